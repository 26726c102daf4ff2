"""Regrouping formulas: sums of standard parameters with exact coefficients.

The coefficients stay expressions until they are written: as text here, in Python by
`emit.printers`, by the printers of SymPy in `symbols`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from symgen.description.expression import ONE, Expression

Signed = tuple[bool, str]  # whether a term is added, and the term


class Formula(NamedTuple):
    """A sum of parameters with coefficients, sum_k c_k chi_k.

    Attributes
    ----------
    combination : mapping
        Coefficient c_k, a constant expression, of each parameter chi_k, in the order of the text.
    """

    combination: Mapping[str, Expression]

    def __str__(self) -> str:
        return self.text(str)

    def text(self, coefficient: Callable[[Expression], str]) -> str:
        """Write the formula as text; parameters with the same coefficient share it: D3*(MX4 + MY5).

        `coefficient` writes a coefficient. Parameters with coefficient 1 or -1 are written one by
        one.
        """
        terms: list[Signed] = []
        for c, members in self.groups():
            if c in (ONE, -ONE):
                terms += [((c == ONE) == added, name) for added, name in members]
                continue
            added = len(c.terms) > 1 or min(c.terms.values()) > 0
            factor = coefficient(c if added else -c)
            if len(c.terms) > 1:
                factor = f"({factor})"
            inside = _sum(members)
            terms.append(
                (added, f"{factor}*({inside})" if len(members) > 1 else f"{factor}*{inside}")
            )
        return _sum(terms)

    def groups(self) -> list[tuple[Expression, list[Signed]]]:
        """Group the parameters of the formula by equal coefficients.

        Return each coefficient with its parameters, as in eq. (27). Parameters with the opposite
        coefficient are in the same group, marked as subtracted.
        """
        groups: dict[Expression, list[Signed]] = {}
        for name, c in self.combination.items():
            key = -c if -c in groups and c not in groups else c
            groups.setdefault(key, []).append((key == c, name))
        return list(groups.items())

    def mapping(self) -> dict[str, Any]:
        """Return the formula for JSON: its text, and the coefficient of each parameter."""
        return {
            "formula": str(self),
            "terms": [
                {"parameter": name, "coefficient": str(c)} for name, c in self.combination.items()
            ],
        }


def _sum(terms: Sequence[Signed]) -> str:
    (added, first), *rest = terms
    return (
        ("" if added else "-")
        + first
        + "".join(f" {'+' if added else '-'} {term}" for added, term in rest)
    )
