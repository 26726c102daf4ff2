"""Whether reading counts would help a record whose positions are taken as they are: one sentence for identify and report.

Positions taken as they are carry an error of variance step^2/12. Through the filters of the study
it becomes an error of qdd of variance v; the columns of W are attenuated by about v over the mean
square of qdd. Above HELPS that is a bias that justifies another reader.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from runtime.core.drives import Drives, encoder_root
from runtime.core.errors import InputError, SettingsError
from runtime.core.part import Part
from runtime.core.record import Record
from runtime.core.result import Identification
from runtime.core.signals.filters import States
from runtime.core.signals.noise_gain import bandwidth
from runtime.core.study import Signals
from runtime.counts.lattice import Lattice, lattice
from runtime.counts.reader import encoder_position

Array = np.ndarray

HELPS = 0.01
"""Share of the filtered acceleration that may be an error of the steps."""
LOOKED_AT = 2**16
"""Samples from the start of a record that are looked at."""


@dataclass(frozen=True, eq=False)
class EncoderSteps(Part):
    """Records whose positions would be read better as counts; computed when first asked for."""

    result: Identification

    name = "encoder_steps"
    title = "Steps of the encoders"

    def text(self) -> str:
        """One sentence for each record."""
        readings = [r for r in self.result.prepared if r.study.signals.reader == "lowpass"]
        sentences = [
            sentence
            for r in readings
            for sentence in encoder_sentences(r.record, r.states, r.study.signals, r.drives)
        ]
        return "\n".join(sentences)


def visible_steps(result: Identification) -> tuple[str, float]:
    """Describe the steps that the positions show, and the largest share of an acceleration they cause.

    The share is that of the mean square.

    "" if none are seen.
    """
    said, most = "", -1.0
    for one in result.prepared:
        if one.study.signals.reader == "lowpass":
            found = _steps(one.record, one.states, one.study.signals, one.drives)
            if found is not None and float(found[1].max()) > most:
                most, joint = float(found[1].max()), int(np.argmax(found[1]))
                said = f"Positions change in steps of {found[0][joint]:.3g} ({found[2]} side)"
    return said, max(most, 0.0)


def encoder_sentences(
    record: Record, states: States, signals: Signals, drives: Drives | None
) -> tuple[str, ...]:
    """Say for each record where reading its positions as counts would help.

    states : of the record, through the filters.   drives : motor side; None if there is none.
    """
    found = _steps(record, states, signals, drives)
    if found is None or (share := found[1].max()) < HELPS:
        return ()
    step, _, side = found
    return (
        f"{record.name}: positions change in steps of {_range(step)} ({side} side), which make "
        f"{100 * share:.0f} % of the mean square of an acceleration; signals: {{reader: counts, "
        f"side: {side}}} reads them as counts.",
    )


def acceleration_error(
    record: Record, states: States, signals: Signals, drives: Drives | None
) -> float:
    """Largest share of the mean square of a filtered acceleration that the steps cause.

    0 if positions show no steps.
    """
    found = _steps(record, states, signals, drives)
    return 0.0 if found is None else float(found[1].max())


def _steps(
    record: Record, states: States, signals: Signals, motors: Drives | None
) -> tuple[Array, Array, str] | None:
    """Steps of the positions, shares of the accelerations that they make, and their side."""
    q, motion = record.q[:LOOKED_AT], np.mean(states.qdd[:LOOKED_AT] ** 2, axis=0)
    for side, drives in (("joint", None), ("motor", motors)):
        if side == "motor" and drives is None:
            continue
        try:
            found = lattice(encoder_position(q, drives))
            share = _attenuation(record.rate, signals, motion, found, drives)
        except (InputError, SettingsError):
            continue
        if not found.rounded:
            return found.step, share, side
    return None


def _range(steps: Array) -> str:
    least, most = f"{steps.min():.3g}", f"{steps.max():.3g}"
    return least if least == most else f"{least} to {most}"


def _attenuation(
    rate: float, signals: Signals, motion: Array, found: Lattice, drives: Drives | None
) -> Array:
    """Variance of the error of qdd divided by its mean square `motion`, by joint; shape (n,)."""
    n = len(motion)
    gain = bandwidth(replace(signals, median=1), rate).before[2, 2]
    error = gain * (encoder_root(drives, n) * found.step) ** 2 @ np.full(n, 1 / 12)
    return np.asarray(np.where(motion > 0, error / np.where(motion > 0, motion, 1.0), 0.0))
