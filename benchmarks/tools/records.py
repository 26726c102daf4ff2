"""The records of the comparison, their splits and their treatment: frozen before any tool was run.

Splits. TX40: 0 to 3.7 s fitted, 3.7 to 7.5 s predicted. EMPS: its record fitted, that with force
pulses predicted. KR300: A fitted, B predicted, 1.8 to 8.2 s of both, torque of the hydraulic
counterbalance subtracted, CAD values with a load of 150 kg in the robot file. Go2: runs 0 to 6
fitted, 7 predicted, torque = kp (q_ref - q) + kd (qd_ref - qd). Simulated: a motion fitted, another
predicted, whose torques have no noise; pinocchio makes all torques.

Treatment of the arrays that every tool is given: Butterworth of order 4 without lag on positions
and torques, central differences twice, 0.1 s of each end left out, samples left out where a joint
is slower than a hundredth of its largest speed, every k-th sample so that some 1,500 stay. The
cut-off is each tool's own choice out of CUTOFFS: the one by which a fit of half of the record
predicts the other half best, both ways; of Go2, run 0 and run 1. What is predicted is treated by
the cut-off `score` of the record, which no tool chooses.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.io import loadmat
from scipy.signal import butter, sosfiltfilt

import symgen
from runtime.core.drives import Drives
from runtime.reading.datasets import fetch
from runtime.reading.files import read_bytes
from symgen.description import Robot, load_robot
from symgen.description.files import write_robot

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "benchmarks")]

import kr300 as source  # noqa: E402
import truth_simulator as world  # noqa: E402

Array = np.ndarray
CUTOFFS, SAMPLES, END, SLOW = (5.0, 10.0, 20.0, 40.0, 80.0), 1500, 0.1, 0.01
ROBOTS, SEED, SEEDS = ("anthropomorphic", "wrist", "panda"), 30_000_001, 5
DATA = source.DATA.parent


@dataclass(frozen=True)
class Piece:
    """A record without gaps, as measured, joint side, SI: t (N,), q and tau (N, n)."""

    t: Array
    q: Array
    tau: Array

    def cut(self, rows: slice | Array) -> Piece:
        return Piece(self.t[rows], self.q[rows], self.tau[rows])


@dataclass(frozen=True)
class Case:
    """What is fitted and predicted.

    Attributes
    ----------
    robot : str
        Text of the robot file that symgen reads; the others read the URDF of it.
    train, test : tuple of Piece
    score : float, Hz
        Cut-off of what is predicted; 0: it is exact.
    coupled : tuple of int
        Joints, from 0, of which a motor turns with both: three more columns.
    exact : tuple of ndarray, optional
        q, qd, qdd, tau that are predicted, without noise.
    repeats : tuple of tuples of Piece
        Records that differ in noise, or in time, alone: spread of the parameters.
    """

    name: str
    robot: str
    suffix: str
    train: tuple[Piece, ...]
    test: tuple[Piece, ...]
    score: float
    coupled: tuple[int, ...] = ()
    exact: tuple[Array, ...] = ()
    repeats: tuple[tuple[Piece, ...], ...] = ()

    def halves(self) -> tuple[Piece, Piece]:
        """Two parts of what is fitted, by which settings are chosen."""
        if len(self.train) > 1:
            return self.train[0], self.train[1]
        k = len(self.train[0].t) // 2
        return self.train[0].cut(slice(0, k)), self.train[0].cut(slice(k, None))

    @cached_property
    def description(self) -> Robot:
        with TemporaryDirectory() as folder:
            path = Path(folder) / f"{self.name}.{self.suffix}"
            path.write_text(self.robot, encoding="utf-8")
            return load_robot(str(path))

    def urdf(self) -> str:
        """The URDF of the robot; names of joints that sort as their numbers do."""
        if self.suffix == "urdf":
            return self.robot
        text = write_robot(self.description, "robot.urdf")[0]
        for j in range(1, 10):
            text = text.replace(f'"joint{j}"', f'"joint0{j}"').replace(f'"link{j}"', f'"link0{j}"')
        return text

    def table(self) -> Array:
        """d, a, alpha and angle of the frames, (n + 1, 4), modified Denavit and Hartenberg, a and
        alpha a line up as Craig counts them; empty for a tree or a sliding joint.
        """
        frames = [f for f in self.description.frames if f.sigma != 2]
        if any(f.sigma != 0 or f.ant != f.j - 1 for f in frames):
            return np.zeros((0, 4))
        rows = np.zeros((len(frames) + 1, 4))
        for k, f in enumerate(frames):
            value = self.description.constants
            rows[k, 1:3] = f.d.value(value), f.alpha.value(value)
            rows[k, 3] = f.theta.value({**value, f"q{f.j}": 0.0})
            rows[k + 1, 0] = f.r.value(value)
        return rows


def treated(pieces: tuple[Piece, ...], cutoff: float) -> tuple[Array, ...]:
    """q, qd, qdd, tau, each (K, n), of all pieces."""
    rows = []
    total = sum(len(piece.t) for piece in pieces)
    for piece in pieces:
        h = (piece.t[-1] - piece.t[0]) / (len(piece.t) - 1)
        sos = butter(4, cutoff, fs=1 / h, output="sos")
        q, tau = (sosfiltfilt(sos, x, axis=0) for x in (piece.q, piece.tau))
        qd = np.gradient(q, h, axis=0)
        qdd = np.gradient(qd, h, axis=0)
        end = round(END / h)
        keep = slice(end, len(q) - end, max(total // SAMPLES, 1))
        rows.append(tuple(x[keep] for x in (q, qd, qdd, tau)))
    q, qd, qdd, tau = (np.concatenate(column) for column in zip(*rows, strict=True))
    moving = (np.abs(qd) > SLOW * np.abs(qd).max(axis=0)).all(axis=1)
    return q[moving], qd[moving], qdd[moving], tau[moving]


def tx40() -> Case:
    robot = load_robot("tx40")
    drives = Drives.from_mapping(symgen.model(robot).DRIVES)
    q, tau = (
        np.loadtxt(read_bytes(fetch("tx40", name)).decode().splitlines(), delimiter=",", skiprows=1)
        for name in ("pos_read_data.csv", "curr_data.csv")
    )
    t = np.arange(len(q)) / 5000
    whole = Piece(t, drives.joint_position(q), drives.joint_torque(tau))
    first, second = whole.cut(t < 3.7), whole.cut((t >= 3.7) & (t < 7.5))
    text = (ROOT / "symgen/description/robots/tx40.yaml").read_text(encoding="utf-8")
    return Case("tx40", text, "yaml", (first,), (second,), 50.0, coupled=(4, 5))


def emps() -> Case:
    def piece(name: str) -> Piece:
        data = loadmat(fetch("emps", name))
        return Piece(data["t"].ravel(), data["qm"], data["gtau"].item() * data["vir"])

    text = (ROOT / "symgen/description/robots/emps.yaml").read_text(encoding="utf-8")
    return Case(
        "emps", text, "yaml", (piece("DATA_EMPS.mat"),), (piece("DATA_EMPS_PULSES.mat"),), 80.0
    )


def kr300() -> Case:
    def piece(name: str) -> Piece:
        data = loadmat(DATA / "kr300" / f"{name}.mat", simplify_cells=True)["rec"]
        t, q = data["time_cont"], np.deg2rad(data["act_pos_mot_deg"]).T
        tau = data["act_torque_abs_nm"].T * np.array(source.RATIO) - source.counterbalance(q)
        return Piece(t, q, tau).cut((t >= 1.8 - END) & (t <= 8.2 + END))

    return Case("kr300", source.robot_text(150.0), "yaml", (piece("A"),), (piece("B"),), 10.0)


def go2() -> Case:
    def piece(k: int) -> Piece:
        data = np.load(DATA / "go2" / f"run{k}.npz")
        tau = data["kp"] * (data["q_ref"] - data["q"]) + data["kd"] * (data["qd_ref"] - data["qd"])
        t = np.linspace(data["t"][0], data["t"][-1], len(tau))
        return Piece(t, data["q"].astype(float), tau.astype(float))

    text = (DATA / "go2/go2.xml").read_text(encoding="utf-8").replace("<freejoint/>", "")
    runs = tuple(piece(k) for k in range(8))
    repeats = tuple((run,) for run in runs[:7])
    return Case("go2", text, "xml", runs[:7], runs[7:], 10.0, repeats=repeats)


def simulated(name: str) -> Case:
    """A record of 10 s: 1 % noise of AR(0.9), an encoder of 20,000 lines a turn."""
    robot = world.ROBOTS[name]
    truth, move = world.Truth(robot, SEED), world.fourier(robot, SEED)
    other = world.fourier(robot, SEED + 1)
    tau, encoder = truth.torque(move), world.Encoder(2 * np.pi / 20_000)
    records = tuple(
        (
            Piece(
                move.t, world.encoded(robot, move, encoder, s), tau + world.noise(tau, 0.9, 0.01, s)
            ),
        )
        for s in range(SEED, SEED + SEEDS)
    )
    exact = tuple(x[::10] for x in (other.q, other.qd, other.qdd, truth.torque(other)))
    return Case(
        name, robot.urdf(robot.nominal), "urdf", records[0], (), 0.0, exact=exact, repeats=records
    )


CASES: dict[str, Callable[[], Case]] = {
    "tx40": tx40,
    "emps": emps,
    "kr300": kr300,
    "go2": go2,
    **{name: partial(simulated, name) for name in ROBOTS},
}


def slips(piece: Piece) -> dict[str, Piece]:
    """What goes wrong in laboratories."""
    q, tau = piece.q, piece.tau
    last = q.shape[1] - 1
    gain, sign = np.ones(last + 1), np.ones(last + 1)
    gain[1], sign[1] = 2.0, -1.0
    swapped = tau[:, [1, 0, *range(2, last + 1)]]
    k = round(0.02 * (len(q) - 1) / (piece.t[-1] - piece.t[0]))
    late = np.concatenate([np.repeat(tau[:1], k, axis=0), tau[:-k]])
    return {
        "torque of joint 2 twice too large": replace(piece, tau=tau * gain),
        "positions in degrees": replace(piece, q=np.rad2deg(q)),
        "torques of joints 1 and 2 swapped": replace(piece, tau=swapped),
        "position of joint 2 with the wrong sign": replace(piece, q=q * sign),
        "torques 20 ms late": replace(piece, tau=late),
    }
