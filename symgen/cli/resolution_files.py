"""Files of a resolution study and of an advice, beside the page that tells them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runtime.resolution.advice import Advice
    from runtime.resolution.result import Cestac


def cestac_files(result: Cestac, *, curve: Cestac | None = None, names: Sequence[str] = ()) -> dict[str, str | bytes]:
    """The study in every format, and the figure where a position is perturbed, by file name.

    curve : the study that the figure shows, `result` without one.   names : parameters drawn in colour.
    """
    from runtime.reporting import figures as plots
    from runtime.reporting.arrays import array_files, cestac_arrays, cestac_csv

    files: dict[str, str | bytes] = {"cestac.json": result.to_json(), "cestac.csv": cestac_csv(result), "cestac.tex": result.to_latex()}
    files |= array_files("cestac", cestac_arrays(result))
    drawn = curve or result
    if any(level.level.delta and not level.level.torque for level in drawn.levels):
        figure = plots.error_against_resolution(drawn, names)
        files |= {"resolution.png": plots.png(figure), "resolution.svg": plots.svg(figure)}
    return files


def advice_files(advice: Advice) -> dict[str, str | bytes]:
    """advice.json and the figure, by file name."""
    from runtime.reporting import figures as plots
    from runtime.reporting.resolution_advice import advice_figure

    figure = advice_figure(advice)
    return {"advice.json": advice.to_json(), "advice.png": plots.png(figure), "advice.svg": plots.svg(figure)}
