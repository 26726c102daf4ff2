"""Records read by blocks: every format gives the samples of `read_record`, and the identification
by blocks that of the record in memory.
"""

import gzip
import sys
import tracemalloc
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import planar_2r_model as planar
import pytest
from campaign import campaign, sampled, some

import symgen
from runtime import load_model, observe, read_record
from runtime.errors import InputError, SettingsError
from runtime.estimators.essential import essential_of
from runtime.identification.validation import cross_validation, split_validation, weak_directions
from runtime.loop.methods import estimate_of, observed
from runtime.model.drives import Drives
from runtime.records.datasets import dataset_study
from runtime.records.reading import read_records
from runtime.records.reading_by_blocks import are_large, open_stream
from runtime.records.record import Origin
from runtime.records.stream import PieceReader, RecordStream, Stream
from runtime.rows.observation import halves, stack
from runtime.rows.pieces import reach
from runtime.settings.study import EstimateSettings, RecordSettings, study_from_mapping
from runtime.signals.filters import filtered_states

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


@pytest.mark.parametrize("block", sampled([10, 97, 500, 5000], 0, always=[97]))
@pytest.mark.parametrize(
    "kind", ["csv", "csv gz", "npz", "npz compressed", "npz matrices", "npy", "parquet"]
)
@some(8)
def test_formats_by_blocks(tmp_path, samples, kind, block):
    given = settings(write(kind, tmp_path, samples), side="motor", units={"tau": "A"})
    whole = read_record(given, robot(DRIVES), folder=tmp_path)
    stream = open_stream(given, robot(DRIVES), folder=tmp_path, block=block)
    assert (len(stream), stream.rate, stream.n, dict(stream.origin.files), stream.name) == (
        N,
        whole.rate,
        2,
        dict(whole.files),
        "record",
    )
    parts = list(stream.blocks())
    assert [len(t) for t, *_ in parts] == [min(block, N - a) for a in range(0, N, block)]
    for found, expected in zip(
        list(zip(*parts, strict=True))[:3], (whole.t, whole.q, whole.tau), strict=True
    ):
        np.testing.assert_array_equal(np.concatenate(found), expected)
    np.testing.assert_array_equal(np.concatenate(list(stream.times())), whole.t)
    assert stream.in_any_order == (kind not in ("npz compressed", "csv gz"))
    reader = PieceReader(deepcopy(stream))
    for start, stop in ((0, 1), (97, 117), (101, 310), (301, N), (5, 40)):
        for found, expected in zip(
            reader.read(start, stop)[:3], (whole.t, whole.q, whole.tau), strict=True
        ):
            np.testing.assert_allclose(found, expected[start:stop], rtol=0, atol=1e-14)


def test_pieces_are_read_by_the_process_that_is_there(tmp_path, samples):
    given = settings(write("parquet", tmp_path, samples))
    stream = open_stream(given, folder=tmp_path, block=97)
    table = stream.opened.tables[0]
    first = table.idle
    for start, stop in ((0, 300), (250, 700), (650, N), (5, 40)):
        PieceReader(stream).read(start, stop)
        assert first is not None and table.idle is first and first.popen.poll() is None


def test_two_files_and_a_rate(tmp_path, samples):
    np.save(tmp_path / "q.npy", samples[1])
    np.savez(tmp_path / "tau.npz", tau=samples[2])
    given = settings(
        {"files": ["q.npy", "tau.npz"], "columns": {"q": ["1", "2"], "tau": ["tau"]}},
        rate=RATE,
        units={"q": "deg"},
    )
    stream, whole = (
        open_stream(given, folder=tmp_path, block=100),
        read_record(given, folder=tmp_path),
    )
    t, q, tau, _ = (np.concatenate(x) for x in zip(*stream.blocks(), strict=True))
    for found, expected in (
        (t, whole.t),
        (q, whole.q),
        (tau, whole.tau),
        (np.concatenate(list(stream.times())), whole.t),
    ):
        np.testing.assert_array_equal(found, expected)


def test_time_of_long_records_is_not_kept(tmp_path, samples, monkeypatch):
    stream = open_stream(settings(write("npz", tmp_path, samples)), folder=tmp_path, block=100)
    monkeypatch.setattr("runtime.records.reading_by_blocks.KEPT", 1000)
    for _ in range(2):
        np.testing.assert_array_equal(np.concatenate(list(stream.times())), samples[0])
    assert "_clock" not in vars(stream)


def test_scale_stored_in_the_file(tmp_path, samples):
    given = settings(write("npz", tmp_path, samples), scale={"tau": "gain"})
    _, _, tau, _ = next(open_stream(given, folder=tmp_path, block=50).blocks())
    np.testing.assert_array_equal(tau, 2 * samples[2][:50])


@pytest.mark.parametrize(
    ("kind", "place"),
    [("csv", "line 719"), ("npz", "sample 717"), ("npy", "sample 717"), ("parquet", "sample 717")],
)
def test_what_is_not_finite_is_found_where_it_stands(tmp_path, samples, kind, place):
    t, q, tau = samples
    q = q.copy()
    q[716, 1] = np.nan
    stream = open_stream(settings(write(kind, tmp_path, (t, q, tau))), folder=tmp_path, block=100)
    with pytest.raises(InputError, match=f"column '(q2|3)', {place}: nan"):
        list(stream.blocks())


@pytest.mark.parametrize("block", [10, 100, 2000])
def test_clock(tmp_path, samples, block):
    t, q, tau = samples
    back, late = t.copy(), t.copy()
    back[400] = back[399]
    late[400:] += 0.5 / RATE
    for bad, message in (
        (back, "sample 401: time goes from 0.798 s to 0.798 s"),
        (late, "sample 401: time is not uniform"),
    ):
        given = settings(write("npz", tmp_path, (bad, q, tau)))
        for read in (
            lambda given: open_stream(given, folder=tmp_path, block=block),
            lambda given: read_record(given, folder=tmp_path),
        ):
            with pytest.raises(InputError, match=message):
                read(given)
    with pytest.raises(InputError, match=r"time runs at 500 Hz, record\.rate is 400 Hz"):
        open_stream(
            settings(write("npz", tmp_path, samples), rate=400, columns={"t": "t"}),
            folder=tmp_path,
            block=block,
        )


def test_bad_files(tmp_path, samples):
    given = settings(write("npz", tmp_path, samples))
    path = tmp_path / "record.npz"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 255
    path.write_bytes(data)
    with pytest.raises(InputError, match="damaged, or not an archive of plain arrays"):
        list(open_stream(given, folder=tmp_path, block=100).blocks())
    path.write_bytes(data[:1000])
    with pytest.raises(InputError, match="not an archive of plain arrays"):
        open_stream(given, folder=tmp_path)
    np.savez(path, q1=np.zeros(N), q2=np.zeros(N - 1), tau1=np.zeros(N), tau2=np.zeros(N))
    with pytest.raises(InputError, match="columns of different lengths: q1 1003, q2 1002"):
        open_stream(replace(given, rate=RATE), folder=tmp_path)
    np.savez(path, q1=np.array([{}], dtype=object))
    with pytest.raises(
        InputError, match=r"not an archive of plain arrays \(q1 holds pickled objects"
    ):
        open_stream(replace(given, rate=RATE), folder=tmp_path)
    with pytest.raises(InputError, match="no such file"):
        open_stream(RecordSettings(files=("nothing.csv",)), folder=tmp_path)
    with pytest.raises(InputError, match=r"\.mat files are read whole; convert to \.csv"):
        open_stream(RecordSettings(files=("record.mat",)), folder=tmp_path)
    with pytest.raises(InputError, match="uncompress it"):
        open_stream(RecordSettings(files=("record.npy.gz",)), folder=tmp_path)
    with pytest.raises(InputError, match="blocks of 3 samples"):
        open_stream(given, folder=tmp_path, block=3)
    (tmp_path / "record.parquet").write_bytes(b"PAR1 nothing")
    with pytest.raises(InputError, match="not a Parquet file"):
        open_stream(RecordSettings(files=("record.parquet",)), folder=tmp_path)


def test_parquet_without_its_library(tmp_path, samples, monkeypatch):
    write("parquet", tmp_path, samples)
    monkeypatch.setitem(sys.modules, "polars", None)
    for read in (open_stream, read_record):
        with pytest.raises(InputError, match=r"pip install symgen\[tables\]"):
            read(RecordSettings(files=("record.parquet",)), folder=tmp_path)


def test_large_files(tmp_path, monkeypatch, samples):
    given = settings(write("npz", tmp_path, samples))
    assert not are_large([given], tmp_path)
    monkeypatch.setattr("runtime.records.reading_by_blocks.LARGE", 10_000)
    assert are_large([given], tmp_path)
    assert not are_large([settings({"dataset": "tx40", "files": ["pos_read_data.csv"]})])
    assert not are_large([RecordSettings(files=("record.mat",))], tmp_path)
    packed = tmp_path / "packed.npz.gz"
    packed.write_bytes(gzip.compress((tmp_path / given.files[0]).read_bytes(), 0))
    assert not are_large([RecordSettings(files=(packed.name,))], tmp_path)


@pytest.fixture(scope="module")
def tx40(tx40_data):
    study = study_from_mapping(dataset_study("tx40"))
    model = load_model(Path(__file__).parents[2] / "generated" / "tx40.py")
    return model, study, read_records(study.record, model)[0]


def by_blocks(model, streams, study, held=0, piece=2**20, workers=1):
    """Observation of streams, in pieces of so many samples, whose W may take `held` bytes; 0:
    reduced to triangular factors.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("runtime.rows.observe.HELD", held)
        patch.setattr("runtime.rows.pieces.PIECE", piece)
        patch.setattr("runtime.rows.pieces.STRETCH", 0)
        return observed(model, streams, study, workers=workers)


def same(found, expected, resolution=0.0):
    """1e-10 of the largest, the goal, or the resolution of the record where that is coarser;
    deviations and norms to 1e-9 of themselves.
    """
    assert found.names == expected.names and found.rank == expected.rank
    allowed = max(1e-10 * np.abs(expected.X).max(), resolution)
    np.testing.assert_allclose(found.X, expected.X, rtol=0, atol=allowed)
    for name in (
        "sigma",
        "sigma_corrected",
        "sigma_rho",
        "cond",
        "cond_unit",
        "residual_norm",
        "relative_error",
    ):
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name), rtol=1e-9, err_msg=name
        )
    for one, other in zip(found.per_joint, expected.per_joint, strict=True):
        assert (one.joint, one.rows) == (other.joint, other.rows)
        np.testing.assert_allclose(
            (one.residual_norm, one.sigma_rho, one.scale),
            (other.residual_norm, other.sigma_rho, other.scale),
            rtol=1e-9,
        )


@pytest.mark.parametrize(
    ("block", "piece"), [(777, 2**20), (5000, 9000), (16384, 2**20), (45000, 2**20)]
)
@some(2)
def test_identification_of_the_tx40_by_blocks(tx40, block, piece):
    model, study, record = tx40
    whole = observe(model, record, study)
    reduction = by_blocks(model, [RecordStream(record, block)], study, piece=piece)
    assert (reduction.rows, reduction.dropped, reduction.files) == (
        whole.rows,
        whole.dropped,
        whole.files,
    )
    expected, found = (
        essential_of(x, study.essential, study.estimate, model=model) for x in (whole, reduction)
    )
    same(found.all_parameters, expected.all_parameters)
    same(found.estimate, expected.estimate)
    assert [step.name for step in found.trail] == [
        step.name for step in expected.trail
    ] and found.counts == expected.counts
    choices = {"all": study.estimate, "essential": replace(study.estimate, columns=expected.names)}
    validations = [split_validation(x, study.validate.split, choices) for x in (whole, reduction)]
    for one, other in zip(*(v.predictions for v in validations), strict=True):
        assert (one.part, one.columns, one.fitted) == (other.part, other.columns, other.fitted)
        np.testing.assert_allclose(
            (one.relative_error, *one.per_joint),
            (other.relative_error, *other.per_joint),
            rtol=1e-8,
        )
    assert (
        weak_directions(reduction, study.estimate).groups
        == weak_directions(whole, study.estimate).groups
    )
    np.testing.assert_allclose(reduction.first_rows.W, whole.W, atol=1e-10 * np.abs(whole.W).max())
    held = by_blocks(model, [RecordStream(record, block)], study, held=whole.W.nbytes, piece=piece)
    assert (
        held.reduced is None
        and held.rows == whole.rows
        and np.array_equal(held.record, whole.record)
    )
    for name in ("W", "Y", "t"):
        np.testing.assert_allclose(
            getattr(held, name),
            getattr(whole, name),
            rtol=0,
            atol=1e-10 * np.abs(getattr(whole, name)).max(),
        )


@pytest.mark.parametrize(
    "changed",
    [
        {
            "rows": {"window": [0.51, 3.3], "low_speed": [0.1, 0.2, 0.05, 0.1, 0.3, 0.0]},
            "signals": {"decimate": {"phase": "last", "padding": "matlab"}},
        },
        {"rows": {"window": [1, 2]}, "signals": {"median": 1, "decimate": None}},
        {
            "rows": {"window": [1, 2], "trim": 40},
            "signals": {
                "lowpass": {"on": ["qd"]},
                "decimate": {"factor": 7},
                "ends": "second-order",
            },
        },
    ],
    ids=["slow rows", "no decimation", "other filters"],
)
@pytest.mark.parametrize(
    "estimator",
    [{}, {"method": "wls", "options": {"block": 0.2}}, {"method": "wls", "weights": "iterated"}],
)
@some(3)
def test_settings_by_blocks(tx40, changed, estimator):
    model, study, record = tx40
    study = study_from_mapping({"estimate": estimator, **changed})
    whole = observe(model, record, study)
    expected = estimate_of(whole, study.estimate, model=model)
    resolution = 0.0
    if study.signals.decimate is None:  # accelerations are as noisy as differences make them
        moved = [one_unit_away(record, seed) for seed in range(4)]
        others = (estimate_of(observe(model, x, study), study.estimate, model=model) for x in moved)
        resolution = 3 * np.mean([np.abs(x.X - expected.X).max() for x in others])
        assert resolution < 1e-9 * np.abs(expected.X).max()
    for piece in (2**20, 7000):
        reduction = by_blocks(model, [RecordStream(record, 4001)], study, piece=piece)
        assert (reduction.rows, reduction.dropped) == (whole.rows, whole.dropped)
        same(estimate_of(reduction, study.estimate, model=model), expected, resolution)


def one_unit_away(record, seed):
    """The record with every position moved by one unit in the last place, up or down."""
    up = np.random.default_rng(seed).random(record.q.shape) < 0.5
    return replace(record, q=np.nextafter(record.q, np.where(up, np.inf, -np.inf)))


@pytest.mark.parametrize("cut", [7000, 9000, 20000])
def test_filtered_pieces_differ_by_rounding(tx40, cut):
    _, study, record = tx40
    rate, signals = record.rate, replace(study.signals, median=1, decimate=None)
    begin, stop = cut - reach(rate, signals, 1), cut + 2000
    whole = filtered_states(record.q, rate, signals)[cut:stop]
    piece = filtered_states(record.q[begin : stop + cut - begin], rate, signals)[cut - begin :]
    for name, allowed in (("q", 1e-13), ("qd", 1e-11), ("qdd", 5e-10)):  # rate times as much each
        one, other = getattr(piece, name)[:2000], getattr(whole, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=allowed * np.abs(other).max())


@campaign
@pytest.mark.parametrize(
    ("kind", "reader"), [("npz", "lowpass"), ("csv", "lowpass"), ("parquet", "counts")]
)
def test_every_number_of_workers_gives_the_same_bits(tmp_path, kind, reader, monkeypatch):
    t = np.arange(30_000) / 1000.0
    q = np.stack(
        [np.sin(3 * t) + 0.3 * np.sin(7.1 * t), np.cos(4 * t) - 0.5 * np.sin(2.3 * t)], axis=1
    )
    given = settings(write(kind, tmp_path, (t, np.round(q / 1e-3) * 1e-3, 3 * q)))
    monkeypatch.setattr("runtime.signals.counts.reading.STRETCH", 4096)
    monkeypatch.setattr("runtime.records.formats.text.PIECE", 20_000)
    signals = {
        "decimate": {"factor": 5},
        **({"reader": "counts", "step": 1e-3} if reader == "counts" else {}),
    }
    study = study_from_mapping({"signals": signals, "rows": {"low_speed": 0.1}})
    model = symgen.model("planar_2r")
    one, two = (
        by_blocks(
            model, [open_stream(given, folder=tmp_path, block=1000)], study, piece=6000, workers=k
        )
        for k in (1, 2)
    )
    assert (
        one.rows == two.rows
        and one.reduced.span == two.reduced.span
        and len(one.segments) == len(two.segments) > 50
    )
    for a, b in (
        (one.factor.R, two.factor.R),
        (one.first_rows.W, two.first_rows.W),
        (one.first_rows.Y, two.first_rows.Y),
    ):
        assert a.tobytes() == b.tobytes()


def test_several_records_by_blocks(tx40):
    model, study, record = tx40
    study = replace(study, rows=replace(study.rows, window=(None, None), low_speed=0.05))
    parts = [
        replace(record, t=record.t[s], q=record.q[s], tau=record.tau[s])
        for s in (slice(0, 21000), slice(15000, 40000))
    ]
    whole = stack([observe(model, part, study) for part in parts])
    reduction = by_blocks(model, [RecordStream(part, 6000) for part in parts], study)
    assert (reduction.rows, reduction.dropped, reduction.files) == (
        whole.rows,
        whole.dropped,
        whole.files,
    )
    same(*(estimate_of(x, study.estimate, model=model) for x in (reduction, whole)))
    assert (
        reduction.reduced.windows == halves(float(whole.t.min()), float(whole.t.max()))
        or study.validate.split
    )
    one, other = (
        cross_validation(x, {"first": y}, {"all": study.estimate}).predictions[1]
        for x, y in (
            (whole, observe(model, parts[0], study)),
            (reduction, by_blocks(model, [RecordStream(parts[0], 3000)], study)),
        )
    )
    np.testing.assert_allclose(
        (one.relative_error, *one.per_joint), (other.relative_error, *other.per_joint), rtol=1e-8
    )


def test_what_needs_the_rows_is_refused(tx40):
    model, study, record = tx40
    short = replace(
        study,
        rows=replace(study.rows, window=(1.0, 2.0)),
        validate=replace(study.validate, split=((1.0, 1.5), (1.5, 2.0))),
    )
    reduction = by_blocks(model, [RecordStream(record, 5000)], short)
    with pytest.raises(SettingsError, match="stream: off"):
        estimate_of(reduction, EstimateSettings("wls", "covariance"))
    for refused in (EstimateSettings("wls", "covariance"), EstimateSettings("feasible")):
        with pytest.raises(SettingsError, match="read by blocks"):
            by_blocks(model, [RecordStream(record, 5000)], replace(short, estimate=refused))
    with pytest.raises(InputError, match="cut by the windows"):
        reduction.between(1.0, 1.7)
    with pytest.raises(InputError, match=r"no sample in rows\.window"):
        by_blocks(
            model,
            [RecordStream(record, 5000)],
            replace(study, rows=replace(study.rows, window=(20.0, 30.0))),
        )
    with pytest.raises(InputError, match=r"of which rows\.trim leaves out 200"):
        by_blocks(
            model, [RecordStream(record, 5000)], replace(short, rows=replace(short.rows, trim=100))
        )
    with pytest.raises(InputError, match=r"rows per joint is used: rows\.trim leaves out"):
        by_blocks(
            model,
            [RecordStream(record, 5000)],
            replace(short, rows=replace(short.rows, low_speed=100.0)),
        )


class Endless(Stream):
    """A stream that is computed while it is read: two sines per joint of the planar arm, nothing
    kept.
    """

    def __init__(self, samples):
        super().__init__(
            name="endless", n=2, rate=1000.0, origin=Origin(), samples=samples, block=4096
        )

    def times(self, start=0, stop=None):
        stop = self.samples if stop is None else stop
        return (
            np.arange(a, min(a + self.block, stop)) / self.rate
            for a in range(start, stop, self.block)
        )

    def blocks(self, start=0, stop=None):
        for t in self.times(start, stop):
            q = np.stack(
                [np.sin(3 * t) + 0.3 * np.sin(7.1 * t), np.cos(4 * t) - 0.5 * np.sin(2.3 * t)],
                axis=1,
            )
            yield t, q, 3 * q, np.empty((len(t), 0), dtype=bool)


def test_memory_does_not_grow_with_the_record():
    """Peak of what Python and NumPy allocate, at 60,000 and at 240,000 samples, beyond the figures'
    share.
    """
    study = study_from_mapping(
        {"signals": {"decimate": {"factor": 20}}, "rows": {"low_speed": 0.1}}
    )
    peaks = []
    for samples in (60_000, 240_000):
        tracemalloc.start()
        reduction = by_blocks(planar, [Endless(samples)], study, piece=16384)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert reduction.rows[0] > 0.8 * samples / 20
    assert peaks[1] < 1.25 * peaks[0] < 60e6
