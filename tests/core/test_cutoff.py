"""The cut-off that follows from a record: `signals.lowpass.cutoff: auto`."""

from dataclasses import replace

import numpy as np
import pytest
from problems import problem_of, resolved

import runtime
import symgen
from runtime.core.record import Origin
from runtime.core.signals.cutoff import cutoff
from runtime.core.signals.filters import median_filtered
from runtime.median import pulses_in_torques, share_taken
from runtime.study import Signals, Study

RATE = 1000.0
T = np.arange(10_000) / RATE
FAST = 2.5
"""Hz, highest frequency of the motion."""


def motion(step: float = 0.0, phase: float = 0.0) -> np.ndarray:
    q = np.stack([np.sin(2 * np.pi * f * T + phase) for f in (0.7, FAST)], axis=1)
    return np.round(q / step) * step if step else q


def test_the_motion_passes_and_coarser_steps_lower_the_cutoff():
    found = [cutoff([(motion(step), RATE)], Signals())[0] for step in (1e-6, 1e-4, 1e-3, 1e-2)]
    assert found == sorted(found, reverse=True) and found[0] < 50
    assert found[-1] > FAST


def test_where_noise_is_small_a_higher_cutoff_is_taken():
    """Dry friction bends at a low cut-off: a motion without noise is not cut where its lines end."""
    slow = np.sin(2 * np.pi * 0.3 * T)[:, None]
    noise = 1e-7 * np.random.default_rng(0).standard_normal(slow.shape)
    quiet, loud = (cutoff([(slow + x * noise, RATE)], Signals())[0] for x in (1, 1e3))
    assert quiet > 2 * loud


def test_spikes_that_the_median_takes_away_are_no_noise():
    q = motion(1e-4)
    spoilt = q.copy()
    spoilt[500::900] += 0.3
    found, expected = (cutoff([(x, RATE)], Signals())[0] for x in (spoilt, q))
    assert found == pytest.approx(expected, rel=0.25)


def test_a_joint_at_rest_and_the_reader_of_counts():
    q = motion(1e-3)
    still = np.column_stack([q, np.full(len(q), 0.3)])
    assert cutoff([(still, RATE)], Signals()) == cutoff([(q, RATE)], Signals())
    coarse = motion(1e-2)
    own = cutoff([(coarse, RATE)], Signals())[0]
    assert own < 25 and cutoff([(coarse, RATE)], Signals(), counts=True)[0] == pytest.approx(
        16, rel=0.05
    )
    coarse[100:110] = np.nan
    assert cutoff([(coarse, RATE)], Signals(), counts=True)[0] == 50
    assert cutoff([(np.ones((500, 2)), RATE)], Signals())[0] == 50
    assert cutoff([(np.ones((500, 2)), 100.0)], Signals())[0] == 40


@pytest.fixture(scope="module")
def records() -> list[runtime.Record]:
    rng = np.random.default_rng(1)
    return [
        runtime.Record(T, motion(step, phase), rng.standard_normal((len(T), 2)), name=name)
        for step, phase, name in ((1e-3, 0.0, "coarse"), (1e-6, 1.0, "fine"))
    ]


def cutoffs(settings) -> list[float]:
    """The cut-offs that results list: one, or those of the records."""
    each = settings.get("records", [settings])
    return [own["signals"]["lowpass"]["cutoff"] for own in each]


def test_each_record_has_its_own_cutoff(records):
    study, why = resolved(Study(), records)
    alone = [resolved(Study(), [record])[0].signals.lowpass.cutoff for record in records]
    assert alone[0] < study.signals.lowpass.cutoff < alone[1]
    assert why == (
        f"Low-pass by record (cutoff: auto): at {alone[0]:g} Hz for coarse (least bias by motion "
        f"and noise, joint 1 decides); at {alone[1]:g} Hz for fine (least bias by motion and "
        "noise, joint 2 decides)."
    )
    assert resolved(study, records) == (study, "")


def same_rows(left, right) -> bool:
    """Whether two observations have the same rows, bit for bit."""
    return all(np.array_equal(getattr(left, x), getattr(right, x)) for x in ("W", "Y", "t"))


def test_records_of_unlike_rate_and_noise_have_the_rows_that_each_has_alone(records):
    """One cut-off for both was too high for the noise of one and too low for the motion of the other."""
    model = symgen.model("planar_2r")
    slow = records[0]
    slow = runtime.Record(slow.t[::8], slow.q[::8], slow.tau[::8], name="slow")
    both = runtime.observe(model, [slow, records[1]])
    for k, record in enumerate((slow, records[1])):
        assert same_rows(both.of_record(k), runtime.observe(model, record))
    stated = Study(signals={"lowpass": {"cutoff": 15}})
    filtered = runtime.problem(model, [slow, records[1]]).records
    assert {record.origin.cutoff for record in filtered} != {None}
    assert same_rows(
        runtime.observe(model, filtered, stated), runtime.observe(model, [slow, records[1]], stated)
    )


def test_a_predicted_record_has_at_most_the_cutoff_that_suits_it(records):
    """A validation record of 40 Hz was refused beside a fit at 22 Hz, since 22 Hz is above half its rate."""
    model, fine = symgen.model("planar_2r"), records[1]
    few = runtime.Record(fine.t[::25], fine.q[::25], fine.tau[::25], name="few")
    shown = runtime.problem(model, fine, unseen=[few, fine])
    alone = resolved(Study(), [few])[0].signals.lowpass.cutoff
    assert shown.settings.signals.lowpass.cutoff > 20 > 16 >= alone
    assert [record.origin.cutoff for record in shown.unseen] == [alone, None]
    result = runtime.identify(model, fine, further=[few])
    assert cutoffs(result.unseen_rows["few"].settings) == [alone]


def test_pieces_between_gaps_are_one_record_and_a_record_at_rest_takes_the_cutoff_of_the_others(
    records,
):
    coarse, fine = records
    parts = [slice(0, 900), slice(900, None)]
    pieces = [
        runtime.Record(
            coarse.t[s], coarse.q[s], coarse.tau[s], name=f"{k}", origin=Origin(whole="coarse")
        )
        for k, s in enumerate(parts)
    ]
    _, why = resolved(Study(), [*pieces, fine])
    assert "for 0, 1 (" in why and why.count(" Hz for ") == 2
    still = runtime.Record(fine.t, 0 * fine.q, fine.tau, name="still")
    study, why = resolved(Study(), [fine, still])
    assert why.startswith(f"Low-pass at {study.signals.lowpass.cutoff:g} Hz (cutoff: auto)")


def test_results_say_what_auto_became(records):
    model = symgen.model("planar_2r")
    for given in (records, records[:1]):
        result = runtime.identify(model, given)
        hertz = [own.study.signals.lowpass.cutoff for own in result.prepared]
        assert len(set(hertz)) == len(given) and cutoffs(result.estimate.settings) == hertz
        assert result.estimate.provenance["signals"] in result.remarks
        assert cutoffs(runtime.observe(model, given).settings) == hertz
        study = runtime.Study(cestac={"delta": [1e-4], "runs": 2})
        assert cutoffs(runtime.cestac(model, given, study).reference.settings) == hertz


def pulses(q: np.ndarray, step: float, size: float) -> np.ndarray:
    """What a controller adds that answers every count by a pulse of 6 ms against it."""
    steps = np.diff(np.round(q / step), axis=0, prepend=np.round(q[:1] / step))
    shape = np.exp(-np.arange(40) / 6)
    return -size * np.apply_along_axis(lambda x: np.convolve(x, shape)[: len(x)], 0, steps)


def test_pulses_of_a_controller_that_a_median_of_torques_removes_are_told():
    q = motion()
    rng, smooth = np.random.default_rng(3), 10 * q + np.sign(np.gradient(q, axis=0))
    torque = smooth + 0.1 * rng.standard_normal(q.shape)
    spoilt = torque.copy()
    spoilt[::301] += 40 * rng.standard_normal(spoilt[::301].shape)
    for usual in (torque, spoilt, np.zeros_like(q), torque[:500]):
        assert not share_taken(usual, q[: len(usual)], RATE, 5).any()
    driven = torque + pulses(q, 0.1, 6.0)
    d = median_filtered(driven, 5) - driven
    share = share_taken(driven, q, RATE, 5)
    assert share[1] > 0.02 and not share_taken(driven, q, RATE, 1).any()
    blocks = d.reshape(100, 100, 2).mean(axis=1), driven.reshape(100, 100, 2).mean(axis=1)
    whole = [np.linalg.norm(x, axis=0) for x in blocks]
    assert share[1] == pytest.approx((whole[0] / whole[1])[1], rel=0.1)
    record = runtime.Record(T, np.round(q / 0.1) * 0.1, driven)
    for window, told in ((1, False), (5, True)):
        study = Study(signals=Signals(torque_median=window))
        problem = pulses_in_torques(problem_of(study, [record]))
        said = " ".join(note.text for note in problem.notes)
        assert problem.settings == study and ("% of the torque of joint 2" in said) == told
    other = runtime.Record(T, q, torque, name="quiet")
    two = pulses_in_torques(problem_of(study, [other, replace(record, name="loop")]))
    assert "of the torque of joint 2 of loop together" in two.notes[0].text
    assert "quiet" not in two.notes[0].text
    plain = problem_of(Study(signals=Signals(torque_median=5)), [runtime.Record(T, q, torque)])
    assert not pulses_in_torques(plain).notes


def bench(vs, step, speed, rate=500.0):
    """One axis that starts, stops and reverses: torque 0.02 qdd + 0.57 tanh(qd/vs) + 0.522 qd + 0.012."""
    t = np.arange(0, 30, 1 / rate)
    w, phase = 2 * np.pi * speed * np.array([0.3, 0.83, 1.9]), np.array([0.0, 1.0, 2.0])
    a, angle = np.array([1.0, 0.5, 0.2]) / speed, w * t[:, None] + phase
    q, qd, qdd = np.sin(angle) @ a, np.cos(angle) @ (a * w), -np.sin(angle) @ (a * w**2)
    tau = 0.02 * qdd + 0.57 * np.tanh(qd / vs) + 0.522 * qd + 0.012
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(t))
    return runtime.Record(t, np.round(q / step)[:, None] * step, (tau + noise)[:, None])


@pytest.mark.parametrize(
    ("vs", "step", "speed"),
    [(0.125, 2 * np.pi / 16384, 1.0), (0.02, 2 * np.pi / 65536, 1.0), (0.05, 1e-5, 0.5)],
    ids=["soft", "steep", "slow"],
)
def test_steps_of_friction_keep_their_parameters(tmp_path, vs, step, speed):
    """A low cut-off bends friction where a joint reverses: intervals of friction hold the true values."""
    file = tmp_path / "bench.yaml"
    file.write_text(
        "symgen: 1\nname: bench\ngravity: [0, 0, -g]\nconstants: {g: 9.81}\n"
        "frames:\n  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}\n"
        "elements:\n  Ia: {kind: inertia, along: all}\n  FV: {kind: viscous, along: all}\n"
        "  OFFSET: {kind: offset, along: all}\ncolumns:\n"
        "  FC: {kind: tanh, along: all, fit: {vs: {bounds: [0.0005, 1]}}}\n"
    )
    result = runtime.identify(symgen.model(file), bench(vs, step, speed))
    fit = result.estimate
    true = {"ZZ1R": 0.02, "FV1": 0.522, "OFFSET1": 0.012, "FC1": 0.57}
    off = np.abs([fit[name] - x for name, x in true.items()])
    assert fit.names == tuple(true)
    assert (off[1:] < 2.6 * fit.sigma_corrected[1:]).all()
    assert off[0] < 0.002 * true["ZZ1R"]  # steps shrink an inertia, beyond its deviation
