"""Robots, motions, noises, encoders and a control loop for `benchmarks/truth.py`, that share no code
with symgen's derivation or runtime's simulation.

    robot = ROBOTS["anthropomorphic"]
    truth = Truth(robot, seed=1)                  # random plausible bodies and frictions
    move = fourier(robot, seed=1, seconds=10.0)   # t, q, qd, qdd
    tau = truth.torque(move)                      # pinocchio's recursive Newton-Euler, plus friction
    q = encoded(move, Encoder(step=2*pi/1000), seed=1)

A robot is URDF text that pinocchio and symgen both read; the text given to symgen has the nominal
bodies (a CAD file that is some 30 % off), that of pinocchio the true ones. Friction is
FV qd + FS sign(qd), with sign(0) = 0. Units: SI, rad.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi

import numpy as np
import pinocchio as pin
from scipy.signal import lfilter

Array = np.ndarray
RATE = 1000.0
"""Sampling rate of all records, Hz."""


# Robots ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Joint:
    """A joint and the link behind it.

    Attributes
    ----------
    xyz, rpy : tuple of float, m, rad
        Place in the frame of the joint before.
    axis : tuple of float
    mass : float, kg
        Nominal mass of the link.
    box : tuple of float, m
        Edges of the nominal body, a uniform box.
    centre : tuple of float, m
        Middle of the box in the frame of the link.
    reach : float, rad or m
        Half of the range that motions use.
    speed : float, rad/s or m/s
        Largest speed of the Fourier motion.
    slides : bool
        Prismatic.
    """

    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]
    axis: tuple[float, float, float]
    mass: float
    box: tuple[float, float, float]
    centre: tuple[float, float, float]
    reach: float
    speed: float
    slides: bool = False


@dataclass(frozen=True)
class Bodies:
    """mass (n,) kg, centre (n, 3) m, inertia (n, 3, 3) kg m^2 about the centre, viscous and dry friction (n,)."""

    mass: Array
    centre: Array
    inertia: Array
    viscous: Array
    dry: Array


@dataclass(frozen=True)
class Robot:
    """An open chain."""

    name: str
    joints: tuple[Joint, ...]

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def slides(self) -> Array:
        """Which joints are prismatic, (n,)."""
        return np.array([j.slides for j in self.joints])

    @cached_property
    def nominal(self) -> Bodies:
        """Uniform boxes; friction in proportion to what the joint carries."""
        mass = np.array([j.mass for j in self.joints])
        box = np.array([j.box for j in self.joints])
        square = box**2
        diagonal = mass[:, None] / 12 * (square.sum(axis=1, keepdims=True) - square)
        carried = np.cumsum(mass[::-1])[::-1]
        length = np.array([np.linalg.norm(j.box) for j in self.joints])
        dry = np.where(self.slides, 1.5 * carried, 0.25 * carried * length + 0.05)
        centre = np.array([j.centre for j in self.joints])
        return Bodies(mass, centre, np.array([np.diag(d) for d in diagonal]), 0.6 * dry, dry)

    def bodies(self, seed: int) -> Bodies:
        """Random plausible bodies: the nominal box of another density with three more masses on it."""
        rng, own = np.random.default_rng([seed, 101]), self.nominal
        mass, centre, inertia = own.mass.copy(), own.centre.copy(), own.inertia.copy()
        for k, joint in enumerate(self.joints):
            density = rng.uniform(0.75, 1.25)
            m, c, J = mass[k] * density, centre[k], inertia[k] * density
            for part in rng.uniform(0.02, 0.15, 3) * mass[k]:
                p = own.centre[k] + 0.5 * np.array(joint.box) * rng.uniform(-1, 1, 3)
                both = (m * c + part * p) / (m + part)
                J = J + m * _point(c - both) + part * _point(p - both)
                m, c = m + part, both
            mass[k], centre[k], inertia[k] = m, c, J
        return Bodies(
            mass,
            centre,
            inertia,
            own.viscous * rng.uniform(0.6, 1.6, self.n),
            own.dry * rng.uniform(0.6, 1.6, self.n),
        )

    @cached_property
    def effort(self) -> Array:
        """Limits of the torque in the file, (n,): 1000 N m or N for the robots of FIRST and SPECIAL,
        as when their tables were made; else three times the largest torque of the nominal bodies.
        """
        if self not in (*SECOND, *THIRD, *FOURTH):
            return np.full(self.n, 1000.0)
        still = replace(self.nominal, viscous=np.zeros(self.n), dry=np.zeros(self.n))
        motion = fourier(self, 0)
        free = pin.buildModelFromXML(self._urdf(still, np.full(self.n, 1000.0)))
        data = free.createData()
        tau = [
            pin.rnea(free, data, *(x[i] for x in (motion.q, motion.qd, motion.qdd)))
            for i in range(0, len(motion.t), 10)
        ]
        own = self.nominal
        rest = own.viscous * np.abs(motion.qd).max(axis=0) + own.dry
        return np.asarray(3 * (np.abs(tau).max(axis=0) + rest))

    def urdf(self, bodies: Bodies) -> str:
        """URDF of the chain with those bodies."""
        return self._urdf(bodies, self.effort)

    def _urdf(self, bodies: Bodies, effort: Array) -> str:
        lines = [f'<robot name="{self.name}">', '<link name="base"/>']
        for k, joint in enumerate(self.joints):
            J, c = bodies.inertia[k], bodies.centre[k]
            entries = " ".join(
                f'i{"xyz"[a]}{"xyz"[b]}="{float(J[a, b])!r}"' for a in range(3) for b in range(a, 3)
            )
            lines += [
                f'<joint name="joint{k + 1}" type="{"prismatic" if joint.slides else "revolute"}">',
                f'<parent link="{f"link{k}" if k else "base"}"/><child link="link{k + 1}"/>',
                f'<origin xyz="{_text(joint.xyz)}" rpy="{_text(joint.rpy)}"/><axis xyz="{_text(joint.axis)}"/>',
                f'<limit lower="{-1.2 * joint.reach}" upper="{1.2 * joint.reach}" effort="{float(effort[k])!r}" velocity="{2 * joint.speed}"/>',
                f'<dynamics damping="{float(bodies.viscous[k])!r}" friction="{float(bodies.dry[k])!r}"/>',
                "</joint>",
                f'<link name="link{k + 1}"><inertial><origin xyz="{_text(c)}" rpy="0 0 0"/>',
                f'<mass value="{float(bodies.mass[k])!r}"/><inertia {entries}/></inertial></link>',
            ]
        return "\n".join([*lines, "</robot>"])


def _point(x: Array) -> Array:
    """Inertia of a unit mass at x about the origin."""
    return np.asarray(x @ x * np.eye(3) - np.outer(x, x))


def _text(values: Sequence[float] | Array) -> str:
    return " ".join(repr(float(v)) for v in values)


X, Y, Z, O = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
RIGHT, LEFT, OVER = (pi / 2, 0.0, 0.0), (-pi / 2, 0.0, 0.0), (pi, 0.0, 0.0)


def _robot(name: str, *joints: Joint) -> Robot:
    return Robot(name, joints)


FIRST = (
    _robot(
        "planar",
        Joint(O, O, Y, 8.0, (0.5, 0.1, 0.1), (0.25, 0.0, 0.0), 1.4, 3.0),
        Joint((0.5, 0.0, 0.0), O, Y, 4.0, (0.4, 0.08, 0.08), (0.2, 0.0, 0.0), 1.6, 4.0),
    ),
    _robot(
        "scara",
        Joint((0.0, 0.0, 0.3), O, Z, 9.0, (0.35, 0.12, 0.1), (0.17, 0.0, 0.0), 1.8, 3.5),
        Joint((0.35, 0.0, 0.05), O, Z, 6.0, (0.3, 0.1, 0.12), (0.14, 0.0, 0.02), 2.0, 4.5),
        Joint((0.28, 0.0, 0.0), O, Z, 2.0, (0.04, 0.04, 0.4), (0.005, 0.0, 0.0), 0.08, 0.4, True),
        Joint(O, O, Z, 0.8, (0.12, 0.06, 0.05), (0.03, 0.0, -0.1), 2.6, 8.0),
    ),
    _robot(
        "anthropomorphic",
        Joint((0.0, 0.0, 0.4), O, Z, 15.0, (0.2, 0.2, 0.3), (0.03, 0.0, -0.1), 2.2, 2.5),
        Joint((0.05, 0.0, 0.0), LEFT, Z, 10.0, (0.5, 0.12, 0.14), (0.24, 0.0, 0.04), 1.1, 2.5),
        Joint((0.45, 0.0, 0.0), O, Z, 6.0, (0.45, 0.1, 0.1), (0.18, -0.02, -0.02), 1.3, 3.5),
    ),
    _robot(
        "wrist",
        Joint((0.0, 0.0, 0.5), O, Z, 30.0, (0.3, 0.3, 0.4), (0.05, 0.0, -0.15), 2.2, 2.0),
        Joint((0.1, 0.0, 0.0), LEFT, Z, 20.0, (0.6, 0.15, 0.16), (0.28, 0.0, 0.1), 1.0, 2.0),
        Joint((0.6, 0.0, 0.0), O, Z, 12.0, (0.2, 0.25, 0.2), (0.04, 0.03, 0.0), 1.2, 2.5),
        Joint((0.08, 0.55, 0.0), LEFT, Z, 5.0, (0.12, 0.12, 0.35), (0.0, 0.01, -0.2), 2.4, 4.0),
        Joint(O, RIGHT, Z, 2.5, (0.12, 0.14, 0.1), (0.0, 0.02, 0.02), 1.7, 4.5),
        Joint(O, LEFT, Z, 1.5, (0.12, 0.1, 0.08), (0.02, 0.01, 0.1), 2.8, 6.0),
    ),
    _robot(
        "panda",
        Joint((0.0, 0.0, 0.333), O, Z, 4.9, (0.12, 0.2, 0.25), (0.0, 0.02, -0.1), 2.2, 1.8),
        Joint(O, LEFT, Z, 3.5, (0.12, 0.25, 0.14), (0.0, -0.05, 0.03), 1.4, 1.8),
        Joint((0.0, -0.316, 0.0), RIGHT, Z, 3.2, (0.16, 0.16, 0.2), (0.03, 0.03, -0.06), 2.2, 1.8),
        Joint((0.0825, 0.0, 0.0), RIGHT, Z, 3.5, (0.2, 0.2, 0.13), (-0.05, 0.1, 0.02), 1.3, 1.8),
        Joint(
            (-0.0825, 0.384, 0.0), LEFT, Z, 2.2, (0.13, 0.16, 0.3), (-0.01, 0.04, -0.1), 2.2, 2.2
        ),
        Joint(O, RIGHT, Z, 1.6, (0.14, 0.1, 0.12), (0.06, -0.01, -0.01), 1.7, 2.2),
        Joint((0.088, 0.0, 0.0), RIGHT, Z, 1.2, (0.1, 0.1, 0.12), (0.01, 0.0, 0.07), 2.4, 2.2),
    ),
)
SECOND = (
    _robot(
        "elbow",
        Joint((0.0, 0.0, 0.2), LEFT, Z, 6.0, (0.35, 0.1, 0.12), (0.16, 0.0, 0.05), 1.3, 3.0),
        Joint((0.35, 0.0, 0.05), RIGHT, Z, 3.0, (0.1, 0.1, 0.25), (0.02, 0.02, 0.1), 1.9, 4.0),
    ),
    _robot(
        "rail",
        Joint(O, (0.0, pi / 2, 0.0), Z, 25.0, (0.3, 0.3, 0.2), (0.0, 0.0, 0.0), 0.5, 1.0, True),
        Joint(
            (0.15, 0.0, 0.0),
            (0.0, -pi / 2, 0.0),
            Z,
            10.0,
            (0.2, 0.2, 0.25),
            (0.03, 0.0, 0.1),
            2.2,
            2.5,
        ),
        Joint((0.06, 0.0, 0.2), LEFT, Z, 8.0, (0.45, 0.1, 0.12), (0.2, 0.0, 0.03), 1.1, 2.5),
        Joint((0.42, 0.0, 0.0), O, Z, 4.0, (0.4, 0.09, 0.09), (0.16, -0.02, 0.0), 1.4, 3.5),
    ),
    _robot(
        "palletizer",
        Joint((0.0, 0.0, 0.6), O, Z, 60.0, (0.5, 0.5, 0.5), (0.08, 0.0, -0.2), 2.4, 1.6),
        Joint((0.2, 0.0, 0.0), LEFT, Z, 35.0, (0.9, 0.2, 0.2), (0.4, 0.0, 0.1), 0.9, 1.6),
        Joint((0.85, 0.0, 0.0), O, Z, 25.0, (0.9, 0.2, 0.2), (0.35, -0.05, 0.0), 1.0, 2.0),
        Joint((0.8, 0.0, 0.0), O, Z, 6.0, (0.15, 0.2, 0.2), (0.05, 0.03, 0.0), 1.2, 3.0),
        Joint(
            (0.1, 0.0, 0.0),
            (0.0, pi / 2, 0.0),
            Z,
            3.0,
            (0.2, 0.15, 0.1),
            (0.03, 0.02, 0.06),
            2.8,
            5.0,
        ),
    ),
    _robot(
        "offset_wrist",
        Joint((0.0, 0.0, 0.15), O, Z, 7.0, (0.15, 0.15, 0.18), (0.0, 0.02, -0.02), 2.4, 2.2),
        Joint((0.0, 0.12, 0.0), LEFT, Z, 13.0, (0.5, 0.13, 0.13), (0.22, 0.0, 0.02), 1.2, 2.2),
        Joint((0.43, 0.0, 0.0), O, Z, 5.0, (0.45, 0.1, 0.1), (0.2, 0.01, -0.09), 1.5, 2.6),
        Joint((0.39, 0.0, 0.0), O, Z, 1.9, (0.1, 0.13, 0.1), (0.0, 0.02, 0.03), 2.0, 3.5),
        Joint((0.0, 0.0, 0.11), RIGHT, Z, 1.9, (0.1, 0.13, 0.1), (0.0, -0.02, 0.03), 2.2, 3.5),
        Joint((0.0, 0.0, 0.095), LEFT, Z, 0.8, (0.12, 0.08, 0.08), (0.02, 0.01, 0.05), 2.6, 4.5),
    ),
)
THIRD = (
    _robot(
        "cylindrical",
        Joint((0.0, 0.0, 0.3), O, Z, 30.0, (0.3, 0.3, 0.6), (0.04, 0.0, 0.1), 2.3, 1.8),
        Joint((0.12, 0.0, 0.4), O, Z, 15.0, (0.35, 0.2, 0.2), (0.08, 0.02, 0.0), 0.3, 0.7, True),
        Joint(
            (0.1, 0.0, 0.0),
            (0.0, pi / 2, 0.0),
            Z,
            6.0,
            (0.1, 0.1, 0.7),
            (0.0, 0.0, 0.1),
            0.3,
            0.9,
            True,
        ),
        Joint((0.0, 0.0, 0.45), O, Z, 1.6, (0.14, 0.08, 0.1), (0.03, 0.01, 0.06), 2.7, 6.0),
    ),
    _robot(
        "skewed",
        Joint(
            (0.0, 0.0, 0.25), (0.5, 0.0, 0.0), Z, 7.0, (0.2, 0.15, 0.2), (0.03, 0.0, 0.05), 2.0, 3.0
        ),
        Joint(
            (0.1, 0.0, 0.15),
            (-1.0, 0.4, 0.0),
            Z,
            5.0,
            (0.35, 0.1, 0.12),
            (0.15, 0.0, 0.02),
            1.3,
            3.0,
        ),
        Joint(
            (0.3, 0.05, 0.0),
            (0.7, -0.3, 0.2),
            Z,
            2.5,
            (0.3, 0.08, 0.08),
            (0.12, 0.02, 0.0),
            1.6,
            4.0,
        ),
    ),
    _robot(
        "hanging",
        Joint((0.0, 0.0, 1.5), OVER, Z, 18.0, (0.25, 0.25, 0.25), (0.03, 0.0, 0.1), 2.3, 2.0),
        Joint((0.12, 0.0, 0.25), LEFT, Z, 12.0, (0.4, 0.14, 0.14), (0.17, 0.0, 0.03), 1.1, 2.2),
        Joint((0.35, 0.0, 0.0), O, Z, 7.0, (0.18, 0.2, 0.16), (0.05, 0.04, 0.0), 1.3, 2.8),
        Joint((0.1, 0.3, 0.0), LEFT, Z, 3.0, (0.1, 0.1, 0.3), (0.01, 0.0, -0.1), 2.4, 4.0),
        Joint(O, RIGHT, Z, 1.8, (0.12, 0.2, 0.1), (0.02, 0.06, 0.01), 1.8, 4.5),
    ),
    _robot(
        "seven_offset",
        Joint((0.0, 0.0, 0.3), O, Z, 5.5, (0.15, 0.15, 0.25), (0.02, 0.01, -0.05), 2.2, 1.8),
        Joint((0.08, 0.05, 0.0), LEFT, Z, 4.5, (0.2, 0.14, 0.16), (0.03, -0.05, 0.03), 1.3, 1.8),
        Joint(
            (0.02, -0.28, 0.12), RIGHT, Z, 3.5, (0.14, 0.14, 0.22), (0.02, 0.02, -0.05), 2.2, 2.0
        ),
        Joint((0.06, 0.0, 0.0), RIGHT, Z, 3.0, (0.16, 0.18, 0.14), (-0.03, 0.06, 0.02), 1.4, 2.0),
        Joint((-0.05, 0.3, 0.09), LEFT, Z, 2.0, (0.12, 0.13, 0.2), (0.01, 0.03, -0.06), 2.3, 2.5),
        Joint((0.0, 0.05, 0.0), RIGHT, Z, 1.5, (0.12, 0.12, 0.12), (0.03, 0.01, 0.02), 1.7, 2.6),
        Joint((0.07, 0.0, 0.08), RIGHT, Z, 0.9, (0.1, 0.09, 0.1), (0.015, 0.01, 0.05), 2.5, 3.0),
    ),
)
FOURTH = (
    _robot(
        "polar",
        Joint((0.0, 0.0, 0.5), O, Z, 22.0, (0.3, 0.3, 0.5), (0.03, 0.01, -0.1), 2.2, 2.0),
        Joint((0.0, 0.1, 0.0), LEFT, Z, 14.0, (0.25, 0.25, 0.3), (0.02, -0.04, 0.05), 1.0, 2.2),
        Joint(O, RIGHT, Z, 7.0, (0.1, 0.1, 0.8), (0.0, 0.01, -0.15), 0.25, 0.8, True),
        Joint((0.0, 0.0, 0.3), O, Z, 1.4, (0.1, 0.14, 0.1), (0.03, 0.0, 0.04), 2.6, 6.0),
    ),
    _robot(
        "snake",
        Joint((0.0, 0.0, 0.2), (0.0, 0.3, 0.0), Z, 6.0, (0.16, 0.16, 0.2), O, 2.0, 2.5),
        Joint((0.03, 0.0, 0.15), LEFT, Z, 4.0, (0.3, 0.1, 0.1), (0.13, 0.0, 0.02), 1.2, 2.8),
        Joint((0.28, 0.0, 0.02), RIGHT, Z, 2.8, (0.26, 0.1, 0.1), (0.11, 0.01, 0.0), 1.3, 3.2),
        Joint((0.25, 0.0, 0.02), LEFT, Z, 1.8, (0.22, 0.08, 0.08), (0.09, 0.0, 0.01), 1.5, 4.0),
    ),
    _robot(
        "wall",
        Joint(
            (0.0, 0.0, 1.0), (0.0, 1.1, 0.0), Z, 26.0, (0.3, 0.25, 0.3), (0.04, 0.0, -0.1), 2.1, 1.9
        ),
        Joint((0.15, 0.0, 0.1), LEFT, Z, 17.0, (0.6, 0.14, 0.15), (0.26, 0.01, 0.07), 1.0, 2.0),
        Joint((0.55, 0.0, 0.0), O, Z, 9.0, (0.25, 0.2, 0.2), (0.06, 0.05, 0.0), 1.2, 2.4),
        Joint((0.1, 0.4, 0.0), LEFT, Z, 4.0, (0.12, 0.12, 0.3), (0.0, 0.01, -0.15), 2.3, 3.5),
        Joint(
            (0.0, 0.0, 0.1),
            (0.0, pi / 3, 0.0),
            Z,
            2.2,
            (0.12, 0.14, 0.12),
            (0.02, 0.01, 0.03),
            2.0,
            4.0,
        ),
        Joint(
            (0.0, 0.0, 0.12),
            (0.0, -pi / 3, 0.0),
            Z,
            1.2,
            (0.14, 0.1, 0.1),
            (0.03, 0.0, 0.06),
            2.7,
            5.5,
        ),
    ),
    _robot(
        "bridge",
        Joint(O, (0.0, pi / 2, 0.0), Z, 35.0, (0.3, 0.9, 0.2), (0.0, 0.05, 0.0), 0.5, 0.9, True),
        Joint(O, (pi / 2, 0.0, 0.0), Z, 16.0, (0.3, 0.25, 0.3), (0.02, 0.0, 0.0), 0.4, 0.9, True),
        Joint(
            (0.1, 0.0, 0.0),
            (0.0, -0.8, 0.4),
            Z,
            5.0,
            (0.14, 0.14, 0.3),
            (0.02, 0.01, 0.1),
            2.2,
            3.0,
        ),
        Joint((0.0, 0.05, 0.25), LEFT, Z, 3.2, (0.3, 0.1, 0.1), (0.12, 0.0, 0.03), 1.3, 3.4),
        Joint((0.3, 0.0, 0.0), RIGHT, Z, 1.3, (0.1, 0.12, 0.12), (0.02, 0.02, 0.05), 2.4, 5.0),
    ),
)
SPECIAL = (
    _robot(
        "pan_tilt",
        Joint((0.0, 0.0, 0.1), O, Z, 3.0, (0.15, 0.15, 0.1), (0.0, 0.01, 0.0), 2.4, 3.0),
        Joint((0.04, 0.0, 0.0), LEFT, Z, 9.0, (0.3, 0.2, 0.25), (0.06, -0.02, 0.02), 1.2, 3.0),
    ),
    _robot(
        "gantry",
        Joint(O, (0.0, pi / 2, 0.0), Z, 40.0, (0.4, 1.0, 0.2), O, 0.6, 0.8, True),
        Joint(O, (pi / 2, 0.0, 0.0), Z, 20.0, (0.3, 0.3, 0.3), O, 0.4, 0.8, True),
        Joint(O, (0.0, pi / 2, 0.0), Z, 8.0, (0.5, 0.1, 0.1), O, 0.25, 0.6, True),
    ),
)
ROBOTS: Mapping[str, Robot] = {
    robot.name: robot for robot in (*FIRST, *SECOND, *THIRD, *FOURTH, *SPECIAL)
}


class Truth:
    """A robot of known bodies.

    Attributes
    ----------
    robot : Robot
    bodies : Bodies
    """

    def __init__(self, robot: Robot, seed: int, *, bodies: Bodies | None = None) -> None:
        self.robot = robot
        self.bodies = bodies or robot.bodies(seed)
        self.model = pin.buildModelFromXML(robot.urdf(self.bodies))
        self.data = self.model.createData()

    def torque(self, move: Motion) -> Array:
        """Joint torques of a motion, shape (N, n): rigid bodies by pinocchio, plus friction."""
        model, data, tau = self.model, self.data, np.empty_like(move.q)
        for i in range(len(tau)):
            tau[i] = pin.rnea(model, data, move.q[i], move.qd[i], move.qdd[i])
        return np.asarray(tau + self.friction(move.qd))

    def friction(self, qd: Array) -> Array:
        """FV qd + FS sign(qd), shape of qd."""
        return np.asarray(self.bodies.viscous * qd + self.bodies.dry * np.sign(qd))

    def changed(self, share: float, seed: int) -> Truth:
        """The robot with one body `share` heavier and its friction changed alike: every standard
        parameter of one random link (mass, moments and inertia) and its FV, FS times 1 + share.
        """
        k = int(np.random.default_rng([seed, 77]).integers(self.robot.n))
        factor = np.where(np.arange(self.robot.n) == k, 1 + share, 1.0)
        b = self.bodies
        return Truth(
            self.robot,
            0,
            bodies=Bodies(
                b.mass * factor,
                b.centre,
                b.inertia * factor[:, None, None],
                b.viscous * factor,
                b.dry * factor,
            ),
        )


# Motions -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Motion:
    """t (N,), q, qd, qdd (N, n)."""

    t: Array
    q: Array
    qd: Array
    qdd: Array

    def at(self, shift: Array) -> Array:
        """Positions `shift` seconds later, shape (N,) or (N, n): by Taylor, exact for shifts of a
        part of a period.
        """
        s = shift if np.ndim(shift) == 2 else np.asarray(shift)[:, None]
        third = np.gradient(self.qdd, self.t, axis=0)
        return np.asarray(self.q + s * self.qd + s**2 / 2 * self.qdd + s**3 / 6 * third)


def _times(seconds: float) -> Array:
    return np.arange(round(seconds * RATE)) / RATE


def _fitted(robot: Robot, t: Array, q: Array, qd: Array, qdd: Array, share: float = 1.0) -> Motion:
    """Scaled by joint so that neither the range nor the speed exceeds that of the robot; the middle
    of the range is at a random place of nothing: zero.
    """
    reach = np.array([j.reach for j in robot.joints])
    speed = np.array([j.speed for j in robot.joints])
    scale = share * np.minimum(reach / np.abs(q).max(axis=0), speed / np.abs(qd).max(axis=0))
    return Motion(t, q * scale, qd * scale, qdd * scale)


def fourier(robot: Robot, seed: int, seconds: float = 10.0, slow: float = 1.0) -> Motion:
    """Five harmonics of 1/seconds of about 0.2 to 1.5 Hz; slow : times and speeds by this factor."""
    rng, t = np.random.default_rng([seed, 11]), _times(seconds)
    base = max(round(0.2 * seconds), 1) / seconds / slow
    q, qd, qdd = np.zeros((3, len(t), robot.n))
    for k in range(1, 6):
        w = 2 * pi * base * k
        for j in range(robot.n):
            a, b = rng.standard_normal(2) / k
            q[:, j] += a * np.sin(w * t) + b * np.cos(w * t)
            qd[:, j] += w * (a * np.cos(w * t) - b * np.sin(w * t))
            qdd[:, j] -= w**2 * (a * np.sin(w * t) + b * np.cos(w * t))
    return _fitted(robot, t, q, qd, qdd) if slow == 1 else _slowed(robot, t, q, qd, qdd, slow)


def _slowed(robot: Robot, t: Array, q: Array, qd: Array, qdd: Array, slow: float) -> Motion:
    q = q - (q.max(axis=0) + q.min(axis=0)) / 2
    reach = np.array([j.reach for j in robot.joints])
    speed = np.array([j.speed for j in robot.joints]) / slow
    scale = np.minimum(speed / np.abs(qd).max(axis=0), reach / np.abs(q).max(axis=0))
    return Motion(t, q * scale, qd * scale, qdd * scale)


def slow(robot: Robot, seed: int, seconds: float = 10.0) -> Motion:
    """The Fourier motion at a twelfth of the speed."""
    return fourier(robot, seed, seconds, slow=12.0)


def crawl(robot: Robot, seed: int, seconds: float = 10.0) -> Motion:
    """The Fourier motion at a hundredth of the speed."""
    return fourier(robot, seed, seconds, slow=100.0)


def chirp(robot: Robot, seed: int, seconds: float = 10.0) -> Motion:
    """One chirp by joint, from 0.1 to 1 to 2 Hz, of random directions and sizes."""
    rng, t = np.random.default_rng([seed, 13]), _times(seconds)
    low, high = rng.uniform(0.08, 0.2, robot.n), rng.uniform(1.0, 2.0, robot.n)
    rise = (high - low) / seconds
    phase = 2 * pi * (low * t[:, None] + rise * t[:, None] ** 2 / 2) + rng.uniform(
        0, 2 * pi, robot.n
    )
    w, wd = 2 * pi * (low + rise * t[:, None]), 2 * pi * rise
    q, qd, qdd = np.sin(phase), w * np.cos(phase), wd * np.cos(phase) - w**2 * np.sin(phase)
    return _fitted(robot, t, q, qd, qdd, share=1.0)


def points(robot: Robot, seed: int, seconds: float = 10.0, rest: float = 0.25) -> Motion:
    """From random point to random point, all joints together, speed of smooth trapezoids; `rest` of
    the time at rest.
    """
    rng, t = np.random.default_rng([seed, 17]), _times(seconds)
    reach = np.array([j.reach for j in robot.joints])
    speed = np.array([j.speed for j in robot.joints])
    q, qd, qdd = np.zeros((3, len(t), robot.n))
    here, begin = reach * rng.uniform(-0.9, 0.9, robot.n), 0.0
    q[:] = here
    while begin < seconds:
        there = reach * rng.uniform(-0.9, 0.9, robot.n)
        ramp = rng.uniform(0.2, 0.35)
        last = float((np.abs(there - here) / speed).max()) + ramp
        u = t - begin
        moving, after = (u >= 0) & (u < last), u >= last
        v, a, s = _trapezoid(u[moving], last, ramp)
        q[moving] = here + np.outer(s, there - here)
        qd[moving], qdd[moving] = np.outer(v, there - here), np.outer(a, there - here)
        q[after] = there
        here, begin = there, begin + last * (1 + rest / (1 - rest) * rng.uniform(0.5, 1.5))
    return Motion(t, q, qd, qdd)


def _trapezoid(u: Array, last: float, ramp: float) -> tuple[Array, Array, Array]:
    """Speed, acceleration and place of a unit way in time `last`; ramps of sin^2."""
    top = 1 / (last - ramp)

    def up(x: Array) -> tuple[Array, Array, Array]:
        y = np.clip(x, 0, ramp)
        return (
            top * np.sin(pi * y / (2 * ramp)) ** 2,
            np.where((x > 0) & (x < ramp), top * pi / (2 * ramp) * np.sin(pi * y / ramp), 0.0),
            top * (y / 2 - ramp / (2 * pi) * np.sin(pi * y / ramp)) + top * np.maximum(x - ramp, 0),
        )

    rise, fall = up(u), up(u - (last - ramp))
    return rise[0] - fall[0], rise[1] - fall[1], rise[2] - fall[2]


MOTIONS: Mapping[str, Callable[..., Motion]] = {
    "fourier": fourier,
    "chirp": chirp,
    "points": points,
    "slow": slow,
    "crawl": crawl,
}


# Noise and encoders ------------------------------------------------------------------------------

NOISES: Mapping[str, float] = {"white": 0.0, "AR(0.9)": 0.9, "AR(0.99)": 0.99, "AR(0.999)": 0.999}


def noise(tau: Array, rho: float, share: float, seed: int) -> Array:
    """Stationary first-order autoregressive noise of `share` of the rms torque of each joint, (N, n)."""
    rng = np.random.default_rng([seed, 23])
    e = rng.standard_normal(tau.shape)
    e[1:] *= np.sqrt(1 - rho**2)
    return np.asarray(
        share * np.sqrt((tau**2).mean(axis=0)) * lfilter([1.0], [1.0, -rho], e, axis=0)
    )


@dataclass(frozen=True)
class Encoder:
    """An incremental encoder at each joint.

    Attributes
    ----------
    step : float, rad
        Of joints that turn; those that slide have step * `metres`.
    random : float, steps
        Deviation of each line from even spacing.
    eccentric : float, steps
        Size of an error once a turn.
    quadrature : float, steps
        Size of a pattern that repeats every four lines.
    jitter : float, periods
        Deviation of the sampling instants, which the stamps do not tell.
    lost : int
        Counts lost at one instant of each joint.
    metres : float, m/rad
    """

    step: float
    random: float = 0.0
    eccentric: float = 0.0
    quadrature: float = 0.0
    jitter: float = 0.0
    lost: int = 0
    metres: float = 0.1

    def steps(self, robot: Robot) -> Array:
        """Steps by joint, (n,), rad or m."""
        return np.where(robot.slides, self.step * self.metres, self.step)


@dataclass(frozen=True)
class Lines:
    """The lines of the encoders of one robot: the same in its loop and in its record.

    q of joint j is in count k while lines[k] <= q < lines[k + 1]; what is reported is the middle of
    an even interval, k*step + phase.
    """

    step: Array
    phase: Array
    first: tuple[int, ...]
    edges: tuple[Array, ...] = field(repr=False)

    def counts(self, q: Array) -> Array:
        """Counts, integers, shape of q (..., n); ValueError where q leaves the scale."""
        for j, edges in enumerate(self.edges):
            if q[..., j].min() < edges[0] or q[..., j].max() >= edges[-1]:
                raise ValueError(f"joint {j + 1} leaves its scale of {len(edges)} lines")
        columns = [
            np.searchsorted(self.edges[j], q[..., j], side="right") - 1 + self.first[j]
            for j in range(len(self.step))
        ]
        return np.stack(columns, axis=-1)

    def position(self, counts: Array) -> Array:
        """What the encoder says, rad or m: the middle of the even interval."""
        return np.asarray(counts * self.step + self.phase)


def lines_of(robot: Robot, encoder: Encoder, seed: int) -> Lines:
    """Lines at random phase with the errors of the encoder, over four times the range of each joint."""
    rng, step = np.random.default_rng([seed, 31]), encoder.steps(robot)
    phase, first, edges = step * rng.uniform(-0.5, 0.5, robot.n), [], []
    for j, joint in enumerate(robot.joints):
        most = int(np.ceil(2 * joint.reach / step[j])) + 8
        k = np.arange(-most, most + 1)
        turn = 2 * pi * k * encoder.step / (2 * pi) + rng.uniform(0, 2 * pi)
        pattern = rng.permutation([-1.0, 1.0, -1.0, 1.0] * np.array([1.0, 0.3, 0.5, 0.8]))
        pattern -= pattern.mean()
        error = (
            encoder.random * rng.standard_normal(len(k))
            + encoder.eccentric * np.sin(turn)
            + encoder.quadrature * pattern[k % 4] / np.sqrt((pattern**2).mean())
        )
        first.append(-most)
        edges.append(np.maximum.accumulate((k - 0.5 + error) * step[j] + phase[j]))
    return Lines(step, phase, tuple(first), tuple(edges))


def encoded(robot: Robot, move: Motion, encoder: Encoder, seed: int) -> Array:
    """Positions that the encoder reports of a motion, (N, n)."""
    rng = np.random.default_rng([seed, 37])
    N = len(move.t)
    q = move.at(encoder.jitter / RATE * rng.standard_normal(N)) if encoder.jitter else move.q
    lines = lines_of(robot, encoder, seed)
    k = lines.counts(q)
    for j in range(robot.n) if encoder.lost else ():
        k[int(N * rng.uniform(0.25, 0.75)) :, j] -= encoder.lost * rng.choice([-1, 1])
    return lines.position(k)


# Control loop ------------------------------------------------------------------------------------


def in_loop(
    truth: Truth, reference: Motion, encoder: Encoder, seed: int, share: float = 0.01
) -> tuple[Motion, Array, Array]:
    """The reference followed by a PD controller that sees counts: motion, reported positions,
    torques of the drives with white noise of `share`.

    tau = tau_ff + Kp (q_r - q_e) + Kd (qd_r - qd_e), q_e by counts, qd_e by their difference through
    a low-pass of 25 Hz, tau_ff by the nominal bodies; held for a tick. Friction in the loop is
    FV qd + FS tanh(qd/v) with v a thousandth of the largest speed. Integrated by the explicit
    midpoint rule, four steps a tick.
    """
    robot, model, data = truth.robot, truth.model, truth.data
    rng, b = np.random.default_rng([seed, 41]), truth.bodies
    lines, n = lines_of(robot, encoder, seed), robot.n
    nominal = Truth(robot, 0, bodies=robot.nominal)
    ff = nominal.torque(reference)
    M = np.mean(
        [np.diag(pin.crba(model, data, q)) for q in reference.q[:: len(reference.q) // 20]], axis=0
    )
    w = 2 * pi * 3.0
    Kp, Kd = w**2 * M, 1.4 * w * M
    v = 2e-3 * np.array([j.speed for j in robot.joints])
    v = np.maximum(
        v, 4e-4 * b.dry / M
    )  # the step of 0.25 ms stays below a half of the time constant
    viscous, dry = b.viscous, b.dry
    wn = share * np.sqrt((ff**2).mean(axis=0))
    x, xd = reference.q[0].copy(), reference.qd[0].copy()
    N, h, keep = len(reference.t), 0.25 / RATE, np.exp(-2 * pi * 25 / RATE)
    q, qd, qdd, told, tau = np.empty((5, N, n))
    seen, speed = lines.position(lines.counts(x)), xd.copy()

    def acceleration(x: Array, xd: Array, torque: Array) -> Array:
        return np.asarray(
            pin.aba(model, data, x, xd, torque - viscous * xd - dry * np.tanh(xd / v))
        )

    for i in range(N):
        before, seen = seen, lines.position(lines.counts(x))
        if i:
            speed = keep * speed + (1 - keep) * (seen - before) * RATE
        torque = ff[i] + Kp * (reference.q[i] - seen) + Kd * (reference.qd[i] - speed)
        q[i], qd[i], qdd[i] = x, xd, acceleration(x, xd, torque)
        told[i], tau[i] = seen, torque + wn * rng.standard_normal(n)
        for _ in range(4):
            a = acceleration(x, xd, torque)
            a = acceleration(x + h / 2 * xd, xd + h / 2 * a, torque)
            x, xd = x + h * xd + h**2 / 2 * a, xd + h * a
    return Motion(reference.t, q, qd, qdd), told, tau


__all__ = [
    "FIRST", "FOURTH", "MOTIONS", "NOISES", "RATE", "ROBOTS", "SECOND", "SPECIAL", "THIRD", "Bodies", "Encoder", "Lines", "Motion",
    "Robot", "Truth", "encoded", "in_loop", "lines_of", "noise", "replace",
]  # fmt: skip
