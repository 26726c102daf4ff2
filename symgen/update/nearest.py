"""Parameters of the links of a file that give the identified base parameters, as near to the file's
as physics allows.

    min ||S^-1 (chi - chi0)||     subject to  K chi = X,  every condition of `runtime.model.inertia`

chi are ten parameters for each link of the file that has inertia, in the frame of the body it
belongs to, and those of the elements on the joints;
chi0 are the values of the file, S their sizes. A body may be several links, held together by fixed
joints: the record knows their sum. First the link that the joint carries changes alone; only where
no physical link is left, the others change with it. What the torques cannot tell from a motor
inertia is one, whether the format has a place for it or not; other elements that the file does not
have change only where links cannot take them in. Without conditions chi = chi0 + G (X - K chi0);
the semidefinite program is solved where that is no physical robot.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.estimators.feasibility import feasibility, limit_rows, scales
from runtime.estimators.semidefinite import closest, solutions
from runtime.limits import LIMIT
from runtime.model.inertia import INERTIAL, PhysicalModel
from symgen.description.tree import Array
from symgen.errors import DescriptionError

NONE = "no physical robot of this file has the estimate"
MISSED = 1e-9  # of the size of a base parameter: more is not reached
ACCURACY = 1e-7  # of the size of a parameter, of the semidefinite program
UNMOVED = 1e-12  # of the size of a parameter
IN_PROGRAM = 1e2  # size of a motor inertia beside that of the file, in the program
NEAR = 1e-6  # of the size of a parameter: nearer to the file is rounding
STRANGE = 2.0  # mass over that of the file
TINY = 1e-15  # SI; an eigenvalue so little below zero is rounding


@dataclass(frozen=True, eq=False)
class FileLink:
    """A link of the file with inertia.

    Attributes
    ----------
    name : str
        Of the file.
    j : int
        Body it belongs to.
    ten : ndarray, shape (10,)
        XX .. ZZ, MX, MY, MZ, M of the file in frame j.
    """

    name: str
    j: int
    ten: Array


@dataclass(frozen=True, eq=False)
class Nearest:
    """Parameters chi, shape (p,), of the links of a file and of the elements on its joints.

    Attributes
    ----------
    chi, chi0 : ndarray, shape (p,)
        Found, and of the file.
    gain : ndarray, shape (p, b)
        d chi / d X without conditions.
    free : ndarray, shape (p, p)
        Projection on what X leaves open.
    links : mapping of list of int
        Places of the ten parameters of each link.
    elements : mapping of int
        Place of each parameter of an element.
    spread : tuple of str
        Links behind fixed joints that had to change too.
    """

    chi: Array
    chi0: Array
    gain: Array
    free: Array
    links: Mapping[str, list[int]]
    elements: Mapping[str, int]
    spread: tuple[str, ...]


def nearest(
    physical: PhysicalModel,
    links: Sequence[FileLink],
    values: Mapping[str, float],
    names: Sequence[str],
    X: Array,
    absent: Collection[str] = (),
) -> Nearest:
    """The parameters of `links`, and of the elements, nearest to those of the file.

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
        Elements that the file does not have; they change only where the links cannot.

    Raises
    ------
    DescriptionError
        A base parameter that no link of the file can give, or no physical robot.
    """
    whole, places, elements, counts = _of_file(physical, links, values, absent)
    K, chi0 = whole.rows(names), np.array([whole.values[name] for name in whole.standard])
    for count in counts:
        part = _head(whole, count)
        rest = X - K[:, count:] @ chi0[count:]
        chi, answer = _within(part, names, rest, X)
        if chi is not None:
            break
    else:
        raise DescriptionError(f"{NONE}: {answer.replace('NOT physically feasible: ', '')}")
    K_part = K[:, :count]
    G = _gain(K_part, scales(part), _rotors(part))
    solution, gain, free = (
        chi0.copy(),
        np.zeros((len(chi0), len(X))),
        np.zeros((len(chi0), len(chi0))),
    )
    solution[:count], gain[:count], free[:count, :count] = chi, G, np.eye(count) - G @ K_part
    moved = [
        name
        for name, at in places.items()
        if at[0] >= counts[-2] and not _unmoved(solution, chi0, whole, at)
    ]
    return Nearest(solution, chi0, gain, free, places, elements, tuple(moved))


def _of_file(
    physical: PhysicalModel,
    links: Sequence[FileLink],
    values: Mapping[str, float],
    absent: Collection[str],
) -> tuple[PhysicalModel, dict[str, list[int]], dict[str, int], list[int]]:
    """The model with ten parameters by link of the file, their places, those of elements, and how
    many parameters may change, try by try.

    First links that lead a body, and elements; then elements that the file does not have and the
    links can take in; then the other links.
    """
    leading = {link.j: link for link in reversed(links)}
    inertial = {f"{family}{j}": (j, k) for j in physical.links for k, family in enumerate(INERTIAL)}
    own = [
        name for name in physical.standard if name not in inertial or inertial[name][0] in leading
    ]
    spare = _spare(physical, own, [name for name in absent if name in own])
    own = [*(name for name in own if name not in spare), *spare]
    counts = [len(own) - len(spare), len(own)]
    of = {
        name: float(leading[inertial[name][0]].ten[inertial[name][1]])
        if name in inertial
        else values.get(name, 0.0)
        for name in own
    }
    columns = [physical.standard.index(name) for name in own]
    standard, conditions = list(own), []
    elements = {name: k for k, name in enumerate(own) if name not in inertial}
    places: dict[str, list[int]] = {}
    for condition in physical.conditions:
        named = [physical.standard[k] for k in condition.numbers]
        if all(name in own for name in named):
            j = inertial[named[0]][0] if named[0] in inertial else 0
            numbers = tuple(own.index(name) for name in named)
            conditions.append(
                replace(
                    condition,
                    name=f"link {leading[j].name!a:.60}" if j else condition.name,
                    numbers=numbers,
                    size=np.ones(len(condition.size)),
                )
            )
            if j:
                places[leading[j].name] = list(numbers)
    for v, link in enumerate(
        (link for link in links if link is not leading[link.j]),
        start=max(physical.links, default=0) + 1,
    ):
        at = list(range(len(standard), len(standard) + 10))
        standard += [f"{family}{v}" for family in INERTIAL]
        of |= dict(zip(standard[-10:], map(float, link.ten), strict=True))
        columns += [physical.standard.index(f"{family}{link.j}") for family in INERTIAL]
        condition = next(c for c in physical.conditions if c.name == f"link {link.j}")
        name = f"link {link.name!a:.60}"
        conditions.append(replace(condition, name=name, numbers=tuple(at), size=np.ones(4)))
        places[link.name] = at
    whole = replace(
        physical,
        standard=tuple(standard),
        K=physical.K[:, columns],
        conditions=tuple(conditions),
        values=of,
    )
    return whole, places, elements, [*counts, len(standard)]


def _spare(physical: PhysicalModel, own: Sequence[str], absent: Sequence[str]) -> list[str]:
    """Absent parameters that the own ones can stand in for."""
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


def _head(whole: PhysicalModel, count: int) -> PhysicalModel:
    """The model with its first `count` parameters alone."""
    conditions = tuple(c for c in whole.conditions if max(c.numbers) < count)
    return replace(
        whole, standard=whole.standard[:count], K=whole.K[:, :count], conditions=conditions
    )


def _within(
    part: PhysicalModel, names: Sequence[str], rest: Array, X: Array
) -> tuple[Array | None, str]:
    """chi of the parameters of `part` with K chi = rest; None, and why, where no physical robot has
    them.
    """
    K, S, chi0, rotors = (
        part.rows(names),
        scales(part),
        np.array([part.values[name] for name in part.standard]),
        _rotors(part),
    )
    chi = chi0 + _gain(K, S, rotors) @ (rest - K @ chi0)
    sizes = np.maximum(np.abs(X), np.abs(K) @ S)
    missed = np.abs(K @ chi - rest) > MISSED * np.maximum(sizes, MISSED)
    if missed.any():
        lost = ", ".join(
            f"{name} = {x:.4g}" for name, x, out in zip(names, X, missed, strict=True) if out
        )
        raise DescriptionError(
            f"the links of this file cannot have {lost}: a body without inertial has no place for "
            "it; add an inertial to the link that moves"
        )
    moved = [c for c in part.conditions if not _unmoved(chi, chi0, part, list(c.numbers))]
    if all(c.smallest(chi) >= -TINY for c in moved):
        clean = _as_it_was(K, S, rest, chi, chi0, NEAR * S, rotors)
        if np.abs(K @ clean - rest).max() <= MISSED * sizes.max() and min(
            part.smallest(clean).values()
        ) >= min(0.0, *part.smallest(chi).values()):
            chi = clean
        return chi, ""
    free = np.abs(np.eye(len(chi)) - _gain(K, S, rotors) @ K) @ S / S
    still = [
        c for c in part.conditions if free[list(c.numbers)].max() < MISSED
    ]  # X tells all of it
    if broken := [c.name for c in still if c in moved and c.smallest(chi) < -LIMIT.MARGIN_ROUNDING]:
        return (
            None,
            (
                "no positive mass density and friction gives these parameters; in the way: "
                f"{', '.join(broken)}"
            ),
        )
    part = replace(part, conditions=tuple(c for c in part.conditions if c not in still))
    answer = feasibility(part, names, rest)
    if not answer.feasible:
        return None, answer.text
    return _solved(part, K, np.where(rotors, IN_PROGRAM, 1.0) * S, rest, answer.chi), ""


def _solved(part: PhysicalModel, K: Array, S: Array, rest: Array, start: Array) -> Array:
    """The nearest chi with K chi = rest that fulfils every condition, `start` one that does."""
    chi0 = np.array([part.values[name] for name in part.standard])
    own = [
        x for c in part.conditions if (x := c.smallest(chi0)) > 0
    ]  # small links have small eigenvalues
    least = max(
        min(
            [LIMIT.LEAST_EIGENVALUE, min(part.smallest(start).values()) / 2, *(x / 2 for x in own)]
        ),
        LIMIT.LEAST_EIGENVALUE**2,
    )
    optimum = closest(
        np.diag(1 / S),
        chi0 / S,
        part.conditions,
        limit_rows(part, None),
        solutions(K, rest, S),
        least=least,
    )
    near = ACCURACY * S
    near[[c.numbers[0] for c in part.conditions if len(c.numbers) == 1]] += 2 * least
    for chi in (
        (_as_it_was(K, S, rest, optimum.chi, chi0, near, _rotors(part)), optimum.chi)
        if optimum.solved
        else ()
    ):
        if min(part.smallest(chi).values()) >= 0:
            return chi
    return start


def _as_it_was(
    K: Array, S: Array, rest: Array, chi: Array, chi0: Array, near: Array, rotors: Array
) -> Array:
    """chi with the parameters that differ from those of the file by `near`, the accuracy of the
    solver, set to these.
    """
    moved = np.abs(chi - chi0) > near
    chi = np.where(moved, chi, chi0)
    chi[moved] += _gain(K[:, moved], S[moved], rotors[moved]) @ (rest - K @ chi)
    return chi


def strange(link: FileLink, closest: Nearest) -> str:
    """What of a link is no longer that of the file, a sentence; "" where its mass is within STRANGE
    times that and its centre has moved by less than the link extends.
    """
    (before, m0), (after, m) = (
        (ten[6:9] / ten[9] if ten[9] else ten[6:9], ten[9])
        for ten in (link.ten, closest.chi[closest.links[link.name]])
    )
    far = float(np.linalg.norm(after - before))
    extent = np.sqrt(max(link.ten[[0, 3, 5]].sum(), 0.0) / 2 / m0) if m0 else 0.0
    if m0 / STRANGE <= m <= STRANGE * m0 and far <= extent:
        return ""
    return f"link {link.name!a:.60} of {m:.3g} kg (file {m0:.3g}), its centre {far:.2g} m away"


def _rotors(part: PhysicalModel) -> Array:
    """Whether each parameter is a motor inertia, bool (p,)."""
    return np.array([name.startswith("Ia") for name in part.standard])


def _gain(K: Array, S: Array, rotors: Array) -> Array:
    """G, shape (p, b): d chi = G d X, first of motor inertias, bool (p,), what they can give, then
    the smallest change of the others in sizes S: with Q the projection on what motor inertias
    cannot give, G_l = S_l (Q K_l S_l)^+ Q, G_m = S_m (K_m S_m)^+ (1 - K_l G_l).
    """
    G, one = np.zeros(K.T.shape), np.eye(len(K))
    of_rotors = _smallest(K[:, rotors], S[rotors])
    Q = one - K[:, rotors] @ of_rotors
    G[~rotors] = _smallest(Q @ K[:, ~rotors], S[~rotors]) @ Q
    G[rotors] = of_rotors @ (one - K[:, ~rotors] @ G[~rotors])
    return G


def _smallest(K: Array, S: Array) -> Array:
    """S (K S)^+: the smallest change in sizes S for a change of K chi."""
    return np.asarray(S[:, None] * np.linalg.pinv(K * S, rcond=1e-12))


def _unmoved(chi: Array, chi0: Array, part: PhysicalModel, at: Sequence[int]) -> bool:
    S = scales(part)
    return bool(np.all(np.abs(chi - chi0)[at] <= UNMOVED * S[: len(chi)][at]))
