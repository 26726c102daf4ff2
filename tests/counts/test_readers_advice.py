"""Advice on real encoders, read as positions and as counts, on a simulated record of the planar
arm.
"""

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from campaign import campaign
from test_cestac_counts import RECORD, SIGNALS, STEP, planar

from runtime.advisor.advice import crossing
from runtime.advisor.coarse_encoders import CoarseEncoders, mean_change
from runtime.advisor.readers import curves
from runtime.compose import advise, cestac, problem
from runtime.core.signals.filters import filtered_states
from runtime.core.signals.reader import LOWPASS
from runtime.counts.reader import COUNTS
from runtime.ground.limits import limits
from runtime.ground.progress import Work
from runtime.reporting.sections import part_section
from runtime.study import CestacSettings, Rows, Study

LIMIT = limits("runtime.advisor")

NAMES = ("ZZ1R", "ZZ2", "FV1")
STUDY = Study(
    signals=replace(SIGNALS, reader="lowpass"),
    rows=Rows(trim=20),
    cestac=CestacSettings(columns=NAMES, runs=3, rounding="phase", delta=(STEP,)),
)


def certain(*names: str) -> Any:
    """An estimate without uncertainty, of which the first parameter is judged."""
    zero, judged = np.zeros(len(names)), {"judged": names[:1]}
    return SimpleNamespace(names=names, relative_deviation=zero, provenance=judged)


PART = replace(RECORD, t=RECORD.t[:2500], q=RECORD.q[:2500], tau=RECORD.tau[:2500])


def test_quadrature_over_the_phase_is_the_mean_of_cestac():
    """Against 60 runs of CESTAC, three deviations of their mean, 20 % (10 % of Delta) and 0.3; for
    one encoder of two alike.
    """
    found = cestac(planar, RECORD, replace(STUDY, cestac=replace(STUDY.cestac, runs=60)))
    names = found.reference.names  # the essential ones and those of the study
    real = CoarseEncoders(problem(planar, RECORD, STUDY), names, None, "phase", LOWPASS)
    change = real.asked(STEP)
    level = found.levels[0]
    sampled = 100 * (level.mean / found.reference.X - 1)
    assert np.allclose(real.reference, found.reference.X, rtol=1e-9)
    assert np.all(
        np.abs(change - sampled) < 3 * level.half_width_percent / 2 + 0.2 * np.abs(sampled) + 0.3
    )
    alone = real.sampled((1,), STEP, 40)
    assert np.all(
        np.abs(mean_change(real.ratios(real.nodes(STEP, (0, 1)), (1,)))[0] - alone.change)
        < 3 * alone.half_width / 2 + 0.2 * np.abs(alone.change) + 0.3
    )


@campaign
def test_steps_by_both_readers():
    advice = advise(planar, RECORD, STUDY, encoders=("all", "2"))
    positions, counts = advice.real
    assert (positions.reader, counts.reader) == (
        "lowpass",
        "counts",
    ) and advice.encoders is positions.encoders
    assert [encoder.label for encoder in counts.encoders] == ["all", "2"]
    coarse = [reader.encoders[0].limits[1].delta for reader in advice.real]
    assert coarse[1] > 3 * coarse[0]
    for limit in positions.encoders[0].limits:
        assert (
            limit.sampled is not None
            and abs(limit.error / limit.change - 1) < 0.4 + limit.half_width / limit.change
        )
    assert (
        advice.real[0].encoders[0].limits[0].delta
        <= min(encoder.limits[0].delta for encoder in positions.encoders[1:]) * 1.05
    )


@campaign
def test_side_by_side_in_words():
    advice = advise(
        planar,
        PART,
        replace(STUDY, rows=Rows(trim=5), cestac=replace(STUDY.cestac, columns=("ZZ1R",))),
        encoders=("all", "2"),
        asked=(STEP, 10.0),
    )
    text = str(advice)
    assert (
        "real, positions" in text and "real, counts" in text and "quadrature over the phase" in text
    )
    assert "Real, counts: with all encoders alike, least squares is practically" in advice.verdict
    answer, detail, _ = part_section(advice).tables
    assert [*answer.header] == ["encoder", "real, positions", "real, counts"]
    assert {"positions, biased", "counts, unbiased"} <= {*detail.header}
    assert '"real"' in advice.to_json()
    delta = advice.encoders[0].delta
    assert np.allclose(delta[1:] / delta[:-1], LIMIT.READER_RATIO)  # nothing locks
    name, e, _ = advice.worst(0)
    assert (
        re.search(rf"read as positions: predicted \w+, {name} changes by {e:.2f} %", text)
        and "10, read as counts: not judged on this record" in text
    )


def test_no_step_is_advised_where_no_parameter_is_determined():
    noise = np.random.default_rng(0).standard_normal(PART.tau.shape)
    loud = replace(PART, tau=PART.tau + 20 * PART.tau.std() * noise)
    advice = advise(
        planar, loud, replace(STUDY, rows=Rows(trim=5)), encoders=("all",), asked=(STEP,)
    )
    assert not advice.negative
    assert advice.verdict.startswith("The 95 % intervals of all parameters asked for contain zero")
    assert "no step changes" not in advice.verdict
    assert "not judged on this record" in str(advice) and not part_section(advice).images


def test_steps_of_constant_speeds_that_lock_are_tried(monkeypatch):
    """Joint 1 to and fro at 2 rad/s: at 2 mrad a sample of 1 ms is one step, and the error of its
    counts stands still.
    """
    triangle = np.abs((RECORD.t * 2 / 3) % 2 - 1) * 3
    noise = 1e-5 * np.random.default_rng(1).standard_normal(
        len(triangle)
    )  # else its positions would lie on a lattice of 2 mrad themselves
    q = np.column_stack([triangle + noise, RECORD.q[:, 1]])
    states = filtered_states(q, RECORD.rate, STUDY.signals)
    record = replace(
        RECORD,
        q=q,
        tau=planar.inverse_dynamics(
            states.q, states.qd, states.qdd, planar.base_parameters(planar.VALUES)
        ),
    )
    real = CoarseEncoders(problem(planar, record, STUDY), NAMES, None, "phase", LOWPASS)
    locked, free, half = real.locking(np.array([2e-3, 2.3e-3, 4e-3]))
    assert locked > 5 * free and half > 2 * free
    monkeypatch.setattr(LIMIT, "READER_UP", 2)
    delta, _ = curves(real, {"1": (0,)}, 1.7e-3, certain(*NAMES), Work())["1"]
    ratio = delta[1:] / delta[:-1]
    near = (delta[1:] > 1.9e-3) & (delta[:-1] < 2.1e-3)
    assert near.sum() >= 3 and ratio[near].max() < 1.05


class Scattered:
    """A change of e = step % whose mean over few phases is one deviation too large, 1.6 % of one
    phase; encoder 2 rests.
    """

    reader, reference, finest, coarsest = COUNTS, np.ones(1), 0.1, np.array([1e3, np.inf])

    def nodes(self, delta, moving, read=0):
        assert moving == [0]
        return delta, read

    def ratios(self, nodes, encoders):
        """The first 4 nodes, or as many as were read: so that all have this mean and deviation."""
        delta, read = nodes
        count = read or 4
        total = np.sqrt(2 * read or 4)
        mean = 1.6 * (total - np.sqrt(read)) / count
        return 1 - (delta + mean + 1.6 * np.resize([[-1.0], [1.0]], (count, 1))) / 100


def test_more_phases_at_the_steps_beside_a_limit():
    delta, change = curves(Scattered(), {"all": (0, 1)}, 1.0, certain("X1"), Work())["all"]
    e, deviation = np.abs(change[:, 0, 0]), dict(zip(delta, change[:, 1, 0], strict=True))
    assert np.allclose([deviation[1.5], deviation[2.25]], 1.6 / np.sqrt(3))  # 4 nodes
    assert deviation[delta[delta < 1].max()] < 0.3  # 32 of them, which is where 1 % is
    assert (
        0.6 < crossing(delta, e, 1.0) < 1 and 4.4 < crossing(delta, e, 5.0) < 5
    )  # 0.2 and 4.2 by the few


def test_further_nodes_lie_in_the_middle_between_those_before():
    real = CoarseEncoders(problem(planar, PART, STUDY), NAMES, None, "phase", LOWPASS)
    real._counts = lambda delta, phases, moving, key: phases
    few = real.phases
    phases = np.concatenate([real.nodes(2.0, (0, 1), read) for read in (0, few, 2 * few)])
    apart = np.diff(np.sort(phases, axis=0), axis=0)
    assert len(phases) == 4 * few and np.allclose(apart, 2.0 / len(phases))


def test_a_record_that_is_coarse_itself_sets_the_finest_step():
    d = 1e-3
    coarse = replace(PART, q=d * np.round(PART.q / d))
    found = advise(
        planar, coarse, replace(STUDY, rows=Rows(trim=5)), encoders=("2",), confirm=False
    )
    steps = [delta for reader in found.real for delta in reader.encoders[0].delta]
    assert steps and min(steps) >= 5 * d * (1 - 1e-9)
