"""Joint trajectories made of successive parts; each part has a formula and its coefficients.

A formula is a family of motions, for instance Fourier series (`runtime.loop.families`). Each part
begins where the part before it ends. SI units, rad.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from runtime.core.errors import InputError, SettingsError
from runtime.core.limits import LIMIT
from runtime.core.settings import require, structure, to_mapping
from runtime.loop.families import AnyFamily, Array, Family

BLOCK = 2**22  # times at once, by coefficients: a family holds a row of them for each time


@dataclass(frozen=True, eq=False)
class Part:
    """One part of a motion: a family such as Fourier, with the coefficients p of every joint.

    p has shape (P, n).
    """

    family: Family
    p: Array

    def __post_init__(self) -> None:
        p = np.array(self.p, dtype=float)
        if p.ndim != 2 or len(p) != len(self.family.names) or not np.all(np.isfinite(p)):
            raise InputError(
                f"coefficients of shape {p.shape} for a {self.family.family} motion; expected a "
                f"table of finite numbers with {len(self.family.names)} rows, one for each of "
                f"{', '.join(self.family.names)}, and one column for each joint"
            )
        object.__setattr__(self, "p", p)


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of all joints: a chain of parts that follow each other in time."""

    parts: tuple[Part, ...]

    def __post_init__(self) -> None:
        if not self.parts or len({part.p.shape[1] for part in self.parts}) != 1:
            raise InputError(
                "a motion needs at least one part (a Fourier series, for instance), and every part "
                "needs coefficients for the same number of joints"
            )

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.parts[0].p.shape[1])

    @property
    def duration(self) -> float:
        """Duration of the motion, s."""
        return sum(part.family.duration for part in self.parts)

    def states(self, t: Array) -> tuple[Array, Array, Array]:
        """Compute q, qd, qdd, shape (N, n), at the times t, shape (N,), within [0, duration]."""
        t = np.asarray(t, dtype=float)
        q, qd, qdd = (np.empty((len(t), self.n)) for _ in range(3))
        start = 0.0
        for k, part in enumerate(self.parts):
            stop = start + part.family.duration
            inside = (t >= start if k else t >= -np.inf) & (
                t < stop if k < len(self.parts) - 1 else t <= np.inf
            )
            rows = np.flatnonzero(inside)
            size = max(BLOCK // len(part.p), 1)
            for a in range(0, len(rows), size):
                block = rows[a : a + size]
                with np.errstate(
                    over="ignore", invalid="ignore"
                ):  # who uses the motion asks for finite ones
                    for j in range(self.n):
                        q[block, j], qd[block, j], qdd[block, j] = part.family.joint(
                            t[block] - start, part.p[:, j], np
                        )
            start = stop
        return q, qd, qdd

    def sampled(self, rate: float) -> tuple[Array, Array, Array, Array]:
        """Sample the motion at `rate`, Hz: return t, shape (N,), and q, qd, qdd, shape (N, n)."""
        t = np.arange(round(self.duration * rate) + 1) / rate
        return t, *self.states(t)

    def to_mapping(self) -> dict[str, Any]:
        """Return the parts of the motion, with the coefficients of each joint, as a mapping."""
        return {
            "parts": [{**to_mapping(part.family), "p": part.p.T.tolist()} for part in self.parts]
        }


def motion_from_mapping(mapping: Mapping[str, Any]) -> Motion:
    """Make a motion from a mapping that `Motion.to_mapping` wrote.

    Raises SettingsError with the path of the wrong key.
    """
    parts = mapping.get("parts")
    if not isinstance(parts, list | tuple):
        raise SettingsError(
            "the trajectory has no `parts`; expected a list of motion families (fourier, "
            "trapezoid, ...), each with its coefficients `p`"
        )
    require(
        len(parts) <= LIMIT.CHAIN_PARTS,
        f"{len(parts)} parts; at most {LIMIT.CHAIN_PARTS} in one trajectory",
        "parts",
    )
    made = []
    for k, part in enumerate(parts):
        path = ("parts", k)
        if not isinstance(part, Mapping) or "p" not in part:
            raise SettingsError(
                f"part {k + 1} of the trajectory has no coefficients; give `p`, one list of "
                "coefficients for each joint",
                path=path,
            )
        settings = {key: value for key, value in part.items() if key != "p"}
        family: Family = structure(cast(Any, AnyFamily), settings, path)
        try:
            made.append(Part(family, np.array(part["p"], dtype=float).T))
        except InputError as e:
            raise SettingsError(e.message, path=(*path, "p")) from None
        except (TypeError, ValueError, OverflowError):
            message = "no table of numbers; expected one list of coefficients for each joint"
            raise SettingsError(message, path=(*path, "p")) from None
    return Motion(tuple(made))
