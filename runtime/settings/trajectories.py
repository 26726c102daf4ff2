"""Families of trajectories that rest at both ends: finite Fourier series, sinusoids of free frequency, point to point, triangular.

    Fourier        q = q0 + sum_l a_l/(w l) sin(w l t) - b_l/(w l) cos(w l t),   w = 2 pi/period       (Swevers et al. 1997)
    Sinusoids      q = q0 + e(t) sum_l A_l sin(2 pi f_l t + phi_l), e(t) rising from 0 to 1 and falling to 0
    PointToPoint   constant velocities between points, at rest in each of them                          (chapter, figure 3)
    Triangular     constant velocities between points, turning without rest                             (chapter, section 4.2.1)

A family says how the coefficients p of one joint become its motion; a Motion is a chain of families with their coefficients, each part
beginning where the one before it ends. The same text evaluates arrays (numpy) and expressions (casadi): `math` is the module whose sin and
cos apply. All but Sinusoids are linear in p. Position, velocity and acceleration are continuous. SI, rad.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np

from runtime.errors import InputError, SettingsError
from runtime.settings.schema import structure

MOST = 1000  # harmonics, terms or points of one part: far more than a motion of a robot has, few enough for any memory
MOST_PARTS = 100  # of a chain
BLOCK = 2**22  # times at once, by coefficients: a family holds a row of them for each time

Array = np.ndarray
States = tuple[Any, Any, Any]  # q, qd, qdd


class Family(Protocol):
    """A form of motion."""

    @property
    def duration(self) -> float:
        """Length, s."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients p of a joint."""

    def joint(self, t: Array, p: Any, math: Any) -> States:
        """q, qd, qdd of one joint at the times t, shape (N,), from its coefficients p, shape (P,)."""

    def bounds(self) -> tuple[Array, Array]:
        """Smallest and largest p, shape (P,) each; infinite where only the motion is limited."""

    def guess(self, rng: np.random.Generator, lower: float, upper: float, speed: float) -> Array:
        """Random coefficients, shape (P,), of a motion about the middle of [lower, upper], no faster than about `speed`."""


@dataclass(frozen=True)
class Fourier:
    """Finite Fourier series over `periods` periods. At rest at its ends where sum a_l = 0 and sum l b_l = 0, which who chooses p sees to."""

    period: float = 10.0
    harmonics: int = 5
    periods: int = 1

    def __post_init__(self) -> None:
        _positive("fourier", period=self.period, harmonics=self.harmonics, periods=self.periods)

    @property
    def duration(self) -> float:
        return self.period * self.periods

    @property
    def names(self) -> tuple[str, ...]:
        orders = range(1, self.harmonics + 1)
        return ("q0", *(f"a{k}" for k in orders), *(f"b{k}" for k in orders))

    def joint(self, t: Array, p: Any, math: Any) -> States:
        wl = 2 * np.pi / self.period * np.arange(1, self.harmonics + 1)
        c, s = np.cos(np.outer(t, wl)), np.sin(np.outer(t, wl))
        one, zero = np.ones((len(t), 1)), np.zeros((len(t), 1))
        q, qd, qdd = np.hstack([one, s / wl, -c / wl]), np.hstack([zero, c, s]), np.hstack([zero, -s * wl, c * wl])
        return _linear((q, qd, qdd), p, math)

    def bounds(self) -> tuple[Array, Array]:
        return _free(len(self.names))

    def guess(self, rng: np.random.Generator, lower: float, upper: float, speed: float) -> Array:
        orders = np.arange(1, self.harmonics + 1)
        a, b = rng.standard_normal((2, self.harmonics))
        a -= a.mean()
        b -= orders * (orders @ b) / (orders @ orders)
        size = 0.3 * min(speed, (upper - lower) * 2 * np.pi / self.period) / np.sqrt(self.harmonics)
        return np.concatenate([[_between(rng, lower, upper)], size * a, size * b])


@dataclass(frozen=True)
class Sinusoids:
    """`terms` sinusoids of free frequency, at most `highest`, Hz; they rise and fall within `ramp`, s."""

    length: float = 10.0
    terms: int = 3
    highest: float = 1.0
    ramp: float = 1.0

    def __post_init__(self) -> None:
        _positive("sinusoids", length=self.length, terms=self.terms, highest=self.highest, ramp=self.ramp)
        if 2 * self.ramp > self.length:
            raise SettingsError(
                f"sinusoids rise and fall within {self.ramp} s each, more than their length of {self.length} s; shorten it", path=("ramp",)
            )

    @property
    def duration(self) -> float:
        return self.length

    @property
    def names(self) -> tuple[str, ...]:
        terms = range(1, self.terms + 1)
        return ("q0", *(f"{letter}{k}" for letter in ("A", "f", "phi") for k in terms))

    def joint(self, t: Array, p: Any, math: Any) -> States:
        e, ed, edd = (rise + fall for rise, fall in zip(_step(t, self.ramp), _step(self.length - t, self.ramp, -1.0), strict=True))
        e = e - 1.0
        L = self.terms
        s = sd = sdd = 0.0 * t if math is np else math.DM(0.0 * t)
        for k in range(L):
            A, w, phi = p[1 + k], 2 * np.pi * p[1 + L + k], p[1 + 2 * L + k]
            angle = (t if math is np else math.DM(t)) * w + phi
            s, sd, sdd = s + A * math.sin(angle), sd + A * w * math.cos(angle), sdd - A * w**2 * math.sin(angle)
        return p[0] + e * s, ed * s + e * sd, edd * s + 2 * ed * sd + e * sdd

    def bounds(self) -> tuple[Array, Array]:
        lower, upper = _free(len(self.names))
        f = slice(1 + self.terms, 1 + 2 * self.terms)
        lower[f], upper[f] = 1 / self.length, self.highest
        return lower, upper

    def guess(self, rng: np.random.Generator, lower: float, upper: float, speed: float) -> Array:
        f = rng.uniform(0.1, 1.0, self.terms) * self.highest
        A = 0.5 * np.minimum((upper - lower) / 2, speed / (2 * np.pi * f)) / self.terms
        return np.concatenate([[_between(rng, lower, upper)], A, f, rng.uniform(-np.pi, np.pi, self.terms)])


@dataclass(frozen=True)
class PointToPoint:
    """`points` positions p0, p1 ..., `travel` s from one to the next, of which `blend` s to gain speed and `blend` s to lose it."""

    points: int = 8
    travel: float = 1.2
    blend: float = 0.3

    def __post_init__(self) -> None:
        _positive("point-to-point", points=self.points - 1, travel=self.travel, blend=self.blend)
        if 2 * self.blend > self.travel:
            raise SettingsError(
                f"point-to-point: gaining and losing speed takes {2 * self.blend} s of {self.travel} s; shorten it", path=("blend",)
            )

    @property
    def duration(self) -> float:
        return self.travel * (self.points - 1)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"p{k}" for k in range(self.points))

    def joint(self, t: Array, p: Any, math: Any) -> States:
        half = self.blend / 2
        ramps = [(self.travel * k + half, self.travel * (k + 1) - half) for k in range(self.points - 1)]
        return _linear(_polyline(t, ramps, self.blend), p, math)

    def bounds(self) -> tuple[Array, Array]:
        return _free(len(self.names))

    def guess(self, rng: np.random.Generator, lower: float, upper: float, speed: float) -> Array:
        return _walk(rng, self.points, lower, upper, 0.5 * speed * (self.travel - self.blend))


@dataclass(frozen=True)
class Triangular:
    """`points` positions p0, p1 ..., `travel` s from one to the next at constant velocity, at most `speed` (rad/s or m/s); corners take `blend` s."""

    points: int = 6
    travel: float = 2.0
    blend: float = 0.2
    speed: float = 0.5

    def __post_init__(self) -> None:
        _positive("triangular", points=self.points - 1, travel=self.travel, blend=self.blend, speed=self.speed)
        if self.blend > self.travel:
            raise SettingsError(
                f"triangular: a corner takes {self.blend} s, more than the {self.travel} s between corners; shorten it", path=("blend",)
            )

    @property
    def duration(self) -> float:
        return self.travel * (self.points - 1) + self.blend

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"p{k}" for k in range(self.points))

    def joint(self, t: Array, p: Any, math: Any) -> States:
        corners = self.blend / 2 + self.travel * np.arange(self.points)
        return _linear(_polyline(t, list(pairwise(corners)), self.blend), p, math)

    def bounds(self) -> tuple[Array, Array]:
        return _free(len(self.names))

    def guess(self, rng: np.random.Generator, lower: float, upper: float, speed: float) -> Array:
        return _walk(rng, self.points, lower, upper, 0.8 * min(speed, self.speed) * self.travel)


FAMILIES: Mapping[str, type] = {"fourier": Fourier, "sinusoids": Sinusoids, "point-to-point": PointToPoint, "triangular": Triangular}


@dataclass(frozen=True, eq=False)
class Part:
    """A family with the coefficients of every joint, shape (P, n)."""

    family: Family
    p: Array

    def __post_init__(self) -> None:
        p = np.array(self.p, dtype=float)
        if p.ndim != 2 or len(p) != len(self.family.names) or not np.all(np.isfinite(p)):
            expected = f"({len(self.family.names)}, joints)"
            raise InputError(f"coefficients of shape {p.shape} of a {label(self.family)} part; expected {expected}, finite")
        object.__setattr__(self, "p", p)


@dataclass(frozen=True, eq=False)
class Motion:
    """A chain of parts."""

    parts: tuple[Part, ...]

    def __post_init__(self) -> None:
        if not self.parts or len({part.p.shape[1] for part in self.parts}) != 1:
            raise InputError("a motion needs at least one part, all of the same joints")

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.parts[0].p.shape[1])

    @property
    def duration(self) -> float:
        """Length, s."""
        return sum(part.family.duration for part in self.parts)

    def states(self, t: Array) -> tuple[Array, Array, Array]:
        """q, qd, qdd, shape (N, n), at the times t, shape (N,), within [0, duration]."""
        t = np.asarray(t, dtype=float)
        q, qd, qdd = (np.empty((len(t), self.n)) for _ in range(3))
        start = 0.0
        for k, part in enumerate(self.parts):
            stop = start + part.family.duration
            inside = (t >= start if k else t >= -np.inf) & (t < stop if k < len(self.parts) - 1 else t <= np.inf)
            rows = np.flatnonzero(inside)
            size = max(BLOCK // len(part.p), 1)
            for a in range(0, len(rows), size):
                block = rows[a : a + size]
                with np.errstate(over="ignore", invalid="ignore"):  # who uses the motion asks for finite ones
                    for j in range(self.n):
                        q[block, j], qd[block, j], qdd[block, j] = part.family.joint(t[block] - start, part.p[:, j], np)
            start = stop
        return q, qd, qdd

    def sampled(self, rate: float) -> tuple[Array, Array, Array, Array]:
        """t, q, qd, qdd at the controller rate, Hz."""
        t = np.arange(round(self.duration * rate) + 1) / rate
        return t, *self.states(t)

    def to_mapping(self) -> dict[str, Any]:
        """The parts with their coefficients, by joint, for a file."""
        return {"parts": [{"family": label(part.family), **asdict(part.family), "p": part.p.T.tolist()} for part in self.parts]}  # type: ignore[call-overload]


def motion_from_mapping(mapping: Mapping[str, Any]) -> Motion:
    """Inverse of Motion.to_mapping; raises SettingsError with the path of what is wrong."""
    parts = mapping.get("parts")
    if not isinstance(parts, Sequence) or isinstance(parts, str):
        raise SettingsError("no `parts` in this trajectory; expected a list of families with their coefficients `p`")
    if len(parts) > MOST_PARTS:
        raise SettingsError(f"{len(parts)} parts; at most {MOST_PARTS} in one trajectory", path=("parts",))
    found = []
    for number, part in enumerate(parts, start=1):
        if not isinstance(part, Mapping) or "p" not in part:
            raise SettingsError(f"part {number} of the trajectory has no coefficients `p`", path=("parts", number - 1))
        try:
            found.append(Part(family_from_mapping({k: v for k, v in part.items() if k != "p"}), _coefficients(part["p"]).T))
        except SettingsError as e:
            raise SettingsError(e.reason, path=("parts", number - 1, *e.path)) from None
        except InputError as e:
            raise SettingsError(e.message, path=("parts", number - 1, "p")) from None
    return Motion(tuple(found))


def _coefficients(p: Any) -> Array:
    """Numbers, shape (joints, P)."""
    try:
        return np.array(p, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError("no table of numbers; expected one list of coefficients for each joint") from None


def family_from_mapping(mapping: Mapping[str, Any], path: tuple[str | int, ...] = ()) -> Family:
    """A family from {"family": "fourier", "period": 10 ...}; settings that are left out have their defaults. path : of the mapping in its file."""
    settings = dict(mapping)
    kind = FAMILIES.get(str(settings.pop("family", None)))
    if kind is None:
        raise SettingsError(f"no family {mapping.get('family')!r} of trajectories; there are {', '.join(FAMILIES)}", path=(*path, "family"))
    family: Family = structure(kind, settings, path)
    return family


def label(family: Family) -> str:
    """The name of a family in files."""
    return next(name for name, kind in FAMILIES.items() if isinstance(family, kind))


def _free(size: int) -> tuple[Array, Array]:
    return np.full(size, -np.inf), np.full(size, np.inf)


def _linear(basis: Sequence[Array], p: Any, math: Any) -> States:
    q, qd, qdd = (B @ p if math is np else math.mtimes(math.DM(B), p) for B in basis)
    return q, qd, qdd


def _step(t: Array, width: float, sign: float = 1.0) -> tuple[Array, Array, Array]:
    """A smooth step from 0 to 1 within [0, width], 10 x^3 - 15 x^4 + 6 x^5, and its derivatives by time, of time running as `sign`."""
    x = np.clip(t / width, 0.0, 1.0)
    speed, bend = 30 * x**2 * (1 - x) ** 2 / width, 60 * x * (1 - x) * (1 - 2 * x) / width**2
    return x**3 * (10 - 15 * x + 6 * x**2), sign * speed, bend


def _polyline(t: Array, ramps: Sequence[tuple[float, float]], blend: float) -> tuple[Array, ...]:
    """Basis of q, qd, qdd, shape (N, points) each: from point k to the next at constant velocity within ramps[k], whose corners are rounded."""
    found = np.zeros((3, len(t), len(ramps) + 1))
    found[0, :, 0] = 1.0
    for k, (start, stop) in enumerate(ramps):
        piece = (_corner(t - start, blend) - _corner(t - stop, blend)) / (stop - start)
        found[:, :, k] -= piece
        found[:, :, k + 1] += piece
    return tuple(found)


def _corner(u: Array, blend: float) -> Array:
    """A ramp max(u, 0) whose corner is rounded within |u| < blend/2, with its two derivatives, shape (3, N); the speed rises as 3 x^2 - 2 x^3."""
    x = np.clip(u / blend + 0.5, 0.0, 1.0)
    beyond = np.maximum(u - blend / 2, 0.0)
    return np.array([blend * (x**3 - x**4 / 2) + beyond, 3 * x**2 - 2 * x**3, 6 * x * (1 - x) / blend])


def _walk(rng: np.random.Generator, points: int, lower: float, upper: float, stride: float) -> Array:
    p = [_between(rng, lower, upper)]
    for _ in range(points - 1):
        p.append(rng.uniform(max(lower, p[-1] - stride), min(upper, p[-1] + stride)))
    return np.array(p)


def _between(rng: np.random.Generator, lower: float, upper: float) -> float:
    """A position in the middle half of the range."""
    return float(rng.uniform(0.75 * lower + 0.25 * upper, 0.25 * lower + 0.75 * upper))


def _positive(family: str, **values: float) -> None:
    for name, value in values.items():
        if not 0 < value < np.inf:  # an integer may be beyond every double
            raise SettingsError(f"{family}: {value}; expected more than 0", path=(name,))
        if isinstance(value, int) and value > MOST:
            raise SettingsError(f"{family}: {value}; at most {MOST} in one part", path=(name,))
