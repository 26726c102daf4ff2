"""What a model is derived from: robot, parameters, closure, and the graph algebra in which symbols may have values."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from math import hypot, isfinite
from typing import Any

from symgen.derive.closure import Closure, open_tree
from symgen.derive.columns import element_names
from symgen.derive.geometry import Geometry
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.derive.loops import close
from symgen.derive.scalar import Scalar, Turn, add, mul
from symgen.description.at_values import at_values, exact
from symgen.description.expression import ONE, ZERO, Expression
from symgen.description.grammar import parse
from symgen.description.robot import Element, Robot
from symgen.errors import SymgenError
from symgen.regroup.formula import Formula
from symgen.regroup.regrouping import Regrouping, regroup

PARAMETERS = ("base", "standard")
PASSIVE = ("functions", "symbols")
GRAVITY = ("symbol", "number")


@dataclass(frozen=True)
class Source:
    """A robot as models are asked of it.

    Attributes
    ----------
    robot : Robot
        With the values that were given in the place of its constants.
    closure : Closure
        Its joints in the independent ones; passive joints that stay symbols are tied.
    relations : Closure
        What is known of the passive joints: as `closure`, unless all of them stay symbols.
    own : mapping
        Symbol of each parameter, by the standard parameter whose column of the regressor it has.
    formulas : mapping
        What each parameter is made of, by its symbol.
    given : mapping
        Values in the place of symbols, by symbol.
    kind : str
        base or standard.
    """

    robot: Robot
    closure: Closure
    relations: Closure
    own: Mapping[str, str]
    formulas: Mapping[str, Formula]
    given: Mapping[str, Expression]
    kind: str

    @property
    def parameters(self) -> tuple[str, ...]:
        return tuple(self.own.values())


class ValuedAlgebra(GraphAlgebra):
    """The algebra of graph nodes with values in the place of some symbols."""

    def __init__(self, source: Source) -> None:
        super().__init__(source.robot)
        self.source = source

    def valued(self, name: str, *, fixed: bool = False) -> Scalar:
        """A symbol, or its value; only zero is structural, since a rate of 1 is no reason to leave out its sign."""
        value = self.source.given.get(name)
        if value is None:
            return self.graph.symbol(name, fixed=fixed)
        return self.graph.lift(self.constant(value)) if value else 0

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar, Scalar]:
        values = self.source.given
        for j, n in turn:
            offset = offset + values.get(f"q{j}", ZERO) * n
        return super().cos_sin(tuple((j, n) for j, n in turn if f"q{j}" not in values), offset)

    def q(self, j: int) -> Scalar:
        return self.valued(f"q{j}")

    def qd(self, j: int) -> Scalar:
        return self.valued(f"QP{j}")

    def qdd(self, j: int) -> Scalar:
        return self.valued(f"QDP{j}")

    def rate(self, u: int, i: int) -> Scalar:
        """dq_u/dq_i: the number of a linear relation, a symbol where only the closure equations give it."""
        total: Scalar = 0
        for k, n in self.source.relations.row[u].items():
            step = super().rate(k, i) if k in self.source.relations.tied else int(k == i)
            total = add(total, mul(self.constant(n), step))
        return total


class Derivation:
    """One graph: the algebra, the geometry and the parameters as its scalars."""

    def __init__(self, source: Source) -> None:
        self.source, self.robot, self.closure = source, source.robot, source.closure
        self.algebra = ValuedAlgebra(source)
        self.geometry = Geometry(self.robot, self.algebra, self.closure)
        self.K: dict[str, Scalar] = {}
        for own, name in source.own.items():
            value = self.algebra.valued(name, fixed=True)
            if not (isinstance(value, int) and value == 0):
                self.K[own] = value

    @property
    def elements(self) -> dict[str, tuple[Element, int]]:
        """The elements whose parameters have an effect, by parameter."""
        return {name: e for name, e in element_names(self.robot).items() if name in self.K}

    def actuated(self, torque: Mapping[int, Scalar]) -> dict[int, Scalar]:
        """G' of values by moving joint: by actuated joint, all of them."""
        projected = self.closure.project(self.algebra, torque)
        return {i: projected.get(i, 0) for i in self.robot.joints}


def source_of(
    robot: Robot,
    parameters: str = "base",
    gravity: str | None = None,
    values: Mapping[str, Any] | None = None,
    passive: str | None = None,
    regrouping: Regrouping | None = None,
) -> Source:
    """The robot with what was asked, see `symgen.symbolic`; `regrouping` is that of the robot where it is known already."""
    _one_of("parameters", parameters, PARAMETERS)
    formulas: dict[str, Formula]
    if parameters == "base":
        regrouping = regrouping or regroup(robot)
        own = {b.own: b.name for b in regrouping.base}
        formulas = {b.name: b.formula for b in regrouping.base}
    else:
        own = {p: p for p in robot.parameters}
        formulas = {p: Formula({p: ONE}) for p in robot.parameters}
    given = _parsed(robot, own.values(), values or {})
    if gravity is not None:
        _one_of("gravity", gravity, GRAVITY)
        robot = _with_gravity(robot, gravity)
    constants = {name: e for name, e in given.items() if name in robot.constants}
    if constants:
        robot = at_values(robot, constants)
        formulas = {
            name: Formula({p: c for p, e in f.combination.items() if (c := e.substitute(constants))}) for name, f in formulas.items()
        }
    relations = close(robot)
    closure = relations
    if passive is not None:
        _one_of("passive", passive, PASSIVE)
        if passive == "functions" and relations.tied:
            tied = ", ".join(f"q{u}" for u in relations.tied)
            raise SymgenError(
                f"{tied} of {robot.name} have no closed form: only the closure equations tie them to the actuated joints; "
                "leave out passive, or passive='symbols', and take their equations from `closure`"
            )
        if passive == "symbols":
            closure = open_tree(robot)
    return Source(robot, closure, relations, own, formulas, given, parameters)


def _one_of(what: str, given: str, known: Iterable[str]) -> None:
    if given not in known:
        raise SymgenError(f"{what}={given!r}; expected one of {', '.join(known)}")


def _parsed(robot: Robot, parameters: Iterable[str], values: Mapping[str, Any]) -> dict[str, Expression]:
    """Values as exact expressions over pi and the constants of the robot, read by the grammar of robot files."""
    moving = [f"{state}{j}" for state in ("q", "QP", "QDP") for j in robot.moving]
    known = [*robot.constants, *moving, *parameters]
    result = {}
    for symbol, value in values.items():
        name = str(symbol)
        if name not in known:
            close_to = ", ".join(difflib.get_close_matches(name, known, n=4, cutoff=0.5)) or f"{', '.join(known[:6])} ..."
            raise SymgenError(f"{name!r} is no symbol of the models of {robot.name}; close: {close_to}")
        if isinstance(value, Expression):
            result[name] = value
        elif isinstance(value, float):
            if not isfinite(value):
                raise SymgenError(f"{name} = {value}; expected a finite number, or a text such as 'pi/2'")
            result[name] = exact(value, angle=name in moving)
        else:
            text = f"{value.numerator}/{value.denominator}" if isinstance(value, Fraction) else str(value)
            result[name] = parse(text, [c for c in robot.constants if c not in values])
    return result


def _with_gravity(robot: Robot, kind: str) -> Robot:
    """Gravity as a number times a direction, or with its size as the symbol g."""
    symbols = {s for e in robot.gravity for s in e.symbols}
    if kind == "number":
        numbers = {name: exact(robot.constants[name]) for name in symbols}
        x, y, z = (e.substitute(numbers) for e in robot.gravity)
        return replace(robot, gravity=(x, y, z))
    if symbols or not any(robot.gravity):
        return robot
    size = hypot(*map(float, robot.gravity))
    if "g" in robot.constants:
        raise SymgenError(f"gravity='symbol': g is another constant of {robot.name}; write its gravity with a symbol in the robot file")
    unit = exact(size).inverse()
    x, y, z = (e * unit * Expression.symbol("g") for e in robot.gravity)
    return replace(robot, gravity=(x, y, z), constants={**robot.constants, "g": size})
