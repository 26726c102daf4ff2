"""A measured record: time, joint positions and joint torques, joint side, SI, uniformly sampled.

Reading one from files is `runtime.records.reading`; a record made in Python is checked alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from runtime.errors import InputError
from runtime.settings.study import SHORTEST

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Record:
    """What was measured, joint side, SI, uniformly sampled. The arrays are read-only copies.

    Parameters
    ----------
    t : ndarray, shape (N,), s.   q : ndarray, shape (N, n), rad or m.   tau : ndarray, shape (N, n), N m or N.
    rate : sampling rate, Hz.   q_r : what the controller followed, shape (N, n), where it is known.
    files : SHA-256 (of the uncompressed bytes) by file name, for the provenance of results.
    time : what its time stamps were like and what was done about it, a sentence; "" where there were none.
    """

    t: Array
    q: Array
    tau: Array
    rate: float
    name: str = "record"
    files: Mapping[str, str] = field(default_factory=dict)
    q_r: Array | None = None
    time: str = ""

    def __post_init__(self) -> None:
        t, q, tau = (np.array(x, dtype=float) for x in (self.t, self.q, self.tau))
        q, tau = (x[:, None] if x.ndim == 1 else x for x in (q, tau))
        if t.ndim != 1 or q.ndim != 2 or q.shape != tau.shape or len(q) != len(t):
            raise InputError(f"t {t.shape}, q {q.shape}, tau {tau.shape}; expected (N,), (N, n), (N, n)", file=self.name)
        if len(t) < SHORTEST:
            raise InputError(f"{len(t)} samples; a record has at least {SHORTEST}", file=self.name)
        if not (np.isfinite(self.rate) and self.rate > 0):
            raise InputError(f"rate {self.rate} Hz; expected a positive number", file=self.name)
        for label, x in (("t", t[:, None]), ("q", q), ("tau", tau)):
            check_finite(x, [label] if label == "t" else [f"{label}{j + 1}" for j in range(x.shape[1])], self.name)
        given = [("t", t), ("q", q), ("tau", tau)]
        if self.q_r is not None:
            q_r = np.array(self.q_r, dtype=float).reshape(len(t), -1)
            if q_r.shape != q.shape:
                raise InputError(f"q_r {q_r.shape}, q {q.shape}; expected the same", file=self.name)
            check_finite(q_r, [f"qr{j + 1}" for j in range(q.shape[1])], self.name)
            given.append(("q_r", q_r))
        for label, x in given:
            x.setflags(write=False)
            object.__setattr__(self, label, x)
        object.__setattr__(self, "files", MappingProxyType(dict(self.files)))

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.q.shape[1])

    def __len__(self) -> int:
        return len(self.t)

    def __reduce__(self) -> tuple[Any, ...]:
        """Records travel to other processes; a read-only mapping alone could not."""
        return Record, (self.t, self.q, self.tau, self.rate, self.name, dict(self.files), self.q_r, self.time)


def check_finite(x: Array, names: list[str], file: str) -> None:
    """Raise InputError at the first value of x, shape (N, columns), that is not finite; samples count from 1."""
    bad = np.argwhere(~np.isfinite(x))
    if len(bad):
        i, j = bad[0]
        raise InputError(
            f"{x[i, j]} ({len(bad)} such values in all); expected finite numbers, repair or cut the record",
            file=file,
            column=names[j],
            row=f"sample {i + 1}",
        )
