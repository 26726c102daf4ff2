"""Replacement of the setting `signals.lowpass.cutoff: auto` by a cut-off frequency in Hz."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from runtime.core.problem import SIGNALS, Note, Problem
from runtime.core.rows.selection import excerpt
from runtime.core.signals.cutoff import cutoff


def automatic_cutoff(problem: Problem) -> Problem:
    """Replace the setting `cutoff: auto` of the low-pass filter by a cut-off frequency in Hz.

    All fitted records share this frequency, which has the smallest bias
    (`runtime.core.signals.cutoff`). A problem with another setting is returned unchanged.
    """
    signals = problem.settings.signals
    low = signals.lowpass
    if low is None or low.cutoff != "auto":
        return problem
    positions = []
    for record in problem.records:
        positions.append((record.q[excerpt(record, problem.settings.rows)], record.rate))
    crossing = np.inf if isinstance(signals.velocity, str) else signals.velocity
    hertz, why = cutoff(positions, signals, crossing, problem.reader.encoder is not None)
    text = f"Low-pass at {hertz:g} Hz (cutoff: auto): {why}."
    settings = replace(
        problem.settings, signals=replace(signals, lowpass=replace(low, cutoff=hertz))
    )
    return problem.changed(Note(SIGNALS, text), settings=settings)
