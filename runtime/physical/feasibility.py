"""Check whether a physical robot can have given base parameters, and find its standard parameters.

    feasibility(X)            t* = max t: every condition of `runtime.physical.inertia` holds with
                              margin t, and K chi = X. t* < 0: no robot has X
    nearest_standard(X)       chi with K chi = X that fulfils every condition, nearest to the values
                              of the robot file (or to zero)

If t* is negative, the condition with the largest multiplier is blamed and released, and the problem
is solved again, until the other conditions hold. Without limits on masses chi is not unique:
different chi of one X give the same torques.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np
from scipy.stats import chi2

from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import limits
from runtime.ground.settings import Positive, Real, Settings, Text
from runtime.physical.inertia import INERTIAL, Condition, PhysicalModel
from runtime.physical.semidefinite import (
    Distance,
    LinearBounds,
    Optimum,
    Prior,
    Space,
    closest,
    everything,
    margin,
    solutions,
)

LIMIT = limits(__package__)

Array = np.ndarray
Bounds = tuple[Real | None, Real | None]

TYPICAL = {
    "X": 0.1,
    "Y": 0.1,
    "Z": 0.1,
    "MX": 0.3,
    "MY": 0.3,
    "MZ": 0.3,
    "M": 3.0,
}  # kg m^2, kg m, kg; scales of the unknowns only


class Ellipsoid(Settings):
    """Ellipsoid that contains the mass of a link.

    Attributes
    ----------
    centre : tuple of 3 float, m
        Centre, in the link frame.
    axes : tuple of 3 float, m
        Semi-axes, along the axes of the link frame.
    """

    centre: tuple[Real, Real, Real]
    axes: tuple[Positive, Positive, Positive]


class RobotLimits(Settings):
    """Known limits of the standard parameters of a robot.

    Attributes
    ----------
    bounds : mapping of pairs of float or None, SI
        [lowest, highest] value of standard parameters, by name.
    total_mass : float or pair of float or None, kg
        Mass of all links together, a number or [lowest, highest].
    centre : mapping of 3 pairs of float, m
        Box that contains the centre of mass, by link, in the link frame: [lowest, highest] x, y and
        z.
    ellipsoid : mapping of Ellipsoid
        Ellipsoid that contains the mass, by link.
    """

    bounds: Mapping[Text, Bounds] = field(default_factory=dict)
    total_mass: Real | tuple[Real, Real] | None = None
    centre: Mapping[Text, tuple[tuple[Real, Real], tuple[Real, Real], tuple[Real, Real]]] = field(
        default_factory=dict
    )
    ellipsoid: Mapping[Text, Ellipsoid] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Feasibility:
    """Result of the check whether base parameters are those of a physical robot.

    Attributes
    ----------
    margin : float
        t*, as a share of the link's second moment and mass in the robot file; in SI for a link
        without values, and for friction and actuators.
    feasible : bool
        Whether t* >= 0, or whether the noise of the record explains t* < 0 (`within_noise`).
    physical : bool
        Whether some robot has these parameters, whatever the limits that were given or guessed.
    blocking : tuple of (str, float)
        Conditions (or limits) that prevent t* >= 0, in the order of their release, each with the t*
        before its release; empty if t* >= 0.
    chi : ndarray, shape (p,)
        Standard parameters at t*.
    """

    margin: float
    feasible: bool
    blocking: tuple[tuple[str, float], ...]
    chi: Array
    physical: bool = False

    @property
    def text(self) -> str:
        """Phrase that says whether the parameters are feasible, and which conditions prevent it."""
        if self.physical and not self.feasible:
            named = ", ".join(name for name, _ in self.blocking)
            return f"physically feasible, but not within the bounds of masses and centres: {named}"
        if self.feasible and self.blocking:
            named = ", ".join(name for name, _ in self.blocking)
            return f"physically feasible within the deviations of the record; at a bound: {named}"
        if self.feasible:
            least = "at least " if self.margin > 0.999 * LIMIT.LARGEST_MARGIN else ""
            return (
                "physically feasible: every condition holds with a margin of "
                f"{least}{self.margin:.3g}"
            )
        named = ", ".join(f"{name} (margin {t:.3g})" for name, t in self.blocking)
        return (
            "NOT physically feasible: no positive mass density and friction gives these "
            f"parameters; in the way: {named}"
        )


def feasibility(
    physical: PhysicalModel,
    names: Sequence[str],
    X: Array,
    limits: RobotLimits | None = None,
    *,
    blame: bool = True,
) -> Feasibility:
    """Check whether base parameters X are those of a physical robot within the limits.

    X has shape (len(names),). blame : find all conditions that X breaks, not only the first.
    """
    rows, space = limit_rows(physical, limits), solutions(physical.rows(names), X, units(physical))
    first = margin(physical.conditions, rows, space)
    if not first.solved:
        raise InputError(
            unsolved(first.status, rows, lambda other: margin(physical.conditions, other, space))
        )
    blocking = tuple(islice(blocked(physical.conditions, rows, space, first), None if blame else 1))
    return Feasibility(first.margin, not blocking, blocking, first.chi, not blocking)


def blocked(
    conditions: Sequence[Condition], rows: LinearBounds, space: Space, first: Optimum
) -> Iterator[tuple[str, float]]:
    """Yield the conditions that no chi in a space fulfils, each with the margin t* before its
    release.

    The condition with the largest multiplier is yielded, and is then released. first : the optimum
    of `margin` with all conditions.
    """
    conditions, optimum = list(conditions), first
    while optimum.solved and optimum.margin < -LIMIT.MARGIN_ROUNDING and conditions:
        worst = max(optimum.duals, key=lambda name: optimum.duals[name])
        yield worst, optimum.margin
        conditions = [c for c in conditions if c.name != worst]
        optimum = margin(conditions, rows, space)


def within_noise(
    judged: Feasibility, physical: PhysicalModel, names: Sequence[str], X: Array, covariance: Array
) -> Feasibility:
    """Accept parameters as feasible if noise explains their distance from a physical robot.

    With C the covariance of X, shape (b, b), and chi of a physical robot, the parameters pass if

        min ||X - K chi||^2_C^-1 <= the 99 % point of chi-square

    The degrees of freedom are the number of rows of all conditions that X breaks.
    """
    L = np.linalg.cholesky(covariance)
    R, z = np.linalg.solve(L, physical.rows(names)), np.linalg.solve(L, X)
    size = np.linalg.norm(z)
    nearest = closest(
        R / size,
        z / size,
        physical.conditions,
        limit_rows(physical, None),
        everything(units(physical)),
        least=LIMIT.MARGIN_ROUNDING,
    )
    broken = dict(judged.blocking)
    freedom = sum(c.B.shape[1] for c in physical.conditions if c.name in broken)
    far = float(np.sum((R @ nearest.chi - z) ** 2)) if nearest.solved else np.inf
    if far > chi2.ppf(LIMIT.NOISE_LEVEL, freedom):
        return judged
    return replace(judged, feasible=True, physical=True, margin=0.0, chi=nearest.chi)


def nearest_standard(
    physical: PhysicalModel,
    names: Sequence[str],
    X: Array,
    start: Array,
    limits: RobotLimits | None = None,
) -> Array:
    """Find the physical standard parameters chi with K chi = X, nearest to those of the robot file.

    start : a chi that fulfils the conditions of a physical robot; the result if the solver finds
    nothing better.
    """
    scale, rows = scales(physical), limit_rows(physical, limits)
    space = solutions(physical.rows(names), X, units(physical))
    chi0 = np.array([physical.values.get(name, 0.0) for name in physical.standard])
    criterion = np.diag(1 / scale), chi0 / scale
    return nearest_physical(space, physical, rows, start, criterion)


def nearest_physical(
    space: Space,
    physical: PhysicalModel,
    rows: LinearBounds,
    start: Array,
    criterion: tuple[Array, Array],
) -> Array:
    """Find the physical standard parameters chi in a space and within rows, with least ||R chi - z||.

    criterion : R, shape (m, p), and z, shape (m,). start : as in `nearest_standard`.
    """
    reach = np.abs(space.basis).max(axis=1, initial=0.0) / units(physical)
    open_ = tuple(
        c for c in physical.conditions if reach[list(c.numbers)].max() > LIMIT.MARGIN_ROUNDING
    )
    if len(open_) < len(
        physical.conditions
    ):  # X alone decides the others, such as a friction of zero
        inner = margin(open_, rows, space)
        start = inner.chi if inner.solved else start
    least = float(
        np.clip(
            min((c.smallest(start) for c in open_), default=LIMIT.LEAST_EIGENVALUE) / 2,
            LIMIT.LEAST_EIGENVALUE**2,
            LIMIT.LEAST_EIGENVALUE,
        )
    )
    nearest = closest(*criterion, open_, rows, space, least=least)
    kept = nearest.solved and all(c.smallest(nearest.chi) >= 0 for c in open_)
    return nearest.chi if kept else start


def limit_rows(physical: PhysicalModel, limits: RobotLimits | None) -> LinearBounds:
    """Write the limits of standard parameters as linear inequalities lower <= A chi <= upper."""
    limits = limits or RobotLimits()
    entries: list[tuple[str, dict[int, float], float, float]] = []
    for name, (low, high) in limits.bounds.items():
        if name not in physical.standard:
            message = f"no standard parameter {name}; there are {', '.join(physical.standard)}"
            raise SettingsError(message, path=("estimate", "options", "bounds", name))
        bounds = (-np.inf if low is None else low, np.inf if high is None else high)
        entries.append((f"bounds of {name}", {physical.standard.index(name): 1.0}, *bounds))
    if limits.total_mass is not None:
        low, high = np.broadcast_to(limits.total_mass, 2).tolist()
        entries.append(
            ("total_mass", {physical.link(j)[-1]: 1.0 for j in physical.links}, low, high)
        )
    for key, box in limits.centre.items():
        ten = physical.link(_link(physical, key, "centre"))
        for axis, (low, high) in enumerate(box):
            moment, mass = ten[6 + axis], ten[9]
            sides = {moment: 1.0, mass: -low}, {moment: -1.0, mass: high}
            entries += [(f"centre of link {key}", side, 0.0, np.inf) for side in sides]
    for key, ellipsoid in limits.ellipsoid.items():
        j = _link(physical, key, "ellipsoid")
        condition = next(c for c in physical.conditions if c.name == f"link {j}")
        weights = np.einsum("kij,ij->k", condition.B, _inside(ellipsoid))
        entries.append(
            (
                f"ellipsoid of link {key}",
                dict(zip(condition.numbers, weights.tolist(), strict=True)),
                0.0,
                np.inf,
            )
        )
    A = np.zeros((len(entries), len(physical.standard)))
    for row, (_, weights_of, _, _) in enumerate(entries):
        A[row, list(weights_of)] = list(weights_of.values())
    lower, upper = (np.array([entry[k] for entry in entries], dtype=float) for k in (2, 3))
    return LinearBounds(tuple(entry[0] for entry in entries), A, lower, upper)


def scales(physical: PhysicalModel) -> Array:
    """Return a typical size of each standard parameter, shape (p,), in SI units.

    The sizes are the absolute values of the robot file, but at least a hundredth of a typical size.
    If the file has no values, typical sizes are used.
    """
    sizes = []
    for name in physical.standard:
        family = name.rstrip("0123456789")
        typical = TYPICAL.get(family, 0.1 if family in INERTIAL else 1.0)
        value = abs(physical.values.get(name, 0.0))
        sizes.append(max(value, 1e-2 * typical) if physical.values else typical)
    return np.array(sizes)


def units(physical: PhysicalModel) -> Array:
    """Return the scales, shape (p,), by which the solver divides the unknown standard parameters.

    For a link with values in the robot file, the scales follow from the size of its condition
    (second moment and mass); all other scales are those of `scales`.
    """
    sizes = scales(physical)
    for j, condition in zip(physical.links, physical.conditions, strict=False):
        second, mass = condition.size[0], condition.size[-1]
        if all(f"{family}{j}" in physical.values for family in INERTIAL):
            sizes[physical.link(j)] = [second] * 6 + [np.sqrt(second * mass)] * 3 + [mass]
    return sizes


def pull_to_file(physical: PhysicalModel, kind: Distance, weight: float) -> Prior | None:
    """Make the penalty (prior) that pulls inertial parameters towards the robot file values.

    Return None if there is no prior or its weight is 0. Raise SettingsError if the file has no
    values of links.
    """
    if kind == "none" or weight == 0:
        return None
    numbers = known_inertia(physical)
    if not numbers:
        raise SettingsError(
            "the robot file has no inertial values of links; give these values, or use prior: none",
            path=("estimate", "options", "prior"),
        )
    chi0 = np.array([physical.values.get(name, 0.0) for name in physical.standard])
    return Prior(chi0, scales(physical), numbers, weight)


def known_inertia(physical: PhysicalModel) -> tuple[int, ...]:
    """Return the indices of the link inertial parameters that have values in the robot file."""
    return tuple(
        k
        for j in physical.links
        for k in physical.link(j)
        if physical.standard[k] in physical.values
    )


def unsolved(status: str, rows: LinearBounds, attempt: Callable[[LinearBounds], Optimum]) -> str:
    """Write why no physical robot was found: the likely cause, and what to try.

    attempt : function that solves the same problem with other limits. Each limit is left out in
    turn, to find out which limit prevents a solution.
    """
    helps = [name for name in dict.fromkeys(rows.names) if attempt(rows.without(name)).solved]
    if helps:
        return (
            "no physical robot is within the limits, but a solution exists without "
            f"{' or without '.join(helps)}: widen or remove this limit"
        )
    if status.startswith("infeasible") and rows.names:
        named = ", ".join(dict.fromkeys(rows.names))
        return (
            f"no physical robot is within the limits ({named}); several of these limits contradict "
            "the others: remove the limits one by one"
        )
    return (
        f"the semidefinite program was not solved ({status}); try another margin, a prior, or "
        "bounds on the masses"
    )


def _inside(e: Ellipsoid) -> Array:
    """Return the matrix Q of an ellipsoid: tr(P Q) >= 0 if a link of pseudo-inertia P is inside.

    With homogeneous coordinates on the left, x'Qx = 1 - (x - c)' A^-1 (x - c), A = diag(axes^2).
    """
    A, c = np.diag(1 / np.square(e.axes)), np.array([e.centre]).T
    return np.block([[-A, A @ c], [c.T @ A, 1 - c.T @ A @ c]])


def _link(physical: PhysicalModel, key: str, setting: str) -> int:
    if key not in map(str, physical.links):
        message = f"no link {key!r}; links are {', '.join(map(str, physical.links))}"
        raise SettingsError(message, path=("estimate", "options", setting, key))
    return int(key)
