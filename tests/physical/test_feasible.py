"""Feasible least squares against point masses, pinocchio, a hand-written parametrisation of all
physical robots, and the TX40 record.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import clarabel
import numpy as np
import pytest
from problems import linear_system
from scipy.optimize import minimize

import symgen
from oracles.pinocchio_model import PinocchioModel
from runtime import InputError, observe
from runtime.compose import estimate_of, state_problem
from runtime.core.least_squares.estimate import Estimate
from runtime.core.model import load_model
from runtime.core.rows.observation import Observation
from runtime.core.study import EstimateSettings
from runtime.core.uncertainty import negative_elements
from runtime.core.validation import split_validation
from runtime.ground.errors import SettingsError
from runtime.physical.feasibility import (
    Ellipsoid,
    RobotLimits,
    feasibility,
    limit_rows,
    nearest_standard,
    pull_to_file,
    scales,
)
from runtime.physical.feasible import (
    FeasibleOptions,
    decide_options,
    residual_norm,
    solve_with_weight,
    within_limits,
)
from runtime.physical.inertia import INERTIAL, physical_model, pseudo_inertia, reach_of
from runtime.physical.semidefinite import closest, everything
from runtime.reading.datasets import dataset_study
from runtime.reading.records import read_records
from runtime.study import study_from_mapping
from symgen.description import load_robot

GENERATED = Path(__file__).resolve().parents[2] / "generated"
PLAIN = {"prior": "none", "reach": None}  # the conditions alone
FEASIBLE = EstimateSettings("feasible", options=PLAIN)


def emitted(name: str):
    return load_model(GENERATED / f"{name}.py")


@pytest.fixture(scope="module")
def arm():
    return emitted("planar_2r")


@pytest.fixture(scope="module")
def tx40():
    return emitted("tx40")


def ten_of(mass: np.ndarray, place: np.ndarray) -> np.ndarray:
    """The ten parameters of point masses (k,) at places (k, 3), by definition."""
    J = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(mass, place, strict=True))
    return np.array(
        [J[0, 0], J[0, 1], J[0, 2], J[1, 1], J[1, 2], J[2, 2], *(mass @ place), mass.sum()]
    )


def simulated(model, X: np.ndarray, noise: float, seed: int = 0, N: int = 300) -> Observation:
    """Random states of a motion without rest, torques with white noise."""
    rng = np.random.default_rng(seed)
    n = len(model.JOINTS)
    q, qd, qdd = rng.uniform(-3, 3, (3, N, n))
    W = np.asfortranarray(model.observation_matrix(q, qd, qdd))
    Y = W @ X + noise * rng.standard_normal(n * N)
    return Observation(
        W,
        Y,
        (N,) * n,
        model.BASE_PARAMETERS,
        np.tile(np.arange(N) / 100, n),
        np.zeros(n * N, dtype=int),
        100.0,
    )


def values(model) -> np.ndarray:
    return np.array([model.VALUES[name] for name in model.STANDARD_PARAMETERS])


def standard_parameters(physical, X: np.ndarray, limits: RobotLimits | None = None) -> np.ndarray:
    """Standard parameters of X, nearest to the robot file, from those of the largest margin."""
    judged = feasibility(physical, physical.base, X, limits)
    assert judged.feasible, judged.text
    return nearest_standard(physical, physical.base, X, judged.chi, limits)


def test_pseudo_inertia_is_the_second_moment_of_point_masses() -> None:
    rng = np.random.default_rng(0)
    mass, place = rng.uniform(0.1, 2, 7), rng.standard_normal((7, 3))
    homogeneous = np.column_stack([place, np.ones(7)])
    np.testing.assert_allclose(
        pseudo_inertia(ten_of(mass, place)), (homogeneous.T * mass) @ homogeneous, atol=1e-13
    )


@pytest.mark.parametrize("name", ["tx40", "puma560", "two_branch"])
def test_regrouping_matrix_gives_the_torques_of_pinocchio(name: str) -> None:
    model, oracle = emitted(name), PinocchioModel(load_robot(name))
    K = physical_model(model).K
    rng = np.random.default_rng(1)
    chi = rng.uniform(0.1, 2, K.shape[1])
    for _ in range(5):
        q, qd, qdd = rng.uniform(-2, 2, (3, len(model.JOINTS)))
        torque = oracle.torque(q, qd, qdd, chi)
        np.testing.assert_allclose(
            model.inverse_dynamics(q, qd, qdd, K @ chi), torque, atol=1e-10 * np.abs(torque).max()
        )


def test_conditions_of_a_coupled_wrist_and_of_one_sided_friction(tx40) -> None:
    wrist = next(c for c in physical_model(tx40).conditions if c.name == "inertia of joints 5, 6")
    chi = dict.fromkeys(tx40.STANDARD_PARAMETERS, 0.0) | {"Ia5": 5.0, "Ia6": 2.0}
    np.testing.assert_array_equal(
        wrist.matrix(np.array(list(chi.values()))), [[5, 2], [2, 2]]
    )  # robot file: q6**2 + 2*q5*q6 of Ia6
    named = [c.name for c in physical_model(emitted("emps_asymmetric")).conditions]
    assert named == ["link 1", "Ia1", "FVP1", "FVN1", "FSP1", "FSN1"]


def test_signs_that_no_drive_has(arm, tx40) -> None:
    """Friction below zero is named where it is so beyond its deviation; offsets, inertias of sums
    and forms have no sign of their own.
    """
    X = arm.base_parameters(
        dict.fromkeys(arm.STANDARD_PARAMETERS, 1.0) | {"FS2": -1.0, "OFFSET1": -1.0}
    )
    for noise, named in ((0.1, ("FS2",)), (1000.0, ())):
        assert (
            negative_elements(
                arm, estimate_of(simulated(arm, X, noise), EstimateSettings(), model=arm)
            )
            == named
        )
    wrist = {
        *negative_elements(
            tx40, estimate_of(simulated(tx40, -np.ones(60), 0.1), EstimateSettings(), model=tx40)
        )
    }
    assert {"Ia3", "FV1", "FSM6"} <= wrist and not {"Ia6", "FVM6", "OFFSET1", "ZZ1R"} & wrist


@pytest.mark.parametrize("name", ["planar_2r", "tx40"])
def test_feasible_is_least_squares_where_that_is_feasible(name: str) -> None:
    """By the estimator, and by the semidefinite program itself: within a hundredth of sigma."""
    model = emitted(name)
    truth = model.base_parameters(model.VALUES)
    seen = simulated(model, truth, 1e-4)
    ols, found = estimate_of(seen), estimate_of(seen, FEASIBLE, model=model)
    assert found.details["least_squares"]["feasible"]
    np.testing.assert_array_equal(found.X, ols.X)
    physical, options = physical_model(model), FeasibleOptions(prior="none", margin=1e-9)
    chi, weight = solve_with_weight(linear_system(seen, FEASIBLE).weighted, physical, options)
    assert weight == 0 and np.abs((physical.K @ chi - ols.X) / ols.sigma).max() < 1e-2


def test_noise_free_records_give_the_parameters_back(tx40) -> None:
    truth = tx40.base_parameters(tx40.VALUES)
    found = estimate_of(simulated(tx40, truth, 0.0), FEASIBLE, model=tx40)
    np.testing.assert_allclose(found.X, truth, atol=1e-9)
    standard = np.array(list(found.details["standard"].values()))
    np.testing.assert_allclose(
        standard, values(tx40), atol=1e-6
    )  # nearest to the values, and these have the torques


def test_optimum_is_that_of_a_parametrisation_of_all_physical_arms(arm) -> None:
    """P = L L', friction and actuator inertia squares: every physical arm and no other; 4 kg in
    all, so that the mass of the links is told.
    """
    X = arm.base_parameters(arm.VALUES)
    X = X + np.array(
        [0, 0, 0, 0, 0, 0, -0.1, 0, 0, -0.01, -0.35, 0, 0]
    )  # ZZ2 too small for MX2, FV2 below zero
    seen = simulated(arm, X, 0.5, N=60)
    settings = EstimateSettings("feasible", options={**PLAIN, "total_mass": 4.0, "margin": 1e-9})
    found = estimate_of(seen, settings, model=arm)
    assert found.status == "ok" and not found.details["least_squares"]["feasible"]
    lower = np.tril_indices(4)

    def chi(u: np.ndarray) -> np.ndarray:
        value = {}
        factors = np.zeros((2, 4, 4))
        factors[0][lower], factors[1][lower] = u[:10], u[10:20]
        matrices = factors @ factors.transpose(0, 2, 1)
        for j, P in enumerate(4.0 * matrices / matrices[:, 3, 3].sum(), start=1):
            J = np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3]
            ten = (J[0, 0], J[0, 1], J[0, 2], J[1, 1], J[1, 2], J[2, 2], *P[3, :3], P[3, 3])
            value |= {f"{family}{j}": x for family, x in zip(INERTIAL, ten, strict=True)}
        value |= dict(zip(("OFFSET1", "OFFSET2"), u[20:22], strict=True))
        value |= dict(zip(("Ia1", "FV1", "FS1", "Ia2", "FV2", "FS2"), u[22:] ** 2, strict=True))
        return np.array([value[name] for name in arm.STANDARD_PARAMETERS])

    start = np.concatenate([np.eye(4)[lower], np.eye(4)[lower], np.zeros(2), np.full(6, 0.5)])
    best = minimize(
        lambda u: np.sum((seen.Y - seen.W @ arm.base_parameters(chi(u))) ** 2),
        start,
        options={"maxiter": 600},
    )
    assert 1 - 1e-6 < best.fun / found.residual_norm**2 < 1 + 1e-6
    np.testing.assert_allclose(arm.base_parameters(chi(best.x)), found.X, atol=2e-3)
    assert found.residual_norm > found.details["least_squares"]["residual_norm"]


def test_infeasible_parameters_are_blamed_on_what_contradicts(arm) -> None:
    physical = physical_model(arm)
    X = arm.base_parameters(arm.VALUES)
    good = feasibility(physical, physical.base, X)
    assert (
        good.feasible
        and good.margin > 0
        and not good.blocking
        and "physically feasible" in good.text
    )
    X = X.copy()
    X[arm.BASE_PARAMETERS.index("FV2")] = -0.2
    X[arm.BASE_PARAMETERS.index("ZZ2")] = (
        0.05  # with MX2 = 0.5 kg m and at most 2 kg: ZZ2 >= MX2**2/M2 = 0.125
    )
    judged = feasibility(physical, physical.base, X, RobotLimits(bounds={"M2": (None, 2.0)}))
    assert not judged.feasible and [name for name, _ in judged.blocking] == ["FV2", "link 2"]
    assert judged.margin == pytest.approx(-0.2, abs=1e-6)
    text = feasibility(physical, physical.base, X).text
    assert re.search(r"NOT physically feasible.*FV2", text)


def test_standard_parameters_have_the_same_torques(tx40) -> None:
    physical = physical_model(tx40)
    X = tx40.base_parameters(tx40.VALUES)
    chi = standard_parameters(replace(physical, values={}), X)  # nothing known of the robot
    assert np.abs(chi - values(tx40)).max() > 1e-2  # another robot
    assert min(physical.smallest(chi).values()) >= 0
    np.testing.assert_allclose(physical.K @ chi, X, atol=1e-12)


def test_limits_hold(arm) -> None:
    physical = physical_model(arm)
    limits = RobotLimits(
        bounds={"M1": (None, 1.5)},
        total_mass=(3.0, 3.5),
        centre={"2": ((0.0, 0.3), (-0.1, 0.1), (-0.1, 0.1))},
        ellipsoid={"2": Ellipsoid((0.25, 0.0, 0.0), (0.5, 0.2, 0.2))},
    )
    chi = standard_parameters(physical, arm.base_parameters(arm.VALUES), limits)
    value = physical.named(chi)
    assert value["M1"] <= 1.5 + 1e-8 and 3.0 - 1e-8 <= value["M1"] + value["M2"] <= 3.5 + 1e-8
    assert -1e-8 <= value["MX2"] / value["M2"] <= 0.3 + 1e-8
    P = pseudo_inertia(chi[physical.link(2)])
    x, a = np.array([0.25, 0.0, 0.0]), np.array([0.5, 0.2, 0.2])
    inside = (
        P[3, 3]
        - (np.diag(P)[:3] / a**2).sum()
        + 2 * (P[3, :3] * x / a**2).sum()
        - P[3, 3] * (x**2 / a**2).sum()
    )  # integral of 1 - (x - c)'A^-1(x - c)
    assert inside >= -1e-8
    weights = limit_rows(physical, limits).A[-1]
    assert weights @ chi == pytest.approx(inside, abs=1e-12)


def test_held_out_weight_is_that_of_the_best_prediction(arm) -> None:
    """Wrong values ask for little pull, right ones for much."""
    seen = simulated(arm, arm.base_parameters(arm.VALUES), 2.0, N=40)
    options = {"reach": None}
    right, wrong = replace_values(arm), replace_values(arm)
    wrong.VALUES = {name: 3 * x for name, x in right.VALUES.items()}
    weights = [
        estimate_of(seen, EstimateSettings("feasible", options=options), model=m).details["weight"]
        for m in (right, wrong)
    ]
    assert weights[0] > 10 * weights[1]


def test_a_part_that_alone_moves_a_joint_does_not_decide_the_weight(arm) -> None:
    """Joint 2 hardly moves before the last fifth, which wrong values predict better than the fit of
    the others: a sum of errors chose a weight of 0.01, and values 54 deviations off.
    """
    true, N = arm.base_parameters(arm.VALUES), 200
    q, qd, qdd = np.random.default_rng(0).uniform(-3, 3, (3, N, 2))
    early = np.arange(N) < 4 * N // 5
    for x in (q, qd, qdd):
        x[early, 1] *= 0.02
    noise = 0.01 * np.random.default_rng(1).standard_normal((2, N))
    noise[1, early] += qdd[early, 1]  # an inertia that is not there, seen in small motions alone
    W = np.asfortranarray(arm.observation_matrix(q, qd, qdd))
    seen = replace(simulated(arm, true, 0.0, N=N), W=W, Y=W @ true + noise.ravel())
    off = replace_values(arm)
    off.VALUES = {name: 1.3 * x for name, x in off.VALUES.items()}
    free = estimate_of(seen, EstimateSettings("ols"), model=off)
    fit = estimate_of(seen, EstimateSettings("feasible", options={"reach": None}), model=off)
    assert fit.relative_error < 1.1 * free.relative_error
    assert (np.abs(fit.X - true) < 3 * free.sigma).all()


def test_a_strong_pull_ends_at_the_values_and_auto_costs_one_per_cent(arm) -> None:
    prior = "euclidean"
    seen = simulated(arm, arm.base_parameters(arm.VALUES), 0.5)
    solid = replace_values(arm)
    free = estimate_of(seen, FEASIBLE, model=solid)
    strong = estimate_of(
        seen,
        EstimateSettings("feasible", options={**PLAIN, "prior": prior, "weight": 1e4}),
        model=solid,
    )
    inertial = [f"{family}{j}" for j in (1, 2) for family in INERTIAL]
    assert (
        max(abs(strong.details["standard"][name] - solid.VALUES[name]) for name in inertial) < 1e-3
    )
    auto = estimate_of(
        seen,
        EstimateSettings("feasible", options={**PLAIN, "prior": prior, "weight": "auto"}),
        model=solid,
    )
    assert (
        free.residual_norm <= auto.residual_norm <= 1.0101 * free.residual_norm
        and auto.details["weight"] > 0
    )


def replace_values(arm):
    """The arm with thick links: the packaged ones are rods, whose pseudo-inertia is singular to the
    printed digits.
    """
    from types import SimpleNamespace

    thick = dict(arm.VALUES) | {"XX1": 0.01, "XX2": 0.01, "ZZ1": 0.172, "ZZ2": 0.172}
    return SimpleNamespace(
        **{name: getattr(arm, name) for name in dir(arm) if not name.startswith("_")}
        | {"VALUES": thick}
    )


def test_deviation_holds_what_a_wrong_prior_moved(arm) -> None:
    other = {name: 1.3 * value for name, value in arm.VALUES.items()}
    truth = arm.base_parameters(other)
    seen = simulated(arm, truth, 0.3)
    least = estimate_of(seen, model=arm)
    pull = EstimateSettings("feasible", options={"prior": "euclidean", "weight": 100.0})
    pulled = estimate_of(seen, pull, model=replace_values(arm))
    moved = pulled.X - least.X
    assert (np.abs(pulled.X - truth) > 3 * least.sigma_corrected).any()
    np.testing.assert_allclose(pulled.sigma_corrected**2, least.sigma_corrected**2 + moved**2)
    assert (np.abs(pulled.X - truth) < 1.96 * pulled.sigma_corrected).mean() > 0.9


def test_json_keeps_the_standard_parameters(arm) -> None:
    found = estimate_of(simulated(arm, arm.base_parameters(arm.VALUES), 0.1), FEASIBLE, model=arm)
    back = Estimate.from_json(found.to_json())
    assert back.details["standard"] == pytest.approx(found.details["standard"])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"total_mass": -1.0}, "without total_mass: widen"),
        (
            {
                "bounds": {"M1": [3, None], "MX1": [None, -9]},
                "centre": {"1": [[0, 1], [0, 1], [0, 1]]},
            },
            "a solution exists without bounds of MX1 or without centre of link 1",
        ),
        (
            {"bounds": {"M1": [3, None], "M2": [3, None]}, "total_mass": [0, 4]},
            "without bounds of M1 or without bounds of M2 or without total_mass",
        ),
        ({"bounds": {"mass": [0, 1]}}, "no standard parameter mass"),
        ({"centre": {"9": [[0, 1], [0, 1], [0, 1]]}}, "no link '9'"),
        ({"ellipsoid": {"1": {"centre": [0, 0, 0], "axes": [1, 0, 1]}}}, r"ellipsoid\.1\.axes"),
        ({"prior": "cad"}, "expected none or euclidean or auto"),
        ({"prior": "entropic"}, "use euclidean or none"),
        ({"prior": "pullback"}, "use euclidean or none"),
        ({"margin": 0}, "margin"),
        ({"weight": 1.0}, "set prior"),
        ({"pull": 1}, "unknown key pull"),
    ],
)
def test_what_cannot_be_asked(arm, options: dict, said: str) -> None:
    seen = simulated(arm, arm.base_parameters(arm.VALUES), 0.1)
    with pytest.raises(InputError, match=said):
        estimate_of(seen, EstimateSettings("feasible", options={**PLAIN, **options}), model=arm)


def test_needs_the_model_and_values_for_a_pull(arm) -> None:
    seen = simulated(arm, arm.base_parameters(arm.VALUES), 0.1)
    with pytest.raises(InputError, match="needs the model"):
        estimate_of(seen, FEASIBLE)
    with pytest.raises(SettingsError, match="no inertial values of"):
        estimate_of(
            simulated(emitted("rx90"), np.ones(len(emitted("rx90").BASE_PARAMETERS)), 1.0),
            EstimateSettings("feasible", options={"prior": "euclidean"}),
            model=emitted("rx90"),
        )


def test_a_solver_that_fails_is_told(arm, monkeypatch) -> None:
    """One step of the interior point method solves nothing."""

    whole = clarabel.DefaultSolver

    def impatient(*problem):
        problem[-1].max_iter = 1
        return whole(*problem)

    monkeypatch.setattr("clarabel.DefaultSolver", impatient)
    with pytest.raises(
        InputError, match=r"was not solved \(Clarabel: MaxIterations\); try another margin"
    ):
        estimate_of(simulated(arm, arm.base_parameters(arm.VALUES), 0.1), FEASIBLE, model=arm)


def test_a_solver_that_panics_is_told(arm, monkeypatch) -> None:
    """A panic of Rust is no Exception: it ended the process of whoever called identify."""

    class PanicException(BaseException):
        pass

    def panics(*problem):
        raise PanicException("index out of bounds")

    monkeypatch.setattr("clarabel.DefaultSolver", panics)
    with pytest.raises(InputError, match=r"was not solved \(Clarabel stopped by an error"):
        estimate_of(simulated(arm, arm.base_parameters(arm.VALUES), 0.1), FEASIBLE, model=arm)


def test_the_pull_is_at_its_minimum(arm) -> None:
    """Criterion written down from the definition of the distance: no step towards another robot
    makes it smaller.
    """
    physical = physical_model(arm)
    prior = pull_to_file(physical, "euclidean", 1e-2)
    rng = np.random.default_rng(3)
    p = len(physical.standard)
    R, z = rng.standard_normal((6, p)) / 3, rng.standard_normal(6) / 3
    rows = limit_rows(physical, None)
    chi = closest(
        R, z, physical.conditions, rows, everything(scales(physical)), least=1e-4, pull=prior
    ).chi

    def criterion(x):
        numbers = list(prior.numbers)
        distance = np.sum(((x - prior.chi0) / prior.scale)[numbers] ** 2)
        return np.sum((R @ x - z) ** 2) + 1e-2 * distance

    best, smallest = criterion(chi), min(physical.smallest(chi).values())
    assert smallest > 1e-4 - 1e-9
    tried = 0
    for _ in range(2000):
        inside = prior.chi0 * rng.uniform(0.5, 2) + scales(physical) * rng.normal(
            0, 10 ** rng.uniform(-4, -1), p
        )
        if min(physical.smallest(inside).values()) >= 1e-4:
            tried += 1
            assert criterion(chi + 10 ** rng.uniform(-4, 0) * (inside - chi)) > best - 1e-10
    assert tried > 50


def test_a_finger_is_judged_by_its_own_size(tmp_path) -> None:
    """Links of 6 and 3 g, 40 and 25 mm long: with a margin in SI the conditions took ZZ2 to four
    times its value, and a small negative moment of inertia passed as rounding.
    """
    path = tmp_path / "finger.yaml"
    path.write_text("""\
symgen: 1
name: finger
gravity: [0, 0, -9.81]
frames:
  1: {ant: 0, sigma: 0, alpha: pi/2, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: 0, d: 0.04, theta: q2, r: 0}
elements:
  FV: {kind: viscous, along: all}
values:
  {M1: 0.006, MX1: 1.2e-4, MY1: 0, MZ1: 0, XX1: 2.7e-8, XY1: 0, XZ1: 0, YY1: 3.2e-6, YZ1: 0, ZZ1: 3.2e-6,
   M2: 0.003, MX2: 3.6e-5, MY2: 0, MZ2: 0, XX2: 1.4e-8, XY2: 0, XZ2: 0, YY2: 6.3e-7, YZ2: 0, ZZ2: 6.3e-7,
   FV1: 2.0e-4, FV2: 1.0e-4}
""")
    finger = symgen.model(load_robot(path))
    X = finger.base_parameters(finger.VALUES)
    ols, plain, pulled_to_file = (
        estimate_of(simulated(finger, X, 1e-6), how, model=finger)
        for how in (EstimateSettings(), FEASIBLE, EstimateSettings("feasible"))
    )
    np.testing.assert_allclose(plain.X, ols.X, rtol=1e-9, atol=1e-15)
    assert np.all(np.abs(pulled_to_file.X - X) < 4 * ols.sigma)
    physical = physical_model(finger)
    assert feasibility(physical, finger.BASE_PARAMETERS, X).feasible
    X[finger.BASE_PARAMETERS.index("ZZ2")] = -1.3e-9
    judged = feasibility(physical, finger.BASE_PARAMETERS, X)
    assert not judged.feasible and judged.blocking[0][0] == "link 2"


def test_essential_columns_alone_leave_the_others_free(arm) -> None:
    """With five columns the arm of the estimate has those five parameters and whatever else makes
    it an arm.
    """
    seen = simulated(arm, arm.base_parameters(arm.VALUES), 0.1)
    names = ("ZZ1R", "MX1R", "FV1", "ZZ2", "MX2")
    found = estimate_of(seen, replace(FEASIBLE, columns=names), model=arm)
    assert found.names == names and min(found.details["smallest_eigenvalues"].values()) > 0
    chi = np.array(list(found.details["standard"].values()))
    np.testing.assert_allclose(physical_model(arm).rows(names) @ chi, found.X, atol=1e-10)


def test_tx40_record(tx40, tx40_data) -> None:
    """Least squares of the public record is infeasible; the feasible estimate costs less than 5 %
    (measured 0.24 %), and a robot has its torques.
    """
    study = study_from_mapping(dataset_study("tx40"))
    seen = observe(tx40, read_records(study.record, tx40)[0], study)
    ols, found = estimate_of(seen), estimate_of(seen, FEASIBLE, model=tx40)
    told = found.details["least_squares"]
    assert (
        not told["feasible"]
        and "link 3" in [blocking["condition"] for blocking in told["blocking"]]
        and "NOT physically feasible" in found.message
    )
    assert 1 < found.relative_error / ols.relative_error < 1.05
    chi = np.array([found.details["standard"][name] for name in tx40.STANDARD_PARAMETERS])
    for j in range(1, 7):
        ten = [found.details["standard"][f"{family}{j}"] for family in INERTIAL]
        assert np.linalg.eigvalsh(pseudo_inertia(np.array(ten)))[0] > 0
    value = found.details["standard"]
    assert np.linalg.eigvalsh([[value["Ia5"], value["Ia6"]], [value["Ia6"], value["Ia6"]]])[0] > 0
    assert np.linalg.eigvalsh([[value["FV5"], value["FVM6"]], [value["FVM6"], value["FV6"]]])[0] > 0
    oracle = PinocchioModel(load_robot("tx40"))
    rng = np.random.default_rng(5)
    for _ in range(5):
        q, qd, qdd = rng.uniform(-2, 2, (3, 6))
        torque = oracle.torque(q, qd, qdd, chi)
        np.testing.assert_allclose(
            tx40.inverse_dynamics(q, qd, qdd, found.X), torque, atol=1e-9 * np.abs(torque).max()
        )
    for split in (
        study.validate.split,
        study.validate.split[::-1],
    ):  # each half predicts the other better than by least squares
        errors = [
            split_validation(state_problem(tx40, ()), seen, split, {"all": how})
            .predictions[1]
            .relative_error
            for how in (EstimateSettings(), FEASIBLE)
        ]
        assert errors[1] < 0.98 * errors[0]
    system = linear_system(seen, FEASIBLE)
    assert residual_norm(system.weighted, found.X) == pytest.approx(found.residual_norm, rel=1e-9)


def test_standard_parameters_where_a_friction_is_zero(tx40) -> None:
    """A condition on its limit, which X alone decides, leaves the others free: the set is the
    nearest to the robot file, not the one of the largest margin.
    """
    physical = physical_model(tx40)
    chi = np.array([tx40.VALUES.get(name, 0.0) for name in physical.standard])
    chi[physical.standard.index("FS1")] = 0.0
    for j in (2, 3):  # denser links, so that the nearest set is another one
        chi[physical.link(j)] *= 1.1
    X = physical.K @ chi
    found = standard_parameters(physical, X)
    values = np.array([tx40.VALUES.get(name, 0.0) for name in physical.standard])
    scale = scales(physical)
    np.testing.assert_allclose(physical.K @ found, X, atol=1e-9)
    assert np.linalg.norm((found - values) / scale) <= np.linalg.norm((chi - values) / scale) + 1e-6
    assert min(c.smallest(found) for c in physical.conditions) > -1e-9


@pytest.mark.parametrize("weight", ["held-out", "auto"])
def test_a_weight_that_the_solver_cannot_do_is_passed_over(arm, monkeypatch, weight: str) -> None:
    """The search goes on with the others; where none can be solved, the error is that of the
    solver.
    """
    import runtime.physical.feasible as method

    seen, solid, whole = (
        simulated(arm, arm.base_parameters(arm.VALUES), 0.5, N=60),
        replace_values(arm),
        method.solve_feasible,
    )
    settings = EstimateSettings(
        "feasible", options={**PLAIN, "prior": "euclidean", "weight": weight, "explain": False}
    )

    def failing(rows, physical, options, weight):
        if weight > 1e-3:
            raise InputError(
                "the semidefinite program was not solved (Clarabel: InsufficientProgress)"
            )
        return whole(rows, physical, options, weight)

    monkeypatch.setattr(method, "solve_feasible", failing)
    found = estimate_of(seen, settings, model=solid)
    assert found.status == "ok" and found.details["weight"] <= 1e-3


def test_values_given_in_part_pull_what_they_name(arm) -> None:
    """Ten of twenty values: they count, the others stay free, and the message says how many."""
    seen = simulated(arm, arm.base_parameters(arm.VALUES), 0.5, N=60)
    partial = replace_values(arm)
    partial.VALUES = {name: x for name, x in partial.VALUES.items() if name.endswith("2")}
    found = estimate_of(seen, EstimateSettings("feasible"), model=partial)
    assert (
        found.status == "ok"
        and "(10 parameters of links have no value and stay free)" in found.message
    )


def test_lengths_that_say_little_give_no_reach() -> None:
    """A slide of unknown travel, by which a SCARA weighed up to 50.9 t; one length alone."""
    assert np.isnan(reach_of(symgen.model("scara"))) and np.isnan(
        reach_of(symgen.model("planar_2r"))
    )
    assert reach_of(symgen.model("tx40")) > 0.5


def test_bounds_are_told_as_bounds() -> None:
    """Balls of 7 kg in a cube of 0.1 m: physical, outside a reach that was given."""
    arm = symgen.model("tx40")
    physical = physical_model(arm)
    sizes = {"M": 7.0, "XX": 0.1, "YY": 0.1, "ZZ": 0.1, "MX": 3.0, "FV": 1.0, "FS": 1.0, "Ia": 1.0}
    chi = np.array([sizes.get(n.rstrip("0123456789"), 0.0) for n in physical.standard])
    for j in physical.links:
        chi[physical.link(j)[1::3]] = 0.0
        chi[physical.link(j)[3]] = chi[physical.link(j)[5]] = 2.0
    X = physical.K @ chi
    options = decide_options(FeasibleOptions(reach=0.1, prior="none"), arm, physical)
    judged = within_limits(physical, physical.base, X, options)
    assert judged.physical and not judged.feasible
    assert "NOT" not in judged.text and "bounds of masses and centres" in judged.text


class Grams:
    """The arm of a model with a millionth of its masses, a thousandth of its friction and no inertia
    of drives.
    """

    def __init__(self, model) -> None:
        self.VALUES = {
            name: {"Ia": 0.0, "FV": 1e-3, "FS": 1e-3}.get(name[:2], 1e-6) * value
            for name, value in model.VALUES.items()
        }
        self._model = model

    def __getattr__(self, name: str):
        return getattr(self._model, name)


def test_margin_of_a_drive_takes_nothing_from_a_small_link(arm) -> None:
    """A margin of the motor inertia in SI, 1e-6 kg m^2, is six times the ZZ2 of such a link."""
    light = Grams(arm)
    truth = arm.base_parameters(light.VALUES)
    found = estimate_of(simulated(arm, truth, 0.0), FEASIBLE, model=light)
    np.testing.assert_allclose(found.X, truth, rtol=5e-3, atol=1e-9)
