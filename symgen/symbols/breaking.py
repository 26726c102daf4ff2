"""Long formulas on several lines: cut before + and -, outside of brackets first, inside where a
term is wider than a line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator


def lines(
    head: str, formula: str, width: int, hanging: str, measure: Callable[[str], int] = len
) -> list[str]:
    """`head` with as much of the formula as fits, then lines that begin with `hanging`."""
    done: list[str] = []
    line, empty = head, True
    for piece in pieces(formula, width, measure):
        if not empty and measure(line) + 1 + measure(piece) > width:
            done.append(line)
            line, empty = hanging, True
        line += piece if empty else f" {piece}"
        empty = False
    return [*done, line]


def pieces(
    formula: str, width: int, measure: Callable[[str], int] = len, depth: int = 0
) -> Iterator[str]:
    """The formula cut before every + and - at `depth` brackets, pieces that are wider than `width`
    cut further in.
    """
    for piece in _cut(formula, depth):
        if measure(piece) <= width or depth > 8:
            yield piece
        else:
            yield from pieces(piece, width, measure, depth + 1)


def _cut(text: str, deepest: int) -> Iterator[str]:
    brackets = braces = start = 0
    for k, c in enumerate(text):
        brackets += (c == "(") - (c == ")")
        braces += (c == "{") - (c == "}")
        if c == " " and not braces and brackets <= deepest and text[k + 1 : k + 3] in ("+ ", "- "):
            yield text[start:k]
            start = k + 1
    yield text[start:]
