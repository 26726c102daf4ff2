"""Parser for the expressions in robot files; a text is never evaluated as Python code.

    sum     = product (("+" | "-") product)*
    product = unary (("*" | "/") unary)*
    unary   = ("+" | "-")* power
    power   = primary ["**" ["-"] primary]          exponent: a whole number
    primary = number | name | function "(" sum ["," sum] ")" | "(" sum ")"

Names are `pi` and the declared symbols. Functions are sin, cos, tan, sqrt. Laws of columns also
allow abs, sign, exp, tanh, min, max, names channel.NAME, and exponents that are expressions.
Anything else is an ExpressionError at its column. Length, depth, exponents, terms and digits are
limited, so that every text is parsed quickly.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from fractions import Fraction

from symgen.description.expression import FUNCTIONS as TABLE
from symgen.description.expression import Expression, call, power, simplified
from symgen.errors import ExpressionError

FUNCTIONS = ("sin", "cos", "tan", "sqrt")
BY_OPERATORS = ("pow", "inv")  # written x**y and 1/x
# functions of columns
LAWS = (
    *FUNCTIONS,
    "abs",
    *(f for f in TABLE if f not in (*FUNCTIONS, *BY_OPERATORS)),
    "min",
    "max",
)
MAX_LENGTH, MAX_DEPTH, MAX_EXPONENT, MAX_TERMS, MAX_DIGITS = 2000, 40, 32, 400, 60

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_][A-Za-z0-9_]*)|(?P<op>\*\*|[-+*/()]))",
    re.ASCII,
)
_LAW_TOKEN = re.compile(
    _TOKEN.pattern.replace("<name>", r"<name>(?:channel\.)?").replace("-+*/()", "-+*/(),"),
    re.ASCII,
)


def _symbol_advice(name: str, declared: Iterable[str]) -> str:
    """Suggest the declared symbol that the user probably meant by the unknown symbol `name`."""
    symbols = [*declared, "pi"]
    same = [symbol for symbol in symbols if symbol.lower() == name.lower()]
    close = same or difflib.get_close_matches(
        name, [symbol for symbol in symbols if len(symbol) > 2], 1
    )
    return f"; did you mean {close[0]!r}?" if close else ""


def _unit_advice(token: str) -> str:
    """Return a hint if `token` in an expression is a unit, such as deg, or the power sign ^."""
    unit = token.lower()
    if unit in ("deg", "degree", "degrees", "°", "grad"):
        return "; angles are in rad: 90 degrees are pi/2"
    if unit in ("mm", "cm", "m", "in", "kg", "g", "rad"):
        return "; write the number alone: everything is in SI and rad"
    return "; a power is written **" if token == "^" else ""


class _Parser:
    def __init__(self, text: str, symbols: Iterable[str] | None, functions: tuple[str, ...]):
        self.text, self.functions = text, functions
        self.symbols = None if symbols is None else frozenset(symbols)
        self.depth = 0
        self.tokens: list[tuple[str, str, int]] = []
        if len(text) > MAX_LENGTH:
            raise self.error(
                f"the expression has {len(text)} characters; the limit is {MAX_LENGTH}", 1
            )
        position, end = 0, len(text.rstrip())
        while position < end:
            match = (_LAW_TOKEN if functions is LAWS else _TOKEN).match(text, position)
            if match is None:
                at = len(text) - len(text[position:].lstrip())
                raise self.error(
                    (
                        f"unexpected {text[at]!r}; expected numbers, declared symbols, + - * / ** "
                        f"( ), {', '.join(functions)}"
                    ),
                    at + 1,
                    _unit_advice(text[at]),
                )
            kind = str(match.lastgroup)
            self.tokens.append((kind, match.group(kind), match.start(kind) + 1))
            position = match.end()
        self.tokens.append(("end", "end of text", len(text) + 1))
        self.position = 0

    def error(self, message: str, column: int, advice: str = "") -> ExpressionError:
        return ExpressionError(message, text=self.text, column=column, advice=advice)

    def accept(self, *texts: str) -> str | None:
        kind, text, _ = self.tokens[self.position]
        if kind == "op" and text in texts:
            self.position += 1
            return text
        return None

    def limited(self, e: Expression) -> Expression:
        if len(e.terms) > MAX_TERMS or any(abs(n) > MAX_EXPONENT for m in e.terms for _, n in m):
            raise self.error(
                (
                    f"the expression expands to more than {MAX_TERMS} terms or powers above "
                    f"{MAX_EXPONENT}; replace a part by a constant"
                ),
                self.tokens[self.position][2],
            )
        if any(
            len(str(c.numerator)) + len(str(c.denominator)) > 4 * MAX_DIGITS
            for c in e.terms.values()
        ):
            raise self.error("number with too many digits", self.tokens[self.position][2])
        return e

    def sum(self) -> Expression:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise self.error(
                f"parentheses are nested more than {MAX_DEPTH} deep", self.tokens[self.position][2]
            )
        e = self.product()
        while op := self.accept("+", "-"):
            e = self.limited(e + self.product() if op == "+" else e - self.product())
        self.depth -= 1
        return e

    def product(self) -> Expression:
        e = self.unary()
        while op := self.accept("*", "/"):
            column = self.tokens[self.position][2]
            f = self.unary()
            if op == "/" and not f:
                raise self.error("division by zero", column)
            e = self.limited(e * f if op == "*" else e * f.inverse())
        return e

    def unary(self) -> Expression:
        negative = False
        while op := self.accept("+", "-"):
            negative ^= op == "-"
        e = self.power()
        return -e if negative else e

    def power(self) -> Expression:
        base = self.primary()
        if self.accept("**"):
            column = self.tokens[self.position][2]
            negative = self.accept("-") is not None
            raised = self.primary()
            exponent = raised.constant
            if self.functions is LAWS and (exponent is None or exponent.denominator != 1):
                return power(base, -raised if negative else raised)
            if exponent is None or exponent.denominator != 1 or abs(exponent) > MAX_EXPONENT:
                raise self.error(
                    f"exponent must be a whole number between -{MAX_EXPONENT} and {MAX_EXPONENT}",
                    column,
                )
            n = -int(exponent) if negative else int(exponent)
            if n < 0 and not base:
                raise self.error("division by zero", column)
            if len(base.terms) > 1 and abs(n) > 8:
                raise self.error(
                    "the power of a sum is above 8; replace the sum by a constant", column
                )
            factor, result = base.inverse() if n < 0 else base, Expression.number(1)
            for _ in range(
                abs(n)
            ):  # guarded step by step: nested powers are refused before they grow
                result = self.limited(result * factor)
            return result
        return base

    def primary(self) -> Expression:
        kind, text, column = self.tokens[self.position]
        self.position += 1
        if kind == "number":
            mantissa, _, exponent = text.lower().partition("e")
            if len(mantissa) > MAX_DIGITS or (exponent and abs(int(exponent[:9])) > MAX_DIGITS):
                raise self.error("number with too many digits", column)
            return Expression.number(Fraction(text))
        if kind == "op" and text == "(":
            e = self.sum()
            if self.accept(")") is None:
                raise self.error("missing )", self.tokens[self.position][2])
            return e
        if kind == "name":
            if self.accept("("):
                if text not in self.functions:
                    *others, last = self.functions
                    raise self.error(
                        f"{text!r} is not a known function; expected {', '.join(others)} or {last}",
                        column,
                        _unit_advice(text),
                    )
                e = self.sum()
                if text in ("min", "max"):
                    if self.accept(",") is None:
                        raise self.error(
                            f"{text} takes two values; write {text}(a, b)",
                            self.tokens[self.position][2],
                        )
                    other = self.sum()
                    distance = call("abs", e - other)
                    e = (e + other + (distance if text == "max" else -distance)) * Fraction(1, 2)
                if self.accept(")") is None:
                    raise self.error("missing )", self.tokens[self.position][2])
                if text in ("min", "max"):
                    return self.limited(e)
                try:
                    return self.limited(call(text, e))
                except (ValueError, ZeroDivisionError) as error:
                    raise self.error(
                        f"cannot evaluate {text}({e}): {error or 'division by zero'}", column
                    ) from error
            if text == "pi" or self.symbols is None or text in self.symbols:
                return Expression.symbol(text)
            declared = sorted(self.symbols)
            raise self.error(
                f"undeclared symbol {text!r}; declared symbols: {', '.join(declared) or 'none'}",
                column,
                _symbol_advice(text, declared),
            )
        raise self.error(f"expected a number, a symbol or (, found {text!r}", column)


def parse(
    text: str | int | float,
    symbols: Iterable[str] | None = None,
    functions: tuple[str, ...] = FUNCTIONS,
) -> Expression:
    """Parse an expression of a robot file, given as text or number, into an exact Expression.

    `symbols` are the declared names (None: any name is allowed). `functions` are the allowed
    functions: `FUNCTIONS`, or `LAWS` for the law of a column. Raises ExpressionError, with the
    column, at the first text that is not allowed.
    """
    if isinstance(text, (int, float)) and not isinstance(text, bool):
        text = repr(text)
    parser = _Parser(str(text), symbols, functions)
    e = parser.sum()
    kind, token, column = parser.tokens[parser.position]
    if kind != "end":
        raise parser.error(
            f"unexpected {token!r} after a complete expression", column, _unit_advice(token)
        )
    return simplified(e)
