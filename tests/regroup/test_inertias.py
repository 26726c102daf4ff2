"""Inertias that no body can have: the note names the base parameters that they enter."""

import warnings

import pytest

import symgen
from symgen.description.angles import InertiaWarning
from symgen.description.tree_robot import read_tree
from symgen.emit.spec import spec_of
from symgen.regroup.regrouping import regroup

LINK = """<link name="{name}"><inertial><origin xyz="0.1 0.02 0.03"/><mass value="1"/>
<inertia ixx="{ixx}" iyy="0.006" izz="0.006" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{parent}-{child}" type="{kind}"><parent link="{parent}"/>
<child link="{child}"/><origin xyz="0.3 0 0" rpy="{roll} 0 0"/><axis xyz="0 0 1"/></joint>"""


def arm(wrong: str) -> bytes:
    """Base, a turning link, another about an axis at a right angle, and a tool held on it."""
    links = (LINK.format(name=name, ixx=0.02 if name == wrong else 0.01)
             for name in ("base", "upper", "fore", "tool"))  # fmt: skip
    joints = (
        JOINT.format(parent="base", child="upper", kind="continuous", roll=0),
        JOINT.format(parent="upper", child="fore", kind="continuous", roll=1.5707963267948966),
        JOINT.format(parent="fore", child="tool", kind="fixed", roll=0),
    )
    return f'<robot name="arm">{"".join((*links, *joints))}</robot>'.encode()


@pytest.mark.parametrize(
    ("link", "parameters"),
    [
        ("base", "no base parameter"),
        ("upper", "ZZ1R"),
        ("fore", "ZZ1R, XX2R, XY2, XZ2, YZ2, ZZ2R"),
        ("tool", "ZZ1R, XX2R, XY2, XZ2, YZ2, ZZ2R"),
    ],
)
def test_the_note_names_the_base_parameters(link, parameters):
    robot, _ = read_tree(arm(link), "arm.urdf")
    with pytest.warns(InertiaWarning) as notes:
        regroup(robot)
    (note,) = notes
    assert str(note.message).startswith(f"link '{link}' (line ")
    assert f"; this inertia enters {parameters}. " in str(note.message)


def test_the_note_comes_once():
    robot, _ = read_tree(arm("upper"), "arm.urdf")
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("default")
        regroup(robot)
        regroup(robot)
    assert [note.category for note in notes] == [InertiaWarning]


def test_a_module_from_the_cache_has_the_note_too(tmp_path, monkeypatch):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path))
    robot, _ = read_tree(arm("upper"), "arm.urdf")
    for _ in range(2):
        spec_of.cache_clear()  # as in another process
        with pytest.warns(InertiaWarning):
            symgen.model(robot)


def test_a_robot_of_bodies_that_exist_has_no_note(recwarn):
    regroup(read_tree(arm(""), "arm.urdf")[0])
    assert not recwarn.list
