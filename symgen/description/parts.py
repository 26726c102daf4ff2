"""Tables of a robot file: frames, coefficients of joint elements, loops, drives and limits."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from itertools import combinations, combinations_with_replacement
from math import prod
from typing import Annotated, Any

from pydantic import AfterValidator, Field, ValidationInfo
from pydantic.dataclasses import dataclass

from symgen.description.expression import ONE, Expression
from symgen.description.fields import (
    CONFIG,
    UNWRITTEN,
    Constant,
    Declared,
    Interval,
    Numeric,
    Position,
    Whole,
    Written,
)
from symgen.description.grammar import parse
from symgen.errors import DescriptionError, ExpressionError

REVOLUTE, PRISMATIC, FIXED = 0, 1, 2
INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")


DIRECTIONS = ("positive", "negative")
GEOMETRY = ("gamma", "b", "alpha", "d", "theta", "r")  # of a row, in the order of application
ANGLES = ("gamma", "alpha", "theta")

Row = Mapping[int, Expression]  # {j: G_j}: s = sum_j G_j q_j, the G_j constant
Form = Mapping[tuple[int, int], Expression]  # {(i, j): B_ij}, symmetric, the B_ij constant
Limits = Mapping[str, tuple[float, ...] | tuple[tuple[float, float], ...]]


def _moved(value: int | None, info: ValidationInfo) -> int:
    return int(info.data.get("sigma") != FIXED) if value is None else value


@dataclass(frozen=True, config=CONFIG)
class Frame:
    """One frame: a row of the frame table, with the parameters of Khalil and Kleinfinger."""

    j: Annotated[int, *UNWRITTEN]
    ant: Annotated[Whole, Field(description="antecedent frame, 0 for the base")]
    sigma: Annotated[Whole, Field(description="0 revolute, 1 prismatic, 2 fixed")]
    mu: Annotated[
        int,
        Written(Whole | None),
        AfterValidator(_moved),
        Field(
            default=None,
            validate_default=True,
            description="1 actuated, 0 passive; default 1, for a fixed frame 0",
        ),
    ]
    gamma: Annotated[
        Constant,
        Field(
            default="0",
            validate_default=True,
            description=(
                "rotation about z of the antecedent frame first, rad; of trees and loops only"
            ),
        ),
    ]
    b: Annotated[
        Constant,
        Field(
            default="0",
            validate_default=True,
            description="distance along that z, m; of trees and loops only",
        ),
    ]
    alpha: Annotated[Constant, Field(description="angle between the z axes, about x, rad: pi/2")]
    d: Annotated[Constant, Field(description="distance between the z axes, along x, m: D2")]
    theta: Annotated[
        Position,
        Field(
            description=(
                "angle between the x axes, about z_j, rad; q1 or q1 + pi/2 where sigma is 0"
            )
        ),
    ]
    r: Annotated[
        Position,
        Field(
            description=(
                "distance between the x axes, along z_j, m; q1 or q1 + R1 where sigma is 1"
            )
        ),
    ]

    @property
    def q(self) -> str:
        """Name of the joint variable, for instance q3."""
        return f"q{self.j}"

    @property
    def at_zero(self) -> tuple[Expression, ...]:
        """Values of gamma, b, alpha, d, theta and r for the joint position q_j = 0."""
        return self.gamma, self.b, self.alpha, self.d, self.theta0, self.r0

    @property
    def theta0(self) -> Expression:
        """Value of theta_j for the joint position q_j = 0, rad."""
        return self.theta - Expression.symbol(self.q) if self.sigma == REVOLUTE else self.theta

    @property
    def r0(self) -> Expression:
        """Value of r_j for the joint position q_j = 0, m."""
        return self.r - Expression.symbol(self.q) if self.sigma == PRISMATIC else self.r


def rows(texts: Mapping[int, str] | str, declared: Declared) -> Mapping[int, Row]:
    """Convert the entry `along` of an element, such as {6: q5 + q6}, to coefficients of q.

    The text "all" gives a row for each actuated joint, in which this joint has the coefficient 1.
    """
    if texts == "all":
        return {f.j: {f.j: ONE} for f in declared.frames if f.mu}
    return reduced(row_of, texts, declared)


def reduced(
    reduce: Callable[[Expression, tuple[int, ...]], Any], texts: Any, declared: Declared
) -> dict[int, Any]:
    """Convert texts of an element, such as {6: q6**2}, to linear or quadratic forms in q.

    The function `reduce` makes the row or the form from an expression. A joint number, or a list of
    joint numbers, means a row for each joint with its coefficient 1.
    """
    joints = tuple(f.j for f in declared.frames if f.sigma != FIXED)
    result: dict[int, Any] = {}
    if isinstance(texts, int | list):  # joints, each along itself
        return {j: {j: ONE} for j in ([texts] if isinstance(texts, int) else texts)}
    for j, text in texts.items() if joints else ():
        try:
            result[j] = reduce(parse(text, declared.variables), joints)
        except (ValueError, ExpressionError) as error:
            raise DescriptionError(str(error), path=(j,)) from error
    return result


PLANES = {"xy": ("XZ", "YZ", "MZ"), "xz": ("XY", "YZ", "MY"), "yz": ("XY", "XZ", "MX")}
"""Inertial parameters that vanish for a link that is symmetric about a plane of its frame."""


def assumed(table: Mapping[str, str], declared: Declared) -> frozenset[str]:
    """Find the standard parameters that a file assumes to be zero, by name or by link symmetry."""
    names: set[str] = set()
    for key, text in table.items():
        link, plane = re.fullmatch(r"link ([1-9][0-9]*)", key), text.removeprefix("symmetric ")
        if link and plane in PLANES and plane != text:
            names |= {parameter(p, int(link[1])) for p in PLANES[plane]}
        elif link:
            raise DescriptionError(
                f"{key}: {text!r}; expected symmetric xy, symmetric xz or symmetric yz", path=(key,)
            )
        elif parse(text, ()).constant == 0:
            names.add(key)
        else:
            raise DescriptionError(
                f"{key}: {text}; expected 0 (only a zero changes the regrouping); write another known "
                "value under `values`, which method feasible uses as a prior",
                path=(key,),
            )
    return frozenset(names)


def by_joint(texts: Mapping[str, Any], declared: Declared) -> dict[int, Any]:
    """Replace the keys of a table by joint numbers: {q3: x} becomes {3: x}."""
    for q in texts:
        if not re.fullmatch(r"q[1-9][0-9]{0,8}", q):
            raise DescriptionError(f"{q!r} is no joint; expected q1, q2, ...", path=(q,))
    return {int(q[1:]): x for q, x in texts.items()}


@dataclass(frozen=True, config=CONFIG)
class Loop:
    """A closed loop of a robot: the fixed frame `twin` coincides with the frame of joint `cut`."""

    cut: Annotated[Whole, Field(description="number of the cut joint: passive, without a link")]
    twin: Annotated[
        Whole,
        Field(
            description="number of the fixed frame (sigma 2) at the same place on the other branch"
        ),
    ]
    start: Annotated[
        Mapping[int, float],
        Written(dict[str, Numeric], by_joint),
        Field(description="picks the assembly mode: {q3: 1.2}"),
    ] = Field(default={})


def _of_motors(value: list[float] | float | None, declared: Declared) -> tuple[float, ...]:
    """Expand a setting of the drives, such as the offset, to one value per actuated joint; None
    means 0.
    """
    if isinstance(value, list):
        return tuple(value)
    return tuple(value or 0.0 for f in declared.frames if f.mu)


def _of_motors_if_given(value: Any, declared: Declared) -> tuple[float, ...] | None:
    """Expand a setting of the drives to one value per actuated joint; None is returned unchanged.

    Measured currents are refused if no torque constant is given.
    """
    return None if value is None else _of_motors(value, declared)


def _rows(value: list[Any], _: Declared) -> tuple[tuple[float, ...], ...]:
    """Convert the gear ratios of a file to a matrix; a list of numbers becomes its diagonal."""
    if any(isinstance(x, list) for x in value):
        return tuple(map(tuple, value))
    return tuple(
        tuple(x if k == i else 0.0 for k in range(len(value))) for i, x in enumerate(value)
    )


@dataclass(frozen=True, config=CONFIG)
class Drives:
    """Drives: motor position qm = ratio (q - offset), tau = ratio' (torque_constant * current)."""

    ratio: Annotated[
        tuple[tuple[float, ...], ...],
        Written(list[list[Numeric]] | list[Numeric], _rows),
        Field(
            description="one row per motor: [[100, 0], [0, 80]]; of uncoupled drives [100, 80]; "
            "rad per m for a prismatic joint"
        ),
    ]
    offset: Annotated[
        tuple[float, ...],
        Written(list[Numeric] | None, _of_motors),
        Field(
            default=None,
            validate_default=True,
            description="joint positions where the motors read 0; default 0",
        ),
    ]
    torque_constant: Annotated[
        tuple[float, ...] | None,
        Written(list[Numeric] | Numeric | None, _of_motors_if_given),
        Field(default=None, description="N m/A; a number, or one per motor"),
    ]


@dataclass(frozen=True, config=CONFIG)
class LimitsTable:
    """Limits for exciting trajectories, one entry for each actuated joint."""

    q: Annotated[
        list[Interval] | None,
        Field(description="[lower, upper], or one number for +- that number"),
    ] = None
    qd: Annotated[list[Numeric] | None, Field(description="largest speeds, rad/s or m/s")] = None
    qdd: Annotated[
        list[Numeric] | None, Field(description="largest accelerations, rad/s^2 or m/s^2")
    ] = None
    tau: Annotated[
        list[Numeric] | None,
        Field(
            description="largest torques, N m or N; 0: a joint without a motor, whose torque is zero"
        ),
    ] = None


def parameter(family: str, j: int) -> str:
    """Build the name of a standard parameter from family and link, for instance XX2."""
    return f"{family}{j}"


def row_of(e: Expression, joints: tuple[int, ...]) -> dict[int, Expression]:
    """Return the coefficients G of an expression G q that is linear in the joint positions q.

    Raises ValueError if the expression is not linear and homogeneous in the joint positions.
    """
    what = "a combination of joint positions such as q5 + q6 or 2*q3"
    return {j: c for (j,), c in _cofactors(e, combinations(joints, 1), what).items()}


def form_of(e: Expression, joints: tuple[int, ...]) -> dict[tuple[int, int], Expression]:
    """Return the symmetric matrix B of an expression that is a quadratic form q' B q.

    Raises ValueError if the expression is not a quadratic form.
    """
    form: dict[tuple[int, int], Expression] = {}
    what = "a quadratic form in the joint positions such as q6**2 + 2*q5*q6"
    pairs = combinations_with_replacement(joints, 2)
    for (i, j), c in _cofactors(e, pairs, what).items():
        form[i, j] = form[j, i] = c if i == j else c * Fraction(1, 2)
    return form


def _cofactors(
    e: Expression, products: Iterable[tuple[int, ...]], what: str
) -> dict[tuple[int, ...], Expression]:
    """Return the coefficients in `e` of given products of joint positions, for instance of q5 q6.

    The result maps the joints of each product to its coefficient: for e = 2 q5 q6, the result maps
    (5, 6) to 2. Raises ValueError if `e` is not a sum of such products.
    """
    cofactors, rest = {}, e
    for joints in products:
        names = [f"q{j}" for j in joints]
        if c := e.coefficient(*names):
            cofactors[joints] = c
            rest = rest - prod(map(Expression.symbol, names), start=c)
    if rest or any(map(moves, cofactors.values())):
        raise ValueError(f"{e} is not {what}")
    return cofactors


def moves(c: Expression) -> bool:
    """Whether a joint position occurs in the expression `c`."""
    return any(re.fullmatch(r"q\d+", name) for name in c.symbols)
