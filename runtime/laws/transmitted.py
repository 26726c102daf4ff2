"""Columns of W that depend on the torque transmitted at their joint, such as load-dependent friction.

A model with such columns is bilinear in the parameters,

    Y = D_r X_r + D_l(tau_m) X_l + rho,        tau_m = D_r X_r

with D_l the columns of these laws and D_r all other columns. The parameters are estimated by least
squares with tau_m of the previous estimate, until tau_m no longer changes. The measured torque
cannot replace tau_m: its noise would enter D_l and bias X_l.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from runtime.core.model import TRANSMITTED, GeneratedModel, channels_of
from runtime.core.problem import Note, Problem
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import Prepared
from runtime.ground.errors import InputError
from runtime.ground.limits import LIMIT

Array = np.ndarray

KIND = "transmitted"
PASSES = 50
SAME_TORQUE = 1e-6  # of the rms of tau_m, between two passes


def transmitted_torque(problem: Problem) -> Problem:
    """Add to the records the torque that each joint transmits, if columns of W depend on it.

    This is a step of the preparation of a problem. Without such laws, or without records, the
    problem is returned unchanged.

    Raises
    ------
    InputError
        The transmitted torque does not converge.
    """
    model = problem.model
    read = {c: names for c, names in channels_of(model).items() if c.startswith(TRANSMITTED)}
    if not (read and problem.records):
        return problem
    parameters = ", ".join(sorted({name for names in read.values() for name in names}))
    weighted = problem.settings.estimate.weights != "none"
    torque = TransmittedTorque(model, read)
    records = [torque.given(record, None) for record in problem.prepared]
    before = np.zeros(0)
    for k in range(PASSES):
        X = _solve([record.observation(model) for record in records], weighted)
        records = [torque.given(record, X) for record in records]
        tau = np.concatenate([r.record.channels[c] for r in records for c in read])[:, 0]
        if k and np.linalg.norm(tau - before) <= SAME_TORQUE * np.linalg.norm(tau):
            break
        before = tau
    else:
        raise InputError(
            f"{parameters}: the torque of the model does not converge in {PASSES} passes; check in the robot file whether the friction is larger than the torque that causes the friction"
        )
    text = (
        f"{parameters}: {TRANSMITTED} is the torque of the other parameters at the states of "
        f"the rows, not the measured torque; it converged in {k + 1} passes."
    )
    unseen = [torque.given(record, X) for record in problem.prepared_unseen]
    others = tuple(note for note in problem.notes if note.kind != KIND)
    return replace(problem, notes=others).changed(
        Note(KIND, text),
        records=tuple(record.record for record in records),
        unseen=tuple(record.record for record in unseen),
    )


def _solve(observations: Sequence[Observation], weights: bool) -> Array:
    """Estimate the parameters X of all columns of W by least squares.

    With `weights`, the rows of each joint are divided by the standard deviation of its residual.
    """
    W = np.vstack([o.W for o in observations])
    Y = np.concatenate([o.Y for o in observations])
    X = np.linalg.lstsq(W, Y, rcond=1e-10)[0]
    if weights:
        _, joint = np.unique(np.concatenate([o.joints for o in observations]), return_inverse=True)
        exact = LIMIT.EXACT_FIT**2 * np.bincount(joint, Y**2)
        squares = np.bincount(joint, (Y - W @ X) ** 2) + exact
        scale = np.sqrt(squares / np.bincount(joint))[joint]
        X = np.linalg.lstsq(W / scale[:, None], Y / scale, rcond=1e-10)[0]
    return np.asarray(X)


class TransmittedTorque:
    """Computation of the torque tau_m that a joint transmits, from columns of W without tau_m.

    `read` lists, for the channel of each tau_m, the parameters whose columns depend on this
    channel.
    """

    def __init__(self, model: GeneratedModel, read: dict[str, tuple[str, ...]]) -> None:
        self.model = model
        self.read = read
        laws = {name for names in read.values() for name in names}
        self.rest = [k for k, name in enumerate(model.BASE_PARAMETERS) if name not in laws]
        self.place = {c: model.JOINTS.index(int(c.removeprefix(TRANSMITTED))) for c in read}

    def given(self, record: Prepared, X: Array | None) -> Prepared:
        """Add the transmitted torque tau_m, computed from X, to a record; zeros if X is None."""
        tau = np.zeros((len(record.record), len(self.model.JOINTS)))
        if X is not None:
            s = record.states
            timed = {c: s.channels[c] for c in channels_of(self.model) if c not in self.read}
            D = cast(Any, self.model).regressor(s.q, s.qd, s.qdd, **timed)
            tau = D[..., self.rest] @ X[self.rest]
        transmitted = {c: tau[:, [k]] for c, k in self.place.items()}
        channels = {**record.record.channels, **transmitted}
        changed = replace(record, record=replace(record.record, channels=channels))
        changed.take_states(record)
        return changed
