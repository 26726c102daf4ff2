"""Conditions on the standard parameters of a physical robot.

Every link has a mass density, actuators have inertia, and friction dissipates power.

Base parameters are X = K chi, with chi the standard parameters. For link j, with J the inertia
tensor about the origin of its frame (the elements XX .. ZZ as they are) and l = (MX, MY, MZ), the
pseudo-inertia

    P_j = [[tr(J)/2 1 - J, l], [l', M]],   4 x 4,

is the matrix of second moments of the density in homogeneous coordinates: a density exists if and
only if P_j is positive semidefinite. This condition contains the triangle inequalities of the
moments of inertia. Every element along s = G q (inertia, viscous, Coulomb) needs c >= 0. Elements
given as forms q'Bq act together with the elements along the same joints: the sum of c_k B_k of one
kind is positive semidefinite (the inertia of a coupled wrist, the power that its viscous friction
dissipates). Friction of one direction of motion counts in that direction and does not enter the
forms. Offsets and springs may have any sign.

References: Wensing, Kim and Slotine (2018) for P_j; Sousa and Cortesao (2014, 2019) for
identification under such constraints.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from runtime.core.model import SIGNED, GeneratedModel, elements_of, is_form, joint_units, require
from runtime.ground.errors import InputError, ModelError
from runtime.ground.limits import limits

LIMIT = limits(__package__)

Array = np.ndarray

INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
FORMED = ("inertia", "viscous")  # kinds whose forms must be positive semidefinite


@dataclass(frozen=True, eq=False)
class Condition:
    """One physical condition: a matrix P, linear in standard parameters, is positive semidefinite.

    P = sum_k chi[numbers[k]] B[k], with chi the standard parameters.

    Attributes
    ----------
    name : str
        Link, form or element that the condition is about.
    numbers : tuple of int
        Indices of its standard parameters in chi.
    B : ndarray, shape (k, m, m)
        One symmetric matrix for each of these parameters.
    size : ndarray, shape (m,), SI
        Scale of the eigenvalues: second moment and mass of the link in the robot file; for inertias
        of drives 1000 times the least of these second moments, at most 1; 1 without values, and for
        friction.
    """

    name: str
    numbers: tuple[int, ...]
    B: Array
    size: Array

    @property
    def scaled(self) -> Array:
        """Matrices B[k] divided by the scale S of the condition: S^-1/2 B[k] S^-1/2, (k, m, m)."""
        root = np.sqrt(self.size)
        return np.asarray(self.B / np.outer(root, root))

    def matrix(self, chi: Array) -> Array:
        """Compute the matrix P of the condition, shape (m, m), from standard parameters chi."""
        return np.asarray(np.tensordot(chi[list(self.numbers)], self.B, axes=1))

    def smallest(self, chi: Array) -> float:
        """Compute the smallest eigenvalue of the matrix P of the condition, relative to its scale.

        S = diag(size). The result is the largest t for which P - t S is positive semidefinite.
        """
        P = np.tensordot(chi[list(self.numbers)], self.scaled, axes=1)
        return float(np.linalg.eigvalsh(P)[0])


@dataclass(frozen=True, eq=False)
class PhysicalModel:
    """Standard parameters chi of a robot model, their physical conditions, and K in X = K chi.

    Attributes
    ----------
    standard, base : tuple of str
        Names of the p standard and the b base parameters.
    K : ndarray, shape (b, p)
        X = K chi.
    links : tuple of int
        Links that have inertia.
    conditions : tuple of Condition
        One per link, then one per form, then one per signed element.
    values : mapping
        Values of the robot file, by name.
    """

    standard: tuple[str, ...]
    base: tuple[str, ...]
    K: Array
    links: tuple[int, ...]
    conditions: tuple[Condition, ...]
    values: Mapping[str, float]

    def link(self, j: int) -> list[int]:
        """Return the indices in chi of the ten inertial parameters of link j.

        The order is XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M.
        """
        if j not in self.links:
            raise InputError(
                f"link {j} has no inertial parameters; links with them are "
                f"{', '.join(map(str, self.links))}"
            )
        return [self.standard.index(f"{family}{j}") for family in INERTIAL]

    def named(self, chi: Array) -> dict[str, float]:
        """Return the standard parameters chi as a mapping from name to value."""
        return {name: float(value) for name, value in zip(self.standard, chi, strict=True)}

    def smallest(self, chi: Array) -> dict[str, float]:
        """Compute the smallest eigenvalue of each physical condition, by name.

        Each eigenvalue is relative to the scale of its condition. For a physical robot, no
        eigenvalue is negative.
        """
        return {condition.name: condition.smallest(chi) for condition in self.conditions}

    def rows(self, names: Sequence[str]) -> Array:
        """Return the rows of K (X = K chi) that belong to the base parameters `names`."""
        return self.K[[self.base.index(name) for name in names]]


def physical_model(
    model: GeneratedModel, constants: Mapping[str, float] | None = None
) -> PhysicalModel:
    """Collect the standard parameters of a generated model and the physical conditions on them.

    Parameters
    ----------
    model : GeneratedModel
    constants : mapping, optional
        Values that replace constants of the robot file, as for `base_parameters`.

    Raises
    ------
    ModelError
        The model was generated by an older version, without these tables.
    """
    require(model, "base_parameters")
    elements = elements_of(model, constants)
    if missing := [name for name in ("STANDARD_PARAMETERS", "LINKS") if not hasattr(model, name)]:
        raise ModelError(
            f"the module has no {', '.join(missing)}; generate the module again with this "
            "version of symgen",
            file=model.NAME,
        )
    emitted = cast(Any, model)
    standard: tuple[str, ...] = tuple(emitted.STANDARD_PARAMETERS)
    links = [*_links(emitted.LINKS, standard, model.VALUES)]
    least = min([1.0, *(1e3 * float(link.size[0]) for link in links)])
    return PhysicalModel(
        standard=standard,
        base=tuple(model.BASE_PARAMETERS),
        K=np.asarray(
            emitted.base_parameters(np.eye(len(standard)), **(constants or {})), dtype=float
        ),
        links=tuple(emitted.LINKS),
        conditions=(*links, *_forms(elements, standard, least), *_signs(elements, standard, least)),
        values=dict(model.VALUES),
    )


def pseudo_inertia(ten: Array) -> Array:
    """Build the pseudo-inertia P_j, shape (4, 4), from the ten inertial parameters of a link.

    The parameters are XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M, about the origin of the link frame.
    """
    XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = ten
    J = np.array([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]])
    l = np.array([[MX, MY, MZ]])
    return np.block([[np.trace(J) / 2 * np.eye(3) - J, l.T], [l, np.array([[M]])]])


def _links(
    links: Sequence[int], standard: Sequence[str], values: Mapping[str, float]
) -> Iterator[Condition]:
    B = np.array([pseudo_inertia(ten) for ten in np.eye(10)])
    for j in links:
        names = [f"{family}{j}" for family in INERTIAL]
        diagonal = np.diag(pseudo_inertia(np.array([values.get(name, 0.0) for name in names])))
        second, mass = float(diagonal[:3].sum()), float(diagonal[3])
        size = np.array([second, second, second, mass]) if min(second, mass) > 0 else np.ones(4)
        yield Condition(f"link {j}", tuple(standard.index(name) for name in names), B, size)


def _forms(
    elements: Mapping[str, Any], standard: Sequence[str], least: float
) -> Iterator[Condition]:
    """Yield the conditions on inertia and viscous friction of coupled joints.

    There is one condition per kind and per group of coupled joints: the sum of the matrices c_k B_k
    over the elements of the group is positive semidefinite.
    """
    for kind in FORMED:
        own = {
            name: _form(acts)
            for name, (k, when, acts) in elements.items()
            if k == kind and when == "both"
        }
        for joints in _coupled(
            [{i for pair in own[name] for i in pair} for name in own if is_form(elements[name][2])]
        ):
            place = {j: k for k, j in enumerate(sorted(joints))}
            members = [name for name in own if {i for pair in own[name] for i in pair} <= joints]
            B = np.zeros((len(members), len(place), len(place)))
            for k, name in enumerate(members):
                for (i, m), b in own[name].items():
                    B[k, place[i], place[m]] = B[k, place[m], place[i]] = b
            names = ", ".join(map(str, sorted(joints)))
            numbers = tuple(standard.index(name) for name in members)
            size = least if kind == "inertia" else 1.0
            yield Condition(f"{kind} of joints {names}", numbers, B, np.full(len(place), size))


def _signs(
    elements: Mapping[str, Any], standard: Sequence[str], least: float
) -> Iterator[Condition]:
    """Yield the conditions that motor inertias and friction coefficients are not negative.

    There is one condition c >= 0 for each such element along one direction G. If friction of one
    direction of motion adds to friction of both, their sum must be >= 0 in each direction of
    motion.
    """
    along: dict[tuple[Any, ...], dict[str, list[str]]] = {}
    for name, (kind, when, acts) in elements.items():
        if kind in SIGNED and not is_form(acts):
            along.setdefault((kind, *sorted(acts.items())), {}).setdefault(when, []).append(name)
    for row, own in along.items():
        both, sided = own.get("both", []), [own.get(when, []) for when in ("positive", "negative")]
        for names in [[*both, *one] for one in sided] if any(sided) else [[name] for name in both]:
            if names:
                yield Condition(
                    " + ".join(names),
                    tuple(standard.index(name) for name in names),
                    np.ones((len(names), 1, 1)),
                    np.array([least if row[0] == "inertia" else 1.0]),
                )


def _form(acts: Mapping[Any, float]) -> dict[tuple[int, int], float]:
    """Return the quadratic form q'Bq of an inertia or friction element as {(i, j): B_ij}, i <= j.

    For an element along s = G q the form is (G q)**2.
    """
    if is_form(acts):
        return dict(acts)
    return {(i, j): a * b for i, a in acts.items() for j, b in acts.items() if i <= j}


def _coupled(groups: Sequence[set[int]]) -> list[set[int]]:
    """Unite sets of joints that share a joint, so that the resulting sets are disjoint."""
    united: list[set[int]] = []
    for group in groups:
        touching = [other for other in united if other & group]
        united = [other for other in united if not other & group] + [group.union(*touching)]
    return united


def frame_origins(model: GeneratedModel, q: Array) -> Array | None:
    """Compute the origins of all frames in frame 0, m, at the joint positions q, shape (K, n).

    The result has shape (K, frames, 3). The result is None if the model has no frame poses, or if a
    kinematic loop does not close.
    """
    poses = getattr(model, "frame_poses", None)
    try:
        with np.errstate(all="ignore"):
            return None if poses is None else np.asarray(poses(q))[:, :, :3, 3]
    except ValueError:
        return None


def reach_of(model: GeneratedModel) -> float:
    """Estimate the size of a robot, m: largest distance between two frames, plus the longest link.

    Random poses are tried. The longest link is added because no frame marks the end of the last
    link. Joints move within their limits; without limits, revolute joints turn anywhere. The result
    is nan if the frames do not show the size: there is a prismatic joint without limits, or fewer
    than two links have a length.
    """
    limits = dict(getattr(model, "LIMITS", None) or {}).get("q")
    units = joint_units(model)
    if limits is None and "m" in units:
        return float("nan")
    spans = (
        np.array([(-np.pi, np.pi)] * len(units))
        if limits is None
        else np.array([(-x, x) if np.ndim(x) == 0 else x for x in limits], dtype=float)
    )
    rng = np.random.default_rng(0)
    q = rng.uniform(spans[:, 0], spans[:, 1], (LIMIT.REACH_POSES, len(spans)))
    origins = frame_origins(model, q)
    if origins is None or origins.shape[1] < 2:
        return float("nan")
    links = np.linalg.norm(np.diff(origins, axis=1), axis=2)
    spread = np.linalg.norm(origins[:, :, None] - origins[:, None], axis=3)
    several = (links.max(axis=0) > 0.1 * links.max()).sum() > 1
    return float(spread.max() + links.max()) if several else float("nan")
