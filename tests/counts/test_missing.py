"""Positions that a record does not hold: read from every kind of file, filled by the reader of
counts, left out where nothing tells the state, refused where counts are not read.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars
import pytest
from campaign import campaign
from planar_data import motion
from problems import observed_states
from scipy.io import savemat
from typer.testing import CliRunner

import symgen
from runtime import load_model
from runtime.compose import cestac, observe, read_record
from runtime.core.drives import Drives
from runtime.core.missing import Missing, bridged
from runtime.core.model import drives_of
from runtime.core.record import Record
from runtime.core.signals.filters import filtered_states
from runtime.core.study import Lowpass
from runtime.counts.reader import encoder_position
from runtime.ground.errors import InputError
from runtime.reading.settings import RecordSettings
from runtime.study import CestacSettings, Rows, Signals, Study
from symgen.cli.main import app

GENERATED = Path(__file__).parents[2] / "generated"

N, STEP = 4000, 2.5e-3
T = np.arange(N) / 1000.0
SIGNALS = Signals(median=1, lowpass=Lowpass(cutoff=20), reader="counts")
STUDY = Study(signals=SIGNALS, rows=Rows(trim=20))
planar = symgen.model("planar_2r")
EXACT = motion(T)
TAU = planar.inverse_dynamics(*EXACT, planar.base_parameters(planar.VALUES))
Q = np.round(EXACT[0] / STEP) * STEP
MISSING = np.random.default_rng(1).random((N, 2)) < 0.02
MISSING[993:1008, 0] = MISSING[2000:2600, 1] = True
RECORD = Record(T, np.where(MISSING, np.nan, Q), TAU, rate=1000.0, missing=MISSING)

WHOLE = Record(T, Q, TAU, rate=1000.0)


def written(kind, folder, samples=200, **changed):
    """A file of the kind with missing positions, and its settings."""
    x = {"t": T, "q1": RECORD.q[:, 0], "q2": RECORD.q[:, 1], "tau1": TAU[:, 0], "tau2": TAU[:, 1]}
    x = {
        key: np.where(MISSING[:, int(key[1]) - 1], np.nan, own)[:samples]
        if key[0] == "q"
        else own[:samples].copy()
        for key, own in x.items()
    }
    for key, (k, value) in changed.items():
        x[key][k] = value
    path = folder / f"record.{kind.split()[0]}"
    if kind.startswith("csv"):
        separator, point, empty = (
            (";", ",", "")
            if "comma" in kind
            else (",", ".", '""' if "quoted" in kind else "nan" if "nan" in kind else "")
        )
        rows = zip(*x.values(), strict=True)
        lines = [
            separator.join(
                empty if np.isnan(v) else repr(float(v)).replace(".", point) for v in row
            )
            for row in rows
        ]
        path.write_text("\n".join([separator.join(x), *lines]))
    elif kind == "npz":
        np.savez(path, **x)
    elif kind == "mat":
        savemat(path, x)
    else:
        polars.DataFrame(x).with_columns(polars.all().fill_nan(None)).write_parquet(path)
    return RecordSettings(files=(str(path),), decimal="," if "comma" in kind else ".")


@pytest.mark.parametrize(
    "kind", ["csv", "csv quoted", "csv nan", "csv decimal comma", "npz", "mat", "parquet"]
)
def test_every_format(tmp_path, kind):
    settings = written(kind, tmp_path)
    record = read_record(settings, missing=True)
    np.testing.assert_array_equal(record.missing.samples, MISSING[:200])
    np.testing.assert_array_equal(record.q[~MISSING[:200]], RECORD.q[:200][~MISSING[:200]])
    if kind in {"mat", "parquet"}:
        return
    with pytest.raises(
        InputError,
        match=(
            r"column 'q\d', (line|sample) \d+: (the value is nan|the field is empty).*reader: counts} takes such "
            r"samples"
        ),
    ):
        read_record(settings)


@pytest.mark.parametrize(
    ("column", "words"),
    [
        ("t", "(the value is nan|the field is empty)"),
        ("tau2", "(the value is nan|the field is empty)"),
    ],
)
@pytest.mark.parametrize("kind", ["csv", "csv nan", "npz"])
def test_time_and_torques_are_refused(tmp_path, kind, column, words):
    settings = written(kind, tmp_path, **{column: (150, np.nan)})
    with pytest.raises(
        InputError, match=rf"column '{column}', (line 152|sample 151): {words}"
    ) as told:
        read_record(settings, missing=True)
    assert "counts" not in str(told.value)


def test_arrays():
    """Straight lines where positions are missing, for whoever looks at them; without `missing` nan
    is refused, and so is lowpass.
    """
    assert (
        not np.isnan(RECORD.q).any()
        and abs(RECORD.q[1000, 0] - (Q[992, 0] + Q[1008, 0]) / 2) < STEP
    )
    np.testing.assert_allclose(
        bridged([[1.0], [np.nan], [4.0], [np.nan]], np.array([[0], [1], [0], [1]], dtype=bool))[
            :, 0
        ],
        [1, 2.5, 4, 4],
    )
    with pytest.raises(
        InputError, match=r"nan .* takes such samples as missing \(here: missing=np.isnan\(q\)\)"
    ):
        Record(T, np.where(MISSING, np.nan, Q), TAU)
    with pytest.raises(
        InputError, match=r"missing.* bool and shape \(4000,\)|missing.* bool and shape \(4000, 1\)"
    ):
        Record(T, Q, TAU, missing=MISSING[:, 0])
    with pytest.raises(
        InputError,
        match=(
            "reader: lowpass needs all positions: repair or cut the record; where positions are counts"
        ),
    ):
        observe(planar, RECORD, replace(STUDY, signals=replace(SIGNALS, reader="lowpass")))
    with pytest.raises(InputError, match="encoder 2: all positions are missing"):
        observe(planar, replace(RECORD, missing=MISSING | [False, True]), STUDY)
    rare = replace(RECORD, missing=MISSING | ((np.arange(N) % 500 > 0)[:, None] & [True, False]))
    with pytest.raises(
        InputError,
        match=(
            r"none of the 200 rows per joint is used: rows.trim leaves out 40, positions "
            r"that are missing leaves? out"
        ),
    ):
        observe(planar, rare, replace(STUDY, signals=replace(SIGNALS, step=STEP)))


def test_short_gaps_are_filled_and_long_ones_left_out():
    """Errors of the rows that stay are those of the whole record; rows of the long gap are left
    out, of both joints.
    """
    observation = observe(planar, RECORD, STUDY)
    whole = observe(planar, WHOLE, STUDY)
    errors = []
    for own in (observation, whole):
        X = planar.base_parameters(planar.VALUES)
        errors.append(np.sqrt(np.mean((own.Y - own.W @ X) ** 2)))
    assert errors[0] < 1.1 * errors[1]
    at = observation.t[observation.joints == 0]
    assert not ((at > 2.0) & (at < 2.6)).any() and (at == 1.0).any()
    lost = 0.6 * observation.rate
    assert all(lost < k < 1.1 * lost for k in observation.dropped["missing"])
    assert (
        f"encoder 1: {MISSING[:, 0].sum()} samples are missing, at most 15 in a row (0.015 s); the "
        "counts around them determine"
    ) in " ".join(observation.findings)
    assert "at most 600 in a row (0.6 s); where the counts around a gap" in observation.findings[-1]


@pytest.mark.parametrize("margin", [pytest.param(1000, marks=campaign), 100])
def test_gaps_across_stretches(monkeypatch, margin):
    """Gaps across stretches, with the small margin one that holds a whole stretch and
    its margins.
    """
    monkeypatch.setattr("runtime.counts.reading.STRETCH", 1500 if margin == 1000 else 300)
    monkeypatch.setattr("runtime.counts.reading.MARGIN", margin)
    study = replace(STUDY, signals=replace(SIGNALS, step=STEP))
    whole = observe(planar, RECORD, study)
    X, *_ = np.linalg.lstsq(whole.W, whole.Y, rcond=None)
    np.testing.assert_allclose(
        X, planar.base_parameters(planar.VALUES), atol=0.1 if margin == 1000 else 0.5
    )


def test_a_first_stretch_without_a_sample(monkeypatch):
    """Step and phase are those of later samples."""
    monkeypatch.setattr("runtime.counts.reading.STRETCH", 1000)
    monkeypatch.setattr("runtime.counts.reading.MARGIN", 200)
    late = replace(RECORD, missing=MISSING | ((T < 1.3)[:, None] & [True, False]))
    observation = observe(planar, late, STUDY)
    assert observation.t.min() > 1.3 and np.isfinite(observation.W).all()


def test_coupled_motors():
    """Motor 6 turns with joints 5 and 6. Recorded at the motors, each stands for itself; recorded
    at the joints, motor 6 lacks what either lacks.
    """
    model = load_model("tx40", folder=GENERATED)
    drives = Drives.from_mapping(model.DRIVES)
    q = 0.4 * np.sin(2 * np.pi * 0.6 * T[:2000, None] + np.arange(6)) + drives.offset
    step = 2 * np.pi / 50
    motor = np.round(drives.motor_position(q) / step) * step
    samples = np.zeros(q.shape, dtype=bool)
    samples[300:310, 4] = samples[500:510, 5] = True
    follows = np.linalg.inv(drives.ratio) != 0
    at_motors, at_joints = Missing(samples, np.abs(follows) > 0), Missing(samples)
    both = samples.copy()
    both[300:310, 5] = True
    np.testing.assert_array_equal(at_motors.at_joints(), both)
    np.testing.assert_array_equal(at_motors.at_encoders(drives), samples)
    np.testing.assert_array_equal(at_joints.at_encoders(drives), both)
    np.testing.assert_array_equal(at_joints.at_encoders(None), samples)
    record = Record(
        T[:2000],
        drives.joint_position(bridged(motor, samples)),
        np.zeros_like(q),
        missing=at_motors,
    )
    known = encoder_position(record.q, drives, at_motors)
    np.testing.assert_allclose(known[~samples], motor[~samples], atol=1e-9)
    assert np.isnan(known[samples]).all()
    signals = Signals(lowpass=Lowpass(cutoff=20), reader="counts", step=step, side="motor")
    states = observed_states(record.q, 1000.0, signals, drives_of(model), missing=record.missing)
    exact = filtered_states(q, 1000.0, replace(signals, median=1))
    assert states.errors.known.all()
    errors = np.abs(states.q - exact.q)
    assert (errors[300:310, 4:].max(axis=0) < 2 * errors[100:-100, 4:].max(axis=0)).all()


def test_motor_side_of_a_file(tmp_path):
    """The file of a planar arm with coupled motors: columns that are missing reach the joints that
    follow from them.
    """
    given = replace(written("csv", tmp_path), side="motor")
    model = load_model("planar_2r", folder=GENERATED)
    drives = {"ratio": [[40.0, 0.0], [10.0, 30.0]]}

    class Coupled:
        NAME, JOINTS, LABELS, DRIVES = model.NAME, model.JOINTS, {}, drives

    record = read_record(given, Coupled, missing=True)
    np.testing.assert_array_equal(record.missing.at_joints()[:, 1], MISSING[:200].any(axis=1))
    motor = Drives.from_mapping(drives).motor_position(record.q)
    np.testing.assert_allclose(motor[~MISSING[:200]], RECORD.q[:200][~MISSING[:200]], atol=1e-12)


@pytest.mark.parametrize("steps", [2, pytest.param(8, marks=campaign)])
def test_cestac_of_a_record_with_gaps(steps):
    """Law phase, from draws of the posterior and from the positions: rows of the long gap stay out,
    estimates near the whole record's.
    """
    asked = CestacSettings(delta=(steps * STEP,), runs=2, columns="all", rounding="phase")
    found, whole = (
        cestac(planar, record, replace(STUDY, cestac=asked)).levels[0].runs[1].X
        for record in (RECORD, WHOLE)
    )
    np.testing.assert_allclose(found, whole, atol=0.06)


def test_identify_prints_what_is_missing(tmp_path):
    written("csv", tmp_path, samples=N)
    study = (
        "record: {files: record.csv}\nsignals: {reader: counts, lowpass: {cutoff: 20}}\nrows: "
        "{trim: 20}\n"
    )
    (tmp_path / "study.yaml").write_text(study)
    (tmp_path / "plain.yaml").write_text(study.replace("reader: counts, ", ""))
    done = CliRunner().invoke(app, ["identify", "planar_2r", str(tmp_path / "study.yaml")])
    assert done.exit_code == 0, done.output
    assert f"encoder 2: {MISSING[:, 1].sum()} samples are missing" in done.output
    refused = CliRunner().invoke(
        app, ["identify", "planar_2r", str(tmp_path / "plain.yaml"), "--json"]
    )
    assert (
        refused.exit_code == 2
        and "takes such samples as missing" in refused.output
        and not json.dumps(refused.output).count("Traceback")
    )
