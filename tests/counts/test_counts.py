"""The reader of counts: its linear algebra against dense NumPy, its moments against SciPy, its
states against motions known in closed form.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign, sampled
from planar_data import motion
from problems import observed_states
from scipy.integrate import quad
from scipy.stats import norm, truncnorm

import runtime
import symgen
from runtime import load_model
from runtime.compose import observe, problem
from runtime.core.model import drives_of
from runtime.core.record import Record
from runtime.core.rows.prepared import decimated_torque, observation_of
from runtime.core.rows.regressor import Columns
from runtime.core.rows.selection import UNCERTAIN, certain_rows, select_rows
from runtime.core.signals.filters import filtered_states
from runtime.core.study import Lowpass
from runtime.counts.boxes import box_moments
from runtime.counts.encoder_advice import encoder_sentences
from runtime.counts.lattice import lattice
from runtime.counts.reading import MARGIN, STRETCH, read_counts, stretches
from runtime.counts.spline import Basis, Factor, next_density
from runtime.ground.errors import InputError, SettingsError
from runtime.reading.datasets import dataset_study
from runtime.reading.records import read_records
from runtime.study import CestacSettings, Rows, Signals, Study, study_from_mapping
from symgen.demo import MAIN

GENERATED = Path(__file__).parents[2] / "generated"

RATE = 2000.0
T = np.arange(8000) / RATE
W1, W2 = 2 * np.pi * 0.7, 2 * np.pi * 2.3


def moved():
    """q, qd, qdd of two joints, rad: sums of two sinusoids, which rest nowhere for long."""
    shift = np.array([0.0, 1.0])
    a, b = W1 * T[:, None] + shift, W2 * T[:, None] + 2 * shift
    return (
        np.sin(a) + 0.2 * np.sin(b),
        W1 * np.cos(a) + 0.2 * W2 * np.cos(b),
        -(W1**2) * np.sin(a) - 0.2 * W2**2 * np.sin(b),
    )


def counted(q, step, seed=3):
    phase = np.random.default_rng(seed).random(q.shape[1]) * step
    return np.round((q - phase) / step) * step + phase


def test_the_posterior_is_that_of_dense_linear_algebra():
    """Precision, solution and the band of the inverse, with knots every 3 samples, against
    numpy.linalg on the written-out system.
    """
    rng = np.random.default_rng(0)
    basis = Basis(100, 3, 0.1)
    tau, nu = rng.random((2, basis.M * basis.m))
    density = 1 + rng.random(basis.M)
    factor = Factor.of(basis.precision(tau, density))
    c = factor.solve(basis.gradient(nu, density, np.zeros(basis.P)))
    Z = factor.inverse()
    rows = np.zeros((basis.M * basis.m, basis.P))
    jerk = np.zeros((basis.M, basis.P))
    for i in range(basis.M):
        jerk[i, i : i + 4] = np.array([-1, 3, -3, 1]) / basis.h**3
        for u in range(basis.m):
            rows[i * basis.m + u, i : i + 4] = basis.values[0][u]
    np.testing.assert_array_equal(basis.rows(np.arange(len(rows))).toarray(), rows)
    A = rows.T @ (tau[:, None] * rows) + jerk.T @ (basis.h / density[:, None] * jerk)
    dense = np.linalg.inv(A)
    np.testing.assert_allclose(c, dense @ rows.T @ nu, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(factor.log_determinant, np.linalg.slogdet(A)[1], rtol=1e-9)
    for lag in range(4):
        np.testing.assert_allclose(
            Z[lag, : basis.P - lag], np.diag(dense, lag), rtol=1e-7, atol=1e-10
        )
    np.testing.assert_allclose(
        basis.variances(Z), np.einsum("ka,ab,kb->k", rows, dense, rows), rtol=1e-7
    )


def test_the_basis_is_differentiated():
    """Values and derivatives of a random spline against central differences of its values."""
    basis = Basis(4000, 400, 1e-3)
    c = np.random.default_rng(1).standard_normal(basis.P)
    x, v, a = (basis.at_samples(c, order) for order in range(3))
    np.testing.assert_allclose(np.gradient(x, 1e-3)[1:-1], v[1:-1], atol=2e-3 * np.abs(v).max())
    np.testing.assert_allclose(np.gradient(v, 1e-3)[1:-1], a[1:-1], atol=2e-2 * np.abs(a).max())


@pytest.mark.parametrize(
    ("a", "b"), [(-0.5, 0.5), (-3.0, -1.0), (2.0, 5.0), (6.0, 9.0), (-40.0, 0.3), (-0.2, 40.0)]
)
def test_moments_of_a_box_are_those_of_a_truncated_normal(a, b):
    mass, g, H = box_moments(np.array([a]), np.array([b]))
    mean, variance = truncnorm.stats(a, b, moments="mv")
    np.testing.assert_allclose([g[0], 1 - H[0]], [mean, variance], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(np.exp(mass[0]), quad(norm.pdf, a, b, epsabs=0)[0], rtol=1e-6)


@pytest.mark.parametrize("per_turn", [20000, 2000, 200])
def test_deviations_are_true_at_every_speed(per_turn):
    """From several counts a sample to some twenty samples a count: errors are as large as stated,
    and far below those of the low-pass.
    """
    q, qd, _ = moved()
    step = 2 * np.pi / per_turn
    reading = read_counts(counted(q, step), RATE, step)
    inner = slice(200, -200)
    z = np.array(
        [
            ((x - truth)[inner] / s[inner])
            for x, s, truth in ((reading.q, reading.s_q, q), (reading.qd, reading.s_qd, qd))
        ]
    )
    rms = np.sqrt((z**2).mean(axis=1))
    assert ((rms > 0.3) & (rms < 1.5)).all(), rms
    low = filtered_states(counted(q, step), RATE, Signals(median=1, lowpass=Lowpass(cutoff=50)))
    error, before = (np.sqrt(((x - qd)[inner] ** 2).mean()) for x in (reading.qd, low.qd))
    assert error < before / 1.5


def test_a_motion_that_answers_its_counts_is_told_and_read_as_smooth():
    """Its controller sees the counts, so that between lines it accelerates and at each it is thrown
    back: no prior of smooth motion knows that.
    """
    q, qd, _ = (x[:, 0] for x in moved())
    step, kp, kd = 0.01, 4e4, 400.0
    x, v, y, before, positions, speeds = q[0], qd[0], q[0], q[0], [], []
    for r, rd in zip(q, qd, strict=True):
        before, y = y, step * np.round(x / step)
        a = kp * (r - y) + kd * (rd - (y - before) * RATE)
        positions.append(x)
        speeds.append(v)
        x, v = x + v / RATE + a / 2 / RATE**2, v + a / RATE
    counts = step * np.round(np.array(positions)[:, None] / step)
    inner = slice(400, -400)
    reading = read_counts(counts, RATE, step)
    off = np.sqrt(np.mean(((reading.q[:, 0] - positions) / reading.s_q[:, 0])[inner] ** 2))
    assert off < 2
    assert any("cross one line to and fro" in text for text in reading.findings)
    certain = reading.s_qd[:, 0] < np.abs(reading.qd[:, 0])
    assert (
        certain.mean() > 0.8
        and (np.sign(reading.qd[:, 0]) == np.sign(speeds))[certain].mean() > 0.95
    )
    assert not any(
        "to and fro" in text for text in read_counts(counted(q[:, None], step), RATE, step).findings
    )


@pytest.mark.parametrize(("seed", "within"), [(0, 0.05), (1, 0.05), (2, 0.09), (3, 0.05)])
def test_an_even_encoder_is_even_where_it_counts_slowly(seed, within):
    """At 130 to 180 changes in 10 s: errors of 0.25 steps were told of three, and their
    accelerations were off by 8 to 9 %.
    """
    rng, t = np.random.default_rng(seed), np.arange(10_000) / 1000
    size, phase = rng.uniform(0.3, 1, 5) * [1, 0.6, 0.4, 0.3, 0.2], rng.uniform(0, 2 * np.pi, 5)
    w = 0.1 * np.pi * np.arange(1, 6)
    waves = size * np.sin(t[:, None] * w + phase)
    q, qdd = waves.sum(axis=1, keepdims=True), (-(w**2) * waves).sum(axis=1, keepdims=True)
    reading = read_counts(np.round(q / 0.02) * 0.02, 1000.0, 0.02)
    assert not reading.findings
    assert np.std(reading.qdd - qdd) < within * np.std(qdd)


@pytest.mark.parametrize(
    ("speed", "lost", "samples", "within"),
    [(3.0, 2, 4000, 0), (30.0, 8, 4000, 1), (100.0, 30, 4000, 1), (0.3, 3, 30_000, 0)],
)
def test_lost_counts_are_found_at_every_speed(speed, lost, samples, within):
    """`speed` counts a sample, jumps below the change of one sample; in a long record away from the
    part that tells the errors of counts. A leap of a fast joint is told to one count.
    """
    t, w = np.arange(samples) / 1000.0, 2 * np.pi * 0.7
    q = 1000 * speed / w * (np.sin(w * t + 5) + 0.3 * np.sin(2.3 * w * t + 4))
    counts = np.round(q)
    at = samples // 2 - 173
    counts[at:] += lost
    reading = read_counts(counts[:, None], 1000.0, 1.0)
    (text,) = (text for text in reading.findings if "as if counts were lost" in text)
    assert f" at {t[at]:.4g} s" in text
    off = reading.q[:, 0] - q
    assert np.abs(off - off[:500].mean()).max() < 0.5 + within


def test_draws_have_the_stated_deviation():
    q, _, _ = moved()
    reading = read_counts(counted(q, 0.01), RATE, 0.01)
    draws = np.array([reading.draw(np.random.default_rng(k)) for k in range(20)])
    ratio = np.sqrt(((draws - reading.q) ** 2).mean(axis=0)) / reading.s_q
    assert abs(float(ratio.mean()) - 1) < 0.05


def test_missing_samples_are_bridged():
    q, qd, _ = moved()
    position = counted(q, 2e-3)
    position[1000:1040] = np.nan
    reading = read_counts(position, RATE, 2e-3)
    assert np.isfinite(reading.qd).all()
    assert (np.abs(reading.qd - qd)[1000:1040] < 6 * reading.s_qd[1000:1040]).all()
    assert reading.s_q[1020].max() > 1.5 * reading.s_q[900:950].max()


def test_step_and_phase_come_from_the_record():
    q, _, _ = moved()
    position = counted(q, 2 * np.pi / 1000) + 1e-14 * np.random.default_rng(0).standard_normal(
        q.shape
    )
    known = lattice(position)
    np.testing.assert_allclose(known.step, 2 * np.pi / 1000, rtol=1e-9)
    cells = (position - known.phase) / known.step
    np.testing.assert_allclose(cells, np.round(cells), atol=1e-6)
    assert "steps from the record" in known.findings[0]


def test_a_step_that_is_a_fraction_of_the_true_one_is_told():
    q, _, _ = moved()
    known = lattice(counted(q, 0.01), 0.005)
    np.testing.assert_allclose(known.step, 0.01)
    assert "not 0.005" in known.findings[0]


@pytest.mark.parametrize(
    ("change", "step", "words"),
    [
        (
            lambda q: q + 0.003 * np.sin(40 * T)[:, None],
            0.01,
            "away from the values that an encoder",
        ),
        (lambda q: q, 0.013, "set signals.step to 0.01 for this encoder"),
        (
            lambda q: (q[2:] + q[1:-1] + q[:-2]) / 3,
            0.01,
            "3 times finer: .* or, if a driver averaged",
        ),
        (lambda q: q, 0.0, "expected a positive number"),
        (lambda q: q, 40.0, "larger than the motion of the encoder"),
        (lambda q: 0 * q, None, "no position changes"),
        (
            lambda q: np.where(np.arange(len(q))[:, None] < 3000, q, q - 123 * 0.01),
            0.01,
            "jumps by",
        ),
    ],
)
def test_what_are_no_counts_is_refused(change, step, words):
    q, _, _ = moved()
    with pytest.raises(InputError, match=words):
        read_counts(change(counted(q, 0.01)), RATE, step)


def test_counts_that_wrap_are_unwrapped_and_told():
    q, _, _ = moved()
    straight = counted(q, 1e-4)
    wrapped = straight.copy()
    wrapped[:, 0] = 1e-4 * ((np.round(straight[:, 0] / 1e-4) + 2**16 - 3000) % 2**16)
    assert np.abs(np.diff(wrapped[:, 0])).max() > 6
    reading = read_counts(wrapped, RATE, 1e-4)
    assert any("wraps at 2^16" in text for text in reading.findings)
    moved_by = reading.q[:, 0] - read_counts(straight, RATE, 1e-4).q[:, 0]
    np.testing.assert_allclose(moved_by, moved_by[0], atol=1e-4)


@pytest.mark.parametrize("step", [1e-4, None])
def test_counts_in_multiples_of_four_wrap_where_the_counter_does(step):
    """A driver that counts in fours of a 16-bit counter: its steps wrap after 2^14 of them."""
    straight = counted(moved()[0], 4e-4)
    wrapped = straight.copy()
    wrapped[:, 0] = 4e-4 * ((np.round(straight[:, 0] / 4e-4) + 2**14 - 800) % 2**14)
    assert np.abs(np.diff(wrapped[:, 0])).max() > 6
    reading = read_counts(wrapped, RATE, step)
    assert any("wraps at 2^16" in text for text in reading.findings)
    moved_by = reading.q[:, 0] - read_counts(straight, RATE, step).q[:, 0]
    np.testing.assert_allclose(moved_by, moved_by[0], atol=4e-4)


@pytest.mark.parametrize("bits", [16, pytest.param(32, marks=campaign)])
def test_wraps_across_stretches(planar, record, monkeypatch, bits):
    """Counts that wrap within a stretch, within its margins and while samples are missing: rows and
    sentences.
    """
    monkeypatch.setattr("runtime.counts.reading.STRETCH", 1500)
    monkeypatch.setattr("runtime.counts.reading.MARGIN", 400)
    fine, half = 2e-5, slice(4000)
    wrapped = fine * (np.round(motion(record.t[half])[0] / fine) % 2**bits)
    missing = np.zeros(wrapped.shape, dtype=bool)
    at = np.flatnonzero(np.abs(np.diff(wrapped[:, 0])) > 0.1)
    missing[at[0] - 3 : at[0] + 4, 0] = True
    study = replace(STUDY, signals=replace(STUDY.signals, step=fine))
    changed = Record(record.t[half], wrapped, record.tau[half], rate=1000.0, missing=missing)
    whole = observe(planar, changed, study)
    assert sum(f"the count wraps at 2^{bits} " in text for text in whole.findings) == 2
    assert "samples are missing" in " ".join(whole.findings)
    reset = wrapped.copy()
    reset[3000:, 1] -= 1234567 * fine
    with pytest.raises(
        InputError,
        match=r"encoder 2: the count jumps by -123\d+ at sample 3000; the encoder was reset or its count was lost",
    ):
        observe(planar, replace(changed, q=reset), study)


def test_an_encoder_at_rest_is_told():
    q, _, _ = moved()
    position = counted(q, 0.01)
    position[:, 1] = 0.03
    reading = read_counts(position, RATE, 0.01)
    assert "encoder 2: the count never changes" in reading.findings[0]
    assert not reading.qd[:, 1].any() and np.allclose(reading.s_q[:, 1], 0.01 / np.sqrt(12))


def test_uneven_lines_are_detected():
    """A pattern of period four and 0.1 steps: told, its bounds widened."""
    q, _, _ = moved()
    step, shift = 0.01, 0.1 * np.array([1.0, -1.2, 0.9, -0.7])
    numbers = np.arange(-200, 200)
    edges = np.sort(numbers + 0.5 + shift[numbers % 4])
    position = step * (-200 + np.searchsorted(edges, q / step))
    reading = read_counts(position, RATE, step)
    assert any("by 0.12 steps (rms)" in text for text in reading.findings)
    assert not read_counts(counted(q, step), RATE, step).findings


@pytest.mark.parametrize("per_turn", [2000, 200])
def test_another_phase_is_read_from_what_the_first_told(per_turn):
    """The same motion within a twentieth of its deviations; counts that contradict what is given are
    read anew.
    """
    q, _, _ = moved()
    step = 2 * np.pi / per_turn
    starts = read_counts(counted(q, step), RATE, step).starts
    assert [*starts] == [(0, 0), (0, 1)]
    other = counted(q, step, seed=4)
    reading = read_counts(other, RATE, step, starts=starts)
    alone = read_counts(other, RATE, step)
    for x, right, s in ((reading.q, alone.q, alone.s_q), (reading.qd, alone.qd, alone.s_qd)):
        assert np.sqrt(np.mean(((x - right) / s) ** 2)) < 0.05
    np.testing.assert_allclose(reading.s_qd.mean(axis=0), alone.s_qd.mean(axis=0), rtol=0.05)
    off = other + step * np.random.default_rng(5).integers(-1, 2, other.shape)
    found, right = read_counts(off, RATE, step, starts=starts), read_counts(off, RATE, step)
    np.testing.assert_array_equal(found.q, right.q)


@pytest.fixture(scope="module")
def planar():
    return symgen.model("planar_2r")


@pytest.fixture(scope="module")
def record(planar):
    states = motion(np.arange(8000) / 1000.0)
    torque = planar.inverse_dynamics(*states, planar.base_parameters(planar.VALUES))
    return Record(np.arange(8000) / 1000.0, counted(states[0], 5e-3), torque, rate=1000.0)


STUDY = Study(
    signals=Signals(lowpass=Lowpass(cutoff=20), reader="counts", step=5e-3), rows=Rows(trim=20)
)


def test_rows_of_uncertain_direction_are_left_out(planar, record):
    observation = observe(planar, record, STUDY)
    states = observed_states(record.q, record.rate, STUDY.signals)
    k = select_rows(record, states.qd, STUDY.signals, STUDY.rows).kept
    slow = np.abs(states.qd[k]) < UNCERTAIN * states.errors.deviation[k]
    names = [name for name in planar.BASE_PARAMETERS if name.startswith("FS")]
    assert (
        names
        and observation.dropped["direction"] == tuple(int(n) for n in slow[20:-20].sum(axis=0))
        and slow[20:-20].any()
    )


def test_no_direction_is_known_while_a_joint_stands():
    """Moves of half a second with rests as long, between two lines or on one; and a slow sinusoid,
    which turns back as slowly.
    """
    t = np.arange(6000) / 1000.0
    moves = np.clip(t - np.floor(t), 0, 0.5) * 2
    q = np.floor(t) % 2 + np.where(np.floor(t) % 2, -1, 1) * (1 - np.cos(np.pi * moves)) / 2
    stands = (t % 1 > 0.55) & (t % 1 < 0.95)
    for step in (1e-3, 6.28e-3):
        reading = read_counts(counted(q[:, None], step), 1000.0, step)
        unknown = np.abs(reading.qd[:, 0]) < UNCERTAIN * reading.s_qd[:, 0]
        assert unknown[stands].all() and unknown[t % 1 < 0.45].mean() < 0.1
    slow = 0.1 * np.sin(2 * np.pi * 0.1 * t)[:, None]
    reading = read_counts(counted(slow, 6.28e-3), 1000.0, 6.28e-3)
    assert (np.abs(reading.qd) < UNCERTAIN * reading.s_qd).mean() < 0.05


def test_a_coarser_step_of_the_record_is_told(planar, record, monkeypatch):
    monkeypatch.setattr("runtime.counts.reading.STRETCH", 3000)
    study = replace(STUDY, signals=replace(STUDY.signals, step=2.5e-3))
    found = observe(planar, record, study).findings[0]
    assert "multiples of 2; the step of the record is 0.005" in found


def test_identify_prints_what_the_reader_says_of_the_encoders(planar, record):
    noise = 0.02 * np.random.default_rng(0).standard_normal(record.tau[:4000].shape)
    half = Record(record.t[:4000], record.q[:4000], record.tau[:4000] + noise, rate=1000.0)
    result = runtime.identify(
        planar, half, replace(STUDY, signals=replace(STUDY.signals, step=2.5e-3)), friction=True
    )
    assert tuple(len(curve.v) for curve in result.part("friction").curves) == tuple(
        joint.rows for joint in result.estimate.per_joint
    )
    assert (
        "record: encoder 2: counts change by multiples of 2; the step of the record is 0.005, not "
        "0.0025."
    ) in result.to_text()


def test_stretches_cover_the_record_once():
    for N in (10, STRETCH, STRETCH + 1, 5 * STRETCH // 2, 1_000_000):
        parts = stretches(N)
        assert [p[1] for p in parts] == [0, *(p[2] for p in parts[:-1])] and parts[-1][2] == N
        assert all(
            begin == max(first - MARGIN, 0) and end == min(stop + MARGIN, N)
            for begin, first, stop, end in parts
        )


def test_encoders_on_the_motors_of_a_coupled_wrist():
    """Motor 6 sees q5 and q6: six encoders of 200 lines on the motors, read there, say joints to
    the step over the ratio.
    """
    model = load_model("tx40", folder=GENERATED)
    drives = {
        key: np.array(value) for key, value in model.DRIVES.items() if key != "torque_constant"
    }
    t = np.arange(3000) / 1000.0
    q = 0.4 * np.sin(2 * np.pi * 0.6 * t[:, None] + np.arange(6)) + drives["offset"]
    step = 2 * np.pi / 50
    motor = np.round((q - drives["offset"]) @ drives["ratio"].T / step) * step
    joint = motor @ np.linalg.inv(drives["ratio"]).T + drives["offset"]
    signals = Signals(lowpass=Lowpass(cutoff=20), reader="counts", step=step, side="motor")
    states = observed_states(joint, 1000.0, signals, drives_of(model))
    exact = filtered_states(q, 1000.0, replace(signals, median=1))
    worth = [
        np.sqrt(((x.qd - exact.qd)[100:-100] ** 2).mean(axis=0))
        for x in (states, filtered_states(joint, 1000.0, Signals(lowpass=Lowpass(cutoff=20))))
    ]
    assert (worth[0] < worth[1] / 2).all()
    np.testing.assert_allclose(states.errors.root @ drives["ratio"], np.eye(6), atol=1e-12)
    with pytest.raises(InputError, match="away from the values that an encoder"):
        observed_states(joint, 1000.0, replace(signals, side="joint"))


@pytest.mark.parametrize(
    "coupling", sampled(["both", "position", "torque", "none"], 0, always=("both",))
)
def test_motor_counts_are_counts_whatever_the_coupling(coupling, tmp_path):
    """Positions that were turned by drives of some coupling are turned back by the same drives."""
    model = load_model("tx40", folder=GENERATED)
    ratio = np.array(model.DRIVES["ratio"])
    t = np.arange(2000) / 1000.0
    q = 0.4 * np.sin(2 * np.pi * 0.6 * t[:, None] + np.arange(6))
    step = 2 * np.pi / 50
    np.savez(tmp_path / "run.npz", t=t, q=np.round(q @ ratio.T / step) * step, tau=np.cos(q))
    study = study_from_mapping(
        {
            "record": {
                "files": "run.npz",
                "columns": {"t": "t", "q": "q", "tau": "tau"},
                "side": "motor",
                "coupling": coupling,
            },
            "signals": {
                "lowpass": {"cutoff": 20},
                "reader": "counts",
                "step": step,
                "side": "motor",
            },
        }
    )
    (record,) = read_records(study.record, model, folder=tmp_path)
    assert record.origin.drives.coupling == coupling
    assert problem(model, record, study).prepared[0].states.errors.known.all()
    coarse = replace(
        study, cestac=CestacSettings(side="motor", rounding="phase", delta=6 * step, runs=2)
    )
    assert np.isfinite(runtime.cestac(model, record, coarse).levels[0].mean).all()


def test_settings_of_counts_need_the_reader(planar, record):
    with pytest.raises(
        SettingsError, match=r"signals\.step: .*does not use this key.*reader: counts"
    ):
        problem(planar, record, Study(signals=Signals(step=0.01)))


def test_a_record_that_counts_would_help_is_told(planar, record):
    positions = replace(STUDY.signals, reader="lowpass", step=None)
    own = problem(planar, record, replace(STUDY, signals=positions)).prepared[0]
    (text,) = encoder_sentences(record, own.states, positions, own.drives)
    assert "reader: counts" in text and "0.005" in text
    fine = Record(record.t, counted(motion(record.t)[0], 1e-6), record.tau, rate=1000.0)
    assert encoder_sentences(fine, own.by(own.study).states, positions, own.drives) == ()


@campaign
def test_measured_record_at_a_coarse_step(tx40_data):
    """2 pi/1000 at the joints: main parameters within 2 % rms of those of the whole record,
    low-pass above 20 %.
    """
    model, study = load_model("tx40", folder=GENERATED), study_from_mapping(dataset_study("tx40"))
    full = read_records(study.record, model)[0]
    step = 2 * np.pi / 1000
    main = list(MAIN)
    q = counted(full.q, step)
    signals = replace(study.signals, reader="counts", step=step)
    read = observed_states(q, full.rate, signals)

    def fitted(states, keep=None):
        selection = select_rows(full, states.qd, study.signals, study.rows, keep=keep)
        rows = observation_of(
            Columns(model),
            replace(states, errors=None),
            decimated_torque(full.tau, selection),
            selection,
        )
        X, *_ = np.linalg.lstsq(rows.W / np.linalg.norm(rows.W, axis=0), rows.Y, rcond=None)
        return (X / np.linalg.norm(rows.W, axis=0))[
            [model.BASE_PARAMETERS.index(name) for name in main]
        ]

    reference = fitted(filtered_states(full.q, full.rate, study.signals))
    by_counts, by_positions = (
        np.sqrt(np.mean((X / reference - 1) ** 2))
        for X in (
            fitted(read, certain_rows(model, read).T),
            fitted(filtered_states(q, full.rate, study.signals)),
        )
    )
    assert by_counts < 0.02 and by_positions > 0.2


def test_a_motion_without_jerk_has_a_density_that_factors():
    """Constant speed, ten seconds a count: MacKay's rule has no fixed point but zero, and its
    passes would overflow.
    """
    y = np.round(0.1 * np.arange(20_000) / 1000.0)
    basis = Basis(20_000, 2, 1e-3)
    samples, ones = basis.of_samples(np.full(y.shape, 0.06)), np.ones(basis.M)
    g, r = basis.gradient(0.06 * y, ones, np.zeros(basis.P)), 1e8
    for _ in range(30):
        r = next_density(basis, samples, basis.of_prior(ones), g, r)
    assert r == basis.least_density
    assert np.isfinite(Factor.of(basis.precision(np.full(y.shape, 0.06), r * ones)).solve(g)).all()
