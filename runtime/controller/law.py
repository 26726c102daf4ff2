"""Joint torques computed by the control law, for records that contain no measured torque.

Many legged robots log only q, the reference and the gains.

    tau = sat(P (q_ref - q) + Vr qd_ref - Vm qd + tau_ff)

P, Vr and Vm are the gains of `runtime.loop.settings.Law` on the joint side, in SI. qd is the
recorded velocity or, without one, the difference q_k - q_(k-1) over the period. With kd: fit, the
torque of kd is left out and the sum is not cut at the saturation: `runtime.controller.fitted`
estimates kd together with the parameters, and cuts then.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.ground.errors import SettingsError
from runtime.loop.settings import Controller

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class TorqueLaw:
    """The control law of n joints, which gives torques from recorded signals.

    Attributes
    ----------
    P, Vr, Vm : ndarray, shape (n,)
        Gains of position, reference velocity and velocity.
    saturation : ndarray, shape (n,), N m or N
        Largest torque; inf if none is given.
    fit : bool
        Whether kd is estimated.
    delay : float, s
        Delay from the logged signals to the torque.
    """

    P: Array
    Vr: Array
    Vm: Array
    saturation: Array
    fit: bool = False
    delay: float = 0.0

    def signals(self, t: Array, own: Mapping[str, Array], rate: float) -> dict[str, Array]:
        """Add the torques of the control law and the velocity errors to the signals of a record.

        The new signals are tau and law_v = qd_ref - qd; both are late by the delay. own : signals
        of the whole record, by name.
        """
        v = own.get("qd_ref", 0.0) - velocity(own["q"], own, rate)
        made = {"tau": self.torque(own["q"], own, rate), "law_v": v}
        return {**own, **{key: late(t, x, self.delay) for key, x in made.items()}}

    def torque(self, q: Array, channels: Mapping[str, Array], rate: float) -> Array:
        """Compute the torques of the control law, shape (N, n), N m or N.

        Parameters
        ----------
        q : ndarray, shape (N, n), rad or m
            Joint positions.
        channels : mapping
            q_r; qd, qd_ref and tau_ff where they were recorded, shape (N, n).
        rate : float, Hz
            Sampling rate.
        """
        tau = self.P * (channels["q_r"] - q) + channels.get("tau_ff", 0.0)
        if np.any(self.Vr) or np.any(self.Vm):
            qd = velocity(q, channels, rate) if np.any(self.Vm) else 0.0
            tau = tau + self.Vr * channels.get("qd_ref", 0.0) - self.Vm * qd
        bound = np.inf if self.fit else self.saturation
        return np.asarray(np.clip(tau, -bound, bound))


def velocity(q: Array, channels: Mapping[str, Array], rate: float) -> Array:
    """Return joint velocities, shape (N, n): the recorded qd, or else backward differences of q."""
    if "qd" in channels:
        return channels["qd"]
    return np.asarray(np.diff(q, axis=0, prepend=q[:1]) * rate)


def late(t: Array, x: Array, delay: float) -> Array:
    """Delay a signal, sampled at times t, by `delay` seconds: return x(t - delay), same shape.

    A cubic spline interpolates between samples; the end values repeat.
    """
    if not delay:
        return x
    from scipy.interpolate import CubicSpline  # 60 ms, where it is used

    return np.asarray(CubicSpline(t, x)(np.clip(t - delay, t[0], t[-1])))


def torque_law(controller: Controller | None, n: int, limits: Mapping[str, Any]) -> TorqueLaw:
    """Make the control law that gives the torques of n joints from the controller settings.

    Raise SettingsError for gains that need more than the recorded signals, such as that of an
    integral.

    limits : limits of the robot file.
    """
    law = (controller or Controller()).law
    gains = law.gains(n)
    if np.any(gains["K"]):
        raise SettingsError(
            f"an integral gain ki ({law.ki}) is not supported here: a record does not contain the "
            "state of the integrator, so the torque can be computed only from kp and "
            "kd; remove ki",
            path=("controller", "law", "ki"),
        )
    if np.any(law.ca):
        raise SettingsError(
            f"a feed-forward gain ca ({law.ca}) is not supported here; remove ca, and give the "
            "column of the feed-forward torque in record.columns.tau_ff",
            path=("controller", "law", "ca"),
        )
    largest = None if controller is None else controller.torque.largest(limits)
    bound = np.atleast_1d(np.asarray(np.inf if largest is None else largest, dtype=float))
    if len(bound) not in (1, n):
        raise SettingsError(
            f"{len(bound)} values are given; expected one value, or {n} values (one per joint)",
            path=("controller", "torque", "saturation"),
        )
    saturation = np.broadcast_to(bound, (n,)).copy()
    fit, delay = law.kd == "fit", 0.0 if law.delay == "fit" else float(law.delay)
    return TorqueLaw(gains["P"], gains["Vr"], gains["Vm"], saturation, fit, delay)
