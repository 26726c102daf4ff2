"""Control laws pid and cascade, written as one law with different gains.

    u = P e + Vr qd_r - Vm qd_m + K I + feed-forward,
    dI/dt = Ie e + Ir qd_r - Im qd_m,
    torque = g sat(u).

    pid      P = kp       Vr = Vm = kd                K = ki   Ie = 1    Ir = Im = 0
    cascade  P = kv kp    Vr = kv cv    Vm = kv       K = ki   Ie = kp   Ir = cv   Im = 1

P, Vr, Vm and K are multiplied by the gain of the drive. g multiplies everything between position
error and torque, including the saturation: with g_j = J_j(X)/J_j(reference), a simulation with
other parameters keeps the bandwidth of the real loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from scipy.signal import cont2discrete

from runtime.core.drives import Drives
from runtime.core.model import GeneratedModel, drives_of
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.settings import PerJoint
from runtime.loop.settings import Controller

Array = np.ndarray

VECTORS = (
    "P",
    "Vr",
    "Vm",
    "K",
    "Ie",
    "Ir",
    "Im",
    "antiwindup",
    "saturation",
    "torque_step",
    "encoder_step",
    "g",
)


@dataclass(frozen=True, eq=False)
class ControlLaw:
    """The gains and limits of a closed loop of n joints, as arrays in SI units on the joint side.

    Attributes
    ----------
    P, Vr, Vm, K, Ie, Ir, Im : ndarray, shape (n,)
        Gains of the equations at the head of this module.
    antiwindup, saturation : ndarray, shape (n,)
        Largest |I|, and largest |u| before g.
    torque_step : ndarray, shape (n,), N m or N
        Step of the converter.
    encoder_step, encoder_noise : ndarray, shape (n,), rad or m
        Step of R (q - offset), and standard deviation of its noise.
    ca : ndarray, shape (n,)
        Gain of qdd_r.
    flags : ndarray, shape (4,)
        T; ticks from the position to its torque (0 or 1); weights of (y_k - y_(k-1))/T and
        (y_k - y_(k-2))/T in qd_m.
    R, offset : ndarray, shape (n, n) and (n,)
        The encoder shows R (q - offset).
    """

    P: Array
    Vr: Array
    Vm: Array
    K: Array
    Ie: Array
    Ir: Array
    Im: Array
    antiwindup: Array
    saturation: Array
    torque_step: Array
    encoder_step: Array
    encoder_noise: Array
    ca: Array
    flags: Array
    R: Array
    offset: Array

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.P)

    def matrix(self, g: Array, *, ideal: bool) -> Array:
        """Arrange gains, limits and quantisation steps of the law in a matrix, one row per joint.

        g : factor on the torque, shape (n,). ideal : whether encoder and converter have no steps.
        """
        vectors = {name: getattr(self, name) for name in VECTORS if name != "g"} | {"g": g}
        if ideal:
            vectors |= {"encoder_step": np.zeros(self.joints), "torque_step": np.zeros(self.joints)}
        return np.column_stack(
            [*(vectors[name] for name in VECTORS), self.R, np.linalg.inv(self.R), self.offset]
        )

    def shown(self, q: Array) -> Array:
        """Round joint positions q, shape (n,), as the encoders do; return the rounded positions."""
        step = np.where(self.encoder_step > 0, self.encoder_step, 1.0)
        qm = self.R @ (q - self.offset)
        return np.asarray(
            np.linalg.solve(
                self.R, np.where(self.encoder_step > 0, step * np.floor(qm / step + 0.5), qm)
            )
            + self.offset
        )


def control_law(controller: Controller, model: GeneratedModel) -> ControlLaw:
    """Convert the settings of a controller into a control law for the joints of a model.

    Raise SettingsError if the settings do not fit the model.
    """
    n, law = len(model.JOINTS), controller.law

    def each(path: str, value: PerJoint[float] | None, absent: float = 0.0) -> Array:
        x = np.atleast_1d(np.asarray(absent if value is None else value, dtype=float))
        if len(x) not in (1, n):
            raise SettingsError(
                f"{len(x)} values are given; expected one value, or {n} values (one per "
                f"joint of {model.NAME})",
                path=("controller", *path.split(".")),
            )
        return np.broadcast_to(x, (n,)).copy()

    if law.kd == "fit":
        raise SettingsError(
            "a simulation needs a number, not `fit`; identify the record first, and write the "
            "fitted number here",
            path=("controller", "law", "kd"),
        )
    gains = law.gains(n)
    one, zero = np.ones(n), np.zeros(n)
    if law.kind == "pid":
        integral = {"Ie": one, "Ir": zero, "Im": zero}
    else:
        integral = {"Ie": each("law.kp", law.kp), "Ir": each("law.cv", law.cv), "Im": one}
    drives = (
        drives_of(model) if controller.encoder.side == "motor" else Drives(np.eye(n), zero, one)
    )
    if drives is None:
        raise SettingsError(
            f"side: motor needs drives, but {model.NAME} has no drives; set side: joint, or give "
            "drives in the robot file",
            path=("controller", "encoder", "side"),
        )
    weights = (0.0, 0.5) if controller.velocity == "averaged" else (1.0, 0.0)
    return ControlLaw(
        **gains,
        **integral,
        antiwindup=each("law.antiwindup", law.antiwindup, np.inf),
        saturation=each("torque.saturation", controller.torque.largest(model.LIMITS), np.inf),
        torque_step=each("torque.step", controller.torque.step),
        encoder_step=each("encoder.step", controller.encoder.step),
        encoder_noise=each("encoder.noise", controller.encoder.noise),
        ca=each("law.gain", law.gain) * each("law.ca", law.ca),
        flags=np.array([1 / controller.rate, controller.delay, *weights]),
        R=drives.ratio,
        offset=drives.offset,
    )


def parameters_of(model: GeneratedModel, controller: Controller | None = None) -> Array:
    """Compute the base parameters, shape (b,), from the standard parameters of the robot file.

    `values` of the controller settings replace values of the file. A standard parameter without
    effect is 0 if it has no value.
    """
    changed = {} if controller is None else controller.values
    emitted, where = cast(Any, model), ("controller", "values")
    values = {**dict.fromkeys(emitted.NO_EFFECT, 0.0), **model.VALUES, **changed}
    if missing := [name for name in emitted.STANDARD_PARAMETERS if name not in values]:
        message = (
            f"{model.NAME} has no value of "
            f"{', '.join(missing[:6])}{' ...' if len(missing) > 6 else ''}; give these values in "
            "the robot file"
        )
        if controller is None:
            raise InputError(
                f"{message} (0 for a parameter that is zero), or give a record from which the values are estimated"
            )
        raise SettingsError(
            f"{message} or in controller.values (0 for a parameter that is zero)", path=where
        )
    if unknown := sorted(set(changed) - set(emitted.STANDARD_PARAMETERS)):
        raise SettingsError(
            f"{model.NAME} has no standard parameter {', '.join(unknown)}; correct the "
            "names in controller.values",
            path=where,
        )
    return np.asarray(emitted.base_parameters(values), dtype=float)


def discrete_poles(law: ControlLaw, A: Array, B: Array, g: Array) -> Array:
    """Compute the poles of the sampled closed loop, linearised about a point at rest.

    A, B : inertia matrix and viscous friction, shape (n, n).

    The torque is constant between ticks. State: q, qd, y1, y2, I, u. States without effect, such as
    an integral with gain 0, are left out.
    """
    n = law.joints
    T, delay, last, average = law.flags
    one, zero, inverse = np.eye(n), np.zeros((n, n)), np.linalg.inv(A)
    free = np.block([[zero, one], [zero, -inverse @ B]])
    driven = np.vstack([zero, inverse])
    outputs = np.eye(2 * n), np.zeros((2 * n, n))
    Phi, Gamma, *_ = cont2discrete((free, driven, *outputs), T)  # q, qd after T
    P, Vm, K, Ie, Im, gain = (
        x[:, None] for x in (law.P, law.Vm, law.K, law.Ie, law.Im, np.asarray(g))
    )
    q, qd, y1, y2, I, before = np.split(np.eye(6 * n), 6)
    qd_m = (last + average) / T * q - last / T * y1 - average / T * y2
    u = -P * q - Vm * qd_m + K * I
    moved = Phi @ np.vstack([q, qd]) + Gamma @ (gain * (before if delay else u))
    following = np.vstack([moved, q, y1, I - T * (Ie * q + Im * qd_m), u])
    acting = np.concatenate([np.ones(4 * n, bool), law.K != 0, np.full(n, delay == 1)])
    return np.asarray(np.linalg.eigvals(following[np.ix_(acting, acting)]))


def continuous_pole(law: ControlLaw, A: Array, B: Array, g: Array) -> float:
    """Compute the modulus of the fastest pole of the closed loop in continuous time, 1/s."""
    n = law.joints
    one, zero = np.eye(n), np.zeros((n, n))
    inverse = np.linalg.inv(A)
    P, Vm, K = (np.diag(g * x) for x in (law.P, law.Vm, law.K))
    rates = np.vstack(
        [
            np.hstack([zero, one, zero]),
            np.hstack([-inverse @ P, -inverse @ (Vm + B), inverse @ K]),
            np.hstack([-np.diag(law.Ie), -np.diag(law.Im), zero]),
        ]
    )
    return float(np.abs(np.linalg.eigvals(rates)).max())
