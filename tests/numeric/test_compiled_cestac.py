"""Resolution studies in C: the plain pipeline of scipy on the TX40 record, NumPy's runs on random
robots, the same bits on workers, refusals.
"""

from __future__ import annotations

import pickle
import shutil
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign
from scipy.signal import decimate

from oracles.random_robots import random_robot
from runtime import load_model
from runtime.advisor.coarse_encoders import CoarseEncoders
from runtime.compiled.cache import FallbackWarning
from runtime.compiled.model import CompiledModel, compiled_model
from runtime.compose import cestac, problem
from runtime.core.cestac.perturbed import perturbed_position, system_of
from runtime.core.drives import Drives
from runtime.core.errors import InputError
from runtime.core.least_squares.method import linear_system
from runtime.core.record import Origin, Record
from runtime.core.rows.prepared import decimated_torque
from runtime.core.rows.regressor import Columns
from runtime.core.rows.selection import select_rows
from runtime.core.signals.filters import filtered_states
from runtime.core.study import (
    CestacSettings,
    Decimate,
    EstimateSettings,
    Lowpass,
    Rows,
    Signals,
    Study,
    study_from_mapping,
)
from runtime.parallel.processes import processes
from runtime.reading.datasets import dataset_study
from runtime.reading.records import read_records
from symgen.description import load_robot
from symgen.description.robot import Robot
from symgen.emit.generate import generate_files

pytestmark = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler"
)


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SYMGEN_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def in_c(robot: Robot, folder: Path) -> CompiledModel:
    """The robot in C, its module in `folder`."""
    for name, text in generate_files(robot, targets=("numpy", "c"), command=robot.name).items():
        (folder / name).write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = compiled_model(load_model(robot.name, folder=folder, trust=True))
    assert isinstance(model, CompiledModel)
    return model


@pytest.fixture(scope="module")
def planar(tmp_path_factory) -> CompiledModel:
    return in_c(load_robot("planar_2r"), tmp_path_factory.mktemp("planar"))


def record_of(model: CompiledModel, N: int, seed: int, rate: float = 1000.0) -> Record:
    """A simulated record: sums of sinusoids, torques of random parameters and noise."""
    rng, n, t = np.random.default_rng(seed), len(model.JOINTS), np.arange(N) / rate
    a, w, p = (
        rng.uniform(0.3, 1.0, (4, n)),
        rng.uniform(1.0, 9.0, (4, n)),
        rng.uniform(0, 6, (4, n)),
    )
    angle = t[:, None, None] * w + p
    q, qd, qdd = (
        (a * np.sin(angle)).sum(1),
        (a * w * np.cos(angle)).sum(1),
        -(a * w**2 * np.sin(angle)).sum(1),
    )
    tau = model.module.regressor(q, qd, qdd) @ rng.uniform(
        0.2, 2.0, len(model.BASE_PARAMETERS)
    ) + 0.05 * rng.standard_normal((N, n))
    return Record(
        t, q, tau, rate=rate, name="simulated", origin=Origin({"simulated.csv": "ab" * 32})
    )


def study(signals: Signals | None = None, rows: Rows | None = None, **settings: object) -> Study:
    chosen = CestacSettings(**{"delta": (1e-4, 2e-4), "runs": 2, "columns": "all", **settings})
    return Study(
        signals=signals or Signals(median=1, lowpass=Lowpass(cutoff=20)),
        rows=rows or Rows(),
        cestac=chosen,
    )


@campaign  # by default: NumPy on this record (test_cestac_tx40), C on random robots below
def test_one_run_on_the_tx40_record_is_the_plain_pipeline(tx40_data, tmp_path):
    """Low-pass, dense regressor, scipy's decimate column by column, lstsq: X to 1e-10 of the
    largest and each to 1e-9, residuals by joint.
    """
    model = in_c(load_robot("tx40"), tmp_path)
    settings = study_from_mapping(dataset_study("tx40"))
    settings = replace(
        settings, cestac=replace(settings.cestac, columns="all", runs=2, delta=(2 * np.pi / 5000,))
    )
    record = read_records(settings.record, model)[0]
    found = cestac(model, record, settings)
    signals = replace(settings.signals, median=1)
    selection = select_rows(
        record, filtered_states(record.q, record.rate, signals).qd, signals, settings.rows
    )
    Y = decimated_torque(record.tau, selection)
    q = perturbed_position(
        record.q, found.levels[0].level, settings.cestac, Drives.from_mapping(model.DRIVES), (0, 1)
    )
    states = filtered_states(q, record.rate, signals)[selection.samples]
    D = model.module.regressor(states.q, states.qd, states.qdd)
    W_j = [
        np.column_stack(
            [decimate(column, selection.factor, zero_phase=True) for column in D[:, j].T]
        )[selection.mask[j]]
        for j in range(6)
    ]
    W = np.vstack(W_j)
    X = np.linalg.lstsq(W, Y[selection.mask], rcond=None)[0]
    run = found.levels[0].runs[1]
    np.testing.assert_allclose(run.X, X, rtol=1e-9, atol=1e-12 * np.abs(X).max())
    np.testing.assert_allclose(
        run.residual_norm, np.linalg.norm(Y[selection.mask] - W @ X), rtol=1e-12
    )
    assert found.settings["target"] == "c" and found.provenance["processor"]


@campaign
@pytest.mark.parametrize(
    ("seed", "changed"),
    [
        (2, study()),
        (
            3,
            study(
                Signals(
                    median=1,
                    lowpass=Lowpass(cutoff=30, order=3),
                    decimate=Decimate(factor=7, phase="last", padding="matlab"),
                ),
                rounding="phase",
                uneven=0.1,
            ),
        ),
        (5, study(Signals(median=3, decimate=Decimate(factor=60)), rounding="quantise")),
        (
            6,
            study(
                Signals(median=1, decimate=None),
                Rows(window=(0.1, 0.9), low_speed=0.3),
                torque=(0.01,),
                common=True,
            ),
        ),
        (
            7,
            study(
                Signals(median=1, lowpass=None, ends="second-order", decimate=Decimate(factor=4)),
                Rows(trim=0),
                rounding="gaussian",
            ),
        ),
    ],
)
def test_runs_on_random_robots_are_those_of_numpy(seed, changed, tmp_path):
    """Two records; filters, factors, rows and roundings of all kinds."""
    model = in_c(random_robot(seed), tmp_path)
    records = [record_of(model, N, seed + N) for N in (1600, 1203)]
    found, right = cestac(model, records, changed), cestac(model.module, records, changed)
    assert len(found.levels) == len(right.levels)
    for level, expected in zip(found.levels, right.levels, strict=True):
        X, reference = level.runs.X, expected.runs.X
        assert np.abs(X - reference).max() <= 1e-10 * np.abs(reference).max()
        np.testing.assert_allclose(
            level.runs.residual_norm, expected.runs.residual_norm, rtol=1e-10
        )


@pytest.mark.parametrize("method", ["ols", "wls"])
def test_positions_moved_by_an_encoder(planar, method):
    """One encoder coarse: the whole pipeline on moved positions, in NumPy and in C."""
    settings = replace(study(median=1), estimate=EstimateSettings(method))
    record, step = record_of(planar, 1500, 4), 1e-3
    q = record.q.copy()
    q[:, 1] = step * np.round(q[:, 1] / step)
    for model in (planar.module, planar):
        own, names = problem(model, record, settings).prepared[0], planar.BASE_PARAMETERS
        real = CoarseEncoders(model, [own], settings, names, None, {}, "phase", "lowpass")
        found = real.reference * real.ratios([real._counts(step, np.zeros(2), (1,), ())], (1,))[0]
        task = real.task
        system = system_of(Columns(planar.module, task.names), task, [q], [task.records[0].torque])
        right = linear_system(system, settings.estimate).solve().X
        np.testing.assert_allclose(found, right, rtol=1e-9)
        assert abs(found / real.reference - 1).max() > 1e-5


def test_columns_in_an_order_of_their_own_and_weights(planar):
    record, names = record_of(planar, 1500, 1), tuple(reversed(planar.BASE_PARAMETERS[2:]))
    some = study(columns=names)
    assert cestac(planar, record, some).names == names
    for settings in (EstimateSettings(), EstimateSettings(method="wls")):
        found, right = (
            cestac(model, record, replace(some, estimate=settings))
            for model in (planar, planar.module)
        )
        np.testing.assert_allclose(
            found.levels[1].runs.X, right.levels[1].runs.X, rtol=1e-9, atol=1e-12
        )


@campaign
def test_workers_give_the_same_bits(planar):
    record = record_of(planar, 1500, 2)
    here = cestac(planar, record, study(runs=5))
    with processes(2) as several:
        there = cestac(planar, record, study(runs=5), map=several)
    for level, other in zip(here.levels, there.levels, strict=True):
        assert np.array_equal(level.runs.X, other.runs.X) and np.array_equal(
            level.runs.residual_norm, other.runs.residual_norm
        )


def test_a_model_travels_as_text(planar, monkeypatch):
    sent = pickle.dumps(planar)
    again = pickle.loads(sent)  # noqa: S301
    assert isinstance(again, CompiledModel) and again.NAME == planar.NAME
    monkeypatch.setenv("CC", "absent-cc")
    with (
        pytest.warns(FallbackWarning, match="no C compiler absent-cc"),
        pytest.raises(InputError, match="no compiled planar_2r"),
    ):
        pickle.loads(sent)  # noqa: S301


def test_steps_that_overflow_are_an_error(planar):
    with pytest.raises(InputError, match="use smaller steps"):
        cestac(planar, record_of(planar, 1500, 4), study(delta=(1e308,)))
