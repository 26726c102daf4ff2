"""Angles that start anew at full turns: continued where the study says so, proposed where they jump."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import symgen
from runtime.compose import read_record
from runtime.core.record import Record
from runtime.reading.settings import RecordSettings
from runtime.study import Study, study_from_mapping, suggested

planar_2r = symgen.model("planar_2r")
t = np.arange(2000) / 200
q = np.column_stack([9 * np.sin(0.7 * t), 4 * t - 3 * np.cos(t)])
tau = np.column_stack([np.cos(t), np.sin(t)])


def wrapped(path: Path, positions: np.ndarray, columns: str = "t,q1,q2,tau1,tau2") -> Path:
    """A log whose positions lie between -180 and 180 degrees."""
    table = np.column_stack([t, (positions + 180) % 360 - 180, tau])
    np.savetxt(path, table, delimiter=",", header=columns, comments="")
    return path


def read(path: Path, **settings: object) -> Record:
    record = {"files": [str(path)], "units": {"q": "deg"}, **settings}
    return read_record(study_from_mapping({"record": record}).record[0], planar_2r)


def test_continued_from_the_first_sample_on(tmp_path: Path) -> None:
    record = read(wrapped(tmp_path / "a.csv", np.degrees(q)), unwrap=True)
    np.testing.assert_allclose(record.q - record.q[0], q - q[0], atol=1e-9)


def test_as_they_are_without_the_key(tmp_path: Path) -> None:
    record = read(wrapped(tmp_path / "a.csv", np.degrees(q)))
    assert np.abs(np.diff(record.q, axis=0)).max() > 6


@pytest.mark.parametrize("scale", [1.0, -1.0])
def test_a_turn_is_one_of_the_side_that_was_recorded(tmp_path: Path, scale: float) -> None:
    """Encoders that turn the other way, by `record.scale`, have the same turn."""
    path = wrapped(tmp_path / "a.csv", scale * np.degrees(q))
    record = read(path, unwrap=True, scale={"q": scale})
    np.testing.assert_allclose(record.q - record.q[0], q - q[0], atol=1e-9)


def test_lengths_have_no_turn(tmp_path: Path) -> None:
    path = wrapped(tmp_path / "a.csv", np.zeros_like(q))
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    table[:, 2] = np.where(t > 5, 7.0, 0.0)
    np.savetxt(path, table, delimiter=",", header="t,q1,q2,tau1,tau2", comments="")
    record = read(path, unwrap=True, units={"q": ["deg", "m"]})
    assert record.q[-1, 1] == 7


def test_proposed_where_positions_jump_by_turns(tmp_path: Path) -> None:
    record = RecordSettings(files=(str(wrapped(tmp_path / "a.csv", np.degrees(q))),))
    for columns in ("t,q1 [deg],q2 [deg],tau1,tau2", "time,q_1 [deg],q_2 [deg],tau_1,tau_2"):
        wrapped(tmp_path / "a.csv", np.degrees(q), columns)
        found = suggested(replace(Study(), record=(record,)), planar_2r)
        assert found.study.record[0].unwrap
        assert "unwrap: true" in found.sentences[-1]


def test_not_proposed_for_fast_positions_in_a_wrong_unit(tmp_path: Path) -> None:
    """Degrees of a motor read as rad: steps beyond a turn are the motion itself."""
    path = tmp_path / "a.csv"
    fast = 80 * np.degrees(0.8 * np.sin(4 * t)[:, None] * [1.0, 0.7])
    np.savetxt(
        path,
        np.column_stack([t, fast, tau]),
        delimiter=",",
        header="t,q1,q2,tau1,tau2",
        comments="",
    )
    study = replace(Study(), record=(RecordSettings(files=(str(path),)),))
    assert np.abs(np.diff(fast, axis=0)).max() > 5 * np.pi
    assert not suggested(study, planar_2r).study.record[0].unwrap


def test_not_proposed_where_they_do_not(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    jumps = q + np.where(t[:, None] > 5, 4.0, 0.0)  # of no whole turn
    np.savetxt(
        path,
        np.column_stack([t, jumps, tau]),
        delimiter=",",
        header="t,q1,q2,tau1,tau2",
        comments="",
    )
    study = replace(Study(), record=(RecordSettings(files=(str(path),)),))
    found = suggested(study, planar_2r)
    assert not found.study.record[0].unwrap and not found.sentences
