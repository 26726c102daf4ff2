"""Inertias that a body can have, but no link of this robot, because of units of CAD, a wrong
reference point or wrong products.

The radius of gyration rho of a link is the root mean square distance of its mass from its centre of
mass; a ball of the same mass and rho has the density D.

    rho = root(tr I / (2 M))        D = M / (4 pi/3 (rho root(5/3))^3)

A moving link is not larger than the robot, and no metal is denser than 22600 kg/m^3. The bounds
leave a margin to the values of 2600 links in 123 URDF files, whose median of D is 400 kg/m^3.
Values beyond the bounds are errors or placeholders. An I in g mm^2 makes rho 31623 times, in kg
mm^2 1000 times, in g m^2 31.6 times too large.

Moments about the origin of a link are possible moments of a body, too. So this error is reported
only for many links at once: even in correct files, every tenth link with a centre far from its
origin still has possible moments after the term of Huygens is subtracted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from symgen.description.bodies import ROUNDED, no_body
from symgen.description.robot import INERTIAL, Robot, parameter
from symgen.description.tree import Array, inertial_of

FAR = 4.0  # times the lengths of the robot, or m: a mass at this distance is not on the robot
THIN, THINNER = 0.1, 0.5  # kg/m^3, alone, and beside another link of the same error; air: 1.2
WIDE, WIDER = 6.0, 2.0  # rho over the lengths beside the link, likewise
DENSE, DENSER = 1e5, 2.3e4  # kg/m^3, likewise; the densest metal: 22600
LINK = 1.0, 2e4  # kg/m^3: a remedy brings a link into this range, nearest to ...
USUAL = 400.0  # kg/m^3: the median of the links of 123 files
PLACEHOLDER = 2e-3  # kg, and of equal moments: a number that only keeps a simulator going
EQUAL = 1e-3  # relative difference of equal moments
TON = 50.0  # kg: a link whose mass may be one in g
APART = 0.5  # of rho: a centre from which the origin can be told
BY_CHANCE = 0.1  # of right links, of which moments about the origin would be those of a body
CHANCE = 2e-5  # probability that as many links of a right file are


class Remedy(NamedTuple):
    """A correction of moments and mass, and the words that name it."""

    moments: float
    mass: float
    words: str


REMEDIES = (
    Remedy(1e-3, 1, "the moments are probably in g m^2: multiply them by 1e-3"),
    Remedy(1e-6, 1, "the moments are probably in kg mm^2: multiply them by 1e-6"),
    Remedy(1e-9, 1, "the moments are probably in g mm^2: multiply them by 1e-9"),
    Remedy(1e-9, 1e-3, "moments and mass are probably in g mm^2 and g: multiply by 1e-9 and 1e-3"),
    Remedy(1e3, 1, "the moments are probably divided by 1e3 once too often: multiply them by 1e3"),
    Remedy(1e6, 1, "the moments are probably divided by 1e6 once too often: multiply them by 1e6"),
    Remedy(1e9, 1, "the moments are probably divided by 1e9 once too often: multiply them by 1e9"),
    Remedy(1, 1e-3, "the mass is probably in g: multiply it by 1e-3"),
)


@dataclass(frozen=True, eq=False)
class Held:
    """A link with mass: its frame, its name in sentences, mass, centre, and tensor about the centre.

    Attributes
    ----------
    j : int
        Number of the frame with which the link moves.
    name : str
    M : float, kg
    c : ndarray, shape (3,), m
        Centre of mass from the origin of the link, in the axes of I.
    I : ndarray, shape (3, 3), kg m^2
        Inertia tensor about the centre of mass.
    """

    j: int
    name: str
    M: float
    c: Array
    I: Array

    @cached_property
    def rho(self) -> float:
        """Radius of gyration, m."""
        return math.sqrt(np.trace(self.I) / (2 * self.M))

    @property
    def density(self) -> float:
        """Density of a ball of the same mass and radius of gyration, kg/m^3."""
        return self.M / (4 / 3 * math.pi * (self.rho * math.sqrt(5 / 3)) ** 3)

    @property
    def stated(self) -> bool:
        """Whether the file states a real inertia with mass, and not a placeholder."""
        moments = np.diag(self.I)
        return self.M > PLACEHOLDER and np.ptp(moments) > EQUAL * moments.max()

    def by(self, remedy: Remedy) -> float:
        """Compute the density after the remedy, kg/m^3."""
        return float(self.density * remedy.mass**2.5 / remedy.moments**1.5)


def from_cad(robot: Robot) -> list[str]:
    """Return a sentence on each kind of inertia that is probably another quantity, or in other
    units.

    The inertias are those of the links of a URDF or MJCF, or else the `values` of links with all
    ten parameters.
    """
    bodies = [
        body
        for body in _held(robot)
        if np.trace(body.I) > ROUNDED
        and not no_body(body.M, body.I)  # others are told, or point masses
    ]
    beside, reach = _lengths(robot)
    wrong = {
        k: (kind, _remedy(body, kind))
        for k, body in enumerate(bodies)
        if (kind := _size(body, beside[body.j], reach))
    }
    shared = {same for same in wrong.values() if same[1]}
    for k, body in enumerate(bodies):
        kind = "" if k in wrong else _size(body, beside[body.j], reach, beside_another=True)
        if kind and (same := (kind, _remedy(body, kind))) in shared:
            wrong[k] = same
    texts = []
    for kind, remedy in dict.fromkeys(wrong.values()):
        those = [bodies[k] for k in sorted(wrong) if wrong[k] == (kind, remedy)]
        texts.append(_sentence(kind, remedy, those, reach))
    if far := [body for body in bodies if np.linalg.norm(body.c) > FAR * max(reach, 1.0)]:
        texts.append(
            f"{_names(far)}: the centre of mass is {np.linalg.norm(far[0].c):.3g} m from the origin; "
            "lengths are in m, not mm"
        )
    if robot.bodies and not texts:
        texts += filter(None, [_about_origin(bodies)])
    return texts


def _size(body: Held, beside: float, reach: float, beside_another: bool = False) -> str:
    """Judge the size of a link: far, thin or dense; "" if a link can have this size.

    beside : length of the neighbouring frames, m. reach : sum of the lengths of the robot, m.
      beside_another : whether another link of the robot has the same error.
    """
    if body.rho > FAR * max(reach, 1.0):
        return "far"
    if not body.stated:
        return ""
    thin, wide = (THINNER, WIDER) if beside_another else (THIN, WIDE)
    if body.density < thin and body.rho > wide * max(beside, float(np.linalg.norm(body.c))):
        return "thin"
    return "dense" if body.density > (DENSER if beside_another else DENSE) else ""


def _remedy(body: Held, kind: str) -> Remedy | None:
    """Choose the remedy that makes a link most like others; None if none does."""
    fits = [
        remedy
        for remedy in REMEDIES
        if (remedy.moments < 1) == (kind != "dense")
        and (remedy.mass == 1 or body.M > TON)
        and LINK[0] < body.by(remedy) < LINK[1]
    ]
    return min(fits, key=lambda remedy: abs(math.log(body.by(remedy) / USUAL)), default=None)


def _sentence(kind: str, remedy: Remedy | None, same: Sequence[Held], reach: float) -> str:
    body = same[0]
    size = {
        "far": f"{body.rho:.3g} m from its centre, and all lengths of the robot are {reach:.2g} m",
        "thin": f"{body.rho:.3g} m from its centre, as of a body lighter than air",
        "dense": f"{body.rho:.2g} m from its centre, as of a body denser than any metal",
    }[kind]
    words = remedy.words if remedy else "compare moments and mass with CAD"
    return f"{_names(same)}: by the moments, the mass of {body.M:.3g} kg is {size}; {words}"


def _names(bodies: Sequence[Held]) -> str:
    first, *others = (body.name for body in bodies)
    named = f" (and {', '.join(others[:3])}{f', {len(others) - 3} more' * (len(others) > 3)})"
    return first + named * bool(others)


def _about_origin(bodies: Sequence[Held]) -> str:
    """Ask whether the moments of most links are about their origins, because bodies can have them
    even without M (c'c 1 - c c').

    A single link proves nothing: every tenth correct link passes this test.
    """
    told = {b.M: b for b in bodies if b.stated and np.linalg.norm(b.c) > APART * b.rho}
    passed = [
        b
        for b in told.values()  # links of the same mass, such as both legs, are one
        if not no_body(b.M, b.I - b.M * (b.c @ b.c * np.eye(3) - np.outer(b.c, b.c)))
    ]
    n, p = len(told), BY_CHANCE
    if sum(math.comb(n, k) * p**k * (1 - p) ** (n - k) for k in range(len(passed), n + 1)) > CHANCE:
        return ""
    return (
        f"{_names(passed)}: the moments are probably about the origins of the links, and not about "
        f"their centres of mass: those of {len(passed)} of {len(told)} links less M (c'c 1 - c c'), c "
        "the centre, are still moments of bodies, which is so of every tenth right link"
    )


def _held(robot: Robot) -> Iterator[Held]:
    """Yield the moving links that have mass and inertia."""
    for j, name, M, c, I in robot.bodies:
        if j and M > 0:
            yield Held(j, name, M, np.array(c), np.array(I))
    for j in () if robot.bodies else robot.links:
        given = [x for p in INERTIAL if (x := robot.values.get(parameter(p, j))) is not None]
        if len(given) == len(INERTIAL) and given[-1] > 0:
            ten = inertial_of(given)
            yield Held(j, f"link {j} ({robot.file or robot.name})", ten.M, ten.pose[:3, 3], ten.I)


def _lengths(robot: Robot) -> tuple[Mapping[int, float], float]:
    """Compute the largest length of the frames next to each link, and the sum of all lengths, m."""
    length = {
        f.j: math.hypot(*(e.value(robot.constants) for e in (f.b, f.d, f.r0))) for f in robot.frames
    }
    beside = {}
    for f in robot.frames:
        near = {f.j, f.ant, *(g.j for g in robot.frames if g.ant in (f.j, f.ant))}
        beside[f.j] = max(length.get(j, 0.0) for j in near)
    return beside, sum(length.values())
