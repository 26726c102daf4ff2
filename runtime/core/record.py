"""A measured record: time, joint positions and joint torques, joint side, SI, uniformly sampled.

`runtime.reading.records` makes records of files; a record made of arrays is checked alike.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from runtime.core.arrays import real, real_number, require_kind
from runtime.core.clock import JITTER, Stamps, rate_of, sample
from runtime.core.drives import Drives
from runtime.core.errors import InputError
from runtime.core.limits import LIMIT
from runtime.core.missing import COUNTS, Missing, bridged

Array = np.ndarray

WRENCH = "wrench"
"""Beginning of the channels that are wrenches, before the number of the frame."""
JOINT_CHANNELS = ("q_r", "qd", "qd_ref", "q_link", "tau_ff")
"""Channels with one column per joint."""

UNNAMED = "record"
"""Name of a record that was given none."""
FINITE = float(np.finfo(float).max)
"""The largest finite number."""


@dataclass(frozen=True, eq=False)
class Origin:
    """Source of a record: files, clock and drives.

    Attributes
    ----------
    files : mapping of str to str
        SHA-256 of the uncompressed bytes, by file name.
    time : str
        What the time stamps were like and what was done about them, a sentence; "" if there were
        none.
    jitter : float
        Largest deviation of the stamps from a uniform grid, sampling periods.
    drives : Drives or None
        Drives of the robot with the coupling by which the record was read; None: those of the
        model.
    torque_constant : ndarray, shape (n,), N m/A or N m/V, or None
        By which currents or voltages became torques; None: torques were measured, or the constants
        are those of the robot file.
    joints : tuple of str
        What results call the joints; none: by their place, from 1.
    whole : str
        Name of the record that was split at gaps and this is a piece of; "": it is whole.
    simulated : bool
        Whether nothing was measured.
    by_law : bool
        Whether the torque is that of a controller's law.
    """

    files: Mapping[str, str] = field(default_factory=dict)
    time: str = ""
    jitter: float = JITTER
    drives: Drives | None = None
    torque_constant: Array | None = None
    joints: tuple[str, ...] = ()
    whole: str = ""
    simulated: bool = False
    by_law: bool = False


@dataclass(frozen=True, eq=False, init=False)
class Record:
    """A measured record: joint side, SI, uniform sampling. The arrays are read-only copies.

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
        How results call the record.
    tau_known : array_like, shape (N, n), N m or N, optional
        Torques of the drives that do not come from the model, such as that of a counterbalance:
        `torque` is tau without them.
    missing : array_like of bool, shape (N, n) or (N,), or Missing, optional
        Samples of q that hold no position, where `signals.reader` is counts: np.isnan(q). There q
        becomes a straight line between its neighbours, for what looks at positions as they are; the
        reader takes no notice of it.
    channels : mapping of str to array_like, optional
        What else was measured, shape (N, k) by name. An array that cannot be written is taken as it
        is, others are copied.
    origin : Origin
        Files, clock and drives by which the record was read.
    **named : array_like or None, shape (N, n)
        Channels of the joints: q_r, what the controller followed, rad or m; tau_ff, feed-forward
        torques that it added, N m or N; qd and qd_ref, velocities and their reference; q_link,
        positions behind the gears, nan on joints without an encoder there. None: without it.

    Raises
    ------
    InputError
        Shapes that differ, numbers that are not finite, fewer than 10 samples, or a clock that runs
        back, is not uniform or contradicts `rate`.
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
        if unknown := sorted(named.keys() - {*JOINT_CHANNELS}):
            raise TypeError(f"{unknown[0]}; a record is given {', '.join(JOINT_CHANNELS)} by name")
        require_kind(name, str, "name", "a text")
        require_kind(channels, (Mapping, type(None)), "channels", "a mapping of names to arrays")
        require_kind(origin, (Origin, type(None)), "origin", "an Origin")
        origin = origin or Origin()
        file = ", ".join(origin.files) or name
        signals = {"t": t, "q": q, "tau": tau, "tau_known": tau_known}
        given = {
            label: _array(x, label, file)
            for label, x in signals.items()
            if x is not None or label != "tau_known"
        }
        shapes = {label: x.shape for label, x in given.items()}
        given |= {label: x[:, None] for label, x in given.items() if label != "t" and x.ndim == 1}
        N = len(given["t"]) if given["t"].ndim == 1 else -1
        if given["q"].ndim != 2 or given["q"].shape != given["tau"].shape or len(given["q"]) != N:
            text = ", ".join(f"{label} {shapes[label]}" for label in ("t", "q", "tau"))
            raise InputError(f"{text}; expected (N,), (N, n), (N, n)", file=file)
        if N < LIMIT.FEWEST_SAMPLES:
            raise InputError(
                f"{N} samples; a record has at least {LIMIT.FEWEST_SAMPLES}", file=file
            )
        for label, x in given.items():
            if label != "t" and x.shape != given["q"].shape:
                raise InputError(
                    f"{label} {shapes[label]}, q {given['q'].shape}; expected the same",
                    file=file,
                )
        others = {**(channels or {}), **named}
        own = {
            label: _channel(label, x, given["q"].shape, file)
            for label, x in others.items()
            if x is not None
        }
        missing = _missing(missing, given["q"].shape, file)
        if missing is not None:
            given["q"] = bridged(given["q"], missing.at_joints() & np.isnan(given["q"]))
        for label, x in given.items():
            column = label.replace("_", "")
            require_finite(
                x if x.ndim == 2 else x[:, None],
                [column] if x.ndim == 1 else [f"{column}{j + 1}" for j in range(x.shape[1])],
                file,
                hint=f"{COUNTS} (here: missing=np.isnan(q))" if label == "q" else "",
                largest=FINITE if label == "t" else LIMIT.LARGEST_NUMBER,
            )
            x.setflags(write=False)
        rate = None if rate is None else real_number(rate, "rate", file)
        if rate is not None and not (np.isfinite(rate) and rate > 0):
            raise InputError(f"rate {rate} Hz; expected a positive number", file=file)
        rate = rate_of(Stamps(file, rate=rate, jitter=origin.jitter), given["t"])
        rest = {"rate": rate, "name": name, "missing": missing, "channels": own, "origin": origin}
        for label, value in (dict.fromkeys(signals) | given | rest).items():
            object.__setattr__(self, label, value)

    @property
    def measured(self) -> frozenset[str]:
        """Names of the recorded channels."""
        return frozenset(self.channels)

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
        """Torques for the model, shape (N, n), N m or N: tau without the known torques."""
        return self.tau if self.tau_known is None else self.tau - self.tau_known

    def moved(self, q: Array, **changes: Any) -> Record:
        """The record with other positions, hence without recorded velocities; changes : other fields."""
        others = {key: x for key, x in self.channels.items() if key != "qd"}
        return replace(self, q=q, channels=others, **changes)

    @property
    def subtracted(self) -> str:
        """Sentence about the known torques that are subtracted from tau; "" without known torques."""
        known = self.tau_known
        return known_text(None if known is None else np.abs(known).max(axis=0), self.origin.joints)

    @property
    def files(self) -> Mapping[str, str]:
        """SHA-256 of the files, by name."""
        return self.origin.files

    @property
    def file(self) -> str:
        """Name for messages: its files, or the name of the record if it was made of arrays."""
        return ", ".join(self.files) or self.name

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.q.shape[1])

    def __len__(self) -> int:
        return len(self.t)

    def __reduce__(self) -> tuple[Any, ...]:
        """Records travel to other processes without what was computed from them."""
        return partial(Record, **{f.name: getattr(self, f.name) for f in fields(self)}), ()


def _array(x: ArrayLike | None, label: str, file: str) -> Array:
    """The numbers of x: a copy, or x itself if it cannot be written."""
    array = real(x, label, file)
    return array.copy() if array.flags.writeable else array


def _channel(label: str, x: ArrayLike, shape: tuple[int, ...], file: str) -> Array:
    """A channel of a record of positions of that shape, read-only."""
    require_kind(label, str, "a name of channels", "a text")
    array = _array(x, label, file)
    array = array[:, None] if array.ndim == 1 else array
    expected = shape if label in JOINT_CHANNELS else (shape[0], *array.shape[1:2])
    if array.shape != expected:
        raise InputError(f"{label} {array.shape}, q {shape}; expected {expected}", file=file)
    held = array[:, ~np.isnan(array).all(axis=0)] if label == "q_link" else array
    require_finite(held, [f"{label}{k + 1}" for k in range(held.shape[1])], file)
    array.setflags(write=False)
    return array


def _missing(
    missing: ArrayLike | Missing | None, shape: tuple[int, ...], file: str
) -> Missing | None:
    """Missing samples of a record of positions of that shape; None if none is."""
    if missing is None:
        return None
    if not isinstance(missing, Missing):
        samples = _marks(missing, file)
        missing = Missing(samples[:, None] if samples.ndim == 1 else samples)
    if missing.samples.shape != shape or missing.samples.dtype != np.bool_:
        raise InputError(
            f"missing {missing.samples.dtype} {missing.samples.shape}; expected bool {shape}, as q",
            file=file,
        )
    return missing if missing.samples.any() else None


def _marks(missing: Any, file: str) -> Array:
    """Marks of samples as an array, of whatever dtype."""
    try:
        return np.array(missing)
    except Exception as e:  # ragged
        raise InputError("missing is ragged; expected marks in the shape of q", file=file) from e


def known_text(largest: Array | None, joints: Sequence[str]) -> str:
    """Sentence about subtracted known torques of this size, shape (n,); "" for None."""
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
    """Raise InputError if x, shape (N, k), has nan, infinity or a number above `largest`.

    row : function from a sample number to its place. hint : another remedy for nan.
    """
    if not (np.abs(x) <= largest).all():
        bad = np.argwhere(~(np.abs(x) <= largest))
        i, j = bad[0]
        numbers = f"numbers up to {largest:g} (SI)" if np.isfinite(x[i, j]) else "finite numbers"
        column = names[j] if len(names) == x.shape[1] else f"{', '.join(names)} ({j + 1})"
        raise InputError(
            f"{x[i, j]} ({len(bad)} such values in all); expected {numbers}, repair or cut "
            f"the record{f'; {hint}' if hint and np.isnan(x[i, j]) else ''}",
            file=file,
            column=column,
            row=row(int(i)),
        )
    return x
