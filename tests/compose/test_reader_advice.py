"""Readers of real encoders: known by what they are, never by their name."""

from dataclasses import replace

import pytest
from features import FEATURES

from runtime import compose
from runtime.advisor.readers import encoder_readers, readers_in_words
from runtime.core.signals.reader import Reader, lowpassed
from runtime.ground.errors import SettingsError
from runtime.ground.limits import limits

LIMIT = limits("runtime.advisor")
TWIN = "twinned"


@pytest.fixture
def few(monkeypatch):
    """Short curves."""
    for name, value in (("READER_DOWN", 1), ("READER_UP", 2), ("PHASES_TAKEN", 1)):
        monkeypatch.setattr(LIMIT, name, value)


def real_encoders(case, reader, **options):
    """Advice on the second encoder as a real one, of a study with this reader."""
    signals = replace(case.study.signals, reader=reader)
    cestac = replace(case.study.cestac, rounding="phase")
    study = replace(case.study, signals=signals, cestac=cestac)
    options = {"confirm": False, "encoders": ("2",), "asked": (2e-2,), **options}
    return compose.advise(case.model, case.records, study, **options)


@pytest.mark.parametrize(
    ("feature", "reader"), [("recorded speeds", "lowpass"), ("counts", "counts")]
)
def test_a_reader_under_another_name_is_advised_as_the_reader(
    tmp_path, monkeypatch, few, feature, reader
):
    case = FEATURES[feature](tmp_path)
    expected = real_encoders(case, reader)
    monkeypatch.setitem(compose.READERS, TWIN, compose.READERS[reader])
    found = real_encoders(case, TWIN)
    assert found.to_json().replace(TWIN, reader) == expected.to_json()
    assert str(found) == str(expected)
    assert found.brief() == expected.brief()


def test_one_reader_alone_is_advised_and_drawn(tmp_path, few):
    advice = real_encoders(FEATURES["nothing"](tmp_path), "lowpass", readers=["lowpass"])
    assert [one.reader for one in advice.real] == ["lowpass"]
    assert [figure.name for figure in advice.figures()] == ["advice"]


def test_a_reader_of_no_encoders_is_refused_and_not_tried(tmp_path):
    with pytest.raises(SettingsError, match="'static'; expected lowpass or counts"):
        real_encoders(FEATURES["nothing"](tmp_path), "lowpass", readers=["static"])
    listed = {**compose.READERS, "toy": Reader(lowpassed)}
    assert list(encoder_readers(listed, "lowpass")) == ["lowpass", "counts"]


def test_readers_that_read_alike_are_told_apart():
    other = Reader(lowpassed, linear=True)
    listed = {name: compose.READERS[name] for name in ("lowpass", "counts")} | {"own": other}
    words = readers_in_words(listed)
    assert words == {"lowpass": "positions (lowpass)", "counts": "counts", "own": "positions (own)"}
