"""Check whether the robot file lacks friction that the record shows.

The samples are fitted twice by least squares, with joints weighted by the size of their torques:

    tau = D X + c,        tau = D X + c + F,        F_j = a_j qd_j + b_j sign(qd_j)

with a constant c_j and F_j in the joints whose elements in the robot file have no friction. A joint
lacks friction if F takes away most of its error. In that case, other causes of an error are not
searched for, because the missing friction hides them.
"""

from __future__ import annotations

import numpy as np

from runtime.core.model import elements_of
from runtime.ground.check import Answer, Question, State
from runtime.ground.limits import limits
from runtime.plausible.case import Case

LIMIT = limits(__package__)

Array = np.ndarray

WITHOUT_FRICTION = ("inertia", "offset", "stiffness", "cogging")
"""Kinds of elements that are no friction."""


@Question(
    "Does the robot file have the friction of the joints?",
    f"friction takes away less than half of the error of a joint, or less than "
    f"{LIMIT.LACKING_FRICTION:g} % of its torque",
)
def friction(case: Case) -> Answer | None:
    """Check whether joints without friction in the robot file show friction in the record.

    Return None if every joint has friction, if nothing is fitted, or if sensors behind the gears
    measure the torques, which then contain no friction of the drives.
    """
    if case.alone is None or case.sides[1] == "link":
        return None
    lacking = ~with_friction(case)
    if not lacking.any():
        return None
    s = case.samples
    constant, moving = np.ones_like(s.qd), (s.qd, np.sign(s.qd))
    before, after = errors(case, lacking, constant), errors(case, lacking, constant, *moving)
    shown = lacking & (before > 2 * after) & (before - after > LIMIT.LACKING_FRICTION)
    if not shown.any():
        return Answer("good", "Friction that the robot file lacks explains little of the torques")
    j = int(np.argmax(np.where(shown, before - after, 0.0)))
    of = "" if lacking.all() else f" of joint {case.joint_labels(lacking)}"
    state: State = "no" if before[j] > LIMIT.JOINT_ERROR[1] else "doubtful"
    return Answer(
        state,
        f"The robot file has no friction{of}: add FV, FS; with friction, the error of "
        f"joint {case.labels[j]} goes from {before[j]:.1f} to {after[j]:.1f} %",
        "write in the robot file, elements: {FV: {kind: viscous, along: all}, FS: {kind: coulomb, "
        "along: all}, OFFSET: {kind: offset, along: all}}; then identify again",
    )


def with_friction(case: Case) -> Array:
    """Whether an element of the robot file may be friction of each joint, bool (n,)."""
    joints = {
        joint
        for kind, _, acts in elements_of(case.model).values()
        if kind not in WITHOUT_FRICTION
        for key in acts
        for joint in (key if isinstance(key, tuple) else (key,))
    }
    return np.array([joint in joints for joint in case.model.JOINTS])


def errors(case: Case, chosen: Array, *added: Array) -> Array:
    """Compute the relative torque error of each joint, %, with further torques in some joints.

    chosen : joints that have these further torques, bool (n,). added : torques of unit parameters,
      shape (K, n) each.
    """
    s = case.samples
    mask = s.moving()
    Y = s.tau - s.tau_known
    size = np.maximum(np.linalg.norm(Y, axis=0), 1e-300)
    F = [
        np.where(np.arange(s.n) == j, torque, 0.0)
        for j in np.flatnonzero(chosen)
        for torque in added
    ]
    W = np.concatenate([case.D, *(f[:, :, None] for f in F)], axis=2) / size[:, None]
    y = Y / size
    columns = np.maximum(np.linalg.norm(W[mask], axis=0), 1e-300)
    X = np.linalg.lstsq(W[mask] / columns, y[mask], rcond=None)[0] / columns
    left = np.where(mask, y - W @ X, 0.0)
    shown = np.maximum(np.linalg.norm(np.where(mask, y, 0.0), axis=0), 1e-300)
    return np.asarray(100 * np.linalg.norm(left, axis=0) / shown)
