"""Base columns of the regressor and their regrouping coefficients, computed in floating point.

The coefficients hold for the constants of the robot file. They are used for relations that are not
recognised modulo primes, and for loops that cannot be closed exactly modulo a prime, such as
spatial loops. Dependent columns are found at random states, which Newton's method closes near the
start configuration of the loops.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from symgen.derive.derivation import derive
from symgen.derive.exact import Array
from symgen.derive.graph import Floats, Symbol, interpret, states_of
from symgen.derive.loop_equations import LoopSystem, loop_system
from symgen.derive.loops import close
from symgen.description.expression import Expression
from symgen.description.robot import PRISMATIC, Robot
from symgen.errors import DescriptionError, SymgenError
from symgen.regroup.states import states_for

# singular values of unit columns: those below are rounding where a gap says so, at most here
LARGEST_ROUNDING, SMALLEST = 1e-9, 1e-14
# coefficients between unit columns that may be left out, first the largest, where the column stays
# the same to KEPT without them; nearly dependent base columns have small ones that count
NEGLIGIBLE, KEPT = (1e-6, 1e-8, 1e-10, 1e-12), 1e-13
OVERFLOWS = 1e100  # its square is a number
SPREAD, MOST_STATES = 0.8, 4000  # rad about the start, and of half the longest length for slides
DECADES = -3.5, 1.0  # decades of the velocities at which laws are compared
Relations = dict[str, dict[str, Expression]]  # {dependent: {base column: coefficient}}


def float_relations(robot: Robot, names: Sequence[str]) -> tuple[tuple[str, ...], Relations]:
    """Find the base columns of the regressor in floating point, and write the other columns as
    combinations of base columns.

    `names` are the columns in order of preference. Return the base columns and {dependent column:
    {base column: coefficient}}.
    """
    pivots, K = float_base(float_regressor(robot, names))
    base = tuple(names[c] for c in pivots)
    return base, {
        name: {base[k]: _number(K[k, c]) for k in np.flatnonzero(K[:, c])}
        for c, name in enumerate(names)
        if c not in pivots
    }


def numeric_coefficients(robot: Robot, name: str, support: Sequence[str]) -> list[Expression]:
    """Write regressor column `name` as a combination of the columns `support`, by least squares.

    Return beta in D_name = sum_k beta_k D_support,k.
    """
    W = float_regressor(robot, (*support, name))
    size = np.linalg.norm(W[:, :-1], axis=0)
    beta = np.linalg.lstsq(W[:, :-1] / size, W[:, -1], rcond=None)[0] / size
    return [_number(x) for x in beta]


def _number(x: float) -> Expression:
    return Expression.number(repr(float(x)))


def float_regressor(robot: Robot, names: Sequence[str]) -> Array:
    """Compute the regressor columns `names` at enough random states to show their rank.

    The result has shape (joints * states, columns).
    """
    closure, rng = close(robot), np.random.default_rng(41)
    if not closure.tied:
        count = states_for(robot, names)
        if any(e.is_own for e in robot.elements):  # which bend and jump
            count *= 6
        drawn = rng.uniform(-1, 1, (3, len(robot.moving), count))
        if any(e.is_own for e in robot.elements):
            drawn[0] *= np.pi
            drawn[1] *= 10 ** rng.uniform(*DECADES, drawn[1].shape)
        q, qd, qdd = (dict(zip(robot.moving, x, strict=True)) for x in drawn)
        states = states_of(q=q, qd=qd, qdd=qdd) | _base_motion(robot, rng, count)
        floats = Floats(robot, states, _in_time(robot, rng, count))
        return sampled_columns(floats, names, count).reshape(-1, len(names))
    system, count = loop_system(robot), 3 * len(names) // len(robot.rows) + 10
    blocks: list[Array] = []
    closed = tried = 0
    while closed < count:
        tried += count
        if tried > MOST_STATES + 10 * count:
            raise SymgenError(
                f"robot {robot.name}: the loops close in {closed} of {tried} states near the "
                "start; give each loop a `start` at which the loop closes"
            )
        blocks.append(_columns_near_start(system, names, count, rng))
        closed += blocks[-1].shape[1]
    return np.concatenate(blocks, axis=1)[:, :count].reshape(-1, len(names))


def sampled_columns(floats: Floats, names: Sequence[str], count: int) -> Array:
    """Compute the regressor columns `names` at given states, shape (rows, count, names).

    `count` is the number of states. A column that is not finite raises DescriptionError.
    """
    robot = floats.robot
    D = derive(robot).columns
    entries = [D[name].get(j, 0) for j in robot.rows for name in names]
    with np.errstate(all="ignore"):  # of laws, which are judged here
        values = [
            np.broadcast_to(np.asarray(x, dtype=float), count) for x in interpret(entries, floats)
        ]
    for k, x in enumerate(values):
        if not (wrong := ~(np.abs(x) <= OVERFLOWS)).any():
            continue
        name, at = names[k % len(names)], int(np.argmax(wrong))
        state = ", ".join(
            f"{symbol.name} = {np.broadcast_to(given, count)[at]:.3g}"
            for symbol, given in floats.states.items()
            if symbol.kind in ("q", "qd")
        )
        own = next((e for e in robot.elements if e.is_own and name.startswith(e.family)), None)
        raise DescriptionError(
            f"column {name} is not finite at {state} (rad, m, s)"
            + (f": {own.torque or own.energy}" if own else "")
            + "; write a law that is finite everywhere, such as sqrt(max(1 - q, 0))",
            path=("columns", own.family) if own else (),
        )
    return np.stack(values).reshape(len(robot.rows), len(names), count).swapaxes(1, 2)


def _columns_near_start(
    system: LoopSystem, names: Sequence[str], count: int, rng: np.random.Generator
) -> Array:
    """Compute regressor columns at random states that close the loops, near the start
    configuration.

    `count` states are tried; states that do not close are dropped. The result has shape (joints,
    states, columns).
    """
    robot = system.robot
    closure = system.closure
    n = len(robot.joints)
    size = robot.longest
    slides = np.array([robot.frame(j).sigma == PRISMATIC for j in robot.joints])
    away = SPREAD * np.where(slides, size / 2, 1.0) * rng.uniform(-1, 1, (n, count)).T
    q = np.tile(system.start, (count, 1))
    for share in (0.25, 0.5, 0.75, 1.0):
        q[:, :n] = system.start[:n] + share * away
        q = system.closed(q, steps=8, tolerance=1e-14 * size)
    r, J = system.residual_floats(q), system.jacobian_floats(q)
    good = (np.abs(r).max(axis=1) < 1e-11 * size) & (np.linalg.cond(J[..., n:]) < 1e6)
    good &= np.linalg.det(J[..., n:]) * system.mode() > 0  # beyond a dead point is another mode
    q = q[good]
    J = J[good]
    J_u = J[..., n:]
    G = -np.linalg.solve(J_u, J[..., :n])
    qd, qdd = rng.standard_normal((2, n, len(q)))[..., None].swapaxes(1, 2)

    def joints(x: Array) -> dict[int, Array]:
        return dict(zip(closure.independent, x.T, strict=True))

    qd = np.concatenate([qd, G @ qd], axis=1)[..., 0]
    B = system.floats(system.curvature, q, qd)
    qdd = np.concatenate([qdd, G @ qdd - np.linalg.solve(J_u, B[..., None])], axis=1)[..., 0]
    named = system.derivation.algebra.named
    rate = {
        Symbol("rate", named("G", u, i)): G[:, a, k]
        for a, u in enumerate(closure.tied)
        for k, i in enumerate(robot.joints)
    }
    states = states_of(q=joints(q), qd=joints(qd), qdd=joints(qdd)) | rate
    states |= _base_motion(robot, rng, len(q))
    floats = Floats(robot, states, _in_time(robot, rng, len(q)))
    return sampled_columns(floats, names, len(q))


def _base_motion(robot: Robot, rng: np.random.Generator, count: int) -> dict[Symbol, Array]:
    """Draw random motions of a base that moves, one per state."""
    names = derive(robot).algebra.base_motion
    return {Symbol("base", name): rng.uniform(-1, 1, count) for name in names}


def _in_time(robot: Robot, rng: np.random.Generator, count: int) -> Any:
    """Draw random values, one per state, of the channels (quantities that the record gives at each
    sample, such as temperature).
    """
    return {name: rng.uniform(0.5, 2, count) for name in robot.channels}


def float_base(W: Array) -> tuple[list[int], Array]:
    """Find the independent columns of a matrix W, leftmost first, and write all columns of W as
    combinations of the independent columns.

    Return the indices of the independent columns, and the coefficients, shape (rank, columns).
    """
    norms = np.linalg.norm(W, axis=0)
    norms[norms <= 1e-10 * norms.max(initial=0.0)] = np.inf
    U = W / norms
    s = np.maximum(np.append(np.linalg.svd(U, compute_uv=False), 0.0), SMALLEST)
    rank = np.flatnonzero(s[1:] < LARGEST_ROUNDING)
    k = int(rank[np.argmax(s[rank] / s[rank + 1])]) if len(rank) else 0
    independent = float(np.sqrt(s[k] * s[k + 1]))
    Q = np.zeros((W.shape[0], 0))
    pivots: list[int] = []
    for c in range(W.shape[1]):
        u = U[:, c] - Q @ (Q.T @ U[:, c])
        u = u - Q @ (Q.T @ u)
        if (size := float(np.linalg.norm(u))) > independent:
            pivots.append(c)
            Q = np.column_stack([Q, u / size])
    K = _without_negligible(U, pivots)
    return pivots, K * np.where(np.isinf(norms), 0.0, norms) / norms[pivots][:, None]


def _without_negligible(U: Array, pivots: list[int]) -> Array:
    """Write all columns of U, shape (rows, columns), as combinations of the columns `pivots`,
    without coefficients that are only rounding errors.

    Return the coefficients, shape (pivots, columns).
    """
    every = np.linalg.lstsq(U[:, pivots], U, rcond=None)[0]
    K, open_ = every.copy(), np.ones(U.shape[1], dtype=bool)
    for least in (*NEGLIGIBLE, 0.0):
        K[:, open_] = np.where(np.abs(every) > least, every, 0.0)[:, open_]
        left = np.linalg.norm(U - U[:, pivots] @ K, axis=0)
        open_ = left > KEPT
    return np.asarray(K)
