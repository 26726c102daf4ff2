"""Show a study of the encoder resolution: its section on a page, and numbers for the page head."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import log2, pi

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
    """Build the section of a study of encoder steps: tables of errors, and curves over the step.

    The table is Table 3 of the chapter, with both definitions of %e(rho).

    curve : study with more steps, for the figure.
    names : parameters that are coloured in the figure.
    """
    shown = curve or result
    figures = [error_against_resolution(shown, names)] if shown.figures() else []
    return replace(part_section(result), title=title, images=[*map(plots.of_part, figures)])


def level_numbers(result: Cestac) -> list[Number]:
    """Write, for each encoder or torque step, the verdict and the largest error, %.

    The error is that of a parameter or of the residual. Encoder steps are given in counts per turn
    and bits too. The numbers are for the head of a page.
    """
    states: dict[str, State] = {"unbiased": "good", "doubtful": "doubtful", "biased": "no"}
    turns = not {*result.reference.units.values()} & {"N*s/m", "kg"}
    numbers = []
    for level in result.levels:
        label, delta = level.level.label, level.level.delta
        if turns and delta and not level.level.torque:
            counts = 2 * pi / delta
            label += f": {counts:.0f} counts per turn, {log2(counts):.1f} bits"
        name, error = next(iter(level.decided_by.items()), ("rho", 0.0))
        most = f"{'residual' if name == 'rho' else name} {error:.1f} %"
        numbers.append(Number(label, f"{level.verdict}, {most}", states[level.verdict]))
    return numbers
