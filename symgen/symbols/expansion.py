"""Closed form of a model: its expression graph is multiplied out, then collected by parameter.

    entry = sum_k common_k inside_k chi_k

Here chi_k is a parameter, common_k the factors that all terms of its coefficient share, inside_k
the bracket that is left. The polynomials are SymPy's sparse ones, in the parameters. Their
coefficients are polynomials of a ring K in cosines and sines, constants, positions of prismatic
joints, and rates. Numbers of K are ints if they are whole, else fractions. SymPy's rings accept
both, and ints are far faster than the rationals QQ.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from decimal import Context, Decimal
from fractions import Fraction
from functools import cache
from itertools import combinations
from math import prod
from typing import Any

import sympy
from sympy.polys.orderings import lex
from sympy.polys.rings import PolyRing

from symgen.derive.algebra import GraphAlgebra
from symgen.derive.constants import numbered, numbers_of
from symgen.derive.graph import Angle, Node, Scalar, reachable
from symgen.description.expression import FUNCTIONS, PI, Expression, call
from symgen.errors import SymgenError
from symgen.symbols import expressions
from symgen.symbols.coefficients import Coefficient, Factors, Identities, forward, whole
from symgen.symbols.expressions import Tree

Polynomial = Any  # of the ring of the parameters
CONSTANT, SLIDE, TURN, RATE, DIRECTION = 1, 2, 3, 4, 5  # ranks: the order of factors in a product
GUARDED, NOISE = 50, Fraction(1, 10**30)  # digits of a decimal inside; what rounding leaves of 1


class TooManyTermsError(SymgenError):
    """Error raised if a polynomial has more terms than the limit."""


class Expansion:
    """The values of an expression graph, multiplied out as polynomials in the parameters.

    Parameters
    ----------
    algebra : GraphAlgebra
        The algebra that made the graph, with the angles of the graph.
    parameters : sequence of str
        Symbols by which the entries are collected, in their order.
    outputs : sequence
        Values of the graph whose polynomials are needed.
    limit : int
        Largest number of terms of a polynomial. TooManyTermsError is raised if a polynomial has
        more.
    decimals : bool
        Whether functions of numbers alone, such as sin(1.571), become decimals. A printed number
        then has at most DIGITS digits.
    """

    def __init__(
        self,
        algebra: GraphAlgebra,
        parameters: Sequence[str],
        outputs: Sequence[Scalar | int],
        limit: int,
        *,
        decimals: bool = False,
    ) -> None:
        self.algebra, self.limit, self.decimals = algebra, limit, decimals
        self.names = self._names({*parameters, *algebra.robot.constants})
        ranks: dict[Any, tuple[int | Fraction, ...]] = {
            x: (TURN, *(j for j, _ in turn), *(n for _, n in turn), k)
            for (turn, _), names in self.names.items()
            for k, x in enumerate(names)
        }
        nodes = reachable(outputs)
        for node in nodes:
            if str(node.value) not in parameters:
                for x, rank in self._generators(node):
                    ranks.setdefault(x, (rank,))
        shown: list[Tree] = sorted(ranks, key=lambda x: (ranks[x], str(x)))
        self.K = PolyRing([sympy.Dummy() for _ in shown], sympy.ZZ, lex)
        self.generator = dict(zip(shown, self.K.gens, strict=True))
        kinds = [ranks[x][0] for x in shown]
        rates, others, constants = (
            [k for k, kind in enumerate(kinds) if kind in kept]
            for kept in ((RATE, DIRECTION), (CONSTANT, SLIDE, TURN), (CONSTANT,))
        )
        self.shown = shown
        decimals = decimals or bool(numbers_of(numbered(algebra.robot)))
        self.factors = Factors(self.K, shown, (rates, others, constants), decimals=decimals)
        self.identities = Identities(
            self.K,
            {a: (self.generator[C], self.generator[S]) for a, (C, S) in self.names.items()},
        )
        used = {str(node.value) for node in nodes if node.op == "sym"}
        own = [name for name in parameters if name in used]
        self.ring = PolyRing([expressions.symbol(name) for name in own], self.K.to_domain(), lex)
        self.parameters = dict(zip(own, self.ring.gens, strict=True))
        self._value: dict[int, Polynomial] = {}
        for node in nodes:
            self._value[node.index] = self._node(node)

    # --- generators ---

    def _names(self, taken: set[str]) -> dict[Angle, tuple[Tree, Tree]]:
        """Name the cosine and the sine of every angle of the graph, for instance C23 and S23.

        A name that a parameter or a constant of the robot already has gets an underscore.
        """
        names: dict[Angle, tuple[Tree, Tree]] = {}
        for node in self.algebra.graph.nodes:
            if not isinstance(node.value, Angle):
                continue
            if node.value.turn:
                C, S = (f"{letter}{str(node.name)[1:]}" for letter in "CS")
                while {C, S} & taken:
                    C, S = f"{C}_", f"{S}_"
                angle, _ = forward(node.value)
                names.setdefault(angle, (expressions.symbol(C), expressions.symbol(S)))
        return names

    def _generators(self, node: Node) -> Iterable[tuple[Tree, int]]:
        """Yield the symbols and functions of a graph node, each with a number for its order in
        printed products.

        Constants are printed first, then positions of prismatic joints, cosines and sines, rates.
        """
        name = str(node.value)
        match node.op:
            case "sym":
                stem, own = name.rstrip("0123456789_"), name in self.algebra.robot.constants
                is_rate = stem in ("QP", "QDP", "G") and not own
                if name == "pi" and self.decimals:
                    return
                yield (
                    expressions.symbol(name),
                    SLIDE if stem == "q" else RATE if is_rate else CONSTANT,
                )
            case "cos" | "sin" | "sqrt" if node.value is not None:
                for m in self._constant(node).terms:
                    for a, n in m:
                        yield expressions.power(a, 1 if n > 0 else -1), CONSTANT
            case "inv":
                yield (node.op, node.index), CONSTANT if node.fixed else RATE
            case op if op in ("pos", *FUNCTIONS):
                yield (node.op, node.index), DIRECTION

    def _constant(self, node: Node) -> Expression:
        """Return the constant value of a node: a square root, or a cosine or sine of a fixed angle.

        The result is zero if the angle depends on joint positions.
        """
        value: Expression = node.value if node.op == "sqrt" else Expression()
        if node.op != "sqrt" and not node.value.turn:
            value = call(node.op, node.value.offset)
        return expressions.rounded(value, GUARDED) if self.decimals else value

    def _node(self, node: Node) -> Polynomial:
        x = [self.of(s) for s in node.operands]
        match node.op:
            case "sym":
                name = str(node.value)
                if name == "pi" and self.decimals:
                    return self._constants(expressions.rounded(PI, GUARDED))
                return self.parameters.get(name) or self._lifted(
                    self.generator[expressions.symbol(name)]
                )
            case "const":
                return self._lifted(self.K.one.mul_ground(whole(node.value)))
            case "add":
                return self.checked(x[0] + x[1])
            case "mul":
                return self.mul(x[0], x[1])
            case "cos" | "sin" if node.value is not None and node.value.turn:
                angle, sign = forward(node.value)
                C, S = self.identities.pairs[angle]
                return self._lifted(C if node.op == "cos" else sign * S)
            case "cos" | "sin" | "sqrt" if node.value is not None:
                return self._constants(self._constant(node))
            case "inv" if self.decimals and (c := self._number(x[0])):
                return self._lifted(self.K.one.mul_ground(whole(shortened(1 / c, GUARDED))))
        inside, made = self.written(x[0]), self.generator[node.op, node.index]
        k = self.K.gens.index(made)
        if node.op == "inv":
            self.shown[k] = sympy.Pow(inside, -1, evaluate=False)
        elif node.op in FUNCTIONS:
            operands = [inside, *map(self.written, x[1:])]
            self.shown[k] = expressions.function(node.op, operands)
        else:  # max(x, 0)
            self.shown[k] = sympy.Abs(inside, evaluate=False)
            return self.halved(self._lifted(made) + x[0])
        return self._lifted(made)

    def _lifted(self, c: Coefficient) -> Polynomial:
        return self.ring.ground_new(c)

    def _constants(self, e: Expression) -> Polynomial:
        return self._lifted(
            sum(
                prod(
                    (
                        self.generator[expressions.power(a, 1 if n > 0 else -1)] ** abs(n)
                        for a, n in m
                    ),
                    start=self.K.one.mul_ground(whole(c)),
                )
                for m, c in e.terms.items()
            )
        )

    def _number(self, a: Polynomial) -> Fraction:
        """Return the value of a polynomial that is a number, else 0."""
        c = a.get(self.ring.zero_monom, {}) if len(a) == 1 else {}
        return Fraction(c.get(self.K.zero_monom, 0)) if len(c) == 1 else Fraction(0)

    # --- arithmetic ---

    def of(self, x: Scalar | int) -> Polynomial:
        """Return a value of the expression graph as a polynomial in the parameters."""
        value = self.ring(x) if isinstance(x, int) else self._value[x.node.index]
        return value if isinstance(x, int) or x.sign > 0 else -value

    def mul(self, a: Polynomial, b: Polynomial) -> Polynomial:
        if (terms := length(a) * length(b)) > 100 * self.limit:
            raise TooManyTermsError(f"more than {self.limit} terms")
        if not terms:
            return self.ring(0)
        made = self._each(a * b, self.identities.reduced)
        return self.checked(self._shortened(made, GUARDED) if self.decimals else made)

    def checked(self, a: Polynomial) -> Polynomial:
        if length(a) > self.limit:
            raise TooManyTermsError(f"more than {self.limit} terms")
        return a

    def _each(self, a: Polynomial, of: Any) -> Polynomial:
        return self.ring.from_dict({m: of(c) for m, c in a.items()})

    def _shortened(self, a: Polynomial, digits: int) -> Polynomial:
        """Round the numbers of a polynomial to `digits` digits, and remove terms that are only
        rounding errors.
        """
        largest = max((abs(n) for c in a.values() for n in c.values()), default=0)
        kept = {
            m: c.new(
                {k: whole(shortened(n, digits)) for k, n in c.items() if abs(n) > NOISE * largest}
            )
            for m, c in a.items()
        }
        return self.ring.from_dict({m: c for m, c in kept.items() if c})

    def halved(self, a: Polynomial) -> Polynomial:
        return self._each(a, lambda c: c.new({m: whole(Fraction(n) / 2) for m, n in c.items()}))

    def determinant(self, rows: Sequence[Sequence[Polynomial]]) -> Polynomial:
        """Compute the determinant of a square matrix of polynomials by Laplace's expansion.

        Rows with most zeros are expanded first, and every minor is computed only once.
        """
        size = len(rows)
        order = sorted(range(size), key=lambda k: sum(map(bool, rows[k])))
        odd = sum(order[i] > order[k] for i, k in combinations(range(size), 2)) % 2

        @cache
        def minor(depth: int, columns: tuple[int, ...]) -> Polynomial:
            value = self.ring(0 if columns else 1)
            for k, column in enumerate(columns):
                if entry := rows[order[depth]][column]:
                    rest = minor(depth + 1, columns[:k] + columns[k + 1 :])
                    value = self.checked(value + (-1) ** k * self.mul(entry, rest))
            return value

        return (-1) ** odd * minor(0, tuple(range(size)))

    def tidied(self, a: Polynomial) -> Polynomial:
        """Shorten the coefficients of a polynomial, for instance by sin**2 + cos**2 = 1."""
        return self._each(a, self.identities.tidy)

    # --- as expressions ---

    def written(self, a: Polynomial) -> Tree:
        """Write a polynomial as a short expression: a factored coefficient times each parameter.

        Parameters that have the same coefficient, up to the sign, share one bracket.
        """
        if self.decimals:
            a = self._shortened(a, expressions.DIGITS)
        shared: dict[Coefficient, list[Tree]] = {}
        signs: dict[Coefficient, int] = {}
        for monomial in sorted(a, key=lambda m: (any(m), [-n for n in m])):
            if c := self.identities.tidy(a[monomial]):
                sign = 1 if c.LC > 0 else -1
                names = [x**n for x, n in zip(self.ring.symbols, monomial, strict=True)]
                own = signs.setdefault(sign * c, sign)
                shared.setdefault(sign * c, []).append(
                    expressions.product(Fraction(sign * own), names)
                )
        return expressions.total(
            x for c, members in shared.items() for x in self.factors.terms(signs[c] * c, members)
        )


def shortened(c: Fraction | int, digits: int) -> Fraction:
    """Round a fraction to a decimal with `digits` significant digits."""
    decimal = Context(prec=digits).divide(Decimal(c.numerator), Decimal(c.denominator))
    return Fraction(decimal)


def length(a: Polynomial) -> int:
    """Count the terms of a polynomial that is multiplied out."""
    return sum(map(len, a.values()))
