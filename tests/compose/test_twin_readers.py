"""A reader that is lowpass, counts or static under another name gives the numbers and sentences of the original."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from features import FEATURES, Case, arm, motion, noise, record, study
from test_matrix import case_of, quick

from runtime import compose
from runtime.core.record import Record
from runtime.core.signals.filters import States
from runtime.core.signals.reader import LOWPASS, Reader, lowpassed
from runtime.ground.errors import InputError, SettingsError

TWIN = "another_name"
SAMPLE = {
    "estimate": ("nothing", "recorded speeds", "motor side", "link side"),
    "identify": ("counts", "missing samples", "poses at rest", "force sensors"),
    "cestac": ("nothing", "recorded speeds", "counts", "missing samples", "poses at rest"),
    "advise": ("recorded speeds", "counts"),
    "delay": ("nothing", "poses at rest"),
    "plausibility": ("nothing", "counts"),
    "friction": ("nothing", "poses at rest"),
    "assess": ("recorded speeds",),
}
"""Features by entry point; all others are a campaign."""


def called(entry: str, case: Case) -> list[Any]:
    """Numbers and sentences of an entry point, or its refusal."""
    model, records, settings = case.model, case.records, case.study
    try:
        if entry == "estimate":
            found: Any = compose.estimate(model, records, settings)
            return [found.X, found.sigma, found.sigma_corrected]
        if entry == "identify":
            found = compose.identify(model, records, settings, further=case.unseen)
            return [*_sets(found), found.prediction_error, found.to_text()]
        if entry == "cestac":
            found = compose.cestac(model, records, settings)
            return [found.reference.X, *(x for one in found.levels for x in (one.mean, one.sigma))]
        if entry == "advise":
            asked = (2e-3,)
            found = compose.advise(model, records, quick(settings), asked=asked, confirm=False)
            return [found.steps, found.verdict]
        if entry == "delay":
            return [compose.delay(model, records[0], settings).shift]
        if entry == "plausibility":
            found = compose.plausibility(model, records, settings)
            return [check.sentence for check in found.checks()]
        if entry == "friction":
            found = compose.identify(model, records, settings, friction=True)
            return [curve.f for curve in found.part("friction").curves]
        found = compose.assess(model, records, settings)
        return [*_sets(found), *found.missing, found.to_text()]
    except InputError as refusal:
        return [str(refusal)]


def _sets(found: Any) -> list[Any]:
    return [x for fit in found.sets.values() for x in (fit.X, fit.sigma)]


@pytest.mark.parametrize(
    ("entry", "feature"),
    [
        pytest.param(entry, feature, marks=() if feature in sample else pytest.mark.campaign)
        for entry, sample in SAMPLE.items()
        for feature in FEATURES
    ],
)
def test_a_reader_under_another_name_is_the_same(monkeypatch, entry, feature):
    case = case_of(feature)
    signals = case.study.signals
    monkeypatch.setitem(compose.READERS, TWIN, replace(compose.READERS[signals.reader]))
    renamed = replace(case.study, signals=replace(signals, reader=TWIN))
    expected = called(entry, case)
    found = called(entry, replace(case, study=renamed))
    assert len(found) == len(expected)
    for mine, own in zip(found, expected, strict=True):
        if isinstance(own, str):
            assert mine.replace(TWIN, signals.reader) == own
        else:
            np.testing.assert_array_equal(mine, own)


def doubled(record: Record, signals: Any) -> States:
    return lowpassed(replace(record, q=2 * record.q), signals)


def test_torque_steps_alone_are_studied_on_the_rows_of_the_reader(monkeypatch):
    """The rows were those of the low-pass, 2020 % off, without a word."""
    monkeypatch.setitem(compose.READERS, "double", replace(LOWPASS, states=doubled))
    steps = {"delta": [], "torque": [1e-3], "runs": 2, "columns": "all"}
    settings = study(signals={"reader": "double"}, cestac=steps)
    model = arm()
    X = compose.estimate(model, [record(model, 0)], settings).X
    found = compose.cestac(model, [record(model, 0)], settings)
    np.testing.assert_allclose(found.levels[0].mean, X, rtol=0.01)


def test_steps_of_encoders_are_read_as_the_reader_reads_positions(monkeypatch):
    """A reader that doubles halved positions is the low-pass, also for rounded ones."""
    monkeypatch.setitem(compose.READERS, "double", replace(LOWPASS, states=doubled))
    model = arm()
    t, q, qd, _ = motion(0)
    tau = record(model, 0).tau
    speeds = qd + noise(7, q.shape, 1e-3)
    whole, half = (Record(t, x, tau, rate=200.0, qd=speeds) for x in (q, q / 2))
    signals = {"velocity": "differences"}
    coarse = {"delta": [2e-3], "runs": 2, "columns": "all"}
    plain = compose.cestac(model, [whole], study(signals=signals, cestac=coarse))
    finer = study(signals=signals | {"reader": "double"}, cestac=coarse | {"delta": [1e-3]})
    found = compose.cestac(model, [half], finer)
    np.testing.assert_allclose(found.levels[0].mean, plain.levels[0].mean, rtol=1e-9)


def test_a_reader_that_reads_no_rounded_positions_says_so(monkeypatch):
    monkeypatch.setitem(compose.READERS, "smooth", Reader(lowpassed))
    model = arm()
    settings = study(signals={"reader": "smooth"})
    with pytest.raises(
        SettingsError, match=r"cestac\.delta: .*smooth cannot read rounded positions"
    ):
        compose.cestac(model, [record(model, 0)], settings)
    torque = study(signals={"reader": "smooth"}, cestac={"delta": [], "torque": [0.1], "runs": 2})
    assert np.isfinite(compose.cestac(model, [record(model, 0)], torque).levels[0].mean).all()


def test_a_setting_of_another_reader_is_refused_by_the_list_of_readers(monkeypatch):
    """The keys `step` and `side` belong to counts, and to every reader with its class of settings."""
    monkeypatch.setitem(compose.READERS, TWIN, replace(compose.READERS["counts"]))
    model = arm()
    for key, value in {"step": 1e-3, "side": "motor"}.items():
        settings = study(signals={key: value})
        said = f"signals.{key}: the reader lowpass does not use this key; set reader: counts or {TWIN}, or remove"
        with pytest.raises(SettingsError, match=said):
            compose.problem(model, [record(model, 0)], settings)
    twin = study(signals={"reader": TWIN, "step": 1e-3})
    assert compose.complete_study(twin).signals.step == 1e-3
