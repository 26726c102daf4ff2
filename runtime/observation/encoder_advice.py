"""Whether reading counts would help a record whose positions are taken as they are: one sentence for identify and report.

Positions taken as they are carry an error of variance step^2/12. Through the filters of the study it becomes an error of qdd of variance v; the
columns of W are attenuated by about v over the mean square of qdd. Above HELPS that is a bias worth another reader.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from runtime.errors import InputError, SettingsError
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel, drives_of
from runtime.observation.encoder_lattice import Lattice, lattice
from runtime.observation.filters import filtered_states
from runtime.observation.noise_gain import bandwidth
from runtime.observation.states import encoder_position, encoder_root
from runtime.records.record import Record
from runtime.settings.study import Signals

Array = np.ndarray

HELPS = 0.01
"""Share of the filtered acceleration that may be an error of the steps."""
LOOKED_AT = 2**16
"""Samples from the start of a record that are looked at."""


def encoder_sentences(model: GeneratedModel, record: Record, signals: Signals) -> tuple[str, ...]:
    """Positions being taken as they are, one sentence where reading counts would help."""
    if signals.reader == "counts":
        return ()
    advice = _advice(model, record.q[:LOOKED_AT], record.rate, signals)
    return (f"{record.name}: {advice}",) if advice else ()


def _advice(model: GeneratedModel, q: Array, rate: float, signals: Signals) -> str:
    for side, drives in (("joint", None), ("motor", drives_of(model))):
        if side == "motor" and drives is None:
            continue
        try:
            found = lattice(encoder_position(q, drives))
            share = _attenuation(q, rate, signals, found, drives)
        except (InputError, SettingsError):
            continue
        if not any("as if rounded" in text for text in found.findings):
            if share.max() < HELPS:
                return ""
            return (
                f"positions change in steps of {_range(found.step)} ({side} side), which make {100 * share.max():.0f} % of the "
                f"mean square of an acceleration; signals: {{reader: counts, side: {side}}} reads them as counts."
            )
    return ""


def _range(steps: Array) -> str:
    least, most = f"{steps.min():.3g}", f"{steps.max():.3g}"
    return least if least == most else f"{least} to {most}"


def _attenuation(q: Array, rate: float, signals: Signals, found: Lattice, drives: Drives | None) -> Array:
    """Variance of the error of qdd over the mean square of qdd, by joint, shape (n,)."""
    signals = replace(signals, median=1)
    gain = bandwidth(signals, rate).before[2, 2]
    error = gain * (encoder_root(drives, q.shape[1]) * found.step) ** 2 @ np.full(q.shape[1], 1 / 12)
    moved = np.mean(filtered_states(q, rate, signals).qdd ** 2, axis=0)
    return np.asarray(np.where(moved > 0, error / np.where(moved > 0, moved, 1.0), 0.0))
