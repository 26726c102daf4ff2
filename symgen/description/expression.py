"""Exact symbolic expressions: polynomials in symbols and functions, with rational coefficients.

`grammar.parse` reads them from text. An expression is

    e = sum_k c_k prod_i atom_i**n_ki ,

where each atom is a symbol, a number as it is written, or cos(e), sin(e), sqrt(e), inv(e), in laws
also sign(e), exp(e), tanh(e) and pow(e, f). Two equal expressions are equal objects. Decimals are
exact (0.225 = 9/40). Quarter turns are removed from cos and sin at once. Square roots of rationals
become products of sqrt(prime) to the first power.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cached_property, lru_cache
from heapq import heappop, heappush
from typing import Any, NamedTuple, TypeAlias

from symgen.errors import DescriptionError
from symgen.time_limit import require_time

LONGEST_SLOPE = 2000  # terms of a derivative
MOST_PRODUCTS = 50_000  # of terms, where two expressions are multiplied
LARGEST_PRIME = 1000  # of the trial division under square roots
PLACES, LARGEST_RATIO = 40, 360  # of a decimal; denominator of a ratio written as one

Atom: TypeAlias = "str | Number | Call"
Monomial = tuple[tuple[Atom, int], ...]


@dataclass(frozen=True)
class Call:
    """A function of an expression, such as cos(q1 + q2), that is a factor in the terms of a
    polynomial.

    The functions are cos, sin, sqrt, sign, exp, tanh, inv (1/argument) and pow
    (argument**exponent).
    """

    function: str
    argument: Expression
    exponent: Expression | None = None

    @cached_property
    def text(self) -> str:
        if self.exponent is not None:
            return f"({self.argument})**({self.exponent})"
        return (
            f"1/({self.argument})"
            if self.function == "inv"
            else f"{self.function}({self.argument})"
        )

    @property
    def operands(self) -> tuple[Expression, ...]:
        return (self.argument,) if self.exponent is None else (self.argument, self.exponent)

    def of(self, *operands: Expression) -> Expression:
        """Return the same function of other arguments, for instance cos(q2) for cos(q1)."""
        if self.exponent is not None:
            return power(*operands)
        return call(self.function, *operands)

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Number:
    """A positive rational number that is printed as in the robot file: 0.4318**2, not 0.18645124.

    See `derive.constants`.
    """

    value: Fraction

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:  # of a fraction: slow
        return hash(self.value)

    @cached_property
    def text(self) -> str:
        text = decimal(self.value, fractions=False)
        return f"({text})" if "/" in text else text

    def __str__(self) -> str:
        return self.text


class Expression:
    """A polynomial with rational coefficients in symbols and functions such as cos(q1).

    Expressions are immutable and hashable, and compare by value.
    """

    __slots__ = ("_hash", "terms")

    def __init__(self, terms: Mapping[Monomial, Fraction] | None = None) -> None:
        self.terms: dict[Monomial, Fraction] = {m: c for m, c in (terms or {}).items() if c}
        self._hash: int | None = None

    @staticmethod
    def number(value: int | Fraction | str) -> Expression:
        return Expression({(): Fraction(value)})

    @staticmethod
    def symbol(name: str) -> Expression:
        return Expression({((name, 1),): Fraction(1)})

    @staticmethod
    def of(value: Expression | int | Fraction) -> Expression:
        return value if isinstance(value, Expression) else Expression.number(value)

    def __add__(self, other: Expression | int | Fraction) -> Expression:
        terms = dict(self.terms)
        for m, c in Expression.of(other).terms.items():
            terms[m] = terms.get(m, Fraction(0)) + c
        return Expression(terms)

    def __neg__(self) -> Expression:
        return Expression({m: -c for m, c in self.terms.items()})

    def __sub__(self, other: Expression | int | Fraction) -> Expression:
        return self + (-Expression.of(other))

    def __mul__(self, other: Expression | int | Fraction) -> Expression:
        require_time()
        terms: dict[Monomial, Fraction] = {}
        other = Expression.of(other)
        if len(self.terms) * len(other.terms) > MOST_PRODUCTS:
            raise DescriptionError(
                f"the product of expressions with {len(self.terms)} and {len(other.terms)} terms has more "
                f"than {MOST_PRODUCTS:,} terms; replace a long sum by one constant"
            )
        for m1, c1 in self.terms.items():
            for m2, c2 in other.terms.items():
                m, c = _with_simple_roots(_product(m1, m2))
                terms[m] = terms.get(m, Fraction(0)) + c * c1 * c2
        return Expression(terms)

    __radd__, __rmul__ = __add__, __mul__

    def __rsub__(self, other: Expression | int | Fraction) -> Expression:
        return Expression.of(other) - self

    def __pow__(self, exponent: int) -> Expression:
        if exponent < 0:
            return self.inverse() ** -exponent
        if len(self.terms) == 1:
            ((m, c),) = self.terms.items()
            m, root = _with_simple_roots(tuple((a, n * exponent) for a, n in m) if exponent else ())
            return Expression({m: c**exponent * root})
        result = Expression.number(1)
        for _ in range(exponent):
            result = result * self
        return result

    def inverse(self) -> Expression:
        """Return 1/e for this expression e: factor by factor for a product, inv(e) for a sum."""
        if not self.terms:
            raise ZeroDivisionError
        if len(self.terms) == 1:
            ((m, c),) = self.terms.items()
            m, root = _with_simple_roots(tuple((a, -n) for a, n in m))
            return Expression({m: root / c})
        return _atom(Call("inv", self))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Expression) and self.terms == other.terms

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the terms only, because hash values of strings differ between processes."""
        return Expression, (self.terms,)

    def __hash__(self) -> int:
        if self._hash is None:
            self._hash = hash(frozenset(self.terms.items()))
        return self._hash

    def __bool__(self) -> bool:
        return bool(self.terms)

    @property
    def constant(self) -> Fraction | None:
        """Value of the expression as a rational if it is a plain number, else None."""
        if not self.terms:
            return Fraction(0)
        return self.terms.get(()) if len(self.terms) == 1 else None

    @property
    def ordered(self) -> list[tuple[Monomial, Fraction]]:
        """Terms in the order in which they are printed: highest degree first."""
        return sorted(self.terms.items(), key=lambda mc: _order(mc[0]))

    @property
    def atoms(self) -> set[str | Number | Call]:
        return {a for m in self.terms for a, _ in m}

    @property
    def symbols(self) -> set[str]:
        """Names of all symbols, including symbols inside functions; `pi` is not a symbol."""
        names: set[str] = set()
        for a in self.atoms:
            for e in a.operands if isinstance(a, Call) else ():
                names |= e.symbols
            names |= {a} - {"pi"} if isinstance(a, str) else set()
        return names

    def coefficient(self, *names: str) -> Expression:
        """Return the coefficient of the product of the symbols `names`.

        The coefficient is an expression in the other factors. A name that is given k times means
        its k-th power.
        """
        wanted: dict[str | Number | Call, int] = {}
        for name in names:
            wanted[name] = wanted.get(name, 0) + 1
        terms: dict[Monomial, Fraction] = {}
        for m, c in self.terms.items():
            powers = dict(m)
            if all(powers.get(a, 0) == n for a, n in wanted.items()):
                terms[tuple((a, n) for a, n in m if a not in wanted)] = c
        return Expression(terms)

    def mapped(self, image: Callable[[Atom], Expression]) -> Expression:
        """Replace every atom (symbol, number or function) by the expression `image(atom)`."""
        terms: dict[Monomial, Fraction] = {}
        for m, c in self.terms.items():
            term = Expression({(): c})
            for a, n in m:
                term = term * image(a) ** n
            for new, value in term.terms.items():
                terms[new] = terms.get(new, Fraction(0)) + value
        return Expression(terms)

    def substitute(self, values: Mapping[str, Expression]) -> Expression:
        """Replace symbols by the expressions in `values`, also inside functions."""

        def image(a: Atom) -> Expression:
            if isinstance(a, Call):
                return a.of(*(e.substitute(values) for e in a.operands))
            return values.get(a, _atom(a)) if isinstance(a, str) else _atom(a)

        return self.mapped(image)

    def derivative(self, name: str) -> Expression:
        """Differentiate with respect to the symbol `name`; the derivative of sign is 0."""
        result = Expression()
        for m, c in self.terms.items():
            for k, (a, n) in enumerate(m):
                rest = Expression({(): c * n}) * _atom(a) ** (n - 1)
                for b, l in (*m[:k], *m[k + 1 :]):
                    rest = rest * _atom(b) ** l
                result = result + rest * _slope(a, name)
                if len(result.terms) > LONGEST_SLOPE:
                    raise ValueError(
                        f"the derivative has more than {LONGEST_SLOPE} terms; "
                        "shorten the expression"
                    )
        return result

    def evaluate(
        self,
        value: Callable[[str], Any],
        function: Callable[..., Any],
        number: Callable[[Fraction], Any],
        written: Callable[[Number], Any] | None = None,
    ) -> Any:
        """Evaluate the expression with numbers of any type, for instance floats or CasADi symbols.

        The arguments convert the parts of the expression: `value` a symbol or pi, `function` a
        function given its name and its operands, `number` a rational, and `written` a Number (by
        default, its rational is converted).
        """
        total: Any = number(Fraction(0))
        for m, c in self.ordered:
            term: Any = number(c)
            for a, n in m:
                base = (
                    function(a.function, *a.operands)
                    if isinstance(a, Call)
                    else value(a)
                    if isinstance(a, str)
                    else written(a)
                    if written
                    else number(a.value)
                )
                factor = base
                for _ in range(abs(n) - 1):
                    factor = factor * base
                term = term * factor if n > 0 else term / factor
            total = total + term
        return total

    def __float__(self) -> float:
        return self.value({})

    def value(self, values: Mapping[str, float]) -> float:
        """Evaluate the expression as a float, with the numbers in `values` for its symbols.

        Raises KeyError with the name of a symbol that has no value.
        """

        def function(name: str, *operands: Expression) -> float:
            x = [e.value(values) for e in operands]
            return float(FUNCTIONS[name].number(*x))

        symbols = {"pi": math.pi, **values}
        return float(self.evaluate(symbols.__getitem__, function, float))

    def __str__(self) -> str:
        if not self.terms:
            return "0"
        text = ""
        for m, c in self.ordered:
            body = _factors(m, c)
            sign = "-" if c < 0 else "+"
            text += (f" {sign} " if text else ("-" if c < 0 else "")) + body
        return text

    def __repr__(self) -> str:
        return f"Expression({self})"


ZERO, ONE, PI = Expression(), Expression.number(1), Expression.symbol("pi")


def decimal(c: Fraction, *, fractions: bool = True) -> str:
    """Write a rational as a decimal if few decimal places make it exact, else as p/q.

    If `fractions` is true, halves, quarters and eighths are written as p/q too.
    """
    if c.denominator == 1:
        return str(c.numerator)
    written = c * 10**PLACES
    if written.denominator > 1 or (fractions and c.denominator in (2, 4, 8)):
        return f"{c.numerator}/{c.denominator}"
    return f"{Decimal(f'{written}e-{PLACES}'):f}".rstrip("0")


def _factors(m: Monomial, c: Fraction) -> str:
    inverses = {a for a, _ in m if isinstance(a, Call) and a.function == "inv"}
    up = [_power(f"{a}", n) for a, n in m if n > 0 and a not in inverses]
    down = [_power(f"{a}", -n) for a, n in m if n < 0]
    down += [_power(f"({a.argument})", n) for a, n in m if n > 0 and a in inverses]
    c = abs(c)
    text = decimal(c, fractions=bool(m))
    if m and "/" in text:
        head, _, tail = text.partition("/")
        down, text = [tail, *down], head
    if text != "1" or not up:
        up = [text, *up]
    return "*".join(up) + "".join(f"/{d}" for d in down)


def _power(base: str, n: int) -> str:
    return base if n == 1 else f"{base}**{n}"


def _order(m: Monomial) -> tuple[Any, ...]:
    return (-sum(n for _, n in m), tuple((str(a), -n) for a, n in m))


def _product(m1: Monomial, m2: Monomial) -> Monomial:
    if not m1:
        return m2
    if not m2:
        return m1
    powers = dict(m1)
    for a, n in m2:
        powers[a] = powers.get(a, 0) + n
    return tuple(sorted(((a, n) for a, n in powers.items() if n), key=lambda an: str(an[0])))


def _with_simple_roots(m: Monomial) -> tuple[Monomial, Fraction]:
    """Reduce the powers of sqrt(rational) and sign(x) in the monomial `m` to 0 or 1.

    Return the reduced monomial, and the rational factor that this leaves: sqrt(3)**-1 = sqrt(3)/3,
    sign(x)**2 = 1.
    """
    if not any(n != 1 and isinstance(a, Call) and a.function in ("sqrt", "sign") for a, n in m):
        return m, Fraction(1)
    factor, powers = Fraction(1), []
    for a, n in m:
        if isinstance(a, Call) and a.function == "sign":
            n %= 2
        c = a.argument.constant if isinstance(a, Call) and a.function == "sqrt" else None
        if c is not None:
            factor *= c ** (n // 2)
            n %= 2
        if n:
            powers.append((a, n))
    return tuple(powers), factor


def _atom(a: Atom) -> Expression:
    return Expression({((a, 1),): Fraction(1)})


def _sqrt_of_rational(c: Fraction) -> Expression:
    """Return the square root of a rational as a rational times square roots of primes.

    sqrt(m/n) = sqrt(m n)/n, and m n is factored by trial division with primes up to 1000; a
    remaining factor stays under one root.
    """
    if c < 0:
        raise ValueError("square root of a negative number")
    rest, result = c.numerator * c.denominator, Expression.number(Fraction(1, c.denominator))
    for l in range(2, min(LARGEST_PRIME, rest + 1)):
        while rest % (l * l) == 0:
            rest, result = rest // (l * l), result * l
        if rest % l == 0:
            rest, result = rest // l, result * _atom(Call("sqrt", Expression.number(l)))
    whole = math.isqrt(rest)
    return result * (whole if whole**2 == rest else _atom(Call("sqrt", Expression.number(rest))))


def _sqrt(e: Expression) -> Expression:
    """Return the square root of an expression, simplified if possible.

    The rules for one term c m, and for a sum a + b in which b**2 and s are rational, are

        sqrt(c m) = sqrt(c) sqrt(m),   c > 0 rational
        sqrt(a + b) = sqrt((a + s)/2) +- sqrt((a - s)/2),   s = sqrt(a**2 - b**2)

    For instance, sqrt(3 + 2 sqrt(2)) = 1 + sqrt(2).
    """
    c, a = e.constant, e.terms.get((), Fraction(0))
    if c is not None:
        return _sqrt_of_rational(c)
    if len(e.terms) == 1:
        ((m, c),) = e.terms.items()
        sign = Fraction(1 if c > 0 else -1)
        return _sqrt_of_rational(abs(c)) * _atom(Call("sqrt", Expression({m: sign})))
    rest = e - a
    square = (rest * rest).constant
    if a > 0 and square is not None and square <= a * a:
        s = _sqrt_of_rational(a * a - square).constant
        if s is not None:
            longer, shorter = (_sqrt_of_rational((a + x) / 2) for x in (s, -s))
            return longer + shorter * (1 if min(rest.terms.values()) > 0 else -1)
    return _atom(Call("sqrt", e))


@lru_cache(maxsize=4096)
def call(function: str, argument: Expression) -> Expression:
    """Apply a function to an expression: cos, sin, tan, sqrt, inv, sign, abs, exp or tanh.

    Quarter turns, signs and perfect squares are simplified exactly: sin(q1 + pi/2) = cos(q1).
    """
    if function == "abs":
        return argument * call("sign", argument)
    if function in ("sign", "tanh", "exp"):
        if not argument:
            return Expression.number(FUNCTIONS[function].at_zero or 0)
        if function != "exp" and _leading(argument) < 0:
            return -call(function, -argument)
        c = argument.constant
        return ONE if function == "sign" and c is not None else _atom(Call(function, argument))
    if function == "tan":
        return call("sin", argument) * call("cos", argument).inverse()
    if function == "inv":
        return argument.inverse()
    if function == "sqrt":
        return _sqrt(argument)
    turns, rest = quarter_turns(argument)
    if function == "sin":
        turns -= 1  # sin x = cos(x - pi/2)
    sign = 1
    if rest and _leading(rest) < 0:  # cos(k pi/2 + x) = cos(-k pi/2 - x)
        turns, rest = -turns, -rest
    turns %= 4
    if turns >= 2:
        sign, turns = -sign, turns - 2
    if not rest:
        return Expression.number(sign if turns == 0 else 0)
    if turns == 0:
        return _atom(Call("cos", rest)) * sign
    return _atom(Call("sin", rest)) * -sign  # cos(x + pi/2) = -sin x


def power(base: Expression, exponent: Expression) -> Expression:
    """Return base**exponent: a polynomial for a whole exponent, else the function pow."""
    c = exponent.constant
    if c is not None and c.denominator == 1:
        return base ** int(c)
    return _atom(Call("pow", base, exponent))


def _slope(a: Atom, name: str) -> Expression:
    """Differentiate an atom (symbol, number or function) with respect to the symbol `name`."""
    if not isinstance(a, Call):
        return ONE if a == name else ZERO
    x, value = a.argument, _atom(a)
    inner = x.derivative(name)
    if a.exponent is not None:
        if name in a.exponent.symbols:
            raise ValueError(
                f"{a}: {name} in an exponent has no derivative; write the power with exp"
            )
        return a.exponent * power(x, a.exponent - ONE) * inner
    return FUNCTIONS[a.function].slope(x, value) * inner if inner else ZERO


class Function(NamedTuple):
    """A function such as cos: its derivative, its values, and its name in other languages.

    Attributes
    ----------
    at_zero : int or None
        Value of the function at zero.
    slope : callable
        Derivative of the function, computed from its argument and its value.
    number : callable
        The function for floats.
    numpy, casadi, c, sympy : str
        Name of the function in that library or language; empty if it is written otherwise, as 1/x.
    """

    at_zero: int | None
    slope: Callable[[Expression, Expression], Expression]
    number: Callable[..., float]
    numpy: str
    casadi: str
    c: str
    sympy: str


def _slope_of_power(base: Expression, value: Expression) -> Expression:
    raise ValueError("the derivative of a power follows from its base and exponent")


FUNCTIONS = {
    "cos": Function(1, lambda x, y: -call("sin", x), math.cos, "cos", "cos", "cos", "cos"),
    "sin": Function(0, lambda x, y: call("cos", x), math.sin, "sin", "sin", "sin", "sin"),
    "sqrt": Function(
        0, lambda x, y: y.inverse() * Fraction(1, 2), math.sqrt, "sqrt", "sqrt", "sqrt", "sqrt"
    ),
    "sign": Function(
        0, lambda x, y: ZERO, lambda x: float((x > 0) - (x < 0)), "sign", "sign", "sign", "sign"
    ),
    "exp": Function(1, lambda x, y: y, math.exp, "exp", "exp", "exp", "exp"),
    "tanh": Function(0, lambda x, y: ONE - y**2, math.tanh, "tanh", "tanh", "tanh", "tanh"),
    "pow": Function(0, _slope_of_power, math.pow, "power", "power", "pow", "Pow"),
    "inv": Function(None, lambda x, y: -(y**2), lambda x: 1.0 / x, "", "", "", ""),
}
"""The one table of functions: a new one is an entry here, and what `call` takes out of it."""


def with_known_cosines(e: Expression) -> Expression:
    """Replace cos and sin of pi/6, pi/4 and pi/3 by their exact values, such as sqrt(3)/2."""

    def image(a: Atom) -> Expression:
        if isinstance(a, Call) and a.function in ("cos", "sin") and a.argument in KNOWN:
            square = KNOWN[a.argument]
            return _sqrt_of_rational(square if a.function == "cos" else 1 - square)
        return _atom(a)

    return e.mapped(image)


def simplified(e: Expression) -> Expression:
    """Simplify an expression by cos(a)**2 + sin(a)**2 = 1 wherever both terms occur in it.

    The rules for any factor m are

        cos(a)**2 m + sin(a)**2 m = m,   m - cos(a)**2 m = sin(a)**2 m
    """
    terms: dict[Monomial, Fraction] = {}
    monomials: list[Monomial] = []  # by their place
    places: dict[Monomial, int] = {}
    partners: dict[Monomial, list[Monomial]] = {}  # terms that a monomial may be taken with
    waiting: list[int] = []  # places of terms that may have a partner

    def add(m: Monomial, c: Fraction) -> None:
        if m not in terms:
            places[m] = len(monomials)
            monomials.append(m)
            for pair in _sine_and_rest(m):
                for other in pair:
                    partners.setdefault(other, []).append(m)
        terms[m] = terms.get(m, Fraction(0)) + c
        if not terms[m]:
            del terms[m]
        for changed in (m, *partners.get(m, ())):
            heappush(waiting, places[changed])

    def shorten(m: Monomial, c: Fraction) -> None:
        for sine, rest in _sine_and_rest(m):
            for partner, shorter, value in ((sine, rest, c), (rest, sine, -c)):
                if terms.get(partner) == value:
                    del terms[m], terms[partner]
                    add(shorter, value)
                    return

    for m, c in e.terms.items():
        add(m, c)
    while waiting:
        place = heappop(waiting)
        m = monomials[place]
        if m in terms and places[m] == place:
            shorten(m, terms[m])
    return Expression(terms)


def _sine_and_rest(m: Monomial) -> list[tuple[Monomial, Monomial]]:
    """Return two products for each cos(a)**2 in the product m: m with sin(a)**2 in its place, and m
    without it.
    """
    pairs = []
    for a, n in m:
        if isinstance(a, Call) and a.function == "cos" and n >= 2:
            rest = tuple((b, k - 2 if b == a else k) for b, k in m if b != a or k > 2)
            pairs.append((_product(rest, ((Call("sin", a.argument), 2),)), rest))
    return pairs


def quarter_turns(angle: Expression) -> tuple[int, Expression]:
    """Split an angle into k quarter turns and a rest: angle = k pi/2 + rest. Return k and the rest.

    The coefficient of pi in the rest is at least 0 and less than 1/2.
    """
    c = angle.terms.get((("pi", 1),), Fraction(0)) * 2
    k = c.numerator // c.denominator
    return k, angle - PI * Fraction(k, 2)


def ratio(x: float) -> Fraction:
    """Convert x to a simple fraction that rounds to x, such as 1/3, else to its shortest decimal.

    The denominator of the fraction is limited (`LARGEST_RATIO`).
    """
    near = Fraction(x).limit_denominator(LARGEST_RATIO)
    return near if float(near) == x else Fraction(repr(x))


def twelfths(angle: float, within: float) -> int | None:
    """Find the integer k for which k pi/12 lies within `within` rad of `angle`, else None.

    Angles in drawings are often such multiples.
    """
    k = round(angle * 12 / math.pi)
    return k if abs(angle - k * math.pi / 12) <= within else None


def _leading(e: Expression) -> Fraction:
    return e.terms[min(e.terms, key=_order)]


KNOWN = {
    PI * Fraction(1, n): Fraction(square, 4) for n, square in ((6, 3), (4, 2), (3, 1))
}  # angle: cos**2
