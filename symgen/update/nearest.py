"""Numbers of a file that give the identified base parameters, as near to the file's as physics allows: the feasible program of `identify`, with the file as prior.

    min ||(u - u0) / S||     subject to  K chi(u) = X,  every condition of `runtime.physical.inertia`

u are the numbers that the file states, u0 as it states them, S their sizes: of each link with
inertia mass M, centre c and tensor I about it, and the parameters of the elements on the joints.
chi are the ten parameters of each link in the frame j of its body, and those of the elements:

    MS = M c,    J = I + M (c'c 1 - c c')

K chi(u) = X is linearised until it holds; where the numbers are no physical robot, the program of
`runtime.physical.feasibility` gives chi, its prior the values of the file. A number on which no
base parameter depends does not move, nor does a mass that enters none but by its first moment and
its tensor.

A body may be several links, held together by fixed joints: the record knows their sum. First the
link that the joint carries changes alone; only if no physical link is left, the others change
with it. What the torques cannot separate from a motor inertia is one, whether the format has a place
for it or not; other elements that the file does not have change only if links cannot take them
in.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.core.limits import LIMIT
from runtime.physical.feasibility import feasibility, nearest_standard, scales
from runtime.physical.inertia import INERTIAL, PhysicalModel
from symgen.description.tree import Array
from symgen.errors import DescriptionError
from symgen.update.places import FileLink

NONE = "no physical robot of this file has the estimate"
MISSED = 1e-9  # of the size of a base parameter: more is not reached
STEPS, SETTLED = 30, 1e-15  # of Newton, and what they change at last
FAR = 1e6  # sizes that a number may move
ROTORS = 1e6  # size of a motor inertia beside that of the file
NEAR = 1e-6  # of the size of a number: nearer to the file is rounding
BARRIER = 2 * LIMIT.LEAST_EIGENVALUE  # what the program keeps an element from zero
STRANGE = 2.0  # mass over that of the file
TINY = 1e-15  # SI; an eigenvalue so little below zero is rounding


@dataclass(frozen=True, eq=False)
class Nearest:
    """Numbers u, shape (p,), of the links of a file and of the elements on its joints.

    Attributes
    ----------
    u, u0 : ndarray, shape (p,)
        Found, and of the file.
    chi : ndarray, shape (p,)
        Standard parameters chi(u).
    gain : ndarray, shape (p, b)
        d u / d X without conditions.
    seen, told : ndarray of bool, shape (p,)
        Numbers that a base parameter depends on, and those that X alone tells.
    links : mapping of list of int
        Places of the ten numbers of each link.
    elements : mapping of int
        Place of each parameter of an element.
    spread : tuple of str
        Links behind fixed joints that had to change too.
    """

    u: Array
    u0: Array
    chi: Array
    gain: Array
    seen: Array
    told: Array
    links: Mapping[str, list[int]]
    elements: Mapping[str, int]
    spread: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Numbers:
    """The unknowns of the program.

    Attributes
    ----------
    physical : PhysicalModel
        With ten parameters by link of the file, and the elements.
    links : list of (FileLink, list of int)
        Links, and the places of their ten.
    u0, size, ease : ndarray, shape (p,)
        As the file states them, their sizes, and how many of these they change as readily as
        others change one.
    masses : ndarray of bool, shape (p,)
        Masses that enter no base parameter but by first moments and tensors.
    """

    physical: PhysicalModel
    links: Sequence[tuple[FileLink, list[int]]]
    u0: Array
    size: Array
    ease: Array
    masses: Array

    def head(self, count: int) -> Numbers:
        """The program with the first `count` numbers alone."""
        p = self.physical
        kept = tuple(c for c in p.conditions if max(c.numbers) < count)
        part = replace(p, standard=p.standard[:count], K=p.K[:, :count], conditions=kept)
        links = [(link, at) for link, at in self.links if at[-1] < count]
        of_numbers = (self.u0, self.size, self.ease, self.masses)
        return Numbers(part, links, *(x[:count] for x in of_numbers))

    def chi(self, u: Array) -> Array:
        """Standard parameters that the numbers u give, shape (p,)."""
        chi = u.copy()
        for link, at in self.links:
            chi[at] = link.place.ten(u[at])
        return chi

    def slope(self, u: Array) -> Array:
        """d chi / d u, shape (p, p): chi is of second order in every number."""
        T = np.eye(len(u))
        for link, at in self.links:
            for k, place in enumerate(at):
                step = np.zeros(10)
                step[k] = self.size[place]
                rise = link.place.ten(u[at] + step) - link.place.ten(u[at] - step)
                T[at, place] = rise / (2 * self.size[place])
        return T

    def seen(self, u: Array) -> Array:
        """Numbers that a base parameter depends on, bool (p,)."""
        A = self.physical.K @ self.slope(u) * self.size
        share = np.abs(A) > MISSED * np.linalg.norm(A, axis=1, keepdims=True)
        return np.asarray(np.any(share, axis=0))


def nearest(
    physical: PhysicalModel,
    links: Sequence[FileLink],
    values: Mapping[str, float],
    names: Sequence[str],
    X: Array,
    absent: Collection[str] = (),
) -> Nearest:
    """The numbers of `links`, and of the elements, nearest to those of the file.

    Parameters
    ----------
    physical : PhysicalModel
        Of the robot, one link for each body.
    links : sequence of FileLink
        The first of a body is the one that changes first.
    values : mapping, SI
        Of the elements on the joints, by name.
    names : sequence of str
        Base parameters with values.
    X : ndarray, shape (len(names),), SI
        Their values.
    absent : collection of str
        Elements that the file does not have; they change only if the links cannot.

    Raises
    ------
    DescriptionError
        A base parameter that no link of the file can give, or no physical robot.
    """
    whole, elements, counts = _of_file(physical, links, values, absent)
    K, chi0 = whole.physical.rows(names), whole.chi(whole.u0)
    answer = ""
    for count in counts:
        part = whole.head(count)
        rest = X - K[:, count:] @ chi0[count:]
        u, answer = _within(part, names, rest, X)
        if u is not None:
            break
    else:
        raise DescriptionError(f"{NONE}: {answer.replace('NOT physically feasible: ', '')}")
    found = np.concatenate([u, whole.u0[count:]])
    places = {link.name: at for link, at in whole.links}
    moved = tuple(
        name
        for name, at in places.items()
        if at[0] >= counts[-2] and np.any(found[at] != whole.u0[at])
    )
    gain, told = np.zeros((len(found), len(X))), np.zeros(len(found), dtype=bool)
    S = np.where(part.masses, 0.0, part.size * part.ease)
    A = K[:, :count] @ part.slope(u) * S
    inverse = np.linalg.pinv(A, rcond=1e-12)
    gain[:count] = S[:, None] * inverse
    told[:count] = np.linalg.norm(np.eye(count) - inverse @ A, axis=1) < NEAR
    return Nearest(
        found,
        whole.u0,
        whole.chi(found),
        gain,
        whole.seen(found) & ~whole.masses,
        told,
        places,
        elements,
        moved,
    )


def _of_file(
    physical: PhysicalModel,
    links: Sequence[FileLink],
    values: Mapping[str, float],
    absent: Collection[str],
) -> tuple[Numbers, dict[str, int], list[int]]:
    """Numbers of the file, places of the elements, and, for each attempt, which numbers may change.

    First links that lead a body, and elements; then elements that the file does not have and the
    links can take in; then the other links.
    """
    leading = {link.j: link for link in reversed(links)}
    led = [leading[j] for j in physical.links if j in leading]
    others = [link for link in links if link is not leading[link.j]]
    inertial = {f"{family}{j}" for j in physical.links for family in INERTIAL}
    names = [name for name in physical.standard if name not in inertial]
    of_led = [f"{family}{link.j}" for link in led for family in INERTIAL]
    spare = _spare(physical, [*of_led, *names], [name for name in absent if name in names])
    names = [*(name for name in names if name not in spare), *spare]
    first = len(of_led) + len(names)
    counts = [first - len(spare), first, first + 10 * len(others)]
    columns = [*of_led, *names, *(f"{family}{link.j}" for link in others for family in INERTIAL)]
    places = [list(range(10 * k, 10 * k + 10)) for k in range(len(led))]
    places += [list(range(first + 10 * k, first + 10 * k + 10)) for k in range(len(others))]
    elements = {name: len(of_led) + k for k, name in enumerate(names)}
    conditions = []
    of_body = {c.name: c for c in physical.conditions}
    for link, at in zip([*led, *others], places, strict=True):
        c = of_body[f"link {link.j}"]
        conditions.append(
            replace(c, name=f"link {link.name!a:.60}", numbers=tuple(at), size=np.ones(4))
        )
    for c in physical.conditions:
        named = [physical.standard[k] for k in c.numbers]
        if all(name in elements for name in named):
            numbers = tuple(elements[name] for name in named)
            conditions.append(replace(c, numbers=numbers, size=np.ones(len(c.size))))
    u0 = np.array([values.get(name, 0.0) for name in columns])
    size = np.ones(len(columns))
    for link, at in zip([*led, *others], places, strict=True):
        u0[at], size[at] = link.numbers, _sizes_of(link.numbers)
    further = range(max(physical.links) + 1, max(physical.links) + 1 + len(others))
    standard = (*columns[:first], *(f"{family}{v}" for v in further for family in INERTIAL))
    K = physical.K[:, [physical.standard.index(name) for name in columns]]
    led_bodies = tuple(link.j for link in led)
    of_file = replace(
        physical, standard=standard, K=K, links=led_bodies, conditions=tuple(conditions)
    )
    at = list(elements.values())
    size[at] = scales(replace(physical, standard=tuple(names), values=dict(values)))
    ease = np.array([ROTORS if name.startswith("Ia") else 1.0 for name in columns])
    masses = np.zeros(len(columns), dtype=bool)
    for at in places:
        masses[at[0]] = not np.any(K[:, at[-1]])
    of_links = list(zip([*led, *others], places, strict=True))
    whole = Numbers(of_file, of_links, u0, size, ease, masses)
    values_of_file = dict(zip(standard, whole.chi(u0).tolist(), strict=True))
    return replace(whole, physical=replace(of_file, values=values_of_file)), elements, counts


def _sizes_of(x: Array) -> Array:
    """Typical sizes of NUMBERS: the mass, and by the extent of the link its centre and moments."""
    M, moments = x[0], float(np.abs(x[[4, 7, 9]]).sum()) / 2
    extent = np.sqrt(x[1:4] @ x[1:4] + moments / M) if M > 0 else 1.0
    return np.array([M, *[max(extent, 1e-3)] * 3, *[max(moments, 1e-3 * M * extent**2)] * 6])


def _spare(physical: PhysicalModel, own: Sequence[str], absent: Sequence[str]) -> list[str]:
    """Find parameters that the file lacks and whose columns the other parameters make up."""
    spare: list[str] = []

    def rank(names: Sequence[str]) -> int:
        columns = physical.K[:, [physical.standard.index(name) for name in names]]
        sizes = np.linalg.norm(columns, axis=0)
        return int(np.linalg.matrix_rank(columns[:, sizes > 0] / sizes[sizes > 0], tol=MISSED))

    for name in absent:
        others = [other for other in own if other not in (*spare, name)]
        if rank(others) == rank([*others, name]):
            spare.append(name)
    return spare


def _within(part: Numbers, names: Sequence[str], rest: Array, X: Array) -> tuple[Array | None, str]:
    """Numbers with K chi(u) = rest; None, and why, where no physical robot has them."""
    K = part.physical.rows(names)
    sizes = np.maximum(np.abs(X), np.abs(K) @ scales(part.physical))
    reached = K @ np.linalg.lstsq(K, rest, rcond=None)[0]
    missed = np.abs(reached - rest) > MISSED * np.maximum(sizes, MISSED)
    if missed.any():
        lost = ", ".join(
            f"{name} = {x:.4g}" for name, x, out in zip(names, X, missed, strict=True) if out
        )
        raise DescriptionError(
            f"no values of this file give {lost}, since a moving link has no <inertial> that could "
            "hold it; add one to that link"
        )
    u = _solve(part, K, rest, part.u0, ~part.masses)
    if u is None or _violated(part, u):
        answer = feasibility(part.physical, names, rest)
        if not answer.feasible:
            return None, answer.text
        u = _hold(part, nearest_standard(part.physical, names, rest, answer.chi))
    near = NEAR * part.size
    alone = [c.numbers[0] for c in part.physical.conditions if len(c.numbers) == 1]
    near[alone] += BARRIER
    moved = np.abs(u - part.u0) > near
    clean = _solve(part, K, rest, np.where(moved, u, part.u0), moved)
    if clean is None or np.abs(K @ part.chi(clean) - rest).max() > MISSED * sizes.max():
        return u, ""
    return (u if _violated(part, clean) else clean), ""


def _violated(part: Numbers, u: Array) -> bool:
    """Whether a condition is violated by numbers that moved."""
    chi, moved = part.chi(u), u != part.u0
    conditions = [c for c in part.physical.conditions if moved[list(c.numbers)].any()]
    return any(c.smallest(chi) < -TINY for c in conditions)


def _solve(part: Numbers, K: Array, rest: Array, start: Array, free: Array) -> Array | None:
    """Find the numbers nearest to `start` with K chi(u) = rest; only those in `free` move.

    None if Newton's steps do not find them.
    """
    S, u = (part.size * part.ease)[free], start.copy()
    for _ in range(STEPS):
        A = K @ part.slope(u)[:, free]
        wanted = rest - K @ part.chi(u) + A @ (u - start)[free]
        step = S * (np.linalg.pinv(A * S, rcond=1e-12) @ wanted)
        if not np.all(np.abs(step) <= FAR * S):
            return None
        before, u = u, start.copy()
        u[free] += step
        if np.all(np.abs(u - before) <= SETTLED * part.size):
            break
    missed = np.abs(rest - K @ part.chi(u))
    sizes = np.abs(K) @ scales(part.physical) + np.abs(rest)
    return u if np.all(missed <= NEAR * sizes) else None


def _hold(part: Numbers, chi: Array) -> Array:
    """Numbers of chi, but with the file's value wherever no base parameter depends on it.

    If that gives no physical link, chi's own numbers stay.
    """
    u = chi.copy()
    for link, at in part.links:
        u[at] = link.place.numbers(chi[at])
    held = np.where(part.seen(u), u, part.u0)
    for c in part.physical.conditions:
        at = list(c.numbers)
        u[at] = held[at] if c.smallest(part.chi(held)) >= 0 else u[at]
    return u


def strange(link: FileLink, closest: Nearest) -> str:
    """Say how far mass and centre of a link are from those of the file.

    "" if the mass is within a factor STRANGE and the centre has moved by less than the size of the
    link.
    """
    before, after = (u[closest.links[link.name]] for u in (closest.u0, closest.u))
    m0, m, far = before[0], after[0], float(np.linalg.norm((after - before)[1:4]))
    extent = np.sqrt(max(link.ten[[0, 3, 5]].sum(), 0.0) / 2 / m0) if m0 else 0.0
    if m0 / STRANGE <= m <= STRANGE * m0 and far <= extent:
        return ""
    return f"link {link.name!a:.60} of {m:.3g} kg (file {m0:.3g}), its centre {far:.2g} m away"
