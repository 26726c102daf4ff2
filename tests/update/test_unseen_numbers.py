"""Numbers on which no torque depends are those of the file about the centre of mass, and are listed:
a planar arm tells moments about its axes alone.
"""

from __future__ import annotations

import numpy as np
import pytest

import symgen
from oracles.applying import exact
from symgen.description import load_robot

ARM = """\
<robot name="turn2">
  <link name="base"/>
  <link name="a"><inertial><origin xyz="0.15 0.01 0.02"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
  <link name="b"><inertial><origin xyz="0.1 0 0.01"/><mass value="1"/>
    <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.006" iyz="0" izz="0.006"/></inertial></link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="a"/>
    <origin rpy="1.5707963267948966 0 0"/><axis xyz="0 0 1"/></joint>
  <joint name="elbow" type="continuous"><parent link="a"/><child link="b"/>
    <origin xyz="0.3 0 0"/><axis xyz="0 0 1"/></joint>
</robot>
"""
UNSEEN = [
    *(
        f"link '{link}': inertia {label}"
        for link in "ab"
        for label in ("xx", "xy", "xz", "yy", "yz")
    ),
    "link 'b': centre z",
]


def test_numbers_that_no_torque_tells_stay(tmp_path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    model = symgen.model(path)
    # what a record gave: the arm is lighter and its centres are elsewhere
    chi = dict(model.VALUES) | {
        "ZZ1": 0.069, "MX1": 0.2114, "MY1": 0.0198, "ZZ2": 0.0158, "MX2": 0.0999, "M2": 0.9666,
        "FV1": 0.3, "FS1": 0.5, "FV2": 0.1, "FS2": 0.2,
    }  # fmt: skip
    applied = symgen.apply(exact(model, chi), path)
    changed = {f"{c.place}: {c.number}" for c in applied.changes}
    assert not changed & {*UNSEEN} and {*UNSEEN} <= {*applied.undetermined}
    assert "link 'a': centre x" in changed and "link 'b': inertia zz" in changed
    text = applied.content.decode()
    assert 'ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz=' in text
    assert 'ixx="0.002" ixy="0" ixz="0" iyy="0.006" iyz="0" izz=' in text
    new = tmp_path / "new.urdf"
    applied.write(new)
    again = load_robot(new)
    placed = dict(again.values) | dict(applied.placeless)
    np.testing.assert_allclose(
        model.base_parameters(placed), model.base_parameters(chi), rtol=1e-9, atol=1e-12
    )


def test_they_give_way_where_no_physical_link_is_left(tmp_path) -> None:
    """Moments about the axis far below those of the file: the others cannot stay."""
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    model = symgen.model(path)
    light = {name: 0.02 * x if name.endswith("2") else x for name, x in model.VALUES.items()}
    applied = symgen.apply(exact(model, light), path)
    assert any("changed only to keep the link physical" in x for x in applied.notes())
    changed = [c for c in applied.changes if c.told_by == "file"]
    assert {c.place for c in changed} == {"link 'b'"} and all(np.isnan(c.sigma) for c in changed)
    assert not {f"{c.place}: {c.number}" for c in changed} & {*applied.undetermined}
    placed = dict(load_robot(applied.write(tmp_path / "new.urdf")).values)
    assert model.base_parameters(placed | dict(applied.placeless)) == pytest.approx(
        np.asarray(model.base_parameters(light)), rel=1e-9, abs=1e-12
    )
