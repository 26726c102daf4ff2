"""CESTAC of the reader of counts, on a simulated record of the planar arm."""

from dataclasses import replace

import numpy as np
import pytest
from planar_data import motion
from problems import observed_states

import symgen
from runtime.compose import cestac
from runtime.core.cestac.rounding import rounded, stream
from runtime.core.record import Record
from runtime.core.rows.prepared import decimated_torque, observation_of
from runtime.core.rows.regressor import Columns
from runtime.core.rows.selection import select_rows
from runtime.core.signals.filters import filtered_states
from runtime.core.study import Lowpass
from runtime.counts.own_encoder import own_encoder
from runtime.counts.reading import read_counts
from runtime.ground.errors import InputError, SettingsError
from runtime.study import CestacSettings, Rows, Signals, Study

SIGNALS = Signals(median=1, lowpass=Lowpass(cutoff=20), reader="counts")
TIME = np.arange(6000) / 1000.0
planar = symgen.model("planar_2r")
STATES = motion(TIME)
RECORD = Record(
    TIME,
    STATES[0],
    planar.inverse_dynamics(*STATES, planar.base_parameters(planar.VALUES)),
    rate=1000.0,
    name="planar.csv",
)
STEP = 5e-3
NAMES = ("ZZ1R", "ZZ2", "FV1")


def study(**settings):
    asked = {"delta": (STEP,), "runs": 2, "columns": NAMES, "rounding": "phase", **settings}
    return Study(signals=SIGNALS, rows=Rows(trim=20), cestac=CestacSettings(**asked))


def test_a_run_reads_the_counts_of_its_draw():
    """The same run written out with NumPy's least squares; the reader knows the step, not the
    phase.
    """
    found = cestac(planar, RECORD, study())
    q = rounded(RECORD.q, STEP, "phase", stream(1, 0, 1))
    states = observed_states(q, RECORD.rate, replace(SIGNALS, step=STEP))
    selection = select_rows(
        RECORD, filtered_states(RECORD.q, RECORD.rate, SIGNALS).qd, SIGNALS, Rows(trim=20)
    )
    seen = observation_of(
        Columns(planar, found.names), states, decimated_torque(RECORD.tau, selection), selection
    )
    X, *_ = np.linalg.lstsq(seen.W, seen.Y, rcond=None)
    assert np.allclose(found.levels[0].runs[1].X, X, rtol=1e-8)
    assert found.settings["signals"]["reader"] == "counts" and "count as exact" in found.notes[0]


def test_counts_are_worth_more_than_positions():
    """The same draws read both ways."""
    by_counts = cestac(planar, RECORD, study())
    by_positions = cestac(
        planar, RECORD, replace(study(), signals=replace(SIGNALS, reader="lowpass"))
    )
    i = NAMES.index("ZZ2")
    assert by_counts.levels[0].e[i] < by_positions.levels[0].e[i] / 2


def test_steps_near_those_of_the_record_are_put_into_draws():
    """A record of steps d: at 5 d and more its positions are quantised; below, draws within half a
    step of its counts; at d nothing can be said.
    """
    d = 1e-3
    coarse = replace(RECORD, q=rounded(RECORD.q, d, "phase", stream(9)))
    own = own_encoder(coarse, study(delta=(2 * d, 5 * d)), None)
    assert np.allclose(own.step, d)
    assert own.positions(coarse.q, 5 * d, stream(3)) is coarse.q
    first, second = (own.positions(coarse.q, 2 * d, stream(k)) for k in (3, 4))
    assert (
        0.05 * d < np.abs(first - second).max() < 1.1 * d
    )  # read_counts allows for lines off by a hundredth
    assert np.abs(first - RECORD.q).std() < d / np.sqrt(12)
    assert np.allclose(read_counts(coarse.q, RECORD.rate, d).q, coarse.q, atol=0.6 * d)
    found = cestac(planar, coarse, study(delta=(2 * d,)))
    (note,) = found.notes  # of the rounding
    assert found.levels[0].sigma.min() > 0 and note.startswith("Rounding phase")
    with pytest.raises(
        SettingsError,
        match=r"cestac.delta: step 0\.001 is not coarser than the step of encoder \d .*, 0\.001",
    ):
        cestac(planar, coarse, study(delta=(d,)))
    filtered = replace(
        coarse,
        q=coarse.q + np.random.default_rng(1).uniform(-0.45, 0.45, coarse.q.shape).round(1) * d,
    )
    with pytest.raises(
        InputError, match=r"away from the values that an encoder of step 0\.001 reports"
    ):
        cestac(planar, filtered, replace(study(delta=(1.5 * d,)), signals=replace(SIGNALS, step=d)))


def test_other_laws_destroy_the_edges():
    with pytest.raises(SettingsError, match="destroys the changes"):
        cestac(planar, RECORD, study(rounding="two-point"))
