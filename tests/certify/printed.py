"""Printed equations read back: name = expression, in the grammar of robot files or Python.

Nothing is run: the syntax tree of each expression is evaluated over numbers and arrays.
"""

from __future__ import annotations

import ast
import json
import operator
import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from symgen.description.expression import FUNCTIONS

OPERATORS: dict[type, Any] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
CALLS: dict[str, Any] = {
    name: getattr(np, f.numpy) for f in FUNCTIONS.values() if f.numpy for name in (f.c, f.sympy)
} | {
    "abs": np.abs,
    "Abs": np.abs,
    "max": np.maximum,
    "Max": np.maximum,
    "min": np.minimum,
    "Min": np.minimum,
    "Rational": operator.truediv,
    "Matrix": list,
}
NEXT = re.compile(r", (?=[A-Za-z]\w* = )")


def definitions(lines: Iterable[str]) -> list[tuple[str, str]]:
    """(name, expression) of lines `name = expression`, several beside each other, continued by
    lines that are indented deeper.
    """
    found: list[tuple[str, str]] = []
    indent: float = float("inf")
    for line in lines:
        depth = len(line) - len(line.lstrip())
        if " = " in line:
            pairs = (piece.partition(" = ") for piece in NEXT.split(line.strip().rstrip(",")))
            found += [(name.strip(), e) for name, _, e in pairs]
            indent = depth
        elif line.strip() and depth > indent:
            found[-1] = (found[-1][0], f"{found[-1][1]} {line.strip()}")
        else:
            indent = float("inf")
    return found


def evaluated(equations: Iterable[tuple[str, str]], values: Mapping[str, Any]) -> dict[str, Any]:
    """Value of every name, in order; names may enter the equations below theirs."""
    known = {"pi": np.pi, **values}
    found = {}
    for name, expression in equations:
        found[name] = known[name] = _value(ast.parse(expression.strip(), mode="eval").body, known)
    return found


def _value(e: ast.AST, known: Mapping[str, Any]) -> Any:
    match e:
        case ast.Constant(value=int() | float()):
            return e.value
        case ast.Name():
            return known[e.id]
        case ast.Attribute(attr="pi"):
            return np.pi
        case ast.UnaryOp():
            return OPERATORS[type(e.op)](_value(e.operand, known))
        case ast.BinOp():
            later = []  # a sum of a thousand terms is as deep
            while isinstance(e, ast.BinOp):
                later.append((OPERATORS[type(e.op)], e.right))
                e = e.left
            value = _value(e, known)
            for operate, right in reversed(later):
                value = operate(value, _value(right, known))
            return value
        case ast.Call(func=ast.Name(id=function) | ast.Attribute(attr=function)):
            return CALLS[function](*(_value(a, known) for a in e.args))
        case ast.List():
            return [_value(a, known) for a in e.elts]
    raise ValueError(f"{ast.unparse(e)} is no expression of numbers")


def equations(text: str) -> list[tuple[str, str]]:
    """(name, expression) of what is printed: JSON, Python with SymPy, or text."""
    if text.startswith("{"):
        document = json.loads(text)
        if "base_parameters" in document:
            return [(b["name"], b["formula"]) for b in document["base_parameters"]]
        angles = document.get("angles", {}).items()
        found = [(a, f"{'cos' if a[0] == 'C' else 'sin'}({e})") for a, e in angles]
        found += [(e["name"], e["expression"]) for e in document.get("equations", ())]
        found += document.get("entries", {}).items()
        return found + [("det A", e) for e in [document.get("denominator")] if e]
    if text.startswith("import sympy"):
        assigned = [s for s in ast.parse(text).body if isinstance(s, ast.Assign)]
        return [
            (s.targets[0].id, ast.unparse(s.value))
            for s in assigned
            if isinstance(s.targets[0], ast.Name)
        ]
    _, gap, body = text.partition("\n\n")  # below the title and the notes, where there are any
    return definitions((body if gap or text.endswith("\n") else text).splitlines())
