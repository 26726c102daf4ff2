"""Irregular clocks: what is said about them, and samples brought to a uniform rate against the
analytic signal, never across a gap.
"""

from copy import copy
from itertools import pairwise

import numpy as np
import planar_2r_model as planar
import pytest
from campaign import campaign
from hypothesis import given
from hypothesis import strategies as st

from runtime import estimate, observe, read_record, resample
from runtime.core.record import Record
from runtime.ground.clock import remedy_text, time_stamps
from runtime.ground.errors import InputError
from runtime.reading.records import read_records
from runtime.reading.resampling import resampled
from runtime.reading.settings import Resample
from runtime.study import study_from_mapping

RATE = 500.0
T = np.arange(2000) / RATE
PULSATIONS = 2 * np.pi * np.array([3.0, 11.0, 23.0])  # rad/s; at most 1/20 of the rate


def signal(t):
    """A band-limited signal, shape (N, 2), amplitude at most 1."""
    s = np.stack([np.sin(PULSATIONS * x) for x in t]).sum(axis=1) / 3
    c = np.stack([np.cos(PULSATIONS * x + 1) for x in t]).sum(axis=1) / 3
    return np.stack([s, c], axis=1)


# --- what is said
# -------------------------------------------------------------------------------------------------------


def test_a_regular_clock():
    found = time_stamps(T)
    assert (
        found.regular
        and found.samples == 2000
        and found.period == pytest.approx(1 / RATE)
        and found.jitter < 1e-9
    )
    assert found.to_text() == "2000 samples, median step 0.002 s"  # jitter of 1e-11 % is none


def test_every_irregularity_is_found():
    t = T.copy()
    t[100:] += 0.5  # a gap of 251 periods ends in sample 101
    t[500:] -= 0.2  # back by 99 periods
    t[900] = t[899]
    t[1200:] += 0.01
    found = time_stamps(t)
    assert [(s.sample, round(s.step, 6)) for s in found.gaps] == [(100, 0.502), (1200, 0.012)]
    assert [(s.sample, round(s.step, 6)) for s in found.resets] == [(500, -0.198)]
    assert [s.sample for s in found.repeats] == [900]
    text = found.to_text()
    assert "2 gaps at sample 101 (t = 0.198 s, 0.502 s, 251 periods), sample 1201" in text
    assert (
        "1 step back at sample 501 (t = 1.498 s, -0.198 s)" in text
        and "1 repeated stamp at sample 901 (t = 2.098 s)" in text
    )


def test_many_gaps_are_counted_and_the_largest_named():
    t = T.copy()
    for k in range(10):
        t[100 * (k + 1) :] += 0.1 * (k + 1)
    text = time_stamps(t).to_text(lambda i: f"line {i + 2}")
    assert "10 gaps, the largest at line 1002 (" in text and text.count("line ") == 3


def test_jitter_is_told():
    rng = np.random.default_rng(0)
    found = time_stamps(T + rng.uniform(-0.05, 0.05, len(T)) / RATE)
    assert 0.08 < found.jitter < 0.11 and 0.03 < found.jitter_rms < 0.05
    with pytest.raises(InputError, match="the time stamps never increase"):
        time_stamps(T[::-1])


# --- resampling
# ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [0.0, 12.3, 1.7e9])
def test_three_periods_are_no_more_than_three_periods(start):
    """Clocks of any rate and beginning that left out two samples here and there, which rounding
    must not make longer than `longest`.
    """
    for rate in np.geomspace(37.0, 3000.0, 200):
        t = start + np.delete(np.arange(300), [50, 51, 120, 121, 200, 201]) / rate
        assert not time_stamps(t, gap=3.0).gaps, rate
        later = np.where(np.arange(len(t)) < 100, t, t + 0.2 / rate)
        assert time_stamps(later, gap=3.0).gaps == () and len(time_stamps(later, gap=2.5).gaps) == 3


def test_a_mask_is_as_long_resampled_as_it_was():
    mask = np.zeros((len(T), 2), dtype=bool)
    mask[300:303, 0] = True
    settings = Resample(rate=2 * RATE)
    ((stretch,), *_) = resampled(T, [signal(T), mask], time_stamps(T), settings, None, file="x")
    assert stretch.signals[1].dtype == np.bool_
    np.testing.assert_array_equal(
        np.flatnonzero(stretch.signals[1][:, 0]), np.arange(2 * 300 - 1, 2 * 302 + 2)
    )
    assert not stretch.signals[1][:, 1].any()


@st.composite
def clocks(draw):
    """Stamps with jitter up to a third of a period, gaps, resets and repeats."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    step = (1 + draw(st.floats(0, 0.33)) * rng.uniform(-1, 1, 1500)) / RATE
    for _ in range(draw(st.integers(0, 3))):
        step[draw(st.integers(1, 1499))] = draw(st.sampled_from([0.05, 0.5, -0.3, -1.0, 0.0]))
    return np.cumsum(step)


@given(
    t=clocks(),
    method=st.sampled_from(["cubic", "linear"]),
    rate=st.sampled_from([None, RATE, 777.0]),
)
@campaign
def test_resampled_signal_is_the_signal(t, method, rate):
    """To the bounds of de Boor at steps of 1.66 periods (a step of 1 + 2 x 0.33), inside of a
    stretch; the grid is exact; no sample lies in a gap.
    """
    stamps = time_stamps(t)
    stretches, found_rate, _ = resampled(
        t,
        [signal(t)],
        stamps,
        Resample(rate=rate, method=method, gaps="split", shortest=0.1),
        None,
        file="x",
    )
    if rate is not None:
        assert found_rate == rate
    h = 1.66 / RATE * PULSATIONS.max()
    bound = {"linear": h**2 / 8, "cubic": 5 * h**4 / 384}[method]
    inner = slice(0, None) if method == "linear" else slice(20, -20)
    cuts = [0, *sorted(s.sample for s in (*stamps.gaps, *stamps.resets)), len(t)]
    covered = [(t[a], t[b - 1]) for a, b in pairwise(cuts)]
    for stretch in stretches:
        assert np.array_equal(stretch.t, stretch.t[0] + np.arange(len(stretch.t)) / found_rate)
        assert any(
            first == stretch.t[0] and stretch.t[-1] <= last + 1e-6 / found_rate
            for first, last in covered
        )
        np.testing.assert_allclose(
            stretch.signals[0][inner], signal(stretch.t)[inner], rtol=0, atol=bound
        )
    assert sum(len(stretch.t) for stretch in stretches) > 0


def test_regular_samples_stay_as_they_are():
    for method in ("cubic", "linear"):
        (stretch,), rate, text = resampled(
            T, [signal(T)], time_stamps(T), Resample(method=method), RATE, file="x"
        )
        np.testing.assert_allclose(stretch.signals[0], signal(T), rtol=0, atol=1e-12)
        assert (
            rate == RATE
            and len(stretch.t) == len(T)
            and text == f"resampled at 500 Hz ({method}): 2000 samples in 1 stretch"
        )


def test_a_repeated_stamp_keeps_its_first_sample():
    t, x = np.insert(T, 700, T[699]), np.insert(signal(T), 700, [9, 9], axis=0)
    (stretch,), _, text = resampled(t, [x], time_stamps(t), Resample(), RATE, file="x")
    np.testing.assert_allclose(stretch.signals[0], signal(T), atol=1e-12)
    assert text.endswith("1 samples of repeated stamps left out")


def test_counted_samples_stay_as_they_are():
    """Uniform samples whose stamps jitter, repeat, miss 0.5 s and start anew: three stretches of
    the very samples, on a uniform grid.
    """
    t = (
        T
        + np.random.default_rng(3).uniform(-0.25, 0.25, len(T)) / RATE
        + 0.5 * (np.arange(len(T)) >= 800)
    )
    t[1500:] -= t[1500]
    t[101] = t[100]
    stretches, rate, text = resampled(
        t, [signal(T)], time_stamps(t), Resample(method="count", gaps="split"), RATE, file="x"
    )
    np.testing.assert_array_equal(np.concatenate([s.signals[0] for s in stretches]), signal(T))
    assert [len(s.t) for s in stretches] == [800, 700, 500] and rate == RATE
    assert all(np.array_equal(s.t, s.t[0] + np.arange(len(s.t)) / RATE) for s in stretches)
    assert text == "taken as uniform at 500 Hz (count): 2000 samples in 3 stretches"
    _, own, _ = resampled(
        t, [signal(T)], time_stamps(t), Resample(method="count", gaps="split"), None, file="x"
    )
    assert own == pytest.approx(RATE, rel=1e-3)


def test_counted_samples_must_fill_their_time():
    for t, rate in ((np.delete(T, range(0, 2000, 100)), RATE), (T, 510.0)):
        with pytest.raises(
            InputError, match="the rate is different, or samples are missing; set record"
        ):
            resampled(t, [signal(t)], time_stamps(t), Resample(method="count"), rate, file="x")


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (Resample(), "time has gaps or goes back; set record.resample.gaps: split"),
        (Resample(gaps="split", rate=100), "below the rate of the record, 500 Hz"),
        (Resample(gaps="split", shortest=5), "no part of the record lasts 5 s without a gap"),
    ],
)
def test_refused(settings, said):
    t = T + 0.5 * (np.arange(len(T)) >= 800)
    with pytest.raises(InputError) as e:
        resampled(t, [signal(t)], time_stamps(t), settings, None, file="x")
    assert said in str(e.value)


# --- records
# ------------------------------------------------------------------------------------------------------------


def write(tmp_path, t):
    np.savez(tmp_path / "a.npz", t=t, q1=signal(t)[:, 0], q2=signal(t)[:, 1], tau1=t, tau2=-t)


def study(**record):
    return study_from_mapping({"record": {"files": "a.npz", **record}})


def test_a_record_with_a_gap_becomes_two(tmp_path):
    t = T + 0.5 * (np.arange(len(T)) >= 800)
    write(tmp_path, t)
    asked = study(resample={"gaps": "split", "rate": 500})
    records = read_records(asked.record, planar, folder=tmp_path)
    assert [(r.name, len(r), r.rate) for r in records] == [
        ("a (1 of 2)", 800, 500),
        ("a (2 of 2)", 1200, 500),
    ]
    np.testing.assert_allclose(np.concatenate([r.tau[:, 0] for r in records]), t, atol=1e-12)
    assert (
        "1 gap at sample 801 (t = 1.598 s, 0.502 s, 251 periods); resampled at 500 Hz (cubic): "
        "2000 samples in 2 stretches"
    ) in records[0].origin.time
    with pytest.raises(
        InputError,
        match=(
            "2 records (or pieces between gaps), but this function returns only one; use read_records, which returns all: a (1 of 2), a (2 of 2)"
        )
        .replace("(", r"\(")
        .replace(")", r"\)"),
    ):
        read_record(asked.record[0], folder=tmp_path)
    assert (
        copy(records[0]).origin.time == records[0].origin.time
    )  # as it travels to other processes


def test_errors_tell_all_irregularities(tmp_path):
    t = T + 0.5 * (np.arange(len(T)) >= 800)
    t[100] = t[99]
    write(tmp_path, t)
    for record, said in (
        (
            {},
            (
                "sample 101: time goes from 0.198 s to 0.198 s; expected increasing time. In all: "
                "2000 samples"
            ),
        ),
        ({"resample": {}}, "set record.resample.gaps: split"),
        (
            {"resample": {"gaps": "split"}, "rate": 1000},
            "the time stamps have the rate 500 Hz, but record.rate is 1000 Hz",
        ),
    ):
        with pytest.raises(InputError) as e:
            read_record(study(columns={"t": "t"}, **record).record[0], folder=tmp_path)
        assert "a.npz" in str(e.value) and said in str(e.value)
        remedy = (
            "Remedy: record.resample: {gaps: split} makes a record of each piece between gaps. "
            "If the samples are uniform and only their stamps are not: record.resample: {gaps: split, method: count}"
        )
        assert record or remedy in str(e.value)
        assert "rate" in record or (
            "1 gap at sample 801" in str(e.value)
            and "1 repeated stamp at sample 101" in str(e.value)
        )


def test_tolerable_jitter_is_stated(tmp_path):
    write(tmp_path, T + np.random.default_rng(1).uniform(-0.02, 0.02, len(T)) / RATE)
    record = read_record(study().record[0], folder=tmp_path)
    assert (
        record.origin.time.startswith("2000 samples, median step 0.00")
        and "jitter up to 4" in record.origin.time
    )
    assert read_record(study(rate=RATE).record[0], folder=tmp_path).origin.time == ""


def test_resampled_record_identifies_as_the_regular_one(tmp_path):
    """A motion sampled by a clock with 20 % jitter: W is that of the regular one to a thousandth,
    as the first samples are a tenth of a period apart.
    """
    from planar_data import motion

    t = np.arange(4000) / 1000
    jittered = t + np.random.default_rng(2).uniform(-0.1, 0.1, len(t)) / 1000
    found = []
    for name, at in (("regular", t), ("jittered", jittered)):
        q = motion(at)[0]
        np.savez(tmp_path / f"{name}.npz", t=at, q1=q[:, 0], q2=q[:, 1], tau1=at, tau2=at)
        asked = study_from_mapping(
            {
                "record": {
                    "files": f"{name}.npz",
                    "rate": 1000,
                    "columns": {"t": "t"},
                    "resample": {},
                },
                "signals": {"lowpass": {"cutoff": 20}},
            }
        )
        found.append(observe(planar, read_records(asked.record, planar, folder=tmp_path)[0], asked))
    K = min(len(o.Y) for o in found) // 2
    one, other = (np.concatenate([o.W[: o.rows[0]][:K], o.W[o.rows[0] :][:K]]) for o in found)
    scale = np.abs(one).max(axis=0)
    smooth = [i for i, name in enumerate(planar.BASE_PARAMETERS) if not name.startswith("FS")]
    np.testing.assert_allclose((other / scale)[:, smooth], (one / scale)[:, smooth], atol=1e-3)


# --- remedies
# -----------------------------------------------------------------------------------------------------------


def record_with(folder, t, q, tau, **record):
    """Records and study of a log, perhaps resampled."""
    np.savez(folder / "log.npz", t=t, q=q, tau=tau)
    columns = {"t": None if "rate" in record else "t", "q": "q", "tau": "tau"}
    asked = study_from_mapping(
        {
            "record": {"files": "log.npz", "columns": columns, **record},
            "signals": {"lowpass": {"cutoff": 30}},
        }
    )
    return read_records(asked.record, planar, folder=folder), asked


def test_the_remedy_named_is_the_best_of_the_three(tmp_path):
    """A controller of 1 kHz whose log lacks one sample in twenty, in gaps of a few: bridged, the
    error is that of the noise; the others are worse.
    """
    from planar_data import TRUE, motion

    rng = np.random.default_rng(3)
    t = np.arange(12000) / 1000
    q, qd, qdd = motion(t)
    tau = planar.inverse_dynamics(q, qd, qdd, TRUE) + rng.normal(0, 0.02, q.shape)
    kept = np.ones(len(t), bool)
    for start in rng.choice(len(t) - 20, 150, replace=False):
        kept[start + 1 : start + rng.integers(3, 9)] = False
    log = t[kept], q[kept], tau[kept]
    with pytest.raises(InputError) as e:
        record_with(tmp_path, *log)
    said = str(e.value)
    assert f"{kept.sum()} samples in 11.999 s (without pauses) give" in said
    assert "the median step gives 1000 Hz. Remedy: record.resample: {longest: " in said
    longest = float(said.partition("{longest: ")[2].partition("}")[0])
    mean = float(said.partition("record.rate: ")[2].split()[0])
    error = {}
    for name, record in (
        ("longest", {"resample": {"longest": longest}}),
        ("gaps", {"resample": {"gaps": "split", "shortest": 0.1}}),
        ("rate", {"rate": mean}),
    ):
        records, asked = record_with(tmp_path, *log, **record)
        error[name] = np.linalg.norm(estimate(planar, records, asked).X / TRUE - 1)
    assert error["longest"] < error["gaps"] and error["longest"] < 0.5 * error["rate"], error


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (
            np.where(np.arange(4000) == 2000, 1.5, 0.002),
            "{gaps: split} makes a record of each piece between gaps",
        ),
        (
            np.where(
                np.arange(4000) % 40 == 0, 0.006001, np.where(np.arange(4000) == 2001, 1.5, 0.002)
            ),
            "{gaps: split, longest: 4} makes a record of each piece between gaps and bridges gaps of up to 4 periods",
        ),
        (
            0.002 * (1 + np.random.default_rng(0).uniform(-0.3, 0.3, 4000)),
            "{} interpolates at the stamps. If the samples are uniform and only their stamps are not: record.resample: {method: count}, or record.rate",
        ),
    ],
)
def test_the_remedy_fits_the_clock(step, said):
    t = np.concatenate([[0.0], np.cumsum(step)])
    assert said in remedy_text(t, time_stamps(t))


def test_resample():
    rng = np.random.default_rng(1)
    t = np.delete(np.arange(3000) / RATE, rng.choice(2900, 200, replace=False) + 50)
    grid, x = resample(t, signal(t), 250 * 2, longest=6)
    np.testing.assert_allclose(np.diff(grid), 0.002, rtol=1e-9)
    np.testing.assert_allclose(x[20:-20], signal(grid)[20:-20], atol=0.02)
    _, one = resample(t, signal(t)[:, 0], 500, longest=6)
    np.testing.assert_array_equal(one, x[:, 0])
    record = Record(grid, x, x)
    assert record.rate == pytest.approx(500)
    for wrong, match in (
        ((t, signal(t)[:-1]), "expected"),
        ((t[::-1], signal(t)), "the time stamps never increase"),
        ((t + (t > 3), signal(t), 500), "one Record for each piece"),
        ((t, signal(t) * np.nan), "nan"),
        ((t, signal(t), 50), "would be aliased"),
    ):
        with pytest.raises(InputError, match=match):
            resample(*wrong, longest=6)
