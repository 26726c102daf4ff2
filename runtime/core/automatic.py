"""Replacement of the setting `signals.lowpass.cutoff: auto` by cut-off frequencies in Hz.

Each fitted record gets the cut-off that it would have alone, since its rate and the noise of its
positions are its own. The study gets the cut-off of all these records together. This cut-off is
used for a record that is too short or does not move, and is the upper limit for a record that is
predicted.

Contacts shake a robot at all frequencies. Near the cut-off, the filter takes part of this motion from
W and not from Y, which biases the parameters. So `decimate.factor: auto` keeps every third row of eq.
(13) where contacts are measured, if enough are left: rows of frequencies at which the filter is 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from runtime.core.problem import CONTACTS, SIGNALS, Note, Problem
from runtime.core.provenance import record_names
from runtime.core.record import Record
from runtime.core.rows.prepared import study_of_record
from runtime.core.rows.selection import excerpt
from runtime.core.signals.cutoff import Choice, chosen_cutoff, lines_of
from runtime.core.signals.filters import decimation_factor
from runtime.ground.limits import LIMIT

NAMED = 3
"""Records with the same cut-off that are named; more are counted."""


def automatic_cutoff(problem: Problem) -> Problem:
    """Replace the setting `cutoff: auto` of the low-pass filter by cut-off frequencies in Hz.

    The cut-off of a record has the smallest bias for it (`runtime.core.signals.cutoff`). With
    another setting, all records are filtered alike.
    """
    signals = problem.settings.signals
    low = signals.lowpass
    if low is None or low.cutoff != "auto":
        return _below_the_filter(
            problem.changed(
                records=tuple(record.cut_at(None) for record in problem.records),
                unseen=tuple(record.cut_at(None) for record in problem.unseen),
            )
        )
    common, own = _choices(problem, problem.records)
    fitted = [one if one.decided else common for one in own]
    same = all(one.hertz == common.hertz for one in fitted)
    text = (
        f"Low-pass at {common.hertz:g} Hz (cutoff: auto): {common.why}."
        if same
        else _by_record(problem.records, fitted)
    )
    highest = [
        min(common.hertz, *([one.hertz] if one.decided else []), LIMIT.HIGHEST_CUTOFF * record.rate)
        for record, one in zip(problem.unseen, _choices(problem, problem.unseen)[1], strict=True)
    ]

    def cut(records: Sequence[Record], cutoffs: Sequence[float]) -> tuple[Record, ...]:
        return tuple(
            record.cut_at(None if hertz == common.hertz else hertz)
            for record, hertz in zip(records, cutoffs, strict=True)
        )

    changed = problem.changed(
        Note(SIGNALS, text),
        records=cut(problem.records, [one.hertz for one in fitted]),
        unseen=cut(problem.unseen, highest),
        settings=replace(
            problem.settings, signals=replace(signals, lowpass=replace(low, cutoff=common.hertz))
        ),
    )
    return _below_the_filter(changed)


def _below_the_filter(problem: Problem) -> Problem:
    """Keep fewer rows, of lower frequencies, if contacts are measured and the factor is automatic."""
    signals, records = problem.settings.signals, problem.records
    how, low = signals.decimate, signals.lowpass
    if problem.noted(CONTACTS) is None or how is None or low is None or how.factor != "auto":
        return problem
    factors = [
        decimation_factor(study_of_record(problem.settings, record).signals, record.rate)
        for record in records or problem.unseen
    ]
    rows = sum(len(record) * record.n for record in records)
    most = int(rows / (LIMIT.CONTACT_ROWS * len(problem.model.BASE_PARAMETERS)))
    factor = max(factors, default=1)
    decimate = replace(how, factor=max(factor, min(LIMIT.CONTACT_THINNING * factor, most)))
    settings = replace(problem.settings, signals=replace(signals, decimate=decimate))
    return problem.changed(settings=settings)


def _choices(problem: Problem, records: Sequence[Record]) -> tuple[Choice, list[Choice]]:
    """Choose one cut-off for all records, and one for each; pieces between gaps are one record."""
    signals, rows = problem.settings.signals, problem.settings.rows
    crossing = np.inf if isinstance(signals.velocity, str) else signals.velocity
    counts = problem.reader.encoder is not None
    read = [lines_of(r.q[excerpt(r, rows)], r.rate, signals, crossing) for r in records]
    common = chosen_cutoff(read, signals, counts)
    wholes = [r.origin.whole or str(k) for k, r in enumerate(records)]
    if len(set(wholes)) <= 1:
        return common, [common] * len(records)
    found = {
        whole: chosen_cutoff(
            [one for one, own in zip(read, wholes, strict=True) if own == whole], signals, counts
        )
        for whole in wholes
    }
    return common, [found[whole] for whole in wholes]


def _by_record(records: Sequence[Record], choices: Sequence[Choice]) -> str:
    """Tell in one sentence the cut-offs of records that differ, and what decides them."""
    names: dict[tuple[float, str], list[str]] = {}
    for name, one in zip(record_names(records), choices, strict=True):
        names.setdefault((one.hertz, one.why), []).append(name)
    parts = [
        f"at {hertz:g} Hz for {', '.join(own) if len(own) <= NAMED else f'{len(own)} records'} ({why})"
        for (hertz, why), own in sorted(names.items())
    ]
    return f"Low-pass by record (cutoff: auto): {'; '.join(parts)}."
