"""Closed-loop simulation: EMPS against its record and published setting, scipy and CVODES on smooth
motion, friction that only takes energy.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign
from scipy.integrate import solve_ivp

from runtime import InputError, load_model
from runtime.compose import simulate as simulate_study
from runtime.core.errors import SettingsError
from runtime.core.settings import structure
from runtime.core.signals.filters import filtered_states
from runtime.loop.control_law import control_law, discrete_poles, parameters_of
from runtime.loop.controller_tick import plant_function
from runtime.loop.dry_friction import dry_friction
from runtime.loop.reference import Reference, reference_of
from runtime.loop.result import SimulationError
from runtime.loop.settings import Controller
from runtime.loop.simulation import Simulator
from runtime.loop.stick_slip import friction_function
from runtime.reading.datasets import dataset_study
from runtime.reading.records import read_records
from runtime.study import study_from_mapping

GENERATED = Path(__file__).resolve().parents[2] / "generated"
GTAU = 35.15065188248547  # N/V
CASCADE = {"kind": "cascade", "kp": 160.18, "kv": 243.45, "gain": 35.15}
PUBLISHED = np.array([95.1089, 203.5034, 20.3935, -3.1648])
TX40 = {  # gains of the BIRDy benchmark, joint side
    "law": {
        "kind": "pid",
        "kp": [341.87, 375.0, 190.34, 150.16, 183.24, 358.86],
        "kd": [2.5361, 4.1174, 1.1793, 0.5462, 0.5714, 0.1954],
        "gain": [35.24, 32.04, 23.94, 9.05, 15.5, 6.56],
    },
    "rate": 5000,
    "reference": {"points": {"duration": 1.5, "seed": 2}},
}


def controller(**changes) -> Controller:
    return structure(Controller, {**TX40, **changes})


@pytest.fixture(scope="module")
def tx40():
    return load_model("tx40", folder=GENERATED)


@pytest.fixture(scope="module")
def emps():
    return load_model("emps", folder=GENERATED)


@pytest.fixture(scope="module")
def truth(tx40):
    return parameters_of(tx40, controller())


def simulate(model, X, controller, reference, **settings):
    """One run with parameters and reference of its own."""
    return Simulator(model, controller).run(X, reference, **settings)


def relative(measured, simulated):
    return 100 * np.linalg.norm(measured - simulated) / np.linalg.norm(measured)


@pytest.mark.parametrize(
    ("delay", "record", "expected"),
    [
        (1, 0, (0.0016, 0.2297, 8.06, 5.859)),
        pytest.param(1, 1, (0.0026, 0.402, 18.4, 8.71), marks=campaign),
        pytest.param(0, 0, (0.0011, 0.126, 5.71, 4.57), marks=campaign),
        pytest.param(0, 1, (0.0016, 0.187, 16.2, 5.44), marks=campaign),
    ],
)
def test_emps_record_with_the_published_parameters(emps, emps_data, delay, record, expected):
    """Relative errors of position, velocity, acceleration, force in %, found by an independent
    simulation of the authors' diagram.

    Positions to the last digit, others within 1.5 %: they depend on how a reversal within 1 ms is
    treated. Pulses are volts after the saturation.
    """
    from scipy.io import loadmat

    study = study_from_mapping(dataset_study("emps"))
    measured = read_records(study.record + study.validate.record, emps)[record]
    pulses = None
    if record:
        pulses = GTAU * loadmat(emps_data["DATA_EMPS_PULSES.mat"])["pulses_N"].astype(float)
    found = simulate(emps, PUBLISHED, replace(study.controller, delay=delay), Reference.sampled(measured.q_r, 1000.0), start=measured.q[0],
                     disturbance=pulses)  # fmt: skip
    states, rows = filtered_states(measured.q, 1000.0, study.signals), slice(49, None)
    force = found.tau + (0 if pulses is None else pulses)
    pairs = (
        (measured.q, found.q),
        (states.qd, found.qd),
        (states.qdd, found.qdd),
        (measured.tau, force),
    )
    errors = [relative(x[rows], y[rows]) for x, y in pairs]
    assert round(errors[0], 4) == expected[0]
    np.testing.assert_allclose(errors[1:], expected[1:], rtol=1.5e-2)


def test_against_scipy(tx40, truth):
    """A feed-forward torque without friction and gains too weak to matter is an initial value
    problem: dop853 at 1e-12, RK4 with 0.2 ms.
    """
    smooth = truth * [not name.startswith("FS") for name in tx40.BASE_PARAMETERS]
    rate, N = 5000.0, 500
    t = np.arange(N) / rate
    rest = np.tile([0.1, -1.2, 1.0, 0.3, 0.2, -0.1], (N, 1))
    steps = np.repeat(np.array([tx40.gravity(rest[0], smooth)]), N, axis=0) + np.sin(
        2 * np.pi * np.outer(t, np.arange(1, 7))
    )
    weak = controller(law={"kind": "pid", "kp": 1e-12})
    found = simulate(
        tx40, smooth, weak, Reference(rate, rest, 0 * rest, 0 * rest), feedforward=steps
    )

    x = np.concatenate([rest[0], np.zeros(6)])
    for k in range(60):  # tick by tick: the torque jumps

        def rates(time, x, tau=steps[k]):
            return np.concatenate([x[6:], tx40.forward_dynamics(x[:6], x[6:], tau, smooth)])

        x = solve_ivp(rates, (0, 1 / rate), x, method="DOP853", rtol=1e-10, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(found.q[60], x[:6], rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.qd[60], x[6:], rtol=0, atol=1e-9)
    assert np.abs(found.q[-1] - rest[0]).max() > 1e-2  # it moved


@campaign
def test_against_cvodes_and_substeps(tx40, truth):
    """The same loop by CVODES and by more substeps: the flow between two ticks is exact to 1e-7."""
    settings = controller()
    whole = reference_of(settings, tx40)
    reference = replace(whole, q=whole.q[:250], qd=whole.qd[:250], qdd=whole.qdd[:250])
    plain = simulate(tx40, truth, settings, reference)
    finer = simulate(tx40, truth, replace(settings, pole_step=0.02), reference)
    cvodes = simulate(tx40, truth, replace(settings, integrator="cvodes"), reference)
    assert finer.substeps > 3 * plain.substeps
    for other in (finer, cvodes):
        np.testing.assert_allclose(plain.q, other.q, rtol=0, atol=2e-7)


def potential(model, values, q):
    """U of the standard parameters, from the poses: independent of the dynamics."""
    T = model.frame_poses(q)
    moments = np.array(
        [[values[f"{x}{j}"] for x in ("MX", "MY", "MZ", "M")] for j in range(1, T.shape[1] + 1)]
    )
    return 9.81 * np.einsum("tjk,jk->t", T[:, :, 2, :], moments)


@pytest.mark.parametrize("step", [1e-3, 4e-3])
def test_energy_of_a_falling_arm_only_falls(tx40, step):
    """Kinetic and potential energy of the TX40, coupled wrist friction and gravity, no torque, from
    four random states until joints rest.
    """
    friction = dry_friction(tx40)
    assert (
        [1, 0, 0, 0, 0, 0] in friction.G.tolist()
        and [0, 0, 0, 0, 1, 1] in friction.G.tolist()
        and len(friction.G) == 7
    )
    values = {name: 0.0 if name.startswith("OFFSET") else x for name, x in tx40.VALUES.items()}
    X = tx40.base_parameters(values)
    plant = plant_function(tx40, friction, "rk4")
    rng = np.random.default_rng(0)
    N, rested = round(1.0 / step), 0
    for _ in range(2):
        q, qd = rng.uniform(-1, 1, 6), rng.uniform(-3, 3, 6)
        states = [(q, qd)]
        for _ in range(N):
            q, qd, _ = (
                x.full()[:, 0]
                for x in plant(
                    q,
                    qd,
                    np.zeros(6),
                    X * friction.smooth,
                    friction.plus @ X,
                    friction.minus @ X,
                    step,
                )
            )
            states.append((q, qd))
        q, qd = (np.array(x) for x in zip(*states, strict=True))
        kinetic = np.einsum("ti,tij,tj->t", qd, tx40.inertia_matrix(q, X), qd) / 2
        energy = kinetic + potential(tx40, values, q)
        assert np.diff(energy).max() < 1e-12 * np.ptp(energy)
        assert np.ptp(energy) > 1
        rested += (np.abs(qd[-1]) < 1e-9).sum()
    assert rested > 4  # wrist and others came to rest against gravity


def test_forces_at_rest_are_those_of_the_quadratic_program(tx40, truth):
    """Gauss: the forces minimise (t - G' f)' A^-1 (t - G' f) between their bounds; 150 random
    states, some joints moving, against bounded least squares.
    """
    from scipy.optimize import lsq_linear

    friction = dry_friction(tx40)
    function = friction_function(tx40, friction)
    G, plus = friction.G, friction.plus @ truth
    rng, size = np.random.default_rng(0), np.array([7, 8, 6, 2.4, 5, 3.5])
    sticking = 0
    for k in range(150):
        q, qd = rng.uniform(-2, 2, 6), rng.uniform(-1, 1, 6) * (rng.random(6) < 0.4) * (k % 3 == 0)
        tau = tx40.gravity(q, truth) + rng.uniform(-2, 2, 6) * size * (0.3, 1, 3)[k % 3]
        f, direction, qdd, _ = (
            x.full() for x in function(q, qd, tau, truth * friction.smooth, plus, plus)
        )
        free = np.abs(G @ qd) < 1e-9
        t = tau - tx40.bias(q, qd, truth * friction.smooth) - G.T @ (np.sign(G @ qd) * plus)
        L = np.linalg.cholesky(np.linalg.inv(tx40.inertia_matrix(q, truth))).T
        expected = (
            t
            - G[free].T
            @ lsq_linear(
                L @ G[free].T, L @ t, bounds=(-plus[free], plus[free]), tol=1e-14, method="bvls"
            ).x
        )
        np.testing.assert_allclose(
            qdd[:, 0], np.linalg.solve(tx40.inertia_matrix(q, truth), expected), rtol=0, atol=1e-6
        )
        assert (np.abs(f[:, 0]) <= plus + 1e-12).all()
        sticking += (direction == 0).sum()
    assert 200 < sticking < 900


def test_held_by_friction_alone(tx40, truth):
    """Below the breakaway torque nothing moves, not even slowly; the coupled element of the wrist
    carries joints 5 and 6 together.
    """
    friction = dry_friction(tx40)
    plant = plant_function(tx40, friction, "rk4")
    column = {name: k for k, name in enumerate(tx40.BASE_PARAMETERS)}
    X = truth.copy()
    X[[column["FS5"], column["FS6"], column["FSM6"]]] = 2.0, 1.0, 1.5
    q = np.array([0.1, -1.2, 1.0, 0.3, 0.2, -0.1])

    def moved(tau5, tau6):
        qd, at = np.zeros(6), q
        for _ in range(20):
            tau = tx40.gravity(at, X) + [0, 0, 0, 0, tau5, tau6]
            at, qd, _ = (
                x.full()[:, 0]
                for x in plant(
                    at, qd, tau, X * friction.smooth, friction.plus @ X, friction.minus @ X, 1e-3
                )
            )
        return np.abs(at - q) > 1e-11

    # f5 + fm = tau5, f6 + fm = tau6, |f5| <= 2, |f6| <= 1, |fm| <= 1.5
    for tau5, tau6 in ((3.4, 1.5), (3.4, 2.4), (-3.4, -2.4), (0.4, 2.4), (0.0, 0.0), (1.9, -0.9)):
        assert not moved(tau5, tau6).any(), (tau5, tau6)
    assert (
        moved(3.6, 1.5)[4] and moved(0.0, 2.6)[5] and moved(3.4, -1.0)[4]
    )  # the last: fm <= 0 when joint 6 is to stay
    assert not moved(3.6, 1.5)[:4].any()


def test_ideal_run_satisfies_the_inverse_model(tx40, truth):
    settings = controller(encoder={"step": 1e-3}, torque={"step": 0.5, "noise": 1.0})
    reference = reference_of(settings, tx40)
    found = simulate(tx40, truth, settings, reference, ideal=True)
    moving = (np.abs(found.qd) > 1e-6).all(axis=1) & (
        np.abs(found.qd[:, 4] + found.qd[:, 5]) > 1e-6
    )
    torque = tx40.inverse_dynamics(found.q, found.qd, found.qdd, truth)
    np.testing.assert_allclose(
        torque[moving], found.tau[moving], rtol=0, atol=1e-9 * np.abs(found.tau).max()
    )
    assert (
        moving.mean() > 0.8
        and np.array_equal(found.q, found.q_measured)
        and np.array_equal(found.tau, found.tau_measured)
    )
    assert np.abs(found.q - reference.q).max() < 0.02
    coarse = simulate(tx40, truth, settings, reference)
    assert not np.array_equal(coarse.q, coarse.q_measured)
    np.testing.assert_allclose(
        coarse.q_measured / 1e-3, np.round(coarse.q_measured / 1e-3), atol=1e-9
    )
    np.testing.assert_allclose(coarse.tau / 0.5, np.round(coarse.tau / 0.5), atol=1e-9)
    assert 0.8 < (coarse.tau_measured - coarse.tau).std() < 1.2


def test_motor_encoder_saturation_and_seeds(tx40, truth):
    settings = controller(
        encoder={"step": 0.01, "side": "motor"},
        torque={"saturation": 5.0},
        reference={"points": {"duration": 0.5}},
    )
    reference = reference_of(settings, tx40)
    simulator = Simulator(tx40, settings)
    found = simulator.run(truth, reference)
    assert np.abs(found.tau).max() == 5.0 and found.saturated.max() > 0.1
    R, offset = np.array(tx40.DRIVES["ratio"]), np.array(tx40.DRIVES["offset"])
    steps = (found.q_measured - offset) @ R.T / 0.01
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    noisy = Simulator(
        tx40,
        controller(
            encoder={"noise": 1e-5},
            torque={"disturbance": 1.0},
            reference={"points": {"duration": 0.5}},
        ),
    )
    one, same, other = (noisy.run(truth, reference, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(one.q, same.q) and not np.array_equal(one.q, other.q)


def test_record_and_csv_carry_the_reference(tx40, truth, tmp_path):
    from runtime.compose import read_record
    from runtime.reading.settings import RecordSettings

    settings = controller(record_every=5, reference={"points": {"duration": 0.4}})
    reference = reference_of(settings, tx40)
    found = simulate(tx40, truth, settings, reference)
    (tmp_path / "run.csv").write_text(found.to_csv())
    read = read_record(RecordSettings(files=("run.csv",)), folder=tmp_path)
    assert read.rate == pytest.approx(1000) and len(read) == -(-len(reference) // 5)
    for x, y in (
        (read.q, found.q_measured),
        (read.tau, found.tau_measured),
        (read.q_r, reference.q[::5]),
    ):
        np.testing.assert_allclose(x, y, rtol=1e-9, atol=1e-9)
    assert np.array_equal(found.record().q_r, found.q_r)


def test_gains_scaled_with_the_inertia_keep_the_bandwidth(emps):
    """M five times too large: with g the loop has the same discrete poles, and the same motion
    where friction is scaled too.
    """
    settings = study_from_mapping(dataset_study("emps")).controller
    q = 0.05 * np.sin(2 * np.pi * np.arange(500) / 500)[:, None]
    reference = Reference.sampled(q, 1000.0)
    J, J_true = (emps.inertia_matrix(reference.q, k * PUBLISHED).mean(axis=0) for k in (5, 1))
    g = np.diag(J / J_true)
    assert g == pytest.approx(5)
    law = control_law(settings, emps)
    poles = [
        np.sort(np.abs(discrete_poles(law, np.eye(1) * M, np.eye(1) * 2 * M, np.array([k]))))
        for M, k in ((95.0, 1.0), (475.0, 5.0))
    ]
    np.testing.assert_allclose(*poles, rtol=1e-9)
    simulator = Simulator(emps, settings)
    one, scaled = simulator.run(PUBLISHED, reference), simulator.run(5 * PUBLISHED, reference, g=g)
    np.testing.assert_allclose(scaled.q, one.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(scaled.tau, 5 * one.tau, rtol=1e-9, atol=1e-6)


def test_discrete_poles_are_those_of_the_simulated_loop(emps):
    """Decay of a small offset, friction zero: the slowest pole, delay and averaged velocity
    included.
    """
    settings = replace(study_from_mapping(dataset_study("emps")).controller, law=structure(Controller, {"law": {
        "kind": "cascade", "kp": 20, "kv": 200, "gain": 35}}).law)  # fmt: skip
    X = np.array([95.0, 100.0, 0.0, 0.0])
    found = simulate(
        emps, X, settings, Reference.sampled(np.zeros((800, 1)), 1000.0), start=np.array([1e-3])
    )
    slowest = np.abs(
        discrete_poles(control_law(settings, emps), np.eye(1) * 95, np.eye(1) * 100, np.ones(1))
    ).max()
    assert (found.q[700] / found.q[600])[0] == pytest.approx(slowest**100, rel=1e-6)


def test_integral_settles_and_clamps(emps):
    """With an integral the loop starts where it rests: the offset force is held, and there is no
    error at rest.
    """
    X = np.array([95.0, 200.0, 0.0, 30.0])
    reference = Reference.sampled(np.full((400, 1), 0.02), 1000.0)
    law = {"kind": "pid", "kp": 60000, "kd": 3000, "ki": 6e5}
    settings = structure(Controller, {"law": law, "rate": 1000, "settle": 2.0})
    found = simulate(emps, X, settings, reference)
    np.testing.assert_allclose(found.q, 0.02, atol=1e-6)
    np.testing.assert_allclose(found.tau, 30, atol=0.3)
    clamped = simulate(
        emps, X, replace(settings, law=replace(settings.law, antiwindup=1e-5)), reference
    )
    assert np.abs(clamped.q[-1] - 0.02) > 1e-4 / 3


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"law": {"kind": "pid", "kp": 1e6, "kd": 10}},
            r"unstable at 0 s of the reference: a discrete pole has modulus .*lower kp and kd",
        ),
        (
            {"law": {"kind": "pid", "kp": [1, 2]}},
            r"controller\.law\.kp: 2 values are given; expected one value, or 6 values",
        ),
        ({"law": {"kind": "pid", "kp": 0}}, r"expected a gain other than 0 for every joint"),
        (
            {"torque": {"disturbance": 1.0, "bandwidth": 3000}},
            r"bandwidth: the disturbance of the torque has a bandwidth of 3000.0 Hz",
        ),
        ({"values": {"ZZ9": 1.0}}, r"no standard parameter ZZ9"),
        ({"pole_step": 1e-5}, r"integration steps per tick"),
        ({"start": [0.0]}, r"start positions \[0\.\]; expected 6"),
    ],
)
def test_settings_that_cannot_be_simulated(tx40, changes, said):
    settings = controller(**changes)
    reference = Reference.sampled(np.zeros((300, 6)) + [0.0, -1.2, 1.0, 0.1, 0.1, 0.1], 5000.0)
    with pytest.raises(InputError, match=said):
        simulate(tx40, parameters_of(tx40, settings), settings, reference)


def test_parameters_that_cannot_be_simulated(tx40, truth):
    settings = controller()
    reference = reference_of(settings, tx40)
    simulator = Simulator(tx40, settings)
    with pytest.raises(
        SimulationError,
        match="not positive definite at 0 s of the reference, smallest eigenvalue -",
    ) as e:
        simulator.run(-truth, reference)
    assert e.value.time == 0
    with pytest.raises(InputError, match="one for each of the 60 base parameters of tx40"):
        simulator.run(truth[:5], reference)
    with pytest.raises(
        InputError, match="the reference is at 1000 Hz, but the controller runs at 5000 Hz"
    ):
        simulator.run(truth, replace(reference, rate=1000.0))
    with pytest.raises(InputError, match="torques of shape"):
        simulator.run(truth, reference, disturbance=np.zeros((3, 6)))


def test_a_loop_that_is_lost(tx40, truth):
    """Linearly stable but saturated: gravity carries the arm away; the instant is said."""
    settings = controller(torque={"saturation": 1e-3})
    values = truth * [not name.startswith("F") for name in tx40.BASE_PARAMETERS]
    reference = Reference.sampled(np.zeros((8000, 6)) + [0.0, -0.3, 1.0, 0.1, 0.1, 0.1], 5000.0)
    found = simulate(tx40, values, settings, reference)
    assert found.saturated.max() > 0.9
    with pytest.raises(SimulationError, match=r"the simulated motion leaves its reference at .* s"):
        simulate(tx40, values, settings, reference, disturbance=np.full((8000, 6), 3e5))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"limits": "refuse", "motion": {"parts": [{"family": "fourier", "harmonics": 1, "p": [[9.0, 0.0, 0.0]] * 6}]}},
         r"leaves the limits of joint 1 at 0 s: q = 9 rad"),
        ({}, "no reference is given"),
        ({"points": {"duration": 1e9}}, r"points: the reference lasts 1e\+09 s at 5000 Hz; expected at most 4,000,000 ticks"),
        ({"record": 0}, "the study has 0"),
        ({"file": "ref.csv"}, r"no column q3 among t, q1, q2; expected q1 \.\.\. q6"),
    ],
)  # fmt: skip
def test_references_that_cannot_be_followed(tx40, tmp_path, given, said):
    (tmp_path / "ref.csv").write_text("t,q1,q2\n0,0,0\n0.001,0,0\n")
    with pytest.raises(InputError, match=said.replace("no column q3", "no column q3, q4, q5, q6")):
        reference_of(controller(reference=given), tx40, folder=tmp_path)


def test_reference_files(emps, tmp_path):
    t = np.arange(50) / 1000
    rows = np.column_stack([t, 0.1 * t**2, 0.2 * t, 0.2 + 0 * t])
    path = tmp_path / "ref.csv"
    settings = structure(Controller, {"law": {"kp": 1}, "reference": {"file": "ref.csv"}})
    np.savetxt(path, rows, delimiter=",", header="t,q1,qd1,qdd1", comments="")
    found = reference_of(settings, emps, folder=tmp_path)
    assert np.array_equal(found.qdd, rows[:, 3:]) and found.rate == 1000
    np.savetxt(path, rows[:, :2], delimiter=",", header="t,q1", comments="")
    found = reference_of(settings, emps, folder=tmp_path)
    np.testing.assert_allclose(found.qd[5:-5], rows[5:-5, 2:3], atol=1e-12)
    with pytest.raises(InputError, match="the rate 1000 Hz, but the controller runs at 500 Hz"):
        reference_of(replace(settings, rate=500.0), emps, folder=tmp_path)


def test_settings_are_checked():
    for given, said in (
        (
            {"law": {"kind": "cascade", "kp": 1, "kd": 1}},
            "controller.law.kd: 1.0, but a cascade law has no gain kd; remove kd",
        ),
        ({"delay": 2}, "controller.delay: 2; expected 0 or 1"),
        ({"reference": {"record": 0, "points": {}}}, "record and points; expected one of"),
        ({"encoder": {"step": -1}}, "encoder.step: -1; expected more than 0"),
        ({"torque": {"noise": -1}}, "torque.noise: -1; expected at least 0"),
        ({"settle": 1e9}, "controller.settle: 1000000000.0; expected at most 60"),
        ({"velocity": "filtered"}, "expected difference or averaged"),
    ):
        with pytest.raises(SettingsError, match=said.replace(".", r"\.")):
            study_from_mapping({"controller": given})


def test_without_a_compiler_the_same_motion(tx40, truth, monkeypatch):
    settings = controller(reference={"points": {"duration": 0.3}})
    reference = reference_of(settings, tx40)
    compiled = simulate(tx40, truth, settings, reference)
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.warns(UserWarning, match="the simulation runs in the interpreter of CasADi"):
        plain = simulate(tx40, truth, settings, reference)
    np.testing.assert_allclose(plain.q, compiled.q, rtol=0, atol=1e-12)


def test_a_study_is_one_call(emps, tmp_path):
    """Parameters of the robot file, reference of a file, noise of the settings: as the simulator
    gives them.
    """
    table = "q1\n" + "".join(f"{0.05 * (1 - np.cos(k / 100)):.12g}\n" for k in range(600))
    (tmp_path / "motion.csv").write_text(table)
    loop = {
        "law": CASCADE,
        "rate": 1000,
        "reference": {"file": "motion.csv", "limits": "ignore"},
        "torque": {"noise": 0.5},
        "encoder": {"step": 1e-6},
    }
    study = study_from_mapping({"controller": loop})
    run = simulate_study(emps, study, folder=str(tmp_path))
    assert run.name.startswith("SIMULATED emps") and not run.ideal
    expected = simulate(
        emps,
        parameters_of(emps, study.controller),
        study.controller,
        reference_of(study.controller, emps, folder=tmp_path),
    )
    np.testing.assert_array_equal(run.q_measured, expected.q_measured)
    np.testing.assert_array_equal(run.tau_measured, expected.tau_measured)
    summary = run.summary()
    assert (
        summary["samples"] == 600
        and summary["parameters"]["M1R"] == emps.VALUES["M1"] + emps.VALUES["Ia1"]
    )
    assert "nothing was measured" in str(run) and "m, N" in str(run)
    assert simulate_study(emps, study, folder=tmp_path, ideal=True, name="exact").summary()["ideal"]
    with pytest.raises(InputError, match="no section `controller`"):
        simulate_study(emps, study_from_mapping({}))
