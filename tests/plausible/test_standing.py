"""Joints that do not move, and joints without a motor."""

from __future__ import annotations

import numpy as np
import pytest
from campaign import campaign

import runtime
import symgen
from runtime.core.signals.cutoff import cutoff, stands
from runtime.study import Signals, study_from_mapping

T = np.arange(0, 20, 0.002)


@pytest.fixture(scope="module")
def arm():
    return symgen.model("scara")


def motion(moving, amplitude=0.4):
    """q, qd, qdd of four joints; those that are not `moving` stay at 0.2."""
    w = 2 * np.pi * np.array([0.23, 0.31, 0.43, 0.57])
    a = amplitude * np.isin(np.arange(4), moving)
    phase = w * T[:, None]
    return 0.2 + a * np.sin(phase), a * w * np.cos(phase), -a * w**2 * np.sin(phase)


@pytest.mark.parametrize(
    ("position", "still"),
    [
        (np.sin(T), False),
        (1e-5 * np.random.default_rng(0).standard_normal(len(T)), True),
        (0.0126 * (np.random.default_rng(1).uniform(size=len(T)) < 0.5), True),  # flickers
        (0.0126 * np.round(0.05 * np.sin(T) / 0.0126), False),  # nine counts
        (np.zeros(len(T)), True),
    ],
    ids=["moves", "noise", "two counts", "nine counts", "constant"],
)
def test_a_joint_stands(position, still) -> None:
    assert stands(position[:, None], 500.0)[0] == still


def test_a_standing_joint_does_not_decide_the_cutoff() -> None:
    rng = np.random.default_rng(2)
    q = np.column_stack([np.sin(3 * T), 2e-5 * rng.standard_normal(len(T))])
    alone, both = (cutoff([(x, 500.0)], Signals())[0] for x in (q[:, :1], q))
    assert alone == both


@pytest.mark.parametrize("moving", [[0], [1, 3], [0, 1, 2]])
def test_standing_joints_are_the_first_doubt(arm, moving) -> None:
    rng = np.random.default_rng(3)
    q, qd, qdd = motion(moving)
    X = np.linspace(0.5, 1.5, len(arm.BASE_PARAMETERS))
    tau = arm.inverse_dynamics(q, qd, qdd, X)
    record = runtime.Record(
        T, q + 1e-5 * rng.standard_normal(q.shape), tau + 0.02 * rng.standard_normal(q.shape)
    )
    found = runtime.plausibility(arm, record, study_from_mapping({}))
    first = next(c for c in found.checks() if c.state in ("no", "doubtful"))
    others = [str(j + 1) for j in range(4) if j not in moving]
    assert first.question == "Do the joints move?"
    assert ", ".join(others) in first.finding and "not move (1e-05 " in first.finding
    assert all(f"--lock q{j}=0.2" in first.remedy for j in others)
    assert not found.named_causes
    result = runtime.identify(arm, record, plausible=True)
    assert result.brief().startswith(first.finding) and "with --lock" in first.finding
    fit = result.model_estimate
    unknown = int(np.count_nonzero(np.abs(fit.X) <= 1.96 * fit.sigma_corrected))
    assert f" {unknown} smaller than their intervals: --verbose" in result.brief()


def test_standing_joints_are_the_next_step_where_they_leave_the_rank_too_small(arm) -> None:
    q, qd, qdd = motion([0, 1])
    tau = arm.inverse_dynamics(q, qd, qdd, np.linspace(0.5, 1.5, len(arm.BASE_PARAMETERS)))
    noise = np.random.default_rng(3).standard_normal(tau.shape)
    result = runtime.identify(arm, runtime.Record(T, q, tau + 0.02 * noise), plausible=True)
    assert result.checklist.doubt.startswith("Does the record determine the parameters? No: rank ")
    assert "convert ROBOT held.yaml --lock q3=0.2 --lock q4=0.2" in result.checklist.next


def test_a_joint_without_a_motor_is_judged_by_the_others() -> None:
    """A cart with a pendulum, in pinocchio's convention of the case: torque of the hinge zero by construction."""
    arm = symgen.model("planar_2r")
    q, qd, qdd = (x[:, :2] for x in motion([0, 1]))
    X = arm.base_parameters(arm.VALUES)
    tau = arm.inverse_dynamics(q, qd, qdd, X) * [1, 0]
    result = runtime.identify(
        arm, runtime.Record(T, q, tau + [[0.01, 0]] * np.sin(900 * T)[:, None])
    )
    assert "2 no motor" in result.brief() and "nan" not in result.brief()
    assert result.estimate.worst_joint.joint == "1"


@campaign
def test_a_word_of_the_record(tmp_path, monkeypatch) -> None:
    """`tau: [tau1, 0]` is the same record as a column of zeros."""
    monkeypatch.chdir(tmp_path)
    arm = symgen.model("planar_2r")
    q, qd, qdd = (x[:, :2] for x in motion([0, 1]))
    tau = arm.inverse_dynamics(q, qd, qdd, arm.base_parameters(arm.VALUES))
    table = np.column_stack([T, q, tau[:, 0]])
    np.savetxt("run.csv", table, delimiter=",", header="t,q1,q2,tau1", comments="")
    study = study_from_mapping(
        {
            "record": {
                "files": ["run.csv"],
                "columns": {"t": "t", "q": ["q1", "q2"], "tau": ["tau1", 0]},
            }
        }
    )
    record = runtime.read_record(study.record[0], arm)
    np.testing.assert_allclose(record.tau, tau * [1, 0], atol=1e-9)


@pytest.mark.parametrize("seconds", [1.5, 20.0])
def test_gravity_of_the_values_is_always_asked(seconds) -> None:
    """All torques with the wrong sign, in a record that is too short for causes and in one that is not."""
    arm = symgen.model("planar_2r")
    q, qd, qdd = (x[:, :2][: int(500 * seconds)] for x in motion([0, 1]))
    small = {name: 0.02 * x for name, x in arm.VALUES.items() if name[:2] in ("FV", "FS")}
    tau = -arm.inverse_dynamics(q, qd, qdd, arm.base_parameters(arm.VALUES | small))
    tau += 0.01 * np.random.default_rng(4).standard_normal(tau.shape)
    study = study_from_mapping({"signals": {"lowpass": {"cutoff": 25}}})
    found = runtime.plausibility(arm, runtime.Record(T[: len(q)], q, tau), study)
    check = next(c for c in found.checks() if c.question.startswith("Do the values"))
    assert check.state == "doubtful" and "No: " in check.finding


@pytest.mark.parametrize("stands_later", [[1], [3]])
def test_a_joint_that_stands_for_half_of_the_record_is_a_doubt(arm, stands_later) -> None:
    """Its friction is biased by rows at rest, which are left out by default; the model as a whole
    leaves 2 % unexplained.
    """
    rng = np.random.default_rng(4)
    q = motion([0, 1, 2, 3])[0]
    x = np.clip((T - 9) / 2, 0, 1)
    q[:, stands_later] *= (1 - x**3 * (10 - 15 * x + 6 * x**2))[:, None]
    qd = np.gradient(q, T, axis=0, edge_order=2)
    qdd = np.gradient(qd, T, axis=0, edge_order=2)
    tau = arm.inverse_dynamics(q, qd, qdd, np.linspace(0.5, 1.5, len(arm.BASE_PARAMETERS)))
    record = runtime.Record(
        T, q + 1e-5 * rng.standard_normal(q.shape), tau + 0.02 * rng.standard_normal(q.shape)
    )
    assert runtime.identify(arm, record, plausible=True).checklist.answer.startswith("Yes")
    every = study_from_mapping({"rows": {"low_speed": 0}})
    checklist = runtime.identify(arm, record, every, plausible=True).checklist
    assert checklist.answer == "With care" and checklist.worst is not None
    assert checklist.worst.question == "Do the joints move while they are used?"
    assert "set rows.low_speed" in checklist.next
