"""Check, joint by joint, whether the simulation follows the record, as IV and DIDIM assume.

    position    100 rms(q_s - q)/std(q)
            of the simulation with the parameters found, g = 1
    tracking    100 rms(q_s - q)/rms(q_r - q)
            100 %: the reference predicts the motion as well; only if the reference is known
    torque      100 ||tau_s - tau||/||tau||           decimated, on the rows of the observation

If the simulated motion differs from the measured motion, the instruments Z (or the output error)
belong to another experiment, and a small residual says nothing about this robot. The limits are
conventions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from runtime.core.least_squares.estimate import Status
from runtime.core.least_squares.linear import ordinary, percent
from runtime.core.least_squares.method import Beginning, Fitted, Method
from runtime.core.model import joint_labels
from runtime.core.rows.observation import Observation
from runtime.ground.errors import InputError
from runtime.ground.limits import limits
from runtime.loop.closed_loop import ClosedLoop, loop_of, observed_loop
from runtime.loop.fixed_point import FixedPointOptions
from runtime.loop.law_check import law_text

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True)
class JointMotion:
    """Difference between the simulated and the measured motion of one joint.

    Attributes
    ----------
    joint : str
        Label of the joint.
    rms : float, rad or m
        Root mean square of q_s - q.
    position : float, %
        This rms relative to the standard deviation of q.
    tracking : float, %
        This rms relative to the rms of the tracking error q_r - q; nan if the reference is not
        known.
    torque : float, %
        100 ||tau_s - tau||/||tau||.
    """

    joint: str
    rms: float
    position: float
    tracking: float
    torque: float

    @property
    def apart(self) -> str:
        """Text on how the simulation differs from the record; "" if it follows the record."""
        if not self.position <= LIMIT.MOTION_APART:
            return f"position of joint {self.joint} off by {self.position:.0f} % of its motion"
        if self.tracking > LIMIT.MOTION_TRACKING and self.position > LIMIT.MOTION_SMALL:
            return (
                f"position of joint {self.joint} off by {self.tracking:.0f} % of its tracking error"
            )
        return (
            f"torque of joint {self.joint} off by {self.torque:.0f} %"
            if self.torque > LIMIT.MOTION_TORQUE
            else ""
        )


def simulated_motion(
    loop: ClosedLoop, observation: Observation, X: Array
) -> tuple[JointMotion, ...]:
    """Simulate the records with base parameters X, and compare the motion of each joint.

    X has shape (b,). Raise InputError if the simulation is not possible.
    """
    runs = loop.run(X)
    gaps = [
        False if part.record.missing is None else part.record.missing.at_joints()
        for part in loop.parts
    ]
    q = [
        np.where(missing, np.nan, part.record.q)
        for part, missing in zip(loop.parts, gaps, strict=True)
    ]
    every = loop.simulator.controller.record_every
    error = np.concatenate([run.q[: len(x)] - x for run, x in zip(runs, q, strict=True)])
    moved = np.concatenate([x - np.nanmean(x, axis=0) for x in q])
    lag = np.concatenate(
        [part.reference.q[::every][: len(x)] - x for part, x in zip(loop.parts, q, strict=True)]
    )
    tau = loop.outputs(loop.torques(runs), observation)
    rms, size, tracking = (np.sqrt(np.nanmean(x**2, axis=0)) for x in (error, moved, lag))
    return tuple(
        JointMotion(
            label,
            float(rms[j]),
            100 * float(rms[j] / size[j]) if size[j] > 0 else float("inf"),
            100 * float(rms[j] / tracking[j])
            if tracking[j] > 0 and not loop.assumption
            else float("nan"),
            percent(
                (tau - observation.Y)[observation.joint(j)], observation.Y[observation.joint(j)]
            ),
        )
        for j, label in enumerate(joint_labels(loop.model))
    )


def judge_motion(
    loop: ClosedLoop, observation: Observation, X: Array
) -> tuple[Status, str, Mapping[str, Any]]:
    """Judge whether the simulation with parameters X follows the records.

    Returns the status, the message and the details for an Estimate. X holds all base parameters.
    """
    law = law_text(loop.law) if loop.law else ""
    details: dict[str, Any] = {"law": [vars(one) for one in loop.law]} if loop.law else {}
    try:
        motion = simulated_motion(loop, observation, X)
    except InputError as e:
        return (
            "simulation-apart",
            f"The loop cannot be simulated with these parameters: {e}. {law}".strip(),
            details,
        )
    apart = [text for one in motion if (text := one.apart)]
    details |= {"motion": [vars(one) for one in motion]}
    if not apart:
        return "ok", law, details
    return (
        "simulation-apart",
        f"The simulation does not follow the record: {', '.join(apart)}. The controller, its "
        "gains, its delay, the reference or the parameters are not those of "
        f"the record; what was fitted says nothing about this robot. {law}",
        details,
    )


def beside_record(fit: Callable[[Beginning], Fitted], start: Beginning) -> Fitted:
    """Run a method that simulates the loop, and check that its last simulation follows the record.

    fit : function of the method.
    """
    fitted = fit(start)
    loop = loop_of(start.observation, start.settings.method)
    X = loop.all_of(start.system.names, fitted.solution.X)
    status, note, motion = judge_motion(loop, start.observation, X)
    return replace(
        fitted,
        status=status if fitted.status == "ok" else fitted.status,
        message=" ".join(text for text in (fitted.message, note) if text),
        details={**fitted.details, **motion},
    )


def simulating_method(fit: Callable[[Beginning], Fitted], rounding: str) -> Method:
    """Make the Method of an estimator that simulates the closed loop of the records.

    rounding : sentence of the method on a study that rounds recorded positions.
    """
    return Method(
        FixedPointOptions,
        ordinary,
        partial(beside_record, fit),
        observe=observed_loop,
        rounding=rounding,
    )
