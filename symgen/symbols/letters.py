"""Names as the literature prints them: a letter with a subscript. ZZ1R is ZZ with 1R, Ia1 is I with
a1, FV2 is F with v2, QP1 is q with a dot and 1, C23 is C with 23.
"""

from __future__ import annotations

import re

GREEK = {
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "delta": "δ",
    "theta": "θ",
    "phi": "φ",
    "psi": "ψ",
    "pi": "π",
    "Gamma": "Γ",
}
FAMILIES = {
    "Ia": ("I", "a"),
    "FV": ("F", "v"),
    "FS": ("F", "s"),
    "FVM": ("F", "vm"),
    "FSM": ("F", "sm"),
    "GAM": ("Gamma", ""),
    "th": ("theta", ""),
}
DOTS = {"QP": "dot", "QDP": "ddot"}
_ANGLE = re.compile(r"(C|S|th)(\d[\d_mx]*)(b*)")  # 23, 5m2 for q5 - q2; b with another constant
_ENTRY = re.compile(r"(\w+)\((.*)\)")  # A(1,2)
_INDEXED = re.compile(r"(.*?[^\d_])_?(\d*(?:_\d+)*)(R?)")


def letter(name: str) -> tuple[str, str]:
    """(letter, subscript) of a name; both may be printed as they are but for Greek letters."""
    if not name[0].isidentifier():  # a number
        return name, ""
    if match := _ENTRY.fullmatch(name):
        return FAMILIES.get(match[1], (match[1], ""))[0], match[2]
    if match := _ANGLE.fullmatch(name):
        index = match[2].replace("m", "-").replace("_", ",")
        return FAMILIES.get(match[1], (match[1], ""))[0] + "'" * len(match[3]), index
    match = _INDEXED.fullmatch(name)
    if match is None:
        return name, ""
    stem, index, regrouped = match.groups()
    stem, prefix = FAMILIES.get(stem, (stem, "")) if index else (stem, "")
    return stem, prefix + index.replace("_", ",") + regrouped
