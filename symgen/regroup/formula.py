"""Formulas: sums of parameters with coefficients in Q(geometry). They stay expressions until they
are written: as text here, in Python by `emit.printers`, by the printers of SymPy in `symbols`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from symgen.description.expression import ONE, Expression

Signed = tuple[bool, str]  # whether a term is added, and the term


@dataclass(frozen=True)
class Formula:
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
        """The whole formula: parameters with coefficient 1 one by one, the others with the coefficient that they share, as `coefficient` writes it."""
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
        """Coefficients with the parameters that share one, as in eq. (27).

        Those with the opposite one are subtracted.
        """
        groups: dict[Expression, list[Signed]] = {}
        for name, c in self.combination.items():
            key = -c if -c in groups and c not in groups else c
            groups.setdefault(key, []).append((key == c, name))
        return list(groups.items())

    def mapping(self) -> dict[str, Any]:
        """The formula in JSON: its text and its terms."""
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
