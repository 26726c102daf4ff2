"""Force sensors below a robot and ahead of a link: parameters from wrenches that pinocchio computes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import planar_arm
import pytest
from campaign import campaign, sampled

import runtime
import symgen
from oracles.applying import motion
from oracles.pinocchio_model import PinocchioModel
from runtime import compose
from runtime.ground.errors import InputError
from runtime.study import study_from_mapping
from runtime.wrench import WrenchModel

OPTION = ("base_wrench_regressor",)
STUDY = study_from_mapping(
    {"signals": {"median": 1, "lowpass": None, "decimate": None}, "rows": {"trim": 20}}
)
BIAS = np.array([3.0, -2.0, 5.0, 0.4, -0.3, 0.2])
SIGMA = np.array([0.2, 0.3, 0.5, 0.02, 0.03, 0.05])
AXES = ("FX", "FY", "FZ", "NX", "NY", "NZ")


def wrench_ahead_of(oracle: Any, chi: Any, j: int, *state: Any) -> Any:
    """Force and moment on joint j, in its frame; on the base as the torques of a free flyer."""
    oracle._set_inertias(chi)
    q, qd, qdd = map(oracle._full, state)
    if j:
        pin.rnea(oracle.model, oracle.data, q, qd, qdd)
        return oracle.data.f[oracle.joint[j]].vector.copy()
    root = pin.Model()
    root.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    root.addFrame(pin.Frame("base", 1, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    free = pin.appendModel(root, oracle.model, 1, pin.SE3.Identity())
    free.gravity = oracle.model.gravity
    at_rest = np.zeros(6)
    q = np.concatenate([[0, 0, 0, 0, 0, 0, 1], q])
    return pin.rnea(free, free.createData(), q, np.append(at_rest, qd), np.append(at_rest, qdd))[:6]


def measured(name: str, sensor: int = 0) -> tuple[Any, Any, Any]:
    """(module, standard parameters, record without noise), 1 kHz."""
    robot = symgen.load_robot(name)
    model, oracle = symgen.model(robot, options=OPTION), PinocchioModel(robot)
    chi = np.random.default_rng(4).uniform(0.2, 1.0, len(robot.parameters))
    t, *states = motion(len(robot.joints), 3, 6.0, 1000.0)
    tau = np.array([oracle.torque(*x, chi) for x in zip(*states, strict=True)])
    wrench = [wrench_ahead_of(oracle, chi, sensor, *x) for x in zip(*states, strict=True)]
    channels = {f"wrench{sensor}": np.array(wrench) + BIAS}
    return model, chi, runtime.Record(t, states[0], tau, rate=1000.0, channels=channels)


@pytest.mark.parametrize("name", sampled(["planar_2r", "scara", "tx40", "two_branch"], 2))
def test_columns_are_those_of_a_floating_base_and_of_a_cut_joint(name: str) -> None:
    robot = symgen.load_robot(name)
    oracle, rng = PinocchioModel(robot), np.random.default_rng(1)
    n, last = len(robot.joints), robot.links[-1]
    wide = WrenchModel(symgen.model(robot, options=OPTION), (0, 1, last), True)
    chi = rng.uniform(0.2, 1.0, len(robot.parameters))
    X = wide.base_parameters(np.concatenate([chi, BIAS, 2 * BIAS, 3 * BIAS]))
    states = rng.uniform(-2, 2, (3, 20, n + 18))
    result = wide.inverse_dynamics(*states, X)
    for k, state in enumerate(np.swapaxes(states[..., :n], 0, 1)):
        wrenches = [wrench_ahead_of(oracle, chi, j, *state) for j in (0, 1, last)]
        expected = np.concatenate(
            [oracle.torque(*state, chi), *((i + 1) * BIAS + w for i, w in enumerate(wrenches))]
        )
        np.testing.assert_allclose(result[k], expected, atol=1e-10 * np.abs(expected).max())
    W = wide.observation_matrix(*states)
    assert np.linalg.matrix_rank(W / np.linalg.norm(W, axis=0)) == W.shape[1]
    assert (W.reshape(n + 18, 20, -1)[:, :, :].any(axis=1).T <= wide.STRUCTURE).all()


@pytest.mark.parametrize("torques", [True, False])
def test_parameters_come_back(torques: bool) -> None:
    model, chi, record = measured("planar_2r")
    record = (
        record
        if torques
        else runtime.Record(
            record.t, record.q, 0 * record.tau, rate=1000.0, channels=record.channels
        )
    )
    wide = runtime.problem(model, record, STUDY).model
    fit = runtime.estimate(model, record, STUDY)
    true = dict(zip(wide.BASE_PARAMETERS, wide.base_parameters([*chi, *BIAS]), strict=True))
    assert fit.status == "ok" and fit.names == wide.BASE_PARAMETERS
    # differences of positions at 1 kHz err by (w T)**2/6 of a rate: 5e-6; a sign at a reversal is
    # that of the difference
    for name, x in true.items():
        assert fit[name] == pytest.approx(x, abs=2e-2), name
    names = {name.removesuffix("R") for name in true}
    joint = {name.removesuffix("R") for name in model.BASE_PARAMETERS}
    assert {"XZ1", "YZ1", "M1"} <= names - joint  # what the wrench alone knows
    assert torques == ("FV1" in names)
    assert (joint <= names) if torques else not joint <= names
    assert wide.UNITS["MX1R"] == "kg*m" and wide.UNITS["BFX0"] == "N"


def test_a_file_names_six_columns_and_a_wrist_knows_what_is_behind_it(tmp_path: Path) -> None:
    """By identify, without torques; the sensor reports what the links do to it."""
    model, chi, record = measured("tx40", 6)
    rng = np.random.default_rng(2)
    wrench = record.channels["wrench6"] + SIGMA * rng.standard_normal((len(record.t), 6))
    table = np.column_stack([record.t, record.q, -wrench])
    head = ["t", *(f"q{j}" for j in range(1, 7)), *AXES]
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header=",".join(head), comments="")
    study = study_from_mapping(
        {
            "record": {
                "files": ["run.csv"],
                "columns": {"wrench": {6: list(AXES)}},
                "scale": {"wrench": -1},
            },
            "signals": {"median": 1},
        }
    )
    read = runtime.read_record(study.record[0], model, folder=tmp_path)
    np.testing.assert_allclose(read.channels["wrench6"], wrench, rtol=1e-12)
    result = runtime.identify(model, read, study, physical=True, plausible=True)
    assert any(
        "check of record and study does not support force sensors" in text
        for text in result.missing
    )
    fit, X = result.estimate, result.model.base_parameters([*chi, *BIAS])
    assert len(fit.names) == 16 and result.determined and result.usable
    assert all(name.removesuffix("R")[-1] == "6" for name in fit.names)
    z = (fit.X - X) / fit.sigma_corrected
    assert np.abs(z).max() < 5, dict(zip(fit.names, z, strict=True))
    rows = [joint.rows for joint in fit.per_joint]
    assert rows[:6] == [0] * 6 and min(rows[6:]) > 50
    text = result.brief()
    assert "NZ6" in text and "a torque that was not measured leaves all these rows out" in text
    assert "nan" not in text


@campaign
@pytest.mark.parametrize("name", ["planar_2r", "scara"])
def test_deviations_by_row_group(name: str) -> None:
    """Weights and deviations of each of the six; scatter of 40 records within what is stated."""
    model, chi, record = measured(name)
    rng, z = np.random.default_rng(5), []
    for _ in range(40):
        wrench = record.channels["wrench0"] + SIGMA * rng.standard_normal((len(record.t), 6))
        tau = record.tau + 0.1 * rng.standard_normal(record.tau.shape)
        channels = {"wrench0": wrench}
        noisy = runtime.Record(record.t, record.q, tau, rate=1000.0, channels=channels)
        wide = runtime.problem(model, noisy, STUDY).model
        fit = runtime.estimate(model, noisy, STUDY)
        z.append((fit.X - wide.base_parameters([*chi, *BIAS])) / fit.sigma)
    scales = np.array([joint.scale for joint in fit.per_joint])
    np.testing.assert_allclose(scales[-6:], SIGMA, rtol=0.05)
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.1)


def test_what_is_missing_is_said() -> None:
    model, _, record = measured("planar_2r")
    bare = runtime.Record(record.t, record.q, record.tau, rate=1000.0, name="bare")
    with pytest.raises(InputError, match="three moments of the sensor in frame 0"):
        runtime.problem(model, [record, bare], STUDY)
    with pytest.raises(InputError, match="--with base_wrench_regressor"):
        runtime.identify(symgen.model("planar_2r"), record, STUDY)
    counts = study_from_mapping({"signals": {"reader": "counts"}})
    with pytest.raises(InputError, match="reader: counts does not support force sensors"):
        runtime.identify(model, record, counts)
    elsewhere = runtime.Record(
        record.t, record.q, record.tau, rate=1000.0, channels={"wrench9": np.ones((6000, 6))}
    )
    with pytest.raises(
        InputError, match="a wrench in frame 9 of planar_2r is not possible: no such frame"
    ):
        runtime.identify(model, elsewhere, STUDY)
    assert runtime.problem(model, bare, STUDY).model is model


def test_amperes_beside_a_force_sensor_are_refused(tmp_path: Path) -> None:
    """Both share parameters: ZZ1R was 1.53 kg m^2 for 0.718. A wrench alone has no torque unit."""
    model = planar_arm.arm(options=OPTION)
    run = planar_arm.record(model, 0)
    names = [axis.lower() for axis in AXES]
    wrench = np.random.default_rng(0).standard_normal((len(run.t), 6))
    file = planar_arm.written(tmp_path / "run.csv", run, "," + ",".join(names), wrench)
    columns = {"t": "t", "q": ["q1", "q2"], "tau": ["tau1", "tau2"], "wrench": {0: names}}
    amperes = {"torque_constant": "none", "units": {"tau": "A"}}
    study = planar_arm.study(record={"files": file, "columns": columns, **amperes})
    records = compose.records_of(study.record, model, study)
    with pytest.raises(InputError, match="joint torques are in A, but the force sensor measures N"):
        runtime.identify(model, records, study)
    study = planar_arm.study(record={"files": file, "columns": {**columns, "tau": []}, **amperes})
    (alone,) = compose.records_of(study.record, model, study)
    # tau1 and tau2 of the file are read by their names
    assert alone.origin.command == "A"
    np.savetxt(tmp_path / "wrench.csv", np.column_stack([run.t, run.q, wrench]), "%.12g", ",",
               header=",".join(["t,q1,q2", *names]), comments="")  # fmt: skip
    file = str(tmp_path / "wrench.csv")
    study = planar_arm.study(record={"files": file, "columns": {**columns, "tau": []}, **amperes})
    (alone,) = compose.records_of(study.record, model, study)
    assert alone.origin.command == ""
    assert runtime.estimate(model, alone, study).units["BFX0"] == "N"
