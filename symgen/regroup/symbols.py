"""Names as the literature prints them: a letter with a subscript. ZZ1R is ZZ with 1R, Ia1 is I with a1, FV2 is F with v2."""

from __future__ import annotations

import re

GREEK = {"alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "theta": "θ", "phi": "φ", "psi": "ψ", "pi": "π"}
FAMILIES = {"Ia": ("I", "a"), "FV": ("F", "v"), "FS": ("F", "s"), "FVM": ("F", "vm"), "FSM": ("F", "sm")}
SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def symbol(name: str) -> tuple[str, str]:
    """(letter, subscript) of a parameter, constant or joint variable; the subscript may be empty."""
    match = re.fullmatch(r"(.*?[^\d_])[_]?(\d*)(R?)", name)
    if match is None:
        return name, ""
    stem, index, regrouped = match.groups()
    letter, prefix = FAMILIES.get(stem, (stem, ""))
    return letter, prefix + index + regrouped


def subscripted(name: str) -> str:
    """A name with its index below, one character for one: ZZ1R is ZZ₁R, OFFSET6 is OFFSET₆; pi is π, alpha3 is α₃."""
    match = re.fullmatch(r"(.*?)(\d*)(R?)", name)
    if match is None:
        return name
    stem, index, regrouped = match.groups()
    return GREEK.get(stem, stem) + index.translate(SUBSCRIPTS) + regrouped


def superscripted(power: str) -> str:
    """An exponent above: ², ⁻¹."""
    return power.translate(SUPERSCRIPTS)
