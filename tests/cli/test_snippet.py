"""`symgen snippet`: the scripts run beside their files alone and agree; `--estimate` here and in `symgen convert`."""

import ast
import importlib.util
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from runtime.estimators.estimate import Estimate
from symgen.cli.main import app
from symgen.description import load_robot, write_yaml

AGREES = 1e-10  # of the largest torque
DRAKE = {  # what the script asks of Drake, all of it run by hand with Drake 1.51.1: differences below 4e-16 of the largest torque
    "AddJointActuator", "AddModels", "CalcForceElementsContribution", "CalcInverseDynamics", "CreateDefaultContext", "Finalize", "GetFrameByName",
    "GetJointByName", "MultibodyForces", "MultibodyPlant", "Parser", "SetPositions", "SetVelocities", "WeldFrames", "mutable_gravity_field",
    "num_velocities", "set_default_damping_vector", "set_default_gear_ratio", "set_default_rotor_inertia", "set_gravity_vector", "velocity_start",
    "world_frame",
}  # fmt: skip


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def difference(script):
    """What the script prints of its agreement, run on its own."""
    done = subprocess.run([sys.executable, script.name], cwd=script.parent, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return float(re.search(r"largest difference (\S+) of the largest torque", done.stdout)[1])


def own_robot(tmp_path):
    """A prismatic joint, tilted gravity, a spring, friction of one direction, coupled motors, a branch whose joints pinocchio numbers otherwise."""
    text = """\
symgen: 1
name: branch
gravity: [1, 2, -9]
constants: {L: 0.4}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0.1}
  2: {ant: 1, sigma: 0, alpha: 0.7, d: L, theta: q2 + 0.3, r: 0}
  3: {ant: 0, sigma: 1, alpha: pi/2, d: 0.2, theta: 0.1, r: q3 + 0.2}
  4: {ant: 2, sigma: 0, gamma: 0.2, b: 0.1, alpha: -pi/3, d: 0.3, theta: q4, r: 0.1}
elements:
  Ia: {kind: inertia, along: {1: q1, 2: q2 - 3*q4}, form: {4: q4**2 + 2*q1*q4}}
  FV: {kind: viscous, along: all}
  FS: {kind: coulomb, along: {1: q1, 2: q2 + q4}}
  UP: {kind: viscous, along: {3: q3}, when: positive}
  DN: {kind: coulomb, along: {3: q3}, when: negative}
  K: {kind: stiffness, along: {2: q2}}
  OFFSET: {kind: offset, along: {1: q1, 4: q4 - q1}}
"""
    file = tmp_path / "branch.yaml"
    file.write_text(text)
    rng = np.random.default_rng(5)
    robot = load_robot(file)
    values = dict(zip(robot.parameters, rng.uniform(0.1, 0.4, len(robot.parameters)), strict=True))
    for j in robot.links:
        values |= {f"M{j}": 3.0, f"XX{j}": 1.0, f"YY{j}": 1.1, f"ZZ{j}": 1.2}
    file.write_text(write_yaml(replace(robot, values={k: round(float(v), 6) for k, v in values.items()})))
    return file


@pytest.mark.parametrize("robot", ["tx40", "emps_asymmetric", own_robot], ids=["coupled wrist", "prismatic", "branch"])
def test_pinocchio_agrees(robot, tmp_path):
    source = robot if isinstance(robot, str) else robot(tmp_path)
    out = tmp_path / "out"
    result = run("snippet", source, "--for", "pinocchio", "-o", out)
    assert result.exit_code == 0, result.output
    name = load_robot(source).name
    assert {p.name for p in out.iterdir()} == {"use_pinocchio.py", f"{name}.urdf", f"{name}.py"}
    assert difference(out / "use_pinocchio.py") < AGREES


def test_the_wrist_is_a_full_matrix(tmp_path):
    """TX40: motor 6 also turns with joint 5; armature alone would miss the off-diagonal share, and the script says what it misses."""
    run("snippet", "tx40", "-o", tmp_path)
    spec = importlib.util.spec_from_file_location("use", tmp_path / "use_pinocchio.py")
    use = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(use)
    Ia6 = load_robot("tx40").values["Ia6"]
    assert use.MOTORS[4, 5] == use.MOTORS[5, 4] == Ia6 and use.MOTORS[5, 5] == Ia6
    model = use.load()
    assert np.array_equal(model.armature, np.diag(use.MOTORS)) and np.array_equal(model.gravity.linear, [0, 0, -9.81])


def test_drake_script_asks_for_what_drake_has(tmp_path):
    """Run where Drake is; else its syntax tree and the names it uses, which were run by hand."""
    assert run("snippet", "tx40", "--for", "drake", "-o", tmp_path).exit_code == 0
    tree = ast.parse((tmp_path / "use_drake.py").read_text())
    ours = {n.name for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)}
    used = {n.func.attr for n in ast.walk(tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Attribute)}
    used |= {n.func.id for n in ast.walk(tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)} - ours
    assert {name for name in used if name in DRAKE} == DRAKE
    python = {"abs", "array", "clip", "diag", "dot", "default_rng", "enumerate", "exec_module", "inverse_dynamics", "base_parameters", "len", "max",
              "module_from_spec", "print", "range", "resolve", "sign", "spec_from_file_location", "str", "uniform", "zeros", "zip", "Path"}  # fmt: skip
    assert used - DRAKE <= python
    if importlib.util.find_spec("pydrake") is not None:
        assert difference(tmp_path / "use_drake.py") < AGREES


def feasible_estimate(values):
    return Estimate(
        names=("X",), X=np.ones(1), sigma=np.ones(1), covariance=np.eye(1), sigma_corrected=np.ones(1), sigma_rho=1.0, cond=1.0, cond_unit=1.0,
        rank=1, residual_norm=1.0, relative_error=1.0, per_joint=(), method="feasible", details={"standard": values} if values else {},
    )  # fmt: skip


def test_estimate_stands_for_the_values(tmp_path):
    robot = load_robot("planar_2r")
    values = {name: 1.5 * robot.values[name] for name in robot.parameters}
    file = tmp_path / "estimate.json"
    file.write_text(feasible_estimate(values).to_json())
    assert run("snippet", "planar_2r", "--estimate", file, "-o", tmp_path / "s").exit_code == 0
    assert difference(tmp_path / "s" / "use_pinocchio.py") < AGREES
    assert run("convert", "planar_2r", tmp_path / "arm.urdf", "--estimate", file).exit_code == 0
    assert load_robot(tmp_path / "arm.urdf").values["M1"] == pytest.approx(values["M1"], rel=1e-15)
    assert (tmp_path / "arm.urdf").read_text() == (tmp_path / "s" / "planar_2r.urdf").read_text()


def test_what_cannot_be_used_is_said(tmp_path):
    base, other = tmp_path / "base.json", tmp_path / "other.json"
    base.write_text(feasible_estimate({}).to_json())
    other.write_text(feasible_estimate({"M99": 1.0}).to_json())
    for arguments, words in (
        (("planar_2r", "--estimate", base), "method: feasible"),
        (("planar_2r", "--estimate", other), "M99"),
        (("planar_2r", "--estimate", tmp_path / "none.json"), "cannot be read"),
        (("planar_2r", "--for", "chrono"), "pinocchio, drake"),
        (("rx90",), "no value of XX1"),
        (("haptic",), "closed loop"),
    ):
        result = run("snippet", *arguments, "-o", tmp_path / "out")
        assert result.exit_code == 2 and words in result.stderr and not (tmp_path / "out").exists(), result.output
    assert run("snippet", "emps", "-o", tmp_path).exit_code == 0
    again = run("snippet", "emps", "-o", tmp_path)
    assert again.exit_code == 2 and "--force" in again.stderr


def test_constants_of_the_file_are_numbers_in_the_script(tmp_path):
    run("snippet", "tx40", "-o", tmp_path)
    text = (tmp_path / "use_pinocchio.py").read_text()
    assert "nan" not in text and "Fraction" not in text and "np.float64" not in text
