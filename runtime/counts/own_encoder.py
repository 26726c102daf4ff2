"""The encoder that made a record, and what it allows to say of coarser ones by law phase.

    Delta >= 5 own steps        the positions are taken as exact and quantised
    own step < Delta
            positions drawn from the posterior of the record's own counts are quantised, another
            draw in every run
    Delta <= own step
            refused: counts rounded at their own step are only shifted, and runs that agree so well
            would say nothing

A record whose positions lie on no lattice (floats of a simulation, positions that a driver
averaged) has a step of its own near zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.core.drives import Drives
from runtime.core.errors import InputError, SettingsError
from runtime.core.limits import LIMIT
from runtime.core.record import Record
from runtime.core.study import Study
from runtime.counts.lattice import smallest_step
from runtime.counts.reading import Reading, read_counts

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class OwnEncoder:
    """The encoder of one record.

    Attributes
    ----------
    step : ndarray, shape (n,), rad or m
        Its steps, on the side study.cestac.side.
    reading : Reading or None
        What its counts say; None if every Delta of the study is coarse compared with it.
    drives : Drives or None
        Between the joints and the encoders of `reading`; None: encoders at the joints.
    """

    step: Array
    reading: Reading | None
    drives: Drives | None

    @property
    def read(self) -> bool:
        """Whether its counts have been read."""
        return self.reading is not None

    def positions(self, q: Array, delta: float, rng: np.random.Generator) -> Array:
        """Joint positions, shape (N, n), that an encoder of step delta may be judged on: q as measured, or a draw."""
        if self.reading is None or delta >= (1 - 1e-9) * LIMIT.EXACT_FROM * self.step.max():
            return q
        drawn = self.reading.draw(rng)
        return drawn if self.drives is None else self.drives.joint_position(drawn)


def own_encoder(record: Record, study: Study, drives: Drives | None) -> OwnEncoder | None:
    """The encoder of a record under law phase.

    None for other laws, which take every position as exact.

    Raises
    ------
    SettingsError
        A Delta that is not above the own step.
    InputError
        Positions too coarse for one Delta of which the counts cannot be read.
    """
    settings, signals = study.cestac, study.signals
    if settings.rounding != "phase" or settings.place == "loop":
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
            f"a step of {finest:.4g} is not coarser than that of encoder {coarsest + 1} of "
            f"{record.name}, {step[coarsest]:.4g}: it would only shift the counts, and the result "
            f"would look too certain; ask for steps above {step[coarsest]:.4g}",
            path=("cestac", "delta"),
        )
    if finest >= (1 - 1e-9) * LIMIT.EXACT_FROM * step[coarsest]:
        return OwnEncoder(step, None, None)
    try:
        reading = read_counts(np.where(missing, np.nan, q), record.rate, step, name=record.name)
    except InputError as e:
        raise InputError(
            f"a step of {finest:.4g} is less than {LIMIT.EXACT_FROM:g} steps of encoder "
            f"{coarsest + 1} "
            f"({step[coarsest]:.4g}), so positions would be drawn from "
            f"the counts, which cannot be read: {e.message}",
            file=record.name,
        ) from e
    return OwnEncoder(step, reading, own_drives)
