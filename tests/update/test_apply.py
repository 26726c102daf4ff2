"""Values into URDF and MJCF texts written here, each for what the format has beside a plain chain;
what is refused, and that nothing is half-written.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign import campaign, sampled
from numpy.testing import assert_allclose

import runtime
import symgen
from oracles import mjcf_robots, urdf_robots
from oracles.applying import exact, motion, other_values, skeleton, torques_of
from oracles.mjcf_robots import ARM, BRANCHES, GRIPPER
from runtime.core.study import EssentialSettings
from runtime.ground.errors import InputError
from symgen.description.files import read_robot
from symgen.description.xml_text import MAX_BYTES
from symgen.errors import DescriptionError

URDF = """\
<?xml version='1.0' encoding="utf-8"?>
<!-- Made by xacro from arm.xacro: ${mass} of <mass value="99"/> -->
<robot name="prüfling" xmlns:xacro="http://www.ros.org/wiki/xacro">\r
  <link name='base'/>
  <link name="upper &amp; arm">
    <inertial>\t<!-- <mass value="7"/> -->
      <mass value = '2.50'/>
      <origin rpy="0.1 -0.2 0.3"   xyz="0.10  0 \t-2e-2"/>
        <inertia ixx="0.03" ixy="0" ixz="1e-3" iyy="0.05" iyz="0" izz="0.04"/>
    </inertial>
    <visual><geometry><mesh filename="package://arm/upper 1.5.stl"/></geometry></visual>
  </link>
  <link name="fore"><inertial><mass value="1.5"/>
    <inertia izz=".02" ixx="0.01" iyy="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="sensor"><inertial><origin xyz="0.3 0 0"/><mass value="0.1"/></inertial></link>
  <link name="tool"><inertial><origin xyz="0 0 .05"/><mass value="+0.4"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1.E-3" iyz="0" izz="0.0005"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper &amp; arm"/>
    <axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="3" effort="90"/><dynamics friction="0.5" damping="1.25"/>
      </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper &amp; arm"/><child link="fore"/><origin xyz="0.4 0 0.05" rpy="0.3 0 0"/>
      <axis xyz="0.2 1 0"/>
    <limit lower="-2" upper="2" velocity="3" effort="30"/>
  </joint>
  <joint name="f1" type="fixed"><parent link="fore"/><child link="sensor"/>
    <origin xyz="0 0 0.1" rpy="1 2 3"/></joint>
  <joint name="f2" type="fixed"><parent link="fore"/><child link="tool"/><origin xyz="0.3 0 0"/>
    </joint>
  <gazebo reference="fore"><![CDATA[ <mass value="5"/> ]]></gazebo>
  <transmission name="t"><joint name="shoulder"><hardwareInterface>1 2</hardwareInterface></joint>
    </transmission>
</robot>
"""
TEXTS = {"arm.urdf": URDF, "bent.xml": ARM, "gripper.xml": GRIPPER, "branches.xml": BRANCHES}


def written(folder: Path, name: str, text: str | bytes | None = None) -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else (text or TEXTS[name]).encode())
    return path


@pytest.fixture(
    params=[
        pytest.param(name, marks=() if name in ("arm.urdf", "gripper.xml") else campaign)
        for name in TEXTS
    ]
)
def file(request, tmp_path):
    """A file, its model, and other physical values."""
    path = written(tmp_path, request.param)
    model = symgen.model(read_robot(path)[0])
    return path, model, other_values(model, 4, offset=0.3)


def test_own_values_leave_every_byte(file) -> None:
    path, model, _ = file
    applied = symgen.apply(exact(model, dict(model.VALUES)), path)
    assert (
        applied.content == path.read_bytes()
        and not applied.changes
        and str(applied).startswith(f"{path.name}: no number changes")
    )


def test_other_values_change_numbers_alone_and_torques_are_theirs(file, tmp_path) -> None:
    path, model, chi = file
    estimate = exact(model, chi)
    applied = symgen.apply(estimate, path)
    first = str(applied).replace("\n  ", " ").split("Far from")[0]
    assert (
        f"{len(applied.changes)} numbers change in the file; {len(applied.placeless)} more" in first
    )
    assert "not written" in first
    told = "inertia xy is -sum m x y" in str(applied).replace("\n  ", " ")
    assert told == any(
        c.number in ("inertia xy", "inertia xz", "inertia yz") for c in applied.changes
    )
    assert (
        skeleton(applied.content, without=True)
        == skeleton(path.read_bytes(), without=True)
        != applied.content
    )
    (tmp_path / "out").mkdir()
    out = applied.write(tmp_path / "out" / path.name)
    states = motion(len(model.JOINTS), 2, 0.4, 10)[1:]
    again = symgen.model(read_robot(out)[0])
    placed = again.VALUES | dict(applied.placeless)
    ours = model.inverse_dynamics(*states, estimate.X)
    assert_allclose(
        again.inverse_dynamics(*states, again.base_parameters(placed)), ours, rtol=1e-9, atol=1e-9
    )
    if (
        path.suffix == ".urdf"
    ):  # pinocchio reads the whole text; the other texts name meshes or tie joints
        assert_allclose(
            torques_of(out, model, states, dict(applied.placeless), {}), ours, rtol=1e-9, atol=1e-9
        )


def test_what_is_added_is_told(tmp_path) -> None:
    path = written(tmp_path, "arm.urdf")
    model = symgen.model(read_robot(path)[0])
    applied = symgen.apply(
        exact(model, other_values(model, 4, offset=0.3) | {"FV2": 0.7, "Ia2": 0.2}), path
    )
    assert (
        any("<dynamics> in <joint>" in line for line in applied.added)
        and 'damping="0.7"' in applied.content.decode()
    )
    assert {
        "Ia2",
        "OFFSET1",
        "OFFSET2",
    } == applied.placeless.keys() - {
        "Ia1"
    } and "Ia2 = 0.2000 kg*m**2 (elbow), sigma 0.0010\n" in str(applied)
    row = next(c for c in applied.changes if c.place == "joint 'elbow'" and c.number == "damping")
    assert (
        (row.before, row.told_by) == (0.0, "record")
        and row.after == pytest.approx(0.7, abs=1e-12)
        and row.sigma == pytest.approx(1e-3)
    )
    assert applied.undetermined == (
        "link 'upper & arm': mass",
        "link 'upper & arm': centre y",
    )  # a physical robot is left with the mass of the file


def test_armature_stays_armature(tmp_path) -> None:
    """Issue 29, 6: rotor inertia of 3 kg m^2 gave links 12 kg and a centre behind the axis; it goes
    to the side list of a URDF and to the attribute of an MJCF, and every link stays as it was.
    """
    for name, place in (("arm.urdf", "side"), ("bent.xml", "file")):
        path = written(tmp_path, name)
        model = symgen.model(read_robot(path)[0])
        rotors = [f"Ia{j}" for j in model.JOINTS if f"Ia{j}" in model.STANDARD_PARAMETERS][:2]
        chi = dict(model.VALUES) | {
            k: model.VALUES[k] + x for k, x in zip(rotors, (3.0, 0.8), strict=True)
        }
        applied = symgen.apply(exact(model, chi), path)
        assert not [c for c in applied.changes if c.place.startswith("link")], str(applied)
        assert not applied.strange
        found = (
            applied.placeless.values()
            if place == "side"
            else [c.after for c in applied.changes if c.number == "armature"]
        )
        assert_allclose(list(found), [chi[k] for k in rotors], rtol=1e-6)


def test_a_rotor_that_turns_as_its_link_is_told_in_sums(tmp_path) -> None:
    """Torques of one hinge hold ZZ1 + Ia1 alone: the armature had a deviation of its own."""
    path = tmp_path / "pendulum.xml"
    path.write_text(
        '<mujoco model="pendulum"><worldbody><body name="arm"><joint name="j" axis="1 0 0"/><inertial '
        'pos="0 0 -0.1" mass="0.9" diaginertia="0.006 0.006 0.002"/></body></worldbody></mujoco>'
    )
    model = symgen.model(path)
    applied = symgen.apply(exact(model, dict(model.VALUES) | {"Ia1": 0.02}), path)
    [armature] = [c for c in applied.changes if c.number == "armature"]
    assert armature.after == pytest.approx(0.02)
    assert armature.told_by == "sum" and np.isnan(armature.sigma)


def test_what_is_absurd_is_told(tmp_path) -> None:
    """A fore arm that the estimate makes five times as heavy, with its centre behind the axis."""
    path = written(tmp_path, "arm.urdf")
    model = symgen.model(read_robot(path)[0])
    moved = {k: 5 * model.VALUES[k] for k in model.VALUES if k[-1] == "2" and k[:2] not in ("FV",)}
    applied = symgen.apply(exact(model, dict(model.VALUES) | moved), path)
    assert any(line.startswith("link 'fore' of") for line in applied.strange)
    told = " ".join(str(applied).split())
    assert "Far from the file: link 'fore' of " in told and " kg (file 1.5), its centre " in told


def test_links_on_fixed_joints_stay_where_physics_allows(tmp_path) -> None:
    path = written(tmp_path, "arm.urdf")
    model = symgen.model(read_robot(path)[0])
    applied = symgen.apply(
        exact(
            model,
            {name: x * (1.2 if name.endswith("2") else 1) for name, x in model.VALUES.items()},
        ),
        path,
    )
    assert {c.place for c in applied.changes if c.place.startswith("link")} <= {
        "link 'upper & arm'",
        "link 'fore'",
    } and not applied.spread
    lighter = {name: x * (0.2 if name.endswith("2") else 1) for name, x in model.VALUES.items()}
    applied = symgen.apply(exact(model, lighter), path)  # less than sensor and tool alone have
    assert set(applied.spread) == {"sensor", "tool"} and "changed only" in str(applied)
    again = read_robot(applied.write(tmp_path / "light.urdf"))[0]
    assert_allclose(
        model.base_parameters(dict(again.values)),
        model.base_parameters(lighter),
        rtol=1e-9,
        atol=1e-9,
    )


@campaign
def test_only_joints_that_differ_get_an_attribute_of_their_own(tmp_path) -> None:
    path = written(tmp_path, "bent.xml")
    model = symgen.model(read_robot(path)[0])
    joint = next(j for j, name in model.LABELS.items() if name == "roll")
    applied = symgen.apply(exact(model, dict(model.VALUES) | {f"FV{joint}": 0.9}), path)
    assert [(c.place, c.number) for c in applied.changes] == [("joint 'roll'", "damping")] and len(
        applied.added
    ) == 1
    assert applied.content.replace(b' damping="0.9"', b"") == path.read_bytes()


INFEASIBLE = {"FV1": -0.2}


def test_what_no_physical_robot_has_is_refused_with_the_reason(tmp_path) -> None:
    path = written(tmp_path, "arm.urdf")
    model = symgen.model(read_robot(path)[0])
    with pytest.raises(DescriptionError, match=r"in the way: FV1.*method: feasible.*arm\.urdf"):
        symgen.apply(exact(model, dict(model.VALUES) | INFEASIBLE), path)
    with pytest.raises(DescriptionError, match=r"no physical robot.*link '(fore|sensor|tool)'"):
        symgen.apply(exact(model, dict(model.VALUES) | {"ZZ2": -0.5, "XX2": -0.5}), path)


def test_the_parameters_printed_first_are_written(tmp_path) -> None:
    """Least squares of a noisy record is no robot (friction below zero); the physical set is."""
    path = written(tmp_path, "arm.urdf")
    model = symgen.model(read_robot(path)[0])
    t, *states = motion(len(model.JOINTS), 5, 8)
    chi = other_values(model, 4) | {"FV1": 0.0, "FS1": 0.0}
    torque = model.inverse_dynamics(*states, np.asarray(model.base_parameters(chi)))
    noise = np.random.default_rng(3).normal(size=torque.shape) * 0.3 * torque.std(0)
    record = runtime.Record(t, states[0], torque + noise)
    result = runtime.identify(model, record)
    with pytest.raises(DescriptionError, match="no physical robot"):
        symgen.apply(result.estimate, path)
    assert result.model_columns == "feasible"
    applied = symgen.apply(result, path)
    runtime.report(result, tmp_path / "results")
    assert symgen.apply(tmp_path / "results", path).content == applied.content
    out = applied.write(tmp_path / "identified.urdf")
    X = result.sets["feasible"].X
    assert_allclose(
        torques_of(out, model, tuple(states), dict(applied.placeless), {}),
        model.inverse_dynamics(*states, X),
        atol=1e-6 * np.abs(torque).max(),
    )
    study = runtime.Study(essential=EssentialSettings(first=True))
    chapter = runtime.identify(model, record, study)
    assert chapter.model_columns == "essential" and "feasible" not in chapter.sets
    assert_allclose(chapter.whole_estimate.X, X, rtol=1e-9)

    document = json.loads((tmp_path / "results" / "estimate.json").read_text())
    next(own for own in document["sets"] if own["name"] == "feasible")["X"].pop()
    (tmp_path / "results" / "estimate.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match="the parameters in the list `sets` differ"):
        symgen.apply(tmp_path / "results", path)


def test_estimates_of_other_robots_are_refused(tmp_path) -> None:
    path = written(tmp_path, "arm.urdf")
    tx40 = symgen.model("tx40")
    with pytest.raises(DescriptionError, match=r"no base parameters of arm\.urdf.*--robot"):
        symgen.apply(exact(tx40, dict(tx40.VALUES)), path)
    with pytest.raises(
        DescriptionError, match=r"frames 1, 2, 3, 4, 5, 6 of tx40\.yaml and arm\.urdf differ"
    ):
        symgen.apply(exact(tx40, dict(tx40.VALUES)), path, robot="tx40")
    named = replace(
        exact(symgen.model(path), dict(symgen.model(path).VALUES)),
        provenance={"labels": {"q1": "shoulder", "q2": "wrist"}},
    )
    with pytest.raises(
        DescriptionError,
        match=r"q2 is wrist in the estimate, but elbow in arm\.urdf; give the same --chain",
    ):
        symgen.apply(named, path)
    with pytest.raises(DescriptionError, match="float given as estimate"):
        symgen.apply(1.0, path)
    with pytest.raises(InputError, match="nowhere"):
        symgen.apply(tmp_path / "nowhere", path)
    with pytest.raises(DescriptionError, match=r"ends in|apply writes URDF"):
        symgen.apply(exact(tx40, dict(tx40.VALUES)), written(tmp_path, "arm.yaml", "symgen: 1"))


def test_a_converted_robot_with_other_elements(tmp_path) -> None:
    """What was converted, then edited, is named: its drives and elements stand, its links are those
    of the URDF.
    """
    from symgen.description.files import write_robot

    path = written(tmp_path, "arm.urdf")
    robot = read_robot(path, lock={"elbow": 0.4})[0]
    text = write_robot(robot, "arm.yaml")[0].replace("gravity:", "title: edited\ngravity:", 1)
    edited = written(tmp_path, "arm.yaml", text)
    model = symgen.model(read_robot(edited)[0])
    chi = dict(model.VALUES) | {"FV1": 2.0}
    applied = symgen.apply(exact(model, chi), path, robot=edited, lock={"elbow": 0.4})
    assert [c.number for c in applied.changes] == ["damping"]
    with pytest.raises(DescriptionError, match=r"frames 1, 2 of arm\.yaml and arm\.urdf differ"):
        symgen.apply(exact(model, chi), path, robot=edited)


BOMB = '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "' + "&a;" * 50 + '">]>'
REFUSED = {
    "entities": ("arm.urdf", URDF.replace("<robot", BOMB + "<robot", 1), "a document type"),
    "external entity": (
        "arm.urdf",
        URDF.replace("<robot", '<!DOCTYPE x SYSTEM "file:///etc/passwd"><robot', 1),
        "a document type",
    ),
    "100 MB": ("arm.urdf", URDF + " " * 100_000_000, "more than"),
    "include": (
        "bent.xml",
        ARM.replace("<asset>", '<include file="more.xml"/><asset>'),
        "<include> is not read",
    ),
    "nested include": (
        "bent.xml",
        ARM.replace("<light ", '<include file="../more.xml"/><light ', 1),
        "<include> is not read",
    ),
    "xacro": ("arm.urdf", URDF.replace("<gazebo", '<xacro:arm name="x"/><gazebo', 1), "xacro"),
    "both formats": ("bent.xml", URDF, "expected <mujoco>"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_hostile_files_are_refused(kind, tmp_path) -> None:
    name, text, words = REFUSED[kind]
    path = written(tmp_path, name, text)
    model = symgen.model("planar_2r")
    with pytest.raises(DescriptionError, match=words) as caught:
        symgen.apply(exact(model, dict.fromkeys(model.STANDARD_PARAMETERS, 0.0)), path)
    assert (
        caught.value.file == name
        and "\n" not in str(caught.value)
        and len(text) > 100
        and MAX_BYTES < 100_000_000
    )


def changed(tmp_path, name, text) -> bytes:
    """The text with the friction of its first joint doubled."""
    path = written(tmp_path, name, text)
    model = symgen.model(read_robot(path)[0])
    return symgen.apply(exact(model, dict(model.VALUES) | {"FV1": 2.5}), path).content


@campaign
def test_encodings(tmp_path) -> None:
    expected = URDF.replace('damping="1.25"', 'damping="2.5"')
    assert (
        changed(tmp_path, "arm.urdf", b"\xef\xbb\xbf" + URDF.encode())
        == b"\xef\xbb\xbf" + expected.encode()
    )
    latin = URDF.replace('"utf-8"', '"iso-8859-1"')
    assert changed(tmp_path, "arm.urdf", latin.encode("latin-1")) == expected.replace(
        '"utf-8"', '"iso-8859-1"'
    ).encode("latin-1")
    with pytest.raises(DescriptionError, match="save the file as UTF-8"):
        changed(tmp_path, "arm.urdf", URDF.replace('"utf-8"', '"utf-16"').encode("utf-16"))
    with pytest.raises(DescriptionError, match="write digits"):
        changed(tmp_path, "arm.urdf", URDF.replace('damping="1.25"', 'damping="&#49;.25"'))


MJCF = """<mujoco><compiler angle="radian"{compiler}/><worldbody><frame pos="0 0 1">
  <body name="a">{joint}
  <frame euler="0.1 0 0"><body name="b"><joint name="k" axis="1 0 0"/>
    <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/></body></frame>
  {inertial}</body></frame></worldbody></mujoco>"""
JOINT = '<joint name="j" axis="0 1 0" damping="1"/>'
TURNED = {
    "quat": 'quat="0.9 0.1 0.3 -0.2"',
    "euler": 'euler="0.1 0.2 0.3"',
    "axisangle": 'axisangle="1 1 0 0.4"',
    "xyaxes": 'xyaxes="0 1 0 -1 0 0"',
    "zaxis": 'zaxis="0 1 1"',
    "none": "",
}


@pytest.mark.parametrize("kind", sampled(TURNED, 0, always=["euler"]))
def test_principal_axes_in_every_way_of_writing(kind, tmp_path) -> None:
    inertial = f'<inertial pos="0.1 0 0" mass="1.2" diaginertia="0.02 0.03 0.04" {TURNED[kind]}/>'
    path = written(tmp_path, "a.xml", MJCF.format(compiler="", joint=JOINT, inertial=inertial))
    model = symgen.model(read_robot(path)[0])
    assert symgen.apply(exact(model, dict(model.VALUES)), path).content == path.read_bytes()
    chi = other_values(model, 1)
    applied = symgen.apply(exact(model, chi), path)
    again = read_robot(applied.write(tmp_path / "new.xml"))[0]
    assert_allclose(
        model.base_parameters(dict(again.values)), model.base_parameters(chi), rtol=1e-9, atol=1e-9
    )
    assert len(re.findall(rb"<inertial", applied.content)) == 2  # that of the geom is inserted


@campaign
def test_inertia_from_geoms_is_switched_or_refused(tmp_path) -> None:
    compiler = ' inertiafromgeom="true"'
    path = written(
        tmp_path,
        "a.xml",
        MJCF.format(compiler=compiler, joint=JOINT, inertial='<geom type="sphere" size="0.1"/>'),
    )
    model = symgen.model(read_robot(path)[0])
    applied = symgen.apply(exact(model, other_values(model, 1)), path)
    assert b'inertiafromgeom="auto"' in applied.content and "inertiafromgeom=auto" in str(applied)
    both = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="sphere" size="0.1"/>'
    path = written(tmp_path, "a.xml", MJCF.format(compiler=compiler, joint=JOINT, inertial=both))
    with pytest.raises(DescriptionError, match="has no effect"):
        symgen.apply(exact(model, other_values(model, 1)), path)


def test_settings_that_would_change_what_is_written_are_noticed(tmp_path) -> None:
    inertial = '<inertial pos="0.1 0 0" mass="1.2" diaginertia="0.03 0.03 0.03"/>'
    path = written(
        tmp_path,
        "a.xml",
        MJCF.format(compiler=' boundinertia="0.025"', joint=JOINT, inertial=inertial),
    )
    model = symgen.model(read_robot(path)[0])
    light = dict(model.VALUES) | {"ZZ1": model.VALUES["ZZ1"] - 0.01}
    with pytest.raises(DescriptionError, match="would change the written values"):
        symgen.apply(exact(model, light), path)


@campaign
def test_springs(tmp_path) -> None:
    joint = '<joint name="j" axis="0 1 0" stiffness="3" springref="0.2"/>'
    path = written(
        tmp_path,
        "a.xml",
        MJCF.format(compiler="", joint=joint, inertial='<geom type="sphere" size="0.1"/>'),
    )
    model = symgen.model(read_robot(path)[0])
    applied = symgen.apply(
        exact(model, dict(model.VALUES) | {"K1": 4.0}), path
    )  # OFFSET, -3 times 0.2, stays
    assert (
        b'stiffness="4.0" springref="0.15000000000000002"' in applied.content
        and not applied.placeless
    )


def test_the_record_leaves_nan(tmp_path) -> None:
    """Base parameters that the record does not show keep the file's values, and are named."""
    path = written(tmp_path, "arm.urdf")
    model = symgen.model(read_robot(path)[0])
    estimate = exact(model, dict(model.VALUES) | {"FV1": 2.0, "FS1": 0.9})
    X = estimate.X.copy()
    X[estimate.names.index("FS1")] = np.nan
    applied = symgen.apply(replace(estimate, X=X), path)
    assert (
        [c.number for c in applied.changes] == ["damping"]
        and applied.lost == ("FS1",)
        and "not shown by the record): FS1" in " ".join(str(applied).split())
        and "unexplained" not in str(applied)  # what the values of the file leave is not known
    )


@campaign
@pytest.mark.parametrize("seed", [1, 2, 4, 7])
@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
def test_trees_with_any_axes(suffix, seed, tmp_path) -> None:
    """Frames in any direction, several joints of one body, fixed and bare links: own values leave
    every byte, others are read back.
    """
    text = urdf_robots.random_tree(seed) if suffix == ".urdf" else mjcf_robots.random_tree(seed)
    path = written(tmp_path, f"tree{suffix}", text)
    model = symgen.model(read_robot(path)[0])
    assert symgen.apply(exact(model, dict(model.VALUES)), path).content == path.read_bytes()
    chi = other_values(model, seed)
    applied = symgen.apply(exact(model, chi), path)
    assert skeleton(applied.content, without=True) == skeleton(path.read_bytes(), without=True)
    again = dict(read_robot(applied.write(tmp_path / f"new{suffix}"))[0].values) | dict(
        applied.placeless
    )
    X = model.base_parameters(chi)
    assert_allclose(model.base_parameters(again), X, rtol=1e-9, atol=1e-9 * np.abs(X).max())


def test_the_answer_comes_first_and_fits_the_terminal(tmp_path) -> None:
    """Error, what is far, every rotor one a line; then the changes by link, rounded to sigma."""
    path = written(tmp_path, "arm.urdf")
    model = symgen.model(read_robot(path)[0])
    chi = other_values(model, 4, offset=0.3) | {"FV1": 1.23456789, "FV2": 0.7, "Ia2": 0.2}
    applied = symgen.apply(replace(exact(model, chi), relative_error=1.26), path)
    lines = str(applied).split("\n")
    assert max(map(len, lines)) <= 80
    assert "Both together leave 1.3 % of the torques" in " ".join(" ".join(lines[:2]).split())
    assert "Not written; set these in your program:" in lines
    for name in applied.placeless:
        assert sum(line.startswith(f"  {name} = ") for line in lines) == 1
    assert lines.count("link 'fore'") == 1 and lines.count("joint 'elbow'") == 1
    damping = next(line for line in lines if line.startswith("  damping") and " 1.25 " in line)
    assert " 1.2346 " in damping and " 0.001 " in damping and damping.endswith("record")
    assert 'damping="1.23456789' in applied.content.decode()
    for change in applied.changes:
        assert np.isfinite(change.sigma) == (change.told_by == "record")


def test_numbers_that_hardly_move_keep_their_bytes(tmp_path) -> None:
    """Less than 1e-9 of their size, also where other numbers move."""
    path = written(tmp_path, "arm.urdf")
    model = symgen.model(read_robot(path)[0])
    own = dict(model.VALUES)
    hardly = {k: x * (1 + 3e-10) for k, x in own.items()} | {"FV1": 1.4}
    applied = symgen.apply(exact(model, hardly), path)
    assert [(c.place, c.number) for c in applied.changes] == [("joint 'shoulder'", "damping")]
    assert applied.content == path.read_bytes().replace(b'damping="1.25"', b'damping="1.4"')
