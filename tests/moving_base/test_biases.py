"""Biases of the sensor on the base, fitted with the parameters; records simulated by pinocchio."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from moving_base.test_free_records import case  # noqa: F401  a fixture

import runtime
import symgen
from runtime.compose import problem
from runtime.ground.errors import InputError, SettingsError

BIAS = np.array([0.01, -0.01, 0.01, 0.15, -0.15, 0.15])


def record_of(case, seed, fit=True):  # noqa: F811
    """Gyroscope .005 rad/s, accelerometer .05 m/s**2 of noise, and BIAS; noise of torques, wrench."""
    _, _, _, (t, q, tau, base) = case
    rng, (w, _, a0) = np.random.default_rng(seed), np.hsplit(base, 3)
    noise = rng.normal(size=tau.shape) * np.r_[np.full(3, 1.0), np.full(3, 0.3), np.full(6, 0.2)]
    own = [w + 0.005 * rng.normal(size=w.shape), a0 + 0.05 * rng.normal(size=w.shape)]
    imu = np.hstack([np.hstack(own) + BIAS, 0 * w])
    channels = {"base_imu": imu, "wrench0": (tau + noise)[:, :6]}
    if fit:
        channels["base_biases"] = np.zeros((len(t), 6))
    q = q + 1e-6 * rng.normal(size=q.shape)
    return runtime.Record(t, q, (tau + noise)[:, 6:], channels=channels)


def error(X, sigma, names, truth):
    """Errors of the parameters that the truth has, in deviations, rms."""
    z = [(x - truth[n]) / s for n, x, s in zip(names, X, sigma, strict=True) if n in truth]
    return np.sqrt(np.mean(np.square(z)))


@pytest.mark.parametrize("base", ["free", "moving"])
def test_biases_are_found_and_parameters_get_better(case, base):  # noqa: F811
    """Within three deviations; X within its deviations; without, 16 (free) and 4 (moving) of them, rms."""
    robot, module, truth, _ = case
    model = module if base == "free" else symgen.model(robot, base="moving")
    result = runtime.identify(model, record_of(case, 1))
    biases = result.part("biases")
    assert biases.known.all()
    assert (np.abs(biases.values - BIAS) < 3 * biases.sigma).all()
    assert (biases.sigma < [0.01] * 3 + [0.03] * 3).all()
    ours = result.sets.all
    without = runtime.estimate(model, record_of(case, 1, fit=False))
    sigma = np.fmax(ours.sigma, ours.sigma_corrected)
    assert error(ours.X, sigma, ours.names, truth) < 1.5
    assert error(without.X, sigma, ours.names, truth) > 3
    alone = runtime.estimate(model, record_of(case, 1))  # as if the biases were known
    assert (ours.sigma_corrected >= alone.sigma_corrected * (1 - 1e-9)).all()
    assert "gyroscope x" in str(result)


def test_the_biases_hold_for_all_records_and_those_predicted(case):  # noqa: F811
    _, module, _, _ = case
    fitted = record_of(case, 1)
    whole = problem(module, [fitted], unseen=[record_of(case, 2)])
    told = whole.noted("biases").result.values
    for record in (*whole.records, *whole.unseen):
        np.testing.assert_array_equal(record.channels["base_biases"], np.tile(told, (2400, 1)))
    with pytest.raises(SettingsError, match="some records have no sensor whose biases are fitted"):
        problem(module, [fitted, record_of(case, 2, fit=False)])


def test_a_bias_that_no_torque_shows_stays():
    """A planar arm on a base that turns about z: nothing tells the bias of the accelerometer along z."""
    model = symgen.model("planar_2r", base="moving")
    t = np.arange(0, 12, 0.005)
    q = np.stack([np.sin(1.3 * t) + 0.3 * np.sin(4 * t), np.cos(2.1 * t)], axis=1)
    qd = np.gradient(q, t, axis=0)
    w0 = np.outer(np.sin(1.7 * t), [0, 0, 0.5])
    a0 = np.stack([2 * np.sin(2.9 * t), 9.81 + np.cos(1.1 * t), 0 * t], axis=1)
    motion = np.hstack([w0, np.gradient(w0, t, axis=0), a0])
    X = model.base_parameters(model.VALUES)
    tau = model.inverse_dynamics(motion, q, qd, np.gradient(qd, t, axis=0), X)
    tau = tau + 0.02 * np.random.default_rng(0).normal(size=tau.shape)
    imu = np.hstack([w0, a0, 0 * w0]) + np.r_[0, 0, 0.01, 0.15, -0.15, 0.5, 0, 0, 0]
    channels = {"base_imu": imu, "base_biases": np.zeros((len(t), 6))}
    told = problem(model, runtime.Record(t, q, tau, channels=channels)).noted("biases").result
    assert list(told.known[2:]) == [True, True, True, False]
    assert abs(told.values[5]) < 1e-6
    off = told.values[2:5] - [0.01, 0.15, -0.15]
    assert (np.abs(off) < 3 * told.sigma[2:5]).all()
    assert "accelerometer z not determined" in told.brief()


def test_a_bias_that_no_sensor_has_tells_of_the_mounting(case):  # noqa: F811
    """The sensor is turned by 90 degrees about x, so that gravity looks like two biases."""
    _, module, _, _ = case
    right, wrong = record_of(case, 1), record_of(case, 1)
    imu = wrong.channels["base_imu"][:, [0, 2, 1, 3, 5, 4, 6, 7, 8]] * [1, 1, -1, 1, 1, -1, 1, 1, 1]
    wrong = runtime.Record(
        wrong.t, wrong.q, wrong.tau, channels={**wrong.channels, "base_imu": imu}
    )
    assert problem(module, right).noted("biases").result.warnings() == ()
    (told,) = problem(module, wrong).noted("biases").result.warnings()
    assert "accelerometer y 9." in told
    assert "check mounting, units and sign in record.base" in told


def test_a_study_asks_for_biases(case, tmp_path: Path):  # noqa: F811
    _, module, _, (t, q, tau, base) = case
    head = ["t", *(f"q{j}" for j in range(1, 7)), *(f"tau{j}" for j in range(1, 7))]
    head += [*(f"b{k}" for k in range(6)), *(f"w{k}" for k in range(6))]
    table = np.column_stack([t, q, tau[:, 6:], base[:, [0, 1, 2, 6, 7, 8]], tau[:, :6]])[:400]
    np.savetxt(tmp_path / "arm.csv", table, delimiter=",", header=",".join(head), comments="")
    file = tmp_path / "study.yaml"
    text = (
        "symgen: 1\nrecord:\n  files: [arm.csv]\n"
        "  columns: {wrench: {0: [w0, w1, w2, w3, w4, w5]}}\n  base: {BASE, biases: fit}\n"
    )
    sensor = "gyroscope: [b0, b1, b2], accelerometer: [b3, b4, b5]"
    file.write_text(text.replace("BASE", sensor), encoding="utf-8")
    record = runtime.read_record(file, module)
    np.testing.assert_array_equal(record.channels["base_biases"], np.zeros((400, 6)))
    pose = "position: [b0, b1, b2], quaternion: [b2, b3, b4, b5]"
    file.write_text(text.replace("BASE", pose), encoding="utf-8")
    with pytest.raises(SettingsError, match="only gyroscope and accelerometer have biases"):
        runtime.read_record(file, module)
    channels = {"base_motion": base, "wrench0": tau[:, :6], "base_biases": np.zeros((len(t), 6))}
    with pytest.raises(InputError, match="the record has base_biases, but no base_imu"):
        runtime.estimate(module, runtime.Record(t, q, tau[:, 6:], channels=channels))
