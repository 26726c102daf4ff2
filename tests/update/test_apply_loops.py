"""Identified values of robots with loops, in their URDF or MJCF: torques that MuJoCo computes of the
written file, projected on its constraints, are those of the estimate.
"""

from __future__ import annotations

import numpy as np
import pytest
from support.loop_files import ClosedMuJoCo, random_file
from support.loop_urdfs import bare, urdf_of
from typer.testing import CliRunner

import symgen
from oracles.applying import exact, other_values
from symgen.cli.main import app
from symgen.description.files import read_robot

KINDS = ("four-bar", "spatial crank", "welded five-bar")


def states_of(oracle: ClosedMuJoCo, robot, count=3):
    rng = np.random.default_rng(3)
    found = []
    while len(found) < count:
        q_a = rng.uniform(-0.1, 0.1, len(robot.joints))
        q = oracle.closed(oracle.start[oracle.driven] + q_a, oracle.start)
        if q is not None:
            found.append((q, *rng.standard_normal((2, len(robot.joints)))))
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_values_go_into_an_mjcf(kind, tmp_path):
    text, driven = random_file(kind, 4)
    file, new = tmp_path / "loop.xml", tmp_path / "new.xml"
    file.write_text(text)
    robot, module = symgen.load_robot(file), symgen.model(file)
    chi = other_values(module, 5)
    chi |= {name: module.VALUES[name] for name in chi if name.startswith("FS")}
    new.write_bytes(symgen.apply(exact(module, chi), file).content)
    written = symgen.load_robot(new)
    assert written.frames == robot.frames and written.loops == robot.loops
    names = [robot.labels[j] for j in robot.joints]
    assert sorted(names) == sorted(driven)
    oracle, X = ClosedMuJoCo(new.read_text(), names), module.base_parameters(chi)
    friction = [module.BASE_PARAMETERS.index(x) for x in module.BASE_PARAMETERS if x[:2] == "FS"]
    X[friction] = 0.0  # which MuJoCo makes a constraint
    for q, qd, qdd in states_of(oracle, robot):
        theirs = oracle.torque(q, qd, qdd)
        ours = module.inverse_dynamics(q[oracle.driven], qd, qdd, X)
        assert np.abs(ours - theirs).max() < 1e-9 * max(1.0, np.abs(theirs).max())


@pytest.mark.parametrize("form", ["yaml", "second parent", "closures"])
def test_values_go_into_a_urdf_beside_its_loops(form, tmp_path):
    text, driven = random_file("four-bar", 4)
    for name, content in urdf_of(bare(text), driven, form, "yaml", 4).items():
        (tmp_path / name).write_text(content)
    file = tmp_path / "robot.urdf"
    module = symgen.model(file)
    chi = other_values(module, 5)
    applied = symgen.apply(exact(module, chi), file)
    file.write_bytes(applied.content)
    written, _ = read_robot(file)
    new = module.base_parameters(dict(written.values) | dict(applied.placeless))
    assert np.abs(new - module.base_parameters(chi)).max() < 1e-9


def test_the_loops_go_with_the_file(tmp_path):
    text, driven = random_file("four-bar", 4)
    for name, content in urdf_of(bare(text), driven, "yaml", "yaml", 4).items():
        (tmp_path / name).write_text(content)
    file, other = tmp_path / "robot.urdf", tmp_path / "sub" / "new.urdf"
    module = symgen.model(file)
    (tmp_path / "estimate.json").write_text(exact(module, other_values(module, 5)).to_json())
    other.parent.mkdir()
    words = ["apply", str(tmp_path / "estimate.json"), str(file), "-o", str(other)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0 and "new.loops.yaml, the loops of robot.urdf" in result.output
    beside = other.with_suffix(".loops.yaml")
    assert beside.read_bytes() == (tmp_path / "robot.loops.yaml").read_bytes()
    assert symgen.load_robot(other).loops == symgen.load_robot(file).loops
    other.unlink()
    beside.write_text("loops: []")
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 2 and "has other loops than robot.urdf" in result.output
    assert not other.exists() and beside.read_text() == "loops: []"
