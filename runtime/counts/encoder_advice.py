"""Advice to estimate the motion from encoder counts, if a record uses its positions as measured.

A position used as measured has an error of variance step^2/12. Through the filters of the study it
becomes an error of qdd of variance v. The columns of W are then too small by about v divided by the
mean square of qdd. If this share is above 1 % (`HELPS`), the bias justifies `reader: counts`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from runtime.core.drives import Drives, encoder_root
from runtime.core.record import Record
from runtime.core.result import Identification
from runtime.core.signals.filters import States
from runtime.core.signals.noise_gain import bandwidth
from runtime.core.study import Signals
from runtime.counts.lattice import Lattice, lattice
from runtime.counts.reader import encoder_position
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.part import Part

Array = np.ndarray

HELPS = 0.01
"""Share of the filtered acceleration that may be an error of the steps."""
LOOKED_AT = 2**16
"""Samples from the start of a record that are looked at."""


@dataclass(frozen=True, eq=False)
class EncoderSteps(Part):
    """Advice on the records whose motion should be estimated from encoder counts.

    The advice is computed when it is first needed.
    """

    result: Identification

    name = "encoder_steps"
    title = "Steps of the encoders"

    def text(self) -> str:
        """Write one sentence of advice for each record that `reader: counts` would improve."""
        readings = [r for r in self.result.prepared if r.reader.filters_positions]
        sentences = [
            sentence
            for r in readings
            for sentence in encoder_sentences(r.record, r.states, r.study.signals, r.drives)
        ]
        return "\n".join(sentences)


def visible_steps(result: Identification) -> tuple[str, float]:
    """Describe the encoder steps visible in the positions, and the acceleration error they cause.

    The error is the largest share of the mean square of an acceleration. The text is empty if no
    steps are found.
    """
    said, most = "", -1.0
    for one in result.prepared:
        if one.reader.filters_positions:
            found = _steps(one.record, one.states, one.study.signals, one.drives)
            if found is not None and float(found[1].max()) > most:
                most, joint = float(found[1].max()), int(np.argmax(found[1]))
                said = f"Positions change in steps of {found[0][joint]:.3g} ({found[2]} side)"
    return said, max(most, 0.0)


def encoder_sentences(
    record: Record, states: States, signals: Signals, drives: Drives | None
) -> tuple[str, ...]:
    """Write the advice to use the counts of a record, if its encoder steps disturb an acceleration.

    states : filtered states of the record.
    drives : drives to the motor side; None if there is none.
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
    """Compute the share of encoder-step errors in the mean squared acceleration of the worst joint.

    The accelerations are filtered. The result is 0 if the positions show no steps.
    """
    found = _steps(record, states, signals, drives)
    return 0.0 if found is None else float(found[1].max())


def _steps(
    record: Record, states: States, signals: Signals, motors: Drives | None
) -> tuple[Array, Array, str] | None:
    """Find the encoder steps of the positions, and their share of each mean squared acceleration.

    Returns the steps, the shares and the side, joint or motor; None if no steps are found.
    """
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
    """Compute which share of the mean square of qdd is due to encoder steps, by joint, shape (n,).

    `motion` is the mean square of qdd.
    """
    n = len(motion)
    gain = bandwidth(replace(signals, median=1), rate).before[2, 2]
    error = gain * (encoder_root(drives, n) * found.step) ** 2 @ np.full(n, 1 / 12)
    return np.asarray(np.where(motion > 0, error / np.where(motion > 0, motion, 1.0), 0.0))
