"""A tree of links and joints with any axes, as URDF and MJCF tell it: what both are read into, and
what becomes a table of Khalil frames.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from symgen.description.angles import Angles
from symgen.description.expression import Expression

Array = np.ndarray
MAX_JOINTS = 200
DROPPED = "not read:"  # how the note on elements that are left out starts
EARTH = 9.81  # m/s^2, along -z of the root link
MOVING, FIXED_TYPE, FREE_TYPE = ("revolute", "continuous", "prismatic"), "fixed", "free"


@dataclass(frozen=True)
class Inertial:
    """Mass and inertia of a link.

    Attributes
    ----------
    M : float, kg
        Mass.
    pose : ndarray, shape (4, 4)
        Frame at the centre of mass, in the link frame.
    I : ndarray, shape (3, 3), kg m^2
        Tensor elements about the centre of mass, in that frame.
    """

    M: float
    pose: Array
    I: Array


@dataclass(frozen=True)
class Joint:
    """A joint; along it, torque or force Gamma += armature qdd + damping qd + friction sign(qd) +
    stiffness (q - rest).

    Attributes
    ----------
    name : str
        Of the file.
    kind : str
        One of MOVING, FIXED_TYPE, or FREE_TYPE, which has to be held.
    parent, child : str
        Names of the links; the frame of `child` is the joint frame at q = 0.
    pose : ndarray, shape (4, 4)
        Joint frame in the frame of `parent`.
    axis : ndarray, shape (3,)
        Unit vector in the joint frame.
    line : int
        Of the file.
    limits : mapping, SI and rad
        Among lower, upper, velocity and effort.
    damping, friction, armature, stiffness, rest : float, SI and rad
        As above.
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
class Tree:
    """Links and joints of a robot, in the order of the file.

    Attributes
    ----------
    name : str
        Of the robot.
    links : mapping
        Inertial of each link, None where the file has none.
    joints : tuple of Joint
        One for each link but the root.
    root : str
        The link that has no parent.
    relations : mapping
        Positions of the joints that follow others, by name: linear in those of joints that follow
        none, whose names are the symbols.
    bare : frozenset of str
        Links between the joints of one body, which have no mass.
    gravity : tuple of float, m/s^2
        Acceleration of gravity in the root link.
    notes : tuple of str
        What was not read.
    angles : str
        How angles near multiples of pi/12 were read.
    places : mapping
        Of MJCF, in the order of its bodies: pose (4, 4) of the frame of each body in the frame of
        its link. A URDF has one frame for both.
    """

    name: str
    links: Mapping[str, Inertial | None]
    joints: tuple[Joint, ...]
    root: str
    relations: Mapping[str, Expression] = field(default_factory=dict)
    bare: frozenset[str] = frozenset()
    gravity: tuple[float, float, float] = (0.0, 0.0, -EARTH)
    notes: tuple[str, ...] = ()
    places: Mapping[str, Array] = field(default_factory=dict)
    angles: str = ""


def turn(axis: int, angle: float) -> Array:
    """Rotation matrix about x, y or z (axis 0, 1, 2); quarter turns exact."""
    c, s = math.cos(angle), math.sin(angle)
    c, s = (float(round(x)) if abs(x - round(x)) < 1e-15 else x for x in (c, s))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[j, j], R[j, k], R[k, j], R[k, k] = c, -s, s, c
    return R


def rotation(rpy: Sequence[float], what: str, angles: Angles) -> Array:
    """R = Rz(yaw) Ry(pitch) Rx(roll) of `what`, each as `angles` takes it."""
    roll, pitch, yaw = (
        x if (k := angles.twelfths(x, f"{name} of {what}")) is None else k * (math.pi / 12)
        for name, x in zip(("roll", "pitch", "yaw"), rpy, strict=True)
    )
    return np.asarray(turn(2, yaw) @ turn(1, pitch) @ turn(0, roll))


def transform(row: Sequence[float]) -> Array:
    """iTj = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r) of a row
    gamma, b, alpha, d, theta, r; (4, 4).
    """
    gamma, b, alpha, d, theta, r = row
    T = np.eye(4)
    for axis, angle, shift in ((2, gamma, b), (0, alpha, d), (2, theta, r)):
        step = np.eye(4)
        step[:3, :3], step[axis, 3] = turn(axis, angle), shift
        T = T @ step
    return T
