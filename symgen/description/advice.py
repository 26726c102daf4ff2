"""Hints for error messages: recognise a typical mistake in a robot file and name the remedy.

Each function returns "" if it has no hint.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable

from symgen.description.expression import PI, Expression

ANCHORS = "anchors and aliases (& and *) are not supported; write the value itself"
FULL_TURN = 2 * math.pi  # rad: a larger constant in an angle, pi aside, was meant in degrees

_YAML = {  # what the scanner says: what to change
    "'\\t'": "there is a tab here; indent with spaces",
    "mapping values are not allowed here": (
        "a second `: ` on this line; put text that contains `: ` between quotes"
    ),
    "but found '<block mapping start>'": (
        "this line has another indent than the lines above; "
        "give all rows of one table the same indent"
    ),
    "<block end>, ": (
        "the lines above are a list (-) or have another indent; write every row as `1: {...}`, "
        "with the same indent"
    ),
    "found another document": "a second document starts here; a robot file holds one",
    "found undefined alias": ANCHORS,
    "expected ',' or '}'": "look here, or at the end of the row above, for a missing , or }",
    "expected ',' or ']'": "look here, or at the end of the row above, for a missing , or ]",
}


def yaml_advice(problem: str) -> str:
    """Return a hint for an error message of the YAML parser, for instance about a tab."""
    return next((f"; {advice}" for part, advice in _YAML.items() if part in problem), "")


def symbol_advice(name: str, declared: Iterable[str]) -> str:
    """Suggest the declared symbol that the user probably meant by the unknown symbol `name`."""
    symbols = [*declared, "pi"]
    same = [symbol for symbol in symbols if symbol.lower() == name.lower()]
    close = same or difflib.get_close_matches(
        name, [symbol for symbol in symbols if len(symbol) > 2], 1
    )
    return f"; did you mean {close[0]!r}?" if close else ""


def unit_advice(token: str) -> str:
    """Return a hint if `token` in an expression is a unit, such as deg, or the power sign ^."""
    unit = token.lower()
    if unit in ("deg", "degree", "degrees", "°", "grad"):
        return "; angles are in rad: 90 degrees are pi/2"
    if unit in ("mm", "cm", "m", "in", "kg", "g", "rad"):
        return "; write the number alone: everything is in SI and rad"
    return "; a power is written **" if token == "^" else ""


def degrees_advice(angle: Expression, constants: dict[str, float]) -> str:
    """Return a hint if an angle larger than a full turn was probably written in degrees.

    Multiples of pi in the angle are ignored. `angle` is given without the joint variable q_j.
    """
    turn = angle - PI * angle.coefficient("pi")
    if "pi" in turn.atoms or turn.symbols - constants.keys():
        return ""
    value = turn.value(constants)
    return (
        (
            f"{value:g} rad are {abs(value) / FULL_TURN:.3g} turns; angles are in rad: 90 degrees "
            "are pi/2"
        )
        if abs(value) > FULL_TURN
        else ""
    )
