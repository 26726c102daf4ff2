"""The `controller` section of a study file: who moves the arm, along what, and through which converters.

    controller:
      law: {kind: pid, kp: [450, ...], kd: [2.5, ...], ki: 0, gain: [35.24, ...]}
      rate: 5000
      reference: {points: {duration: 10, seed: 1}}
      encoder: {step: 2*pi/65536, side: motor}

SI, rad, joint side. A number stands for all joints. Values are checked where they are made.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from runtime.errors import SettingsError
from runtime.settings.trajectories import motion_from_mapping

Number = float | tuple[float, ...]  # one for all joints, or one per joint


@dataclass(frozen=True)
class Law:
    """Control law of every joint on its own; e = q_r - q_m, u in the unit of the drive, torque = gain u.

    pid      u = kp e + kd (qd_r - qd_m) + ki I,                       I = integral of e
    cascade  u = kv (kp e + cv qd_r - qd_m) + ki I + ca qdd_r,         I = integral of kp e + cv qd_r - qd_m

    kp, kd, kv, ki, ca : gains; kp of a cascade in 1/s.   cv : share of the reference velocity that is fed forward.
    gain : torque per unit of u, N m or N.   antiwindup : largest |I|; null: none.
    """

    kind: Literal["pid", "cascade"] = "pid"
    kp: Number = 0.0
    kd: Number = 0.0
    kv: Number = 0.0
    ki: Number = 0.0
    cv: Number = 0.0
    ca: Number = 0.0
    gain: Number = 1.0
    antiwindup: Number | None = None

    def __post_init__(self) -> None:
        _positive("antiwindup", self.antiwindup)
        for key in ("kv", "cv", "ca") if self.kind == "pid" else ("kd",):
            if any(_each(getattr(self, key))):
                raise SettingsError(f"{getattr(self, key)}; a {self.kind} law has no such gain", path=(key,))


@dataclass(frozen=True)
class Encoder:
    """What the controller sees of the position: noise of deviation `noise`, then steps of size `step`; null: none. Rad or m of that side."""

    step: Number | None = None
    noise: Number = 0.0
    side: Literal["joint", "motor"] = "joint"

    def __post_init__(self) -> None:
        _positive("step", self.step)
        _not_negative("noise", self.noise)


@dataclass(frozen=True)
class Torque:
    """From the command to the arm and to the record, N m or N of the joint.

    saturation : largest torque; "limits": that of the robot file, where it has one; null: none.   step : of the converter, after the saturation.
    noise : deviation of white noise on the recorded torque.   disturbance : deviation of a torque on the arm that nobody records, white up to
    `bandwidth`, Hz.
    """

    saturation: Number | Literal["limits"] | None = "limits"
    step: Number | None = None
    noise: Number = 0.0
    disturbance: Number = 0.0
    bandwidth: float = 50.0

    def __post_init__(self) -> None:
        if self.saturation != "limits":
            _positive("saturation", self.saturation)
        _positive("step", self.step)
        _positive("bandwidth", self.bandwidth)
        _not_negative("noise", self.noise)
        _not_negative("disturbance", self.disturbance)


@dataclass(frozen=True)
class Points:
    """Point to point between random points in the middle of the range, as fast as the limits of the robot file allow; s."""

    duration: float = 10.0
    seed: int = 1

    def __post_init__(self) -> None:
        _positive("duration", self.duration)


@dataclass(frozen=True)
class ReferenceSettings:
    """What the controller follows: one of a file, the reference of a record of the study, a motion by its coefficients, random points.

    file : CSV with columns q1 ..., qd1 ..., qdd1 ... (and t), at the controller rate, rad or m; derivatives that are missing are differences.
    record : index, from 0, of a record that holds its reference, columns qr1 ...   motion : as `runtime.settings.trajectories.motion_from_mapping` reads it.
    limits : "refuse" a reference outside the limits of the robot file, or "ignore" them.
    """

    file: str | None = None
    record: int | None = None
    motion: Mapping[str, Any] | None = None
    points: Points | None = None
    limits: Literal["refuse", "ignore"] = "refuse"

    def __post_init__(self) -> None:
        given = [k for k in ("file", "record", "motion", "points") if getattr(self, k) is not None]
        if len(given) > 1:
            raise SettingsError(f"{' and '.join(given)}; expected one of file, record, motion, points", path=(given[1],))
        if self.motion is not None:
            try:
                motion_from_mapping(self.motion)
            except SettingsError as e:
                raise SettingsError(e.reason, path=("motion", *e.path)) from None


@dataclass(frozen=True)
class Controller:
    """A closed loop.

    rate : of the controller, Hz; torque is held between its ticks.   delay : ticks from measurement to torque, 0 or 1.
    velocity : qd_m as the "difference" of two positions, or of two "averaged" ones, (q_k - q_(k-2))/2T.
    feedforward : "values" adds the torque of the reference with the parameters of the robot file.
    record_every : ticks per recorded sample.   settle : s at rest on the first reference point before the motion, where there is an integral.
    integrator : "rk4" in substeps of at most `pole_step` over the fastest closed-loop pole, or "cvodes".   start : joint positions at t = 0;
    default: the first reference point.   values : parameters that replace those of the robot file.   seed : of all noise.
    """

    law: Law = field(default_factory=Law)
    rate: float = 1000.0
    delay: int = 0
    velocity: Literal["difference", "averaged"] = "difference"
    feedforward: Literal["none", "values"] = "none"
    encoder: Encoder = field(default_factory=Encoder)
    torque: Torque = field(default_factory=Torque)
    reference: ReferenceSettings = field(default_factory=ReferenceSettings)
    record_every: int = 1
    settle: float = 0.5
    integrator: Literal["rk4", "cvodes"] = "rk4"
    pole_step: float = 0.2
    start: tuple[float, ...] | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    seed: int = 1

    def __post_init__(self) -> None:
        _positive("rate", self.rate)
        _positive("pole_step", self.pole_step)
        if not 0 <= self.settle <= 60:
            raise SettingsError(f"{self.settle}; expected 0 to 60 s", path=("settle",))
        if self.delay not in (0, 1):
            raise SettingsError(f"{self.delay} ticks; expected 0 or 1", path=("delay",))
        if self.record_every < 1:
            raise SettingsError(f"{self.record_every}; expected 1 or more ticks per sample", path=("record_every",))
        if self.seed < 0:
            raise SettingsError(f"{self.seed}; expected 0 or more", path=("seed",))


def _positive(key: str, value: Number | None) -> None:
    if value is not None and not all(x > 0 for x in _each(value)):
        raise SettingsError(f"{value}; expected positive numbers", path=(key,))


def _not_negative(key: str, value: Number) -> None:
    if not all(x >= 0 for x in _each(value)):
        raise SettingsError(f"{value}; expected 0 or more", path=(key,))


def _each(value: Number) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)
