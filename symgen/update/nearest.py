"""Find the physically possible robot with given base parameters, nearest to a file's values.

The optimisation is that of the feasible estimate in `identify`, with the file as prior:

    min ||(u - u0) / S||     subject to  K chi(u) = X,  every condition of
    `runtime.physical.inertia`

u are the numbers of the file: for each link with inertia, mass M, centre c and tensor I about the
centre, and the parameters of the elements on the joints. u0 are their values in the file, S their
sizes. chi are the ten parameters of each link in the frame j of its body, and the parameters of the
elements:

    MS = M c,    J = I + M (c'c 1 - c c')

K chi(u) = X is linearised and solved repeatedly until it holds. If the resulting numbers are no
physical robot, a semidefinite program finds chi: K chi = X and the conditions are linear in chi,
and the distance in u is linearised repeatedly. Both ways have the same order of preference: a motor
inertia receives all inertia that the torques cannot separate from it, whether or not the format has
a place for motor inertias. A number on which no base parameter depends does not change. A mass does
not change if base parameters depend on it only through its first moment and its tensor. Such a
number or mass changes only if no physical robot is possible otherwise.

A body may be several links, held together by fixed joints: the record determines only their sum.
First, only the link on the moving joint changes, or, if it has no mass, the next link; the other
links change with it only if no physical link is possible otherwise. Other elements that the file
does not have change only if the links cannot give the same torques.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.ground.limits import limits
from runtime.physical.feasibility import (
    blocked,
    feasibility,
    limit_rows,
    nearest_physical,
    scales,
    units,
)
from runtime.physical.inertia import INERTIAL, PhysicalModel
from runtime.physical.semidefinite import LinearBounds, Space, margin, solutions, within
from symgen.description.tree import Array
from symgen.errors import DescriptionError
from symgen.update.places import FileLink

LIMIT = limits("runtime.physical")

NONE = "no physical robot with the links of this file has the estimated parameters"
MISSED = 1e-9  # of the size of a base parameter: more is not reached
STEPS, SETTLED = 30, 1e-15  # of Newton, and what they change at last
LINEARISED, STILL = 10, 1e-4  # of the distance: how often, and the sizes that it changes at last
FAR = 1e6  # sizes that a number may move
ROTORS = 1e6  # size of a motor inertia beside that of the file
NEAR = 1e-6  # of the size of a number: nearer to the file is rounding
EQUAL = 1e-9  # of the size of a number: so near, a number of the file stays in any case
BARRIER = 2 * LIMIT.LEAST_EIGENVALUE  # what the program keeps an element from zero
STRANGE = 2.0  # mass over that of the file
NO_MASS = 1e-15  # kg; a link with no more has no mass, as in MuJoCo
SMALL = 0.1, 0.1  # kg, m: mass and extent of a small body
TINY = 1e-15  # SI; an eigenvalue so little below zero is rounding


@dataclass(frozen=True, eq=False)
class Nearest:
    """Result of `nearest`: masses, centres of mass, inertia tensors and joint parameters.

    The numbers u, shape (p,), are mass, centre and tensor of each link, and the parameters of the
    elements on the joints.

    Attributes
    ----------
    u, u0 : ndarray, shape (p,)
        Numbers found, and numbers of the file.
    chi : ndarray, shape (p,)
        Standard parameters chi(u).
    gain : ndarray, shape (p, b)
        d u / d X without the physical conditions.
    seen, told : ndarray of bool, shape (p,)
        Whether a base parameter depends on the number, and whether X alone determines the number.
    links : mapping of list of int
        Indices of the ten numbers of each link.
    elements : mapping of int
        Index of each parameter of an element.
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
    """Unknowns of the optimisation in `nearest`: link and joint values as in the file.

    Each link of the file has ten unknowns; the joint parameters are those of the elements on the
    joints.

    Attributes
    ----------
    physical : PhysicalModel
        Model with ten parameters for each link of the file, and the elements.
    links : list of (FileLink, list of int)
        Links, and the indices of their ten numbers.
    u0, size, ease : ndarray, shape (p,)
        Values in the file, typical sizes, and ease of change: a number with ease 10 changes by ten
        sizes as readily as a number with ease 1 changes by one size.
    masses : ndarray of bool, shape (p,)
        Whether the number is a mass on which base parameters depend only through first moments and
        tensors.
    """

    physical: PhysicalModel
    links: Sequence[tuple[FileLink, list[int]]]
    u0: Array
    size: Array
    ease: Array
    masses: Array

    def head(self, count: int) -> Numbers:
        """Return the unknowns with the indices 0 ... `count` - 1 alone, to optimise only these."""
        p = self.physical
        kept = tuple(c for c in p.conditions if max(c.numbers) < count)
        part = replace(p, standard=p.standard[:count], K=p.K[:, :count], conditions=kept)
        links = [(link, at) for link, at in self.links if at[-1] < count]
        of_numbers = (self.u0, self.size, self.ease, self.masses)
        return Numbers(part, links, *(x[:count] for x in of_numbers))

    def chi(self, u: Array) -> Array:
        """Compute standard parameters, shape (p,), from the unknowns u (link and joint values)."""
        chi = u.copy()
        for link, at in self.links:
            chi[at] = link.place.ten(u[at])
        return chi

    def slope(self, u: Array) -> Array:
        """Compute the derivatives (p, p) of the standard parameters with respect to the unknowns u.

        u are masses, centres, tensors and joint parameters. Central differences are exact, because
        chi is of second order in every number.
        """
        T = np.eye(len(u))
        for link, at in self.links:
            for k, place in enumerate(at):
                step = np.zeros(10)
                step[k] = self.size[place]
                rise = link.place.ten(u[at] + step) - link.place.ten(u[at] - step)
                T[at, place] = rise / (2 * self.size[place])
        return T

    def seen(self, u: Array) -> Array:
        """Find the link and joint values that affect any base parameter; bool, shape (p,)."""
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
    """Find the physically possible robot with base parameters X that is nearest to a file's values.

    Parameters
    ----------
    physical : PhysicalModel
        Model of the robot, with one link for each body.
    links : sequence of FileLink
        Links of the file. In each body, the first link with mass changes first.
    values : mapping, SI
        Values of the elements on the joints, by name.
    names : sequence of str
        Names of the base parameters that are given.
    X : ndarray, shape (len(names),), SI
        Values of these base parameters.
    absent : collection of str
        Elements that the file does not have; they change only if a change of the links is not
        enough.

    Raises
    ------
    DescriptionError
        No link of the file can give a base parameter, or no physical robot has X.
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
    A = K[:, :count] @ part.slope(u) * np.where(part.masses, 0.0, part.size)  # rotors as links
    told[:count] = np.linalg.norm(np.eye(count) - np.linalg.pinv(A, rcond=1e-12) @ A, axis=1) < NEAR
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
    """Collect the unknowns of `nearest` from the file, sorted by the attempt that may change them.

    Return the unknowns, the index of each element, and the number of values that each attempt may
    change. The first attempt may change the first link with mass of each body, and the elements.
    The second attempt adds elements that the file does not have and that other parameters can
    replace; the third attempt adds the other links.
    """
    massless_last = sorted(links, key=lambda link: link.ten[-1] <= NO_MASS)
    leading = {link.j: link for link in reversed(massless_last)}
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
    """Estimate typical sizes of mass, centre of mass and inertia tensor of a link, shape (10,).

    The sizes of centre and tensor follow from the extent of the link. A link without mass has no
    extent; its sizes are those of a small body.
    """
    M, moments = x[0], float(np.abs(x[[4, 7, 9]]).sum()) / 2
    if M <= NO_MASS:
        mass, extent = SMALL
        return np.array([mass, *[extent] * 3, *[max(moments, mass * extent**2)] * 6])
    extent = max(np.sqrt(x[1:4] @ x[1:4] + moments / M), 1e-3)
    return np.array([M, *[extent] * 3, *[max(moments, 1e-3 * M * extent**2)] * 6])


def _spare(physical: PhysicalModel, own: Sequence[str], absent: Sequence[str]) -> list[str]:
    """Find the joint parameters that are not in the file and that other parameters can replace."""
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
    """Find the link and joint values of a physically possible robot with given base parameters.

    The equation is K chi(u) = rest, with the standard parameters chi; `rest` is the part of the
    base parameters X that does not come from values which stay as in the file. Return u and "", or
    None and the reason why no physical robot has these base parameters.
    """
    K = part.physical.rows(names)
    sizes = np.maximum(np.abs(X), np.abs(K) @ scales(part.physical))
    reached = K @ np.linalg.lstsq(K, rest, rcond=None)[0]
    missed = np.abs(reached - rest) > MISSED * np.maximum(sizes, MISSED)
    if missed.any():
        lost = ", ".join(
            f"{name} = {x:.4g}" for name, x, out in zip(names, X, missed, strict=True) if out
        )
        raise DescriptionError(
            f"no inertial values in this file can give the identified {lost}, because a moving "
            "link has no <inertial>; add <inertial> to this link"
        )
    missed_most = MISSED * float(sizes.max())
    u = _solve(part, K, rest, part.u0, ~part.masses)
    for v in () if u is None else (_clean(part, K, rest, u, missed_most), u):
        if not _violated(part, v):
            return v, ""
    answer = feasibility(part.physical, names, rest)
    if not answer.feasible:
        return None, answer.text
    u = _physical(part, K, rest, part.u0 if u is None else u, answer.chi)
    v = _clean(part, K, rest, u, missed_most)
    return (u if _violated(part, v) else v), ""


def _clean(part: Numbers, K: Array, rest: Array, u: Array, missed_most: float) -> Array:
    """Reset numbers that have hardly moved to their values in the file, and let the others give K
    chi = rest.

    A number that moved by less than 1e-6 of its size (`NEAR`) is reset if the others can compensate
    for it; a number that moved by less than 1e-9 of its size (`EQUAL`) is reset whenever K chi =
    rest allows it.
    """
    near = NEAR * part.size
    alone = [c.numbers[0] for c in part.physical.conditions if len(c.numbers) == 1]
    near[alone] += BARRIER
    moved = np.abs(u - part.u0) > near
    clean = _solve(part, K, rest, np.where(moved, u, part.u0), moved)
    kept = np.where(np.abs(u - part.u0) > EQUAL * part.size, u, part.u0)
    for v in (clean, kept):
        if v is not None and np.abs(K @ part.chi(v) - rest).max() <= missed_most:
            return v
    return u


def _violated(part: Numbers, u: Array) -> bool:
    """Whether the link and joint values that changed are physically impossible."""
    chi, moved = part.chi(u), u != part.u0
    conditions = [c for c in part.physical.conditions if moved[list(c.numbers)].any()]
    return any(c.smallest(chi) < -TINY for c in conditions)


def _solve(part: Numbers, K: Array, rest: Array, start: Array, free: Array) -> Array | None:
    """Find the link and joint values nearest to `start` that give the base parameters.

    The equation K chi(u) = rest, with the standard parameters chi, is solved by Newton's method.
    Only the values in `free` change. The result is None if the steps do not reach a solution.
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


def _physical(part: Numbers, K: Array, rest: Array, u: Array, start: Array) -> Array:
    """Find the link and joint values of the physical robot nearest to the file.

    The optimisation is that of `_solve`, with every condition of a physical robot. K chi = rest and
    the conditions are linear in the standard parameters chi, and hold exactly. The distance from
    the file is linearised repeatedly, first at u:

        u(chi) = u + T^-1 (chi - chi(u)),    T = d chi / d u

    Finally, the motor inertias, which move most easily, get the values nearest to the file that the
    links allow.

    u : values of `_solve`, or of the file. start : standard parameters of a physical robot with
    K chi = rest.
    """
    held, start = _held(part, K, rest, u, start)
    rows, S = limit_rows(part.physical, None), part.size * part.ease
    rotors = part.ease > 1
    distance, best = np.inf, u
    for _ in range(LINEARISED):
        W, w = _linear(part, u)
        space = _holding(part, K, rest, u, held)
        criterion = W / part.ease[:, None], w / part.ease
        chi = nearest_physical(space, part.physical, rows, start, criterion)
        before, u = u, _numbers(part, chi)
        if (far := float(np.linalg.norm((u - part.u0) / S))) < distance:
            distance, best = far, u
        if np.all(np.abs(u - before)[~rotors] <= STILL * part.size[~rotors]):
            best = u
            break
    best = _hold(part, best)
    other = _solve(part, K, rest, np.where(rotors, part.u0, best), rotors)
    return best if other is None or _violated(part, other) else other


def _held(part: Numbers, K: Array, rest: Array, u: Array, start: Array) -> tuple[Array, Array]:
    """Find which of the numbers that `_solve` keeps can keep their values in a physical robot.

    The candidates are masses that no torque determines, and numbers without effect. If no physical
    robot keeps all of them, sets of numbers of the links that violate conditions are released in
    this order, until a physical robot exists: masses; numbers without effect; both; finally all
    numbers of all links.

    Returns the numbers that stay, bool, shape (p,), and the standard parameters of such a robot.
    """
    conditions, rows = part.physical.conditions, limit_rows(part.physical, None)
    silent = ~part.seen(u) & ~part.masses
    kept = part.masses | silent
    space = _holding(part, K, rest, u, kept)
    first = margin(conditions, rows, space)
    names = {name for name, _ in blocked(conditions, rows, space, first)}
    in_way = np.zeros(len(u), dtype=bool)
    for c in conditions:
        in_way[list(c.numbers)] |= c.name in names
    for given_up in (~kept, part.masses & in_way, silent & in_way, in_way):
        held = kept & ~given_up
        found = margin(conditions, rows, _holding(part, K, rest, u, held))
        if found.solved and found.margin >= -LIMIT.MARGIN_ROUNDING:
            return held, found.chi
    return np.zeros(len(u), dtype=bool), start


def _holding(part: Numbers, K: Array, rest: Array, u: Array, held: Array) -> Space:
    """Return all chi with K chi = rest in which the numbers `held` have the values of the file.

    Centres and tensors, which are no linear functions of chi, are linearised at u.
    """
    W, w = (x[held] for x in _linear(part, u))
    names = tuple(map(str, np.flatnonzero(held)))
    space = solutions(K, rest, units(part.physical))
    return within(space, LinearBounds(names, W, w, w))[0]


def _linear(part: Numbers, u: Array) -> tuple[Array, Array]:
    """Linearise the deviation of the numbers u(chi) from those of the file, u0, at a given u:
    (u(chi) - u0) / size = W chi - w.

    A link without mass has no centre; it is linearised at a mass of typical size.
    """
    point = u.copy()
    for _, at in part.links:
        point[at[0]] = u[at[0]] if u[at[0]] > NEAR * part.size[at[0]] else part.size[at[0]]
    W = np.linalg.inv(part.slope(point) * part.size)
    return W, W @ part.chi(point) - (point - part.u0) / part.size


def _numbers(part: Numbers, chi: Array) -> Array:
    """Convert standard parameters to link and joint values."""
    u = chi.copy()
    for link, at in part.links:
        u[at] = link.place.numbers(chi[at])
    return u


def _hold(part: Numbers, u: Array) -> Array:
    """Reset link and joint values without effect to the values of the file.

    A value has no effect if no base parameter depends on it. If the values of the file violate a
    condition of a physical robot, the values in this condition stay.
    """
    u, held = u.copy(), np.where(part.seen(u), u, part.u0)
    for c in part.physical.conditions:
        at = list(c.numbers)
        u[at] = held[at] if c.smallest(part.chi(held)) >= 0 else u[at]
    return u


def strange(link: FileLink, closest: Nearest) -> str:
    """Describe how far mass and centre of mass of a link are from the file; "" if they are near.

    They are near if the mass is within a factor of 2 (`STRANGE`) and the centre has moved by no
    more than the size of the link.
    """
    before, after = (u[closest.links[link.name]] for u in (closest.u0, closest.u))
    m0, m, far = before[0], after[0], float(np.linalg.norm((after - before)[1:4]))
    extent = np.sqrt(max(link.ten[[0, 3, 5]].sum(), 0.0) / 2 / m0) if m0 else 0.0
    if m0 / STRANGE <= m <= STRANGE * m0 and far <= extent:
        return ""
    return f"link {link.name!a:.60} of {m:.3g} kg (file {m0:.3g}), its centre {far:.2g} m away"
