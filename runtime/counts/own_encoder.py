"""The encoder that measured a record, and coarser encoders simulated from its positions.

The study simulates encoders of step Delta (`rounding: phase` of CESTAC): the positions are
quantised again, with a random phase in every run.

    Delta >= 5 own steps        the positions are taken as exact and quantised
    own step < Delta
            positions drawn from the posterior of the record's own counts are quantised, another
            draw in every run
    Delta <= own step
            refused: the counts would only be shifted, and the good agreement between the runs
            would have no meaning

A record whose positions are no multiples of a step (floats of a simulation, positions averaged by a
driver) has an own step near zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.core.drives import Drives
from runtime.core.record import Record
from runtime.core.study import Study
from runtime.counts.lattice import smallest_step
from runtime.counts.reading import Reading, read_counts
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import LIMIT

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class OwnEncoder:
    """The encoder that measured a record: its steps and, if needed, the motion from its counts.

    Attributes
    ----------
    step : ndarray, shape (n,), rad or m
        Steps of the encoder, on the side study.cestac.side.
    reading : Reading or None
        Motion estimated from the counts; None if every Delta of the study is coarse compared with
        the encoder's own step.
    drives : Drives or None
        Drives between the joints and the encoders of `reading`; None for encoders at the joints.
    """

    step: Array
    reading: Reading | None
    drives: Drives | None

    @property
    def read(self) -> bool:
        """Whether the motion has been estimated from the counts of the record."""
        return self.reading is not None

    def positions(self, q: Array, delta: float, rng: np.random.Generator) -> Array:
        """Return the joint positions, shape (N, n), that a simulated encoder of step delta rounds.

        The positions are the measured q if delta is coarse, else a random draw from the posterior
        distribution.
        """
        if self.reading is None or delta >= (1 - 1e-9) * LIMIT.EXACT_FROM * self.step.max():
            return q
        drawn = self.reading.draw(rng)
        return drawn if self.drives is None else self.drives.joint_position(drawn)


def own_encoder(record: Record, study: Study, drives: Drives | None) -> OwnEncoder | None:
    """Determine the encoder steps of a record, for a study that simulates coarser encoders.

    The study needs the setting `rounding: phase`. The result is None for other kinds of rounding,
    which take every position as exact.

    Raises
    ------
    SettingsError
        If a Delta is not above the own step.
    InputError
        If a Delta is less than five own steps and no motion can be estimated from the counts.
    """
    settings = study.cestac
    signals: Any = study.signals
    if settings.rounding != "phase":
        return None
    own_drives = drives if settings.side == "motor" else None
    q = record.q if own_drives is None else own_drives.motor_position(record.q)
    known = signals.step is not None and signals.side == settings.side
    missing = (
        np.zeros(q.shape, dtype=bool)
        if record.missing is None
        else record.missing.at_encoders(own_drives)
    )
    given: Any = (
        signals.step
        if known
        else [smallest_step(x[~gaps]) for x, gaps in zip(q.T, missing.T, strict=True)]
    )
    step = np.broadcast_to(np.asarray(given, dtype=float), (record.n,))
    finest, coarsest = min(settings.delta, default=np.inf), int(np.argmax(step))
    if finest <= 1.001 * step[coarsest]:
        raise SettingsError(
            f"step {finest:.4g} is not coarser than the step of encoder {coarsest + 1} of "
            f"{record.name}, {step[coarsest]:.4g}: rounding would only shift the counts, and the "
            f"result would look too certain; set only steps above {step[coarsest]:.4g}. The estimate "
            "from the record has the effect of this encoder already: to see it, set rounding: "
            "two-point at this step, which shows at least as much, or compare with signals: {reader: "
            "counts}",
            path=("cestac", "delta"),
        )
    if finest >= (1 - 1e-9) * LIMIT.EXACT_FROM * step[coarsest]:
        return OwnEncoder(step, None, None)
    try:
        reading = read_counts(np.where(missing, np.nan, q), record.rate, step, name=record.name)
    except InputError as e:
        raise InputError(
            f"step {finest:.4g} is less than {LIMIT.EXACT_FROM:g} steps of encoder "
            f"{coarsest + 1} "
            f"({step[coarsest]:.4g}), so the study needs the counts of this encoder, "
            f"which cannot be read: {e.message}; or set only steps of at least "
            f"{LIMIT.EXACT_FROM * step[coarsest]:.4g}, for which the positions count as exact",
            file=record.name,
        ) from e
    return OwnEncoder(step, reading, own_drives)
