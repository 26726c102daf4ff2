"""Names as the literature prints them: a letter with a subscript. ZZ1R is ZZ with 1R, Ia1 is I with a1, FV2 is F with v2."""

from __future__ import annotations

import re

FAMILIES = {"Ia": ("I", "a"), "FV": ("F", "v"), "FS": ("F", "s"), "FVM": ("F", "vm"), "FSM": ("F", "sm")}


def symbol(name: str) -> tuple[str, str]:
    """(letter, subscript) of a parameter, constant or joint variable; the subscript may be empty."""
    match = re.fullmatch(r"(.*?[^\d_])[_]?(\d*)(R?)", name)
    if match is None:
        return name, ""
    stem, index, regrouped = match.groups()
    letter, prefix = FAMILIES.get(stem, (stem, ""))
    return letter, prefix + index + regrouped
