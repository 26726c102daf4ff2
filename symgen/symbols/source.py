"""Inputs of the symbolic models: robot, parameters, relations between joints, given values.

The relations (`closure`) give the joint positions of a closed loop as functions of the
independent joint positions.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, partial
from math import isfinite
from typing import Any

from symgen.derive.algebra import GraphAlgebra, Scalar
from symgen.derive.closure import Closure, open_tree
from symgen.derive.derivation import Derivation, derive, derived
from symgen.derive.graph import Symbol
from symgen.derive.loops import close
from symgen.derive.models import Request
from symgen.derive.names import Names
from symgen.derive.rewrite import Input
from symgen.description.expression import ONE, Expression
from symgen.description.grammar import parse
from symgen.description.robot import Robot
from symgen.description.values import at_values, exact, substituted
from symgen.errors import SymgenError, require_name
from symgen.regroup.regrouping import Formula, Regrouping, regroup
from symgen.symbols.expressions import in_decimals

PARAMETERS = ("base", "standard")
PASSIVE = ("functions", "symbols")


@dataclass(frozen=True)
class Source:
    """All inputs from which the symbolic models of one robot are derived.

    Attributes
    ----------
    robot : Robot
        The robot; given numbers replace its constants.
    closure : Closure
        Each joint as a function of the independent joints. A passive joint that stays a symbol
        counts as a joint that only the closure equations determine.
    relations : Closure
        The relations of the passive joints. They differ from `closure` if all passive joints stay
        symbols.
    own : mapping
        Symbol of each parameter, by the name of the standard parameter that has the same column in
        the regressor.
    formulas : mapping
        Each parameter as a combination of standard parameters, by its symbol.
    given : mapping
        Values that replace symbols, by symbol.
    kind : str
        Kind of the parameters, base or standard.
    decimals : bool
        Whether functions of numbers alone, such as sin(1.571), are written as decimals.
    """

    robot: Robot
    closure: Closure
    relations: Closure
    own: Mapping[str, str]
    formulas: Mapping[str, Formula]
    given: Mapping[str, Expression]
    kind: str
    decimals: bool = False

    @property
    def parameters(self) -> tuple[str, ...]:
        return tuple(self.own.values())

    @cached_property
    def derivation(self) -> Derivation:
        """Derived formulas of the robot, as an expression graph for all its symbolic models.

        Passive joints that stay symbols are treated as independent joints.
        """
        if self.closure is self.relations:
            return derive(self.robot)
        return derived(self.robot, open_tree)

    def request(self, of: int = 0, frame: int = 0) -> Request:
        """Collect the choices for one model: parameters, values that replace symbols, frames.

        The model is of frame `of` in components of frame `frame`.
        """
        inputs: dict[Symbol, Input] = {}
        for kind, letter in (("q", "q"), ("qd", "QP"), ("qdd", "QDP")):
            for j in self.robot.moving:
                if (name := f"{letter}{j}") in self.given:
                    inputs[Symbol(kind, name)] = self.given[name]
        for name in GraphAlgebra(self.robot).base_motion:
            if name in self.given:
                inputs[Symbol("base", name)] = self.given[name]
        for own, name in self.own.items():
            if name in self.given:
                inputs[Symbol("parameter", own)] = self.given[name]
        named = Names(len(self.robot.frames))
        for u in () if self.closure is self.relations else self.closure.tied:
            for i in self.robot.joints:
                inputs[Symbol("rate", named("G", u, i))] = partial(self._rate, u, i)
        return Request(self.own, of, frame, inputs)

    def _rate(self, u: int, i: int, algebra: GraphAlgebra) -> Scalar:
        """Compute the rate dq_u/dq_i of passive joint u with respect to independent joint i.

        The rate is a number if a linear relation gives q_u. Rates of joints that only the closure
        equations determine enter as symbols.
        """
        row, tied = self.relations.row[u], self.relations.tied
        steps = {k: algebra.rate(k, i) if k in tied else int(k == i) for k in row}
        return algebra.linear(row, steps)


def source_of(
    robot: Robot,
    parameters: str = "base",
    values: Mapping[str, Any] | None = None,
    passive: str | None = None,
    regrouping: Regrouping | None = None,
    decimals: bool = False,
) -> Source:
    """Collect the inputs (parameters, given values, ...) of the symbolic models of a robot.

    The parameters are explained in `symgen.symbolic`. `regrouping` is the regrouping of the robot,
    if it is already computed.
    """
    require_name(parameters, PARAMETERS, "parameters")
    formulas: dict[str, Formula]
    if parameters == "base":
        regrouping = regrouping or regroup(robot)
        if decimals:
            regrouping = in_decimals(regrouping)
        own = {b.own: b.name for b in regrouping.base}
        formulas = {b.name: b.formula for b in regrouping.base}
    else:
        own = {p: p for p in robot.parameters}
        formulas = {p: Formula({p: ONE}) for p in robot.parameters}
    given = _parsed(robot, own.values(), values or {})
    constants = {name: e for name, e in given.items() if name in robot.constants}
    if constants:
        robot = at_values(robot, constants)
        formulas = {
            name: Formula(
                {p: c for p, e in f.combination.items() if (c := substituted(e, constants))}
            )
            for name, f in formulas.items()
        }
    relations = close(robot)
    closure = relations
    if passive is not None:
        require_name(passive, PASSIVE, "passive")
        if passive == "functions" and relations.tied:
            tied = ", ".join(f"q{u}" for u in relations.tied)
            raise SymgenError(
                f"{tied} of {robot.name} have no closed form: only the closure equations relate "
                "these joints to the actuated joints; "
                "leave the argument `passive` out, or use passive='symbols' and solve the equations of the model `closure` too"
            )
        if passive == "symbols":
            closure = open_tree(robot)
    return Source(robot, closure, relations, own, formulas, given, parameters, decimals)


def _parsed(
    robot: Robot, parameters: Iterable[str], values: Mapping[str, Any]
) -> dict[str, Expression]:
    """Convert values given for symbols to exact expressions in pi and the robot's constants.

    A text is parsed by the grammar of robot files.
    """
    moving = [f"{state}{j}" for state in ("q", "QP", "QDP") for j in robot.moving]
    moving += GraphAlgebra(robot).base_motion
    known = [*robot.constants, *moving, *parameters]
    result = {}
    for symbol, value in values.items():
        name = str(symbol)
        if name not in known:
            close_to = (
                ", ".join(difflib.get_close_matches(name, known, n=4, cutoff=0.5))
                or f"{', '.join(known[:6])} ..."
            )
            raise SymgenError(
                f"{name!r} is no symbol of the models of {robot.name}; similar names: {close_to}"
            )
        if isinstance(value, Expression):
            result[name] = value
        elif isinstance(value, float):
            if not isfinite(value):
                raise SymgenError(
                    f"{name} = {value}; expected a finite number, or a text such as 'pi/2'"
                )
            result[name] = exact(value, angle=name in moving)
        else:
            text = (
                f"{value.numerator}/{value.denominator}"
                if isinstance(value, Fraction)
                else str(value)
            )
            result[name] = parse(text, [c for c in robot.constants if c not in values])
    return result
