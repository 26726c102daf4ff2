"""A measured record: time, joint positions and joint torques, joint side, SI, uniformly sampled.

`runtime.records.reading` makes records of files; a record made of arrays is checked alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import InputError
from runtime.records.clock import JITTER, Stamps, rate_of, sample
from runtime.records.missing import COUNTS, Missing, bridged
from runtime.settings.record import SHORTEST

Array = np.ndarray

UNNAMED = "record"
"""Name of a record that was given none."""


@dataclass(frozen=True, eq=False, init=False)
class Record:
    """What was measured, joint side, SI, uniformly sampled. The arrays are read-only copies.

    Parameters
    ----------
    t : array_like, shape (N,), s
        Uniform within `jitter`.
    q : array_like, shape (N, n) or (N,), rad or m
        Joint positions.
    tau : array_like, shape (N, n) or (N,), N m or N
        Joint torques.
    rate : float, Hz, optional
        Checked against t. Default: (N - 1)/(t[-1] - t[0]).
    name : str
        How results call the record.
    files : mapping of str to str
        SHA-256 of the uncompressed bytes, by file name.
    q_r : array_like, shape (N, n), rad or m, optional
        What the controller followed.
    tau_ff : array_like, shape (N, n), N m or N, optional
        Feed-forward torques that the controller added.
    tau_known : array_like, shape (N, n), N m or N, optional
        Torques of the drives that do not come from the model, such as that of a counterbalance. They are subtracted: the attribute `tau` is what is
        left for the model. None in records that `dataclasses.replace` makes.
    known : str
        What was subtracted, a sentence; "" where nothing was.
    time : str
        What the time stamps were like and what was done about them, a sentence; "" where there were none.
    jitter : float
        Largest deviation of t from a uniform grid, sampling periods.
    missing : array_like of bool, shape (N, n) or (N,), or Missing, optional
        Samples of q that hold no position, where `signals.reader` is counts: np.isnan(q). There q becomes a straight line between its neighbours, for
        what looks at positions as they are; the reader takes no notice of it.

    Raises
    ------
    InputError
        Shapes that differ, numbers that are not finite, fewer than 10 samples, or a clock that runs back, is not uniform or contradicts `rate`.
    """

    t: Array
    q: Array
    tau: Array
    rate: float
    name: str
    files: Mapping[str, str]
    q_r: Array | None
    tau_ff: Array | None
    time: str
    jitter: float
    known: str
    missing: Missing | None
    tau_known: Array | None = field(init=False)

    def __init__(
        self,
        t: ArrayLike,
        q: ArrayLike,
        tau: ArrayLike,
        *,
        rate: float | None = None,
        name: str = UNNAMED,
        files: Mapping[str, str] | None = None,
        q_r: ArrayLike | None = None,
        tau_ff: ArrayLike | None = None,
        tau_known: ArrayLike | None = None,
        time: str = "",
        jitter: float = JITTER,
        known: str = "",
        missing: ArrayLike | Missing | None = None,
    ) -> None:
        file = ", ".join(files or ()) or name
        given = {"t": np.array(t, dtype=float), "q": np.array(q, dtype=float), "tau": np.array(tau, dtype=float)}
        shapes = ", ".join(f"{label} {x.shape}" for label, x in given.items())
        given |= {label: given[label][:, None] for label in ("q", "tau") if given[label].ndim == 1}
        N = len(given["t"]) if given["t"].ndim == 1 else -1
        if given["q"].ndim != 2 or given["q"].shape != given["tau"].shape or len(given["q"]) != N:
            raise InputError(f"{shapes}; expected (N,), (N, n), (N, n)", file=file)
        if N < SHORTEST:
            raise InputError(f"{N} samples; a record has at least {SHORTEST}", file=file)
        for label, signal in (("q_r", q_r), ("tau_ff", tau_ff), ("tau_known", tau_known)):
            if signal is not None:
                x = np.array(signal, dtype=float)
                given[label] = x[:, None] if x.ndim == 1 else x
                if given[label].shape != given["q"].shape:
                    raise InputError(f"{label} {x.shape}, q {given['q'].shape}; expected the same", file=file)
        if tau_known is not None:
            require_finite(given["tau_known"], "tauknown", file)
            given["tau"] = given["tau"] - given["tau_known"]
            known = known or known_text(given["tau_known"])
        missing = _missing(missing, given["q"].shape, file)
        if missing is not None:
            given["q"] = bridged(given["q"], missing.at_joints() & np.isnan(given["q"]))
        for label, x in given.items():
            require_finite(x, label.replace("_", ""), file)
            x.setflags(write=False)
        if rate is not None and not (np.isfinite(rate) and rate > 0):
            raise InputError(f"rate {rate} Hz; expected a positive number", file=file)
        rate = rate_of(Stamps(file, rate=rate, jitter=jitter), given["t"])
        others = {
            "rate": rate,
            "name": name,
            "files": MappingProxyType(dict(files or {})),
            "time": time,
            "jitter": jitter,
            "known": known,
            "missing": missing,
        }
        others |= dict.fromkeys(("q_r", "tau_ff", "tau_known"))
        for label, value in (others | given).items():
            object.__setattr__(self, label, value)

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
        """Records travel to other processes; a read-only mapping alone could not."""
        others = {name: getattr(self, name) for name in ("rate", "name", "q_r", "tau_ff", "time", "jitter", "known", "missing")}
        return partial(Record, files=dict(self.files), **others), (self.t, self.q, self.tau), {"tau_known": self.tau_known}


def _missing(missing: ArrayLike | Missing | None, shape: tuple[int, ...], file: str) -> Missing | None:
    """Missing samples of a record of positions of that shape; None where none is."""
    if missing is None:
        return None
    if not isinstance(missing, Missing):
        samples = np.array(missing)
        missing = Missing(samples[:, None] if samples.ndim == 1 else samples)
    if missing.samples.shape != shape or missing.samples.dtype != np.bool_:
        raise InputError(f"missing {missing.samples.dtype} {missing.samples.shape}; expected bool {shape}, as q", file=file)
    return missing if missing.samples.any() else None


def known_text(known: Array) -> str:
    """What known torques, shape (N, n), take from the record, a sentence."""
    largest = np.abs(known).max(axis=0)
    return "known torques subtracted: " + ", ".join(f"up to {x:.4g} of joint {j}" for j, x in enumerate(largest, 1) if x) + " (N m or N)"


def require_finite(x: Array, label: str, file: str) -> None:
    """Raise InputError at the first value of x, shape (N,) or (N, k), that is not finite; columns are called label1, label2 ..."""
    if not np.isfinite(x).all():
        bad = np.argwhere(~np.isfinite(x))
        value, column = x[tuple(bad[0])], label if x.ndim == 1 else f"{label}{bad[0][1] + 1}"
        raise InputError(
            f"{value} ({len(bad)} such values in all); expected finite numbers, repair or cut the record"
            f"{f'; {COUNTS} (here: missing=np.isnan(q))' if label == 'q' and np.isnan(value) else ''}",
            file=file,
            column=column,
            row=sample(int(bad[0][0])),
        )
