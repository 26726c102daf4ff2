"""Torques that exist only as the law of a controller: those of an own integration of the arm come
back, from files whole and by blocks, and so do its parameters.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import planar_2r_model as planar
import planar_arm
import pytest
from campaign import campaign
from planar_data import TRUE, motion
from scipy.integrate import solve_ivp

from runtime import InputError, identify
from runtime.core.parameter_sets import Sets
from runtime.ground.errors import SettingsError
from runtime.ground.settings import to_mapping
from runtime.reading.records import read_records
from runtime.study import study_from_mapping

RATE, N = 200.0, 3000
KP, KD = np.array([400.0, 120.0]), np.array([30.0, 8.0])
FREE = np.where([name.startswith("FS") for name in planar.BASE_PARAMETERS], 0.0, TRUE)
COLUMNS = {"t": "t", "q": ["q1", "q2"], "q_ref": ["r1", "r2"]}


def reference(t):
    """Positions and velocities that the loop follows, (2,) each."""
    w, phase = np.array([[2.0, 5.3], [2.7, 6.1]]), np.array([[0.3, 1.1], [0.9, 0.2]])
    a = np.array([[0.8, 0.25], [0.9, 0.3]])
    return (a * np.sin(w * t + phase)).sum(1), (a * w * np.cos(w * t + phase)).sum(1)


@cache
def simulated(feed=0.0, moving=True, cut=(np.inf, np.inf)):
    """t, q, qd, q_ref, qd_ref, tau_ff of the arm under its law, integrated by scipy; the inertia
    matrix from the rows of unit accelerations. moving : whether the law follows qd_ref. cut : the
    largest torques of the drives.
    """

    def torque(t, x):
        q_r, qd_r = reference(t)
        law = KP * (q_r - x[:2]) + KD * ((qd_r if moving else 0) - x[2:]) + feed * np.sin(3 * t)
        return np.clip(law, -np.array(cut), cut)

    def rate(t, x):
        D = planar.regressor(
            np.tile(x[:2], (3, 1)), np.tile(x[2:], (3, 1)), np.vstack([np.zeros(2), np.eye(2)])
        )
        h, *columns = D @ FREE
        M = np.column_stack([column - h for column in columns])
        return np.concatenate([x[2:], np.linalg.solve(M, torque(t, x) - h)])

    t = np.arange(N) / RATE
    start = np.concatenate(reference(0.0))
    x = solve_ivp(rate, (0, t[-1]), start, "DOP853", t, rtol=1e-10, atol=1e-12).y.T
    followed = np.array([np.concatenate(reference(time)) for time in t])
    tau_ff = np.repeat(feed * np.sin(3 * t)[:, None], 2, axis=1)
    return t, x[:, :2], x[:, 2:], followed[:, :2], followed[:, 2:] * moving, tau_ff


def logged():
    """What was logged in the loop with a feed-forward of 5 N m."""
    return simulated(feed=5.0)


def written(folder, log=None, **study):
    """The study of a file run.npz that holds a log; default: what was `logged`."""
    t, q, qd, r, rd, ff = log or logged()
    named = {"t": t, "q": q, "v": qd, "r": r, "rd": rd, "ff": ff}
    np.savez(folder / "run.npz", **named)
    columns = {"t": "t", "q": "q", "qd": "v", "q_ref": "r", "qd_ref": "rd", "tau_ff": "ff"}
    record = {"files": str(folder / "run.npz"), "columns": columns}
    law = {"controller": {"kp": KP.tolist(), "kd": KD.tolist()}}
    return study_from_mapping({"record": record, **law, **study})


def law_torque(log=None):
    _, q, qd, r, rd, ff = log or logged()
    return KP * (r - q) + KD * (rd - qd) + ff


@campaign
def test_the_law_is_the_torque(tmp_path):
    study = written(tmp_path)
    (record,) = read_records(study.record)
    np.testing.assert_allclose(record.tau, law_torque(), rtol=1e-12, atol=1e-12)
    assert study_from_mapping(to_mapping(study)) == study


def test_without_recorded_velocities_differences_stand_for_them(tmp_path):
    t, q, _, r, *_ = logged()
    table = np.column_stack([t, q, r])
    np.savetxt(tmp_path / "a.csv", table, "%.17g", ",", header="t,q1,q2,r1,r2", comments="")
    study = study_from_mapping(
        {
            "record": {"files": str(tmp_path / "a.csv"), "columns": COLUMNS},
            "controller": {
                "law": {"kp": 300, "kd": 8, "gain": 2},
                "torque": {"saturation": [50, 9]},
            },
        }
    )
    (record,) = read_records(study.record)
    qd = np.diff(q, axis=0, prepend=q[:1]) * record.rate
    expected = np.clip(600 * (r - q) - 16 * qd, [-50, -9], [50, 9])
    np.testing.assert_allclose(record.tau, expected, rtol=1e-9, atol=1e-9)


def test_parameters_of_an_arm_whose_torque_is_its_law(tmp_path):
    """Its own integration returns the truth, also predicted by a study's further record."""
    study = written(
        tmp_path,
        signals={"median": 1, "lowpass": {"cutoff": 20}},
        validate={"record": written(tmp_path).record},
    )
    records = read_records(study.record, planar)
    estimate = identify(planar, records, study, plausible=False).estimate
    np.testing.assert_allclose(estimate.X, FREE, atol=2e-3 * np.abs(TRUE).max())


@pytest.mark.parametrize(
    ("record", "controller", "said"),
    [
        ({}, None, "controller: {kp: ..., kd: ...}"),
        ({}, {"kp": 10, "law": {"kp": 10}}, "are short for law"),
        (
            {},
            {"law": {"kp": 10, "ki": 3}},
            "controller.law.ki: an integral gain ki (3.0) is not supported here",
        ),
        ({}, {"kp": [1, 2, 3]}, "3 values are given; expected one value, or 2 values"),
        ({}, {"kd": 1}, "expected a gain other than 0 for every joint"),
        ({"qd_ref": ["q1"]}, {"kp": 10}, "1 reference velocities (q1); expected 2"),
        ({"qr": ["q1", "q2"]}, {"kp": 10}, "given together with q_ref"),
    ],
)
def test_what_is_no_law_is_refused(tmp_path, record, controller, said):
    (tmp_path / "a.csv").write_text("t,q1,q2,r1,r2\n" + "0,0,0,0,0\n" * 20)
    given = {"record": {"files": "a.csv", "columns": {**COLUMNS, **record}}}
    with pytest.raises((InputError, SettingsError)) as e:
        study = study_from_mapping(given | ({"controller": controller} if controller else {}))
        read_records(study.record, folder=tmp_path)
    assert said in str(e.value)


def test_a_simulated_loop_needs_a_number(tmp_path):
    from runtime.loop.control_law import control_law
    from runtime.loop.settings import Controller

    with pytest.raises(SettingsError, match="identify the record first"):
        control_law(Controller(kp=10, kd="fit"), planar)


LATE, GAIN = 0.0042, np.array([3.0, 1.2])


def logged_early(folder, *, late=LATE, moving=True, noise=0.05, **law):
    """A study of signals that a law with kd = GAIN turns into the torque `late` s afterwards:
    kp (q_ref - q) + kd (qd_ref - qd) at t is the torque of the motion at t + late.
    """
    t, rng = np.arange(8000) / 500.0, np.random.default_rng(3)
    (q, qd, _), later = motion(t), motion(t + late)
    tau = (planar.observation_matrix(*later) @ TRUE).reshape(2, -1).T
    rd = qd + 2 * np.sin(np.outer(t, [5.0, 7.0])) if moving else np.zeros_like(qd)
    r = q + (tau + noise * rng.standard_normal(tau.shape) - GAIN * (rd - qd)) / KP
    np.savez(folder / "run.npz", t=t, q=q, v=qd, r=r, rd=rd)
    columns = {"t": "t", "q": "q", "qd": "v", "q_ref": "r", "qd_ref": "rd"}
    return study_from_mapping(
        {
            "record": {"files": str(folder / "run.npz"), "columns": columns},
            "controller": {"law": {"kp": KP.tolist(), **law}},
            "signals": {"median": 1, "lowpass": {"cutoff": 40}},
            "rows": {"low_speed": 0.1},
        }
    )


def identified(study):
    return identify(planar, read_records(study.record), study, plausible=False)


def test_kd_and_delay_are_found_with_the_parameters(tmp_path):
    result = identified(logged_early(tmp_path, kd="fit", delay="fit"))
    law = result.estimate.provenance["law"]
    np.testing.assert_array_less(np.abs(law["kd"] - GAIN), 4 * law["sigma"])
    assert law["sigma"].max() < 0.02 and abs(law["delay"] - LATE) < 4 * law["sigma_delay"] < 4e-4
    np.testing.assert_allclose(result.estimate.X, TRUE, rtol=0.03, atol=0.03)
    assert "after the logged signals (fit)" in str(result) and "kd 3" in str(result)


def test_a_stated_delay_and_gain_serve_as_the_found_ones(tmp_path):
    study = logged_early(tmp_path, kd=GAIN.tolist(), delay=LATE, noise=0.0)
    result = identified(study)
    np.testing.assert_allclose(result.estimate.X, TRUE, rtol=0.02, atol=0.02)
    wrong = identified(logged_early(tmp_path, kd=GAIN.tolist(), delay=0.0, noise=0.0))
    assert result.estimate.relative_error < 0.2 * wrong.estimate.relative_error


def test_kd_beside_a_reference_at_rest_is_told(tmp_path):
    """Its column is that of FV: a sentence, FV the sum of both."""
    result = identified(logged_early(tmp_path, kd="fit", moving=False, late=0.0))
    law = result.estimate.provenance["law"]
    assert np.isnan(law["kd"]).all() and abs(law["delay"]) < 3 * law["sigma_delay"]
    assert "kd and FV of joint 1, 2 cannot be separated" in result.brief()
    viscous = [result.estimate["FV1"], result.estimate["FV2"]]
    np.testing.assert_allclose(viscous, GAIN + TRUE[[3, 8]], rtol=0.02)


def test_the_sign_of_a_sum_of_kd_and_friction_is_not_judged(tmp_path):
    """The reference is 1.1 qd: the torque lacks 0.8 qd of kd = 8, and "FV1, FV2 below zero" was
    said: "a sign of the joint is wrong".
    """
    model = planar_arm.arm()
    t, q, qd, qdd = planar_arm.motion(0)
    tau = model.inverse_dynamics(q, qd, qdd, planar_arm.parameters(model))
    followed = q + (tau + 8.0 * qd - 8.0 * 1.1 * qd) / 200.0
    np.savez(tmp_path / "law.npz", t=t, q=q, v=qd, r=followed, rd=1.1 * qd)
    columns = {"t": "t", "q": "q", "qd": "v", "q_ref": "r", "qd_ref": "rd"}
    study = planar_arm.study(
        record={"files": str(tmp_path / "law.npz"), "columns": columns},
        controller={"law": {"kp": 200.0, "kd": "fit"}},
    )
    runs = read_records(study.record, model)
    result = identify(model, runs, study, plausible=True, physical=True)
    np.testing.assert_allclose(
        [result.estimate["FV1"], result.estimate["FV2"]], [-0.3, -0.5], atol=0.01
    )
    assert result.negative == () and result.checklist.state == "good", result.checklist.doubt
    elements = result.model.ELEMENTS
    assert elements["FV1"][0] == "column" and elements["FS1"][0] == "coulomb"


@pytest.mark.parametrize("moving", [True, False])
def test_the_saturation_is_in_force_where_kd_is_found(tmp_path, moving):
    """Drives that cut a tenth of the samples: the torque of the record stays within the limit, kd is
    that of the loop, even where the reference velocity does not move, and the error that of the
    stated kd. Without the saturation the record said twice the torque.
    """
    cut = (53.2, 15.7) if moving else (51.4, 15.2)  # N m, 0.9 quantiles of the uncut torque
    log = simulated(moving=moving, cut=cut)
    errors = {}
    for kd in (KD.tolist(), "fit"):
        study = written(
            tmp_path,
            log,
            controller={
                "law": {"kp": KP.tolist(), "kd": kd, "delay": 0},
                "torque": {"saturation": list(cut)},
            },
            signals={"median": 1, "lowpass": {"cutoff": 40}},
        )
        result = identified(study)
        errors[str(kd)] = result.estimate.relative_error
        assert 0.05 < (np.abs(result.records[0].tau) > 0.999 * np.array(cut)).mean() < 0.4
        assert np.abs(result.records[0].tau).max(axis=0) == pytest.approx(cut)
    found = result.estimate.provenance["law"]
    np.testing.assert_allclose(found["kd"], KD, rtol=1e-3)
    assert errors["fit"] == pytest.approx(errors[str(KD.tolist())], rel=0.02)


def test_every_entry_point_has_the_torque_of_the_found_law(tmp_path):
    """Estimate and cestac took the torque without kd, or refused."""
    from runtime import cestac, estimate
    from runtime.study import CestacSettings

    settings = CestacSettings(delta=(1e-6,), runs=2, columns="all")
    study = replace(logged_early(tmp_path, kd="fit"), cestac=settings)
    records = read_records(study.record)
    known = identified(study)
    assert "law_v" not in known.records[0].channels
    np.testing.assert_allclose(estimate(planar, records, study).X, known.estimate.X, rtol=1e-9)
    reference = cestac(planar, records, study).reference
    np.testing.assert_allclose(reference.X, known.estimate.X, rtol=0.02, atol=0.01)


def test_coverage_of_the_stated_deviation(tmp_path):
    """Scatter of kd over noise against its deviation."""
    errors = []
    for seed in range(12):
        study = logged_early(tmp_path, kd="fit", noise=0.0, late=0.0)
        (record,) = read_records(study.record)
        noise = 1.0 * np.random.default_rng(seed).standard_normal(record.tau.shape)
        law = identify(
            planar, replace(record, tau=record.tau + noise), study, plausible=False
        ).estimate.provenance["law"]
        errors.append(np.concatenate([law["kd"], law["sigma"]]))
    kd, sigma = np.array(errors)[:, :2], np.array(errors)[:, 2:]
    ratio = kd.std(axis=0, ddof=1) / sigma.mean(axis=0)
    assert ((ratio > 0.4) & (ratio < 1.7)).all(), ratio


def test_gains_in_other_units_are_told(tmp_path):
    """kd of twice the size; FV below zero is told as a gain; nothing of right ones."""
    wrong = identified(logged_early(tmp_path, kd=(20 * GAIN).tolist(), late=0.0))
    assert "With kd 3" in wrong.brief() and "in other units" in wrong.brief()
    right = identified(logged_early(tmp_path, kd=GAIN.tolist(), late=0.0))
    assert "in other units" not in right.brief()


def test_friction_below_zero_is_told_as_a_gain(tmp_path):
    """The reference velocity at rest: a kd too large by 5 is friction of -5 and more."""
    import symgen

    model, t = symgen.model("planar_2r"), np.arange(5000) / 500.0
    q, qd, qdd = motion(t)
    tau = model.inverse_dynamics(q, qd, qdd, model.base_parameters(model.VALUES))
    np.savez(tmp_path / "run.npz", t=t, q=q, v=qd, r=q + (tau + GAIN * qd) / KP)
    columns = {"t": "t", "q": "q", "qd": "v", "q_ref": "r"}
    study = study_from_mapping(
        {
            "record": {"files": str(tmp_path / "run.npz"), "columns": columns},
            "controller": {"kp": KP.tolist(), "kd": (GAIN + 5).tolist()},
            "signals": {"median": 1, "lowpass": {"cutoff": 40}},
        }
    )
    result = identify(model, read_records(study.record, model), study, plausible=False)
    all_of_them = result.sets["all"]
    assert all_of_them["FV1"] == pytest.approx(model.VALUES["FV1"] - 5, abs=0.2)
    told = replace(result, sets=Sets(all_of_them)).own_warnings
    assert any("kd of the law is larger than that of the drive" in text for text in told)


def test_the_delay_is_fitted_by_default_and_told_first(tmp_path):
    """A law whose torque acts 4.2 ms later, and a right one whose interval contains 0."""
    late = identified(logged_early(tmp_path, kd=GAIN.tolist()))
    law = late.estimate.provenance["law"]
    assert abs(law["delay"] - LATE) < 3 * law["sigma_delay"] < 1e-3
    assert str(late).startswith("The torque of the law comes 4.")
    right = identified(logged_early(tmp_path, kd=GAIN.tolist(), late=0.0))
    law = right.estimate.provenance["law"]
    assert abs(law["delay"]) < 1.96 * law["sigma_delay"]
    given = identified(logged_early(tmp_path, kd=GAIN.tolist(), delay=0.0))
    assert "law" not in given.estimate.provenance
    assert late.estimate.relative_error < 0.5 * given.estimate.relative_error
