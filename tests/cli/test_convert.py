"""`symgen convert`: by suffix, whole or not at all, with a report; verbs take the formats too."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from runtime.core.least_squares.estimate import Estimate
from symgen.cli.main import app
from symgen.description import load_robot


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


PAR = Path(__file__).parents[1] / "description" / "par_files" / "planar_2r.par"


def test_a_par_file_becomes_a_robot_file(tmp_path):
    file = tmp_path / "arm.yaml"
    assert run("convert", PAR, file).exit_code == 0
    assert load_robot(file).frames == load_robot("planar_2r").frames == load_robot(PAR).frames
    shown = [json.loads(run("show", source, "--json").stdout) for source in (PAR, file)]
    assert shown[0] == shown[1] and shown[0]["count"] > 10


def test_never_overwrites_unless_told(tmp_path):
    file = tmp_path / "arm.yaml"
    file.write_text("mine")
    result = run("convert", "rx90", file)
    assert result.exit_code == 2 and "--force" in result.stderr and file.read_text() == "mine"
    assert run("convert", "rx90", file, "--force").exit_code == 0 and "RL4" in file.read_text()


def test_nothing_is_written_for_another_mechanism(tmp_path):
    result = run("convert", "sr400", tmp_path / "sr400.urdf")
    assert result.exit_code == 2 and "is a tree" in result.stderr and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("rx90", "arm.txt"), "expected a file name"),
        (("rx90", "arm.par"), "expected a file name"),
        (("nothing.par", "arm.yaml"), "no file"),
        (("rx90", "arm.yaml", "--constant", "D3"), "NAME=NUMBER"),
        (("rx90", "arm.yaml", "--constant", "D3=1/0"), "division by zero"),
    ],
)
def test_bad_input(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run("convert", *arguments)
    assert result.exit_code == 2 and words in result.stderr and list(tmp_path.iterdir()) == []


def test_constants_of_a_foreign_file(tmp_path):
    file = tmp_path / "arm.par"
    lines = PAR.read_text().splitlines()
    file.write_text("\n".join(line for line in lines if not line.startswith("(* constants")))
    result = run("convert", file, tmp_path / "arm.yaml")
    assert result.exit_code == 2 and "--constant" in result.stderr
    names = load_robot("planar_2r").constants
    options = [part for name in names for part in ("--constant", f"{name}=3/2")]
    assert run("convert", file, tmp_path / "arm.yaml", *options).exit_code == 0
    assert set(load_robot(tmp_path / "arm.yaml").constants.values()) == {1.5}


ARM = """\
<robot name="arm"><link name="base"/>
<link name="a"><inertial><origin xyz="0.1 0 0.05"/><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.015"/></inertial></link>
<link name="b"><inertial><origin xyz="0 0.1 0"/><mass value="1"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.015"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>\
<dynamics damping="0.3"/>
<limit lower="-1" upper="1" velocity="2" effort="30"/></joint>
<joint name="elbow" type="continuous"><parent link="a"/><child link="b"/>\
<origin xyz="0.4 0 0" rpy="1.5708 0 0"/><axis xyz="0 0 1"/>
<limit velocity="2" effort="30"/></joint>
</robot>
"""


def test_urdf_and_back(tmp_path):
    file, table, again = tmp_path / "arm.urdf", tmp_path / "arm.yaml", tmp_path / "again.urdf"
    file.write_text(ARM)
    result = run("convert", file, table)
    assert (
        result.exit_code == 0
        and "q1 = 'shoulder', q2 = 'elbow'" in result.stdout
        and "limits of q left out" in result.stdout
    )
    robot = load_robot(table)
    assert (
        str(robot.frame(2).alpha) == "pi/2"
        and robot.values["FV1"] == 0.3
        and robot.values["M1"] == 2
    )
    change = "roll of joint 'elbow' (line 8) from 1.5708 to pi/2, by -3.7e-06 rad"
    assert (
        change in " ".join(result.stderr.split())
        and change not in result.stdout
        and f"# snapped: {change}" in table.read_text()
    )
    assert load_robot(file).frames == robot.frames and change in " ".join(
        run("check", file).stderr.split()
    )
    result = run("convert", file, tmp_path / "as_it_is.yaml", "--exact")
    assert (
        "snapped" not in result.stderr
        and str(load_robot(tmp_path / "as_it_is.yaml").frame(2).alpha) == "1.5708"
    )
    assert "are those of arm.urdf" in (tmp_path / "as_it_is.yaml").read_text()
    result = run("convert", table, again)
    assert result.exit_code == 0 and "formulas are not carried" in result.stdout
    assert load_robot(again).values == pytest.approx(robot.values, abs=1e-12)


def test_locked_joints_and_chains(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(ARM)
    result = run("convert", file, tmp_path / "a.yaml", "--lock", "elbow=pi/2")
    assert (
        result.exit_code == 0
        and "held: elbow at 1.5708" in result.stdout
        and load_robot(tmp_path / "a.yaml").labels == {1: "shoulder"}
    )
    result = run("convert", file, tmp_path / "b.yaml", "--chain", "base", "a")
    assert (
        result.exit_code == 0
        and "chain from 'base' to 'a': shoulder move" in result.stdout
        and "held at zero: elbow" in result.stdout
    )
    result = run("convert", file, tmp_path / "c.yaml", "--chain", "a", "b")
    assert result.exit_code == 0 and "held at zero: shoulder" in result.stdout
    wrong = {
        ("--lock", "wrist=0"): "no moving joint 'wrist' to lock",
        ("--lock", "elbow"): "NAME=NUMBER",
        ("--chain", "b", "a"): "the base link of the chain first",
        ("--chain", "a", "tool"): "no link",
    }
    for options, words in wrong.items():
        result = run("convert", file, tmp_path / "d.yaml", *options)
        assert (
            result.exit_code == 2 and words in result.stderr and not (tmp_path / "d.yaml").exists()
        )
    result = run("convert", "tx40", tmp_path / "d.yaml", "--lock", "q1=0")
    assert result.exit_code == 2 and "edit the frames" in result.stderr


def test_kept_frames_are_named(tmp_path):
    """A flange stays a frame: its number in the report, its pose in the models."""
    file, table = tmp_path / "arm.urdf", tmp_path / "arm.yaml"
    flange = (
        '<link name="tool0"/><joint name="f" type="fixed"><parent link="b"/><child '
        'link="tool0"/><origin xyz="0 0.3 0"/></joint></robot>'
    )
    file.write_text(ARM.replace("</robot>", flange))
    result = run("convert", file, table, "--keep-fixed")
    assert result.exit_code == 0 and "fixed frames: frame 3 = 'tool0'" in result.stdout
    assert (
        load_robot(table).frames == load_robot(file, keep_fixed=True).frames
        and len(load_robot(file).frames) == 2
    )


def test_values_of_an_estimate_go_into_the_urdf(tmp_path):
    file, csv = tmp_path / "arm.urdf", tmp_path / "standard_parameters.csv"
    file.write_text(ARM)
    csv.write_text("name,value,note\nM2,1.25,NOT determined: 1 to 9 kg\nFS2,0.5,\n")
    assert run("convert", file, tmp_path / "new.urdf", "--values", csv).exit_code == 0
    values = load_robot(tmp_path / "new.urdf").values
    assert values["M2"] == 1.25 and values["FS2"] == 0.5 and values["FV1"] == 0.3
    csv.write_text("M2,heavy\n")
    result = run("convert", file, tmp_path / "bad.urdf", "--values", csv)
    assert (
        result.exit_code == 2 and "line 1" in result.stderr and not (tmp_path / "bad.urdf").exists()
    )


def feasible_estimate(values):
    return Estimate(
        names=("X",), X=np.ones(1), sigma=np.ones(1), covariance=np.eye(1),
        sigma_corrected=np.ones(1), sigma_rho=1.0, cond=1.0, cond_unit=1.0,
        rank=1, residual_norm=1.0, relative_error=1.0, per_joint=(), method="feasible",
        details={"standard": values} if values else {},
    )  # fmt: skip


def test_an_estimate_stands_for_the_values(tmp_path):
    robot = load_robot("planar_2r")
    values = {name: 1.5 * robot.values[name] for name in robot.parameters}
    file = tmp_path / "estimate.json"
    file.write_text(feasible_estimate(values).to_json())
    assert run("convert", "planar_2r", tmp_path / "arm.urdf", "--estimate", file).exit_code == 0
    assert load_robot(tmp_path / "arm.urdf").values["M1"] == pytest.approx(values["M1"], rel=1e-15)


@pytest.mark.parametrize(
    ("values", "words"), [({}, "method: feasible"), ({"M99": 1.0}, "M99"), (None, "cannot be read")]
)
def test_an_estimate_without_standard_parameters_of_the_robot_is_refused(values, words, tmp_path):
    file = tmp_path / "estimate.json"
    if values is not None:
        file.write_text(feasible_estimate(values).to_json())
    result = run("convert", "planar_2r", tmp_path / "arm.urdf", "--estimate", file)
    assert result.exit_code == 2 and words in result.stderr and not (tmp_path / "arm.urdf").exists()


@pytest.mark.parametrize(("robot", "words"), [("sr400", "closed loop"), ("rx90", "no value of")])
def test_what_a_urdf_cannot_hold_is_refused(robot, words, tmp_path):
    result = run("convert", robot, tmp_path / "robot.urdf")
    assert result.exit_code == 2 and words in result.stderr and list(tmp_path.iterdir()) == []


def test_verbs_take_a_urdf_as_it_is(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(ARM.replace("1.5708", "0"))
    result = run("check", file)
    assert result.exit_code == 0 and "certificate valid" in result.stdout
    assert run("generate", file, "-o", tmp_path / "models").exit_code == 0
    text = (tmp_path / "models" / "arm.py").read_text()
    assert "ZZ1R = ZZ1 + Ia1 + D2**2*M2" in text and "generate arm.urdf" in text
