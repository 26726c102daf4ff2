"""Closed forms: the graph of a model multiplied out, then collected by parameter,

    entry = sum_k common_k inside_k chi_k ,

common_k the factors that all terms of a coefficient share. Parameters with one coefficient share it in brackets, as in the formulas of `regroup`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from symgen.derive.graph import Node, Scalar, reachable
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.derive.scalar import Turn
from symgen.description.expression import ONE, Call, Expression, Monomial, call
from symgen.errors import SymgenError
from symgen.symbols.polynomial import BITS, ONES, Coefficient, Polynomial, Rank, Ring

CONSTANT, SLIDE, RATE, DIRECTION, PARAMETER = (1,), (2,), (4,), (5,), (6,)  # ranks of factors; cosines and sines have (3, ...)


@dataclass(frozen=True)
class Group:
    """common * inside * (sum of inner) * parameters: the terms of an entry that share a coefficient.

    Attributes
    ----------
    parameters : Expression
        A parameter, a sum of parameters, or 1.
    common : Expression
        One monomial.
    inside : Expression
        1, or a polynomial of two terms and more.
    inner : tuple of Group
        () for 1, or the terms of a coefficient that are factored themselves.
    """

    parameters: Expression
    common: Expression
    inside: Expression = ONE
    inner: tuple[Group, ...] = ()

    @property
    def size(self) -> int:
        """Terms as they are written."""
        return len(self.inside.terms) + len(self.parameters.terms) - 1 + max(sum(g.size for g in self.inner) - 1, 0)


ClosedForm = tuple[Group, ...]  # an entry; () is zero


class Expansion:
    """Polynomials of the nodes of one graph.

    Parameters
    ----------
    algebra : GraphAlgebra
        Where the graph came from: what its angles are.
    parameters : iterable of str
        Symbols by which entries are collected, in their order.
    limit : int
        Terms that a polynomial may have. Raises TooManyTermsError beyond.
    """

    def __init__(self, algebra: GraphAlgebra, parameters: Iterable[str], limit: int) -> None:
        self.algebra, self.ring = algebra, Ring(limit)
        self.parameters = {name: k for k, name in enumerate(parameters)}
        self._value: dict[int, Polynomial] = {}
        self._written: dict[int, Monomial] = {}
        for node in algebra.graph.nodes:  # angles by which sums of products may be written shorter
            if node.index in algebra.angles and algebra.angles[node.index][0]:
                turn, rest, _ = _forward(*algebra.angles[node.index])
                label = str(node.name)[1:]
                for name in {f"C{label}", f"S{label}"} & {*algebra.robot.constants, *self.parameters}:
                    raise SymgenError(
                        f"two quantities would be called {name}; rename the constant or parameter of that name in the robot file"
                    )
                self.ring.angle(turn, rest, label)

    def of(self, outputs: Sequence[Scalar | int]) -> list[Polynomial]:
        """The polynomials of graph values, multiplied out."""
        for node in reachable(outputs):
            if node.index not in self._value:
                self._value[node.index] = self._node(node)
        return [self._signed(x) for x in outputs]

    def _signed(self, x: Scalar | int) -> Polynomial:
        if isinstance(x, int):
            return {0: x} if x else {}
        value = self._value[x.node.index]
        return value if x.sign > 0 else self.ring.scaled(value, -1)

    def _node(self, node: Node) -> Polynomial:
        ring, x = self.ring, [self._signed(s) for s in node.operands]
        match node.op:
            case "sym":
                return {self.symbol(str(node.value)): 1}
            case "const":
                return {0: _whole(node.value)} if node.value else {}
            case "add":
                return ring.add(x[0], x[1])
            case "mul":
                return ring.mul(x[0], x[1])
            case "cos" | "sin":
                turn, rest = self.algebra.angles[node.index]
                if not turn:
                    return self._expression(call(node.op, rest))
                turn, rest, sign = _forward(turn, rest)
                angle = ring.angles[turn, rest]
                return {angle.cos: 1} if node.op == "cos" else {angle.sin: sign}
            case "sqrt":
                return self._expression(self.algebra.roots[node.index])
            case "inv":
                return self._expression(self.expression(x[0]).inverse())
            case "sign":
                return self._expression(Expression({((Call("sign", self.expression(x[0])), 1),): Fraction(1)}), DIRECTION)
        size = self._expression(Expression({((Call("Abs", self.expression(x[0])), 1),): Fraction(1)}), DIRECTION)
        return ring.scaled(ring.add(x[0], size), Fraction(1, 2))  # max(x, 0)

    def symbol(self, name: str) -> int:
        """The monomial of a symbol of the graph."""
        if name in self.parameters:
            return self.ring.atom(name, (*PARAMETER, self.parameters[name]))
        stem = name.rstrip("0123456789_")
        rank: Rank = SLIDE if stem == "q" else RATE if stem in ("QP", "QDP", "G") and name not in self.algebra.robot.constants else CONSTANT
        return self.ring.atom(name, rank)

    def _expression(self, e: Expression, rank: Rank = CONSTANT) -> Polynomial:
        """A constant expression: its powers and functions are atoms."""
        total: Polynomial = {}
        for m, c in e.terms.items():
            monomial = 0
            for a, n in m:
                assert isinstance(a, str | Call)
                sign = 1 if n > 0 else -1
                monomial += abs(n) * (self.symbol(a) if isinstance(a, str) and n > 0 else self.ring.atom(a, rank, sign))
            total[monomial] = total.get(monomial, 0) + _whole(c)
        return total

    # --- back to expressions ---

    def expression(self, a: Polynomial) -> Expression:
        """A polynomial as an expression, the factors of each product in the order of their ranks."""
        return Expression({self._factors(m): Fraction(c) for m, c in sorted(a.items())})

    def _factors(self, monomial: int) -> Monomial:
        if monomial not in self._written:
            found = [(self.ring.atoms[k], n) for k, n in self.ring.powers(monomial).items()]
            found.sort(key=lambda an: (an[0].rank, str(an[0].base)))
            self._written[monomial] = tuple((atom.base, n * atom.exponent) for atom, n in found)
        return self._written[monomial]

    def collected(self, a: Polynomial) -> ClosedForm:
        """A polynomial by parameter, written short."""
        by_parameter: dict[int, Polynomial] = {}
        fields = sum(self.symbol(name) * ONES for name in self.parameters if name in self.ring)
        for m, c in a.items():
            by_parameter.setdefault(m & fields, {})[m & ~fields] = c
        shared: dict[tuple[tuple[int, Coefficient], ...], dict[int, int]] = {}
        for key in sorted(by_parameter, key=lambda key: tuple(k for k, n in self._in_order(key))):
            coefficient = self.ring.tidy(by_parameter[key])
            if not coefficient:
                continue
            sign = 1 if coefficient[min(coefficient)] > 0 else -1
            told = tuple(sorted((m, sign * c) for m, c in coefficient.items()))
            shared.setdefault(told, {})[key] = sign
        return tuple(self._group(dict(told), members) for told, members in shared.items())

    def angles_in(self, forms: Iterable[ClosedForm]) -> dict[str, Expression]:
        """{C23: q2 + q3, ...} of the cosines and sines in closed forms."""
        used = {a for form in forms for group in form for g in (group, *group.inner) for e in (g.common, g.inside) for a in e.atoms}
        told = {}
        for angle in self.ring.angles.values():
            total = sum((Expression.symbol(f"q{j}") * n for j, n in angle.turn), angle.rest)
            for monomial in (angle.cos, angle.sin):
                (k,) = self.ring.powers(monomial)
                if (name := self.ring.atoms[k].base) in used:
                    told[str(name)] = total
        return told

    def _in_order(self, key: int) -> list[tuple[Rank, int]]:
        return sorted((self.ring.atoms[k].rank, n) for k, n in self.ring.powers(key).items())

    def _group(self, coefficient: Polynomial, members: dict[int, int]) -> Group:
        first = next(iter(members.values()))
        parameters = self.expression({key: first * sign for key, sign in members.items()}) if any(members) else ONE
        inner = self._factored(coefficient)
        if len(inner) == 1:
            (only,) = inner
            return Group(parameters, only.common * first, only.inside)
        common, content = self.ring.common(coefficient)
        sign = first * (1 if inner[0].common.ordered[0][1] > 0 else -1)
        rest = self._factored({m - common: _divided(sign * first * c, content) for m, c in coefficient.items()})
        return Group(parameters, self.expression({common: sign * content}), ONE, rest)

    def _factored(self, a: Polynomial) -> ClosedForm:
        """A polynomial in the shortest of four ways: all in one bracket, by rates, by what is no rate, by constants."""
        ways = [[a], *([*_parts(a, fields).values()] for fields in self._fields())]
        forms = [tuple(self._bracketed(part) for part in way) for way in ways]
        return min(forms, key=lambda form: sum(map(_factors_of, form)))

    def _fields(self) -> tuple[int, int, int]:
        """Bits of the rates, of everything else, and of the constants."""
        by_kind = {RATE: 0, CONSTANT: 0}
        for k, atom in enumerate(self.ring.atoms):
            kind = RATE if atom.rank in (RATE, DIRECTION) else CONSTANT
            if atom.rank in (RATE, DIRECTION, CONSTANT):
                by_kind[kind] |= ONES << (BITS * k)
        return by_kind[RATE], (1 << (BITS * len(self.ring.atoms))) - 1 - by_kind[RATE], by_kind[CONSTANT]

    def _bracketed(self, a: Polynomial) -> Group:
        """common * inside, with the first term inside positive."""
        if len(a) == 1:
            return Group(ONE, self.expression(a))
        common, content = self.ring.common(a)
        inside = self.expression({m - common: _divided(c, content) for m, c in a.items()})
        sign = 1 if inside.ordered[0][1] > 0 else -1
        return Group(ONE, self.expression({common: sign * content}), inside if sign > 0 else -inside)


def _parts(a: Polynomial, fields: int) -> dict[int, Polynomial]:
    """The terms by what their monomials have in some fields."""
    parts: dict[int, Polynomial] = {}
    for m, c in a.items():
        parts.setdefault(m & fields, {})[m] = c
    return parts


def _factors_of(group: Group) -> int:
    """Symbols of a group as it is written."""
    return sum(sum(abs(n) for _, n in m) + (abs(c) != 1) for e in (group.common, group.inside) for m, c in e.terms.items())


def _forward(turn: Turn, rest: Expression) -> tuple[Turn, Expression, int]:
    """An angle whose first joint is added, and the sign that its sine takes on by that."""
    return (turn, rest, 1) if turn[0][1] > 0 else (tuple((j, -n) for j, n in turn), -rest, -1)


def _whole(c: Fraction) -> Coefficient:
    """An int where it is one: several times faster."""
    return c.numerator if c.denominator == 1 else c


def _divided(c: Coefficient, by: Coefficient) -> Coefficient:
    return c // by if type(c) is int and type(by) is int and not c % by else _whole(Fraction(c) / by)
