"""Values with their time derivatives, over any algebra: x, xd, xdd along a motion with constant
joint rates.

A recursion that gives a residual r(q) over an algebra gives r, J qd and Jd qd over its jets: the
Jacobian column of joint k is the
derivative along the unit rate of joint k, and Jd qd the second derivative along qd.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from symgen.derive.scalar import Algebra, Scalar, Turn, add, mul, sub, turned
from symgen.description.expression import Expression


class Jet:
    """(x, xd, xdd); structural zeros stay structural."""

    __slots__ = ("x", "xd", "xdd")

    def __init__(self, x: Scalar, xd: Scalar = 0, xdd: Scalar = 0) -> None:
        self.x, self.xd, self.xdd = x, xd, xdd

    def __add__(self, other: Any) -> Jet:
        o = jet(other)
        return Jet(add(self.x, o.x), add(self.xd, o.xd), add(self.xdd, o.xdd))

    def __sub__(self, other: Any) -> Jet:
        o = jet(other)
        return Jet(sub(self.x, o.x), sub(self.xd, o.xd), sub(self.xdd, o.xdd))

    def __rsub__(self, other: Any) -> Jet:
        return jet(other) - self

    def __mul__(self, other: Any) -> Jet:
        o = jet(other)
        cross = mul(self.xd, o.xd)
        return Jet(
            mul(self.x, o.x),
            add(mul(self.xd, o.x), mul(self.x, o.xd)),
            add(add(mul(self.xdd, o.x), mul(self.x, o.xdd)), add(cross, cross)),
        )

    def __neg__(self) -> Jet:
        return Jet(-self.x, -self.xd, -self.xdd)

    __radd__, __rmul__ = __add__, __mul__


def jet(value: Scalar) -> Jet:
    return value if isinstance(value, Jet) else Jet(value)


class JetAlgebra:
    """Positions over the algebra `inner` along the joint rates `rate`; other joints stand still."""

    def __init__(self, inner: Algebra, rate: Mapping[int, Scalar]) -> None:
        self.inner, self._rate = inner, rate

    def constant(self, e: Expression) -> Scalar:
        value = self.inner.constant(e)
        return value if type(value) is int else Jet(value)

    def cos_sin(self, turn: Turn, offset: Expression) -> tuple[Scalar, Scalar]:
        c, s = self.inner.cos_sin(turn, offset)
        rate = turned(self.inner, turn, self._rate)
        if type(rate) is int and rate == 0:
            return Jet(c), Jet(s)
        cd, sd = -mul(s, rate), mul(c, rate)
        return Jet(c, cd, -mul(sd, rate)), Jet(s, sd, mul(cd, rate))

    def q(self, j: int) -> Jet:
        return Jet(self.inner.q(j), self._rate.get(j, 0))

    def name(self, value: Scalar, name: str) -> Scalar:
        if isinstance(value, Jet):
            self.inner.name(value.x, name)
        return value

    def section(self, title: str) -> None:
        self.inner.section(title)
