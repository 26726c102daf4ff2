"""A measured record: time, positions and torques of the joints, SI, uniformly sampled.

`runtime.reading.records` makes records from files. A record made from arrays passes the same
checks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from runtime.core.drives import Drives
from runtime.core.missing import COUNTS, Missing, bridged
from runtime.ground.arrays import real, real_number, require_kind
from runtime.ground.clock import JITTER, Stamps, rate_of, sample
from runtime.ground.errors import InputError
from runtime.ground.limits import LIMIT

Array = np.ndarray

WRENCH = "wrench"
"""Beginning of the channels that are wrenches, before the number of the frame."""
JOINT_CHANNELS = ("q_r", "qd", "qd_ref", "tau_ff")
"""Channels with one column per joint."""
BASE_MOTION, BASE_POSITION, BASE_QUATERNION = "base_motion", "base_position", "base_quaternion"
"""Channels of a record: w0, wd0, a0 (N, 9); p (N, 3), m; Q (N, 4), scalar first."""
BASE_IMU = "base_imu"
"""Channel with w0 (rad/s), f (m/s**2) and r (m) in the axes of frame 0, (N, 9)."""
BASE_BIASES = "base_biases"
"""Channel with the biases of w0 and f in BASE_IMU, (N, 6), which are subtracted, and fitted."""
BASE_GRAVITY = "base_gravity"
"""Channel with the acceleration of gravity in the axes of the world, (N, 3), m/s**2."""

UNNAMED = "record"
"""Name of a record that was given none."""
FINITE = float(np.finfo(float).max)
"""The largest finite number."""


@dataclass(frozen=True, eq=False)
class Origin:
    """Source of a record: its files, time stamps and drives, and whether it was simulated.

    Attributes
    ----------
    files : mapping of str to str
        SHA-256 of the uncompressed bytes, by file name.
    time : str
        Sentence on the time stamps of the file and on their correction; "" if there were none.
    jitter : float
        Largest difference of the stamps from a uniform grid, sampling periods.
    drives : Drives or None
        Drives of the robot, with the coupling that was used when the file was read; None: the
        drives of the model.
    torque_constant : ndarray, shape (n,), N m/A or N m/V, or None
        Constants that converted currents or voltages to torques; None: torques were measured, or
        the constants are those of the robot file.
    command : str
        A or V, if the torque was recorded in this unit and stays in it; else "".
    joints : tuple of str
        Names of the joints in results; empty: the numbers of the joints, from 1.
    whole : str
        Name of the whole record, if this is one piece of a record that was split at gaps; else "".
    simulated : bool
        Whether the record was simulated, not measured.
    by_law : bool
        Whether the torque was computed by the law of a controller.
    sides : (str, str) or None
        Sides of the gears at which positions and torques were measured, each "motor", "joint" or
        "link" (behind the gears); None: unknown, so that the sides of the study are used.
    cutoff : float or None, Hz
        Cut-off of the low-pass for this record, if it differs from the cut-off of the study
        (`runtime.core.automatic`).
    """

    files: Mapping[str, str] = field(default_factory=dict)
    time: str = ""
    jitter: float = JITTER
    drives: Drives | None = None
    torque_constant: Array | None = None
    command: str = ""
    joints: tuple[str, ...] = ()
    whole: str = ""
    simulated: bool = False
    by_law: bool = False
    sides: tuple[str, str] | None = None
    cutoff: float | None = None


@dataclass(frozen=True, eq=False, init=False)
class Record:
    """A measured record: positions and torques of the joints, in SI, uniformly sampled.

    The arrays are read-only copies.

    Parameters
    ----------
    t : array_like, shape (N,), s
        Uniform within `origin.jitter`.
    q : array_like, shape (N, n) or (N,), rad or m
        Joint positions.
    tau : array_like, shape (N, n) or (N,), N m or N
        Joint torques of the drives.
    rate : float, Hz, optional
        Checked against t. Default: (N - 1)/(t[-1] - t[0]).
    name : str
        Name of the record in results.
    tau_known : array_like, shape (N, n), N m or N, optional
        Torques of the drives that do not come from the model, such as that of a counterbalance:
        `torque` is tau without them.
    missing : array_like of bool, shape (N, n) or (N,), or Missing, optional
        Samples of q without a position, if `signals.reader` is counts: np.isnan(q). There q becomes
        a straight line between its neighbours, for functions that need all positions; the reader
        does not use this line.
    channels : mapping of str to array_like, optional
        Further measured signals, shape (N, k) by name. A read-only array is used as it is, others
        are copied.
    origin : Origin
        Files, clock and drives by which the record was read.
    **named : array_like or None, shape (N, n)
        Channels of the joints: q_r, reference positions of the controller, rad or m; tau_ff,
        feed-forward torques that it added, N m or N; qd and qd_ref, velocities and their reference.
        None: not recorded.

    Raises
    ------
    InputError
        Shapes that differ, numbers that are not finite, fewer than 10 samples, or a clock that runs
        back, is not uniform or contradicts `rate`.

    Examples
    --------
    >>> import numpy as np, runtime
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = np.sin(t), np.cos(t), -np.sin(t)
    >>> record = runtime.Record(t, q, tau=95 * qdd + 200 * qd + 20 * np.sign(qd))
    >>> record.tau.shape, round(record.rate)
    ((10000, 1), 1000)
    """

    t: Array
    q: Array
    tau: Array
    rate: float
    name: str
    tau_known: Array | None
    missing: Missing | None
    channels: Mapping[str, Array]
    origin: Origin

    def __init__(
        self,
        t: ArrayLike,
        q: ArrayLike,
        tau: ArrayLike,
        *,
        rate: float | None = None,
        name: str = UNNAMED,
        tau_known: ArrayLike | None = None,
        missing: ArrayLike | Missing | None = None,
        channels: Mapping[str, ArrayLike] | None = None,
        origin: Origin | None = None,
        **named: ArrayLike | None,
    ) -> None:
        _require_known(named)
        require_kind(name, str, "name", "a text")
        require_kind(channels, (Mapping, type(None)), "channels", "a mapping of names to arrays")
        require_kind(origin, (Origin, type(None)), "origin", "an Origin")
        origin = origin or Origin()
        file = ", ".join(origin.files) or name
        signals = _signals({"t": t, "q": q, "tau": tau, "tau_known": tau_known}, file)
        shape = signals["q"].shape
        further = {**(channels or {}), **named}
        own = {key: _channel(key, x, shape, file) for key, x in further.items() if x is not None}
        missing = _missing(missing, shape, file)
        if missing is not None:
            unknown = missing.at_joints() & np.isnan(signals["q"])
            signals["q"] = bridged(signals["q"], unknown)
        for label, x in signals.items():
            _require_numbers(label, x, file)
            x.setflags(write=False)
        stamps = Stamps(file, rate=_positive(rate, file), jitter=origin.jitter)
        rate = rate_of(stamps, signals["t"])
        rest = {"rate": rate, "name": name, "missing": missing, "channels": own, "origin": origin}
        for label, value in ({"tau_known": None} | signals | rest).items():
            object.__setattr__(self, label, value)

    @property
    def measured(self) -> frozenset[str]:
        """Names of the recorded channels: the signals besides time, positions and torques."""
        return frozenset(self.channels)

    @property
    def sides(self) -> tuple[str, str]:
        """Sides of the gears at which positions and torques were measured; "joint" if the record
        does not state them.
        """
        return self.origin.sides or ("joint", "joint")

    @property
    def q_r(self) -> Array | None:
        """Reference positions of the controller, shape (N, n), rad or m; None if not recorded."""
        return self.channels.get("q_r")

    @property
    def tau_ff(self) -> Array | None:
        """Feed-forward torques of the controller, shape (N, n), N m or N; None if not recorded."""
        return self.channels.get("tau_ff")

    @cached_property
    def torque(self) -> Array:
        """Torques that the model explains, shape (N, n), N m or N: tau minus the known torques."""
        return self.tau if self.tau_known is None else self.tau - self.tau_known

    def moved(self, q: Array, **changes: Any) -> Record:
        """Copy the record with other positions q, and without its recorded velocities.

        changes : new values of other fields.
        """
        others = {key: x for key, x in self.channels.items() if key != "qd"}
        return replace(self, q=q, channels=others, **changes)

    def cut_at(self, hertz: float | None) -> Record:
        """Return the record with a cut-off of its own for the low-pass, Hz; None: the cut-off of
        the study.
        """
        if self.origin.cutoff == hertz:
            return self
        return replace(self, origin=replace(self.origin, cutoff=hertz))

    @property
    def subtracted(self) -> str:
        """Sentence on known torques (e.g. of a counterbalance) subtracted from tau; "" if none."""
        known = self.tau_known
        return known_text(None if known is None else np.abs(known).max(axis=0), self.origin.joints)

    @property
    def files(self) -> Mapping[str, str]:
        """SHA-256 hash of each file of the record, by file name."""
        return self.origin.files

    @property
    def file(self) -> str:
        """Name of the record in messages: its files, or its own name if it was made from arrays."""
        return ", ".join(self.files) or self.name

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.q.shape[1])

    def __len__(self) -> int:
        return len(self.t)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return a function that rebuilds the record from its fields, for pickle.

        Values computed from the fields are not sent.
        """
        return partial(Record, **{f.name: getattr(self, f.name) for f in fields(self)}), ()


def _require_known(named: Mapping[str, Any]) -> None:
    """Raise TypeError for a keyword argument that is no channel of the joints."""
    if unknown := sorted(named.keys() - {*JOINT_CHANNELS}):
        raise TypeError(
            f"unexpected argument {unknown[0]}; expected some of {', '.join(JOINT_CHANNELS)}"
        )


def _signals(given: Mapping[str, ArrayLike | None], file: str) -> dict[str, Array]:
    """Convert t, q, tau and tau_known to arrays of the shapes (N,) and (N, n).

    tau_known is left out if it is None. Raise InputError if the shapes differ.
    """
    arrays = {
        label: _array(x, label, file)
        for label, x in given.items()
        if x is not None or label != "tau_known"
    }
    signals = {k: x[:, None] if k != "t" and x.ndim == 1 else x for k, x in arrays.items()}
    _require_shapes(signals, {label: x.shape for label, x in arrays.items()}, file)
    return signals


def _require_shapes(
    signals: Mapping[str, Array], shapes: Mapping[str, tuple[int, ...]], file: str
) -> None:
    """Raise InputError unless t, q, tau and tau_known have the same number N of samples, at least
    10.

    shapes : the given shapes, for the message.
    """
    t, q, tau = (signals[label] for label in ("t", "q", "tau"))
    if t.ndim != 1 or q.ndim != 2 or q.shape != tau.shape or len(q) != len(t):
        text = ", ".join(f"{label} {shapes[label]}" for label in ("t", "q", "tau"))
        raise InputError(
            f"{text}; expected the shapes (N,), (N, n), (N, n) for N samples of n joints",
            file=file,
        )
    if len(t) < LIMIT.FEWEST_SAMPLES:
        raise InputError(
            f"the record has {len(t)} samples; expected at least {LIMIT.FEWEST_SAMPLES}", file=file
        )
    known = signals.get("tau_known", q)
    if known.shape != q.shape:
        raise InputError(
            f"tau_known has shape {shapes['tau_known']}, but q has shape {q.shape}; "
            "expected the same shape",
            file=file,
        )


def _require_numbers(label: str, x: Array, file: str) -> None:
    """Raise InputError unless the signal x, shape (N,) or (N, n), has finite numbers only."""
    column = label.replace("_", "")
    require_finite(
        x if x.ndim == 2 else x[:, None],
        [column] if x.ndim == 1 else [f"{column}{j + 1}" for j in range(x.shape[1])],
        file,
        hint=f"{COUNTS} (here: missing=np.isnan(q))" if label == "q" else "",
        largest=FINITE if label == "t" else LIMIT.LARGEST_NUMBER,
    )


def _positive(rate: float | None, file: str) -> float | None:
    """Return the rate, Hz, as a float; raise InputError unless it is positive. None stays None."""
    if rate is None:
        return None
    rate = real_number(rate, "rate", file)
    if not (np.isfinite(rate) and rate > 0):
        raise InputError(f"rate {rate} Hz; expected a positive number", file=file)
    return rate


def _array(x: ArrayLike | None, label: str, file: str) -> Array:
    """Convert x to numbers: a copy, or x itself if it is a read-only array of floats."""
    array = real(x, label, file)
    return array.copy() if array.flags.writeable else array


def _channel(label: str, x: ArrayLike, shape: tuple[int, ...], file: str) -> Array:
    """Check a channel (a further measured signal) of a record, and make it read-only.

    shape : shape of the positions, (N, n).
    """
    require_kind(label, str, "a name of channels", "a text")
    array = _array(x, label, file)
    array = array[:, None] if array.ndim == 1 else array
    expected = shape if label in JOINT_CHANNELS else (shape[0], *array.shape[1:2])
    if array.shape != expected:
        raise InputError(
            f"{label} has shape {array.shape}, but q has shape {shape}; expected {expected}",
            file=file,
        )
    require_finite(array, [f"{label}{k + 1}" for k in range(array.shape[1])], file)
    array.setflags(write=False)
    return array


def _missing(
    missing: ArrayLike | Missing | None, shape: tuple[int, ...], file: str
) -> Missing | None:
    """Convert marks of missing positions to an object Missing; None if no position is missing.

    shape : shape of the positions, (N, n).
    """
    if missing is None:
        return None
    if not isinstance(missing, Missing):
        samples = _marks(missing, file)
        missing = Missing(samples[:, None] if samples.ndim == 1 else samples)
    if missing.samples.shape != shape or missing.samples.dtype != np.bool_:
        raise InputError(
            f"`missing` has dtype {missing.samples.dtype} and shape {missing.samples.shape}; "
            f"expected bool {shape}, the shape of q",
            file=file,
        )
    return missing if missing.samples.any() else None


def _marks(missing: Any, file: str) -> Array:
    """Convert the marks of missing positions to an array; raise InputError for rows of unequal
    length.
    """
    try:
        return np.array(missing)
    except Exception as e:  # ragged
        raise InputError(
            "the array `missing` has rows of different lengths; expected bool values in the shape of q",
            file=file,
        ) from e


def known_text(largest: Array | None, joints: Sequence[str]) -> str:
    """Write a sentence on known torques (of a counterbalance, ...) that are subtracted from tau.

    Return "" if `largest` is None. largest : largest absolute value of the known torque of each
    joint, shape (n,).
    """
    if largest is None:
        return ""
    names = joints or range(1, len(largest) + 1)
    sizes = zip(names, largest, strict=True)
    listed = ", ".join(f"up to {x:.4g} of joint {joint}" for joint, x in sizes if x)
    return f"known torques subtracted: {listed} (N m or N)"


def require_finite(
    x: Array,
    names: Sequence[str],
    file: str,
    row: Callable[[int], str] = sample,
    hint: str = "",
    largest: float = FINITE,
) -> Array:
    """Return x, shape (N, k); raise InputError if a number of x is not finite or larger than
    `largest`.

    row : function from a sample number to its place. hint : another remedy for nan.
    """
    if not (np.abs(x) <= largest).all():
        bad = np.argwhere(~(np.abs(x) <= largest))
        i, j = bad[0]
        numbers = f"numbers up to {largest:g} (SI)" if np.isfinite(x[i, j]) else "finite numbers"
        column = names[j] if len(names) == x.shape[1] else f"{', '.join(names)} ({j + 1})"
        raise InputError(
            f"the value is {x[i, j]} ({len(bad)} such values in all); expected {numbers}: repair or cut the "
            f"record{f'; {hint}' if hint and np.isnan(x[i, j]) else ''}",
            file=file,
            column=column,
            row=row(int(i)),
        )
    return x
