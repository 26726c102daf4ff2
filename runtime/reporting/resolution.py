"""A resolution study on a page of its own: its part under another title and with a longer curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from runtime.core.cestac.result import Cestac, error_against_resolution
from runtime.reporting import figures as plots
from runtime.reporting.page import Number, Section, State
from runtime.reporting.sections import part_section


def resolution_section(
    result: Cestac,
    title: str = "Encoder resolution",
    *,
    curve: Cestac | None = None,
    names: Sequence[str] = (),
) -> Section:
    """Table 3 of the chapter with %e and %sigma, both readings of %e(rho), and the curve of %e
    against Delta.

    curve : study with more steps, for the figure.   names : parameters that it draws in colour.
    """
    shown = curve or result
    figures = [error_against_resolution(shown, names)] if shown.figures() else []
    return replace(part_section(result), title=title, images=[*map(plots.of_part, figures)])


def level_numbers(result: Cestac) -> list[Number]:
    """The verdict of every step, for the head of a page."""
    states: dict[str, State] = {"unbiased": "good", "doubtful": "doubtful", "biased": "no"}
    return [Number(r.level.label, r.verdict, states[r.verdict]) for r in result.levels]
