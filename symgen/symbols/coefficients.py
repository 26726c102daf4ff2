"""Short forms of the coefficients in a formula: shortened by identities, then factored.

Every S**2 is replaced by 1 - C**2 at once, so that S**2 + C**2 never remains. At the end `tidy`
applies these identities from left to right, if the result is shorter:

    1 - C**2 = S**2 ,     Ca Cb - Sa Sb = C(a + b) ,     Sa Cb + Ca Sb = S(a + b) ,

and similarly for a - b. A sum or difference of angles is used only if it is itself an angle of the
model, as for joints with parallel axes. `Factors` then writes a coefficient with as few symbols as
possible.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import combinations, product
from math import gcd, lcm
from typing import Any

import sympy

from symgen.derive.geometry import summed
from symgen.derive.graph import Angle
from symgen.description.expression import quarter_turns
from symgen.symbols import expressions
from symgen.symbols.expressions import Tree

Coefficient = Any  # of the ring of cosines, sines, constants and rates


class Identities:
    """The trigonometric identities between the cosines and sines that occur in coefficients.

    Parameters
    ----------
    ring : PolyRing
        Ring of the coefficients.
    pairs : mapping
        (cos, sin) of each angle, as generators of the ring.
    """

    def __init__(self, ring: Any, pairs: Mapping[Angle, tuple[Coefficient, Coefficient]]) -> None:
        self.ring, self.pairs, change = ring, pairs, ring.monomial_ldiv
        self._circles = [
            (S.LM.index(1), change(ring.zero_monom, (S**2).LM), change((C**2).LM, (S**2).LM))
            for C, S in pairs.values()
        ]
        self._rules = [
            (*_ends(first.LM), first.LM, second.LM, sign, value.LM, value.LC)
            for first, second, sign, value in self._sums()
        ]

    def reduced(self, c: Coefficient) -> Coefficient:
        """Replace every sin**2 in the coefficient c by 1 - cos**2 of the same angle."""
        c, times = c.copy(), self.ring.monomial_mul
        for k, less, other in self._circles:
            while squares := [m for m in c if m[k] > 1]:
                for m in squares:
                    value = c.pop(m)
                    c[times(m, less)] = c.get(times(m, less), 0) + value
                    c[times(m, other)] = c.get(times(m, other), 0) - value
        c.strip_zero()
        return c

    def tidy(self, c: Coefficient) -> Coefficient:
        """Shorten the coefficient c by identities such as cos a cos b - sin a sin b = cos(a + b).

        Pairs of terms that an identity turns into one term are replaced, until no such pair is
        left.
        """
        terms, times, over = dict(c), self.ring.monomial_mul, self.ring.monomial_div
        size = 0
        while size != len(terms):
            size = len(terms)
            for m in sorted(terms):
                for i, k, first, second, sign, becomes, factor in self._rules:
                    if not (m[i] and m[k] and m in terms) or (rest := over(m, first)) is None:
                        continue
                    if terms.get(other := times(rest, second)) == sign * terms[m]:
                        made, value = times(rest, becomes), factor * terms.pop(m)
                        del terms[other]
                        value += terms.pop(made, 0)
                        if value:
                            terms[made] = value
        return c.new(terms)

    def _sums(self) -> Iterable[tuple[Coefficient, Coefficient, int, Coefficient]]:
        """Yield identities of cosines and sines, first + sign*second = value, as four values.

        Each identity is a tuple (first, second, sign, value).
        """
        one = self.ring(1)
        for C, S in self.pairs.values():
            yield C**2, one, -1, -(S**2)
            yield C**2, S**2, 1, one
        for (a, b), way in product(combinations(self.pairs, 2), (1, -1)):
            (Ca, Sa), (Cb, Sb) = self.pairs[a], self.pairs[b]
            if combined := self._whole(a, b, way):
                yield Ca * Cb, Sa * Sb, -way, combined[0]
                yield Sa * Cb, Ca * Sb, way, combined[1]

    def _whole(self, a: Angle, b: Angle, way: int) -> tuple[Coefficient, Coefficient] | None:
        """Return cosine and sine of a + b (if `way` is 1) or of a - b (if `way` is -1).

        Return None if the sum or difference is no angle of the model.
        """
        turn = summed((*a.turn, *((j, way * n) for j, n in b.turn)))
        if not turn:
            return None
        angle, sign = forward(Angle(turn, a.offset + b.offset * way))
        quarters, rest = quarter_turns(angle.offset)
        angle = Angle(angle.turn, rest)
        if angle not in self.pairs:
            return None
        C, S = self.pairs[angle]
        c, s = ((C, S), (-S, C), (-C, -S), (S, -C))[quarters % 4]
        return c, sign * s


def whole(c: Fraction) -> Fraction | int:
    """Convert a fraction to an int if it is whole."""
    return c.numerator if c.denominator == 1 else c


def _ends(monomial: tuple[int, ...]) -> tuple[int, int]:
    """Return the indices of the first and the last variable in a monomial."""
    inside = [k for k, n in enumerate(monomial) if n]
    return inside[0], inside[-1]


def forward(angle: Angle) -> tuple[Angle, int]:
    """Change the sign of an angle that starts with a minus; for instance, -q1 - q2 becomes q1 + q2.

    Returns the angle and the sign, 1 or -1, by which its sine must be multiplied.
    """
    return (angle, 1) if angle.turn[0][1] > 0 else (-angle, -1)


Powers = tuple[int, ...]  # of the generators of a ring


class Factors:
    """Writer of coefficients (polynomials in cosines, lengths, ...) as short factored expressions.

    Parameters
    ----------
    ring : PolyRing
        Ring of the coefficients.
    shown : sequence
        Printed expression of each generator of the ring.
    fields : sequence
        Groups of generators; the terms of a coefficient may be collected by their powers.
    decimals : bool
        Whether numbers are written as decimals, because the robot file has decimals.
    """

    def __init__(
        self,
        ring: Any,
        shown: Sequence[Tree],
        fields: Sequence[Sequence[int]],
        *,
        decimals: bool = False,
    ) -> None:
        self.ring, self.shown, self.fields, self.decimals = ring, shown, fields, decimals
        self._labels = [*map(str, shown)]

    def terms(self, c: Coefficient, members: Sequence[Tree]) -> Sequence[Tree]:
        """Write the product of the coefficient c and a sum of parameters (or 1) in a short form.

        Returns its terms: several if the product is a plain sum, else one.
        """
        number, factors = self._shortest(c)
        factors = [*factors, *sympy.Mul.make_args(expressions.total(members))]
        factors = [x for x in factors if x != 1]
        if abs(number) == 1 and len(factors) == 1:
            return [
                x if number > 0 else expressions.negative(x)
                for x in sympy.Add.make_args(factors[0])
            ]
        return [self._product(number, factors)]

    def _product(self, c: Fraction, factors: Sequence[Tree]) -> Tree:
        """Multiply the number c by the factors; c is a decimal if the robot file has decimals."""
        if self.decimals and c.denominator > 1:
            factors, c = [expressions.product(abs(c), ()), *factors], Fraction(1 if c > 0 else -1)
        return expressions.product(c, factors)

    def _shortest(self, c: Coefficient) -> tuple[Fraction, list[Tree]]:
        """Write a coefficient with as few symbols as possible, as a number and a list of factors.

        All terms are in one bracket, or there is one bracket for each monomial in the rates, in the
        variables that are no rates, or in the constants.
        """
        terms = {m: c[m] for m in sorted(c, key=self._order)}
        ways = [[c], *([*self._parts(terms, fields)] for fields in self.fields)]
        best = min(ways, key=lambda way: sum(map(self._symbols, way)))
        if len(best) == 1:
            return self._bracketed(c)
        number, common, rest = self._split(c)
        if number == 1 and not any(common):
            return self._positive(number, [self._product(*self._bracketed(x)) for x in best])
        number_of_rest, factors = self._shortest(rest)
        return number * number_of_rest, [*self._powers(common), *factors]

    def _symbols(self, c: Coefficient) -> int:
        """Count the printed symbols of a coefficient that is written as a product with one bracket."""
        number, shared = _content(c), sum(map(min, zip(*c, strict=True)))
        inside = sum(sum(m) - shared + (abs(n) != number) for m, n in c.items())
        return int(inside + shared + (number != 1))

    def _positive(self, number: Fraction, terms: Sequence[Tree]) -> tuple[Fraction, list[Tree]]:
        """Sum the terms, with the signs chosen so that the first term is positive.

        Returns the number before the sum, negated if the signs were changed, and a list with the
        sum.
        """
        if expressions.is_negative(terms[0]):
            number, terms = -number, [*map(expressions.negative, terms)]
        return number, [expressions.total(terms)]

    def _bracketed(self, c: Coefficient) -> tuple[Fraction, list[Tree]]:
        """Write a coefficient as a number and a list of factors, the last one a sum in brackets.

        The first term in the bracket is positive.
        """
        number, common, rest = self._split(c)
        terms = [
            self._product(Fraction(rest[m]), self._powers(m)) for m in sorted(rest, key=self._order)
        ]
        number, inside = self._positive(number, terms)
        return number, [*self._powers(common), *inside]

    def _split(self, c: Coefficient) -> tuple[Fraction, Powers, Coefficient]:
        """Divide a coefficient by the greatest number and monomial that divide every term.

        Returns this number, the monomial and the quotient.
        """
        number, common = _content(c), tuple(map(min, zip(*c, strict=True)))
        over = self.ring.monomial_ldiv
        rest = {over(m, common): whole(Fraction(n) / number) for m, n in c.items()}
        return number, common, c.new(rest)

    def _parts(self, terms: Mapping[Powers, Any], fields: Sequence[int]) -> Iterable[Coefficient]:
        """Group the terms of a coefficient by the powers of the variables `fields` in each term.

        Each group is a coefficient too.
        """
        parts: dict[Powers, dict[Powers, Any]] = {}
        for m, value in terms.items():
            parts.setdefault(tuple(m[k] for k in fields), {})[m] = value
        return map(self.ring.zero.new, parts.values())

    def _order(self, m: Powers) -> tuple[Any, ...]:
        """Return the sort key of a monomial for printing: highest degree first, then by name."""
        return -sum(m), [(self._labels[k], -n) for k, n in enumerate(m) if n]

    def _powers(self, m: Powers) -> list[Tree]:
        """List the printed factors of a monomial, for instance D3**2 and C2."""
        return [
            x if n == 1 else sympy.Pow(x.as_base_exp()[0], n * x.as_base_exp()[1], evaluate=False)
            for x, n in zip(self.shown, m, strict=True)
            if n
        ]


def _content(c: Coefficient) -> Fraction:
    """Return the number that can be factored out of all terms of a coefficient.

    The result is the greatest number that divides all terms. Different decimals have no common
    factor: 0.5 x + 0.8636 y is easier to read than 0.0004 (1250 x + 2159 y).
    """
    sizes = {abs(n) for n in c.values()}
    if len(sizes) > 1 and any(8 % n.denominator for n in sizes):
        return Fraction(1)
    return Fraction(
        gcd(*(n.numerator for n in c.values())), lcm(*(n.denominator for n in c.values()))
    )
