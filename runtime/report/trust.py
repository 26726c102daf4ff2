"""Section of a report on how far an identification can be trusted, with the spectra of the residuals."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from runtime.report.html import Image, Section, Table
from runtime.report.plots import BLUE, GREY, ORANGE, STYLE, panels_figure, svg
from runtime.residuals import Whiteness
from runtime.trust import Trust


def spectra_figure(found: Sequence[Whiteness], unit: str = "N m") -> Figure:
    """Spectral density of the residuals joint by joint, and the level of white residuals of the same power."""
    columns = min(3, len(found))
    rows = -(-len(found) // columns)
    with mpl.rc_context(STYLE):
        figure, axes = panels_figure(rows, columns, (max(5.4, 3.2 * columns), 2.0 * rows + 0.6))
        for ax, w in zip(axes, found, strict=False):
            drawn = w.density > 0
            ax.semilogy(w.frequency[drawn], w.density[drawn], color=BLUE, linewidth=1.1, label="residuals")
            ax.axhline(float(np.mean(w.density)) or 1.0, color=ORANGE, linewidth=1.0, linestyle="--", label="white, same power")
            ax.axvline(w.half, color=GREY, linewidth=0.9, label="half of the power below")
            ax.set_title(f"joint {w.joint}", fontsize=9)
            ax.set_xlabel("frequency, Hz")
        for ax in axes[len(found) :]:
            ax.set_visible(False)
        figure.supylabel(f"density, ({unit})²/Hz", fontsize=9)
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, ncols=3, loc="outside upper center", fontsize=8)
    return figure


def trust_section(trust: Trust, unit: str = "N m") -> Section:
    """Deviations three ways, whiteness, F-tests along the trail, sets by threshold."""
    tables = [
        _table("Deviations: eq. (10), corrected for correlation, blocks of time drawn again", trust.scatter_lines()),
        _table("Residuals by joint: correlation of neighbours, Ljung-Box, rows that count, spectrum", trust.whiteness_lines()),
        _table("F-tests along the trail; rows that count instead of rows", trust.test_lines()),
        _table("Essential parameters by threshold; - removed besides, + kept besides", trust.set_lines()),
    ]
    image = Image(
        "Spectra of the residuals; a peak at the frequency of the motion is model error, not noise",
        svg(spectra_figure(trust.whiteness, unit)),
        "Spectral density of the residuals of every joint",
    )
    return Section("How far to trust it", trust.verdict, [image] if trust.whiteness else [], tables)


def _table(caption: str, lines: Sequence[Sequence[str]]) -> Table:
    return Table(caption, lines[0], lines[1:])
