"""The `excitation` section of a study: what is asked of an exciting motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from runtime.errors import SettingsError
from runtime.settings.trajectories import Family, family_from_mapping


@dataclass(frozen=True)
class Sphere:
    """A ball carried by frame `frame`: centre in that frame, m; radius, m."""

    frame: int
    radius: float
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not self.radius > 0:
            raise SettingsError(f"{self.radius}; expected more than 0", path=("radius",))


@dataclass(frozen=True)
class ExcitationSettings:
    """The search for an exciting motion.

    parts : families in the order they are run through (`runtime.settings.trajectories`), each a mapping with its `family`.
    criterion : "cond", "logdet" or "sigma".   columns : "essential" (of an estimate), "all" or names.
    limits : q, qd, qdd, tau in place of those of the robot file: one per joint, or (lower, upper) for q.
    torque_rms, torque_rate : largest root mean square, N m, and rate of change, N m/s, of each torque; None: unlimited.
    margin : share of every limit that the optimiser keeps free between its grid points.
    grid : points of the optimiser, Hz.   rate : controller rate, Hz.   begin : positions at the start; None: free.
    spheres, apart : balls on the links, and pairs of them (by number, from 1) whose surfaces stay `gap` m from each other; apart: None means
        every pair on frames that are not next to each other.
    smooth : v0 of tanh(qd/v0), which stands for sign(qd) inside the optimiser only, rad/s or m/s.
    torque_sigma : s_j, one per joint, N m; None: those of an estimate, else 1 for every joint.
    starts : random starts.   iterations : of the optimiser in each of its two stages.   seed : of the starts.
    """

    parts: tuple[Mapping[str, Any], ...] = (
        {"family": "fourier", "period": 10.0, "harmonics": 5},
        {"family": "point-to-point", "points": 7, "travel": 1.0, "blend": 0.25},
    )
    criterion: Literal["cond", "logdet", "sigma"] = "cond"
    columns: Literal["essential", "all"] | tuple[str, ...] = "essential"
    limits: Mapping[str, Any] = field(default_factory=dict)
    torque_rms: tuple[float, ...] | None = None
    torque_rate: tuple[float, ...] | None = None
    margin: float = 0.02
    grid: float = 20.0
    rate: float = 1000.0
    begin: tuple[float, ...] | None = None
    spheres: tuple[Sphere, ...] = ()
    apart: tuple[tuple[int, int], ...] | None = None
    gap: float = 0.0
    smooth: float = 0.05
    torque_sigma: tuple[float, ...] | None = None
    starts: int = 10
    iterations: int = 200
    seed: int = 1

    def __post_init__(self) -> None:
        for name in ("grid", "rate", "smooth"):
            _require(getattr(self, name) > 0, name, f"{getattr(self, name)}; expected more than 0")
        for name in ("starts", "iterations"):
            _require(getattr(self, name) >= 1, name, f"{getattr(self, name)}; expected at least 1")
        _require(0 <= self.margin < 1, "margin", f"{self.margin}; expected a share between 0 and 1")
        _require(len(self.parts) > 0, "parts", "no part; expected at least one family")
        for pair in self.apart or ():
            _require(all(1 <= k <= len(self.spheres) for k in pair), "apart", f"{list(pair)}; there are {len(self.spheres)} spheres")
        _ = self.families

    @property
    def families(self) -> tuple[Family, ...]:
        """The parts, made."""
        return tuple(family_from_mapping(part, ("parts", k)) for k, part in enumerate(self.parts))

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Pairs of spheres that stay apart, numbered from 0."""
        if self.apart is not None:
            return tuple((a - 1, b - 1) for a, b in self.apart)
        count = range(len(self.spheres))
        return tuple((a, b) for a in count for b in count if a < b and abs(self.spheres[a].frame - self.spheres[b].frame) > 1)


def _require(ok: bool, name: str, message: str) -> None:
    if not ok:
        raise SettingsError(message, path=(name,))
