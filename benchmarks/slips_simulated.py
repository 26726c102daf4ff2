"""Slips that strangers made, in two robots whose torques are pinocchio's: a six-axis arm with a
wrist and a counterbalance, and one of seven axes. `benchmarks/slips.py` runs them.

Records of 10 s at 1 kHz, a Fourier motion, torque noise of 1 % (AR(0.9)); bodies and frictions of
the seed, of which the values of the robot file are 25 % off.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import truth_simulator as world
from truth_simulator import Bodies, Motion, Robot, Truth

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests" / "support")]

from slip_cases import Case, Slip  # noqa: E402

from symgen.description import load_robot  # noqa: E402
from symgen.description.files import write_robot  # noqa: E402

Array = np.ndarray
SEED = 3_000_007
LOADS = {"wrist": 6.0, "panda": 2.5}
"""Mass of the load, kg, about a twelfth of the robot."""


def text_of(robot: Robot, bodies: Bodies) -> str:
    """The robot file that symgen makes of the URDF with these bodies."""
    with tempfile.TemporaryDirectory() as folder:
        urdf = Path(folder) / f"{robot.name}.urdf"
        urdf.write_text(robot.urdf(bodies), encoding="utf-8")
        text = write_robot(load_robot(str(urdf)), "robot.yaml")[0]
        return text.split("labels:")[0]  # joints by their numbers


def loaded(bodies: Bodies, mass: float, z: float) -> Bodies:
    """The bodies with a point mass of the last link at height z."""
    m, c, J = bodies.mass.copy(), bodies.centre.copy(), bodies.inertia.copy()
    place = np.array([0.0, 0.0, z])
    both = (m[-1] * c[-1] + mass * place) / (m[-1] + mass)
    J[-1] = J[-1] + m[-1] * _point(c[-1] - both) + mass * _point(place - both)
    m[-1], c[-1] = m[-1] + mass, both
    return replace(bodies, mass=m, centre=c, inertia=J)


def _point(x: Array) -> Array:
    return np.asarray(x @ x * np.eye(3) - np.outer(x, x))


class Simulated:
    """One robot: its right study, and the torques of others."""

    def __init__(self, name: str) -> None:
        self.robot = world.ROBOTS[name]
        self.truth, self.move = (
            Truth(self.robot, SEED),
            world.fourier(self.robot, SEED, seconds=10.0),
        )
        self.load = LOADS[name]
        self.balance = np.zeros_like(self.move.q)
        size = float(np.abs(self.truth.torque(self.move)[:, 1]).max())
        self.balance[:, 1] = 0.6 * size * np.sin(self.move.q[:, 1] + 0.4)
        self.right = self.case(self.truth)

    def case(self, truth: Truth, bodies: Bodies | None = None) -> Case:
        """The study of a true robot, values of `bodies` in its file."""
        tau = truth.torque(self.move) + self.balance
        tau = tau + world.noise(tau, 0.9, 0.01, SEED)
        text = text_of(self.robot, bodies or self.robot.nominal)
        return Case(
            text,
            self.move.t,
            self.move.q,
            tau,
            torque_side="joint",
            known=self.balance,
            values=True,
        )

    def with_load(self, z: float) -> Truth:
        return Truth(self.robot, 0, bodies=loaded(self.truth.bodies, self.load, z))

    def slips(self) -> tuple[Slip, ...]:
        """Slips of the two robots, the same numbers in both."""
        n, late = self.robot.n, int(0.04 * world.RATE)
        wrist, at = np.arange(n) >= 3, np.arange

        def lag(x: Array, by: int, chosen: Array) -> Array:
            moved = np.concatenate([np.repeat(x[:1], by, axis=0), x[:-by]])
            return np.where(chosen, moved, x)

        def clipped(c: Case) -> Case:
            most = 0.6 * np.abs(c.tau[:, 1]).max()
            return replace(c, tau=np.where(at(n) == 1, c.tau.clip(-most, most), c.tau))

        def zero(j: int, degrees: float) -> Callable[[Case], Case]:
            return lambda c: replace(c, q=c.q + np.deg2rad(degrees) * (at(n) == j))

        def frozen(c: Case) -> Case:
            q, a = c.q.copy(), len(c.q) // 3
            q[a : a + len(q) // 6, 3] = q[a, 3]
            return replace(c, q=q)

        def wrapped(c: Case) -> Case:
            q, low = c.q.copy(), c.q[:, -1].min() + 1.0
            q[:, -1] = (q[:, -1] - low) % (2 * pi) + low
            return replace(c, q=q)

        def target(c: Case, friction: bool) -> Case:
            own = Truth(self.robot, 0, bodies=self.robot.nominal)
            tau = own.torque(self.move) - (0 if friction else own.friction(self.move.qd))
            return replace(c, tau=tau + self.balance)

        def longer(c: Case) -> Case:
            name, length = {"wrist": ("D3", 0.6), "panda": ("RL5", 0.384)}[self.robot.name]
            return c.text(f"{name}: {length}", f"{name}: {1.1 * length:.6g}")

        last = f"joints? .*({n}|{n - 1}|{n - 2})|of joint ({n}|{n - 1}|{n - 2}|4|3|2)"
        return (
            Slip(1, "torque of joint 2 clipped at 60 %", r"torque of joint 2 is at its largest", clipped),
            Slip(2, "torques of joints 4 on 40 ms late", r"torques? of joints? 4", lambda c: replace(c, tau=lag(c.tau, late, wrist))),
            Slip(3, "joints 4 on logged 40 ms late", r"joints? [4567][^|]*late", lambda c: replace(c, tau=lag(c.tau, late, wrist), q=lag(c.q, late, wrist))),
            Slip(7, "torques of the controller's model", r"no noise", lambda c: target(c, True)),
            Slip(8, "rate 125 for 94", r"sampling rate is [^;]*0\.7[345]", lambda c: replace(c, rate=125 / 94)),
            Slip(9, "rate 300 for 500", r"sampling rate is [^;]*1\.[67]", lambda c: replace(c, rate=0.6)),
            Slip(10, "angle of the last joint wraps", r"starts anew", wrapped),
            Slip(11, "a load not told", rf"(gravity|inertia) torque of joint|unexplained.*{last}|they leave", lambda c: self.case(self.with_load(0.1))),
            Slip(12, "g = 9810", r"gravity is [^;]*(9810|1/1000|1000)", lambda c: c.text("g: 9.81", "g: 9810.0")),
            Slip(13, "zero of joint 3 off by 10 degrees", r"zero of joint 3", zero(2, 10)),
            Slip(14, "zero of joint 2 off by 10 degrees", r"zero of joint 2", zero(1, 10)),
            Slip(15, "zero of joint 3 off by 15 degrees", r"zero of joint 3", zero(2, 15)),
            Slip(16, "sign of the counterbalance", r"known torque", lambda c: replace(c, known=-c.known)),
            Slip(17, "counterbalance forgotten", r"torque of joint 2|counterbalance", lambda c: replace(c, known=None)),
            Slip(18, "centre of the load 0.24 m off", rf"(gravity|inertia) torque of joint|they leave|{last}", lambda c: self.case(self.with_load(0.34), loaded(self.robot.nominal, self.load, 0.1))),
            Slip(19, "frozen encoder of joint 4", r"froze", frozen),
            Slip(20, "torque of joint 3 20 ms late", r"torques? of joints? 3 (is|are) late", lambda c: replace(c, tau=lag(c.tau, late // 2, at(n) == 2))),
            Slip(21, "the same without friction", r"No joint shows friction", lambda c: target(c, False)),
            Slip(22, "position of joint 3 times 1.1", r"position of joint 3 must be multiplied by 0\.9[01]", lambda c: replace(c, q=c.q * np.where(at(n) == 2, 1.1, 1.0))),
            Slip(23, "position of joint 4 times 0.5", r"position of joint 4 must be multiplied by (2|1\.9|2\.0)", lambda c: replace(c, q=c.q * np.where(at(n) == 3, 0.5, 1.0))),
            Slip(24, "a length 10 % too long", r"[dr] of frame [35] is", longer),
        )  # fmt: skip


def campaigns() -> list[tuple[str, Case, tuple[Slip, ...]]]:
    """Name, right study and slips."""
    made = [Simulated("wrist"), Simulated("panda")]
    return [(f"{one.robot.name}, pinocchio", one.right, one.slips()) for one in made]


__all__ = ["Motion", "campaigns"]
