"""Names, formulas and numbers as people write them: ZZ1R is ZZ with the index 1R, `D3**2*(M3 + M4)` has a square and no star.

Every piece is made by `element`, which escapes whatever is not Markup already: no name and no
formula can bring in markup.
"""

from __future__ import annotations

import math
import re
from html import escape

FAMILIES = {
    "Ia": ("I", "a"),
    "FV": ("F", "v"),
    "FS": ("F", "s"),
    "FVM": ("F", "vm"),
    "FSM": ("F", "sm"),
}
TOKEN = re.compile(
    r"\*\*(?P<power>\d+)|(?P<times>\*)|(?P<sign>\s[+-]\s|-)|(?P<name>[A-Za-z]\w*)|(?P<other>.)",
    re.DOTALL,
)
UPRIGHT = {"sin", "cos", "tan", "sqrt", "pi"}


class Markup(str):
    """Complete, escaped HTML; templates do not escape it again."""

    __slots__ = ()

    def __html__(self) -> str:
        return self


def element(tag: str, *children: str, **attributes: str) -> Markup:
    """<tag attributes>children</tag> with escaped texts and attribute values.

    `class_` becomes class, `aria_label` becomes aria-label.
    """
    inside = "".join(child if isinstance(child, Markup) else escape(child) for child in children)
    given = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(value)}"'
        for name, value in attributes.items()
    )
    return Markup(f"<{tag}{given}>{inside}</{tag}>")


def split(name: str) -> tuple[str, str]:
    """Letter and subscript of a parameter or constant; the subscript may be empty."""
    match = re.fullmatch(r"(.*?[^\d_])_?(\d*(?:_\d+)*)(R?)", name)
    if match is None or not (match[2] or match[1] in FAMILIES):
        return name, ""
    letter, prefix = FAMILIES.get(match[1], (match[1], ""))
    return letter, prefix + match[2] + match[3]


def symbol(name: str) -> Markup:
    """A parameter with its subscript, in HTML that copies as one word."""
    letter, subscript = split(name)
    return element("var", letter, *([element("sub", subscript)] if subscript else []))


def formula(text: str) -> Markup:
    """A flat formula with + - * ** ( ) and functions in HTML: subscripts, exponents, thin spaces for products."""
    pieces: list[str] = []
    for token in TOKEN.finditer(text):
        kind, piece = token.lastgroup, token[0]
        if kind == "power":
            pieces.append(element("sup", token["power"]))
        elif kind == "times":
            pieces.append("\u2009")
        elif kind == "sign":
            pieces.append(piece.replace("-", "\u2212"))
        elif kind == "name":
            pieces.append("π" if piece == "pi" else piece if piece in UPRIGHT else symbol(piece))
        else:
            pieces.append(piece)
    return element("span", *pieces, class_="formula")


def unit(text: str) -> str:
    """A unit for people: kg*m**2 becomes kg m², N*m*s/rad becomes N m s/rad."""
    return text.replace("**2", "²").replace("*", "\u00a0")


def number(value: float, form: str = ".4g") -> str:
    """A number for people; - for no number."""
    return format(value, form) if math.isfinite(value) else "-"
