"""A measured record: time, joint positions and joint torques, joint side, SI, uniformly sampled.

`runtime.records.reading` makes records of files; a record made of arrays is checked alike.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import InputError
from runtime.limits import LIMIT
from runtime.model.drives import Drives
from runtime.records.clock import JITTER, Stamps, rate_of, sample
from runtime.records.missing import COUNTS, Missing, bridged

Array = np.ndarray

UNNAMED = "record"
"""Name of a record that was given none."""


@dataclass(frozen=True, eq=False)
class Origin:
    """How a record was read.

    Attributes
    ----------
    files : mapping of str to str
        SHA-256 of the uncompressed bytes, by file name.
    time : str
        What the time stamps were like and what was done about them, a sentence; "" where there were
        none.
    jitter : float
        Largest deviation of the stamps from a uniform grid, sampling periods.
    drives : Drives or None
        Drives of the robot with the coupling by which the record was read; None: those of the
        model.
    """

    files: Mapping[str, str] = field(default_factory=dict)
    time: str = ""
    jitter: float = JITTER
    drives: Drives | None = None


@dataclass(frozen=True, eq=False, init=False)
class Record:
    """What was measured, joint side, SI, uniformly sampled. The arrays are read-only copies.

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
    q_r : array_like, shape (N, n), rad or m, optional
        What the controller followed.
    tau_ff : array_like, shape (N, n), N m or N, optional
        Feed-forward torques that the controller added.
    tau_known : array_like, shape (N, n), N m or N, optional
        Torques of the drives that do not come from the model, such as that of a counterbalance:
        `torque` is tau without them.
    missing : array_like of bool, shape (N, n) or (N,), or Missing, optional
        Samples of q that hold no position, where `signals.reader` is counts: np.isnan(q). There q
        becomes a straight line between its neighbours, for
        what looks at positions as they are; the reader takes no notice of it.
    origin : Origin
        Files, clock and drives by which the record was read.

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
    q_r: Array | None
    tau_ff: Array | None
    tau_known: Array | None
    missing: Missing | None
    origin: Origin

    def __init__(
        self,
        t: ArrayLike,
        q: ArrayLike,
        tau: ArrayLike,
        *,
        rate: float | None = None,
        name: str = UNNAMED,
        q_r: ArrayLike | None = None,
        tau_ff: ArrayLike | None = None,
        tau_known: ArrayLike | None = None,
        missing: ArrayLike | Missing | None = None,
        origin: Origin | None = None,
    ) -> None:
        origin = origin or Origin()
        file = ", ".join(origin.files) or name
        signals = {"t": t, "q": q, "tau": tau, "q_r": q_r, "tau_ff": tau_ff, "tau_known": tau_known}
        given = {label: np.array(x, dtype=float) for label, x in signals.items() if x is not None}
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
            )
            x.setflags(write=False)
        if rate is not None and not (np.isfinite(rate) and rate > 0):
            raise InputError(f"rate {rate} Hz; expected a positive number", file=file)
        rate = rate_of(Stamps(file, rate=rate, jitter=origin.jitter), given["t"])
        others = {"rate": rate, "name": name, "missing": missing, "origin": origin}
        for label, value in (dict.fromkeys(signals) | given | others).items():
            object.__setattr__(self, label, value)

    @cached_property
    def torque(self) -> Array:
        """What the model has to explain of tau, shape (N, n), N m or N: without known torques."""
        return self.tau if self.tau_known is None else self.tau - self.tau_known

    @property
    def subtracted(self) -> str:
        """What known torques take from tau, a sentence; "" where there are none."""
        return known_text(None if self.tau_known is None else np.abs(self.tau_known).max(axis=0))

    @property
    def files(self) -> Mapping[str, str]:
        """SHA-256 of the files, by name."""
        return self.origin.files

    @property
    def file(self) -> str:
        """What messages call it: its files, or its name where it was made of arrays."""
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


def _missing(
    missing: ArrayLike | Missing | None, shape: tuple[int, ...], file: str
) -> Missing | None:
    """Missing samples of a record of positions of that shape; None where none is."""
    if missing is None:
        return None
    if not isinstance(missing, Missing):
        samples = np.array(missing)
        missing = Missing(samples[:, None] if samples.ndim == 1 else samples)
    if missing.samples.shape != shape or missing.samples.dtype != np.bool_:
        raise InputError(
            f"missing {missing.samples.dtype} {missing.samples.shape}; expected bool {shape}, as q",
            file=file,
        )
    return missing if missing.samples.any() else None


def known_text(largest: Array | None) -> str:
    """What known torques of that size, shape (n,), take from a record, a sentence; "" for None."""
    if largest is None:
        return ""
    return (
        "known torques subtracted: "
        + ", ".join(f"up to {x:.4g} of joint {j}" for j, x in enumerate(largest, 1) if x)
        + " (N m or N)"
    )


def require_finite(
    x: Array,
    names: Sequence[str],
    file: str,
    row: Callable[[int], str] = sample,
    first: int = 0,
    hint: str = "",
) -> Array:
    """The columns x, shape (N, k), from sample `first` on, if there is neither nan nor infinity
    among them; row : place of a sample in words; hint : what else may be done about nan.
    """
    if not np.isfinite(x).all():
        bad = np.argwhere(~np.isfinite(x))
        i, j = bad[0]
        column = names[j] if len(names) == x.shape[1] else f"{', '.join(names)} ({j + 1})"
        raise InputError(
            f"{x[i, j]} ({len(bad)} such values in all); expected finite numbers, repair or cut "
            f"the record{f'; {hint}' if hint and np.isnan(x[i, j]) else ''}",
            file=file,
            column=column,
            row=row(first + int(i)),
        )
    return x
