"""Resolution study on a simulated record of the planar arm."""

import json
import pickle
from dataclasses import replace

import numpy as np
import planar_2r_model as planar
import pytest
from campaign import campaign
from planar_data import TRUE, motion, record
from scipy.stats import t

from runtime.compose import cestac, estimate_of, observe
from runtime.core.cestac.cestac import key_blocks, levels_of
from runtime.core.cestac.perturbed import perturbed_position, perturbed_torque
from runtime.core.cestac.result import Cestac, deciding_names, level_result, runs_needed
from runtime.core.cestac.runs import Level, Run, Runs
from runtime.core.drives import Drives
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import decimated_torque, observation_of
from runtime.core.rows.regressor import Columns
from runtime.core.rows.selection import select_rows
from runtime.core.signals.filters import filtered_states
from runtime.core.study import EstimateSettings, Lowpass
from runtime.ground.errors import InputError, SettingsError
from runtime.parallel.processes import processes
from runtime.study import CestacSettings, Rows, Signals, Study

SIGNALS = Signals(median=1, lowpass=Lowpass(cutoff=20))
RECORD = record()


def study(**settings):
    return Study(
        signals=SIGNALS,
        cestac=CestacSettings(**{"delta": (1e-3, 2e-3), "runs": 3, "columns": "all", **settings}),
    )


@pytest.fixture(scope="module")
def small():
    return cestac(planar, RECORD, study())


def test_enough_is_the_coarsest_step_without_a_worse_finer_one(small):
    def of(**verdicts):
        steps = {"fine": Level(1e-6), "middle": Level(1e-4), "coarse": Level(1e-2)}
        steps["torque"] = Level(0.0, 0.1)
        levels = [replace(small.levels[0], level=steps[k], verdict=v) for k, v in verdicts.items()]
        return replace(small, levels=tuple(levels)).enough

    assert of(coarse="biased", middle="unbiased", fine="unbiased") == Level(1e-4)
    assert of(coarse="unbiased", middle="doubtful", fine="unbiased") == Level(1e-6)
    assert of(coarse="unbiased", fine="biased") is None
    assert of(torque="unbiased") is None


def test_one_run_is_equations_15_to_17(small):
    """The same run written out: perturb, filter, regressor on all columns, decimate, lstsq."""
    bits = np.random.Generator(np.random.Philox(np.random.SeedSequence(1, spawn_key=(1, 2))))
    noise = (
        2.0 * np.unpackbits(np.frombuffer(bits.bytes(1500), dtype=np.uint8)).reshape(6000, 2) - 1
    )
    states = filtered_states(RECORD.q + 2e-3 * noise, 1000.0, SIGNALS)
    clean = filtered_states(RECORD.q, 1000.0, SIGNALS)
    selection = select_rows(RECORD, clean.qd, SIGNALS, Study().rows)
    seen = observation_of(
        Columns(planar), states, decimated_torque(RECORD.tau, selection), selection
    )
    X, *_ = np.linalg.lstsq(seen.W, seen.Y, rcond=None)
    run = small.levels[1].runs[2]
    assert (run.level, run.run) == (1, 2)
    assert np.allclose(run.X, X, rtol=1e-9)
    assert np.isclose(run.residual_norm, np.linalg.norm(seen.Y - seen.W @ X), rtol=1e-9)


def test_statistics_are_equations_18_to_22(small):
    result, X_ls = small.levels[0], small.reference.X
    X = np.array([run.X for run in result.runs])
    mean = sum(X) / 3
    sigma = np.sqrt(sum((X - mean) ** 2) / 2)
    clean = filtered_states(RECORD.q, 1000.0, SIGNALS)
    selection = select_rows(RECORD, clean.qd, SIGNALS, Study().rows)
    seen = observation_of(
        Columns(planar), clean, decimated_torque(RECORD.tau, selection), selection
    )
    rho_ls, rho = (np.linalg.norm(seen.Y - seen.W @ x) for x in (X_ls, mean))
    own = np.mean([run.residual_norm for run in result.runs])
    assert np.allclose(X_ls, estimate_of(seen).X, rtol=1e-9)
    assert np.allclose(result.mean, mean) and np.allclose(result.sigma, sigma)
    assert np.allclose(result.relative_sigma, 100 * sigma / np.abs(mean))
    assert np.allclose(result.e, 100 * np.abs(1 - mean / X_ls))
    assert np.isclose(result.e_rho, 100 * abs(1 - rho / rho_ls))
    assert np.isclose(result.e_rho_own, 100 * abs(1 - own / rho_ls))
    assert np.isclose(result.increase, 100 * (rho - rho_ls) / np.linalg.norm(seen.Y))
    assert np.isclose(result.increase_own, 100 * (own - rho_ls) / np.linalg.norm(seen.Y))
    assert np.allclose(
        result.half_width, 4.302652729911275 * sigma / np.sqrt(3)
    )  # Student, 2 degrees of freedom, 97.5 %


@campaign
def test_processes_give_the_same_bits(small):
    """Of this one, too: BLAS has one thread in all of them (conftest.py)."""
    calls = []
    with processes(2) as several:
        two = cestac(
            planar,
            RECORD,
            study(),
            map=several,
            progress=lambda done, total: calls.append((done, total)),
        )
    assert two.to_json() == small.to_json()
    assert calls == [(done, 6) for done in range(1, 7)]


def test_common_random_numbers_are_filtered_once_for_all_steps():
    """filter(q + Delta xi) = filter(q) + Delta filter(xi): the same run written out, on the side of
    the motors.
    """
    common = study(common=True, side="motor", delta=(2e-2, 1e-2))
    found = cestac(planar, RECORD, common)
    drives = Drives.from_mapping(planar.DRIVES)
    clean = filtered_states(RECORD.q, 1000.0, SIGNALS)
    selection = select_rows(RECORD, clean.qd, SIGNALS, Study().rows)
    for level in found.levels:
        q = perturbed_position(RECORD.q, level.level, common.cestac, drives, (2,))
        seen = observation_of(
            Columns(planar),
            filtered_states(q, 1000.0, SIGNALS),
            decimated_torque(RECORD.tau, selection),
            selection,
        )
        X, *_ = np.linalg.lstsq(seen.W, seen.Y, rcond=None)
        assert np.allclose(level.runs[2].X, X, rtol=1e-8)


def test_least_squares_of_a_motion_that_hardly_accelerates():
    t = np.arange(6000) / 1000.0
    slow = replace(RECORD, q=motion(t / 300)[0])  # accelerations 1e-5 of before
    asked = replace(study(delta=(1e-9,)), rows=Rows(trim=3))  # the ends are all that excites it
    found = cestac(planar, slow, asked)
    assert np.allclose(found.levels[0].mean, found.reference.X, rtol=1e-3)


def test_weights_take_the_way_of_the_identification():
    weighted = replace(study(delta=(1e-3,)), estimate=EstimateSettings(method="wls"))
    found = cestac(planar, RECORD, weighted)
    q = perturbed_position(RECORD.q, Level(1e-3), weighted.cestac, None, (0, 1))
    seen = observe(planar, replace(RECORD, q=q), weighted)
    assert np.allclose(found.levels[0].runs[1].X, estimate_of(seen, weighted.estimate).X, rtol=1e-9)


def test_tasks_have_fixed_borders():
    """Whatever is missing, a run shares its task with the same others; with common numbers all
    levels of a run stay together.
    """
    keys = [(level, run) for level in range(3) for run in range(100)]
    blocks = key_blocks(keys, 100, 3, common=False)
    assert max(map(len, blocks)) == 20 and sorted(key for block in blocks for key in block) == keys
    assert {level for level, _ in blocks[0]} == {0}
    without = key_blocks([key for key in keys if key[1] % 7], 100, 3, common=False)
    assert all(any(set(part) <= set(block) for block in blocks) for part in without)
    assert [len(block) for block in key_blocks(keys, 100, 3, common=True)] == [18] * 16 + [12]
    assert key_blocks(keys, 100, 3, common=True)[0][:3] == ((0, 0), (1, 0), (2, 0))
    assert len(key_blocks(keys[:5], 5, 1, common=False)) == 5


def test_many_runs_are_not_listed_in_json(small):
    many = replace(
        small.levels[0].runs,
        **{
            f: np.repeat(getattr(small.levels[0].runs, f), 400, axis=0)
            for f in ("run", "level", "X", "residual_norm")
        },
    )
    text = replace(small, levels=(replace(small.levels[0], runs=many), small.levels[1])).to_json()
    assert (
        json.loads(text)["levels"][0]["runs"] is None
        and json.loads(text)["levels"][0]["run_count"] == 1200
    )
    assert len(text) < len(small.to_json())


def test_an_emitted_module_travels_as_text():
    """Other modules by their names."""
    sent = pickle.dumps((planar, planar, np))
    again, same, numpy = pickle.loads(sent)  # noqa: S301
    assert again.BASE_PARAMETERS == planar.BASE_PARAMETERS and again is not planar
    assert again is same and numpy is np


def test_bias_grows_as_the_square_of_the_step():
    """e(2 Delta) / e(Delta) = 4 while the bias is small; common random numbers, so that only Delta
    differs.
    """
    found = cestac(planar, record(noise=0.0), study(delta=(5e-4, 1e-3, 2e-3), runs=20, common=True))
    for name in ("ZZ1R", "ZZ2"):
        i = found.names.index(name)
        bias = np.array([found.reference.X[i] - level.mean[i] for level in found.levels])
        assert np.all(bias > 0)  # errors in variables: inertias shrink
        assert np.allclose(bias[1:] / bias[:-1], 4, rtol=0.25)


def test_gaussian_biases_as_two_point_and_uniform_a_third():
    shrunk = {}
    for mode in ("two-point", "gaussian", "uniform", "quantise"):
        found = cestac(planar, record(noise=0.0), study(delta=(1e-3,), runs=12, rounding=mode))
        shrunk[mode] = found.levels[0].e[0]
    assert np.isclose(shrunk["gaussian"] / shrunk["two-point"], 1, rtol=0.2)
    for mode in ("uniform", "quantise"):
        assert np.isclose(shrunk[mode] / shrunk["two-point"], 1 / 3, rtol=0.25)


def test_columns_are_the_essential_ones_by_default():
    simple = study(columns="essential", runs=2, delta=(1e-3,))
    found = cestac(planar, record(noise=20.0), simple)
    assert 3 < len(found.names) < 10
    given = cestac(planar, record(noise=20.0), simple, columns=found.names)
    assert given.to_json() == found.to_json()
    with pytest.raises(SettingsError, match="ZZ9"):
        cestac(planar, RECORD, study(columns=("ZZ9",)))


@pytest.mark.parametrize("names", [("ZZ1R",), ("FV1", "FS2"), ("ZZ2", "MX2R")])
def test_named_columns_are_judged_in_the_essential_fit(names):
    names = tuple(name for name in names if name in planar.BASE_PARAMETERS)
    simple = study(columns="essential", runs=2, delta=(1e-3, 2e-2))
    whole = cestac(planar, RECORD, simple)
    found = cestac(planar, RECORD, replace(simple, cestac=replace(simple.cestac, columns=names)))
    assert found.names[: len(names)] == names and {*found.names} == {*whole.names, *names}
    assert {*found.deciding} <= {*names}
    for name in names:
        if name in whole.names:
            places = [result.names.index(name) for result in (found, whole)]
            X, X_whole = (r.reference.X[k] for r, k in zip((found, whole), places, strict=True))
            assert pytest.approx(X_whole, rel=1e-9) == X
    for level in found.levels:
        assert {*level.decided_by} <= {*names}


def test_several_records_are_stacked():
    other = record(N=4000, seed=5)
    found = cestac(planar, [RECORD, other], study(delta=(1e-3,)))
    assert (
        found.reference.rows > cestac(planar, RECORD, study(delta=(1e-3,), runs=2)).reference.rows
    )
    assert found.settings["rate"] == [1000.0, 1000.0]
    again = cestac(planar, [RECORD, other], study(delta=(1e-3,)))
    assert again.to_json() == found.to_json()
    alike = cestac(
        planar, [RECORD, RECORD], study(delta=(1e-3,))
    )  # the two draw different numbers: less scatter than one record
    assert np.median(alike.levels[0].sigma) < np.median(
        cestac(planar, RECORD, study(delta=(1e-3,), runs=3)).levels[0].sigma
    )


def test_torque_steps_alone_change_little_and_go_through_the_drives():
    found = cestac(planar, RECORD, study(delta=(1e-3,), torque=(1e-3, 0.01)))
    assert [result.level for result in found.levels] == [
        Level(1e-3),
        Level(0, 1e-3),
        Level(0, 0.01),
        Level(1e-3, 1e-3),
        Level(1e-3, 0.01),
    ]
    assert [result.level.label for result in found.levels][1:4:2] == [
        "Phi 0.001",
        "0.001 + Phi 0.001",
    ]
    alone, together = found.levels[1], found.levels[3]
    assert np.nanmax(alone.e) < 1 < np.max(together.e)
    assert alone.e_rho < 1
    assert found.settings["torque_side"] == "motor"
    drives = Drives.from_mapping(planar.DRIVES)
    noise = (
        perturbed_torque(RECORD.tau, Level(0, 0.01), study().cestac, drives, (1, 0, 1)) - RECORD.tau
    )
    assert np.allclose(np.unique(np.round(noise @ np.linalg.inv(drives.ratio), 9)), [-0.01, 0.01])


def test_torque_study_needs_no_position_step():
    settings = CestacSettings(delta=(), torque=(0.01,), runs=20)
    assert levels_of(settings) == (Level(0.0, 0.01),)
    found = cestac(planar, RECORD, replace(study(), cestac=replace(settings, columns="all")))
    assert found.verdict in ("unbiased", "doubtful")


def test_motor_side_divides_the_step_by_the_ratio():
    drives = Drives.from_mapping(planar.DRIVES)
    settings = study(side="motor").cestac
    noise = perturbed_position(RECORD.q, Level(1e-3), settings, drives, (0, 0)) - RECORD.q
    assert np.allclose(np.unique(np.round(noise @ drives.ratio.T, 9)), [-1e-3, 1e-3])
    joint = cestac(planar, RECORD, study(delta=(1e-3,)))
    motor = cestac(planar, RECORD, study(delta=(1e-3,), side="motor"))
    assert motor.levels[0].e[0] < 0.05 < joint.levels[0].e[0]
    blind = type(planar)("blind")
    blind.__dict__.update(
        {name: value for name, value in vars(planar).items() if not name.startswith("__")},
        DRIVES=None,
    )
    with pytest.raises(SettingsError, match="no drives"):
        cestac(blind, RECORD, study(side="motor"))
    with pytest.raises(InputError, match="use one process"), processes(2) as several:
        cestac(blind, RECORD, study(), map=several)


@pytest.mark.parametrize(
    ("e", "verdict", "chapter", "names"),
    [
        ((0.3, 0.2, 2.0), "unbiased", "doubtful", {"c"}),
        ((3.0, 0.2, 2.0), "doubtful", "doubtful", {"a"}),
        ((7.0, 6.0, 2.0), "biased", "biased", {"a", "b"}),
        ((0.3, 0.2, 4.0), "doubtful", "doubtful", {"c"}),
        ((0.3, 0.2, 11.0), "doubtful", "biased", {"c"}),
        ((0.3, 0.2, 13.0), "biased", "biased", {"c"}),
    ],
)
def test_a_change_is_compared_with_the_interval(e, verdict, chapter, names):
    """c has an interval of +-25 %, by slow residuals: 2.5 % are negligible, 12.5 % biased; those of
    a and b are below 10 %, and 1 % and 5 % remain. The chapter's limits stand beside.
    """
    reference = estimate_like(relative_sigma=(1.0, 2.0, 4.0), corrected=(1.0, 2.0, 25 / 1.96))
    X = reference.X * (1 - np.array(e) / 100)
    runs = Runs.of([Run(0, k, tuple(X), 1.0) for k in range(3)], 3)
    result = level_result(Level(1e-3), runs, Measured, reference)
    assert (result.verdict, result.chapter_verdict) == (verdict, chapter)
    assert set(result.decided_by) == names
    assert all(result.decided_by[name] == pytest.approx(e["abc".index(name)]) for name in names)
    study = Cestac(reference.names, reference, (result,))
    last = {
        "unbiased": "less than a tenth of its 95 % interval of +-25 %: the record, not the encoder",
        "doubtful": "less than half of its 95 % interval of +-25 %.",
        "biased": "more than half of its 95 % interval of +-25 %.",
    }
    if "c" in names or verdict != chapter:
        (sentence,) = study.reasons
        assert f"c changes by {e[2]:.1f} %" in sentence and last[verdict] in sentence
    else:
        assert not study.reasons
    assert verdict in study.message and "+- 95 %, %" in study.brief()
    rows = {row[0]: row[1] for row in study.residual_table().rows}
    assert rows["verdict of the chapter, (21): 1 % and 5 %"] == chapter


def test_an_uncertain_parameter_is_judged_by_its_interval():
    """A %sigma of 30 % was without effect on the verdict, whatever the encoder did to it."""
    reference = estimate_like(relative_sigma=(1.0, 2.0, 30.0))
    assert deciding_names(reference) == ("a", "b", "c")
    for change, verdict in ((5.0, "unbiased"), (20.0, "doubtful"), (60.0, "biased")):
        X = reference.X * (1 - np.array([0.1, 0.1, change]) / 100)
        runs = Runs.of([Run(0, k, tuple(X), 1.0) for k in range(3)], 3)
        result = level_result(Level(1e-3), runs, Measured, reference)
        assert (result.verdict, result.chapter_verdict) == (verdict, "unbiased")  # not a main one
    nothing = estimate_like(relative_sigma=(70.0, 80.0, 90.0))
    study = Cestac(nothing.names, nothing, (level_result(Level(1e-3), runs, Measured, nothing),))
    assert "contain zero" in study.reasons[0]


def test_runs_without_an_estimate_are_left_out_and_counted():
    reference = estimate_like(relative_sigma=(1.0, 2.0, 30.0))
    runs = [
        Run(0, k, tuple(reference.X * (1 + share)), 1.0)
        for k, share in enumerate((0.0, 0.02, np.nan))
    ]
    result = level_result(Level(1e-3), Runs.of(runs, 3), Measured, reference)
    assert np.allclose(result.e, 1.0) and "1 of 3 runs found no estimate" in result.message
    with pytest.raises(InputError, match=r"finds an estimate in only 1 of 2 runs at 0\.001"):
        level_result(Level(1e-3), Runs.of(runs[1:], 3), Measured, reference)


class Measured:
    """No rows matter here: the residual does not move with X."""

    W = np.zeros((4, 3))
    Y = np.ones(4)


def estimate_like(relative_sigma, corrected=None):
    """An Estimate of parameters a, b, c with the given %sigma, and that of slow residuals."""
    instants = np.arange(4.0)
    full = estimate_of(
        Observation(
            np.eye(4, 3), np.ones(4), (4,), ("a", "b", "c"), instants, np.zeros(4, dtype=int), 1.0
        )
    )
    X = np.array([1.0, 2.0, 3.0])
    sigma, slow = (np.array(x) * X / 100 for x in (relative_sigma, corrected or relative_sigma))
    return replace(full, X=X, sigma=sigma, sigma_corrected=slow, residual_norm=2.0)


def test_runs_needed():
    assert runs_needed(0.0) == 2
    for spread in (0.5, 3.0, 20.0):
        N = runs_needed(spread)
        assert (
            t.ppf(0.975, N - 1) * spread / np.sqrt(N)
            < 1
            <= t.ppf(0.975, N - 2) * spread / np.sqrt(N - 1)
        )


def test_text_and_json(small):
    data = json.loads(small.to_json(), parse_constant=lambda name: pytest.fail(name))
    assert data["settings"]["rate"] == [1000.0] and data["settings"]["cestac"]["seed"] == 1
    assert (
        data["settings"]["signals"]["lowpass"]["cutoff"] == 20 and data["settings"]["factor"] == 20
    )
    assert data["provenance"]["seed"] == 1 and data["provenance"]["files"] == {
        "planar.csv": "cd" * 32
    }
    assert len(data["levels"]) == 2 and data["levels"][0]["level"] == {
        "delta": 0.001,
        "torque": 0.0,
    }
    text = str(small)
    assert "%e(rho) (22), measured W, as printed" in text and "verdict" in text
    assert len(small.error_table().to_text().splitlines()) == 11
    assert Level(2 * np.pi / 5000).label == "2*pi/5000" and Level(0.0).label == "none"
    assert Level(1e-6).label == "1e-06"  # a linear encoder, m: no counts per turn


def test_reference_is_the_estimate_of_the_measured_record(small):
    assert small.reference.provenance["robot"] == "planar_2r_test"
    assert np.all(np.abs(small.reference.X - TRUE) < 6 * small.reference.sigma_corrected)
