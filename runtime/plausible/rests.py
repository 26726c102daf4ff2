"""Leave out the rows in which a joint rests, if its torque at rest is not that of the model.

Dry friction holds a joint at rest with any torque between -FS and FS, but its column sign(qd) is
noise there. A joint j that rests (|qd_j| <= v_j = STANDING max |qd_j|) in more than REST_SHARE of
its rows is judged by

    X = argmin ||Y - W X||_w over the rows without rests (weights by joint)
    a_j^2, b_j^2 = mean of (Y - W X)^2 over the rows of joint j without rests, and over all of them

The rests of joint j are left out (`rows.low_speed` = v_j) if a_j < REST_ERROR b_j. Rows within
REST_REACH instants of the decimation contain a part of the torque of a rest, and are left out with
the rest (`rows.around`).

The rests of a joint are kept if the other rows do not determine its own friction and offset, or if
W loses rank without them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from runtime.core.least_squares.wls import weighted_system
from runtime.core.model import GeneratedModel, elements_of, is_axis, joint_labels, joint_units
from runtime.core.problem import Note, Problem
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import stacked
from runtime.core.signals.cutoff import stands
from runtime.ground.errors import InputError
from runtime.ground.limits import limits

LIMIT = limits(__package__)

Array = np.ndarray

KIND = "rests"
OWN = ("viscous", "coulomb", "offset")
"""Kinds of elements whose parameters the rows of their joint must determine."""
SMOOTH = ("inertia", "viscous", "offset", "stiffness", "cubic")
"""Kinds of elements whose torques do not jump with the direction of motion."""


def rows_at_rest(problem: Problem) -> Problem:
    """Replace the setting `rows.low_speed: auto` by speeds, zero for joints whose rests are kept.

    This is a step of the preparation of a problem, and notes in one sentence which rows are left
    out.
    """
    try:
        whole = with_speeds(problem, np.zeros(len(problem.model.JOINTS)))
    except InputError:  # the reader refuses the record as it is, which CESTAC rounds first
        rows = replace(problem.settings.rows, low_speed=0.0)
        return problem.changed(settings=replace(problem.settings, rows=rows))
    speeds, share = resting(whole)
    if not speeds.any():
        return whole
    observation = stacked(whole.model, whole.prepared)
    speeds = without_loss(whole, observation, speeds, np.argsort(-share))
    if not speeds.any():
        return whole
    kept = moving_rows(whole, with_speeds(whole, speeds))
    speeds = np.where(disobeying(observation, kept), speeds, 0.0)
    if not speeds.any():
        return whole
    done = with_speeds(whole, speeds)
    return done.changed(Note(KIND, sentence(done, moving_rows(whole, done), observation)))


def with_speeds(problem: Problem, speeds: Array) -> Problem:
    """Return the problem whose rows slower than `speeds`, shape (n,), and near these are left out.

    If all speeds are zero, rows.low_speed becomes 0, and rows.around stays as it is.
    """
    rows, low = problem.settings.rows, tuple(map(float, speeds))
    around = max(
        LIMIT.REST_REACH * own.selection.factor / own.record.rate for own in problem.prepared
    )
    rows = (
        replace(rows, low_speed=low, around=max(rows.around, float(f"{around:.2g}")))
        if any(low)
        else replace(rows, low_speed=0.0)
    )
    return problem.changed(settings=replace(problem.settings, rows=rows))


def resting(problem: Problem) -> tuple[Array, Array]:
    """Find the speed below which each joint rests, and the share of its rows in which it does.

    Return speeds in rad/s or m/s, shape (n,), zero for a joint that rests in few rows, that never
    moves, that has no dry friction in the model, or that is an axis of a force sensor; and the
    shares, shape (n,).
    """
    rows = [
        (np.abs(own.states.qd[own.selection.samples][own.selection.kept]), own.selection.mask.T)
        for own in problem.prepared
    ]
    low = LIMIT.STANDING * np.max([(qd * used).max(axis=0) for qd, used in rows], axis=0)
    low = np.array([rounded_up(v) for v in low])
    standing = sum(((qd <= low) & used).sum(axis=0) for qd, used in rows)
    share = np.asarray(standing / np.maximum(sum(used.sum(axis=0) for _, used in rows), 1))
    rests = (share > LIMIT.REST_SHARE) & [not is_axis(joint) for joint in problem.model.JOINTS]
    if rests.any():
        rests &= dry_friction(problem.model)
        median = problem.settings.signals.median
        rests &= ~np.all([stands(r.q, r.rate, median) for r in problem.records], axis=0)
    return np.where(rests, low, 0.0), share


def dry_friction(model: GeneratedModel) -> Array:
    """Tell of which joints the model has dry friction, or another law that may, bool, shape (n,)."""
    laws = [axes for kind, _, axes in elements_of(model).values() if kind not in SMOOTH]
    return np.array([any(j in axes for axes in laws) for j in model.JOINTS])


def rounded_up(x: float) -> float:
    """Round a speed threshold x up to two significant digits.

    A smaller threshold would not leave out all rows at rest.
    """
    digit = 10.0 ** (np.floor(np.log10(x)) - 1) if x > 0 else 1.0
    return float(f"{np.ceil(x / digit * (1 - 1e-12)) * digit:.2g}")


def moving_rows(whole: Problem, moving: Problem) -> Array:
    """Tell which rows of the problem `whole` are rows of the problem `moving` too, bool, (r,)."""
    pairs = [
        (before.certain(whole.model).mask, after.selection.mask)
        for before, after in zip(whole.prepared, moving.prepared, strict=True)
    ]
    joints = range(len(whole.model.JOINTS))
    return np.concatenate([left[j, used[j]] for j in joints for used, left in pairs])


def without_loss(
    whole: Problem, observation: Observation, speeds: Array, order: Iterable[int]
) -> Array:
    """Set to zero the speeds of joints whose rests are needed, shape (n,).

    If not all rests can be left out, they are left out joint by joint in the given order, as far as
    possible.
    """
    rank = weighted_system(observation).solve().rank

    def enough(speeds: Array) -> bool:
        try:
            rows = observation.where(moving_rows(whole, with_speeds(whole, speeds)))
        except InputError:  # no row is left
            return False
        own = all(friction_determined(whole.model, rows, int(j)) for j in np.flatnonzero(speeds))
        return own and weighted_system(rows).solve().rank == rank

    if enough(speeds):
        return speeds
    kept = np.zeros_like(speeds)
    for j in order:
        more = np.where(np.arange(len(speeds)) == j, speeds, kept)
        if speeds[j] and enough(more):
            kept = more
    return kept


def friction_determined(model: GeneratedModel, rows: Observation, j: int) -> bool:
    """Whether the rows of joint j (from 0) determine the friction and the offset of this joint alone.

    The condition number of their columns, of norm 1, must be small (below FRICTION_CONDITION in
    limits.toml): a joint that moves in one direction only does not separate FS from OFFSET.
    """
    own = [
        column
        for column, name in enumerate(rows.names)
        if (element := elements_of(model).get(name.removesuffix("R")))
        and element[0] in OWN
        and set(element[2]) == {model.JOINTS[j]}
    ]
    C = rows.W[rows.joint(j)][:, own]
    norms = np.linalg.norm(C, axis=0)
    return not own or bool(norms.all() and np.linalg.cond(C / norms) < LIMIT.FRICTION_CONDITION)


def disobeying(observation: Observation, moving: Array) -> Array:
    """Find the joints whose residuals at rest are larger than those in motion, bool, shape (n,).

    moving : rows without rests, bool, shape (r,).
    """
    X = weighted_system(observation.where(moving), "joint").solve().X
    square = (observation.Y - observation.W @ X) ** 2
    larger = []
    for j in range(observation.n):
        own = observation.joint(j)
        motion, every = square[own][moving[own]], square[own]
        larger.append(motion.mean() < LIMIT.REST_ERROR**2 * every.mean() if len(motion) else False)
    return np.array(larger)


def sentence(done: Problem, left: Array, whole: Observation) -> str:
    """Say which rows of which joints are left out.

    left : rows of `whole` that are used, bool, shape (r,).
    """
    rows, labels, units = done.settings.rows, joint_labels(done.model), joint_units(done.model)
    parts = []
    for j, v in enumerate(rows.slow):  # type: ignore[arg-type]
        if v:
            share = 100 * (1 - left[whole.joint(j)].mean())
            parts.append(f"joint {labels[j]} {share:.0f} % (below {v:g} {units[j]}/s)")
    return (
        f"Rows at rest are left out, with those within {rows.around:g} s, because dry friction "
        f"holds a joint with any torque: {', '.join(parts)}; rows.low_speed: 0 keeps them."
    )
