"""Models of robots whose base moves: torques equal those of a free-flyer, formulas and texts are proved."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from certify.text_faults import code_lines, turned_sign
from typer.testing import CliRunner

import symgen
from oracles.free_flyer import free_flyer
from oracles.urdf_robots import NAMED, panda, random_tree, ur5
from symgen.certify.certificate import certify_formulas
from symgen.certify.claim import claim
from symgen.certify.modules import certify
from symgen.certify.texts import text_check
from symgen.certify.witness import Witness
from symgen.cli.main import app
from symgen.derive.regressor import inertial_names
from symgen.description import load_robot, parse_robot
from symgen.description.files import on_base
from symgen.description.robot import INERTIAL, parameter
from symgen.description.tree import TreePart
from symgen.description.tree_robot import read_tree
from symgen.description.urdf import write_urdf
from symgen.description.yaml import write_yaml
from symgen.emit.generate import generate_files
from symgen.emit.targets import TARGETS
from symgen.errors import DescriptionError, SymgenError
from symgen.pages.page import robot_page
from symgen.regroup.regrouping import BaseParameter, regroup

TOLERANCE = 1e-10  # of the largest torque
HERE = Path(__file__).resolve().parents[2]
LEGS = """\
<mujoco model="legs"><compiler angle="radian"/><worldbody>
<body name="trunk" pos="0 0 0.5" quat="0.9 0.1 0.3 -0.2"><freejoint name="fly"/>
<inertial pos="0.02 0 0.01" mass="7" fullinertia="0.1 0.2 0.25 0.01 -0.02 0.005"/>
{legs}
</body></worldbody></mujoco>
"""
LEG = """\
<body name="hip{k}" pos="0.2 {y} 0"><joint name="a{k}" axis="1 0 0" damping="0.2" armature="0.01"/>
<inertial pos="0.01 {y} 0.003" mass="0.7" fullinertia="0.001 0.002 0.0015 0.0002 0.0001 -0.0003"/>
<body name="thigh{k}" pos="0 {y} 0.01"><joint name="b{k}" axis="0 1 0" damping="0.1" armature="0.02"/>
<inertial pos="-0.01 0.02 -0.05" mass="1.1" fullinertia="0.008 0.009 0.003 0.0004 0.0006 0.0002"/>
<body name="calf{k}" pos="0 0 -0.21"><joint name="c{k}" axis="0 1 0" damping="0.3" armature="0.03"/>
<inertial pos="0.004 0 -0.1" mass="0.2" fullinertia="0.002 0.002 0.0002 0.00001 0.0001 0"/>
</body></body></body>
"""
QUADRUPED = LEGS.format(legs="".join(LEG.format(k=k, y=y) for k, y in enumerate((0.05, -0.05))))


FREE_PANDA = panda().replace('<mimic joint="finger1"/>', "")
"""Seven joints and two fingers, each on its own."""


def humanoid() -> str:
    """A URDF of 24 joints: a trunk, legs of six, arms of five, a neck of two; random inertias."""
    rng, parts = np.random.default_rng(8), ['<robot name="humanoid">']

    def link(name, mass):
        a, b, c = mass * np.array([0.011, 0.012, 0.013]) * rng.uniform(0.9, 1.1, 3)
        xyz = " ".join(f"{x:.3f}" for x in rng.uniform(-0.1, 0.1, 3))
        parts.append(
            f'<link name="{name}"><inertial><origin xyz="{xyz}" rpy="0.1 0.2 0.3"/><mass value="{mass}"/>'
            f'<inertia ixx="{a:.4f}" ixy="0" ixz="0" iyy="{b:.4f}" iyz="0" izz="{c:.4f}"/></inertial></link>'
        )

    link("trunk", 30.0)
    limbs = {
        "leg": ("0 0.1 -0.2", "xyzyyx", "0 0 -0.2"),
        "arm": ("0 0.2 0.3", "yxzyz", "0 0 -0.15"),
    }
    chains = [(f"{limb}{side}", *limbs[limb]) for limb in limbs for side in "ab"]
    for limb, start, axes, step in [*chains, ("neck", "0 0 0.4", "zy", "0 0 0.1")]:
        parent, xyz = "trunk", start.replace("0.1 ", "-0.1 ") if limb.endswith("b") else start
        for k, axis in enumerate(axes):
            link(f"{limb}{k}", round(3.0 / (k + 1), 3))
            direction = " ".join(str(int(axis == c)) for c in "xyz")
            parts.append(
                f'<joint name="{limb}j{k}" type="revolute"><parent link="{parent}"/><child link="{limb}{k}"/>'
                f'<origin xyz="{xyz}"/><axis xyz="{direction}"/>'
                '<limit lower="-2" upper="2" effort="99" velocity="9"/></joint>'
            )
            parent, xyz = f"{limb}{k}", step
    return "\n".join([*parts, "</robot>"])


def module_of(robot, base="moving"):
    return symgen.model(robot, base=base)


def standard(module):
    return dict.fromkeys(module.STANDARD_PARAMETERS, 0.0) | dict(module.VALUES)


def links_alone(module):
    """Standard parameters without those of friction and rotors, which pinocchio's recursion lacks."""
    return {name: x * (name not in module.ELEMENTS) for name, x in standard(module).items()}


@pytest.mark.parametrize("base", ["moving", "free"])
@pytest.mark.parametrize("text", [ur5(), FREE_PANDA, random_tree(3)], ids=["ur5", "panda", "tree"])
def test_torques_are_those_of_pinocchio_with_a_free_flyer(text, base):
    robot, notes = read_tree(text.encode(), "arm.urdf", exact=True)
    module = module_of(robot, base)
    X = module.base_parameters(links_alone(module))
    names = dict(re.findall(r"q(\d+) = '([^']*)'", notes[0]))
    joints = [names[str(j)] for j in module.JOINTS]
    of_base, q, qd, qdd, expected, _ = free_flyer(text, joints, 20, wrench=base == "free")
    found = module.inverse_dynamics(of_base, q, qd, qdd, X)
    assert np.abs(found - expected).max() < TOLERANCE * np.abs(expected).max()
    assert found.shape[1] == len(module.JOINTS) + 6 * (base == "free")


def test_a_humanoid_and_its_accelerations():
    """24 joints: torques of a free base from its accelerations, and its accelerations from torques."""
    text = humanoid()
    robot, notes = read_tree(text.encode(), "humanoid.urdf", exact=True)
    module = module_of(robot, "free")
    assert len(module.JOINTS) == 24
    names = dict(re.findall(r"q(\d+) = '([^']*)'", notes[0]))
    joints = [names[str(j)] for j in module.JOINTS]
    base, q, qd, qdd, expected, _ = free_flyer(text, joints, 20, wrench=True)
    X = module.base_parameters(links_alone(module))
    found = module.inverse_dynamics(base, q, qd, qdd, X)
    assert np.abs(found - expected).max() < TOLERANCE * np.abs(expected).max()
    direct = module.forward_dynamics(base, q, qd, found, X)
    np.testing.assert_allclose(direct, np.hstack([base[:, 3:], qdd]), atol=1e-9)
    other = base * (np.arange(9) < 3)  # of the base, only w0 is read
    np.testing.assert_allclose(module.forward_dynamics(other, q, qd, found, X), direct, atol=1e-9)
    A = module.inertia_matrix(q, X)
    assert A.shape == (20, 30, 30)
    accelerations = np.hstack([base[:, 6:], base[:, 3:6], qdd])
    still = np.hstack([base[:, :3], np.zeros((20, 6))])
    rest = module.inverse_dynamics(still, q, qd, 0 * qdd, X)
    np.testing.assert_allclose((A @ accelerations[..., None])[..., 0] + rest, found, atol=1e-9)
    falling = module.forward_dynamics(0 * base, 0 * q, 0 * qd, 0 * found, X)
    np.testing.assert_allclose(falling, 0, atol=1e-9)  # no weight where nothing holds it


@pytest.mark.parametrize("base", ["moving", "free"])
def test_torques_of_legs_are_those_of_mujoco(base):
    """A freejoint is read as a free base; the inverse dynamics of MuJoCo, constraints off."""
    robot, notes = read_tree(QUADRUPED.encode(), "legs.xml")
    assert robot.base == "free"
    assert any("free joint 'fly': read as base: free" in note for note in notes)
    module = module_of(robot, base)
    compiled = mujoco.MjModel.from_xml_string(QUADRUPED)
    compiled.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data, rng = mujoco.MjData(compiled), np.random.default_rng(1)
    X = module.base_parameters(standard(module))
    for _ in range(10):
        Q = rng.normal(size=4)
        data.qpos[:] = [*rng.normal(size=3), *(Q / np.linalg.norm(Q)), *rng.normal(size=6)]
        data.qvel[:], data.qacc[:] = rng.normal(size=(2, 12))
        mujoco.mj_inverse(compiled, data)
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, data.qpos[3:7])
        R = R.reshape(3, 3)
        a0 = R.T @ (data.qacc[:3] - compiled.opt.gravity)
        motion = np.concatenate([data.qvel[3:6], data.qacc[3:6], a0])
        found = module.inverse_dynamics(motion, data.qpos[7:], data.qvel[6:], data.qacc[6:], X)
        forces = data.qfrc_inverse  # of a freejoint: the force in the world, the moment in the body
        expected = np.concatenate([R.T @ forces[:3], forces[3:]])[-len(found) :]
        assert np.abs(found - expected).max() < TOLERANCE * np.abs(expected).max()


def test_at_rest_it_is_the_fixed_robot():
    """w0 = wd0 = 0 and a0 = -g: the torques of the fixed robot, whatever the standard parameters."""
    fixed, module = symgen.model("tx40"), module_of("tx40")
    rng = np.random.default_rng(2)
    q, qd, qdd, chi = *rng.normal(size=(3, 5, 6)), rng.normal(size=len(fixed.STANDARD_PARAMETERS))
    base = np.tile([0.0] * 6 + [-g for g in module.GRAVITY], (5, 1))
    tau = fixed.inverse_dynamics(q, qd, qdd, fixed.base_parameters(chi))
    X = module.base_parameters(chi)
    np.testing.assert_allclose(module.inverse_dynamics(base, q, qd, qdd, X), tau, atol=1e-12)
    np.testing.assert_allclose(
        module.gravity(base, q, X), fixed.gravity(q, fixed.base_parameters(chi)), atol=1e-12
    )
    turning = base + np.array([1.0] * 6 + [0.0] * 3)
    assert (module.gravity(turning, q, X) == module.gravity(base, q, X)).all()


@pytest.mark.parametrize("base", ["moving", "free"])
@pytest.mark.parametrize("make", NAMED, ids=lambda make: make.__name__)
def test_the_count_is_the_rank_of_a_free_flyer(make, base):
    """By SVD of pinocchio's regressor: inertial parameters, rows of random free-flyer states."""
    text = FREE_PANDA if make is panda else make()
    robot = replace(read_tree(text.encode(), "arm.urdf")[0], base=base, elements=(), values={})
    assert len(regroup(robot)) == rank_of_pinocchio(text, base)


def rank_of_pinocchio(text, base):
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    data, rng, rows = model.createData(), np.random.default_rng(0), []
    for _ in range(40):
        Q = pin.randomConfiguration(model, -3 * np.ones(model.nq), 3 * np.ones(model.nq))
        v, a = rng.normal(size=(2, model.nv))
        D = pin.computeJointTorqueRegressor(model, data, Q, v, a)
        rows.append(D if base == "free" else D[6:])
    W = np.vstack(rows)
    W = W[:, np.linalg.norm(W, axis=0) > 0]
    s = np.linalg.svd(W / np.linalg.norm(W, axis=0), compute_uv=False)
    return np.sum(s > 1e-9 * s[0])


def test_a_free_base_adds_the_ten_parameters_of_its_link():
    """Whatever the arm: link 0 alone under a base that shakes at will, 10 more than a moving base."""
    for name in ("tx40", "scara", "sr400", "panda"):
        moving, free = (regroup(load_robot(name, base=base)) for base in ("moving", "free"))
        assert len(free) == len(moving) + 10
        assert {*free.own} - {*moving.own} == {parameter(p, 0) for p in INERTIAL}
    formulas = {b.name: str(b.formula) for b in regroup(load_robot("tx40", base="free")).base}
    assert formulas["M0R"] == "M0 + M1 + M2 + M3 + M4 + M5 + M6"
    assert formulas["XX0R"] == "XX0 + YY1"
    assert formulas["MZ0R"] == "MZ0 + MZ1"


def test_which_parameters_a_turning_base_reveals():
    """A rotor feels the rate of its joint, a link that of the base too: Ia1 and Ia2 part from ZZ1R, ZZ2R."""
    fixed, moving = regroup(load_robot("tx40")), regroup(load_robot("tx40", base="moving"))
    assert (len(fixed), len(moving)) == (60, 68)
    assert {*moving.own} - {*fixed.own} == {"XX1", "XY1", "XZ1", "YZ1", "MX1", "MY1", "Ia1", "Ia2"}
    formulas = {b.name: str(b.formula) for b in moving.base}
    assert formulas["XX1R"] == "XX1 - YY1 + YY2 + YY3 + D3**2*(M3 + M4 + M5 + M6)"
    assert formulas["MY1R"] == "MY1 + MZ2 + MZ3"
    assert formulas["ZZ1R"] == "ZZ1 + YY2 + YY3 + D3**2*(M3 + M4 + M5 + M6)"


@pytest.mark.parametrize(
    ("name", "base"),
    [
        ("tx40", "moving"),
        ("sr400", "moving"),
        ("scara", "moving"),
        ("tx40", "free"),
        ("sr400", "free"),
    ],
)
def test_the_certificate_holds_and_refuses_false_formulas(name, base):
    regrouping = regroup(load_robot(name, base=base))
    found = certify(regrouping)
    assert found.valid
    assert found.primes
    b = next(b for b in regrouping.base if len(b.combination) > 1)
    *kept, dropped = b.combination
    false = BaseParameter(b.name, b.own, {k: b.combination[k] for k in kept})
    wrong = replace(regrouping, base=tuple(false if x is b else x for x in regrouping.base))
    assert not certify_formulas(wrong).valid, dropped


@pytest.mark.parametrize("base", ["moving", "free"])
def test_faults_in_the_text_are_refused(base):
    """A turned sign in any line of the motion from the base on, or of the rows of a free base."""
    import random

    regrouping = regroup(load_robot("planar_2r", base=base))
    ((file, text),) = generate_files(regrouping.robot, regrouping=regrouping).items()
    witness, rng, lines = Witness(regrouping), random.Random(5), text.splitlines()
    assert text_check(file, text, "numpy", witness).valid
    inner = ("_motion", "_gravity_block", "_inertia_matrix_block", "forward_dynamics")
    places = [(n, line) for f, n, line in code_lines(text, False) if f in inner]
    tried = 0
    for number, line in rng.sample(places, len(places)):
        code, mark, comment = line.partition("  #")
        new = turned_sign(code, rng) + mark + comment
        of_base = re.search(r"\b(W|WP|VP|E|NE)[123]0\b|\b(D|GAM|A)\[", code)
        if new == line or not of_base or "unpack" in code:
            continue
        tried += 1
        changed = [*lines[:number], new, *lines[number + 1 :]]
        assert not text_check(file, "\n".join(changed) + "\n", "numpy", witness).valid, new
        if tried == 12:
            break
    assert tried == 12


@pytest.mark.parametrize(("base", "rank"), [("moving", 22), ("free", 32)])
def test_a_claim_is_verified_by_a_script_that_shares_no_code(tmp_path, base, rank):
    import json

    regrouping = regroup(load_robot("planar_2r", base=base))
    file = tmp_path / "claim.json"
    stated = claim(regrouping, certify_formulas(regrouping))
    script = HERE / "docs" / "examples" / "check_certificate.py"

    def verdict() -> str:
        file.write_text(json.dumps(stated), encoding="utf-8")
        run = subprocess.run([sys.executable, script, file], capture_output=True, text=True)
        return run.stdout

    assert f"verified: rank {rank}" in verdict()
    stated["base"] = "fixed"
    assert "refuted" in verdict()


def test_what_has_no_models_is_refused_in_one_sentence(monkeypatch):
    robot = load_robot("tx40", base="moving")
    monkeypatch.setitem(TARGETS, "c", TARGETS["c"]._replace(bases=("fixed",)))
    with pytest.raises(
        SymgenError, match="target c has no models of a robot with base: moving; use"
    ):
        generate_files(robot, targets=("numpy", "c"))
    with pytest.raises(SymgenError, match="coriolis has no meaning on a moving base"):
        generate_files(robot, options=("coriolis",))
    with pytest.raises(SymgenError, match="kinetic_energy has no meaning"):
        symgen.symbolic(robot).model("kinetic_energy")
    free = load_robot("tx40", base="free")
    with pytest.raises(
        SymgenError, match="target c has no models of a robot with base: free; use numpy"
    ):
        generate_files(free, targets=("c",))
    with pytest.raises(SymgenError, match="the direct model of tx40, whose base is free"):
        symgen.symbolic(free).forward_dynamics()
    with pytest.raises(DescriptionError, match="expected fixed, moving or free"):
        load_robot("tx40", base="flying")
    with pytest.raises(DescriptionError, match="closes through frame 0"):
        load_robot("five_bar", base="free")
    module = module_of("planar_2r")
    with pytest.raises(ValueError, match=r"base of shape \(5, 8\); expected \(5, 9\)"):
        module.regressor(np.zeros((5, 8)), *np.zeros((3, 5, 2)))
    module = module_of("planar_2r", "free")
    X = np.zeros(len(module.BASE_PARAMETERS))
    with pytest.raises(ValueError, match=r"tau of shape \(5, 2\); expected \(5, 8\)"):
        module.forward_dynamics(np.zeros((5, 9)), *np.zeros((3, 5, 2)), X)


@pytest.mark.parametrize("base", ["moving", "free"])
def test_a_robot_file_keeps_its_base(base):
    robot = load_robot("planar_2r", base=base)
    text = write_yaml(robot)
    assert f"base: {base}" in text
    assert parse_robot(text.encode(), "planar_2r.yaml").base == base
    assert "base" not in write_yaml(load_robot("planar_2r"))
    named = text.replace("constants: {", "constants: {W10: 1.0, ")
    with pytest.raises(DescriptionError, match="W10 is an input of a robot whose base moves"):
        parse_robot(named.encode(), "planar_2r.yaml")


def test_the_parameters_of_link_0_are_those_of_the_file():
    """A free base has them, whether a joint of the file or the option frees it; others have none."""
    free, _ = read_tree(QUADRUPED.encode(), "legs.xml")
    assert free.values["M0"] == 7
    moving = on_base(free, "moving")
    assert "M0" not in moving.values
    assert on_base(moving, "free") == free
    held, _ = read_tree(QUADRUPED.encode(), "legs.xml", part=TreePart({"fly": 0.0}))
    assert not {*held.values} & {parameter(p, 0) for p in INERTIAL}
    assert on_base(held, "free").values["M0"] == 7  # in the axes of the world, which hold it
    text, notes = write_urdf(free)
    assert any("base: free, which --base free gives" in note for note in notes)
    again = on_base(read_tree(text.encode(), "legs.urdf")[0], "free")
    for p in INERTIAL:
        assert again.values[parameter(p, 0)] == pytest.approx(
            free.values[parameter(p, 0)], abs=1e-12
        )


def test_a_page_names_the_rows_of_a_free_base():
    text = robot_page(regroup(load_robot("planar_2r", base="free")))
    assert "Γ<sub>NZ0</sub>" in text
    assert "mass of link 0" in text


def test_a_free_joint_of_a_urdf_below_all_others_is_a_free_base():
    """Only the joint that carries all others; held, it is the fixed robot."""
    text = ur5()
    root = re.search(r'<link name="([^"]+)"', text)[1]
    free = (
        f'<link name="earth"/><joint name="fly" type="floating"><parent link="earth"/>'
        f'<child link="{root}"/><origin xyz="1 2 3" rpy="0.1 0.2 0.3"/></joint></robot>'
    )
    flying = text.replace("</robot>", free)
    robot, _ = read_tree(flying.encode(), "arm.urdf")
    assert robot.base == "free"
    assert robot.frames == read_tree(text.encode(), "arm.urdf")[0].frames
    held, _ = read_tree(flying.encode(), "arm.urdf", part=TreePart({"fly": 0.0}))
    assert held.base == "fixed"
    beside = flying.replace(
        "</robot>",
        '<link name="door"/><joint name="hinge" type="revolute"><parent link="earth"/>'
        '<child link="door"/><axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/>'
        "</joint></robot>",
    )
    with pytest.raises(DescriptionError, match="'fly' does not carry joint 'hinge'"):
        read_tree(beside.encode(), "arm.urdf")


def test_the_inertial_parameters_of_a_moving_base_are_never_fewer():
    for name in ("panda", "scara", "puma560"):
        robot = load_robot(name)
        inertial = inertial_names(robot)
        counts = [
            sum(own in inertial for own in regroup(replace(robot, base=base)).own)
            for base in ("fixed", "moving")
        ]
        assert counts[0] < counts[1]


def test_commands_take_the_base(tmp_path):
    """The header of a generated module names --base, by which it is generated anew."""
    run = CliRunner().invoke(
        app, ["generate", "planar_2r", "--base", "moving", "-o", str(tmp_path)]
    )
    assert run.exit_code == 0, run.output
    text = (tmp_path / "planar_2r.py").read_text(encoding="utf-8")
    assert "symgen generate planar_2r --base moving" in text
    assert "def regressor(\n    base:" in text or "def regressor(base:" in text
    assert CliRunner().invoke(app, ["check", "planar_2r", "--base", "moving"]).exit_code == 0
    module = CliRunner().invoke(
        app, ["identify", str(tmp_path / "planar_2r.py"), "x.csv", "--base", "fixed"]
    )
    assert module.exit_code == 2
    assert "leave out --base" in module.output
