"""Every model in symbols, evaluated at 20 random states and parameters, equals the emitted module
to 1e-12: closed forms and recursions.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign

import runtime
import symgen
from oracles.exact_zero import valued
from symgen.symbols.symbolic import symbolic

GENERATED = Path(__file__).parents[2] / "generated"
N = 20
SMALL = ("planar_2r", "emps_asymmetric", "scara", "four_bar")
LIMIT = 500  # terms of closed forms that are compared
UP_TO_THREE = (
    "planar_2r",
    "emps",
    "emps_asymmetric",
    "haptic",
    "four_bar",
    "five_bar",
)  # tests/symbols/test_lagrange.py
NAMES = symgen.packaged_robots()
CASES = [name if name in SMALL else pytest.param(name, marks=campaign) for name in NAMES]
MODELS = {
    "inertia_matrix": "q",
    "gravity": "q",
    "bias": "q qd",
    "inverse_dynamics": "q qd qdd",
    "regressor": "q qd qdd",
}


@cache
def states(name: str):
    """(symbolic robot, emitted module, its arguments, values of the symbols): random states near
    those that close the loops.
    """
    robot, module = symgen.load_robot(name), runtime.load_model(name, folder=GENERATED)
    rng, models = np.random.default_rng(7), symbolic(robot)
    relations = models.source.relations
    start = np.array([relations.start.get(j, 0.0) for j in robot.joints])
    q = (
        start + rng.uniform(-0.3, 0.3, (N, len(robot.joints)))
        if relations.tied
        else rng.uniform(-3, 3, (N, len(robot.joints)))
    )
    qd, qdd = rng.standard_normal((2, *q.shape))
    X = rng.standard_normal(len(module.BASE_PARAMETERS))
    values = dict(robot.constants) | dict(zip(module.BASE_PARAMETERS, X, strict=True))
    values |= {
        f"{s}{j}": x[:, k]
        for s, x in (("q", q), ("QP", qd), ("QDP", qdd))
        for k, j in enumerate(robot.joints)
    }
    arguments = {"q": q, "qd": qd, "qdd": qdd}
    return models, module, arguments, X, values


def with_passive(name: str, values, arguments, *, qdd: bool):
    """Positions, velocities and accelerations of tied joints by the emitted Newton iteration; their
    rates from the closure equations in SymPy.
    """
    models, module, _, _, _ = states(name)
    robot, tied = models.source.robot, models.source.relations.tied
    if not tied:
        return values
    found = module.passive_joints(
        arguments["q"], arguments["qd"], arguments["qdd"] if qdd else 0 * arguments["qdd"]
    )
    passive = {
        s: {u: np.asarray(x)[:, robot.passive.index(u)] for u in tied}
        for s, x in zip(("q", "QP", "QDP"), found, strict=True)
    }
    values = values | {f"{s}{u}": x for s, table in passive.items() for u, x in table.items()}
    r = models.closure()
    assert np.abs(valued(r, values)).max() < 1e-9
    J = valued(r.jacobian([models.symbols[f"q{j}"] for j in (*robot.joints, *tied)]), values)
    n = len(robot.joints)
    G = -np.linalg.solve(J[:, :, n:], J[:, :, :n])
    return values | {
        f"G{u}{i}": G[:, a, b] for a, u in enumerate(tied) for b, i in enumerate(robot.joints)
    }


def agrees(found: np.ndarray, expected: np.ndarray) -> None:
    assert found.size == expected.size  # a column of one joint has one axis less
    assert np.abs(found.reshape(expected.shape) - expected).max() <= 1e-12 * max(
        np.abs(expected).max(), 1.0
    )


@pytest.mark.parametrize("name", CASES)
def test_recursions(name: str) -> None:
    models, module, arguments, X, values = states(name)
    for model, needs in MODELS.items():
        steps, result = models.equations(model)
        at = with_passive(name, values, arguments, qdd="qdd" in needs)
        x = [arguments[a] for a in needs.split()]
        expected = getattr(module, model)(*x, *([] if model == "regressor" else [X]))
        agrees(valued(result, at, steps), expected)
    steps, result = models.equations("jacobian")
    at = with_passive(name, values, arguments, qdd=False)
    agrees(valued(result, at, steps), module.jacobian(arguments["q"]))
    poses = module.frame_poses(arguments["q"])
    for f in models.source.robot.frames:
        steps, result = models.equations("pose", of=f.j)
        agrees(valued(result, at, steps), poses[:, f.j - 1])


@pytest.mark.parametrize("name", CASES)
def test_closed_forms(name: str) -> None:
    models, module, arguments, X, values = states(name)
    if models.model("inertia_matrix").closed.size > LIMIT:
        models = symbolic(name, limit=LIMIT)
    for model, needs in MODELS.items():
        try:
            if models.model(model).closed.size > LIMIT:
                continue
        except symgen.SymgenError as e:
            assert "form recursive" in str(e)  # the recursion is compared above
            continue
        at = with_passive(name, values, arguments, qdd="qdd" in needs)
        x = [arguments[a] for a in needs.split()]
        agrees(
            valued(getattr(models, model)(), at),
            getattr(module, model)(*x, *([] if model == "regressor" else [X])),
        )
    at = with_passive(name, values, arguments, qdd=False)
    agrees(valued(models.jacobian(), at), module.jacobian(arguments["q"]))


@pytest.mark.parametrize(
    "name",
    [
        name if name == "scara" else pytest.param(name, marks=campaign)
        for name in NAMES
        if name not in UP_TO_THREE
    ],
)
def test_identities_as_numbers(name: str) -> None:
    """Robots of more than three joints: A symmetric positive, C by recursion with C qd = H - Q - F
    and Ad = C + C', dU/dq = Q. Derivatives by complex steps.
    """
    models, _, arguments, _, values = states(name)
    robot, h = models.source.robot, 1e-30

    def at(model: str, inputs) -> np.ndarray:
        steps, result = models.equations(model)
        return valued(result, inputs, steps)

    A, C, Q = at("inertia_matrix", values), at("coriolis", values), at("gravity", values)
    assert np.abs(A - np.swapaxes(A, 1, 2)).max() <= 1e-12 * np.abs(A).max()
    agrees(
        np.einsum("nij,nj->ni", C, arguments["qd"]) + Q + at("friction", values), at("bias", values)
    )
    agrees(
        np.einsum("nij,nj->ni", A, arguments["qdd"]) + at("bias", values),
        at("inverse_dynamics", values),
    )
    agrees(
        np.einsum("ni,nij,nj->n", arguments["qd"], A, arguments["qd"]) / 2,
        at("kinetic_energy", values),
    )
    moved = values | {f"q{j}": values[f"q{j}"] + 1j * h * values[f"QP{j}"] for j in robot.joints}
    Ad = at("inertia_matrix", moved).imag / h
    assert np.abs(Ad - C - np.swapaxes(C, 1, 2)).max() <= 1e-12 * np.abs(C).max()
    for k, j in enumerate(robot.joints):
        slope = at("potential_energy", values | {f"q{j}": values[f"q{j}"] + 1j * h}).imag / h
        agrees(slope, Q[:, k])


@pytest.mark.parametrize(
    "name",
    [
        name if name in ("four_bar", "scara") else pytest.param(name, marks=campaign)
        for name in NAMES
    ],
)
def test_kinematics_of_any_two_frames(name: str) -> None:
    """Transforms, Jacobians and twists between random pairs of frames, from the poses and Jacobians
    in frame 0 of the emitted module.
    """
    models, module, arguments, _, values = states(name)
    robot, rng = models.source.robot, np.random.default_rng(1)
    at = with_passive(name, values, arguments, qdd=True)
    poses = {0: np.broadcast_to(np.eye(4), (N, 4, 4))} | {
        f.j: module.frame_poses(arguments["q"])[:, f.j - 1] for f in robot.frames
    }
    pairs = [
        (int(rng.integers(1, len(robot.frames) + 1)), int(rng.integers(0, len(robot.frames) + 1)))
        for _ in range(4)
    ]
    for j, i in [*pairs, (robot.frames[-1].j, robot.frames[-1].j)]:
        agrees(valued(models.pose(of=j, frame=i), at), np.linalg.solve(poses[i], poses[j]))
        turned = np.zeros((N, 6, 6))
        turned[:, :3, :3] = turned[:, 3:, 3:] = np.swapaxes(poses[i][:, :3, :3], 1, 2)
        J = turned @ module.jacobian(arguments["q"], frame=j)
        agrees(valued(models.jacobian(of=j, frame=i), at), J)
        agrees(
            valued(models.velocity(of=j, frame=i), at), np.einsum("nij,nj->ni", J, arguments["qd"])
        )
        steps, acceleration = models.equations("acceleration", of=j, frame=i)
        more, rate = models.equations("jacobian_rate", of=j, frame=i)
        if not models.source.relations.tied:
            agrees(
                valued(acceleration, at, steps) - valued(rate, at, more),
                np.einsum("nij,nj->ni", J, arguments["qdd"]),
            )


@pytest.mark.parametrize(
    "name",
    ["tx40", *(pytest.param(name, marks=campaign) for name in ("puma560", "stanford", "sr400"))],
)
def test_determinants(name: str) -> None:
    models, module, arguments, _, values = states(name)
    of = {"sr400": 6}.get(name)
    J = module.jacobian(arguments["q"]) if of is None else module.jacobian(arguments["q"], frame=of)
    agrees(valued(models.determinant(of=of), values), np.linalg.det(J))
