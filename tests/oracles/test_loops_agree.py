"""Emitted models of mechanisms with loops against two routes: Lagrange multipliers, and the open
tree with numerically solved loops.

Tolerance 1e-10 of the largest entry, of every (joint, column) for regressors; loops close to 1e-12
(metres, direction cosines).
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from campaign import sampled, some

from oracles.multipliers import Multipliers
from oracles.random_parallelograms import SEEDS, random_parallelogram
from oracles.random_robots import random_parameters
from symgen.certify.certificate import certify_formulas
from symgen.certify.lagrange import Lagrange
from symgen.derive.loops import close as close_loops
from symgen.description import load_robot
from symgen.description.expression import Expression
from symgen.description.grammar import parse
from symgen.description.robot import REVOLUTE, Robot
from symgen.emit.python_target import render
from symgen.emit.spec import module_spec
from symgen.regroup.regrouping import EXACT, Regrouping, regroup

Array = np.ndarray[Any, Any]
GENERAL = ("four_bar", "five_bar")
PACKAGED = ("haptic", "sr400", *GENERAL)
NAMES = (*PACKAGED, *(f"parallelogram_{seed}" for seed in SEEDS))
SAMPLE = sampled(NAMES, 10, always=PACKAGED)
PARALLELOGRAMS = [case for case in SAMPLE if case not in GENERAL]
Emitted = Callable[[str], ModuleType]


@cache
def robot_of(name: str) -> Robot:
    return (
        load_robot(name) if name in PACKAGED else random_parallelogram(int(name.rpartition("_")[2]))
    )


@cache
def regrouped(name: str) -> Regrouping:
    """General loops take seconds: once per session."""
    return regroup(robot_of(name))


@pytest.fixture(scope="session")
def emitted(tmp_path_factory: pytest.TempPathFactory) -> Emitted:
    folder, modules = tmp_path_factory.mktemp("loops"), {}

    def load(name: str) -> ModuleType:
        if name not in modules:
            path = folder / f"{name}.py"
            path.write_text(render(module_spec(regrouped(name))), encoding="utf-8")
            spec = importlib.util.spec_from_file_location(name, path)
            assert spec is not None and spec.loader is not None
            modules[name] = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(modules[name])
        return modules[name]

    return load


def equal(a, b) -> None:
    """Equal to 1e-10 of the largest entry; of every column (all samples, all joints) for arrays of
    more than two axes.

    Floor 1e-2: a column that the loop nearly cancels has the rounding of the forces in its bars, of
    order 1 to 10 per unit parameter.
    """
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape
    axis = (0, 1) if b.ndim > 2 else None
    largest = np.maximum(np.abs(b).max(axis=axis), 1e-2)
    defect = (np.abs(a - b).max(axis=axis) / largest).max()
    assert defect <= 1e-10, f"{defect:.2e} of the largest entry"


def positions(robot: Robot, samples: int, seed: int) -> Array:
    """Actuated joints: anywhere for parallelograms and for the crank of the four-bar, near the
    start for the five-bar.
    """
    rng = np.random.default_rng([24, seed])
    start = {j: x for loop in robot.loops for j, x in loop.start.items()}
    near = len(robot.joints) > 1 and start
    reach = [
        0.5 if near else np.pi if robot.frame(j).sigma == REVOLUTE else 1.0 for j in robot.joints
    ]
    return (
        np.array([start.get(j, 0.0) for j in robot.joints])
        + rng.uniform(-1, 1, (samples, len(reach))) * reach
    )


def whole(robot: Robot, actuated: Array, passive: Array) -> Array:
    """All moving joints, order `robot.moving`."""
    q = np.empty((*actuated.shape[:-1], len(robot.moving)))
    q[..., [robot.moving.index(j) for j in robot.joints]] = actuated
    q[..., [robot.moving.index(j) for j in robot.passive]] = passive
    return q


def regular_states(
    module: ModuleType, robot: Robot, model: Lagrange, samples: int
) -> tuple[tuple[Array, Array, Array], Multipliers]:
    """q, qd, qdd (N, n) and the oracle there: its loops are solved anew from 0.01 rad or m beside.

    Of ten times as many states those farthest from singular ones, where Newton from beside is sure
    and magnifies rounding least.
    """
    q, rng = positions(robot, 10 * samples, seed=5), np.random.default_rng(6)
    at = whole(robot, q, module.passive_joints(q))
    zero = np.zeros((1, q.shape[1]))
    keep = np.argsort(Multipliers(robot, at[:1], zero, zero, model).regularity(at))[-samples:]
    qd, qdd = rng.standard_normal((2, samples, q.shape[1]))
    beside = at[keep]
    beside[:, [robot.moving.index(j) for j in robot.passive]] += 0.01 * rng.uniform(
        -1, 1, (samples, len(robot.passive))
    )
    return (q[keep], qd, qdd), Multipliers(robot, beside, qd, qdd, model)


@pytest.mark.parametrize("name", SAMPLE)
@some(3)
def test_module_against_multipliers(name: str, emitted: Emitted) -> None:
    robot, module = robot_of(name), emitted(name)
    model = Lagrange(robot)
    (q, qd, qdd), oracle = regular_states(module, robot, model, samples=6)
    moving = [
        whole(robot, a, p)
        for a, p in zip((q, qd, qdd), module.passive_joints(q, qd, qdd), strict=True)
    ]
    assert oracle.defect(moving[0]).max() < 1e-12
    for found, expected in zip(moving, (oracle.q, oracle.qd, oracle.qdd), strict=True):
        equal(found, expected)
    chi = random_parameters(robot, seed=7)
    X, D, tau, full = (
        module.base_parameters(chi),
        module.regressor(q, qd, qdd),
        oracle.torque(chi),
        oracle.regressor(),
    )
    K = np.array([module.base_parameters(unit) for unit in np.eye(len(chi))]).T  # X = K chi
    assert robot.parameters == module.STANDARD_PARAMETERS
    equal(oracle.projected_regressor(), full)  # the two oracles
    equal(D, full[:, :, [robot.parameters.index(own) for own in regrouped(name).own]])
    equal(D @ K, full)
    equal(D @ X, tau)
    equal(module.observation_matrix(q, qd, qdd) @ X, tau.T.ravel())
    equal(module.inverse_dynamics(q, qd, qdd, X), tau)
    equal(module.inverse_dynamics(q[0], qd[0], qdd[0], X), tau[0])
    equal(module.inertia_matrix(q, X), A := oracle.inertia_matrix(chi))
    equal(module.bias(q, qd, X), tau - (A @ qdd[..., None])[..., 0])
    equal(module.gravity(q, X), oracle.gravity(chi))
    equal(module.frame_poses(q), model.poses(oracle.q))
    for frame in robot.frames:
        equal(module.jacobian(q, frame=frame.j), model.jacobian(oracle.q, frame.j) @ oracle.rates)
    assert (
        np.all(np.linalg.eigvalsh(A) > 0)
        or robot.massless
        or not any(e.kind == "inertia" for e in robot.elements)
    )
    if np.linalg.cond(A).max() < 1e4:
        equal(module.forward_dynamics(q, qd, tau, X), qdd)
    assert not D[:, ~np.array(module.STRUCTURE).T].any()


@pytest.mark.parametrize("name", SAMPLE)
def test_certificate(name: str) -> None:
    certificate = certify_formulas(regrouped(name))
    assert certificate.valid, certificate.failures


RELATIONS = {
    "haptic": {"q3": "q5 - q2 + pi", "q4": "c - q5", "q6": "q2 - q5", "q7": "q5 - q2 + pi"},
    "sr400": {"q3": "q7 - q2 + pi/2", "q8": "q2 - q7", "q9": "q7 - q2 + pi"},
}


@pytest.mark.parametrize("name", PACKAGED)
def test_module_against_open_tree_closed_by_newton(name: str, emitted: Emitted) -> None:
    """The loops of the packaged robots, solved by the tree itself from the relations of their
    sources or from `start`.
    """
    robot, module = robot_of(name), emitted(name)
    written = {int(q[1:]): parse(text) for q, text in RELATIONS.get(name, {}).items()}
    model = Lagrange(replace(robot, constraints=written))
    q, rng = positions(robot, 10, seed=8), np.random.default_rng(9)
    if name in GENERAL:  # within the reach of Newton from `start`
        start = close_loops(robot).start
        q = np.array([start[j] for j in robot.joints]) + 0.4 * rng.uniform(-1, 1, q.shape)
    qd, qdd = rng.standard_normal((2, *q.shape))
    K = np.array([module.base_parameters(unit) for unit in np.eye(len(robot.parameters))]).T
    equal(module.regressor(q, qd, qdd) @ K, model.actuated_regressor(q, qd, qdd))


@pytest.mark.parametrize("name", PARALLELOGRAMS)
def test_never_an_antiparallelogram(name: str, emitted: Emitted) -> None:
    """Opposite sides keep their orientation to each other through every state, flat ones included;
    the loops close to 1e-12.
    """
    robot, module = robot_of(name), emitted(name)
    q = positions(robot, 400, seed=10)
    T = module.frame_poses(q)
    for loop in robot.loops:
        a, b = T[:, loop.cut - 1], T[:, loop.twin - 1]
        assert np.abs(a - b).max() < 1e-12
        bar = robot.frame(loop.cut).ant
        lever = robot.frame(loop.twin).ant
        for side, other in ((bar, robot.frame(lever).ant), (robot.frame(bar).ant, lever)):
            turn = [np.eye(3) if j == 0 else T[:, j - 1, :3, :3] for j in (side, other)]
            relative = np.broadcast_to(np.swapaxes(turn[0], -1, -2) @ turn[1], (len(q), 3, 3))
            assert np.abs(relative - relative[0]).max() < 1e-12


def crank_record(samples: int = 3000, turns: float = 5.0) -> tuple[Array, Array, Array]:
    """A crank that turns `turns` times at a wavering speed; q, qd, qdd of shape (samples, 1)."""
    t = np.linspace(0.0, 10.0, samples)[:, None]
    w = 2 * np.pi * turns / 10
    return 0.4 + w * t + 0.3 * np.sin(1.7 * t), w + 0.51 * np.cos(1.7 * t), -0.867 * np.sin(1.7 * t)


def five_bar_record(samples: int = 3000) -> tuple[Array, Array, Array]:
    t = np.linspace(0.0, 10.0, samples)[:, None]
    a, w, phase = np.array([0.6, 0.5]), np.array([2.1, 3.3]), np.array([0.0, 0.7])
    return (
        np.array([2.2, 0.9]) + a * np.sin(w * t + phase),
        a * w * np.cos(w * t + phase),
        -a * w**2 * np.sin(w * t + phase),
    )


RECORDS = {"four_bar": crank_record, "five_bar": five_bar_record}
APEX = {
    "four_bar": 4,
    "five_bar": 5,
}  # cut joint: the angle between the last two bars keeps its sign in one assembly mode


@pytest.mark.parametrize("name", GENERAL)
def test_general_loop_along_a_record(name: str, emitted: Emitted) -> None:
    """Closed at every sample, continuous, always in the mode of `start`, with the rates that
    differences of the positions show.
    """
    robot, module = robot_of(name), emitted(name)
    q, qd, qdd = RECORDS[name]()
    h = 10.0 / (len(q) - 1)
    p, pd, pdd = module.passive_joints(q, qd, qdd)
    T = module.frame_poses(q)
    loop = robot.loops[0]
    assert np.abs(T[:, loop.cut - 1] - T[:, loop.twin - 1]).max() < 1e-12
    assert np.abs(np.diff(p, axis=0)).max() <= 1.1 * h * np.abs(pd).max()
    apex = robot.passive.index(APEX[name])
    assert np.all(np.sin(p[:, apex]) * np.sin(close_loops(robot).start[APEX[name]]) > 0)
    # Central differences, error h**2/6 times the third derivative, below 2e3 s**-3 here.
    assert np.abs((p[2:] - p[:-2]) / (2 * h) - pd[1:-1]).max() < 2e3 * h**2 / 6
    assert np.abs((pd[2:] - pd[:-2]) / (2 * h) - pdd[1:-1]).max() < 2e4 * h**2 / 6


@pytest.mark.parametrize("name", GENERAL)
def test_general_loop_in_any_order(name: str, emitted: Emitted) -> None:
    """A shuffled record gives the same states as the record, one state the same as many."""
    robot, module = robot_of(name), emitted(name)
    q = RECORDS[name]()[0]
    order = np.random.default_rng(11).permutation(len(q))
    along, shuffled = module.passive_joints(q), module.passive_joints(q[order])
    assert np.abs(along[order] - shuffled).max() < 1e-11
    assert np.abs(module.passive_joints(q[1234]) - along[1234]).max() < 1e-11
    assert module.passive_joints(q[:0]).shape == (0, len(robot.passive))


def newton_passes(
    module: ModuleType, q: Array, monkeypatch: pytest.MonkeyPatch
) -> tuple[float, int]:
    """Newton steps per sample: (mean, of all `_newton` calls on the way; largest number that the
    samples themselves needed).

    A pass is one evaluation of `_linearised_closure_block` followed by a step; the evaluation that finds the
    loops closed is none.
    """
    passes: list[tuple[int, int]] = []
    newton, block = module._newton, module._linearised_closure_block
    evaluations = [0]

    def counted_block(*arguments):
        evaluations[0] += 1
        return block(*arguments)

    def counted_newton(states, *arguments):
        evaluations[0] = 0
        result = newton(states, *arguments)
        passes.append((len(states), evaluations[0] - 1))  # len(states) <= 8192: one block
        return result

    monkeypatch.setattr(module, "_linearised_closure_block", counted_block)
    monkeypatch.setattr(module, "_newton", counted_newton)
    module.passive_joints(q)
    monkeypatch.undo()
    return sum(size * count for size, count in passes) / len(q), passes[-1][1]


@pytest.mark.parametrize("name", GENERAL)
def test_newton_passes(name: str, emitted: Emitted, monkeypatch: pytest.MonkeyPatch) -> None:
    """At most 5 per sample on a smooth record, those of the samples followed from `start` included."""
    mean, last = newton_passes(emitted(name), RECORDS[name]()[0], monkeypatch)
    assert mean <= 5 and last <= 5, (mean, last)


def test_loop_that_does_not_close(emitted: Emitted) -> None:
    """A longer crank cannot turn: the first samples close, the others are named with their
    residual.
    """
    module = emitted("four_bar")
    q = np.linspace(1.0, 3.1, 200)[:, None]
    with pytest.raises(
        ValueError, match=r"does not close at sample \d+: residual [\d.e-]+ at q = "
    ):
        module.inverse_dynamics(q, 0 * q, 0 * q, np.ones(len(module.BASE_PARAMETERS)), L1=0.6)
    with pytest.raises(ValueError, match="does not close at sample 2:"):
        module.passive_joints(np.array([[1.0], [1.1], [3.1], [1.2]]), L1=0.6)
    five = emitted("five_bar")
    with pytest.raises(ValueError, match=r"does not close .*at sample 1:"):
        five.passive_joints(np.array([[2.2, 0.9], [np.pi, 0.0]]))


def test_singular_configuration(emitted: Emitted) -> None:
    """Dead point of a four-bar whose crank cannot turn: coupler and rocker in one line."""
    module = emitted("four_bar")
    L = {
        "L0": 0.45,
        "L1": 0.35,
        "L2": 0.3,
        "L3": 0.4,
    }  # outstretched where crank end and rocker pivot are L2 + L3 apart
    dead = np.arccos(
        (L["L0"] ** 2 + L["L1"] ** 2 - (L["L2"] + L["L3"]) ** 2) / (2 * L["L0"] * L["L1"])
    )
    q = np.array([[1.0], [1.4], [dead], [1.2]])
    with pytest.raises(ValueError, match="singular configuration at sample 2"):
        module.passive_joints(q, **L)
    module.passive_joints(q[[0, 1, 3]], **L)


# --- the four-bar of the theory notes
# ---------------------------------------------------------------------------------


def test_four_bar_formula() -> None:
    """D_MX3 = (L1^2 D_ZZ1 + L1 D_MX1 + L2^2 D_ZZ2 + L2 D_MX2)/L3 - L3 D_ZZ3, x axes along the bars:
    symbolically.
    """
    regrouping = regrouped("four_bar")
    assert regrouping.method == EXACT
    row = {b.own: b.combination["MX3"] for b in regrouping.base if "MX3" in b.combination}
    expected = {"ZZ1": "L1**2/L3", "MX1": "L1/L3", "ZZ2": "L2**2/L3", "MX2": "L2/L3", "ZZ3": "-L3"}
    assert row == {own: parse(text) for own, text in expected.items()}


@pytest.mark.parametrize(("own", "standard"), [("ZZ1", "MX3"), ("ZZ3", "MX3"), ("MX1", "M2")])
def test_certificate_catches_a_wrong_coefficient(own: str, standard: str) -> None:
    """A sign, and a factor of 1 + 1e-12."""
    regrouping = regrouped("four_bar")
    for factor in (Expression.number(-1), Expression.number("1.000000000001")):
        base = tuple(
            replace(
                b,
                combination={
                    k: c * factor if (b.own, k) == (own, standard) else c
                    for k, c in b.combination.items()
                },
            )
            for b in regrouping.base
        )
        certificate = certify_formulas(replace(regrouping, base=base))
        assert not certificate.valid and any(
            standard in failure for failure in certificate.failures
        )
