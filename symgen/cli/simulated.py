"""A simulated record of any robot that has VALUES and LIMITS: for a first look where no measured one can be had.

    q(t)    point to point between random way points: velocity ramps of the third degree, constant velocity between them
    tau     inverse dynamics of the emitted model with the base parameters of VALUES, plus white noise
    motors  qm = R (q - offset) rounded to the encoder step, taum = R'^-1 tau plus noise

Nothing here was measured, and the fit is better than that of any real arm: the model is exact.
"""

from __future__ import annotations

import gzip
from dataclasses import dataclass
from io import BytesIO
from math import pi
from typing import Literal

import numpy as np

from runtime.drives import Drives
from runtime.model import GeneratedModel, require
from runtime.study import Columns, RecordSettings
from symgen.cli.session import SIMULATED

Array = np.ndarray

FILE = "simulated_record.csv.gz"
RATE = 5000.0  # Hz, as the public TX40 record
ENCODER = 2 * pi / 65536  # rad on the motor
NOISE = 0.02  # standard deviation of the torque noise, of the largest torque of each motor
MARGIN = 0.9  # of the limits of speed and acceleration
RAMP = 1 / 3  # of each piece: acceleration, constant velocity, deceleration


@dataclass(frozen=True, eq=False)
class Trajectory:
    """q, qd, qdd of shape (N, n) at the instants t, s."""

    t: Array
    q: Array
    qd: Array
    qdd: Array


def point_to_point(model: GeneratedModel, duration: float, seed: int, rate: float = RATE) -> Trajectory:
    """All joints move together between random points of the middle of their range, as fast as speed and acceleration limits allow.

    The record ends with the last piece that `duration`, s, has room for.
    """
    rng = np.random.default_rng(seed)
    low, high = np.array(model.LIMITS["q"], dtype=float).T
    centre, reach = (low + high) / 2, 0.35 * (high - low)
    speed, acceleration = (MARGIN * np.array(model.LIMITS[key], dtype=float) for key in ("qd", "qdd"))
    N = round(duration * rate)
    t = np.arange(N) / rate
    q, qd, qdd = (np.zeros((N, len(model.JOINTS))) for _ in range(3))
    start, here = 0.0, centre
    while start < duration:
        there = centre + reach * rng.uniform(-1, 1, len(centre))
        way = there - here
        # velocity way/(T (1 - RAMP)); a ramp 3 x**2 - 2 x**3 has the largest slope 1.5
        T = max(np.max(np.abs(way) / speed) / (1 - RAMP), np.sqrt(np.max(np.abs(way) / acceleration) * 1.5 / (RAMP * (1 - RAMP))))
        if start and start + T > duration:
            break
        piece = (t >= start) & (t < start + T)
        s, v, a = _unit_piece((t[piece] - start) / T)
        q[piece], qd[piece], qdd[piece] = here + s[:, None] * way, v[:, None] * way / T, a[:, None] * way / T**2
        start, here = start + T, there
    moved = t < start
    return Trajectory(t[moved], q[moved], qd[moved], qdd[moved])


def motor_record(model: GeneratedModel, duration: float, seed: int) -> tuple[bytes, RecordSettings]:
    """A .csv.gz file t,q1..qn,tau1..taun of the motor side, and the settings that read it."""
    return recorded(model, point_to_point(model, duration, seed), seed)


def recorded(
    model: GeneratedModel, path: Trajectory, seed: int, *, rate: float = RATE, encoder: float = ENCODER, noise: float = NOISE
) -> tuple[bytes, RecordSettings]:
    """The file, and the settings that read it, of a motion: motor positions in steps of `encoder`, torques with white noise.

    rate : Hz.   encoder : rad on the motor.   noise : standard deviation, of the largest torque of each motor.
    """
    require(model, "base_parameters", "inverse_dynamics")
    drives = Drives.from_mapping(model.DRIVES or {"ratio": np.eye(len(model.JOINTS))})
    X = model.base_parameters(model.VALUES)  # type: ignore[attr-defined]
    tau = model.inverse_dynamics(path.q, path.qd, path.qdd, X)  # type: ignore[attr-defined]
    command = drives.motor_command(tau)
    rng = np.random.default_rng([seed, 1])
    command += noise * np.abs(command).max(axis=0) * rng.standard_normal(command.shape)
    qm = encoder * np.round(drives.motor_position(path.q) / encoder)
    n = len(model.JOINTS)
    q_names, tau_names = (tuple(f"{letter}{j}" for j in range(1, n + 1)) for letter in ("q", "tau"))
    stream = BytesIO()
    np.savetxt(stream, np.column_stack([qm, command]), fmt="%.7g", delimiter=",", header=",".join((*q_names, *tau_names)), comments="")
    side: Literal["motor", "joint"] = "motor" if model.DRIVES is not None else "joint"
    name = f"{SIMULATED} {model.NAME}"
    settings = RecordSettings(files=(FILE,), columns=Columns(None, q_names, tau_names), side=side, rate=rate, name=name)
    return gzip.compress(stream.getvalue(), compresslevel=1, mtime=0), settings


def _unit_piece(x: Array) -> tuple[Array, Array, Array]:
    """Position from 0 to 1, velocity and acceleration of one piece at x = t/T from 0 to 1."""
    top = 1 / (1 - RAMP)
    up, down = np.clip(x / RAMP, 0, 1), np.clip((1 - x) / RAMP, 0, 1)
    v = top * np.minimum(up**2 * (3 - 2 * up), down**2 * (3 - 2 * down))
    a = top * 6 / RAMP * np.where(x < 0.5, up * (1 - up), -down * (1 - down))
    rise = top * RAMP * (up**3 - up**4 / 2)
    fall = 1 - top * RAMP * (down**3 - down**4 / 2)
    steady = top * (x - RAMP / 2)
    s = np.where(x < RAMP, rise, np.where(x > 1 - RAMP, fall, steady))
    return s, v, a
