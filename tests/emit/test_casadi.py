"""Functions of emitted modules in CasADi: agreement with NumPy, derivatives against differences,
batches, defaults.
"""

from __future__ import annotations

import ast
from functools import cache
from types import ModuleType

import numpy as np
import pytest
from campaign import sampled

from symgen.cli.generate import emitted
from symgen.description import load_robot, packaged_robots, parse_robot
from symgen.emit.generate import generate_module

GENERAL_LOOPS = {"four_bar", "five_bar"}  # closed by Newton iteration: NumPy only
ROBOTS = [name for name in packaged_robots() if name not in GENERAL_LOOPS]
SAMPLE = sampled(ROBOTS, 4, always=("emps_asymmetric", "haptic", "tx40"))
RESULTS = {
    "regressor": ("D", "q qd qdd"),
    "inverse_dynamics": ("GAM", "q qd qdd X"),
    "inertia_matrix": ("A", "q X"),
    "bias": ("GAM", "q qd X"),
    "gravity": ("GAM", "q X"),
    "jacobian": ("J", "q"),
}


def loaded(name: str, text: str) -> ModuleType:
    module = ModuleType(name)
    exec(compile(text, name, "exec"), module.__dict__)  # noqa: S102 (our own output)
    return module


@cache
def module_of(name: str) -> ModuleType:
    return loaded(name, generate_module(load_robot(name), command=name))


def states(module: ModuleType, N: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Random motion (N, n) and physical parameters: links of a few kg, so that A is positive
    definite.
    """
    rng = np.random.default_rng(seed)
    n = len(module.JOINTS)
    standard = dict.fromkeys(module.STANDARD_PARAMETERS, 0.1) | {
        name: value
        for name in module.STANDARD_PARAMETERS
        for start, value in PHYSICAL.items()
        if name.rstrip("0123456789_") == start
    }
    q, qd, qdd, tau = rng.uniform(-3, 3, (4, N, n))
    return {
        "q": q,
        "qd": qd,
        "qdd": qdd,
        "tau": tau,
        "X": np.asarray(module.base_parameters(standard)),
        "standard": standard,
    }


PHYSICAL = {"XX": 0.3, "YY": 0.31, "ZZ": 0.32, "XY": 0.01, "XZ": 0.02, "YZ": -0.01, "MX": 0.1, "MY": -0.05, "MZ": 0.08, "M": 2.0, "Ia": 0.4,
            "FV": 3.0, "FVM": 0.5, "FS": 2.0, "FSM": 0.4, "OFFSET": 0.2}  # fmt: skip


def by_sample(found: np.ndarray, N: int) -> np.ndarray:
    """Samples side by side (rows, columns*N) to (N, rows, columns)."""
    return found.reshape(found.shape[0], N, -1).transpose(1, 0, 2)


@pytest.mark.parametrize("name", SAMPLE)
def test_agrees_with_numpy(name: str) -> None:
    """To 1e-12 of each column's maximum; batches side by side."""
    numpy = module_of(name)
    N = 40
    x = states(numpy, N)
    for function, (label, columns) in RESULTS.items():
        given = [x[c] for c in columns.split()]
        expected = getattr(numpy, function)(*given)
        found = by_sample(
            numpy.casadi(function)(**{c: x[c].T for c in columns.split()})[label].full(), N
        )
        found = found.reshape(expected.shape)
        scale = np.abs(expected).reshape(-1, expected.shape[-1]).max(axis=0)
        assert (np.abs(found - expected) <= 1e-12 * scale).all(), function
    found = numpy.casadi("frame_poses")(q=x["q"].T)
    for k, T in enumerate(np.moveaxis(numpy.frame_poses(x["q"]), 1, 0), start=1):
        np.testing.assert_allclose(by_sample(found[f"T{k}"].full(), N), T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        numpy.casadi("base_parameters")(standard=list(x["standard"].values()))["X"].full()[:, 0],
        x["X"],
        rtol=1e-13,
    )


@pytest.mark.parametrize("name", SAMPLE)
def test_forward_dynamics_inverts_the_inverse(name: str) -> None:
    """The residual of A qdd = tau - bias, so that the condition of A does not enter."""
    numpy = module_of(name)
    x = states(numpy, 40)
    qdd = (
        numpy.casadi("forward_dynamics")(**{c: x[c].T for c in ("q", "qd", "tau", "X")})["qdd"]
        .full()
        .T
    )
    A = numpy.inertia_matrix(x["q"], x["X"])
    assert (np.linalg.eigvalsh(A) > 0).all()
    torque = numpy.inverse_dynamics(x["q"], x["qd"], qdd, x["X"])
    scale = np.abs(A).sum(axis=2) * np.abs(qdd).max() + np.abs(x["tau"])
    assert (np.abs(torque - x["tau"]) <= 1e-13 * scale).all()
    np.testing.assert_allclose(
        qdd, numpy.forward_dynamics(x["q"], x["qd"], x["tau"], x["X"]), rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize("name", ["haptic", "panda", "sr400"])
def test_frames_and_passive_joints(name: str) -> None:
    numpy = module_of(name)
    x = states(numpy, 9)
    for frame in range(1, numpy.frame_poses(x["q"][0]).shape[0] + 1):
        J = by_sample(numpy.casadi("jacobian", frame=frame)(q=x["q"].T)["J"].full(), 9)
        np.testing.assert_allclose(J, numpy.jacobian(x["q"], frame=frame), rtol=0, atol=1e-12)
    if hasattr(numpy, "PASSIVE"):
        found = numpy.casadi("passive_joints")(**{c: x[c].T for c in ("q", "qd", "qdd")})
        expected = numpy.passive_joints(x["q"], x["qd"], x["qdd"])
        for label, value in zip(("q_passive", "qd_passive", "qdd_passive"), expected, strict=True):
            np.testing.assert_allclose(found[label].full().T, value, rtol=0, atol=1e-12)


def differences(function, column: str, x: dict[str, np.ndarray], result: str) -> np.ndarray:
    """Central differences of a result by one of its inputs, one evaluation of all points side by
    side.
    """
    m, h = len(x[column]), 1e-6
    shifted = x[column][:, None] + np.hstack([h * np.eye(m), -h * np.eye(m)])
    found = function(**(x | {column: shifted}))[result].full()
    return (found[:, :m] - found[:, m:]) / (2 * h)


@pytest.mark.parametrize("name", ["emps_asymmetric", "haptic", "tx40"])
@pytest.mark.parametrize(
    ("model", "result", "columns"),
    [("inverse_dynamics", "GAM", "q qd qdd X"), ("forward_dynamics", "qdd", "q qd tau X")],
)
def test_derivatives(name: str, model: str, result: str, columns: str) -> None:
    """Central differences of step 1e-6: 1e-7 of the largest entry is their own error."""
    numpy = module_of(name)
    drawn = states(numpy, 1, seed=3)
    x = {c: drawn[c].reshape(-1) for c in columns.split()}
    found = numpy.casadi(f"{model}_derivatives")(**x)
    for column in columns.split():
        expected = differences(numpy.casadi(model), column, x, result)
        np.testing.assert_allclose(
            found[f"d{result}_d{column}"].full(),
            expected,
            rtol=0,
            atol=1e-7 * (1 + np.abs(expected).max()),
        )
    if model == "inverse_dynamics":
        np.testing.assert_allclose(
            found["dGAM_dqdd"].full(), numpy.inertia_matrix(x["q"], x["X"]), rtol=0, atol=1e-12
        )
        np.testing.assert_allclose(
            found["dGAM_dX"].full(), numpy.regressor(x["q"], x["qd"], x["qdd"]), rtol=0, atol=1e-11
        )


def test_constants_by_name_and_missing_inputs() -> None:
    numpy = module_of("planar_2r")
    x = states(numpy, 5)
    given = {c: x[c].T for c in ("q", "qd", "qdd", "X")}
    function = numpy.casadi("inverse_dynamics")
    found = function(**given, D2=0.7)["GAM"].full().T
    np.testing.assert_allclose(
        found, numpy.inverse_dynamics(x["q"], x["qd"], x["qdd"], x["X"], D2=0.7), rtol=1e-13
    )
    by_position = function(*given.values(), *numpy.CONSTANTS.values())
    np.testing.assert_array_equal(by_position.full(), function(**given)["GAM"].full())
    del given["qd"]
    assert np.isnan(function(**given)["GAM"].full()).all()


def test_general_loops_have_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert not emitted(["four_bar"], ("casadi",))
    assert (
        "the target casadi is not possible, because the loops of this robot are closed by iteration"
        in capsys.readouterr().err
    )
    assert not hasattr(module_of("four_bar"), "casadi")


def test_what_there_is_not_is_said() -> None:
    with pytest.raises(
        ValueError, match=r"casadi\('energy'\); there is base_parameters, regressor"
    ):
        module_of("planar_2r").casadi("energy")


def test_a_module_imports_numpy_alone_at_load() -> None:
    tree = ast.parse(generate_module(load_robot("tx40")))
    outside = [n for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom)]
    assert [ast.unparse(n) for n in outside] == ["import numpy as np"]


CLASH = b"""
symgen: 1
name: clash
gravity: [0, 0, -g]
constants: {g: 9.81, T1: 0.3}
frames:
  1: {ant: 0, sigma: 0, alpha: pi/2, d: T1, theta: q1, r: 0}
"""


def test_the_name_of_a_result_gives_way_to_a_constant() -> None:
    text = generate_module(parse_robot(CLASH, "clash.yaml"))
    function = loaded("clash", text).casadi("frame_poses")
    assert function.name_in() == ["q", "g", "T1"] and function.name_out() == ["T1_"]
