"""Files of every format: the numbers that were written, and where a file that cannot be read is
wrong.
"""

import gzip
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from runtime import read_record
from runtime.core.drives import Drives
from runtime.ground.errors import InputError
from runtime.reading.settings import RecordSettings
from runtime.study import study_from_mapping

N, RATE = 1003, 500.0
DRIVES = Drives([[30.0, 0.0], [12.0, -20.0]], [0.1, -0.2], [0.5, 0.4])


@pytest.fixture(scope="module")
def samples():
    rng = np.random.default_rng(3)
    return np.arange(N) / RATE, rng.normal(size=(N, 2)).cumsum(axis=0), rng.normal(size=(N, 2))


def write(kind, folder, samples):
    """A record file of the kind, and the columns that its settings name."""
    t, q, tau = samples
    path = folder / f"record.{kind.split()[0]}"
    named = {"t": t, "q1": q[:, 0], "q2": q[:, 1], "tau1": tau[:, 0], "tau2": tau[:, 1]}
    columns = {}
    if kind.startswith("csv"):
        text = (
            "# a comment\n"
            + ",".join(named)
            + "\n"
            + "\n".join(
                ",".join(map(repr, row)) for row in np.column_stack(list(named.values())).tolist()
            )
        )
        path.write_bytes(gzip.compress(text.encode()) if kind.endswith("gz") else text.encode())
        if kind.endswith("gz"):
            path = path.rename(folder / "record.csv.gz")
    elif kind == "npz":
        np.savez(path, **named, gain=np.array(2.0))
    elif kind == "npz compressed":
        np.savez_compressed(path, **named)
    elif kind == "npz matrices":
        np.savez(path, t=t[None], Q=np.asfortranarray(q), T=tau.astype(np.float32))
        columns = {"q": ["Q"], "tau": ["T"]}
    elif kind == "npy":
        np.save(path, np.column_stack([t, q, tau]))
        columns = {"t": "1", "q": ["2", "3"], "tau": ["4", "5"]}
    elif kind == "parquet":
        import polars

        polars.DataFrame({**named, "note": ["x"] * len(t)}).write_parquet(path, row_group_size=300)
    return {"files": [path.name], "columns": columns}


def robot(drives):
    """A model with these drives."""
    given = {
        "ratio": drives.ratio,
        "offset": drives.offset,
        "torque_constant": drives.torque_constant,
    }
    return SimpleNamespace(NAME="arm", JOINTS=tuple(range(drives.n)), DRIVES=given)


def settings(given, **others):
    return study_from_mapping({"record": {**given, **others}}).record[0]


@pytest.mark.parametrize(
    "kind", ["csv", "csv gz", "npz", "npz compressed", "npz matrices", "npy", "parquet"]
)
def test_every_format(tmp_path, samples, kind):
    given = settings(write(kind, tmp_path, samples), side="motor", units={"tau": "A"})
    record = read_record(given, robot(DRIVES), folder=tmp_path)
    t, q, tau = samples
    kept = np.float32 if kind == "npz matrices" else float  # of the torques
    np.testing.assert_array_equal(record.t, t)
    np.testing.assert_allclose(record.q, DRIVES.joint_position(q), rtol=1e-12)
    joint_torque = DRIVES.joint_torque(tau.astype(kept).astype(float))
    np.testing.assert_allclose(record.tau, joint_torque, rtol=1e-12)
    assert (record.rate, record.name, (*record.files,)) == (RATE, "record", given.files)


def test_two_files_and_a_rate(tmp_path, samples):
    np.save(tmp_path / "q.npy", samples[1])
    np.savez(tmp_path / "tau.npz", tau=samples[2])
    given = settings(
        {"files": ["q.npy", "tau.npz"], "columns": {"q": ["1", "2"], "tau": ["tau"]}},
        rate=RATE,
        units={"q": "deg"},
    )
    record = read_record(given, folder=tmp_path)
    np.testing.assert_array_equal(record.t, samples[0])
    np.testing.assert_allclose(record.q, np.radians(samples[1]), rtol=1e-12)
    np.testing.assert_array_equal(record.tau, samples[2])


def test_scale_stored_in_the_file(tmp_path, samples):
    given = settings(write("npz", tmp_path, samples), scale={"tau": "gain"})
    np.testing.assert_array_equal(read_record(given, folder=tmp_path).tau, 2 * samples[2])


@pytest.mark.parametrize(
    ("kind", "place"),
    [("csv", "line 719"), ("npz", "sample 717"), ("npy", "sample 717"), ("parquet", "sample 717")],
)
def test_what_is_not_finite_is_found_where_it_stands(tmp_path, samples, kind, place):
    t, q, tau = samples
    q = q.copy()
    q[716, 1] = np.nan
    with pytest.raises(InputError, match=f"column '(q2|3)', {place}: the value is nan"):
        read_record(settings(write(kind, tmp_path, (t, q, tau))), folder=tmp_path)


def test_clock(tmp_path, samples):
    t, q, tau = samples
    back, late = t.copy(), t.copy()
    back[400] = back[399]
    late[400:] += 0.5 / RATE
    for bad, message in (
        (back, "sample 401: time goes from 0.798 s to 0.798 s"),
        (late, "sample 401: time is not uniform"),
    ):
        with pytest.raises(InputError, match=message):
            read_record(settings(write("npz", tmp_path, (bad, q, tau))), folder=tmp_path)
    with pytest.raises(
        InputError, match=r"the time stamps have the rate 500 Hz, but record\.rate is 400 Hz"
    ):
        read_record(
            settings(write("npz", tmp_path, samples), rate=400, columns={"t": "t"}), folder=tmp_path
        )


def test_bad_files(tmp_path, samples):
    given = settings(write("npz", tmp_path, samples))
    path = tmp_path / "record.npz"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 255
    path.write_bytes(data)
    with pytest.raises(InputError, match="damaged, or not an archive of plain arrays"):
        read_record(given, folder=tmp_path)
    path.write_bytes(data[:1000])
    with pytest.raises(InputError, match="not an archive of plain arrays"):
        read_record(given, folder=tmp_path)
    np.savez(path, q1=np.zeros(N), q2=np.zeros(N - 1), tau1=np.zeros(N), tau2=np.zeros(N))
    with pytest.raises(InputError, match="columns of different lengths: q1 1003, q2 1002"):
        read_record(replace(given, rate=RATE), folder=tmp_path)
    np.savez(path, q1=np.array([{}], dtype=object))
    with pytest.raises(
        InputError, match=r"not an archive of plain arrays \(q1 contains pickled objects"
    ):
        read_record(replace(given, rate=RATE), folder=tmp_path)
    with pytest.raises(InputError, match="no such file"):
        read_record(RecordSettings(files=("nothing.csv",)), folder=tmp_path)
    (tmp_path / "record.parquet").write_bytes(b"PAR1 nothing")
    with pytest.raises(InputError, match="not a Parquet file"):
        read_record(RecordSettings(files=("record.parquet",)), folder=tmp_path)


def test_parquet_without_its_library(tmp_path, samples, monkeypatch):
    write("parquet", tmp_path, samples)
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(InputError, match=r"pip install symgen\[tables\]"):
        read_record(RecordSettings(files=("record.parquet",)), folder=tmp_path)
