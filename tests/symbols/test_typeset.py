"""The equations of a robot's page, read from their MathML as a browser shows them and evaluated."""

from __future__ import annotations

import cmath
import random
from collections.abc import Mapping
from xml.etree import ElementTree

import pytest
import sympy
from campaign import sampled

import symgen
from symgen.description import packaged_robots
from symgen.symbols import documents, expressions, printers

FUNCTIONS = {"sin": cmath.sin, "cos": cmath.cos, "sqrt": cmath.sqrt, "tanh": cmath.tanh}
FUNCTIONS |= {"sign": lambda x: 1.0 if x.real > 0 else -1.0, "abs": abs}
SIGNS = {"\u2062": "*", "·": "*", "\u2061": "", "−": "-"}
"""What stands between two factors, between a function and its argument, and the minus sign."""


def read(node: ElementTree.Element, names: Mapping[str, str]) -> str:
    """Write a MathML element in Python. A row has no brackets but those that a reader sees."""
    if name := names.get(ElementTree.tostring(node, encoding="unicode")):
        return name
    if len(node) > 1 and node[0].text == node[-1].text == "|":
        return f"abs({''.join(read(x, names) for x in node[1:-1])})"
    inside = (read(x, names) for x in node)
    match node.tag:
        case "math" | "mrow":
            return "".join(inside)
        case "mspace":
            return ""
        case "mfrac":
            return "(({})/({}))".format(*inside)
        case "msup":
            return "{}**({})".format(*inside)
        case "msubsup":
            base = ElementTree.Element("msub")
            base.extend(node[:2])
            return f"{read(base, names)}**({read(node[2], names)})"
        case "msqrt":
            return f"sqrt({''.join(inside)})"
        case "mn" | "mi" | "mo":
            assert node.text
            return {**SIGNS, "π": "pi"}.get(node.text, node.text)
    raise ValueError(f"{node.tag} is not read")


def value(x: expressions.Tree, numbers: Mapping[expressions.Tree, complex]) -> complex:
    """Evaluate an expression with a number for each symbol, factor by factor."""
    if x.is_Symbol:
        return numbers[x]
    if x.is_Number or x.is_NumberSymbol:
        return complex(x)
    parts = [value(y, numbers) for y in x.args]
    if x.is_Add:
        return sum(parts)
    if x.is_Mul:
        product = 1 + 0j
        for y in parts:
            product *= y
        return product
    return parts[0] ** parts[1] if x.is_Pow else FUNCTIONS[x.func.__name__.lower()](*parts)


def right_as_typeset(x: expressions.Tree, terms: list[str]) -> bool:
    """Whether the terms of an equation have, as they are typeset, the value of the equation."""
    rng = random.Random(0)
    numbers = {s: rng.uniform(0.5, 2.0) for s in sorted(x.free_symbols, key=str)}
    names = {
        ElementTree.tostring(
            ElementTree.fromstring(printers.math(s))[0], encoding="unicode"
        ): f"v{k}"
        for k, s in enumerate(numbers)
    }
    text = "".join(read(ElementTree.fromstring(term), names) for term in terms)
    values = {f"v{k}": number for k, number in enumerate(numbers.values())}
    found = eval(text, FUNCTIONS | {"pi": cmath.pi} | values)  # noqa: S307
    expected = value(x, numbers)
    return bool(abs(found - expected) < 1e-9 * (1 + abs(expected)))


@pytest.mark.parametrize("name", sampled(packaged_robots(), 2, always=("tx40", "puma560")))
def test_every_equation_of_a_page_has_its_value_as_typeset(name: str, monkeypatch) -> None:
    typeset = []
    term_by_term = documents.math_terms

    def recorded(x: expressions.Tree) -> list[printers.MathML]:
        typeset.append((sympy.sympify(x), term_by_term(x)))
        return typeset[-1][1]

    monkeypatch.setattr(documents, "math_terms", recorded)
    documents.shown_models(symgen.regrouping(symgen.load_robot(name)))
    wrong = [printers.text(x) for x, terms in typeset if not right_as_typeset(x, terms)]
    assert typeset and not wrong


X, Y, Z = (expressions.symbol(name) for name in ("MY6", "S6", "JP135"))


@pytest.mark.parametrize(
    "x",
    [
        sympy.Mul(-1, X, Y, evaluate=False),
        sympy.Mul(-1, X, Y, Z, evaluate=False),
        sympy.Mul(-1, 2, X, evaluate=False),
        sympy.Mul(-1, sympy.Mul(X, Y, evaluate=False), evaluate=False),
        expressions.negative(expressions.total([X, Y])),
        expressions.total([X, expressions.negative(expressions.total([Y, Z]))]),
        -X * Y,
        -X,
    ],
    ids=printers.text,
)
def test_a_minus_sign_keeps_every_factor(x: expressions.Tree) -> None:
    assert right_as_typeset(x, [printers.math(x)]) and right_as_typeset(x, printers.math_terms(x))
    numbers = {X: 2.0, Y: 3.0, Z: 5.0}
    assert value(expressions.negative(x), numbers) == -value(x, numbers)


def test_a_name_of_several_letters_is_one_word() -> None:
    assert "<mi>MSP</mi>" in printers.math(expressions.symbol("MSP15"))
