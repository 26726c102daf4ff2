"""Writer of URDF files: one link and one joint for each frame of a Robot with values.

Joint axes are z axes, and link frames are Khalil's. Notes list what a URDF cannot store. The joint
frame is iTj at q_j = 0, as x y z and roll, pitch, yaw. Inertials are about the centre of mass c =
MS / M:

    I = J - M (c'c 1 - c c')
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

import numpy as np

from symgen.description.expression import Expression
from symgen.description.robot import (
    FIXED,
    INERTIAL,
    PRISMATIC,
    REVOLUTE,
    Frame,
    Robot,
    one_joint_parameters,
    parameter,
)
from symgen.description.tree import Array, transform, turn
from symgen.description.tree_robot import inertial_of
from symgen.description.urdf import MOMENTS
from symgen.errors import DescriptionError

NO_LIMIT = 1e9  # where a URDF asks for a limit that the robot does not have
_TYPES = {REVOLUTE: "revolute", PRISMATIC: "prismatic", FIXED: "fixed"}
_DYNAMICS = {"FV": "damping", "FS": "friction"}


def write_urdf(
    robot: Robot, values: Mapping[str, float] | None = None
) -> tuple[str, tuple[str, ...]]:
    """Return the URDF text of `robot`, and notes on what a URDF cannot store.

    Parameters
    ----------
    robot : Robot
        A robot without loops; each passive joint follows one joint.
    values : mapping, SI, optional
        Standard parameters by name; by default, those of the robot file. A URDF holds masses, so
        the values must be those of a physical robot: of a feasible estimate, or from CAD.

    Raises
    ------
    DescriptionError
        The robot has loops, a relation of several joints, inertial parameters without value, or
        first moments without mass.
    """
    values = dict(robot.values if values is None else values)
    if robot.loops:
        raise DescriptionError(
            f"{robot.name}: a URDF is a tree; this robot has {len(robot.loops)} closed "
            f"loop{'s' * (len(robot.loops) > 1)}"
        )
    if missing := [
        name for j in robot.links for p in INERTIAL if (name := parameter(p, j)) not in values
    ]:
        raise DescriptionError(
            f"{robot.name}: no value of {', '.join(missing[:12])}{' ...' * (len(missing) > 12)}; "
            "add these parameters under values, with 0 for a parameter that is zero"
        )
    lines = [
        '<?xml version="1.0"?>',
        f"<robot name={quoteattr(robot.name)}>",
        '  <link name="link0"/>',
    ]
    for f in robot.frames:
        lines += _link(robot, f.j, values) + _joint(robot, f, values)
    return "\n".join([*lines, "</robot>"]) + "\n", _losses(robot, values)


def _attributes(**numbers: float) -> str:
    return " ".join(f'{key}="{float(x) + 0.0!r}"' for key, x in numbers.items())


def _link(robot: Robot, j: int, values: Mapping[str, float]) -> list[str]:
    standard = [values[parameter(p, j)] for p in INERTIAL] if j in robot.links else []
    if not any(standard):
        return [f'  <link name="link{j}"/>']
    *_, mx, my, mz, M = standard
    if M < 0 or (M == 0 and (mx, my, mz) != (0, 0, 0)):
        raise DescriptionError(
            f"{robot.name}: link {j} has the mass M{j} = {M} and first moments that are not zero, which no "
            "body can have; export a physically feasible estimate (--method feasible)"
        )
    own = inertial_of(standard)
    inertia = dict(zip(MOMENTS, own.I[np.triu_indices(3)], strict=True))
    return [
        f'  <link name="link{j}">',
        "    <inertial>",
        f'      <origin xyz="{_numbers(own.pose[:3, 3])}" rpy="0 0 0"/>',
        f"      <mass {_attributes(value=M)}/>",
        f"      <inertia {_attributes(**inertia)}/>",
        "    </inertial>",
        "  </link>",
    ]


def _numbers(row: Array) -> str:
    return " ".join(repr(float(x) + 0.0) for x in row)


def _joint(robot: Robot, f: Frame, values: Mapping[str, float]) -> list[str]:
    T = transform([e.value(robot.constants) for e in f.at_zero])  # iTj at q_j = 0
    limit = _limit(robot, f)
    endless = f.sigma == REVOLUTE and "lower" not in limit
    lines = [
        f'  <joint name="q{f.j}" type="{"continuous" if endless else _TYPES[f.sigma]}">',
        f'    <parent link="link{f.ant}"/>',
        f'    <child link="link{f.j}"/>',
        f'    <origin xyz="{_numbers(T[:3, 3])}" rpy="{_numbers(_roll_pitch_yaw(T[:3, :3]))}"/>',
    ]
    if f.sigma == FIXED:
        return [*lines, "  </joint>"]
    lines += ['    <axis xyz="0 0 1"/>', f"    <limit {_attributes(**limit)}/>"]
    own = one_joint_parameters(robot, _DYNAMICS)
    dynamics = {
        key: values[name]
        for family, key in _DYNAMICS.items()
        if (name := parameter(family, f.j)) in own & set(values)
    }
    if dynamics:
        lines.append(f"    <dynamics {_attributes(**dynamics)}/>")
    if f.j in robot.constraints:
        leader, multiplier, offset = _follows(robot, f.j)
        lines.append(
            f'    <mimic joint="q{leader}" {_attributes(multiplier=multiplier, offset=offset)}/>'
        )
    return [*lines, "  </joint>"]


def _limit(robot: Robot, f: Frame) -> dict[str, float]:
    k = robot.joints.index(f.j) if f.mu else None
    row = {
        key: robot.limits[key][k]
        for key in ("q", "qd", "tau")
        if k is not None and key in robot.limits
    }
    bounds: dict[str, float] = {}
    if isinstance(ends := row.get("q"), tuple):
        bounds = {"lower": ends[0], "upper": ends[1]}
    elif f.sigma == PRISMATIC:
        bounds = {"lower": -NO_LIMIT, "upper": NO_LIMIT}
    largest = {
        written: row.get(key, NO_LIMIT) for key, written in (("qd", "velocity"), ("tau", "effort"))
    }
    return bounds | {key: x for key, x in largest.items() if not isinstance(x, tuple)}


def _follows(robot: Robot, j: int) -> tuple[int, float, float]:
    """Find the joint i that passive joint j follows, with q_j = multiplier q_i + offset.

    Return i, the multiplier and the offset. Raises DescriptionError if q_j depends on several
    joints.
    """
    e = robot.constraints[j]
    leaders = [i for i in robot.moving if f"q{i}" in e.symbols]
    factor = e.coefficient(f"q{leaders[0]}") if len(leaders) == 1 else None
    if factor is None or (e - factor * Expression.symbol(f"q{leaders[0]}")).symbols & {
        f"q{leaders[0]}"
    }:
        raise DescriptionError(
            f"{robot.name}: q{j} = {e} cannot be written in a URDF, where a joint follows one "
            "other joint with multiplier and offset"
        )
    rest = e - factor * Expression.symbol(f"q{leaders[0]}")
    return leaders[0], factor.value(robot.constants), rest.value(robot.constants)


def _roll_pitch_yaw(R: Array) -> Array:
    """Compute roll, pitch and yaw, rad, of a rotation matrix R = Rz(yaw) Ry(pitch) Rx(roll).

    Roll is computed last, from R without yaw and pitch, so that it is exact at pitch = +-pi/2 too.
    """
    c = math.hypot(R[0, 0], R[1, 0])
    yaw = math.atan2(R[1, 0], R[0, 0]) if c > 1e-12 else 0.0
    pitch = math.atan2(-R[2, 0], c)
    rest = turn(1, pitch).T @ turn(2, yaw).T @ R
    return np.array([math.atan2(rest[2, 1], rest[1, 1]), pitch, yaw])


def _losses(robot: Robot, values: Mapping[str, float]) -> tuple[str, ...]:
    inertial = {parameter(p, j) for j in robot.links for p in INERTIAL}
    lost = [
        name
        for name in robot.parameters
        if name not in inertial | one_joint_parameters(robot, _DYNAMICS)
    ]
    notes = []
    if dropped := [name for name in lost if values.get(name, 0.0)]:
        notes.append(f"values without a place in a URDF, left out: {', '.join(dropped)}")
    if unknown := [name for name in lost if name not in values]:
        notes.append(f"parameters without a place or value: {', '.join(unknown)}")
    notes.append("constants as numbers, frames as placements: formulas are not carried")
    gravity = tuple(e.value(robot.constants) for e in robot.gravity)
    if gravity[:2] != (0.0, 0.0) or gravity[2] >= 0:
        notes.append(
            f"gravity {gravity} m/s^2: a URDF has none, programs assume -z of the root link"
        )
    notes += [
        f"{what} not carried"
        for what in ("title", "source", "drives", "labels")
        if getattr(robot, what)
    ]
    if absent := [key for key in ("q", "qd", "tau") if key not in robot.limits]:
        notes.append(f"no limits of {', '.join(absent)}: written as continuous or {NO_LIMIT:g}")
    return tuple(notes)
