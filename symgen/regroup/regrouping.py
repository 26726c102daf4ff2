"""Derive the base parameters of a robot with exact regrouping formulas.

General rules, exact for any geometry, first remove most columns of the regressor. Rank and base
parameters then follow from the echelon form over the finite field F_p, with the columns in Khalil's
order of preference. The few dependent columns that remain are expressed by relations of this robot
alone, solved exactly. A certificate checks the result.

The coefficients stay expressions until they are written: as text by this module, in Python by
`emit.printers`, and by the printers of SymPy in `symbols`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from symgen.derive.constants import numbered
from symgen.derive.exact import Draw
from symgen.derive.loops import close
from symgen.derive.regressor import element_names, inertial_names, is_opaque
from symgen.description.angles import InertiaWarning
from symgen.description.bodies import impossible_links
from symgen.description.element import OWN_LAWS
from symgen.description.expression import ONE, ZERO, Expression, simplified, with_known_cosines
from symgen.description.files import robot_of
from symgen.description.robot import INERTIAL, PRISMATIC, Robot, parameter
from symgen.errors import require
from symgen.regroup.finite_field import rref
from symgen.regroup.floats import float_relations, numeric_coefficients
from symgen.regroup.rules import Combination, Step, Transfer
from symgen.regroup.solve import coefficients
from symgen.regroup.states import draw_states, sample, states_for
from symgen.time_limit import limited

Signed = tuple[bool, str]  # whether a term is added, and the term


class Formula(NamedTuple):
    """A sum of parameters with coefficients, sum_k c_k chi_k.

    Attributes
    ----------
    combination : mapping
        Coefficient c_k, a constant expression, of each parameter chi_k, in the order of the text.
    """

    combination: Mapping[str, Expression]

    def __str__(self) -> str:
        return self.text(str)

    def text(self, coefficient: Callable[[Expression], str]) -> str:
        """Write the formula as text; parameters with the same coefficient share it: D3*(MX4 + MY5).

        `coefficient` writes a coefficient. Parameters with coefficient 1 or -1 are written one by
        one.
        """
        terms: list[Signed] = []
        for c, members in self.groups():
            if c in (ONE, -ONE):
                terms += [((c == ONE) == added, name) for added, name in members]
                continue
            added = len(c.terms) > 1 or min(c.terms.values()) > 0
            factor = coefficient(c if added else -c)
            if len(c.terms) > 1:
                factor = f"({factor})"
            inside = _sum(members)
            terms.append(
                (added, f"{factor}*({inside})" if len(members) > 1 else f"{factor}*{inside}")
            )
        return _sum(terms)

    def groups(self) -> list[tuple[Expression, list[Signed]]]:
        """Group the parameters of the formula by equal coefficients.

        Return each coefficient with its parameters, as in eq. (27). Parameters with the opposite
        coefficient are in the same group, marked as subtracted.
        """
        groups: dict[Expression, list[Signed]] = {}
        for name, c in self.combination.items():
            key = -c if -c in groups and c not in groups else c
            groups.setdefault(key, []).append((key == c, name))
        return list(groups.items())

    def mapping(self) -> dict[str, Any]:
        """Return the formula for JSON: its text, and the coefficient of each parameter."""
        return {
            "formula": str(self),
            "terms": [
                {"parameter": name, "coefficient": str(c)} for name, c in self.combination.items()
            ],
        }


def _sum(terms: Sequence[Signed]) -> str:
    (added, first), *rest = terms
    return (
        ("" if added else "-")
        + first
        + "".join(f" {'+' if added else '-'} {term}" for added, term in rest)
    )


FIRST_CHOICE = ("ZZ", "XX", "XY", "XZ", "YZ", "MX", "MY")
EXACT = "exact, proved modulo primes"
NUMERIC = "numeric, for the constants of the robot file and no others"
LAST_CHOICE = ("MZ", "M", "YY")


@dataclass(frozen=True)
class BaseParameter:
    """One base parameter X = own + sum_k coefficient_k chi_k: a standard parameter `own` plus a
    combination of other standard parameters.

    Attributes
    ----------
    name : str
        Name of the standard parameter `own`, with R at the end if the sum has further terms.
    own : str
        Standard parameter that gives the base parameter its name; its coefficient is 1.
    combination : mapping
        Coefficient of each standard parameter, `own` first.
    """

    name: str
    own: str
    combination: Mapping[str, Expression]

    @property
    def formula(self) -> Formula:
        return Formula(self.combination)


@dataclass(frozen=True)
class Regrouping:
    """The base parameters of a robot with their formulas, and how these were derived.

    Attributes
    ----------
    robot : Robot
        The robot.
    base : tuple of BaseParameter
        Base parameters in the order of eq. (4).
    no_effect : tuple of str
        Standard parameters that enter no base parameter.
    steps : tuple of (from, into, coefficient)
        The recursive form: each step removes the standard parameter `from` and adds coefficient *
        `from` to the parameter `into`.
    method : str
        How the coefficients were derived: the text `EXACT`, or the text `NUMERIC` and the reason.
    """

    robot: Robot
    base: tuple[BaseParameter, ...]
    no_effect: tuple[str, ...]
    steps: tuple[Step, ...] = field(repr=False, default=())
    method: str = EXACT

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(b.name for b in self.base)

    @property
    def own(self) -> tuple[str, ...]:
        return tuple(b.own for b in self.base)

    @property
    def coefficients(self) -> set[Expression]:
        """Different coefficients of the formulas: few, as a length comes back in every link."""
        return {c for b in self.base for c in b.combination.values()}

    @property
    def constants(self) -> Mapping[str, float]:
        """Constants of the robot whose values may change without a new derivation.

        If coefficients are numbers, only channels may change (constants that are functions of
        time), because the numbers hold for the constants of the robot file.
        """
        every, channels = self.robot.constants, self.robot.channels
        return every if self.method == EXACT else {c: every[c] for c in every if c in channels}

    def __len__(self) -> int:
        return len(self.base)


def regroup(robot: str | Path | Robot, *, seed: int = 1) -> Regrouping:
    """Derive the base parameters of a robot with their formulas.

    Parameters
    ----------
    robot : str, Path or Robot
        As for `symgen.model`.
    seed : int
        Seed of the random numbers over F_p; it never changes the result.

    Raises
    ------
    DescriptionError
        The loops cannot close.
    SymgenError
        A general loop closes in too few states near its start, or the derivation needs more
        processor time than its limit.

    Examples
    --------
    >>> import symgen
    >>> base = symgen.regrouping("planar_2r")
    >>> base.names[:3], base.no_effect[:3]
    (('ZZ1R', 'MX1R', 'MY1'), ('XX1', 'XY1', 'XZ1'))
    >>> print(base.base[0].name, "=", base.base[0].formula)
    ZZ1R = ZZ1 + Ia1 + D2**2*M2
    """
    robot = robot_of(robot)
    require(seed, int, "seed", "a whole number")
    with limited(f"the regrouping of {robot.name}"):
        regrouping = _regrouped(robot, seed)
    _warn(regrouping)
    return regrouping


def regrouping_of(robot: str | Path | Robot | Regrouping) -> Regrouping:
    """Return a Regrouping as it is, or derive that of a robot, given as for `regroup`."""
    return robot if isinstance(robot, Regrouping) else regroup(robot)


def _warn(regrouping: Regrouping) -> None:
    """Warn of each link whose inertia no rigid body can have, and name its base parameters.

    Every call warns from one line of this function, because Python shows a warning only once per
    line.
    """
    advice = (
        "Give the moments about the centre of mass in kg m^2, from CAD or of a box, or identify the moments"
        if regrouping.robot.impossible
        else "XX .. ZZ under values are about the origin of the link frame: add M (c'c 1 - c c') to "
        "the moments about the centre of mass c"
    )
    for j, wrong in impossible_links(regrouping.robot):
        moments = {parameter(p, j) for p in INERTIAL[:6]}
        names = [b.name for b in regrouping.base if moments & b.combination.keys()]
        warnings.warn(
            f"{wrong}; this inertia enters {', '.join(names) or 'no base parameter'}. {advice}",
            InertiaWarning,
            stacklevel=1,
        )


@lru_cache(maxsize=16)
def _regrouped(robot: Robot, seed: int) -> Regrouping:
    """Derive the base parameters of a robot; a second call returns the stored result.

    The cache saves time, because formulas, certificate and module of a robot need the same result.
    """
    given, robot = robot, numbered(robot)
    transfer = Transfer(robot)
    names = preference(robot, transfer.remaining)
    reason = ""
    try:
        draw = draw_states(given, seed, states_for(given, names))
        pivots, R = rref(sample(draw, names).reshape(-1, len(names)), draw.p)
    except ArithmeticError as error:
        base, relations = float_relations(given, names)
        reason = str(error)
    else:
        base = tuple(names[c] for c in pivots)
        # of which exact arithmetic knows nothing: rank is told in numbers too
        laws = [e.family for e in robot.elements if any(is_opaque(e, j) for j in e.along)]
        if laws:
            numeric, relations = float_relations(given, names)
            if len(numeric) < len(base):
                reason = f"{', '.join(laws)} depend on other columns in numbers alone"
                base = numeric
    if not reason:
        supports = {
            name: tuple(base[k] for k in np.flatnonzero(R[:, c]))
            for c, name in enumerate(names)
            if c not in pivots
        }
        exact, missing = coefficients(given, supports)
        betas = exact | {n: numeric_coefficients(given, n, supports[n]) for n in missing}
        relations = {
            name: dict(zip(support, betas.get(name, []), strict=True))
            for name, support in supports.items()
        }
        reason = _reason(missing) if missing else ""
    method = f"{NUMERIC}; {reason}" if reason else EXACT
    regrouping = _assemble(robot, transfer, base, relations, Draw(given, seed, 1))
    return replace(regrouping, robot=given, method=method)


def _reason(missing: Mapping[str, str]) -> str:
    """State why the coefficients of a regressor column were not found exactly.

    The sentence names the first column and counts the other columns in `missing`.
    """
    name, reason = next(iter(missing.items()))
    return (
        f"coefficients of {name}{f' and {len(missing) - 1} more' if len(missing) > 1 else ''} "
        f"not recognised: {reason}"
    )


regrouping = regroup  # its public name, symgen.regrouping: symgen.regroup is the package


def preference(robot: Robot, names: tuple[str, ...]) -> tuple[str, ...]:
    """Sort regressor columns by preference: earlier columns are chosen first as base parameters."""
    inertial, elements = inertial_names(robot), element_names(robot)

    def rank(name: str) -> tuple[int, int, int]:
        position = robot.parameters.index(name)
        if name in elements:
            e, j = elements[name]
            passive = j in robot.passive
            return (3 if e.kind == "inertia" else int(passive), position, 0)
        family, j = inertial[name]
        if family in FIRST_CHOICE:
            return (2, j, FIRST_CHOICE.index(family))
        if family == "M" and j and robot.frame(j).sigma == PRISMATIC:
            return (2, j, len(FIRST_CHOICE))
        return (4, j, LAST_CHOICE.index(family))

    return tuple(sorted(names, key=rank))


def _assemble(
    robot: Robot,
    transfer: Transfer,
    base: tuple[str, ...],
    relations: Mapping[str, Mapping[str, Expression]],
    draw: Draw,
) -> Regrouping:
    """Build the base parameters from general rules and from relations of this robot alone.

    `relations` holds {dependent column: {base column: coefficient}}.
    """
    combination: dict[str, Combination] = {name: transfer.combination[name] for name in base}
    steps = list(transfer.steps)
    for dependent, relation in relations.items():
        for target, beta in relation.items():
            steps.append((dependent, target, beta))
            into = combination[target]
            for standard, value in transfer.combination[dependent].items():
                into[standard] = into.get(standard, ZERO) + beta * value
    order = {name: k for k, name in enumerate(robot.parameters)}
    every = {c for terms in combination.values() for c in terms.values()}
    simple = {c: simplified(with_known_cosines(c)) for c in every}
    zero = {c for c in {*simple.values()} if _vanishes(c, draw)}
    parameters: list[BaseParameter] = []
    used: set[str] = set()
    for own in sorted(combination, key=order.__getitem__):
        terms = {
            name: simple[c]
            for name, c in sorted(
                combination[own].items(), key=lambda nc: (nc[0] != own, order[nc[0]])
            )
            if simple[c] not in zero
        }
        used |= set(terms)
        parameters.append(BaseParameter(own if terms == {own: ONE} else own + "R", own, terms))
    no_effect = tuple(name for name in robot.parameters if name not in used)
    return Regrouping(robot, tuple(parameters), no_effect, tuple(steps))


def _vanishes(c: Expression, draw: Draw) -> bool:
    """Whether a coefficient is zero, with sin**2 + cos**2 = 1 taken into account.

    The values of the coefficient modulo a prime decide, because angles are exact there.
    """
    if all(isinstance(a, str) for a in c.atoms):
        return not c
    return not draw.residues(draw.constant(c)).any()


def sign_conditions(regrouping: Regrouping) -> list[tuple[str, Expression, int]]:
    """Find the base parameters whose formula holds only for one sign of a transmission ratio.

    Such a formula adds the frictions of dependent joints. For qd2 = KR qd1,

        sign(qd2) = sign(KR) sign(qd1) ,

    so that FS1 + KR FS2 holds only for the sign that KR has in the robot file.

    Return for each ratio: a base parameter, the ratio of the two joint rates, and its sign in the
    robot file.
    """
    robot, closure = regrouping.robot, close(regrouping.robot)
    leads: dict[str, Expression] = {}
    for name, (e, j) in element_names(robot).items():
        if (
            (e.kind in ("coulomb", *OWN_LAWS) or e.when is not None)
            and j in e.along
            and (row := closure.in_independent(e.along[j]))
        ):
            leads[name] = row[0][1]
    conditions: dict[Expression, tuple[str, Expression, int]] = {}
    for b in regrouping.base:
        for name in b.combination:
            if name != b.own and name in leads and b.own in leads:
                ratio = leads[name] * leads[b.own].inverse()
                if ratio.symbols:
                    conditions.setdefault(
                        ratio, (b.name, ratio, 1 if ratio.value(robot.constants) > 0 else -1)
                    )
    return list(conditions.values())
