"""Identities between the cosines and sines of the angles of a model, to shorten its coefficients.

Every S**2 is replaced by 1 - C**2 at once, so that S**2 + C**2 never remains. At the end `tidy`
applies these identities from left to right, if the result is shorter:

    1 - C**2 = S**2 ,     Ca Cb - Sa Sb = C(a + b) ,     Sa Cb + Ca Sb = S(a + b) ,

and the same for a - b. A sum or difference of angles is used only if it is itself an angle of the
model, as for joints with parallel axes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from itertools import combinations, product
from typing import Any

from symgen.derive.geometry import summed
from symgen.derive.graph import Angle
from symgen.description.expression import quarter_turns

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
            if whole := self._whole(a, b, way):
                yield Ca * Cb, Sa * Sb, -way, whole[0]
                yield Sa * Cb, Ca * Sb, way, whole[1]

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


def number(c: Fraction) -> Fraction | int:
    """Convert a fraction to an int if it is whole."""
    return c.numerator if c.denominator == 1 else c


def _ends(monomial: tuple[int, ...]) -> tuple[int, int]:
    """Return the indices of the first and the last variable in a monomial."""
    inside = [k for k, n in enumerate(monomial) if n]
    return inside[0], inside[-1]


def forward(angle: Angle) -> tuple[Angle, int]:
    """Change the sign of an angle if it starts with a minus, for instance -q1 - q2 to q1 + q2.

    Returns the angle and the sign, 1 or -1, by which its sine must be multiplied.
    """
    return (angle, 1) if angle.turn[0][1] > 0 else (-angle, -1)
