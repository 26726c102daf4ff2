"""Closed forms against Lagrange's equations worked out in SymPy from the frame table alone, and
identities of mechanics: all by difference zero.

T_0j = prod Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r),   E = sum 1/2 tr(Td Sigma Td'),   U = -g' T Sigma e4
"""

from __future__ import annotations

import pytest
import sympy
from campaign import campaign
from sympy import Matrix, cos, sin

import symgen
from oracles.exact_zero import are_zero, is_zero
from symgen.derive.loops import close
from symgen.symbols.symbolic import symbolic

RPR = b"""
symgen: 1
name: rpr
gravity: [gx, 0, -g]
constants: {D2: 0.3, L3: 0.2, a: 0.4, gx: 1.0, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0,     d: 0,  theta: q1, r: 0}
  2: {ant: 1, sigma: 1, alpha: a,     d: D2, theta: 0,  r: q2, gamma: pi/2, b: L3}
  3: {ant: 2, sigma: 0, alpha: -pi/2, d: 0,  theta: q3 + pi/2, r: L3}
elements:
  Ia: {kind: inertia, along: {1: q1 + 2*q3, 2: q2}}
  K:  {kind: stiffness, along: {3: q3}}
  FV: {kind: viscous, along: {3: q3}}
  OFFSET: {kind: offset, along: {1: q1}}
"""
ROBOTS = {
    "rpr": symgen.parse_robot(RPR, "rpr.yaml"),
    **{
        name: symgen.load_robot(name) for name in ("planar_2r", "emps", "emps_asymmetric", "haptic")
    },
}
LOOPS = {
    name: symgen.load_robot(name) for name in ("four_bar", "five_bar")
}  # passive joints are symbols
SLOW = [
    name if name in ("planar_2r", "emps", "emps_asymmetric") else pytest.param(name, marks=campaign)
    for name in ROBOTS
]

IDENTITIES = [("planar_2r", "base"), ("emps_asymmetric", "standard")]
IDENTITIES += [
    pytest.param(name, kind, marks=campaign)
    for name, kind in (
        ("planar_2r", "standard"),
        ("rpr", "base"),
        ("rpr", "standard"),
        ("haptic", "base"),
    )
]


def real(name: str):
    return sympy.Symbol(name, real=True)


def number(e):
    """A constant of the frame table."""
    text = str(e)
    return sympy.sympify(text, locals={s: real(s) for s in e.symbols}, rational=True)


def screw(axis: int, angle, shift) -> Matrix:
    T, u, v = sympy.eye(4), (axis + 1) % 3, (axis + 2) % 3
    T[u, u], T[u, v], T[v, u], T[v, v], T[axis, 3] = (
        cos(angle),
        -sin(angle),
        sin(angle),
        cos(angle),
        shift,
    )
    return T


def lagrange(robot) -> tuple[Matrix, object, object]:
    """(Gamma in the actuated joints without friction, E, U): standard parameters; loops by their
    linear relations, or rates Gui of tied joints.
    """
    relations = close(robot)
    q = {i: real(f"q{i}") for i in relations.independent}
    at = {
        j: sum((number(g) * q[i] for i, g in relations.row[j].items()), number(relations.offset[j]))
        for j in robot.moving
    }
    qd, qdd = ({i: real(f"{s}{i}") for i in q} for s in ("QP", "QDP"))
    T, E, U = {0: sympy.eye(4)}, 0, 0
    for f in robot.frames:
        theta, r = (number(x) for x in (f.theta0, f.r0))
        theta, r = (
            (theta + at[f.j], r)
            if f.sigma == 0
            else (theta, r + at[f.j])
            if f.sigma == 1
            else (theta, r)
        )
        T[f.j] = (
            T[f.ant]
            * screw(2, number(f.gamma), number(f.b))
            * screw(0, number(f.alpha), number(f.d))
            * screw(2, theta, r)
        )
    gravity = Matrix([*(number(e) for e in robot.gravity), 0])
    for j in robot.links:
        XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = (
            real(f"{p}{j}") for p in ["XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M"]
        )
        S = Matrix(
            [
                [(YY + ZZ - XX) / 2, -XY, -XZ, MX],
                [-XY, (XX + ZZ - YY) / 2, -YZ, MY],
                [-XZ, -YZ, (XX + YY - ZZ) / 2, MZ],
                [MX, MY, MZ, M],
            ]
        )
        Td = sum((T[j].diff(x) * qd[i] for i, x in q.items()), sympy.zeros(4, 4))
        E += (Td * S * Td.T).trace() / 2
        U -= (gravity.T * T[j] * S)[0, 3]
    for e in robot.elements:
        for j in e.along:
            s = sum(number(g) * at[i] for i, g in e.along[j].items())
            sd = sum(s.diff(q[i]) * qd[i] for i in q)
            c = real(f"{e.family}{j}")
            E += c * sd**2 / 2 if e.kind == "inertia" else 0
            U += c * s**2 / 2 if e.kind == "stiffness" else c * s if e.kind == "offset" else 0
    rows = {}
    for i, x in q.items():
        p = E.diff(qd[i])
        rows[i] = (
            sum(p.diff(q[k]) * qd[k] + p.diff(qd[k]) * qdd[k] for k in q) - E.diff(x) + U.diff(x)
        )
    return (
        Matrix(
            [
                rows[i] + sum(real(f"G{u}{i}") * rows[u] for u in relations.tied)
                for i in robot.joints
            ]
        ),
        E,
        U,
    )


@pytest.mark.parametrize("name", [*SLOW, *(pytest.param(name, marks=campaign) for name in LOOPS)])
def test_lagrange(name: str) -> None:
    robot = (ROBOTS | LOOPS)[name]
    gamma, E, U = lagrange(robot)
    models = symbolic(robot, parameters="standard")
    assert is_zero(models.kinetic_energy() - E)
    assert is_zero(models.potential_energy() - U)
    assert are_zero(models.inverse_dynamics() - models.friction() - gamma)


@pytest.mark.parametrize(("name", "kind"), IDENTITIES)
def test_identities(name: str, kind: str) -> None:
    """A is symmetric and d2E/dqd2; Ad - 2C is skew symmetric; dU/dq = Q; Gamma = A qdd + C qd + Q +
    friction = D chi; H = Gamma at qdd = 0.
    """
    models = symbolic(ROBOTS[name], parameters=kind, passive="functions")
    q, qd, qdd = (Matrix(x) for x in (models.q, models.qd, models.qdd))
    A, C, Q, F = models.inertia_matrix(), models.coriolis(), models.gravity(), models.friction()
    assert A == A.T and are_zero(sympy.hessian(models.kinetic_energy(), list(qd)) - A)
    Ad = sum((A.diff(x) * v for x, v in zip(q, qd, strict=True)), sympy.zeros(len(q)))
    assert are_zero((Ad - 2 * C) + (Ad - 2 * C).T)
    dA = [A.diff(x) for x in q]
    christoffel = [
        [
            sum((dA[k][i, j] + dA[j][i, k] - dA[i][j, k]) * v for k, v in enumerate(qd)) / 2
            for j in range(len(q))
        ]
        for i in range(len(q))
    ]
    assert are_zero(Matrix(christoffel) - C)
    assert are_zero(Matrix([models.potential_energy()]).jacobian(q).T - Q)
    gamma = models.inverse_dynamics()
    assert are_zero(A * qdd + C * qd + Q + F - gamma)
    assert are_zero(models.bias() - gamma.subs(dict.fromkeys(qdd, 0)))
    assert are_zero(models.regressor() * Matrix(models.parameters) - gamma)


@pytest.mark.parametrize("name", ["planar_2r", "emps", pytest.param("haptic", marks=campaign)])
def test_base_parameters_give_the_torques_of_standard_ones(name: str) -> None:
    base, standard = (symbolic(ROBOTS[name], parameters=kind) for kind in ("base", "standard"))
    made_of = base.base_parameters()
    assert are_zero(
        base.inverse_dynamics().subs(made_of, simultaneous=True) - standard.inverse_dynamics()
    )
    assert base.inverse_dynamics().free_symbols & {x for x, e in made_of.items() if x != e}


@pytest.mark.parametrize("name", ["emps", pytest.param("planar_2r", marks=campaign)])
def test_direct_model_solves_the_inverse_one(name: str) -> None:
    models = symbolic(ROBOTS[name])
    torque = Matrix([models.symbols[f"GAM{j}"] for j in ROBOTS[name].joints])
    inverse = models.inverse_dynamics().subs(
        dict(zip(models.qdd, models.forward_dynamics(), strict=True)), simultaneous=True
    )
    below = models.inertia_matrix().det()
    for e in inverse - torque:
        assert is_zero(sympy.numer(sympy.together(e))) and not is_zero(below)


@pytest.mark.parametrize("name", ["planar_2r", pytest.param("rpr", marks=campaign)])
def test_kinematics(name: str) -> None:
    """J of the origin is its derivative, V = J qd, Jd qd its derivative in space, VP = J qdd + Jd
    qd, in frame 0; in other frames turned.
    """
    robot = ROBOTS[name]
    models = symbolic(robot)
    q, qd, qdd = (Matrix(x) for x in (models.q, models.qd, models.qdd))
    last = robot.frames[-1].j
    J, T = models.jacobian(), models.pose()
    assert are_zero(T[:3, 3].jacobian(q) - J[:3, :])
    rate = sum((T[:3, :3].diff(x) * v for x, v in zip(q, qd, strict=True)), sympy.zeros(3))
    w = J[3:, :] * qd
    assert are_zero(
        rate - Matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]) * T[:3, :3]
    )
    Jd = sum((J.diff(x) * v for x, v in zip(q, qd, strict=True)), sympy.zeros(6, len(q)))
    assert are_zero(models.velocity() - J * qd) and are_zero(models.jacobian_rate() - Jd * qd)
    assert are_zero(models.acceleration() - J * qdd - Jd * qd)
    for i in range(last + 1):
        A = models.pose(of=i)[:3, :3]
        turned = sympy.diag(A, A)
        assert are_zero(turned * models.jacobian(frame=i) - J) and are_zero(
            turned * models.velocity(frame=i) - J * qd
        )
        for j in range(last + 1):
            assert are_zero(models.pose(of=i) * models.pose(of=j, frame=i) - models.pose(of=j))
