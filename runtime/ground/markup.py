"""Names, formulas and numbers in HTML, with indices, exponents and units set as in a book.

The parameter ZZ1R is printed as ZZ with the index 1R, and `D3**2*(M3 + M4)` with an exponent and no
star. Every text passes through `element`, which escapes whatever is not Markup already: no name and
no formula can insert markup.
"""

from __future__ import annotations

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
    """A text of complete, escaped HTML, which templates do not escape again."""

    __slots__ = ()

    def __html__(self) -> str:
        return self


def element(tag: str, *children: str, **attributes: str) -> Markup:
    """Make the HTML element <tag attributes>children</tag>; texts and attribute values are escaped.

    `class_` becomes class, `aria_label` becomes aria-label.
    """
    inside = "".join(child if isinstance(child, Markup) else escape(child) for child in children)
    given = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(value)}"'
        for name, value in attributes.items()
    )
    return Markup(f"<{tag}{given}>{inside}</{tag}>")


def split(name: str) -> tuple[str, str]:
    """Split the name of a parameter or constant into its letters and its subscript.

    For instance, ZZ1R gives "ZZ" and "1R"; the subscript may be empty.
    """
    match = re.fullmatch(r"(.*?[^\d_])_?(\d*(?:_\d+)*)(R?)", name)
    if match is None or not (match[2] or match[1] in FAMILIES):
        return name, ""
    letter, prefix = FAMILIES.get(match[1], (match[1], ""))
    return letter, prefix + match[2] + match[3]


def symbol(name: str) -> Markup:
    """Write the name of a parameter, such as ZZ1R, in HTML with its index as a subscript.

    Text that is copied from the page has the name in one word.
    """
    letter, subscript = split(name)
    return element("var", letter, *([element("sub", subscript)] if subscript else []))


def formula(text: str) -> Markup:
    """Write a formula in HTML, with subscripts, exponents, and thin spaces for products.

    The formula may have + - * ** ( ) and functions.
    """
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
    """Write a unit as in print: kg*m**2 becomes kg m², N*m*s/rad becomes N m s/rad."""
    return text.replace("**2", "²").replace("*", "\u00a0")
