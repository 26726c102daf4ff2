"""Measure how well a motion lets the parameters be identified, and check its limits.

The measure is a criterion of the weighted observation matrix W_w (chapter, section 2.2.3): rows of
joint j are divided by the standard deviation s_j of its torque, columns are multiplied by the size
of their parameter, so that parameters are compared by their relative error.

    W_w = diag(1/s_j) W diag(|X_i|)       cond      s_max/s_min of W_w
                                          logdet    -log det W_w'W_w
                                          sigma     largest %sigma_i, the root of the diagonal of C
                                          record    largest ratio of %sigma_i to its value with
                                                    the motion of a record

%sigma is predicted by `runtime.core.rows.predicted`.

W is the observation matrix of the identification: the motion, sampled at the controller rate,
passes through the filters and the decimation of the study. A parameter smaller than a hundredth of
the largest parameter of its unit counts as if it had the size of this hundredth.
`runtime.excitation.search` searches for the motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.core.model import GeneratedModel, base_columns, joint_labels, require
from runtime.core.problem import Problem
from runtime.core.record import Record
from runtime.core.rows.observation import Observation
from runtime.core.rows.predicted import Weights
from runtime.excitation.accelerations import accelerations
from runtime.excitation.settings import ExcitationSettings
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import limits
from runtime.loop.dry_friction import dry_friction
from runtime.loop.trajectories import Motion

LIMIT = limits(__package__)

Array = np.ndarray

QUANTITIES = {"q": "position", "qd": "velocity"}
UNITS = {"q": "rad or m", "qd": "rad/s or m/s"}


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Limits of position, velocity, acceleration and torque of each joint, arrays of shape (n,).

    Attributes
    ----------
    lower, upper : ndarray, rad or m
        Smallest and largest position.
    qd, qdd : ndarray, rad/s or m/s, rad/s^2 or m/s^2
        Largest velocity and acceleration.
    tau : ndarray, N m or N
        Largest torque; inf: unlimited.
    assumed : str
        Sentence on the accelerations, if neither robot file nor study limits them; else "".
    """

    lower: Array
    upper: Array
    qd: Array
    qdd: Array
    tau: Array
    assumed: str = ""

    def of(self, share: float) -> MotionLimits:
        """Return limits that are narrower by the fraction `share` of each limit.

        The range of positions shrinks about its middle.
        """
        middle, half = (self.lower + self.upper) / 2, (1 - share) * (self.upper - self.lower) / 2
        qd, qdd, tau = ((1 - share) * x for x in (self.qd, self.qdd, self.tau))
        return MotionLimits(middle - half, middle + half, qd, qdd, tau, self.assumed)


@dataclass(frozen=True)
class Excess:
    """One limit that a motion exceeds, with the joint, the worst value and its time.

    Attributes
    ----------
    what : str
        Name of the quantity, for instance "velocity".
    joint : str
        Label of the joint.
    value, limit : float, SI
        Value at the worst instant, and the limit that it exceeds.
    time : float, s
    """

    what: str
    joint: str
    value: float
    limit: float
    time: float

    def __str__(self) -> str:
        return (
            f"{self.what} of joint {self.joint} is {self.value:.4g} at {self.time:.3f} s, limit "
            f"{self.limit:.4g}"
        )


def limits_of(
    model: GeneratedModel, given: Mapping[str, Any], records: Sequence[Record] = ()
) -> MotionLimits:
    """Combine the limits of the robot file with the limits in `given`, which replace them.

    If the acceleration of a joint has no limit, a limit is computed from the velocities and from
    `records` (`runtime.excitation.accelerations`).

    Raises SettingsError if q or qd has no limit.
    """
    n = len(model.JOINTS)
    known = {**dict(getattr(model, "LIMITS", None) or {}), **given}
    missing = [name for name in ("q", "qd") if known.get(name) is None]
    if missing:
        raise SettingsError(
            f"{model.NAME} has no {' or '.join(QUANTITIES[name] for name in missing)} limits of every "
            "joint: add "
            f"`excitation: {{limits: {{{', '.join(f'{name}: [...]' for name in missing)}}}}}` to the "
            f"study file of the record, a number per joint in "
            f"{', '.join(UNITS[name] for name in missing)}, and run `symgen excite ROBOT study.yaml`",
            path=("limits",),
        )
    unknown = known.keys() - {"q", "qd", "qdd", "tau"}
    if unknown:
        raise SettingsError(
            f"unknown limit {', '.join(sorted(unknown))}; expected some of q, qd, qdd, tau",
            path=("limits",),
        )
    largest = {name: _largest(model, name, known.get(name)) for name in ("qd", "qdd", "tau")}
    assumed = ""
    if known.get("qdd") is None:
        largest["qdd"], assumed = _assumed(model, largest["qd"], records)
    ranges = [
        (-float(x), float(x)) if np.ndim(x) == 0 else tuple(map(float, x)) for x in known["q"]
    ]
    if len(ranges) != n or any(len(x) != 2 or not x[0] < x[1] for x in ranges):
        raise SettingsError(
            f"q: {known['q']}; expected {n} limits, each a number or a pair (lower, upper)",
            path=("limits", "q"),
        )
    lower, upper = np.array(ranges).T
    return MotionLimits(lower, upper, **largest, assumed=assumed)


def _largest(model: GeneratedModel, name: str, given: Any) -> Array:
    """Read the limits `name` of all joints, shape (n,), each above 0; inf if no limit is given."""
    n = len(model.JOINTS)
    limits = np.array(np.inf if given is None else given, dtype=float)
    if limits.ndim and limits.shape != (n,):
        raise SettingsError(
            f"{name}: {limits.tolist()}; expected {n} numbers, one per joint, or one for all",
            path=("limits", name),
        )
    if not np.all(limits > 0):
        motor = "; a joint with tau 0 has no motor and cannot be moved: lock it" * (name == "tau")
        raise SettingsError(
            f"{name}: {limits.tolist()}; expected more than 0{motor}", path=("limits", name)
        )
    return np.array(np.broadcast_to(limits, (n,)))


def _assumed(model: GeneratedModel, qd: Array, records: Sequence[Record]) -> tuple[Array, str]:
    """Choose limits of acceleration, and write a sentence on them with the line that changes them."""
    if not np.all(np.isfinite(qd)):
        raise SettingsError(
            f"{model.NAME} has no limits of acceleration, nor of velocity from which to choose them; "
            "add `excitation: {limits: {qdd: [...]}}` to the study file, a number per joint",
            path=("limits",),
        )
    qdd, of_record = accelerations(qd, records)
    joints = [j for j, yes in zip(joint_labels(model), of_record, strict=True) if yes]
    more = f", and the largest of the record for joint {', '.join(joints)}" if joints else ""
    line = ", ".join(f"{x:g}" for x in qdd)
    return qdd, (
        f"Neither robot file nor study limits the accelerations; symgen takes those that reach the "
        f"largest velocity in {LIMIT.RISE_TIME:g} s{more}. This line of the study file changes them: "
        f"excitation: {{limits: {{qdd: [{line}]}}}}"
    )


def weights_of(
    model: GeneratedModel,
    settings: ExcitationSettings,
    X: Mapping[str, float],
    *,
    essential: Sequence[str] = (),
    s: Sequence[float] = (),
) -> Weights:
    """Choose the columns of W for the search, and the factors that scale its rows and columns.

    The rows are scaled by the standard deviations of the torques, the columns by the sizes of the
    parameters, from their values X.

    `essential`, `s` : essential parameters, and standard deviations of the torques, from an
    estimate if there is one.
    """
    n = len(model.JOINTS)
    names = base_columns(model, settings.columns, essential or model.BASE_PARAMETERS, "columns")
    deviation = np.array(settings.torque_sigma or tuple(s) or (1.0,) * n, dtype=float)
    if deviation.shape != (n,) or not np.all(deviation > 0):
        raise SettingsError(
            f"standard deviations of the torques {deviation.tolist()}; expected {n} numbers above "
            "0, one per joint",
            path=("torque_sigma",),
        )
    units = dict(getattr(model, "UNITS", {}))
    largest: dict[str, float] = {}
    for name in names:
        largest[units.get(name, "")] = max(largest.get(units.get(name, ""), 0.0), abs(X[name]))
    if not all(largest.values()):
        raise InputError(
            f"all parameters in {', '.join(u for u, x in largest.items() if not x)} are zero, but the "
            "criterion compares each parameter with its size; give values in the robot file, or a "
            "record"
        )
    return Weights(
        names,
        deviation,
        np.array(
            [
                max(abs(X[name]), LIMIT.SMALLEST_SIZE * largest[units.get(name, "")])
                for name in names
            ]
        ),
    )


def criterion_of(weights: Weights, observation: Observation, criterion: str) -> float:
    """Compute the criterion that the search minimises, such as cond(W), from the W of one motion.

    The value is exact: W has the rows that the identification will use.
    """
    if criterion == "cond":
        return weights.condition(observation)
    if criterion in (
        "sigma",
        "record",
    ):  # white residuals: the order of candidates does not depend on it
        return float(weights.relative_sigma(observation).max())
    return float(
        -2 * np.sum(np.log(np.abs(np.diag(np.linalg.qr(weights.matrix(observation), mode="r")))))
    )


def plan_rows(problem: Problem, motion: Motion, rate: float) -> Observation:
    """Build the observation matrix W that a planned motion, sampled at `rate` (Hz), will give.

    Y is zero. The time window of the rows is ignored.
    """
    t, q, *_ = motion.sampled(rate)
    record = Record(t=t, q=q, tau=np.zeros_like(q), rate=rate, name="planned motion")
    settings = problem.settings
    settings = replace(settings, rows=replace(settings.rows, window=(None, None)))
    # planned positions are exact: a reader of encoder counts has nothing to read
    reader = problem.reader.at_step(0.0, "joint")
    return (
        problem.changed(settings=settings, records=(record,), unseen=(), reader=reader)
        .prepared[0]
        .observation(problem.model)
    )


def excesses(
    model: GeneratedModel,
    motion: Motion,
    limits: MotionLimits,
    settings: ExcitationSettings,
    X: Array,
    rate: float | None = None,
) -> list[Excess]:
    """Find the limits that a motion exceeds: the worst instant of each joint and quantity.

    The motion is sampled at `rate`, Hz; default: the controller rate of the settings. Distances
    between spheres are not checked. The rate of change of the torque is computed without dry
    friction, because no motion avoids the jump of dry friction at a reversal.
    """
    require(model, "inverse_dynamics")
    t, q, qd, qdd = motion.sampled(settings.rate if rate is None else rate)
    tau = model.inverse_dynamics(q, qd, qdd, X)
    free, labels = np.full(q.shape[1], np.inf), joint_labels(model)
    bounds = [
        ("position", q, limits.lower, limits.upper),
        ("velocity", qd, -limits.qd, limits.qd),
        ("acceleration", qdd, -limits.qdd, limits.qdd),
        ("torque", tau, -limits.tau, limits.tau),
    ]
    if settings.torque_rate:
        smooth = model.inverse_dynamics(q, qd, qdd, X * dry_friction(model).smooth)
        bounds.append(
            (
                "rate of torque",
                np.abs(np.gradient(smooth, t, axis=0)),
                -free,
                np.array(settings.torque_rate),
            )
        )
    if settings.torque_rms:
        bounds.append(
            (
                "rms torque",
                np.sqrt(np.mean(tau**2, axis=0))[None],
                -free,
                np.array(settings.torque_rms),
            )
        )
    exceeded = []
    for what, x, lower, upper in bounds:
        beyond = np.maximum(x - upper, lower - x)
        for j in range(q.shape[1]):
            k = int(np.argmax(beyond[:, j]))
            if beyond[k, j] > 1e-9 * max(1.0, abs(x[k, j])):
                limit = upper[j] if x[k, j] > upper[j] else lower[j]
                exceeded.append(Excess(what, labels[j], float(x[k, j]), float(limit), float(t[k])))
    return exceeded


def usage(
    model: GeneratedModel, motion: Motion, limits: MotionLimits, rate: float, X: Array
) -> dict[str, list[float]]:
    """Compute how much of each limit (of q, qd, qdd, torque) a motion uses, as a share, by joint.

    A share of 1 is the limit. The motion is sampled at `rate`, Hz. The share of a position range is
    measured from the middle of the range.
    """
    _, q, qd, qdd = motion.sampled(rate)
    middle, half = (limits.lower + limits.upper) / 2, (limits.upper - limits.lower) / 2
    shares = {
        "position": (q - middle) / half,
        "velocity": qd / limits.qd,
        "acceleration": qdd / limits.qdd,
    }
    if np.isfinite(limits.tau).any():
        shares["torque"] = model.inverse_dynamics(q, qd, qdd, X) / limits.tau
    return {what: np.abs(x).max(axis=0).tolist() for what, x in shares.items()}
