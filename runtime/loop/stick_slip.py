"""Slip and stick of coupled dry friction in a simulation, and the instant at which a slip stops.

Every Coulomb element of the model acts along a row of G: slip s = G qd, force between -c_minus and
c_plus,

    A qdd = tau - h - G' f,        f = c_plus where s > 0,  -c_minus where s < 0,
            between them where s = 0,

with h of the model without dry friction. At rest, the friction force keeps ds/dt = 0 if such a
force lies between the bounds; else it is the bound itself. These conditions form a linear
complementarity problem, solved by block pivots.

A step ends where a slip changes its sign, and the slip is zero from then on: friction never pushes
along the motion, so that it only takes energy.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from runtime.core.model import GeneratedModel
from runtime.ground.limits import limits
from runtime.loop.dry_friction import DryFriction

LIMIT = limits(__package__)

SX = Any  # casadi.SX


def friction_function(model: GeneratedModel, friction: DryFriction) -> Any:
    """Make the CasADi function that computes the dry friction forces f from the state of the arm.

    (q, qd, tau, Xs, c_plus, c_minus) -> f, direction of every element (-1, 0 stuck, 1), qdd, and
    Y = A^-1 G'.

    Xs : X without dry friction.
    """
    n, m = len(model.JOINTS), len(friction.G)
    q, qd, tau, X = (
        ca.SX.sym("q", n),
        ca.SX.sym("qd", n),
        ca.SX.sym("tau", n),
        ca.SX.sym("X", len(model.BASE_PARAMETERS)),
    )
    plus, minus = ca.SX.sym("plus", m), ca.SX.sym("minus", m)
    G = ca.DM(friction.G)
    A = model.casadi("inertia_matrix")(q=q, X=X)["A"]
    h = model.casadi("bias")(q=q, qd=qd, X=X)["GAM"]
    solved = solve(A, ca.horzcat(tau - h, G.T))
    Y = solved[:, 1:]
    slip = G @ qd
    moving = ca.sign(slip) * (ca.fabs(slip) > LIMIT.SLIP_REST)
    f_moving = kinetic(moving, plus, minus)
    f, mode = _at_rest(G @ Y, G @ (solved[:, 0] - Y @ f_moving), moving, plus, minus)
    f = f + f_moving
    names = ["q", "qd", "tau", "X", "plus", "minus"]
    return ca.Function(
        "friction",
        [q, qd, tau, X, plus, minus],
        [f, moving + mode, solved[:, 0] - Y @ f, Y],
        names,
        ["f", "direction", "qdd", "Y"],
    )


def kinetic(direction: SX, plus: SX, minus: SX) -> SX:
    """Compute the forces, shape (m,), of friction elements that slip; 0 for all others."""
    return (direction > 0) * plus - (direction < 0) * minus


def _at_rest(D: SX, free: SX, moving: SX, plus: SX, minus: SX) -> tuple[SX, SX]:
    """Compute the forces of friction elements at rest, and in which direction each starts to slip.

    Both results have the shape (m,); the direction is 0 if the element stays at rest. ds/dt = free
    - D f.
    """
    m = D.shape[0]
    resting = moving == 0
    mode = ca.SX.zeros(m)
    f = ca.SX.zeros(m)
    for last in [False] * LIMIT.STICK_PIVOTS + [True]:
        held = resting * (mode == 0)
        bound = resting * kinetic(mode, plus, minus)
        f = held * solve(_masked(D, held), held * (free - D @ bound)) + bound
        if last:
            break
        leaving = held * ((f > plus) - (f < -minus))
        rate, slack = free - D @ f, LIMIT.STICK_SLACK * ca.diag(D) * (plus + minus)
        mode = leaving + mode * (mode * rate >= -slack)
    return resting * ca.fmin(ca.fmax(f, -ca.fmax(minus, 0)), ca.fmax(plus, 0)), mode


def _masked(D: SX, rows: SX) -> SX:
    """Keep the rows and columns of D marked in `rows`; set the others to the identity matrix.

    The diagonal becomes slightly larger, since rows of G may depend on each other.
    """
    return (
        ca.diag(rows) @ D @ ca.diag(rows)
        + ca.diag(1 - rows)
        + LIMIT.STICK_EQUAL * ca.diag(ca.diag(D))
    )


def rest_function(friction: DryFriction) -> Any:
    """Make the CasADi function that stops marked friction elements: their slips G qd become zero.

    (qd, Y, at_rest) -> the nearest velocity with these slips zero. The metric is A, so that kinetic
    energy only falls. If a displacement replaces qd, elements that rest over the step do not creep.
    """
    m, n = friction.G.shape
    qd, Y, rows = ca.SX.sym("qd", n), ca.SX.sym("Y", n, m), ca.SX.sym("rows", m)
    G = ca.DM(friction.G)
    impulse = solve(_masked(G @ Y, rows), ca.diag(rows) @ G @ qd)
    return ca.Function(
        "rest", [qd, Y, rows], [qd - Y @ ca.diag(rows) @ impulse], ["qd", "Y", "rows"], ["qd1"]
    )


def event_function(friction: DryFriction) -> Any:
    """Make the CasADi function that ends a step as soon as a slip velocity changes its sign.

    (q, qd, qdd, q1, qd1, h, direction, whole) -> q, qd at the cut, the remaining part of h, and
    which slips are zero at the cut. The slip is taken as quadratic over the step. `whole` = 1 keeps
    the whole step, whatever changes its sign.
    """
    m, n = friction.G.shape
    q, qd, qdd, q1, qd1 = (ca.SX.sym(name, n) for name in ("q", "qd", "qdd", "q1", "qd1"))
    h, direction, whole = ca.SX.sym("h"), ca.SX.sym("direction", m), ca.SX.sym("whole")
    G = ca.DM(friction.G)
    c, b, end = (
        direction * (G @ x) for x in (qd, qdd * h, qd1)
    )  # direction*slip = c + b x + a x**2, x from 0 to 1
    crossing = end < -LIMIT.SLIP_REST
    x = ca.vertcat(*(ca.if_else(crossing[k], _root(c[k], b[k], end[k]), 1) for k in range(m)))
    first = ca.if_else(whole, 1, ca.mmin(x)) if m else ca.SX(1)
    bend = qd1 - qd - qdd * h
    cubic = q + h * (qd * first + qdd * h * first**2 / 2 + bend * first**3 / 3)
    at_end = q + h * (qd + qdd * h / 2 + bend / 3)
    qx = cubic + (q1 - at_end) * first**4
    qdx = qd + qdd * h * first + bend * first**2
    stopped = crossing * ca.logic_or(whole, x <= first * (1 + LIMIT.STICK_EQUAL))
    at_rest = ca.logic_or(direction == 0, stopped)
    names = ["q", "qd", "qdd", "q1", "qd1", "h", "direction", "whole"]
    inputs = [q, qd, qdd, q1, qd1, h, direction, whole]
    return ca.Function(
        "event",
        inputs,
        [qx, qdx, h * (1 - first), at_rest],
        names,
        ["qx", "qdx", "left", "at_rest"],
    )


def _root(c: SX, b: SX, end: SX) -> SX:
    """Find the first x in [0, 1] at which c + b x + a x**2 falls below zero.

    The polynomial is c >= 0 at x = 0 and `end` < 0 at x = 1.
    """
    a = end - b - c
    root = ca.sqrt(ca.fmax(b**2 - 4 * a * c, 0))
    rising = (b + root) / ca.fmax(-2 * a, 1e-300)
    falling = 2 * c / ca.fmax(root - b, 1e-300)
    return ca.fmin(ca.fmax(ca.if_else(b > 0, rising, falling), 0), 1)


def solve(A: SX, B: SX) -> SX:
    """Compute A^-1 B from the factors A = L diag(d) L'; A is symmetric positive definite.

    L is unit lower triangular.
    """
    n = A.shape[0]
    L, d = ca.SX.eye(n), [A[j, j] for j in range(n)]
    rows = [B[j, :] for j in range(n)]
    for j in range(n):
        for k in range(j):
            d[j] -= L[j, k] ** 2 * d[k]
            rows[j] -= L[j, k] * rows[k]
        for i in range(j + 1, n):
            L[i, j] = (A[i, j] - sum(L[i, k] * L[j, k] * d[k] for k in range(j))) / d[j]
    rows = [rows[j] / d[j] for j in range(n)]
    for j in range(n - 1, -1, -1):
        for i in range(j + 1, n):
            rows[j] -= L[i, j] * rows[i]
    return ca.vertcat(*rows) if n else B
