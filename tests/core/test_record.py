"""Records and the reading of them: units and sides explicit, every bad input named with file,
column and line.
"""

import gzip
import hashlib
from copy import copy
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.io

from runtime import Record, read_record
from runtime.core.drives import Drives
from runtime.core.record import Origin
from runtime.ground.errors import InputError, SettingsError
from runtime.reading.records import read_records
from runtime.reading.settings import RecordSettings
from runtime.study import study_from_mapping

N, RATE = 60, 200.0
T = np.arange(N) / RATE
Q = np.stack([np.sin(T), np.cos(3 * T)], axis=1)
TAU = np.stack([T, T**2], axis=1)


def robot(drives):
    """A model with these drives."""
    given = {
        "ratio": drives.ratio,
        "offset": drives.offset,
        "torque_constant": drives.torque_constant,
    }
    return SimpleNamespace(NAME="arm", JOINTS=tuple(range(drives.n)), DRIVES=given)


def settings(**record):
    return study_from_mapping({"record": record}).record[0]


def write_csv(path, header="t,q1,q2,tau1,tau2", rows=None, delimiter=","):
    rows = np.column_stack([T, Q, TAU]) if rows is None else rows
    lines = [
        delimiter.join(format(x, ".17g") if not isinstance(x, str) else x for x in row)
        for row in rows
    ]
    text = "\n".join(([header] if header else []) + lines) + "\n"
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


def with_at(x, value):
    """A copy of x with `value` in the first column of sample 8."""
    x = x.copy()
    x[7, 0] = value
    return x


def cells():
    return [list(row) for row in np.column_stack([T, Q, TAU])]


# --- the record itself
# ------------------------------------------------------------------------------------------------


def test_record_is_a_read_only_copy():
    q = Q.copy()
    record = Record(T, q, TAU, rate=RATE)
    q[0, 0] = 9
    assert record.q[0, 0] == 0 and record.n == 2 and len(record) == N
    with pytest.raises(ValueError, match="read-only"):
        record.q[0, 0] = 1
    assert Record(T, Q[:, 0], TAU[:, 0], rate=RATE).q.shape == (N, 1)


@pytest.mark.parametrize(
    ("t", "q", "tau", "rate", "said"),
    [
        (T, Q[:-1], TAU, RATE, "expected the shapes (N,), (N, n), (N, n)"),
        (T, Q[:, :1], TAU, RATE, "expected the shapes (N,), (N, n), (N, n)"),
        (T[:5], Q[:5], TAU[:5], RATE, "at least 10"),
        (T, Q, TAU, 0.0, "positive"),
        (T, with_at(Q, np.nan), TAU, RATE, "column 'q1', sample 8"),
        (T, Q, with_at(TAU, np.inf), RATE, "column 'tau1', sample 8"),
    ],
)
def test_record_refuses(t, q, tau, rate, said):
    with pytest.raises(InputError) as e:
        Record(t, q, tau, rate=rate)
    assert said in str(e.value)


@pytest.mark.parametrize("rate", [200.0, 5000.0, 1 / 3])
def test_rate_comes_from_the_stamps(rate):
    record = Record(np.arange(N) / rate + 7, Q, TAU)
    assert record.rate == pytest.approx(rate, rel=1e-12) and record.name == "record"
    assert Record(record.t, Q, TAU, rate=1.0004 * rate).rate == 1.0004 * rate
    pieces = replace(record, t=record.t[5:25], q=Q[5:25], tau=TAU[5:25]), copy(record)
    assert [piece.rate for piece in pieces] == [record.rate] * 2


def shuffled(t):
    return np.concatenate([t[:30], t[30:][::-1]])


def late(t):
    return t + 0.3 / RATE * (np.arange(N) >= 30)


@pytest.mark.parametrize(
    ("t", "rate", "said"),
    [
        (T, 10 * RATE, "the time stamps have the rate 200 Hz, but record.rate is 2000 Hz"),
        (T / 10, RATE, "the time stamps have the rate 2000 Hz, but record.rate is 200 Hz"),
        (T[::-1], None, "sample 2: time goes from 0.295 s to 0.29 s; expected increasing time"),
        (shuffled(T), None, "sample 32: time goes from 0.295 s to 0.29 s"),
        (np.repeat(T[::2], 2), None, "sample 2: time goes from 0 s to 0 s"),
        (late(T), None, "sample 31: time is not uniform"),
        (
            T + 0.5 * (np.arange(N) >= 30),
            None,
            (
                "59 samples in 0.29 s (without pauses) give 200 Hz; the median step gives 200 Hz. Remedy: "
                "one Record for each piece"
            ),
        ),
        (
            T + np.random.default_rng(0).uniform(-0.4, 0.4, N) / RATE,
            None,
            "the median step gives 205.222 Hz. Remedy: runtime.resample(t, q), and so for tau",
        ),
    ],
)
def test_stamps_that_are_no_clock_are_refused(t, rate, said):
    """Believed, they made velocities ten times wrong."""
    with pytest.raises(InputError) as e:
        Record(t, Q, TAU, rate=rate, name="run")
    assert said in str(e.value) and str(e.value).startswith("run")


def test_jitter_is_allowed_where_it_is_said():
    jittered = Record(late(T), Q, TAU, origin=Origin(jitter=0.4))
    assert jittered.rate == pytest.approx(RATE, rel=1e-2)
    assert replace(jittered, name="again").origin.jitter == 0.4


def test_a_changed_record_loses_no_field():
    """At most ten fields, and each of them is there after `replace`."""
    drives = Drives(np.diag([10.0, 20.0]), np.zeros(2), np.ones(2), "none")
    record = Record(
        T,
        Q,
        TAU,
        rate=RATE,
        name="run",
        q_r=Q + 1,
        tau_ff=TAU + 1,
        tau_known=TAU / 2,
        missing=np.arange(len(T) * 2).reshape(-1, 2) % 7 == 0,
        origin=Origin({"a.csv": "00"}, "regular", 0.3, drives),
    )
    assert len(fields(Record)) <= 10
    np.testing.assert_array_equal(record.torque, TAU / 2)
    for field in fields(Record):
        same = replace(record, **{field.name: getattr(record, field.name)})
        for other in fields(Record):
            before, after = getattr(record, other.name), getattr(same, other.name)
            if isinstance(before, np.ndarray):
                np.testing.assert_array_equal(before, after)
            else:
                assert before is after or before == after, (field.name, other.name)
    moved = replace(record, q=Q + 0.5)
    np.testing.assert_array_equal(moved.torque, TAU / 2)
    assert moved.subtracted == record.subtracted != ""


# --- names
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("files", "names", "keys"),
    [
        (["log.1.csv", "log.2.csv"], ["log.1", "log.2"], ["log.1.csv", "log.2.csv"]),
        (
            ["day1/run.csv", "day2/run.csv"],
            ["day1/run", "day2/run"],
            ["day1/run.csv", "day2/run.csv"],
        ),
        (
            ["a/x/run.csv", "b/x/run.csv", "c.csv"],
            ["a/x/run", "b/x/run", "c"],
            ["a/x/run.csv", "b/x/run.csv", "c.csv"],
        ),
        (["run.csv", "run.csv"], ["run", "run (2)"], ["run.csv", "run.csv"]),
    ],
)
def test_records_of_several_files_have_names_of_their_own(tmp_path, files, names, keys):
    """Called by the part up to the first dot, one overwrote the other."""
    for file in files:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        write_csv(tmp_path / file)
    records = read_records([settings(files=file) for file in files], folder=str(tmp_path))
    assert [record.name for record in records] == names
    assert [list(record.files) for record in records] == [[key] for key in keys]


@pytest.mark.parametrize("folder", [".", Path(), "", None])
def test_folders_are_texts_or_paths(tmp_path, monkeypatch, folder):
    write_csv(tmp_path / "run.csv")
    monkeypatch.chdir(tmp_path)
    assert len(read_records([settings(files="run.csv")], folder=folder)) == 1


def test_errors_name_the_file(tmp_path):
    write_csv(tmp_path / "short.csv", rows=np.column_stack([T, Q, TAU])[:5])
    write_csv(tmp_path / "run.csv")
    with pytest.raises(
        InputError, match=r"^short\.csv: the record has 5 samples; expected at least 10"
    ):
        read_record(settings(files="short.csv"), folder=tmp_path)
    with pytest.raises(InputError, match=r"^run\.csv: the record has 2 joints, but arm has 3"):
        read_record(
            settings(files="run.csv"),
            SimpleNamespace(NAME="arm", JOINTS=(1, 2, 3), DRIVES=None),
            folder=tmp_path,
        )


# --- by a path alone
# --------------------------------------------------------------------------------------------------


def test_a_file_a_study_and_a_dataset_are_read_by_name(tmp_path, monkeypatch, emps_data, tx40_data):
    write_csv(tmp_path / "run.csv")
    (tmp_path / "study.yaml").write_text("record: {files: [run.csv], units: {q: deg}}\n")
    for path in (tmp_path / "run.csv", str(tmp_path / "run.csv")):
        np.testing.assert_array_equal(read_record(path).q, Q)
    np.testing.assert_allclose(read_record(tmp_path / "study.yaml").q, Q * np.pi / 180)
    monkeypatch.chdir(tmp_path)
    np.testing.assert_array_equal(read_record("run.csv").q, Q)
    assert read_record("emps").name == "emps"
    with pytest.raises(InputError, match=r"expected a dataset \(tx40, emps\), a study file"):
        read_record("nothing")
    with pytest.raises(InputError, match="has no drives"):
        read_record("tx40")
    (tmp_path / "two.yaml").write_text(
        "record: [{files: [run.csv]}, {files: [run.csv], name: b}]\n"
    )
    with pytest.raises(
        InputError,
        match=r"2 records \(or pieces between gaps\), but this function returns only one; use read_records, which returns all: run, b",
    ):
        read_record("two.yaml")


# --- kinds of files
# ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz", "a.txt"])
@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_plain_file_needs_no_column_names(tmp_path, name, delimiter):
    path = write_csv(
        tmp_path / name,
        header=delimiter.join(["t", "q1", "q2", "tau1", "tau2"]),
        delimiter=delimiter,
    )
    record = read_record(settings(files=path.name), folder=tmp_path)
    np.testing.assert_array_equal(record.q, Q)
    np.testing.assert_array_equal(record.tau, TAU)
    assert record.rate == pytest.approx(RATE) and record.name == "a"


def test_hash_is_that_of_the_uncompressed_bytes(tmp_path):
    plain = write_csv(tmp_path / "a.csv")
    packed = write_csv(tmp_path / "b.csv.gz")
    digest = hashlib.sha256(plain.read_bytes()).hexdigest()
    assert read_record(settings(files=str(plain))).files == {"a.csv": digest}
    assert read_record(settings(files=str(packed))).files == {"b.csv.gz": digest}


def test_two_files_of_one_name_keep_both_hashes(tmp_path):
    for folder, header, x in (("a", "q1,q2", Q), ("b", "tau1,tau2", TAU)):
        (tmp_path / folder).mkdir()
        write_csv(tmp_path / folder / "x.csv", header=header, rows=x)
    assert set(
        read_record(settings(files=["a/x.csv", "b/x.csv"], rate=RATE), folder=tmp_path).files
    ) == {"a/x.csv", "b/x.csv"}


def test_file_without_header_counts_its_columns(tmp_path):
    write_csv(tmp_path / "a.csv", header="")
    record = read_record(
        settings(files="a.csv", columns={"t": 1, "q": [2, 3], "tau": [4, 5]}), folder=tmp_path
    )
    np.testing.assert_array_equal(record.q, Q)


def test_two_files_with_equal_column_names(tmp_path):
    write_csv(tmp_path / "q.csv", header="Joint_1,Joint_2", rows=Q)
    write_csv(tmp_path / "tau.csv", header="# torques\nJoint_1,Joint_2", rows=TAU)
    columns = {"q": ["Joint_1", "Joint_2"], "tau": ["Joint_1", "Joint_2"]}
    record = read_record(
        settings(files=["q.csv", "tau.csv"], columns=columns, rate=RATE), folder=tmp_path
    )
    np.testing.assert_array_equal(record.q, Q)
    np.testing.assert_array_equal(record.tau, TAU)
    np.testing.assert_allclose(record.t, T)
    assert set(record.files) == {"q.csv", "tau.csv"}


def test_arrays_of_npz_and_mat(tmp_path):
    np.savez(tmp_path / "a.npz", t=T, q=Q, tau=TAU, note=np.array("text"))
    scipy.io.savemat(
        tmp_path / "a.mat",
        {"t": T[None, :], "pos": Q, "u1": TAU[:, :1], "u2": TAU[:, 1:], "gain": 2.0, "s": {"x": 1}},
    )
    a = read_record(
        settings(files="a.npz", columns={"t": "t", "q": "q", "tau": "tau"}), folder=tmp_path
    )
    b = read_record(
        settings(
            files="a.mat",
            columns={"t": "t", "q": "pos", "tau": ["u1", "u2"]},
            scale={"tau": "gain"},
        ),
        folder=tmp_path,
    )
    np.testing.assert_array_equal(a.q, b.q)
    np.testing.assert_array_equal(2 * a.tau, b.tau)


def test_pickled_objects_are_refused(tmp_path):
    np.savez(tmp_path / "a.npz", q=np.array([object()], dtype=object))
    with pytest.raises(InputError, match="not an archive of plain arrays"):
        read_record(settings(files="a.npz"), folder=tmp_path)


# --- units and sides
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("units", "extra", "factor"),
    [
        ({"q": "deg"}, {}, np.pi / 180),
        ({"q": "rev"}, {}, 2 * np.pi),
        ({"q": "mm"}, {}, 1e-3),
        ({"q": "counts"}, {"counts_per_revolution": 4000}, 2 * np.pi / 4000),
        ({"q": ["rad", "mm"]}, {}, [1, 1e-3]),
        ({"q": ["counts", "m"]}, {"counts_per_revolution": [4000, 1]}, [2 * np.pi / 4000, 1]),
    ],
)
def test_position_units(tmp_path, units, extra, factor):
    write_csv(tmp_path / "a.csv")
    np.testing.assert_allclose(
        read_record(settings(files="a.csv", units=units, **extra), folder=tmp_path).q, Q * factor
    )


def test_time_in_milliseconds(tmp_path):
    write_csv(tmp_path / "a.csv", rows=np.column_stack([1000 * T, Q, TAU]))
    assert read_record(
        settings(files="a.csv", units={"t": "ms"}), folder=tmp_path
    ).rate == pytest.approx(RATE)


def test_torque_constants(tmp_path):
    """A and V are turned into torque by the constant of the settings, then of the drives; N*m by
    none.
    """
    write_csv(tmp_path / "a.csv")
    drives = Drives(np.array([[10.0, 0], [5, 20]]), 0.0, [0.1, 0.2])

    def tau(**record):
        return read_record(settings(files="a.csv", **record), robot(drives), folder=tmp_path).tau

    np.testing.assert_allclose(tau(side="motor"), TAU @ drives.ratio)
    np.testing.assert_allclose(
        tau(side="motor", units={"tau": "A"}), (TAU * [0.1, 0.2]) @ drives.ratio
    )
    np.testing.assert_allclose(
        tau(side="motor", units={"tau": ["A", "N*m"]}), (TAU * [0.1, 1]) @ drives.ratio
    )
    np.testing.assert_allclose(
        tau(side="motor", units={"tau": "A"}, torque_constant=3), (3 * TAU) @ drives.ratio
    )
    np.testing.assert_allclose(
        tau(side="joint", units={"tau": "V"}, torque_constant=[3, 4]), TAU * [3, 4]
    )
    with pytest.raises(InputError, match=r"set record\.torque_constant"):
        tau(side="joint", units={"tau": "A"})


def test_joint_angles_beside_motor_currents(tmp_path):
    """The side of the torques may be another than that of the positions: both mixtures give what a
    record of one side gives.
    """
    drives = Drives(np.array([[10.0, 0], [5, -20]]), [0.1, -0.3], [0.1, 0.2])
    motor = drives.motor_position(Q)
    write_csv(tmp_path / "joint.csv")
    write_csv(tmp_path / "motor.csv", rows=np.column_stack([T, motor, TAU]))

    def read(name, **record):
        return read_record(settings(files=name, **record), robot(drives), folder=tmp_path)

    one = read("motor.csv", side="motor", units={"tau": "mA"})
    mixed = read("joint.csv", side="joint", torque_side="motor", units={"tau": "mA"})
    np.testing.assert_allclose(mixed.q, one.q, atol=1e-12)
    np.testing.assert_array_equal(mixed.tau, one.tau)
    np.testing.assert_allclose(mixed.tau, (TAU * 1e-3 * [0.1, 0.2]) @ drives.ratio)
    other = read("motor.csv", side="motor", torque_side="joint")
    np.testing.assert_array_equal(other.q, one.q)
    np.testing.assert_array_equal(other.tau, TAU)
    with pytest.raises(InputError, match=r"set record\.torque_side: motor"):
        read("joint.csv", units={"tau": "mA"})


@pytest.mark.parametrize(
    ("record", "said"),
    [
        (
            {"torque_constant": 0.1},
            r"record\.torque_constant: given, but units\.tau is N\*m; set units\.tau to mA",
        ),
        (
            {"counts_per_revolution": 4096, "units": {"q": "deg"}},
            r"record\.counts_per_revolution: given, but units\.q is deg; set units\.q to counts",
        ),
        (
            {"columns": {"q": ["a", "a"]}},
            r"record\.columns\.q: column 'a' is given twice; expected one column per joint",
        ),
    ],
)
def test_settings_that_contradict_each_other(record, said):
    with pytest.raises(SettingsError, match=said):
        settings(**record)


def test_two_files_are_the_two_halves_of_one_record(tmp_path):
    for name in ("a.csv", "b.csv"):
        write_csv(tmp_path / name)
    write_csv(tmp_path / "tau.csv", header="tau1,tau2", rows=TAU[:-3])
    write_csv(tmp_path / "p.csv", header="a,b", rows=Q)
    for said, record in (
        (r"both contain positions and torques, .*also: \[b\.csv\]", {"files": ["a.csv", "b.csv"]}),
        (
            "contains the torques and p.csv the positions",
            {"files": ["tau.csv", "p.csv"], "columns": {"q": ["a", "b"], "tau": ["tau1", "tau2"]}},
        ),
        (
            r"60 samples of positions in a\.csv, 57 of torques in tau\.csv; cut",
            {"files": ["a.csv", "tau.csv"]},
        ),
        (
            r"1 columns of positions \(q1\), 2 of torques \(tau1, tau2\)",
            {"files": "a.csv", "columns": {"q": "q1"}},
        ),
    ):
        with pytest.raises(InputError, match=said):
            read_record(settings(**record), folder=tmp_path)


@pytest.mark.parametrize("delimiter", [";", "\t", " "])
@pytest.mark.parametrize("header", [True, False])
def test_decimal_commas(tmp_path, delimiter, header):
    """Decimal commas where `record.decimal` says so; the names in a header keep theirs."""
    rows = [
        [format(x, ".17g").replace(".", ",") for x in row]
        for row in np.column_stack([1000 * T, Q, TAU])
    ]
    top = "t,ms;q,1;q,2;tau,1;tau,2".replace(";", delimiter) if header else ""
    write_csv(tmp_path / "a.csv", header=top, rows=rows, delimiter=delimiter)
    columns = (
        {"t": "t,ms", "q": ["q,1", "q,2"], "tau": ["tau,1", "tau,2"]}
        if header
        else {"t": "1", "q": ["2", "3"], "tau": ["4", "5"]}
    )
    given = settings(files="a.csv", columns=columns, units={"t": "ms"}, decimal=",")
    whole = read_record(given, folder=tmp_path)
    np.testing.assert_array_equal(whole.q, Q)
    np.testing.assert_array_equal(whole.tau, TAU)


NAMES = "t;q1;q2;tau1;tau2\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            NAMES + "0;0,1;0,2;1;2\n",
            (
                "line 2: '0,1'; expected a number; write decimals with a point, or set "
                "record.decimal: "
                "','"
            ),
        ),
        (
            NAMES.replace(";", ",") + "0,0,1,0,2,1,2\n",
            "line 2: 7 fields; expected 5 (t, q1, q2, tau1, tau2); if decimals are written with "
            "commas, separate columns by semicolons "
            "and set record.decimal: ','",
        ),
        (
            NAMES + "ms;deg;deg;mA;mA\n0;0;0;0;0\n",
            "line 2: 'ms'; expected a number; put # before a second line of names or units",
        ),
        (
            NAMES + "10:00:00;0;0;0;0\n",
            (
                "line 2: '10:00:00'; expected a number; dates and times of day are not supported: write "
                "seconds, or give record.rate"
            ),
        ),
        (
            "Log of cell\n" + NAMES + "0;0;0;0;0\n",
            (
                "line 2: 1 fields; expected 3 (Log, of, cell); put # before lines that are neither "
                "names nor numbers"
            ),
        ),
    ],
)
def test_logs_as_offices_write_them(tmp_path, text, said):
    """Every message names the line and what to change."""
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(InputError) as e:
        read_record(settings(files="log.csv"), folder=tmp_path)
    assert said in str(e.value)


def test_a_title_of_as_many_words_as_columns_is_told(tmp_path):
    (tmp_path / "log.csv").write_text("Log of the cell and\nt q1 q2 tau1 tau2\n0 0 0 0 0\n")
    with pytest.raises(
        InputError,
        match="the first line has Log, of, the, cell, and; put # before lines above the names",
    ):
        read_record(
            settings(
                files="log.csv", columns={"t": "t", "q": ["q1", "q2"], "tau": ["tau1", "tau2"]}
            ),
            folder=tmp_path,
        )


def test_separators_of_thousands_are_no_decimals(tmp_path):
    (tmp_path / "log.csv").write_text(NAMES + "0,0;1.234;0;0;0\n0,1;1.235;0;0;0\n")
    with pytest.raises(
        InputError,
        match=r"column 'q1', line 2: '1.234' contains a point, .* without separators of thousands",
    ):
        read_record(settings(files="log.csv", decimal=","), folder=tmp_path)


def test_a_log_of_another_encoding_says_how_to_save_it(tmp_path):
    (tmp_path / "log.csv").write_text("# arm\nWinkel [°];q1\n", encoding="latin-1")
    with pytest.raises(
        InputError,
        match=r"line 2: not a text file in UTF-8 \(byte 0xb0\); save it so \(Excel: CSV UTF-8",
    ):
        read_record(settings(files="log.csv"), folder=tmp_path)


def test_motor_side_needs_drives(tmp_path):
    write_csv(tmp_path / "a.csv")
    drives = Drives(np.diag([2.0, -4.0]), [0.1, 0.2], 1.0)
    np.testing.assert_allclose(
        read_record(settings(files="a.csv", side="motor"), robot(drives), folder=tmp_path).q,
        Q / [2, -4] + [0.1, 0.2],
    )
    np.testing.assert_array_equal(
        read_record(settings(files="a.csv", side="joint"), robot(drives), folder=tmp_path).q, Q
    )
    with pytest.raises(InputError, match="has no drives"):
        read_record(settings(files="a.csv", side="motor"), folder=tmp_path)
    currents = settings(files="a.csv", torque_side="motor", units={"tau": "A"})
    with pytest.raises(InputError, match=r"record\.torque_side is motor but the robot file has no"):
        read_record(currents, folder=tmp_path)  # it asked to set what was set already
    with pytest.raises(InputError, match=r"no torque constant; set record\.torque_constant"):
        read_record(settings(files="a.csv", units={"tau": "A"}), folder=tmp_path)


def test_records_of_a_model(tmp_path):
    import emps_model
    import planar_2r_model

    write_csv(tmp_path / "a.csv")
    write_csv(tmp_path / "b.csv")
    both = study_from_mapping(
        {"record": [{"files": "a.csv"}, {"files": "b.csv", "name": "second"}]}
    ).record
    assert [r.name for r in read_records(both, planar_2r_model, folder=tmp_path)] == ["a", "second"]
    with pytest.raises(InputError, match="the record has 2 joints, but emps has 1"):
        read_records(both, emps_model, folder=tmp_path)


# --- bad files
# --------------------------------------------------------------------------------------------------------


def spoiled(i, j, value):
    rows = cells()
    rows[i][j] = value
    return rows


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (
            spoiled(3, 2, "nan"),
            "a.csv, column 'q2', line 5: the value is nan (1 such values in all)",
        ),
        (spoiled(3, 2, ""), "a.csv, column 'q2', line 5: the field is empty"),
        (spoiled(3, 4, "1.5x"), "a.csv, column 'tau2', line 5: '1.5x'; expected a number"),
        (
            spoiled(3, 0, T[2]),
            "a.csv, column 't', line 5: time goes from 0.01 s to 0.01 s; expected increasing time",
        ),
        (spoiled(3, 0, T[3] + 0.3 / RATE), "not uniform"),
        ([*cells()[:20], *cells()[25:]], "a.csv, column 't', line 22: time is not uniform"),
        (cells()[:4], "at least 10"),
        (
            [*cells()[:4], [1.0, 2.0, 3.0]],
            "a.csv, line 6: 3 fields; expected 5 (t, q1, q2, tau1, tau2)",
        ),
        ([], "a.csv: the file has no line of numbers"),
    ],
)
def test_bad_csv(tmp_path, rows, said):
    write_csv(tmp_path / "a.csv", rows=rows)
    with pytest.raises(InputError) as e:
        read_record(settings(files="a.csv"), folder=tmp_path)
    assert said in str(e.value)


@pytest.mark.parametrize(
    ("record", "said"),
    [
        ({"columns": {"q": ["q1", "q3"]}}, "no column q3; the file has t, q1, q2, tau1, tau2"),
        ({"columns": {"q": ["q1"]}}, "1 columns of positions (q1), 2 of torques (tau1, tau2)"),
        ({"columns": {"t": "time"}}, "no column time"),
        (
            {"rate": 100, "columns": {"t": "t"}},
            "the time stamps have the rate 200 Hz, but record.rate is 100 Hz",
        ),
        ({"scale": {"tau": "gtau"}}, "a text file contains no variable 'gtau'"),
        (
            {"scale": {"q": [1, 2, 3]}},
            "record.scale.q has 3 values; expected one value, or 2 values",
        ),
        ({"units": {"q": ["rad", "rad", "m"]}}, "record.units.q has 3 units"),
        ({"files": ["b.csv"]}, "cannot be read"),
        ({"files": ["b.xls"]}, "unknown kind of file '.xls'"),
        ({"files": []}, "names no file"),
    ],
)
def test_bad_settings(tmp_path, record, said):
    write_csv(tmp_path / "a.csv")
    with pytest.raises(InputError) as e:
        read_record(settings(**{"files": "a.csv", **record}), folder=tmp_path)
    assert said in str(e.value)


def test_no_time_and_no_rate(tmp_path):
    write_csv(tmp_path / "a.csv", header="q1,q2,tau1,tau2", rows=np.hstack([Q, TAU]))
    with pytest.raises(InputError, match=r"set record\.rate"):
        read_record(settings(files="a.csv"), folder=tmp_path)


def test_wrong_number_of_joints(tmp_path):
    write_csv(tmp_path / "a.csv")
    with pytest.raises(InputError, match="the record has 2 joints, but arm has 3"):
        read_record(settings(files="a.csv"), robot(Drives(np.eye(3), 0.0, 1.0)), folder=tmp_path)


def test_different_lengths(tmp_path):
    write_csv(tmp_path / "q.csv", header="q1,q2", rows=Q)
    write_csv(tmp_path / "tau.csv", header="tau1,tau2", rows=TAU[:-1])
    with pytest.raises(
        InputError, match=r"60 samples of positions in q\.csv, 59 of torques in tau\.csv"
    ):
        read_record(settings(files=["q.csv", "tau.csv"], rate=RATE), folder=tmp_path)
    np.savez(tmp_path / "a.npz", q1=Q[:, 0], q2=Q[1:, 1], tau1=T, tau2=T)
    with pytest.raises(InputError, match="different lengths: q1 60, q2 59"):
        read_record(settings(files="a.npz", rate=RATE), folder=tmp_path)


def test_samples_run_along_the_longer_side(tmp_path):
    np.savez(tmp_path / "a.npz", q=Q.T, tau=np.asfortranarray(TAU.T), deep=np.zeros((2, 3, 4)))
    record = read_record(
        settings(files="a.npz", rate=RATE, columns={"q": "q", "tau": "tau"}), folder=tmp_path
    )
    np.testing.assert_array_equal(record.q, Q)
    np.testing.assert_array_equal(record.tau, TAU)
    np.save(tmp_path / "a.npy", np.vstack([Q.T, TAU.T]))
    np.testing.assert_array_equal(
        read_record(
            settings(files="a.npy", rate=RATE, columns={"q": [1, 2], "tau": [3, 4]}),
            folder=tmp_path,
        ).tau,
        TAU,
    )
    with pytest.raises(InputError, match="k columns of N samples"):
        read_record(
            settings(files="a.npz", rate=RATE, columns={"q": "deep", "tau": "tau"}), folder=tmp_path
        )


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("a.csv.gz", b"\x1f\x8bbroken", "damaged gzip"),
        ("a.csv", b"\xff\xfe\x00", "UTF-8"),
        ("a.csv", b"", "no line of numbers"),
        ("a.csv", b"q1,q1,tau1\n1,2,3\n", "q1 more than once"),
        ("a.csv", b"q1;tau1\n1,5;2\n", "decimals with a point"),
        ("a.npz", b"PK nothing", "not an archive"),
        ("a.mat", b"MATLAB 5.0 MAT-file" + bytes(200), "not a MATLAB file"),
        ("a.mat", b"", "not a MATLAB file"),
    ],
)
def test_damaged_files(tmp_path, name, data, said):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError) as e:
        read_record(settings(files=name, rate=1.0), folder=tmp_path)
    assert said in str(e.value) and name in str(e.value)


def test_settings_have_at_most_two_files():
    with pytest.raises(InputError, match="3 files"):
        RecordSettings(files=("a", "b", "c"))


def test_a_quotation_mark_that_stays_open_is_told_with_its_line(tmp_path) -> None:
    """It took the next line into its field."""
    rows = ["t,q1,tau1", *(f"{k / 100},{k % 3},1" for k in range(20))]
    rows[7] = '0.06,2,"'
    (tmp_path / "run.csv").write_text("\n".join([*rows, ""]))
    with pytest.raises(InputError, match=r"run\.csv, line 8: a quotation mark"):
        read_record(RecordSettings(files=["run.csv"]), folder=tmp_path)
