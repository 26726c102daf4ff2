"""A link of mass 0 with an inertia changes only where nothing else can, whatever its inertia."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import symgen
from oracles.applying import exact, motion, other_values, torques_of
from symgen.description.robot import INERTIAL

BODY = '<mass value="1"/><inertia ixx="5e-3" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>'
URDF = """\
<robot name="two"><link name="base"/>
<link name="a"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
  <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
<link name="b"><inertial>{b}</inertial></link>
<link name="tcp"><inertial>{tcp}</inertial></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" velocity="3" effort="50"/></joint>
<joint name="j2" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.4 0 0"/>
  <axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="3" effort="50"/></joint>
<joint name="jt" type="fixed"><parent link="b"/><child link="tcp"/><origin xyz="0.2 0 0"/></joint>
</robot>
"""
MJCF = """\
<mujoco><compiler angle="radian"/><worldbody>
<body name="a"><joint name="j1" axis="0 1 0"/>
  <inertial pos="0.2 0 0" mass="2" diaginertia="0.01 0.03 0.03"/>
<body name="b" pos="0.4 0 0"><joint name="j2" axis="0 1 0"/>
  <inertial pos="0.1 0 0" mass="1" diaginertia="0.005 0.01 0.01"/>
<body name="tcp" pos="0.2 0 0" euler="0.1 0.2 0.3">
  <inertial pos="0 0 0.1" mass="0" {}/></body></body></body>
</worldbody></mujoco>
"""


def massless(xx: str, yy: str, xy: str = "0") -> str:
    """An <inertial> of a URDF with mass 0, its centre off the origin."""
    return (
        f'<origin xyz="0 0.1 0"/><mass value="0"/><inertia ixx="{xx}" ixy="{xy}" ixz="0" '
        f'iyy="{yy}" iyz="0" izz="{yy}"/>'
    )


INERTIAS = {
    "small": massless("1e-6", "1e-6"),
    "zero": massless("0", "0"),
    "negative": massless("-1e-3", "-1e-3"),
    "tiny": massless("1e-300", "1e-300"),
    "products alone": massless("0", "0", "1e-6"),
    "large": massless("1", "1"),
}
COMPILED = {
    "diagonal": 'diaginertia="1e-6 2e-6 2e-6"',
    "turned": 'quat="0.9 0.1 0.3 -0.2" diaginertia="1e-6 2e-6 2e-6"',
    "full": 'fullinertia="2e-6 2e-6 2e-6 1e-7 0 0"',
    "negative": 'diaginertia="-1e-6 1e-6 1e-6"',
    "zero": 'diaginertia="0 0 0"',
}


def require_applied(path: Path, chi: dict[str, float] | None = None):
    """Own values leave every byte; other values are told by the record, and their torques are those
    of the file.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        model = symgen.model(path)
        assert symgen.apply(exact(model, dict(model.VALUES)), path).content == path.read_bytes()
        estimate = exact(model, chi or other_values(model, 4) | {"FV1": 0.4, "Ia2": 0.1})
        applied = symgen.apply(estimate, path)
    assert {"record", "sum"} & {c.told_by for c in applied.changes}
    assert all((c.sigma > 0) == (c.told_by == "record") for c in applied.changes)
    out = applied.write(path.with_stem("new"))
    states = motion(2, 2, 0.4, 10)[1:]
    ours = model.inverse_dynamics(*states, estimate.X)
    theirs = torques_of(out, model, states, dict(applied.placeless), {})
    assert np.abs(theirs - ours).max() < 1e-9 * np.abs(ours).max()
    return applied


@pytest.mark.parametrize("kind", INERTIAS)
@pytest.mark.parametrize("first", [False, True])
def test_on_a_fixed_joint_or_before_it(kind, first, tmp_path) -> None:
    path, body = tmp_path / "arm.urdf", '<origin xyz="0.1 0 0"/>' + BODY
    own = INERTIAS[kind]
    path.write_text(URDF.format(b=own, tcp=body) if first else URDF.format(b=body, tcp=own))
    applied = require_applied(path)
    own = f"link '{'b' if first else 'tcp'}'"
    assert own not in {c.place for c in applied.changes} and not applied.spread


@pytest.mark.parametrize("kind", [kind for kind in INERTIAS if kind != "zero"])
def test_alone_on_its_body(kind, tmp_path) -> None:
    path = tmp_path / "arm.urdf"
    text = URDF.format(b=INERTIAS[kind], tcp="")
    path.write_text(text.replace("<inertial></inertial>", ""))
    ten = (0.005, 0, 0, 0.02, 0, 0.02, 0.1, 0, 0, 1)
    chi = dict(symgen.model(path).VALUES)
    chi |= {f"{family}2": x for family, x in zip(INERTIAL, ten, strict=True)}
    applied = require_applied(path, chi)
    assert any(c.place == "link 'b'" and c.number == "mass" for c in applied.changes)


@pytest.mark.parametrize("kind", COMPILED)
def test_of_an_mjcf(kind, tmp_path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(MJCF.format(COMPILED[kind]))
    applied = require_applied(path)
    assert "link 'tcp'" not in {c.place for c in applied.changes}


def test_numbers_stated_of_a_massless_body_are_those_of_the_file(tmp_path) -> None:
    """The centre is not in the ten parameters, the tensor is in the axes of the file."""
    from symgen.description.tree import TreePart
    from symgen.update.places import read_text

    path = tmp_path / "arm.xml"
    for kind, tensor in (
        ("turned", (1e-6, 0, 0, 2e-6, 0, 2e-6)),
        ("full", (2e-6, 1e-7, 0, 2e-6, 0, 2e-6)),
    ):
        text = MJCF.format(COMPILED[kind]).encode()
        tcp = read_text(text, path, False, TreePart({}, None)).links[-1]
        assert tcp.numbers == pytest.approx([0, 0, 0, 0.1, *tensor], abs=1e-15)
        assert tcp.place.ten(tcp.numbers) == pytest.approx(tcp.ten, abs=1e-15)
