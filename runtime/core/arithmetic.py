"""Evaluation of numbers that are written as arithmetic, such as `2*pi/10000`.

Allowed are numbers, pi, the operators + - * / ** and parentheses. The text is parsed to a syntax
tree, and the tree is evaluated; no text is ever executed as code.
"""

from __future__ import annotations

import ast
import math
import operator
import warnings
from collections.abc import Callable

from runtime.core.limits import LIMIT

_BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


def number(text: str) -> float:
    """Compute the value of an arithmetic expression such as "2*pi/1000".

    Raise ValueError for any other text, and if the value is not finite and real.
    """
    if len(text) > LIMIT.NUMBER_CHARACTERS:
        raise ValueError(
            f"a number of {len(text)} characters; expected at most {LIMIT.NUMBER_CHARACTERS}"
        )
    try:
        with warnings.catch_warnings(
            action="ignore"
        ):  # of Python, about numbers that run into words
            value = _value(ast.parse(text.strip(), mode="eval").body)
    except (SyntaxError, RecursionError, MemoryError):
        raise ValueError(f"{text!r} is not a number; write e.g. 1e-3 or 2*pi/10000") from None
    except (ZeroDivisionError, OverflowError) as e:
        raise ValueError(f"{text!r} has no finite value ({e})") from None
    if isinstance(value, complex) or not math.isfinite(value):
        raise ValueError(f"{text!r} has no finite real value")
    return value


def _value(node: ast.expr) -> float:
    match node:
        case ast.Constant(value=int() | float() as x) if not isinstance(x, bool):
            return float(x)
        case ast.Name(id="pi"):
            return math.pi
        case ast.UnaryOp(op=ast.USub(), operand=x):
            return -_value(x)
        case ast.UnaryOp(op=ast.UAdd(), operand=x):
            return _value(x)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            return _BINARY[type(op)](_value(left), _value(right))
    raise ValueError(
        f"{ast.unparse(node)!r} is not allowed in a number; use numbers, pi, + - * / ** ( )"
    )
