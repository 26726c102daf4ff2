"""One Step, Reader, Method and format each, added from outside the package as one line of a list, named in a study file, and seen through the command line: printed and exported; a toy Part: test_toy_part."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from features import arm, record
from typer.testing import CliRunner

from runtime import compose
from runtime.core.least_squares.linear import ordinary
from runtime.core.least_squares.method import Beginning, Fitted, Method
from runtime.core.problem import Note, Problem
from runtime.core.record import Record
from runtime.core.signals.filters import States
from runtime.core.signals.reader import Reader, lowpassed
from runtime.ground import settings_errors
from runtime.ground.errors import SettingsError
from runtime.ground.settings import Count, Positive, Settings
from runtime.reading import formats
from runtime.reading.formats import Format
from runtime.reading.text import read_text
from runtime.study import Signals, study_from_mapping
from symgen.cli.main import app

COLUMNS = "t,q1,q2,tau1,tau2"
SHRINK = 1e-3


@pytest.fixture
def log(tmp_path):
    """A CSV file of the planar arm of the package."""
    import symgen

    model = symgen.model("planar_2r")
    one = record(arm(), 0)
    X = model.base_parameters(model.VALUES)
    q = one.q
    qd = np.gradient(q, one.t, axis=0)
    qdd = np.gradient(qd, one.t, axis=0)
    tau = model.inverse_dynamics(q, qd, qdd, X)
    table = np.column_stack([one.t, q, tau])
    path = tmp_path / "log.csv"
    np.savetxt(path, table, "%.12g", ",", header=COLUMNS, comments="")
    return path


def identified(folder, study, file="log.csv"):
    """What the command line prints of a study file, and estimate.json."""
    columns = "{t: t, q: [q1, q2], tau: [tau1, tau2]}"
    text = f"symgen: 1\nrecord: {{files: {file}, columns: {columns}}}\n{study}"
    path = folder / "study.yaml"
    path.write_text(text)
    words = ["identify", "planar_2r", path, "-o", folder / "out", "--no-plausible", "--verbose"]
    done = CliRunner().invoke(app, [str(word) for word in words])
    results = folder / "out" / "estimate.json"
    return done, json.loads(results.read_text()) if results.exists() else {}


def test_a_step_is_one_line_of_a_list(tmp_path, log, monkeypatch):
    """It doubles the torques, says so, and leaves its number in the results."""

    def doubled(problem: Problem) -> Problem:
        records = tuple(replace(r, tau=2 * r.tau) for r in problem.records)
        note = Note("toy", "All torques are doubled by a toy.", {"toy": {"factor": 2}})
        return problem.changed(note, records=records)

    _, before = identified(tmp_path, "")
    monkeypatch.setattr(compose, "STEPS", [*compose.STEPS, doubled])
    done, after = identified(tmp_path, "")
    assert done.exit_code in (0, 1), done.output
    assert "All torques are doubled by a toy." in done.stdout
    assert after["provenance"]["toy"] == {"factor": 2}
    np.testing.assert_allclose(after["X"], 2 * np.array(before["X"]), rtol=1e-9)


class ToyReaderOptions(Settings):
    """Options of the toy reader.

    Attributes
    ----------
    gain : float
        On the positions.
    """

    gain: Positive = 1.0


def toy_states(record: Record, signals: Signals) -> States:
    """Positions times the gain of signals.options, through the low-pass."""
    return lowpassed(replace(record, q=signals.options["gain"] * record.q), signals)


def test_a_reader_is_one_line_of_a_list(tmp_path, log, monkeypatch):
    """It has settings of its own, which are checked, and which the results hold."""
    monkeypatch.setitem(compose.READERS, "toy", Reader(toy_states, ToyReaderOptions))
    _, before = identified(tmp_path, "")
    done, same = identified(tmp_path, "signals: {reader: toy}\n")
    assert done.exit_code in (0, 1), done.output
    assert same["X"] == before["X"]
    assert same["settings"]["signals"]["options"] == {"gain": 1.0}
    done, scaled = identified(tmp_path, "signals: {reader: toy, options: {gain: 2}}\n")
    assert scaled["settings"]["signals"]["reader"] == "toy"
    assert scaled["settings"]["signals"]["options"] == {"gain": 2.0}
    t, q1, q2, *tau = np.loadtxt(log, delimiter=",", skiprows=1).T
    table = np.column_stack([t, 2 * q1, 2 * q2, *tau])
    np.savetxt(log, table, "%.12g", ",", header=COLUMNS, comments="")
    _, doubled = identified(tmp_path, "")
    np.testing.assert_allclose(scaled["X"], doubled["X"], rtol=1e-9)


@pytest.mark.parametrize(
    ("study", "said"),
    [
        ("{reader: toy, options: {gain: -1}}", "line 3: signals.options.gain: -1"),
        ("{reader: toy, options: {gian: 2}}", "line 3: signals.options.gian: unknown key"),
        (
            "{reader: tyo}",
            "line 3: signals.reader: 'tyo'; expected lowpass, counts or static",
        ),
        (
            "{options: {gain: 2}}",
            "line 3: signals.options: the reader lowpass has no options",
        ),
    ],
)
def test_settings_of_a_reader_are_checked(tmp_path, log, monkeypatch, study, said):
    if "toy" in study:
        toy = Reader(toy_states, ToyReaderOptions)
        monkeypatch.setitem(compose.READERS, "toy", toy)
    done, _ = identified(tmp_path, f"signals: {study}\n")
    assert done.exit_code == 2
    assert f"study.yaml, {said}" in done.stderr


class ToyMethodOptions(Settings):
    """Options of the toy method.

    Attributes
    ----------
    times : int
        So many times X is shrunk.
    """

    times: Count = 1


def shrunk(start: Beginning) -> Fitted:
    """X of ordinary least squares, shrunk."""
    times = start.options.times
    solution = replace(start.solution, X=start.solution.X * (1 - SHRINK) ** times)
    return Fitted(
        start.system, solution, message=f"Shrunk {times} times.", details={"times": times}
    )


def test_a_method_is_one_line_of_a_list(tmp_path, log, monkeypatch):
    _, before = identified(tmp_path, "")
    method = Method(ToyMethodOptions, ordinary, shrunk, weights=("none",))
    monkeypatch.setitem(compose.METHODS, "toy", method)
    done, found = identified(tmp_path, "estimate: {method: toy, options: {times: 3}}\n")
    assert done.exit_code in (0, 1), done.output
    assert "Shrunk 3 times." in done.stdout
    assert found["method"] == "toy"
    assert found["details"]["times"] == 3
    np.testing.assert_allclose(found["X"], np.array(before["X"]) * (1 - SHRINK) ** 3, rtol=1e-9)
    done, _ = identified(tmp_path, "estimate: {method: toy, options: {times: 0}}\n")
    assert done.exit_code == 2
    assert "estimate.options.times: 0; expected at least 1" in done.stderr
    done, _ = identified(tmp_path, "estimate: {method: yot}\n")
    assert done.exit_code == 2
    assert "line 3: estimate.method: 'yot'; expected ols, wls" in done.stderr


def test_a_format_is_one_line_of_a_list(tmp_path, log, monkeypatch):
    """A file of another ending, with a line of its own ahead of a CSV."""
    (tmp_path / "log.toy").write_text("TOY 1\n" + log.read_text())

    def read_toy(path, options):
        whole = path.with_suffix(".csv")
        assert path.read_text().startswith("TOY 1\n")
        return replace(read_text(whole, options), file=path.name)

    done, _ = identified(tmp_path, "", file="log.toy")
    assert done.exit_code == 2
    assert "unknown kind of file '.toy'" in done.stderr
    monkeypatch.setattr(
        formats, "FORMATS", [*formats.FORMATS, Format("a toy", (".toy",), read_toy)]
    )
    done, found = identified(tmp_path, "", file="log.toy")
    assert done.exit_code in (0, 1), done.output
    assert "log.toy" in json.dumps(found["provenance"])
    assert len(found["X"]) == len(found["names"])


@pytest.mark.parametrize(
    ("name", "said"),
    [("magic", "use ols"), ("other", "'other'; expected ols, wls")],
)
def test_a_method_that_went_is_told_from_one_that_is_unknown(
    tmp_path, log, monkeypatch, name, said
):
    monkeypatch.setattr(settings_errors, "WENT", {"estimate.method: magic": "use ols"})
    done, _ = identified(tmp_path, f"estimate: {{method: {name}}}\n")
    assert done.exit_code == 2
    assert f"study.yaml, line 3: estimate.method: {said}" in done.stderr
    study = study_from_mapping({"estimate": {"method": name}})
    with pytest.raises(SettingsError, match=f"estimate.method: {said}"):
        compose.problem(arm(), record(arm(), 0), study)
