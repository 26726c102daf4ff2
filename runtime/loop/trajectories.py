"""Joint trajectories made of successive parts; each part has a formula and its coefficients.

A formula is a family of motions, which rest at both ends. Each part begins where the part before it
ends. SI units, rad.

    Fourier        q = q0 + sum_l a_l/(w l) sin(w l t) - b_l/(w l) cos(w l t),   w = 2 pi/period
            (Swevers et al. 1997)
    Sinusoids
            q = q0 + e(t) sum_l A_l sin(2 pi f_l t + phi_l), e(t) rising from 0 to 1 and falling to
            0
    PointToPoint   constant velocities between points, at rest in each of them
            (chapter, figure 3)
    Triangular     constant velocities between points, turning without rest
            (chapter, section 4.2.1)

A family turns the coefficients p of one joint into its motion. The same code evaluates arrays
(numpy) and expressions (casadi): `math` is the module whose sin and cos are used. All families but
Sinusoids are linear in p. Position, velocity and acceleration are continuous.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import Field

from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import limits
from runtime.ground.settings import Positive, Settings, Whole, require, structure, to_mapping

LIMIT = limits(__package__)

Array = np.ndarray
States = tuple[Any, Any, Any]  # q, qd, qdd
Terms = Annotated[Whole, Field(ge=1, le=LIMIT.PART_SIZE)]
Corners = Annotated[Whole, Field(ge=2, le=LIMIT.PART_SIZE)]


class Family:
    """Base class of the families of joint motions, for instance of Fourier series.

    `family` is the name of the family in files.
    """

    family: str

    @property
    def duration(self) -> float:
        """Duration of the motion, s."""
        raise NotImplementedError

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients p that define the motion of one joint."""
        raise NotImplementedError

    def joint(self, t: Array, p: Any, math: Any) -> States:
        """Compute q, qd, qdd of one joint at the times t, shape (N,), from its coefficients p.

        p has shape (P,).
        """
        raise NotImplementedError

    def guess(self, rng: np.random.Generator, lower: float, upper: float, speed: float) -> Array:
        """Draw P random coefficients p of a joint motion around the middle of [lower, upper].

        The motion is not faster than about `speed`.
        """
        raise NotImplementedError

    def bounds(self) -> tuple[Array, Array]:
        """Return the smallest and the largest allowed values of the P coefficients p of a joint.

        The bounds are infinite for coefficients that only the limits of the motion restrict.
        """
        return np.full(len(self.names), -np.inf), np.full(len(self.names), np.inf)


class Fourier(Family, Settings):
    """Joint motion q(t) as a finite Fourier series.

    The motion is at rest at its ends if sum a_l = 0 and sum l b_l = 0; the search imposes these
    conditions on the coefficients.

    Attributes
    ----------
    family : str
        fourier.
    period : float, s
        Period of the first harmonic.
    harmonics : int
        Number of harmonics.
    periods : int
        Number of periods.
    """

    family: Literal["fourier"] = field(default="fourier", kw_only=True)
    period: Positive = 10.0
    harmonics: Terms = 5
    periods: Terms = 1

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
        q, qd, qdd = (
            np.hstack([one, s / wl, -c / wl]),
            np.hstack([zero, c, s]),
            np.hstack([zero, -s * wl, c * wl]),
        )
        return _linear((q, qd, qdd), p, math)

    def guess(self, rng: np.random.Generator, lower: float, upper: float, speed: float) -> Array:
        orders = np.arange(1, self.harmonics + 1)
        a, b = rng.standard_normal((2, self.harmonics))
        a -= a.mean()
        b -= orders * (orders @ b) / (orders @ orders)
        size = 0.3 * min(speed, (upper - lower) * 2 * np.pi / self.period) / np.sqrt(self.harmonics)
        return np.concatenate([[_between(rng, lower, upper)], size * a, size * b])


class Sinusoids(Family, Settings):
    """Joint motion as a sum of sinusoids with free frequencies; amplitudes grow and fade at the ends.

    Attributes
    ----------
    family : str
        sinusoids.
    length : float, s
        Length of the motion.
    terms : int
        Number of sinusoids.
    highest : float, Hz
        Largest frequency.
    ramp : float, s
        Time in which the sinusoids rise at the start, and in which they fall at the end.
    """

    family: Literal["sinusoids"] = field(default="sinusoids", kw_only=True)
    length: Positive = 10.0
    terms: Terms = 3
    highest: Positive = 1.0
    ramp: Positive = 1.0

    def __post_init__(self) -> None:
        message = (
            f"sinusoids: the ramps at the start and at the end, {self.ramp} s each, are longer than "
            f"the length {self.length} s; shorten the ramp"
        )
        require(2 * self.ramp <= self.length, message, "ramp")

    @property
    def duration(self) -> float:
        return self.length

    @property
    def names(self) -> tuple[str, ...]:
        terms = range(1, self.terms + 1)
        return ("q0", *(f"{letter}{k}" for letter in ("A", "f", "phi") for k in terms))

    def joint(self, t: Array, p: Any, math: Any) -> States:
        e, ed, edd = (
            rise + fall
            for rise, fall in zip(
                _step(t, self.ramp), _step(self.length - t, self.ramp, -1.0), strict=True
            )
        )
        e = e - 1.0
        L = self.terms
        s = sd = sdd = 0.0 * t if math is np else math.DM(0.0 * t)
        for k in range(L):
            A, w, phi = p[1 + k], 2 * np.pi * p[1 + L + k], p[1 + 2 * L + k]
            angle = (t if math is np else math.DM(t)) * w + phi
            s, sd, sdd = (
                s + A * math.sin(angle),
                sd + A * w * math.cos(angle),
                sdd - A * w**2 * math.sin(angle),
            )
        return p[0] + e * s, ed * s + e * sd, edd * s + 2 * ed * sd + e * sdd

    def bounds(self) -> tuple[Array, Array]:
        lower, upper = super().bounds()
        f = slice(1 + self.terms, 1 + 2 * self.terms)
        lower[f], upper[f] = 1 / self.length, self.highest
        return lower, upper

    def guess(self, rng: np.random.Generator, lower: float, upper: float, speed: float) -> Array:
        f = rng.uniform(0.1, 1.0, self.terms) * self.highest
        A = 0.5 * np.minimum((upper - lower) / 2, speed / (2 * np.pi * f)) / self.terms
        return np.concatenate(
            [[_between(rng, lower, upper)], A, f, rng.uniform(-np.pi, np.pi, self.terms)]
        )


class Polyline(Family):
    """Joint motion of constant velocity between positions p0, p1 ..., smoothed at the positions.

    `ramps` has the start and end times of each constant velocity, as if the corners were sharp.
    """

    points: int
    blend: float

    @property
    def ramps(self) -> list[tuple[float, float]]:
        """Start and end time, s, of each move from one position to the next, before smoothing."""
        raise NotImplementedError

    def stride(self, speed: float) -> float:
        """Return the largest distance of two successive positions in a random motion, rad or m."""
        raise NotImplementedError

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"p{k}" for k in range(self.points))

    def joint(self, t: Array, p: Any, math: Any) -> States:
        basis = np.zeros((3, len(t), self.points))
        basis[0, :, 0] = 1.0
        for k, (start, stop) in enumerate(self.ramps):
            piece = ramp(t, start, stop, self.blend)
            basis[:, :, k] -= piece
            basis[:, :, k + 1] += piece
        return _linear(tuple(basis), p, math)

    def guess(self, rng: np.random.Generator, lower: float, upper: float, speed: float) -> Array:
        p, stride = [_between(rng, lower, upper)], self.stride(speed)
        for _ in range(self.points - 1):
            p.append(rng.uniform(max(lower, p[-1] - stride), min(upper, p[-1] + stride)))
        return np.array(p)


class PointToPoint(Polyline, Settings):
    """Motion through the positions p0, p1 ..., at rest in each position.

    Attributes
    ----------
    family : str
        point-to-point.
    points : int
        Number of positions.
    travel : float, s
        Time from one position to the next.
    blend : float, s
        Part of `travel` in which the joint accelerates, and in which it decelerates.
    """

    family: Literal["point-to-point"] = field(default="point-to-point", kw_only=True)
    points: Corners = 8
    travel: Positive = 1.2
    blend: Positive = 0.3

    def __post_init__(self) -> None:
        message = (
            f"point-to-point: acceleration and deceleration take {2 * self.blend} s of the travel "
            f"time {self.travel} s; shorten the blend"
        )
        require(2 * self.blend <= self.travel, message, "blend")

    @property
    def duration(self) -> float:
        return self.travel * (self.points - 1)

    @property
    def ramps(self) -> list[tuple[float, float]]:
        half = self.blend / 2
        return [
            (self.travel * k + half, self.travel * (k + 1) - half) for k in range(self.points - 1)
        ]

    def stride(self, speed: float) -> float:
        return 0.5 * speed * (self.travel - self.blend)


class Triangular(Polyline, Settings):
    """Motion through the positions p0, p1 ..., turning at each position without rest.

    Attributes
    ----------
    family : str
        triangular.
    points : int
        Number of positions.
    travel : float, s
        Time from one position to the next.
    blend : float, s
        Time of a rounded corner.
    speed : float, rad/s or m/s
        Largest velocity between positions in the search.
    """

    family: Literal["triangular"] = field(default="triangular", kw_only=True)
    points: Corners = 6
    travel: Positive = 2.0
    blend: Positive = 0.2
    speed: Positive = 0.5

    def __post_init__(self) -> None:
        message = (
            f"triangular: a corner takes {self.blend} s, more than the {self.travel} s "
            "between corners; shorten the blend"
        )
        require(self.blend <= self.travel, message, "blend")

    @property
    def duration(self) -> float:
        return self.travel * (self.points - 1) + self.blend

    @property
    def ramps(self) -> list[tuple[float, float]]:
        return list(pairwise(self.blend / 2 + self.travel * np.arange(self.points)))

    def stride(self, speed: float) -> float:
        return 0.8 * min(speed, self.speed) * self.travel


AnyFamily = Annotated[
    Fourier | Sinusoids | PointToPoint | Triangular, Field(discriminator="family")
]


def _linear(basis: Sequence[Array], p: Any, math: Any) -> States:
    q, qd, qdd = (B @ p if math is np else math.mtimes(math.DM(B), p) for B in basis)
    return q, qd, qdd


def _step(t: Array, width: float, sign: float = 1.0) -> tuple[Array, Array, Array]:
    """Compute a smooth step from 0 to 1 within [0, width], and its two time derivatives.

    The step is 10 x^3 - 15 x^4 + 6 x^5 with x = t/width. sign : -1 if t runs against the time.
    """
    x = np.clip(t / width, 0.0, 1.0)
    speed, bend = 30 * x**2 * (1 - x) ** 2 / width, 60 * x * (1 - x) * (1 - 2 * x) / width**2
    return x**3 * (10 - 15 * x + 6 * x**2), sign * speed, bend


def ramp(t: Array, start: float, stop: float, blend: float) -> Array:
    """Compute a move from 0 to 1 of constant velocity between start and stop, rounded at both.

    The result is the move with its two time derivatives, shape (3, N); each corner lasts `blend`.
    """
    return np.asarray((_corner(t - start, blend) - _corner(t - stop, blend)) / (stop - start))


def _corner(u: Array, blend: float) -> Array:
    """Compute a ramp max(u, 0), rounded within |u| < blend/2, and its two derivatives.

    The result has shape (3, N). In the corner the speed rises as 3 x^2 - 2 x^3, x from 0 to 1.
    """
    x = np.clip(u / blend + 0.5, 0.0, 1.0)
    beyond = np.maximum(u - blend / 2, 0.0)
    return np.array(
        [blend * (x**3 - x**4 / 2) + beyond, 3 * x**2 - 2 * x**3, 6 * x * (1 - x) / blend]
    )


def _between(rng: np.random.Generator, lower: float, upper: float) -> float:
    """Draw a random position in the middle half of the range [lower, upper]."""
    return float(rng.uniform(0.75 * lower + 0.25 * upper, 0.25 * lower + 0.75 * upper))


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
