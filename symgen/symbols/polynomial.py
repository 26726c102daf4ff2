"""Polynomials over the symbols of a model, the cosines and sines of its angles among them.

A polynomial is {monomial: coefficient}; a monomial is one whole number with eight bits for the power of each atom, so that a product of
monomials is a sum of numbers. S**2 becomes 1 - C**2 at once, hence S**2 + C**2 never stays. `tidy` writes the other way whatever gets shorter by it:

    1 - C**2 = S**2 ,     Ca Cb - Sa Sb = C(a + b) ,     Sa Cb + Ca Sb = S(a + b) ,     and the same with a - b ,

for the sums and differences that are angles of the model themselves: those of joints with parallel axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations, product
from math import gcd, lcm

from symgen.derive.scalar import Turn
from symgen.description.expression import Call, Expression, quarter_turns
from symgen.errors import SymgenError

BITS = 8
ONES, SQUARES = (1 << BITS) - 1, (1 << BITS) - 2  # bits of any power, of a power above 1
HIGHEST = 127  # power of an atom in a polynomial: the sum of two powers fits its bits
Coefficient = int | Fraction
Polynomial = dict[int, Coefficient]
Rank = tuple[int, ...]  # where an atom stands in a product


@dataclass(frozen=True)
class Atom:
    """A factor of monomials: `base` to the power `exponent`, 1 or -1; `rank` orders the factors of a product."""

    base: str | Call
    exponent: int
    rank: Rank


@dataclass(frozen=True)
class Angle:
    """sum n_j q_j + rest, with the monomials of its cosine and sine."""

    turn: Turn
    rest: Expression
    cos: int
    sin: int


@dataclass(frozen=True)
class Rule:
    """product + sign partner = function, a sine or cosine, negative where its sign is; `fields` hold the powers of the two factors of the product."""

    fields: tuple[int, int]
    product: int
    partner: int
    sign: int
    function: int


class Ring:
    """The atoms of one model, and arithmetic of polynomials over them. Raises SymgenError where a polynomial gets more than `limit` terms."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.atoms: list[Atom] = []
        self.angles: dict[tuple[Turn, Expression], Angle] = {}
        self._index: dict[tuple[str | Call, int], int] = {}
        self._powers: dict[int, dict[int, int]] = {}
        self._watched = 0  # bits that are set in no reduced monomial
        self._rules: list[Rule] | None = None

    # --- atoms ---

    def atom(self, base: str | Call, rank: Rank, exponent: int = 1) -> int:
        """The monomial of an atom."""
        key = (base, exponent)
        if key not in self._index:
            self._watched |= (HIGHEST + 1) << (BITS * len(self.atoms))
            self._index[key] = len(self.atoms)
            self.atoms.append(Atom(base, exponent, rank))
        return 1 << (BITS * self._index[key])

    def angle(self, turn: Turn, rest: Expression, label: str) -> Angle:
        """The angle turn q + rest, whose cosine is called C + label."""
        key = (turn, rest)
        if key not in self.angles:
            rank = (3, *(j for j, _ in turn), *(n for _, n in turn))
            c, s = self.atom(f"C{label}", (*rank, 0)), self.atom(f"S{label}", (*rank, 1))
            self._watched |= s * SQUARES
            self.angles[key] = Angle(turn, rest, c, s)
            self._rules = None
        return self.angles[key]

    def powers(self, monomial: int) -> dict[int, int]:
        """{number of an atom: its power}."""
        if monomial not in self._powers:
            found, rest = {}, monomial
            while rest:
                k = ((rest & -rest).bit_length() - 1) // BITS
                found[k] = (rest >> (BITS * k)) & ONES
                rest &= ~(ONES << (BITS * k))
            self._powers[monomial] = found
        return self._powers[monomial]

    def common(self, a: Polynomial) -> tuple[int, Coefficient]:
        """The greatest monomial and the greatest positive number that divide every term."""
        shared: dict[int, int] | None = None
        for m in a:
            powers = self.powers(m)
            shared = dict(powers) if shared is None else {k: min(n, powers[k]) for k, n in shared.items() if k in powers}
            if not shared:
                break
        if all(type(c) is int for c in a.values()):
            return self.monomial(shared or {}), gcd(*a.values())  # type: ignore[arg-type]
        numbers = [Fraction(c) for c in a.values()]
        return self.monomial(shared or {}), Fraction(gcd(*(c.numerator for c in numbers)), lcm(*(c.denominator for c in numbers)))

    def monomial(self, powers: Mapping[int, int]) -> int:
        """The monomial with these powers, by number of the atom."""
        return sum(n << (BITS * k) for k, n in powers.items())

    def __contains__(self, base: str) -> bool:
        return (base, 1) in self._index

    # --- arithmetic ---

    def add(self, a: Polynomial, b: Polynomial, sign: int = 1) -> Polynomial:
        """a + sign b."""
        total = dict(a)
        for m, c in b.items():
            _put(total, m, sign * c)
        return self._checked(total)

    def mul(self, a: Polynomial, b: Polynomial) -> Polynomial:
        if len(a) * len(b) > 100 * self.limit:
            raise self._too_long(len(a) * len(b))
        total: Polynomial = {}
        for m, c in a.items():
            for n, d in b.items():
                total[m + n] = total.get(m + n, 0) + c * d
        return self._checked(self._reduced({m: c for m, c in total.items() if c}))

    def scaled(self, a: Polynomial, c: Coefficient) -> Polynomial:
        return {m: c * d for m, d in a.items()} if c else {}

    def derivative(self, a: Polynomial, q: str, j: int) -> Polynomial:
        """da/dq_j; `q` is the name of the position of joint j."""
        total: Polynomial = {}
        slides = 1 << (BITS * self._index[q, 1]) if (q, 1) in self._index else None
        turns = [(angle, n) for angle in self.angles.values() for i, n in angle.turn if i == j]
        for m, c in a.items():
            if slides and (n := self._power(m, slides)):
                _put(total, m - slides, n * c)
            for angle, rate in turns:
                if n := self._power(m, angle.cos):
                    _put(total, m - angle.cos + angle.sin, -n * rate * c)
                if n := self._power(m, angle.sin):
                    _put(total, m - angle.sin + angle.cos, n * rate * c)
        return self._reduced(total)

    def determinant(self, rows: list[list[Polynomial]]) -> Polynomial:
        """Laplace's expansion by rows, those with most zeros first; minors are kept."""
        size = len(rows)
        order = sorted(range(size), key=lambda k: sum(map(bool, rows[k])))
        odd = sum(order[i] > order[k] for i, k in combinations(range(size), 2)) % 2
        minors: dict[tuple[int, ...], Polynomial] = {(): {0: 1}}
        for depth in range(size - 1, -1, -1):
            row = rows[order[depth]]
            wider: dict[tuple[int, ...], Polynomial] = {}
            for columns in combinations(range(size), size - depth):
                total: Polynomial = {}
                for k, column in enumerate(columns):
                    minor = minors[columns[:k] + columns[k + 1 :]]
                    if row[column] and minor:
                        total = self.add(total, self.mul(row[column], minor), (-1) ** k)
                wider[columns] = total
            minors = wider
        return self.scaled(minors[tuple(range(size))], -1 if odd else 1)

    def _power(self, m: int, unit: int) -> int:
        return (m // unit) & ONES

    def _reduced(self, a: Polynomial) -> Polynomial:
        """Without squares of sines."""
        pending = [m for m in a if m & self._watched]
        while pending:
            m = pending.pop()
            c = a.pop(m, 0)
            if not c:
                continue
            for angle in self.angles.values():
                if m & (angle.sin * SQUARES):
                    break
            else:
                raise SymgenError(f"a power above {HIGHEST}; introduce a constant for it in the robot file")
            once = m - 2 * angle.sin
            for n, d in ((once, c), (once + 2 * angle.cos, -c)):
                _put(a, n, d)
                if n & self._watched:
                    pending.append(n)
        return a

    def _checked(self, a: Polynomial) -> Polynomial:
        if len(a) > self.limit:
            raise self._too_long(len(a))
        return a

    def _too_long(self, terms: int) -> TooManyTermsError:
        return TooManyTermsError(f"more than {self.limit} terms")

    # --- shorter ways to write ---

    def tidy(self, a: Polynomial) -> Polynomial:
        """The same function in fewer terms: pairs of terms are put together until no pair is left."""
        a = dict(a)
        changed = True
        while changed:
            changed = False
            for m in sorted(a):
                if m in a and self._merged(a, m):
                    changed = True
        return a

    def _merged(self, a: Polynomial, m: int) -> bool:
        """Whether the term m of `a` was put together with another one."""
        c = a[m]
        for angle in self.angles.values():
            if m & (angle.cos * SQUARES):
                rest = m - 2 * angle.cos
                if a.get(rest) == -c:
                    del a[m], a[rest]
                    _put(a, rest + 2 * angle.sin, -c)
                    return True
                if a.get(rest + 2 * angle.sin) == c:
                    del a[m], a[rest + 2 * angle.sin]
                    _put(a, rest, c)
                    return True
        for rule in self._sum_rules():
            if m & rule.fields[0] and m & rule.fields[1]:
                other = m - rule.product + rule.partner
                if a.get(other) == rule.sign * c:
                    del a[m], a[other]
                    _put(a, m - rule.product + abs(rule.function), c if rule.function > 0 else -c)
                    return True
        return False

    def _sum_rules(self) -> list[Rule]:
        if self._rules is None:
            self._rules = []
            for (a, b), way in product(combinations(self.angles.values(), 2), (1, -1)):
                if (single := self._known(a, b, way)) is not None:
                    for first, second, sign, function in (
                        ((a.cos, b.cos), a.sin + b.sin, -way, single[0]),
                        ((a.sin, b.cos), a.cos + b.sin, way, single[1]),
                    ):
                        fields = (first[0] * ONES, first[1] * ONES)
                        self._rules.append(Rule(fields, sum(first), second, sign, function))
        return self._rules

    def _known(self, a: Angle, b: Angle, way: int) -> tuple[int, int] | None:
        """Signed monomials of cos and sin of a + way b, where that is an angle of the model."""
        total: dict[int, int] = dict(a.turn)
        for j, n in b.turn:
            total[j] = total.get(j, 0) + way * n
        turn: Turn = tuple((j, n) for j, n in sorted(total.items()) if n)
        if not turn:
            return None
        forward = turn[0][1] > 0
        rest = a.rest + b.rest * way
        if not forward:
            turn, rest = tuple((j, -n) for j, n in turn), -rest
        quarters, rest = quarter_turns(rest)
        angle = self.angles.get((turn, rest))
        if angle is None:
            return None
        c, s = ((angle.cos, angle.sin), (-angle.sin, angle.cos), (-angle.cos, -angle.sin), (angle.sin, -angle.cos))[quarters % 4]
        return c, s if forward else -s


class TooManyTermsError(SymgenError):
    """A polynomial with more terms than the limit."""


def _put(a: Polynomial, m: int, c: Coefficient) -> None:
    value = a.get(m, 0) + c
    if value:
        a[m] = value
    else:
        a.pop(m, None)
