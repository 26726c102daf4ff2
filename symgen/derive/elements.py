"""Regressor columns of the elements: friction, springs, actuator inertias, torque laws of the user.

An element with parameter c adds one of these torques:

    along G, s = G q:    Gamma += c G' x,    x the law of the element over s, sd, sdd
    form B:              Gamma += c B x,     x = qdd | qd | q
    energy U:            Gamma_i += c dU/dq_i

A law is a polynomial in states, constants and function calls. Cosines and sines of whole multiples
of joint angles and signs of velocities are functions of the robot's geometry and motion, hence
exact over F_p. Every other call that varies with the state is a node of its own, which exact
arithmetic identifies only by its operands.
"""

from __future__ import annotations

from symgen.derive.algebra import Scalar
from symgen.derive.constants import varies
from symgen.derive.graph import Turn
from symgen.derive.newton_euler import Motion
from symgen.description.expression import FUNCTIONS, ONE, ZERO, Atom, Call, Expression
from symgen.description.kinds import CHANNEL, STATE
from symgen.description.robot import Element, Form, Row, parameter


def element_column(motion: Motion, e: Element, j: int) -> dict[int, Scalar]:
    """Return the regressor column {joint i: D_i} of an element parameter, such as FV2.

    The joints i are the moving joints that this parameter acts on.
    """
    if j in e.form:
        return _form(motion, str(e.law(j)), e.form[j])
    row = e.along[j]
    law, others = e.laws(j)
    values = _Law(motion, e, j)
    x = values.one_sided(law) if e.when is not None else values.of(law)
    if x == 0 and not others:
        return dict.fromkeys(row, 0)
    column = {i: motion.algebra.constant(g) * x for i, g in row.items()} if law else {}
    for i, slope in others.items():
        column[i] = column.get(i, 0) + values.of(slope)
    return column


def law_value(motion: Motion, e: Element, j: int, law: Expression) -> Scalar:
    """Convert the torque law or energy of an element (friction, spring, ...) to a graph node."""
    return _Law(motion, e, j).of(law)


class _Law:
    """The torque law of one element parameter, such as FV2, and its conversion to graph nodes.

    A velocity along several joints is named after the element, since rows of other elements may
    have the same joints.
    """

    def __init__(self, motion: Motion, e: Element, j: int) -> None:
        self.motion, self.element, self.row = motion, e, e.along[j]
        self.name = f"{motion.algebra.named('QP')}{parameter(e.family, j)}"

    def of(self, e: Expression) -> Scalar:
        """Convert an expression in the torque law to a node of the expression graph."""
        total: Scalar = 0
        for m, c in e.ordered:
            varying = [(a, n) for a, n in m if varies(a)]
            fixed = Expression({tuple(an for an in m if an not in varying): c})
            term = self.motion.algebra.constant(fixed)
            for a, n in varying:
                x = self._atom(a)
                x = self.motion.algebra.function("inv", x) if n < 0 else x
                for _ in range(abs(n)):
                    term = term * x
            total = total + term
        return total

    def one_sided(self, law: Expression) -> Scalar:
        """Return the velocity on which friction in one direction depends, or its sign; zero in the
        other direction.
        """
        rate, key = self._atom("qd"), self.motion.geometry.closure.in_independent(self.row)
        if type(rate) is int or not key:
            return 0  # at rest, or the closure holds s still
        direction, speed = self.motion.algebra.one_sided(rate, key, str(self.element.when))
        return speed if law == Expression.symbol("qd") else direction

    def _atom(self, a: Atom) -> Scalar:
        if isinstance(a, Call):
            return self._call(a)
        if str(a).startswith(CHANNEL):
            return self.motion.algebra.channel(str(a).removeprefix(CHANNEL))
        state, joint = STATE.match(str(a)).groups()  # type: ignore[union-attr]
        coordinate = getattr(self.motion, state)
        if joint:
            return coordinate(int(joint))
        rate = self.motion.algebra.linear(self.row, {i: coordinate(i) for i in self.row})
        if state == "qd" and len(self.row) > 1:
            rate = self.motion.algebra.name(rate, self.name)
        return rate

    def _call(self, a: Call) -> Scalar:
        motion, algebra = self.motion, self.motion.algebra
        if a.function == "sign" and (part := linear_in(a.argument, "qd", self.row)):
            row, rest = part
            key = motion.geometry.closure.in_independent(row)
            if not rest:
                rate = self.of(a.argument)
                return 0 if type(rate) is int or not key else algebra.sign(rate, key)
        if a.function in ("cos", "sin") and (turn := self._turn(a.argument)):
            return algebra.cos_sin(*turn)[a.function == "sin"]
        operands = [self.of(e) for e in a.operands]
        at_zero = FUNCTIONS[a.function].at_zero
        if operands[0] == 0 and at_zero is not None:
            return at_zero
        return algebra.function(a.function, *operands)

    def _turn(self, angle: Expression) -> tuple[Turn, Expression] | None:
        """Write an angle in a torque law as whole multiples of independent joint angles plus a
        constant.

        Return the multiples and the constant, or None if the angle has another form.
        """
        if not (part := linear_in(angle, "q", self.row)):
            return None
        row, rest = self.motion.geometry.closure.relation(*part)
        whole = {i: c.constant for i, c in row.items()}
        if any(c is None or c.denominator != 1 for c in whole.values()):
            return None
        return tuple((i, int(c)) for i, c in whole.items() if c), rest


def is_opaque(e: Element, j: int) -> bool:
    """Whether a torque law has a function that exact arithmetic cannot represent, such as tanh."""
    pending = [e.law(j), e.potential(j)]
    for law in pending:
        for a in law.atoms:
            if isinstance(a, Call) and varies(a):
                state = {"sign": "qd", "cos": "q", "sin": "q"}.get(a.function, "")
                part = linear_in(a.argument, state, e.along[j])
                rest = a.function == "sign" and part and part[1]
                if a.function != "inv" and (not state or not part or rest):
                    return True
                pending += a.operands
    return False


def linear_in(
    e: Expression, state: str, along: Row
) -> tuple[dict[int, Expression], Expression] | None:
    """Split an expression that is linear in joint positions or velocities into coefficients and a
    constant.

    Return the row {joint: coefficient} and the constant rest, or None if e is not linear. x are the
    positions if `state` is q, the velocities if it is qd. The name q (or qd) without a joint number
    means the sum over the row `along`.
    """
    row: dict[int, Expression] = {}
    rest = ZERO
    for m, c in e.terms.items():
        varying = [(a, n) for a, n in m if varies(a)]
        fixed = Expression({tuple(an for an in m if an not in varying): c})
        if not varying:
            rest = rest + fixed
            continue
        match = STATE.match(str(varying[0][0]))
        if len(varying) > 1 or varying[0][1] != 1 or not match or match[1] != state:
            return None
        joints = {int(match[2]): ONE} if match[2] else along
        for i, g in joints.items():
            row[i] = row.get(i, ZERO) + fixed * g
    return row, rest


def _form(motion: Motion, coordinate: str, form: Form) -> dict[int, Scalar]:
    column: dict[int, Scalar] = {}
    for (i, m), b in form.items():
        x = motion.algebra.constant(b) * getattr(motion, coordinate)(m)
        column[i] = column.get(i, 0) + x
    return column
