"""References of a controller: positions q_r, velocities qd_r and accelerations qdd_r at its rate.

A reference comes from samples, from a motion given by coefficients, from a record, or from random
points.

    reference = Reference.sampled(q_r, rate=1000)   # derivatives by central differences
    reference = Reference(rate, q, qd, qdd)
    check_limits(reference, model.LIMITS)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from runtime.core.model import GeneratedModel, joint_labels
from runtime.core.record import Record
from runtime.core.signals.filters import derivative
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import limits
from runtime.loop.settings import Controller, Points
from runtime.loop.trajectories import motion_from_mapping, ramp
from runtime.reading.formats import read_table

LIMIT = limits(__package__)

Array = np.ndarray

RAMP = 1 / 3  # of each piece: acceleration, constant velocity, deceleration
UNITS = {"q": "", "qd": "/s", "qdd": "/s^2"}


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference positions, velocities and accelerations of all joints, sampled at `rate`.

    Attributes
    ----------
    rate : float, Hz
    q, qd, qdd : ndarray, shape (N, n), rad or m, and s
    """

    rate: float
    q: Array
    qd: Array
    qdd: Array

    def __post_init__(self) -> None:
        shapes = {np.shape(x) for x in (self.q, self.qd, self.qdd)}
        if len(shapes) != 1 or len(np.shape(self.q)) != 2 or len(self.q) < 2:
            raise InputError(
                f"reference q, qd, qdd of shapes {np.shape(self.q)}, {np.shape(self.qd)}, "
                f"{np.shape(self.qdd)}; expected the same shape (N, n) for all"
            )
        if not all(np.isfinite(x).all() for x in (self.q, self.qd, self.qdd)):
            raise InputError(
                "the reference contains values that are not finite; correct these values"
            )

    @classmethod
    def sampled(cls, q: Array, rate: float) -> Reference:
        """Make a reference motion from N sampled positions of n joints, shape (N, n).

        Velocities and accelerations are central differences.
        """
        q = np.asarray(q, dtype=float)
        qd = derivative(q, rate)
        return cls(rate, q, qd, derivative(qd, rate))

    def at_rate(self, every: int) -> Reference:
        """Resample the reference at `every` times its rate: N samples become (N - 1) every + 1.

        Cubic splines interpolate q; their derivatives are qd and qdd.
        """
        if every == 1:
            return self
        ticks = np.arange((len(self) - 1) * every + 1) / (every * self.rate)
        spline = CubicSpline(self.t, self.q, axis=0)
        return Reference(self.rate * every, spline(ticks), spline(ticks, 1), spline(ticks, 2))

    @property
    def t(self) -> Array:
        """Times of the samples, s, shape (N,)."""
        return np.arange(len(self.q)) / self.rate

    def __len__(self) -> int:
        return len(self.q)


def reference_of(
    controller: Controller,
    model: GeneratedModel,
    *,
    records: Sequence[Record] = (),
    folder: str | Path | None = None,
) -> Reference:
    """Make the reference motion that the settings of a controller describe.

    The reference must be within the limits of the robot, unless the settings say that the limits
    are ignored.

    Parameters
    ----------
    controller : Controller
    model : GeneratedModel
    records : sequence of Record
        Records of the study, for the setting `record`.
    folder : str or Path, optional
        Folder of relative file names; default: the current folder.

    Raises
    ------
    SettingsError
        There is no reference, or it does not fit the robot or the controller.
    InputError
        A file does not hold the reference, or a value is outside the limits; the message gives
        joint and time.
    """
    settings, rate, n = controller.reference, controller.rate, len(model.JOINTS)
    if settings.file is not None:
        reference = read_reference(Path(folder or "") / settings.file, rate, n)
    elif settings.record is not None:
        if not 0 <= settings.record < len(records):
            raise SettingsError(
                f"record {settings.record}; the study has {len(records)} records, numbered from 0",
                path=("controller", "reference", "record"),
            )
        reference = of_record(records[settings.record], controller)
    elif settings.motion is not None:
        motion = motion_from_mapping(settings.motion)
        _check_length(motion.duration, rate, "motion")
        reference = Reference(rate, *motion.sampled(rate)[1:])
    elif settings.points is not None:
        _check_length(settings.points.duration, rate, "points")
        reference = point_to_point(model, settings.points, rate)
    else:
        raise SettingsError(
            "no reference is given; give one of file, record, motion, points",
            path=("controller", "reference"),
        )
    if reference.q.shape[1] != n:
        raise SettingsError(
            f"the reference motion has {reference.q.shape[1]} joints, but {model.NAME} has {n} "
            "joints; give one column of positions per joint",
            path=("controller", "reference"),
        )
    if settings.limits == "refuse":
        check_limits(reference, model.LIMITS, joint_labels(model))
    return reference


def _check_length(duration: float, rate: float, key: str) -> None:
    if duration * rate > LIMIT.LONGEST_REFERENCE:
        raise SettingsError(
            f"the reference lasts {duration:g} s at {rate:g} Hz; expected at most "
            f"{LIMIT.LONGEST_REFERENCE:,} ticks of the controller, so shorten the reference",
            path=("controller", "reference", key),
        )


def read_reference(path: Path, rate: float, n: int) -> Reference:
    """Read a reference motion at `rate`, Hz, from the columns q1 ... qn of a file.

    The columns qd1 ... and qdd1 ... are used if the file has them; otherwise central differences
    are used.
    """
    table = read_table(path)
    names = {x: [f"{x}{j}" for j in range(1, n + 1)] for x in UNITS}
    if missing := [name for name in names["q"] if name not in table.names]:
        raise InputError(
            f"no column {', '.join(missing)} among {', '.join(table.names)}; expected q1 ... q{n}",
            file=path.name,
        )
    if "t" in table.names:
        t = table.read(["t"])[:, 0]
        own = (len(t) - 1) / (t[-1] - t[0])
        if abs(own / rate - 1) > LIMIT.RATE_TOLERANCE:
            raise InputError(
                (
                    f"the time column of the reference has the rate {own:g} Hz, but the controller "
                    f"runs at {rate:g} Hz; resample the reference, or correct controller.rate"
                ),
                file=path.name,
            )
    plain = Reference.sampled(table.read(names["q"]), rate)
    if not all(name in table.names for name in (*names["qd"], *names["qdd"])):
        return plain
    return Reference(rate, plain.q, table.read(names["qd"]), table.read(names["qdd"]))


def of_record(record: Record, controller: Controller) -> Reference:
    """Make the reference of a controller from the reference columns of a record.

    If the record is slower than the controller, cubic splines interpolate. Raise SettingsError if
    the record holds no reference, or if its rate is not the rate of every `record_every`-th tick.
    """
    where, every = ("controller", "reference", "record"), controller.record_every
    if record.q_r is None:
        raise SettingsError(
            f"{record.file} contains no reference; give its columns in record.columns.q_ref",
            path=where,
        )
    require_rate(record, controller)
    return Reference.sampled(record.q_r, controller.rate / every).at_rate(every)


def require_rate(record: Record, controller: Controller) -> None:
    """Raise SettingsError unless record rate times controller.record_every is the controller rate.

    The error names the setting to change.
    """
    rate, every = controller.rate, controller.record_every
    if abs(record.rate * every / rate - 1) <= LIMIT.RATE_TOLERANCE:
        return
    ratio = rate / record.rate
    told = (
        f"{record.file} has the rate {record.rate:g} Hz, which does not match a controller at "
        f"{rate:g} Hz that records {'every tick' if every == 1 else f'one tick in {every}'}"
    )
    if round(ratio) >= 1 and abs(ratio / round(ratio) - 1) <= LIMIT.RATE_TOLERANCE:
        raise SettingsError(
            f"{told}; set controller.record_every: {round(ratio)}",
            path=("controller", "record_every"),
        )
    raise SettingsError(
        (
            f"{told}; the rate of the controller is no multiple of the rate of the record: correct "
            "controller.rate or record.rate"
        ),
        path=("controller", "rate"),
    )


def check_limits(reference: Reference, limits: Mapping[str, Any], joints: Sequence[str]) -> None:
    """Raise InputError if a reference exceeds the limits of q, qd or qdd of the robot.

    The message gives joint, value, limit and time of the first value outside the limits.
    """
    for quantity, unit in UNITS.items():
        if quantity not in limits:
            continue
        given = np.asarray(limits[quantity], dtype=float)
        low, high = given.T if quantity == "q" else (-given, given)
        x = getattr(reference, quantity)
        slack = 1e-9 * np.maximum(np.abs(low), np.abs(high))
        outside = (x < low - slack) | (x > high + slack)
        if outside.any():
            k, j = np.argwhere(outside)[0]
            raise InputError(
                f"the reference leaves the limits of joint {joints[j]} at {k / reference.rate:g} "
                f"s: {quantity} = {x[k, j]:.4g} rad{unit} or m{unit}, "
                f"limits {low[j]:.4g} to {high[j]:.4g}; slow down or move the reference, or set "
                "controller.reference.limits: ignore"
            )


def point_to_point(model: GeneratedModel, settings: Points, rate: float) -> Reference:
    """Make a reference that moves all joints together between random points of their range.

    The points are in the middle of the range. Each move is as fast as the limits of speed and
    acceleration allow. The reference ends with the last move that fits into the duration.
    """
    if missing := [key for key in ("q", "qd", "qdd") if key not in model.LIMITS]:
        raise SettingsError(
            f"{model.NAME} has no limits of {', '.join(missing)}; add these limits to "
            "the robot file",
            path=("controller", "reference", "points"),
        )
    rng = np.random.default_rng(settings.seed)
    low, high = np.array(model.LIMITS["q"], dtype=float).T
    centre, reach = (low + high) / 2, LIMIT.POINT_REACH * (high - low)
    speed, acceleration = (
        LIMIT.POINT_MARGIN * np.array(model.LIMITS[key], dtype=float) for key in ("qd", "qdd")
    )
    N = round(settings.duration * rate)
    t = np.arange(N) / rate
    q, qd, qdd = (np.zeros((N, len(model.JOINTS))) for _ in range(3))
    start, begin = 0.0, centre
    while start < settings.duration:
        end = centre + reach * rng.uniform(-1, 1, len(centre))
        way = end - begin
        # velocity way/(T (1 - RAMP)); a ramp 3 x**2 - 2 x**3 has the largest slope 1.5
        T = max(
            np.max(np.abs(way) / speed) / (1 - RAMP),
            np.sqrt(np.max(np.abs(way) / acceleration) * 1.5 / (RAMP * (1 - RAMP))),
        )
        if start and start + T > settings.duration:
            break
        piece = (t >= start) & (t < start + T)
        s, v, a = ramp((t[piece] - start) / T, RAMP / 2, 1 - RAMP / 2, RAMP)
        q[piece], qd[piece], qdd[piece] = (
            begin + s[:, None] * way,
            v[:, None] * way / T,
            a[:, None] * way / T**2,
        )
        start, begin = start + T, end
    moved = t < start
    return Reference(rate, q[moved], qd[moved], qdd[moved])
