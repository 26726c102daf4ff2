"""The `controller` section of a study file, the closed loop that moves the arm, and its encoders in CESTAC.

The section describes the control law, the reference, the encoders and the drives:

    controller:
      law: {kind: pid, kp: [450, ...], kd: [2.5, ...], ki: 0, gain: [35.24, ...]} rate: 5000
      reference: {points: {duration: 10, seed: 1}} encoder: {step: 2*pi/65536, side: motor}

SI units, rad, joint side. One number applies to all joints.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field

from runtime.core import study as chapter
from runtime.ground.errors import SettingsError
from runtime.ground.settings import (
    Count,
    Many,
    NotNegative,
    PerJoint,
    Positive,
    Real,
    Seed,
    Settings,
    Text,
    Whole,
    require,
)
from runtime.loop.trajectories import motion_from_mapping


def _a_motion(mapping: Mapping[str, Any]) -> Mapping[str, Any]:
    motion_from_mapping(mapping)
    return mapping


class Law(Settings):
    """Settings of the control law of each joint: pid or cascade.

    e = q_r - q_m, u in the unit of the drive, torque = gain u.

    pid      u = kp e + kd (qd_r - qd_m) + ki I,                       I = integral of e
    cascade  u = kv (kp e + cv qd_r - qd_m) + ki I + ca qdd_r,
            I = integral of kp e + cv qd_r - qd_m

    Attributes
    ----------
    kind : str
        pid or cascade.
    kp : float or tuple of float
        Gain of the position; of a cascade in 1/s.
    kd : float or tuple of float or str
        Gain of the velocity of a pid; fit: the gain is estimated together with the parameters, from
        a record whose torque is that of the law.
    kv : float or tuple of float
        Gain of the velocity of a cascade.
    ki : float or tuple of float
        Gain of the integral.
    cv : float or tuple of float
        Share of the reference velocity that a cascade feeds forward.
    ca : float or tuple of float
        Gain of the reference acceleration that a cascade feeds forward.
    gain : float or tuple of float, N m or N
        Torque for one unit of u.
    delay : float or str, s
        Delay from the logged signals to the torque, for a law that replaces a measured torque; fit
        (the default): the delay is estimated together with the parameters. A simulated loop uses
        controller.delay instead.
    antiwindup : float or tuple of float or None
        Largest |I|; null: unlimited.
    """

    kind: Literal["pid", "cascade"] = "pid"
    kp: PerJoint[Real] = 0.0
    kd: PerJoint[Real] | Literal["fit"] = 0.0
    kv: PerJoint[Real] = 0.0
    ki: PerJoint[Real] = 0.0
    cv: PerJoint[Real] = 0.0
    ca: PerJoint[Real] = 0.0
    gain: PerJoint[Real] = 1.0
    delay: Real | Literal["fit"] = "fit"
    antiwindup: PerJoint[Positive] | None = None

    def __post_init__(self) -> None:
        for key in ("kv", "cv", "ca") if self.kind == "pid" else ("kd",):
            value = getattr(self, key)
            none = value != "fit" and not np.any(value)
            require(none, f"{value}, but a {self.kind} law has no gain {key}; remove {key}", key)

    def gains(self, n: int) -> dict[str, np.ndarray]:
        """Return the gains P (position error), Vr, Vm (reference, measured velocity), K (integral).

        The law is u = P e + Vr qd_r - Vm qd_m + K I. Each gain has the shape (n,) and contains the
        gain of the drive: N m or N per unit of e, of its rate, and of I. With kd: fit, kd counts as
        0.
        """

        def each(key: str) -> np.ndarray:
            value = getattr(self, key)
            x = np.atleast_1d(np.asarray(0.0 if value == "fit" else value, dtype=float))
            message = (
                f"{len(x)} values are given; expected one value, or {n} values (one per joint)"
            )
            require(len(x) in (1, n), message, "controller", "law", key)
            return np.broadcast_to(x, (n,)).copy()

        gain, kp, kd, kv, ki, cv = map(each, ("gain", "kp", "kd", "kv", "ki", "cv"))
        if not kp.all():
            text = "expected a gain other than 0 for every joint, to control its position"
            raise SettingsError(f"{self.kp}; {text}", path=("controller", "law", "kp"))
        if self.kind == "pid":
            return {"P": gain * kp, "Vr": gain * kd, "Vm": gain * kd, "K": gain * ki}
        return {"P": gain * (kv * kp), "Vr": gain * (kv * cv), "Vm": gain * kv, "K": gain * ki}


class Encoder(Settings):
    """Model of an encoder: white noise is added to the position, then the sum is rounded to steps.

    Units are rad or m on the side of the encoder.

    Attributes
    ----------
    step : float or tuple of float or None, rad or m
        Size of the steps; null: no steps.
    noise : float or tuple of float, rad or m
        Standard deviation of the noise.
    side : str
        joint or motor.
    """

    step: PerJoint[Positive] | None = None
    noise: PerJoint[NotNegative] = 0.0
    side: Literal["joint", "motor"] = "joint"


class Torque(Settings):
    """Settings of the joint torques, N m or N: limit, resolution, disturbance, noise of the record.

    Attributes
    ----------
    saturation : float or tuple of float or str or None, N m or N
        Largest torque; limits: the limit of the robot file, if it has one; null: unlimited.
    step : float or tuple of float or None, N m or N
        Step of the converter, after the saturation.
    noise : float or tuple of float, N m or N
        Standard deviation of white noise on the recorded torque.
    disturbance : float or tuple of float, N m or N
        Standard deviation of a torque on the arm that is not recorded, white up to `bandwidth`.
    bandwidth : float, Hz
        Bandwidth of the disturbance.
    """

    saturation: PerJoint[Positive] | Literal["limits"] | None = "limits"
    step: PerJoint[Positive] | None = None
    noise: PerJoint[NotNegative] = 0.0
    disturbance: PerJoint[NotNegative] = 0.0
    bandwidth: Positive = 50.0

    def largest(self, limits: Mapping[str, Any]) -> PerJoint[float] | None:
        """Return the largest joint torque, N m or N, from the settings or the limits of the model.

        The result is None if the torque is unlimited.
        """
        if self.saturation != "limits":
            return self.saturation
        return tuple(limits["tau"]) if "tau" in limits else None


class Points(Settings):
    """Settings of a motion between random points in the middle of the range of each joint.

    The speed of the motion is the largest that the limits of the robot file allow.

    Attributes
    ----------
    duration : float, s
        Length of the motion.
    seed : int
        Seed of the points.
    """

    duration: Positive = 10.0
    seed: Seed = 1


class ReferenceSettings(Settings):
    """Motion that the controller follows; at most one of file, record, motion, points.

    Attributes
    ----------
    file : str or None
        CSV with columns q1 ..., qd1 ..., qdd1 ... (and t), at the controller rate, rad or m;
        missing derivatives are computed by differences.
    record : int or None
        Index, from 0, of a record that contains its own reference in the columns qr1 ...
    motion : mapping or None
        Parts with their coefficients, as `runtime.loop.trajectories.motion_from_mapping` reads
        them.
    points : Points or None
        Random points.
    limits : str
        refuse a reference outside the limits of the robot file, or ignore the limits.
    """

    file: Text | None = None
    record: Whole | None = None
    motion: Annotated[Mapping[str, Any], AfterValidator(_a_motion)] | None = None
    points: Points | None = None
    limits: Literal["refuse", "ignore"] = "refuse"

    def __post_init__(self) -> None:
        given = [k for k in ("file", "record", "motion", "points") if getattr(self, k) is not None]
        require(
            len(given) <= 1,
            f"{' and '.join(given)}; expected one of file, record, motion, points",
            *given[1:2],
        )


class Controller(Settings):
    """Settings of a closed loop: control law, encoder, torque and reference.

    Attributes
    ----------
    law : Law
        Control law. If records name q_ref and no tau, its torque replaces the missing torque.
    kp, kd : float or tuple of float or str or None
        Short form of law: {kp: ..., kd: ...}.
    rate : float, Hz
        Rate of the controller; torque is held between its ticks.
    delay : int
        Ticks from measurement to torque, 0 or 1.
    velocity : str
        Computation of qd_m: difference of two successive positions, or averaged, (q_k -
        q_(k-2))/2T.
    feedforward : str
        none; values adds the torque of the reference with the parameters of the robot file; record
        adds the recorded feed-forward torque, `record.columns.tau_ff`.
    encoder : Encoder
        Measurement of the positions.
    torque : Torque
        Path of the torque to the arm and to the record.
    reference : ReferenceSettings
        Motion that the controller follows.
    record_every : int
        Number of ticks per recorded sample.
    settle : float, s
        Time at rest on the first reference point before the motion, if the law has an integral.
    integrator : str
        rk4 in substeps of at most `pole_step` over the fastest closed-loop pole, or cvodes.
    pole_step : float
        Largest product of substep and fastest pole.
    start : tuple of float or None, rad or m
        Joint positions at t = 0; default: the first reference point.
    values : mapping of float
        Parameters, by name, that replace those of the robot file.
    seed : int
        Seed of all noise.
    """

    law: Law = field(default_factory=Law)
    kp: PerJoint[Real] | None = None
    kd: PerJoint[Real] | Literal["fit"] | None = None
    rate: Positive = 1000.0
    delay: Literal[0, 1] = 0
    velocity: Literal["difference", "averaged"] = "difference"
    feedforward: Literal["none", "values", "record"] = "none"
    encoder: Encoder = field(default_factory=Encoder)
    torque: Torque = field(default_factory=Torque)
    reference: ReferenceSettings = field(default_factory=ReferenceSettings)
    record_every: Count = 1
    settle: Annotated[Real, Field(ge=0, le=60)] = 0.5
    integrator: Literal["rk4", "cvodes"] = "rk4"
    pole_step: Positive = 0.2
    start: Many[Real] | None = None
    values: Mapping[Text, Real] = field(default_factory=dict)
    seed: Seed = 1

    def __post_init__(self) -> None:
        given = {key: x for key in ("kp", "kd") if (x := getattr(self, key)) is not None}
        message = "given together with law; kp and kd are short for law: {kp: ..., kd: ...}; remove either these gains or law"
        require(not given or self.law == Law(), message, *list(given)[:1])
        if given:
            object.__setattr__(self, "law", Law(**given))
        object.__setattr__(self, "kp", None)
        object.__setattr__(self, "kd", None)


class CestacSettings(chapter.CestacSettings):
    """Settings of the CESTAC study of encoder resolution, eqs. (15)-(22), (28) of the chapter.

    Attributes
    ----------
    place : str
        Signal that is rounded. record: the positions of the record. loop: the encoder in the closed
        loop of study.controller, which is simulated again in every run.
    """

    place: Literal["record", "loop"] = "record"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.place == "record":
            return
        require(
            self.rounding == "phase",
            f"{self.rounding} with place: loop; expected phase, the only rounding of an encoder in the loop",
            "rounding",
        )
        require(
            not self.uneven,
            f"{self.uneven} with place: loop; the encoder in the loop has even lines: remove uneven",
            "uneven",
        )
        require(
            not self.torque,
            "given with place: loop; remove torque, and set torque steps in controller.torque.step",
            "torque",
        )
