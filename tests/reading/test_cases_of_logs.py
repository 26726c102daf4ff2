"""Logs of the cases: hdf5, lerobot, stamps, studio, apply_rotors, from file to values."""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from runtime.ground.clock import counted_rate, resolution
from runtime.ground.errors import InputError
from runtime.reading.formats import read_table
from runtime.reading.likely_columns import known_columns, likely_columns
from runtime.reading.units import likely_time_unit
from runtime.study import load_study
from symgen.cli.main import app

sys.path.insert(0, str(Path(__file__).parent))
from column_lists import LISTS

DATA = os.environ.get("SYMGEN_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data"
CASES = Path(DATA).parent / "cases5"
SIX = ("j_pan", "j_lift", "j_elbow", "j_roll", "j_bend", "j_turn")


def identified(*arguments: object) -> tuple[int, str, str]:
    """Exit code, output and messages of `symgen identify --no-plausible`."""
    command = ["identify", *map(str, arguments), "--no-plausible"]
    result = CliRunner().invoke(app, command)
    return result.exit_code, result.stdout, result.stderr


def value(text: str, name: str) -> float:
    found = re.search(rf"\b{name} +([-0-9.e]+) +\+-", text)
    assert found, text
    return float(found[1])


@pytest.mark.parametrize("case", ["hdf5", "lerobot"])
def test_logs_of_learning_are_read(case: str) -> None:
    code, text, _ = identified(CASES / case / "two.urdf", CASES / case / "log.yaml")
    assert code == 0
    assert value(text, "MX1R") == pytest.approx(0.540, abs=2e-3)
    assert value(text, "MX2") == pytest.approx(0.100, abs=1e-3)


@pytest.mark.parametrize("file", ["rounded.csv.gz", "nanoseconds.npz"])
def test_stamps_rounded_and_in_nanoseconds(file: str, tmp_path: Path) -> None:
    """Rounded to 10 ms at 200 Hz: counted, never interpolated; nanoseconds by their size."""
    study = tmp_path / "study.yaml"
    code, text, _ = identified(
        CASES / "stamps" / "two.urdf", CASES / "stamps" / file, "--suggest", study
    )
    assert code == 0 and "study.yaml is written" in text
    assert value(text, "ZZ1R") == pytest.approx(0.1887, abs=1e-3)
    assert value(text, "ZZ2") == pytest.approx(0.0180, abs=5e-4)
    record = load_study(study).record[0]
    if file == "rounded.csv.gz":
        assert record.resample is not None
        assert (record.resample.method, record.resample.rate) == ("count", 200.0)
    else:
        assert record.units.t == "ns" and record.resample is None


def test_units_in_names_and_per_joint(tmp_path: Path) -> None:
    study = tmp_path / "study.yaml"
    case = CASES / "apply_rotors"
    code, text, _ = identified(case / "lab6.urdf", case / "run.csv.gz", "--suggest", study)
    assert code == 0 and "study.yaml is written" in text and "Check this file" in text
    written, right = load_study(study).record[0], load_study(case / "log.yaml").record[0]
    assert written.columns == right.columns
    assert (written.units.t, written.units.q) == (right.units.t, right.units.q)


def test_what_is_not_recognised_is_told(tmp_path: Path) -> None:
    """Three of six positions: named by their joints, marked in the file; no error."""
    table = read_table(CASES / "apply_rotors" / "run.csv.gz")
    names = [re.sub("(roll|pitch)_pos_rad", r"\1_x", name) for name in table.names]
    lines = [",".join(names)]
    lines += [",".join(map(str, row)) for row in np.column_stack([*table.columns.values()])[:50]]
    (tmp_path / "run.csv").write_text("\n".join(lines).replace("nan", "RUN"))
    study = tmp_path / "study.yaml"
    robot = CASES / "apply_rotors" / "lab6.urdf"
    code, text, said = identified(robot, tmp_path / "run.csv", "--suggest", study)
    assert code == 0 and "error" not in text + said
    assert "\n- positions of joints 4 to 6\n" in text and f"{robot} {study}" in text
    assert "# ? record.columns.q: positions of joints 4 to 6" in study.read_text()
    code, _, said = identified(robot, tmp_path / "run.csv")
    assert code == 2 and "identify --suggest FILE" in said


def test_hdf5_without_a_time_asks_for_the_rate(tmp_path: Path) -> None:
    study = tmp_path / "study.yaml"
    case = CASES / "hdf5"
    code, text, _ = identified(case / "two.urdf", case / "episode_0.hdf5", "--suggest", study)
    assert code == 0 and "- time, or the sampling rate in record.rate" in text
    assert "q: [observations.qpos]" in study.read_text()


def test_degrees_are_asked_for(tmp_path: Path) -> None:
    study = tmp_path / "study.yaml"
    case = CASES / "lerobot"
    code, text, _ = identified(case / "two.urdf", case / "file-000.parquet", "--suggest", study)
    assert code == 0 and "- unit of the positions, which reach 102" in text
    study.write_text(study.read_text().replace("q: rad", "q: deg"))
    code, text, _ = identified(case / "two.urdf", study)
    assert code == 0 and value(text, "MX1R") == pytest.approx(0.540, abs=2e-3)


def test_names_of_a_lerobot_dataset(tmp_path: Path) -> None:
    """The names of meta/info.json are columns beside the arrays; episodes restart the time."""
    data = tmp_path / "data" / "chunk-000"
    data.mkdir(parents=True)
    shutil.copy(CASES / "lerobot" / "file-000.parquet", data)
    (tmp_path / "meta").mkdir()
    features = {
        "observation.state": {"names": ["shoulder.pos", "elbow.pos"]},
        "observation.effort": {"names": {"motors": ["shoulder", "elbow"]}},
    }
    (tmp_path / "meta" / "info.json").write_text(json.dumps({"fps": 200, "features": features}))
    table = read_table(data / "file-000.parquet")
    state = table.columns["observation.state"]
    assert np.array_equal(table.columns["observation.state.elbow.pos"], state[:, 1])
    found = likely_columns(table.columns, ("elbow", "shoulder"))["columns"]
    assert found["q"] == ["observation.state.elbow.pos", "observation.state.shoulder.pos"]
    assert found["tau"] == ["observation.effort.elbow", "observation.effort.shoulder"]


def test_lists_of_other_lengths_are_refused(tmp_path: Path) -> None:
    import polars

    frame = polars.DataFrame({"a": [[1.0, 2.0], [3.0]], "b": [[1, 2], [3, 4]]})
    frame.write_parquet(tmp_path / "a.parquet")
    table = read_table(tmp_path / "a.parquet")
    assert np.array_equal(table.columns["b"], [[1, 2], [3, 4]])
    with pytest.raises(InputError, match="lists of the column have 1 to 2 numbers"):
        table.read(["a"])


def test_json_lines(tmp_path: Path) -> None:
    rows = [
        {
            "stamp": 0.1 * k,
            "state": {"pos": [k, 2.0 * k]},
            "mode": "RUN",
            "x": None if k == 3 else k,
        }
        for k in range(5)
    ]
    path = tmp_path / "log.jsonl"
    path.write_text("\n".join(json.dumps(row) for row in rows) + "\n")
    table = read_table(path)
    assert np.array_equal(table.columns["state.pos"][:, 1], 2.0 * np.arange(5))
    assert table.empty == {"x": "line 4"}
    with pytest.raises(InputError, match="expected a number"):
        table.read(["mode"])
    path.write_text('{"a": 1}\n{"a": \n')
    with pytest.raises(InputError, match="line 2"):
        read_table(path)


def test_commanded_columns_are_not_taken_beside_measured_ones() -> None:
    names = read_table(CASES / "studio" / "goals.csv").names
    found = likely_columns(names, SIX)["columns"]
    assert found["q"] == [f"/joint_states/j{j}/position" for j in range(1, 7)]
    assert found["tau"] == [f"/joint_states/j{j}/effort" for j in range(1, 7)]


def test_utf16_is_read_and_a_picture_is_told() -> None:
    table = read_table(CASES / "studio" / "utf16.csv")
    found = likely_columns(table.columns, SIX)
    assert len(table.columns["Time_ms"]) > 100 and not table.refused
    assert found["units"] == {"t": "ms", "q": "deg", "tau": "Nm"}
    with pytest.raises(InputError, match="89 50 4e 47, are those of a picture"):
        read_table(CASES / "studio" / "picture.csv")


@pytest.mark.parametrize("one", LISTS, ids=lambda one: one.title)
def test_column_lists(one) -> None:
    assert one.agrees(known_columns(one.names, one.joints))


@pytest.mark.parametrize(
    ("factor", "unit"),
    [(1.0, "s"), (1e3, "ms"), (1e6, "us"), (1e9, "ns")],
    ids=["s", "ms", "us", "ns"],
)
@pytest.mark.parametrize("rate", [5.5, 30.0, 1000.0, 4900.0])
def test_time_units_by_size(factor: float, unit: str, rate: float) -> None:
    assert likely_time_unit(factor * (3 + np.arange(300) / rate)) == unit


@pytest.mark.parametrize(("u", "rate"), [(0.01, 200), (0.001, 150), (0.01, 1000), (0.001, 333)])
def test_rate_of_rounded_stamps(u: float, rate: float) -> None:
    t = np.arange(4000) / rate
    assert resolution(np.floor(t / u) * u) == u
    assert counted_rate(np.floor(t / u) * u) == rate
    jittered = t + np.random.default_rng(0).uniform(-0.3, 0.3, len(t)) / rate
    assert counted_rate(jittered) is None


def test_a_column_time_is_a_time(tmp_path: Path) -> None:
    table = read_table(CASES / "hdf5" / "episode_0.hdf5")
    q, tau = table.columns["observations.qpos"], table.columns["observations.effort"]
    robot = CASES / "hdf5" / "two.urdf"
    for name, step, code in (("seconds", 0.005, 0), ("milliseconds", 5.0, 2)):
        rows = np.column_stack([step * np.arange(len(q)), q, tau])
        path = tmp_path / f"{name}.csv"
        np.savetxt(path, rows, delimiter=",", header="time,q1,q2,tau1,tau2", comments="")
        found, text, said = identified(robot, path)
        assert found == code
        if code:
            assert "set record.units.t: ms" in said and "--suggest FILE" in said
        else:
            assert value(text, "MX2") == pytest.approx(0.100, abs=1e-3)


def test_milliseconds_of_a_record_that_is_read_as_it_is(tmp_path: Path) -> None:
    table = read_table(CASES / "hdf5" / "episode_0.hdf5")
    q, tau = table.columns["observations.qpos"], table.columns["observations.effort"]
    rows = np.column_stack([5.0 * np.arange(len(q)), q, tau])
    path, study = tmp_path / "log.csv", tmp_path / "study.yaml"
    np.savetxt(path, rows, delimiter=",", header="t,q1,q2,tau1,tau2", comments="")
    code, text, _ = identified(CASES / "hdf5" / "two.urdf", path, "--suggest", study)
    assert code == 0 and "- record: units: {t: ms}, because time steps of 5 s are too long" in text
    assert load_study(study).record[0].units.t == "ms"
    assert value(text, "MX2") == pytest.approx(0.100, abs=1e-3)


def test_a_null_row_of_lists_is_missing(tmp_path: Path) -> None:
    import polars

    polars.DataFrame({"a": [[1.0, 2.0], None, [3.0, 4.0]]}).write_parquet(tmp_path / "a.parquet")
    with pytest.raises(InputError, match="lists of the column have 0 to 2 numbers"):
        read_table(tmp_path / "a.parquet").read(["a"])


def test_episodes_are_records(tmp_path: Path) -> None:
    """Three episodes in one file: the time starts anew at each; counted, not interpolated."""
    table = read_table(CASES / "lerobot" / "file-000.parquet")
    q = np.radians(table.columns["observation.state"])
    t = np.float32(np.concatenate([np.arange(n) / 200 for n in (1200, 1000, 800)]))
    rows = np.column_stack([t, q, table.columns["observation.effort"]])
    path, study = tmp_path / "log.csv", tmp_path / "study.yaml"
    np.savetxt(path, rows, delimiter=",", header="timestamp,q1,q2,tau1,tau2", comments="")
    code, text, _ = identified(CASES / "hdf5" / "two.urdf", path, "--suggest", study)
    resample = load_study(study).record[0].resample
    assert code == 0 and "(3 of 3)" in text
    assert resample is not None
    assert (resample.method, resample.gaps, resample.rate) == ("count", "split", 200)
    assert value(text, "MX2") == pytest.approx(0.100, abs=1e-3)


def test_objects_of_motors_in_a_list(tmp_path) -> None:
    """A log of one object per motor: its values are arrays, as if there were a list of each."""
    path, q = tmp_path / "log.jsonl", np.random.default_rng(0).normal(size=(4, 3))
    lines = [
        {"stamp": k, "motors": [{"q": float(x), "state": {"tau": -float(x)}} for x in row]}
        for k, row in enumerate(q)
    ]
    path.write_text("\n".join(map(json.dumps, lines)))
    table = read_table(path)
    assert table.names == ("stamp", "motors.q", "motors.state.tau")
    np.testing.assert_array_equal(table.columns["motors.q"], q)
    np.testing.assert_array_equal(table.columns["motors.state.tau"], -q)
    lines[2]["motors"][1] = {"state": {"tau": 0.0}}
    path.write_text("\n".join(map(json.dumps, lines)))
    with pytest.raises(InputError, match=r"column 'motors\.q', line 3"):
        read_table(path).read(["motors.q"])
