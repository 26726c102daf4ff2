"""Behaviour of the emitted module at its border: stores, blocks, single states, constants, hostile
texts, colliding names.
"""

from __future__ import annotations

import ast
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from campaign import some

from symgen.certify.lagrange import Lagrange
from symgen.description import Robot, load_robot, parse_robot
from symgen.emit.generate import generate_module
from symgen.errors import DescriptionError


def loaded(robot: Robot) -> ModuleType:
    module = ModuleType(robot.name)
    exec(compile(generate_module(robot), robot.name, "exec"), module.__dict__)  # noqa: S102 (our own output)
    return module


@pytest.fixture(scope="module")
def tx40() -> ModuleType:
    return loaded(load_robot("tx40"))


def states(n: int, N: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((3, N, n))


def test_store_is_reused_and_its_zeros_stay(tx40: ModuleType) -> None:
    out = tx40.store(50)
    first = tx40.regressor(*states(6, 50, 1), out=out).copy()
    second = tx40.regressor(*states(6, 50, 2), out=out)
    assert np.shares_memory(second, out)
    assert np.array_equal(second, tx40.regressor(*states(6, 50, 2)))
    assert not np.array_equal(first, second)
    assert not second[:, ~tx40.STRUCTURE.T].any()


def test_layout(tx40: ModuleType) -> None:
    """D is a view on (b, n, N); W is the same store in Fortran order, rows joint-major."""
    out = tx40.store(7)
    D, W = tx40.regressor(*states(6, 7), out=out), tx40.observation_matrix(*states(6, 7), out=out)
    assert D.shape == (7, 6, 60) and W.shape == (42, 60)
    assert W.flags.f_contiguous and np.shares_memory(W, out) and np.shares_memory(D, out)
    assert np.array_equal(W[2 * 7 + 3], D[3, 2])


@pytest.mark.parametrize("wrong", ["zeros", "view", "copy", "size", "empty_like"])
def test_a_store_that_store_did_not_make_is_refused(tx40: ModuleType, wrong: str) -> None:
    made = tx40.store(5)
    out = {
        "zeros": np.zeros((60, 6, 5)),
        "view": made[:, :, :],
        "copy": made.copy(),
        "size": tx40.store(4),
        "empty_like": np.empty_like(made),
    }[wrong]
    with pytest.raises(ValueError, match=r"expected store\(5\)"):
        tx40.regressor(*states(6, 5), out=out)


def test_blocks_do_not_show(tx40: ModuleType) -> None:
    """Around the block length: every sample as when it is evaluated alone."""
    q, qd, qdd = states(6, 8200)
    X = np.random.default_rng(3).standard_normal(60)
    tau = tx40.inverse_dynamics(q, qd, qdd, X)
    for t in (0, 4095, 4096, 8191, 8192, 8199):
        assert np.allclose(
            tau[t], tx40.inverse_dynamics(q[t], qd[t], qdd[t], X), rtol=1e-13, atol=1e-13
        )
    assert tx40.regressor(np.zeros((0, 6)), np.zeros((0, 6)), np.zeros((0, 6))).shape == (0, 6, 60)


def test_one_state_has_no_leading_axis(tx40: ModuleType) -> None:
    q, qd, qdd = (x[0] for x in states(6, 1))
    X = np.ones(60)
    assert tx40.regressor(q, qd, qdd).shape == (6, 60)
    assert tx40.inverse_dynamics(q, qd, qdd, X).shape == (6,)
    assert tx40.inertia_matrix(q, X).shape == (6, 6)
    assert tx40.frame_poses(q).shape == (6, 4, 4)
    assert tx40.jacobian(q).shape == (6, 6)
    assert tx40.jacobian(q, frame=3).shape == (6, 6)
    assert tx40.forward_dynamics(q, qd, qdd, tx40.base_parameters(tx40.VALUES)).shape == (6,)


def test_constants_are_keyword_arguments(tx40: ModuleType) -> None:
    """Calibration needs no new code: another length is another argument, in the regressor and in
    the formulas.
    """
    q, qd, qdd = states(6, 4)
    chi = np.random.default_rng(4).standard_normal(86)
    longer = {"D3": 0.3, "RL4": 0.2, "g": 1.62}
    X = tx40.base_parameters(chi, **longer)
    assert np.allclose(
        tx40.regressor(q, qd, qdd, **longer) @ X,
        tx40.inverse_dynamics(q, qd, qdd, X, **longer),
        rtol=1e-12,
        atol=1e-12,
    )
    assert not np.allclose(X, tx40.base_parameters(chi))


def test_packaged_values_move(tx40: ModuleType) -> None:
    X = tx40.base_parameters(tx40.VALUES)
    A = tx40.inertia_matrix(states(6, 200)[0] * 3, X)
    assert np.allclose(A, A.transpose(0, 2, 1)) and np.linalg.eigvalsh(A).min() > 0


ARM = """
symgen: 1
name: arm
title: '{title}'
gravity: [0, 0, -g]
constants: {{{constant}: 0.5, g: 9.81}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: pi/2, d: {constant}, theta: q2, r: 0}}
  3: {{ant: 2, sigma: 1, alpha: pi/2, d: 0, theta: 0, r: q3}}
elements:
  FS: {{kind: coulomb, along: all}}
"""


def arm(title: str = "arm", constant: str = "L2") -> Robot:
    return parse_robot(ARM.format(title=title, constant=constant).encode(), "arm.yaml")


@pytest.mark.parametrize(
    "title", ["{{ 7*7 }}", "#}{% raw %}", "%s {0} N{{DIGIT ONE}}", "a # b; import os"]
)
def test_titles_stay_text(title: str) -> None:
    """A title cannot add a statement: the syntax tree but for the docstring is that of a plain
    title.
    """

    def code(text: str) -> str:
        tree = ast.parse(text)
        return ast.dump(ast.Module(tree.body[1:], []))

    def without_hash(robot: Robot) -> Robot:
        return replace(robot, sha256="")

    plain, hostile = arm(), arm(title=title.replace("'", "''"))
    assert code(generate_module(without_hash(hostile))) == code(
        generate_module(without_hash(plain))
    )


@pytest.mark.parametrize("constant", ["C2", "W12", "VP13", "S2", "H", "J", "gravity"])
def test_a_constant_may_be_named_as_a_quantity(constant: str) -> None:
    """The module calls its own quantity otherwise; what it returns is that of a robot with another
    name.
    """
    (module, q), plain = (loaded(arm(constant=constant)), states(3, 4)), loaded(arm())
    assert np.array_equal(module.regressor(*q), plain.regressor(*q))
    X = plain.base_parameters(np.arange(1.0, 1 + len(plain.STANDARD_PARAMETERS)))
    assert np.array_equal(module.forward_dynamics(*q, X), plain.forward_dynamics(*q, X))
    assert np.array_equal(module.jacobian(q[0], **{constant: 0.7}), plain.jacobian(q[0], L2=0.7))


FOUR_BAR = """
symgen: 1
name: crank
gravity: [0, -g, 0]
constants: {{L0: 0.45, {constant}: 0.2, L2: 0.5, L3: 0.4, g: 9.81}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, mu: 0, alpha: 0, d: {constant}, theta: q2, r: 0}}
  3: {{ant: 0, sigma: 0, mu: 0, alpha: 0, d: L0, theta: q3, r: 0}}
  4: {{ant: 2, sigma: 0, mu: 0, alpha: 0, d: L2, theta: q4, r: 0}}
  5: {{ant: 3, sigma: 2, alpha: 0, d: L3, theta: 0, r: 0}}
loops: [{{cut: 4, twin: 5, start: {{q1: 1, q2: -0.5518, q3: 1.2956, q4: 0.8475}}}}]
"""


@pytest.mark.parametrize("constant", ["G", "R", "k", "step", "residual", "J", "N", "t"])
@some(3)
def test_a_constant_may_be_named_as_a_local_of_the_loops(constant: str) -> None:
    q = np.linspace(0.8, 1.2, 5)[:, None]
    named = [
        loaded(parse_robot(FOUR_BAR.format(constant=name).encode(), "arm.yaml"))
        for name in (constant, "L1")
    ]
    one, other = (
        m.passive_joints(q, **{m_name: 0.19})
        for m, m_name in zip(named, (constant, "L1"), strict=True)
    )
    assert np.array_equal(one, other)


@pytest.mark.parametrize("constant", ["store", "states", "X", "tau"])
def test_a_constant_that_functions_need_for_themselves_is_refused(constant: str) -> None:
    with pytest.raises(
        DescriptionError, match=f"constant '{constant}' is the name of a reserved word of the"
    ):
        parse_robot(ARM.format(title="", constant=constant).encode(), "arm.yaml")


def test_same_bytes_twice() -> None:
    assert generate_module(load_robot("two_branch")) == generate_module(load_robot("two_branch"))


def chain(n: int) -> Robot:
    """n joints in a row, every fifth prismatic, parallel and perpendicular axes in turn."""
    twist = ("0", "pi/2", "0", "-pi/2", "pi/2")
    rows = []
    for j in range(1, n + 1):
        slides = j % 5 == 0
        place = f"theta: 0, r: q{j}" if slides else f"theta: q{j}, r: 0"
        rows.append(
            f"  {j}: {{ant: {j - 1}, sigma: {int(slides)}, alpha: {twist[j % 5]}, d: "
            f"{'L' if j % 2 else 0}, {place}}}"
        )
    head = (
        f"symgen: 1\nname: chain\ntitle: chain of {n}\nsource: made up\ngravity: [0, -g, "
        f"0]\nconstants: {{L: 0.3, g: 9.81}}\nframes:\n"
    )
    return parse_robot((head + "\n".join(rows)).encode(), "chain.yaml")


def test_more_than_nine_joints_have_separated_indices() -> None:
    """W1_12, not W112; and the module is that of CasADi energies."""
    robot = chain(12)
    text = generate_module(robot)
    assert "W1_12 = " in text and "WP1_11 = " in text and "th1_2 = " in text and "W112" not in text
    module, model = loaded(robot), Lagrange(robot)
    q, qd, qdd = states(12, 3)
    chi = np.random.default_rng(5).standard_normal(len(robot.parameters))
    tau = model.torque(q, qd, qdd, chi)
    found = module.regressor(q, qd, qdd) @ module.base_parameters(chi)
    assert np.abs(found - tau).max() <= 1e-10 * np.abs(tau).max()


GEARED = """
symgen: 1
name: geared
title: three joints in a plane, the third driven from the frame through a belt of ratio KR
gravity: [0, -g, 0]
constants: {L: 0.4, KR: 0.5, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 1, mu: 0, alpha: pi/2, d: L, theta: 0, r: q2}
  3: {ant: 2, sigma: 1, alpha: pi/2, d: 0, theta: 0, r: q3}
constraints: {q2: KR*q3}
elements:
  FV: {kind: viscous, along: {1: q1 + KR*q3, 3: q3}}
  K: {kind: stiffness, form: {3: KR*q3**2 + q1*q3}}
"""


def test_jacobian_and_elements_are_those_of_the_constants_given() -> None:
    """The rate of a passive joint and the row of an element hold a constant: another value of it
    acts as in the robot file.
    """
    module = loaded(parse_robot(GEARED.encode(), "geared.yaml"))
    doubled = loaded(parse_robot(GEARED.replace("KR: 0.5", "KR: 2.0").encode(), "geared.yaml"))
    q = states(2, 5)[0]
    assert np.array_equal(module.jacobian(q, KR=2.0), doubled.jacobian(q)) and not np.array_equal(
        module.jacobian(q), doubled.jacobian(q)
    )
    assert module.elements(KR=2.0) == doubled.ELEMENTS != module.ELEMENTS
    step, h = np.array([0.3, -0.7]), 1e-6
    ahead, behind = (
        module.frame_poses(q + sign * h * step, KR=2.0)[:, -1, :3, 3] for sign in (1, -1)
    )
    assert np.allclose(
        (ahead - behind) / (2 * h), module.jacobian(q, KR=2.0)[:, :3] @ step, atol=1e-8
    )


def test_constants_of_paths_may_be_called_as_locals() -> None:
    """P, J, v are names of lengths and ratios as well."""
    q = states(2, 5)[0]
    expected = loaded(parse_robot(GEARED.encode(), "geared.yaml")).jacobian(q)
    for name in ("P", "J", "v", "k", "rate", "path"):
        renamed = GEARED.replace("KR", name)
        assert np.array_equal(
            loaded(parse_robot(renamed.encode(), "geared.yaml")).jacobian(q), expected
        ), name


ONE = """
symgen: 1
name: one
gravity: [0, -g, 0]
constants: {g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
"""


def test_one_joint_takes_the_shapes_it_means() -> None:
    """(N, 1) or (1,); (N,) is no record of one joint: the error says what is expected."""
    module = loaded(parse_robot(ONE.encode(), "one.yaml"))
    X = np.ones(len(module.BASE_PARAMETERS))
    q = states(1, 5)
    assert module.inverse_dynamics(*q, X).shape == (5, 1) and module.inverse_dynamics(
        *q[:, 0], X
    ).shape == (1,)
    assert module.regressor(*q[:, :0]).shape == (0, 1, len(X))
    for call in (module.regressor, module.observation_matrix):
        with pytest.raises(ValueError, match=r"\(5,\).*expected \(N, 1\)"):
            call(*q[:, :, 0])
    for call in (module.gravity, module.inertia_matrix):
        with pytest.raises(ValueError, match=r"\(5,\).*expected \(N, 1\)"):
            call(q[0, :, 0], X)
    with pytest.raises(ValueError, match=r"\(5,\).*expected \(N, 1\)"):
        module.frame_poses(q[0, :, 0])


def test_states_have_one_shape(tx40: ModuleType) -> None:
    q, qd, qdd = states(6, 5)
    for wrong in (
        (q, qd[:3], qdd),
        (q, qd, qdd[0]),
        (q[:, :5], qd[:, :5], qdd[:, :5]),
        (q[None], qd[None], qdd[None]),
    ):
        with pytest.raises(ValueError, match=r"expected \(N, 6\) each"):
            tx40.regressor(*wrong)


CROSSED = """
symgen: 1
name: crossed
gravity: [0, -g, 0]
constants: {L: 0.4, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: 0, d: L, theta: q2, r: 0}
elements:
  FS: {kind: coulomb, along: {1: q1 + q2, 2: q1 - q2}}
  FV: {kind: viscous, along: {1: q1 - q2, 2: q1 + 2*q2}}
"""


def test_rates_of_the_same_joints_have_names_of_their_own() -> None:
    """Friction along q1 + q2 and along q1 - q2 in one file: a name each, and the values of CasADi
    energies.
    """
    robot = parse_robot(CROSSED.encode(), "crossed.yaml")
    text = generate_module(robot)
    assert (
        "W32 = QP1 + QP2" in text and "QPFS2 = QP1 - QP2" in text and "QPFV2 = QP1 + 2*QP2" in text
    )
    module, model = loaded(robot), Lagrange(robot)
    q, qd, qdd = states(2, 20)
    chi = np.random.default_rng(5).standard_normal(len(robot.parameters))
    assert np.allclose(
        module.regressor(q, qd, qdd) @ module.base_parameters(chi),
        model.torque(q, qd, qdd, chi),
        rtol=1e-11,
        atol=1e-11,
    )
