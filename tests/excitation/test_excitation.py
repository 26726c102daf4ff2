"""The search for exciting motions: limits hold, the criterion falls, what cannot be is said;
predictions against identification.
"""

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from campaign import campaign

from runtime.compose import estimate_of, excite, observe, problem
from runtime.core.model import load_model
from runtime.core.record import Record
from runtime.core.rows.observation import Observation
from runtime.core.study import Decimate, Lowpass
from runtime.excitation.criteria import Weights, excesses, limits_of, plan_rows, usage, weights_of
from runtime.excitation.optimiser import Search, improve, one_start, smoothed
from runtime.excitation.settings import ExcitationSettings, Sphere
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.settings import structure
from runtime.loop.dry_friction import dry_friction
from runtime.loop.trajectories import Motion, Part, motion_from_mapping
from runtime.study import Signals, Study
from symgen.description import load_robot
from symgen.emit.generate import generate_files

STUDY = Study(signals=Signals(lowpass=Lowpass(cutoff=20.0), decimate=Decimate(factor=10)))
VALUES = {
    "XX1": 0.1,
    "ZZ1": 0.3,
    "MX1": 0.8,
    "MY1": 0.1,
    "M1": 3.0,
    "ZZ2": 0.12,
    "MX2": 0.4,
    "MY2": 0.05,
    "M2": 1.5,
}
FRICTION = {"FV1": 1.0, "FS1": 2.0, "FV2": 0.5, "FS2": 1.0, "Ia1": 0.2, "Ia2": 0.1}
LIMITS = {"q": [1.5, [-2.0, 1.0]], "qd": [3.0, 4.0], "qdd": [15.0, 25.0]}
S = (0.5, 0.2)


@pytest.fixture(scope="module")
def planar(tmp_path_factory: pytest.TempPathFactory) -> tuple[object, np.ndarray]:
    folder: Path = tmp_path_factory.mktemp("planar")
    for name, text in generate_files(load_robot("planar_2r")).items():
        (folder / name).write_text(text, encoding="utf-8")
    model = load_model(folder / "planar_2r.py", trust=True)
    standard = {name: {**VALUES, **FRICTION}.get(name, 0.0) for name in model.STANDARD_PARAMETERS}  # type: ignore[attr-defined]
    model.VALUES, model.LABELS = standard, {1: "shoulder"}
    return model, np.asarray(model.base_parameters(standard))  # type: ignore[attr-defined]


def settings(**changes: object) -> ExcitationSettings:
    parts = (
        {"family": "fourier", "period": 4, "harmonics": 3},
        {"family": "point-to-point", "points": 4, "travel": 0.8, "blend": 0.2},
    )
    return structure(
        ExcitationSettings,
        {
            "parts": parts,
            "columns": "all",
            "limits": LIMITS,
            "torque_sigma": S,
            "starts": 1,
            "iterations": 40,
            **changes,
        },
    )


def search(planar: tuple, asked: ExcitationSettings) -> object:
    return excite(planar[0], study=replace(STUDY, excitation=asked))


@pytest.fixture(scope="module")
def free(planar: tuple) -> object:
    """What the search finds without further limits."""
    return search(planar, settings())


def test_smooth_sign_is_tanh_and_nothing_else_changes(planar: tuple) -> None:
    model, exact_one = planar[0], planar[0].casadi("regressor")
    smooth = smoothed(exact_one, 1e-4)
    rng = np.random.default_rng(0)
    q, qd, qdd = rng.standard_normal((3, 2))
    constants = list(model.CONSTANTS.values())
    exact, near = (np.array(f(q, qd, qdd, *constants)) for f in (exact_one, smooth))
    assert np.allclose(exact, near, rtol=0, atol=1e-12)
    near = np.array(smoothed(exact_one, 0.1)(q, np.array([0.05, -0.02]), qdd, *constants))
    friction = [model.BASE_PARAMETERS.index(name) for name in ("FS1", "FS2")]
    assert np.allclose(near[[0, 1], friction], np.tanh([0.5, -0.2]))
    assert ca.OP_SIGN not in [smooth.instruction_id(k) for k in range(smooth.n_instructions())]


def test_predicted_deviations_with_correlated_noise_and_rows_left_out() -> None:
    """(W'W)^-1 W' Omega W (W'W)^-1 with Omega written out: rows of one joint and one record, by the
    instants between them.
    """
    rng = np.random.default_rng(0)
    instants, r = (
        [np.flatnonzero(rng.random(60) < 0.7) for _ in range(4)],
        np.array([1.0, -0.5, 0.3, 0.1]),
    )
    k, record, joint = (
        np.concatenate(x)
        for x in (
            instants,
            *(
                [np.full(len(a), b) for a, b in zip(instants, c, strict=True)]
                for c in ("0101", "0011")
            ),
        )
    )
    record, joint = record.astype(int), joint.astype(int)
    W = rng.standard_normal((len(k), 3)) * np.array([[1, 1, 0], [1, 0, 1]])[joint]
    observation = Observation(
        W, np.zeros(len(k)), tuple(np.bincount(joint)), ("a", "b", "c"), k / 50.0, record, 50.0
    )
    apart = np.abs(k[:, None] - k)
    together = (record[:, None] == record) & (joint[:, None] == joint) & (apart < len(r))
    Omega, inverse = np.where(together, r[np.minimum(apart, 3)], 0.0), np.linalg.inv(W.T @ W)
    expected = 100 * np.sqrt(np.diag(inverse @ W.T @ Omega @ W @ inverse))
    np.testing.assert_allclose(
        Weights(("a", "b", "c"), np.ones(2), np.ones(3)).relative_sigma(observation, r),
        expected,
        rtol=1e-10,
    )


@pytest.mark.parametrize("criterion", [pytest.param("cond", marks=campaign), "sigma", "logdet"])
def test_motion_within_limits_and_better_than_the_start(planar: tuple, criterion: str) -> None:
    model, X = planar
    asked = settings(criterion=criterion, begin=[0.1, -0.2])
    found = search(planar, asked)
    limits = limits_of(model, asked.limits)
    assert excesses(model, found.motion, limits, asked, X, rate=5000.0) == []
    shares = usage(model, found.motion, limits, 1000.0, X)
    assert max(map(max, shares.values())) <= 1.0
    assert max(map(max, shares.values())) > 0.7  # some limit is used
    q, qd, qdd = found.motion.states(np.array([0.0, found.motion.duration]))
    assert np.allclose(q[0], [0.1, -0.2], atol=1e-6)
    assert np.abs(qd).max() < 1e-5
    assert np.abs(qdd).max() < 1e-4
    weights = weights_of(model, asked, dict(zip(model.BASE_PARAMETERS, X, strict=True)))
    smooth = dry_friction(model).smooth
    once = replace(asked, iterations=1)
    first = one_start(Search(model, once, weights, limits, X, smooth), 0)
    begun = plan_rows(problem(model, (), STUDY), motion_from_mapping(first.motion), asked.rate)
    seen = plan_rows(problem(model, (), STUDY), found.motion, asked.rate)
    assert weights.relative_sigma(seen).max() < 0.8 * weights.relative_sigma(begun).max()
    assert found.condition == pytest.approx(np.linalg.cond(weights.matrix(seen)))
    parts = found.motion.parts
    assert np.allclose(
        parts[0].family.joint(np.array([4.0]), parts[0].p[:, 0], np)[0], parts[1].p[0, 0], atol=1e-5
    )


def test_joints_have_the_names_of_the_file(free: object) -> None:
    assert free.usage_table().header == ("", "joint 1 shoulder", "joint 2")  # type: ignore[attr-defined]


def test_prediction_is_what_identification_finds(planar: tuple, free: object) -> None:
    """60 draws of white torque noise at the raw rate: scatter of the weighted estimate against the
    predicted %sigma, within 20 %.
    """
    model, X = planar
    found = free
    t, q, qd, qdd = found.motion.sampled(1000.0)
    clean = model.inverse_dynamics(q, qd, qdd, X)
    asked = replace(STUDY, estimate=replace(STUDY.estimate, method="wls"))
    rng = np.random.default_rng(3)
    deviations = np.array(S) / np.sqrt(_power_kept())
    estimates = []
    for _ in range(60):
        record = Record(
            t=t, q=q, tau=clean + deviations * rng.standard_normal(clean.shape), rate=1000.0
        )
        estimates.append(estimate_of(observe(model, record, asked), asked.estimate, model=model).X)
    size = weights_of(model, settings(), dict(zip(model.BASE_PARAMETERS, X, strict=True))).size
    scatter = 100 * np.std(estimates, axis=0, ddof=1) / size
    ratio = scatter / np.array(list(found.relative_sigma.values()))
    assert 0.8 < np.sqrt(np.mean(ratio**2)) < 1.2
    assert np.all((ratio > 0.6) & (ratio < 1.5))  # 60 draws: each deviation is known to about 10 %


def _power_kept() -> float:
    """Variance that decimation by 10 leaves of white noise of variance 1."""
    from scipy.signal import decimate

    noise = np.random.default_rng(0).standard_normal(400_000)
    return float(np.var(decimate(noise, 10, zero_phase=True)[50:-50]))


@campaign
def test_torque_limits_hold(planar: tuple, free: object) -> None:
    model, X = planar
    largest = np.abs(model.inverse_dynamics(*free.motion.sampled(1000.0)[1:], X)).max(axis=0)
    asked = settings(
        limits={**LIMITS, "tau": (0.8 * largest).tolist()},
        torque_rms=(0.5 * largest).tolist(),
        smooth=0.02,
        iterations=200,
    )
    found = search(planar, asked)
    tau = model.inverse_dynamics(*found.motion.sampled(1000.0)[1:], X)
    assert np.all(np.abs(tau).max(axis=0) <= 0.8 * largest)
    assert np.all(np.sqrt(np.mean(tau**2, axis=0)) <= 0.5 * largest)


@pytest.mark.campaign
def test_torque_rate_leaves_the_jump_of_dry_friction_out(planar: tuple, free: object) -> None:
    """A reversal of joint 1 switches 2 * 2 N m of dry friction between two samples: 4000 N m/s at 1
    kHz, whatever the motion does.
    """
    model, X = planar
    t, q, qd, qdd, tau = free.sampled()
    assert (np.diff(np.sign(qd[:, 0])) != 0).any() and np.abs(
        np.gradient(tau, t, axis=0)
    ).max() > 1500
    smooth = model.inverse_dynamics(q, qd, qdd, X * dry_friction(model).smooth)
    largest = np.abs(np.gradient(smooth, t, axis=0)).max(axis=0)
    assert np.all(largest < 500)
    assert (
        excesses(
            model, free.motion, free.limits, settings(torque_rate=(1.01 * largest).tolist()), X
        )
        == []
    )
    (excess,) = excesses(
        model,
        free.motion,
        free.limits,
        settings(torque_rate=[0.9 * largest[0], 1.01 * largest[1]]),
        X,
    )
    assert (excess.what, excess.joint) == (
        "rate of torque",
        "1 shoulder",
    ) and excess.value == pytest.approx(largest[0])
    limited = search(planar, settings(torque_rate=(0.8 * largest).tolist(), iterations=100))
    t, q, qd, qdd, _ = limited.sampled()
    rate = np.gradient(
        model.inverse_dynamics(q, qd, qdd, X * dry_friction(model).smooth), t, axis=0
    )
    assert np.all(np.abs(rate).max(axis=0) <= 0.8 * largest)


def test_spheres_stay_apart(planar: tuple) -> None:
    model = planar[0]
    spheres = [{"frame": 0, "radius": 0.1}, {"frame": 2, "radius": 0.1, "centre": [0.4, 0, 0]}]
    wide = {"q": [1.5, 3.0], "qd": [3.0, 8.0], "qdd": [15.0, 60.0]}
    found = search(planar, settings(spheres=spheres, apart=[[1, 2]], gap=0.25, limits=wide))
    T = model.frame_poses(found.motion.sampled(500.0)[1])
    tip = T[:, -1, :3, :3] @ np.array([0.4, 0.0, 0.0]) + T[:, -1, :3, 3]
    assert np.linalg.norm(tip, axis=1).min() >= 0.45 - 1e-3


def test_a_record_gives_parameters_and_a_motion_to_compare_with(planar: tuple) -> None:
    model, X = planar
    t = np.arange(4000) / 1000
    q = np.column_stack([0.3 * np.sin(2 * t), 0.4 * np.sin(3 * t)])
    qd, qdd = np.gradient(q, t, axis=0), np.gradient(np.gradient(q, t, axis=0), t, axis=0)
    noise = 0.01 * np.random.default_rng(0).standard_normal(q.shape)
    record = Record(
        t=t, q=q, tau=model.inverse_dynamics(q, qd, qdd, X) + noise, rate=1000.0, name="slow"
    )
    asked = settings(torque_sigma=None, columns=["ZZ1R", "ZZ2", "FV1", "FV2"], iterations=20)
    found = excite(model, record, replace(STUDY, excitation=asked))
    summary = found.summary()
    assert (
        summary["parameters_from"] == "estimate of slow"
        and summary["cond_of_record"] == found.known.condition
    )
    assert (
        set(found.relative_sigma)
        == set(found.known.relative_sigma)
        == {"ZZ1R", "ZZ2", "FV1", "FV2"}
    )
    ratios = [
        found.relative_sigma[name] / found.known.relative_sigma[name]
        for name in found.relative_sigma
    ]
    assert (
        max(ratios) < 1
        and found.worse == {}
        and "better than the motion of the record" in found.verdict
    )
    assert (
        excite(model, record, replace(STUDY, excitation=replace(asked, criterion="cond"))).condition
        < found.known.condition
    )
    idle = replace(
        found, relative_sigma={**found.relative_sigma, "ZZ2": 3 * found.known.relative_sigma["ZZ2"]}
    )
    assert (
        list(idle.worse) == ["ZZ2"]
        and idle.worse["ZZ2"] == pytest.approx(3)
        and "WORSE: ZZ2" in idle.verdict
    )
    assert "motion of the record" in str(found) and found.to_csv().startswith(
        "t,q1,q2,qd1,qd2,qdd1,qdd2\n"
    )


def test_what_cannot_be_is_said(planar: tuple) -> None:
    with pytest.raises(InputError, match="gave a motion within the limits"):
        search(planar, settings(begin=[3.0, 0.0]))
    with pytest.raises(SettingsError, match=r"no limits of acceleration, .*limits: \{qdd"):
        limits_of(planar[0], {"q": [1, 1], "qd": np.inf, "qdd": None})
    with pytest.raises(SettingsError, match="expected 2 limits, each a number or a pair"):
        limits_of(planar[0], {**LIMITS, "q": [1.0]})
    with pytest.raises(SettingsError, match="has no motor and cannot be moved: lock it"):
        limits_of(planar[0], {**LIMITS, "tau": [10.0, 0.0]})
    with pytest.raises(SettingsError, match="no parameter ZZ9"):
        weights_of(planar[0], settings(columns=["ZZ9"]), {})
    with pytest.raises(SettingsError, match="spheres"):
        settings(apart=[[1, 2]])
    with pytest.raises(SettingsError, match="no family"):
        settings(parts=[{"family": "spiral"}])
    assert Sphere(1, 0.2).centre == (0.0, 0.0, 0.0)


@campaign
def test_a_wider_margin_starts_from_the_motion_found(planar: tuple) -> None:
    model, X = planar
    asked = settings()
    weights = weights_of(model, asked, dict(zip(model.BASE_PARAMETERS, X, strict=True)))
    search = Search(
        model, asked, weights, limits_of(model, asked.limits), X, dry_friction(model).smooth
    )
    start = one_start(search, 0)
    motion = motion_from_mapping(start.motion)
    again = improve(search, 0, Motion(tuple(Part(p.family, p.p) for p in motion.parts)))
    assert again.criterion <= start.criterion + 1e-3
