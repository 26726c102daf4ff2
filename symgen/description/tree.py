"""A tree of links and joints with any axes, as URDF and MJCF tell it: what both are read into, and what becomes a table of Khalil frames."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

Array = np.ndarray
MAX_JOINTS = 200
GRAVITY = 9.81  # m/s^2, along -z of the root link
MOVING, FIXED_TYPE = ("revolute", "continuous", "prismatic"), "fixed"


@dataclass(frozen=True)
class Inertial:
    """M, kg; pose (4, 4) of the centre-of-mass frame in the link frame; I (3, 3) about that point, kg m^2, tensor elements."""

    M: float
    pose: Array
    I: Array


@dataclass(frozen=True)
class Joint:
    """A joint: `pose` (4, 4) of its frame in that of the parent link, unit `axis` in the joint frame; child link frame = joint frame at 0.

    Along the joint, torque or force Gamma += armature qdd + damping qd + friction sign(qd) + stiffness (q - rest).
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Array
    axis: Array
    line: int
    limits: Mapping[str, float] = field(default_factory=dict)
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0


@dataclass(frozen=True)
class Relation:
    """q = sum of factor times q of the leaders + offset, the leaders by name and independent of each other."""

    leaders: Mapping[str, Fraction]
    offset: Fraction


@dataclass(frozen=True)
class Tree:
    """Links by name and joints, both in the order of the file; the link that has no parent; the joints that follow others, by name."""

    name: str
    links: Mapping[str, Inertial | None]
    joints: tuple[Joint, ...]
    root: str
    relations: Mapping[str, Relation] = field(default_factory=dict)
    bare: frozenset[str] = frozenset()  # links between the joints of one body, which have no mass
    gravity: tuple[float, float, float] = (0.0, 0.0, -GRAVITY)
    notes: tuple[str, ...] = ()


def turn(axis: int, angle: float) -> Array:
    """Rotation matrix about x, y or z (axis 0, 1, 2); quarter turns exact."""
    c, s = math.cos(angle), math.sin(angle)
    c, s = (float(round(x)) if abs(x - round(x)) < 1e-15 else x for x in (c, s))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[j, j], R[j, k], R[k, j], R[k, k] = c, -s, s, c
    return R


def transform(row: Sequence[float]) -> Array:
    """iTj = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r) of a row gamma, b, alpha, d, theta, r; (4, 4)."""
    gamma, b, alpha, d, theta, r = row
    T = np.eye(4)
    for axis, angle, shift in ((2, gamma, b), (0, alpha, d), (2, theta, r)):
        step = np.eye(4)
        step[:3, :3], step[axis, 3] = turn(axis, angle), shift
        T = T @ step
    return T
