"""Columns of the logs that people have: which are time, positions and torques, and their units."""

from __future__ import annotations

import re

import numpy as np
import pytest
from typer.testing import CliRunner

from runtime.reading.likely_columns import known_columns, likely_columns
from symgen.cli.main import app

ARM = """<robot name="arm"><link name="base"/>
<link name="a"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="b"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="0.005" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="3" effort="50"/></joint>
<joint name="elbow" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.4 0 0"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="3" effort="50"/></joint></robot>"""
JOINTS = ("shoulder", "elbow")
LOGS = {  # names with {} for the joint; time, positions, torques, others, units
    "RTDE": ("timestamp", "actual_q_{}", "actual_current_{}", ("target_q_{}", "target_current_{}", "actual_qd_{}"), {"tau": "A"}),
    "KUKA": ("Zeitstempel [ms]", "Axis {} ActPos (°)", "Axis {} Current [A]", ("Axis {} SetPos (°)", "Axis {} Temperatur"), {"t": "ms", "q": "°", "tau": "A"}),
    "German": ("Zeit [s]", "A{} Ist-Position [Grad]", "A{} Drehmoment [Nm]", ("A{} Soll-Position [Grad]", "A{} Geschwindigkeit"), {"t": "s", "q": "deg", "tau": "Nm"}),
    "French": ("Temps", "position_mesuree_axe{}", "couple_axe{}", ("vitesse_axe{}", "consigne_position_axe{}"), {}),
    "Italian": ("tempo", "posizione{}", "coppia{}", ("velocita{}",), {}),
    "commanded": ("time", "pos_meas_{}", "torque_meas_{}", ("pos_cmd_{}", "torque_cmd_{}", "vel_meas_{}"), {}),
}  # fmt: skip


@pytest.mark.parametrize("log", LOGS)
@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("by_sample", [False, True], ids=["families", "joints"])
def test_families_are_kept_apart(log: str, first: int, by_sample: bool) -> None:
    """In whatever order the file has them: target_q_0, actual_q_0, target_q_1, ..."""
    time, q, tau, others, units = LOGS[log]
    forms, numbers = [*others, q, tau], range(first, first + 6)
    names = (
        [f.format(j) for j in numbers for f in forms]
        if by_sample
        else [f.format(j) for f in forms for j in numbers]
    )
    found = likely_columns([time, *names])
    assert found["columns"] == {
        "t": time,
        "q": [q.format(j) for j in numbers],
        "tau": [tau.format(j) for j in numbers],
    }
    assert found.get("units", {}) == units


NAMED = {
    "bare names": ("t", "{}", "tau_{}"),
    "PlotJuggler": ("__time", "/joint_states/{}/position", "/joint_states/{}/effort"),
    "dots": ("time", "{}.pos", "{}.effort"),
    "German": ("Zeit", "Winkel {}", "Moment {}"),
}


@pytest.mark.parametrize("log", NAMED)
def test_names_of_the_joints(log: str) -> None:
    time, q, tau = NAMED[log]
    names = [time, *(f.format(j) for j in reversed(JOINTS) for f in (tau, q))]
    found = likely_columns(names, JOINTS)["columns"]
    assert found == {
        "t": time,
        "q": [q.format(j) for j in JOINTS],
        "tau": [tau.format(j) for j in JOINTS],
    }


@pytest.mark.parametrize(
    ("names", "columns"),
    [
        (
            ("positions", "velocities", "torques", "times", "target_positions", "base_rpy"),
            {"t": "times", "q": ["positions"], "tau": ["torques"]},
        ),
        (
            ("para.k_T", "rec.time_cont", "rec.act_pos_se_deg", "rec.act_pos_mot_deg", "rec.act_torque_abs_nm", "rec.ref_pos_deg"),
            {"t": "rec.time_cont", "q": ["rec.act_pos_mot_deg"], "tau": ["rec.act_torque_abs_nm"]},
        ),
        (("Zeit", "Strom_1", "Strom_2"), {"t": "Zeit", "tau": ["Strom_1", "Strom_2"]}),
        (("a", "b"), {}),
    ],
    ids=["arrays", "structure", "no positions", "nothing"],
)  # fmt: skip
def test_what_is_known(names: tuple[str, ...], columns: dict) -> None:
    assert known_columns(names).get("columns", {}) == columns


def test_rows_of_another_topic_are_dropped(tmp_path) -> None:
    """A logger that writes each topic in rows of its own, from file to verdict."""
    (tmp_path / "arm.urdf").write_text(ARM)
    t = np.arange(0, 15, 0.004)
    w = 2 * np.pi * np.array([0.31, 0.47])
    q = 0.8 * np.sin(w * t[:, None])
    qd, qdd = 0.8 * w * np.cos(w * t[:, None]), -(w**2) * q
    import symgen

    arm = symgen.model(tmp_path / "arm.urdf")
    X = arm.base_parameters(dict.fromkeys(arm.STANDARD_PARAMETERS, 0.0) | dict(arm.VALUES))
    tau = arm.inverse_dynamics(q, qd, qdd, X)
    forms = ("/joint_states/{}/position", "/joint_states/{}/effort")
    head = ["__time", *(f.format(j) for f in forms for j in JOINTS), "/imu/z"]
    lines = [",".join(head)]
    for k in range(len(t)):
        lines.append(",".join([f"{t[k]:.6f}", *(f"{x:.9g}" for x in (*q[k], *tau[k])), ""]))
        lines.append(f"{t[k] + 0.001:.6f},,,,,9.81")
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    study = str(tmp_path / "study.yaml")
    command = [
        "identify",
        str(tmp_path / "arm.urdf"),
        str(tmp_path / "log.csv"),
        "--suggest",
        study,
    ]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    assert re.search(r"MX1R +1\.0+ +\+- ", result.stdout)  # 3 kg at 0.2 m, 1 kg at 0.4 m


def test_a_name_of_many_digits() -> None:
    assert known_columns(["q" + "9" * 5000, "tau1"]) is not None
