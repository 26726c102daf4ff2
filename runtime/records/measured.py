"""What the files of a record hold, before it is made a Record: samples at the stamps of the files,
joint side, SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from runtime.records.formats.columns import Array


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of a record, joint side, SI; None: the files hold no such columns.

    Attributes
    ----------
    t : ndarray, shape (N,), s, or None
    q : ndarray, shape (N, n), rad or m
    tau : ndarray, shape (N, n), N m or N, or None
        As measured, known torques included; None where a law is the torque.
    tau_known : ndarray, shape (N, n), N m or N, or None
        Torques that do not come from the model.
    missing : ndarray of bool, shape (N, n), or (N, 0) where none may be missing
        Columns of positions that hold none.
    channels : mapping of str to ndarray, shape (N, n)
        As of a Record.
    """

    t: Array | None
    q: Array
    tau: Array | None
    missing: Array
    tau_known: Array | None = None
    channels: Mapping[str, Array] = field(default_factory=dict)

    @property
    def signals(self) -> dict[str, Array]:
        """What is resampled together, by name."""
        given = {key: getattr(self, key) for key in ("q", "tau", "tau_known")}
        given |= {**self.channels, **({"missing": self.missing} if self.missing.any() else {})}
        return {key: x for key, x in given.items() if x is not None}
