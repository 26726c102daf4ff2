"""Drives: one matrix for both directions, power conserved, coupling left out on request."""

import re

import numpy as np
import pytest

import runtime
import symgen
from runtime.commands import require_torques
from runtime.core.drives import Drives
from runtime.ground.errors import InputError, SettingsError
from runtime.study import study_from_mapping

RATIO = np.array([[32.0, 0, 0], [0, -48, 0], [0, 32, 45]])
OFFSET = [0, -np.pi / 2, 0.3]
CONSTANT = [0.1, 0.2, 0.05]


@pytest.fixture
def drives():
    return Drives(RATIO, OFFSET, CONSTANT)


@pytest.fixture
def q():
    return np.random.default_rng(1).normal(size=(20, 3))


def test_there_and_back(drives, q):
    np.testing.assert_allclose(drives.joint_position(drives.motor_position(q)), q, atol=1e-14)
    np.testing.assert_allclose(drives.motor_command(drives.joint_torque(q)), q, atol=1e-14)


def test_equations_written_out(drives, q):
    np.testing.assert_allclose(
        drives.motor_position(q)[:, 2], 32 * (q[:, 1] + np.pi / 2) + 45 * (q[:, 2] - 0.3)
    )
    np.testing.assert_allclose(
        drives.joint_torque(q)[:, 1], -48 * 0.2 * q[:, 1] + 32 * 0.05 * q[:, 2]
    )


def test_power_is_that_of_the_motors(drives):
    """taum' qdm = tau' qd, with qdm = R qd."""
    rng = np.random.default_rng(2)
    u, qd = rng.normal(size=(2, 20, 3))
    at_rest = drives.motor_position(np.zeros((20, 3)))
    qdm = drives.motor_position(qd) - at_rest
    np.testing.assert_allclose(
        (u * drives.torque_constant * qdm).sum(axis=1), (drives.joint_torque(u) * qd).sum(axis=1)
    )


@pytest.mark.parametrize(
    ("coupling", "position", "torque"),
    [
        ("both", True, True),
        ("position", True, False),
        ("torque", False, True),
        ("none", False, False),
    ],
)
def test_coupling_left_out(drives, q, coupling, position, torque):
    some, alone = drives.decoupled(coupling), Drives(np.diag(np.diag(RATIO)), OFFSET, CONSTANT)
    np.testing.assert_allclose(
        some.joint_position(q), (drives if position else alone).joint_position(q)
    )
    np.testing.assert_allclose(some.joint_torque(q), (drives if torque else alone).joint_torque(q))


def test_mapping_of_an_emitted_model():
    drives = Drives.from_mapping({"ratio": RATIO.tolist(), "offset": OFFSET, "torque_constant": 2})
    assert drives.torque_constant.tolist() == [2, 2, 2]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (([[1.0, 2]], 0.0, 1.0), "expected (n, n)"),
        ((np.diag([1.0, 0]), 0.0, 1.0), "singular"),
        ((np.ones((2, 2)), 0.0, 1.0), "singular"),
        ((np.eye(2), [0.0], 1.0), "offset has shape (1,)"),
        ((np.eye(2), 0.0, 0.0), "torque constant may be zero"),
        ((np.eye(2) * np.nan, 0.0, 1.0), "finite"),
    ],
)
def test_bad_drives(arguments, said):
    with pytest.raises(InputError) as e:
        Drives(*arguments)
    assert said in str(e.value)


def test_wrong_number_of_joints(drives):
    with pytest.raises(InputError, match=r"an array of shape \(5, 2\) for drives of 3 joints"):
        drives.joint_position(np.zeros((5, 2)))


def test_currents_ask_for_a_torque_constant_that_is_declared(tmp_path):
    """A constant of 1 that nobody stated fits in amperes and prints SI units."""
    text = (
        "symgen: 1\nname: one\ngravity: [0, 0, -g]\nconstants: {g: 9.81}\nframes:\n"
        "  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}\ndrives: {ratio: [[100]]%s}\n"
    )
    t = np.arange(400) / 100
    table = np.column_stack([t, np.sin(t), np.cos(t)])
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header="t,q1,tau1", comments="")
    settings = {"files": "run.csv", "torque_side": "motor", "units": {"tau": "A"}}
    for constant, refused in (("", True), (", torque_constant: 1", False)):
        (tmp_path / "one.yaml").write_text(text % constant)
        model = symgen.model(tmp_path / "one.yaml")
        record = study_from_mapping({"record": settings}).record[0]
        if refused:
            with pytest.raises(InputError, match=r"no drives.torque_constant \(N\*m/A\)"):
                runtime.read_record(record, model, folder=tmp_path)
            stated = study_from_mapping({"record": {**settings, "torque_constant": 0.5}}).record[0]
            tau = runtime.read_record(stated, model, folder=tmp_path).tau
            np.testing.assert_allclose(tau[:, 0], 50 * np.cos(t), rtol=1e-6)
        else:
            tau = runtime.read_record(record, model, folder=tmp_path).tau
            np.testing.assert_allclose(tau[:, 0], 100 * np.cos(t), rtol=1e-6)


def in_amperes(folder, **record):
    """Study of a pendulum with FV 2 A s/rad, recorded with a current."""
    (folder / "one.yaml").write_text(
        "symgen: 1\nname: one\ngravity: [g, 0, 0]\nconstants: {g: 9.81}\nframes:\n"
        "  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}\n"
        "elements: {FV: {kind: viscous, along: all}}\nvalues: {ZZ1: 1, MX1: 5}\n"
        "limits: {q: [[-3, 3]], qd: [10], tau: [0.1]}\n"
    )
    t = np.arange(4000) / 400
    q = np.sin(3 * t) + 0.7 * np.sin(7 * t)
    qd = 3 * np.cos(3 * t) + 4.9 * np.cos(7 * t)
    qdd = -9 * np.sin(3 * t) - 34.3 * np.sin(7 * t)
    tau = 0.3 * qdd + 0.1 * 9.81 * np.sin(q) + 2 * qd
    tau += 0.01 * np.random.default_rng(1).standard_normal(tau.shape)
    table = np.column_stack([t, q, tau])
    np.savetxt(folder / "run.csv", table, delimiter=",", header="t,q1,tau1", comments="")
    settings = {"files": "run.csv", "units": {"tau": "A"}, "torque_constant": "none", **record}
    return study_from_mapping({"record": settings})


@pytest.mark.parametrize(("given", "unit"), [("A", "A"), ("V", "V")])
def test_a_fit_in_amperes_is_printed_in_amperes(tmp_path, given, unit):
    """Values of the robot file and its limits are in N m, so nothing is compared with them."""
    study = in_amperes(tmp_path, units={"tau": given})
    model = symgen.model(tmp_path / "one.yaml")
    record = runtime.read_record(study.record[0], model, folder=tmp_path)
    result = runtime.identify(model, record, study)
    assert result.estimate.units == {
        "ZZ1": f"{unit}*s**2/rad",
        "MX1": f"{unit}*s**2/m",
        "MY1": f"{unit}*s**2/m",
        "FV1": f"{unit}*s/rad",
    }
    assert result.estimate.X[-1] == pytest.approx(2, rel=1e-2)
    text = str(result)
    assert f"{unit}*s/rad" in text and "N*m" not in text and "N m" not in text and "kg" not in text
    runtime.report(result, tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text()
    assert not re.search(r"\d N m\b|torque, N m|limits.tau at", page)
    with pytest.raises(InputError, match=rf"the estimate is in {unit} .*record.torque_constant"):
        require_torques(result.estimate)


def test_records_in_amperes_go_with_records_in_amperes(tmp_path):
    study = in_amperes(tmp_path)
    model = symgen.model(tmp_path / "one.yaml")
    amperes = runtime.read_record(study.record[0], model, folder=tmp_path)
    torques = runtime.read_record(tmp_path / "run.csv", model)
    with pytest.raises(InputError, match="some records are in A, others in N m"):
        runtime.identify(model, [amperes, torques], study)
    with pytest.raises(SettingsError, match=r"units.tau is N\*m"):
        in_amperes(tmp_path, units={"tau": "N*m"})
