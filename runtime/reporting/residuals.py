"""What the model leaves of the torques, joint by joint: distribution and spectrum."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from runtime.identification.residuals import Whiteness
from runtime.identification.result import Identification
from runtime.reporting.figures import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    STYLE,
    drawn,
    logarithmic,
    panels_figure,
    residual_histogram,
    shared_legend,
)
from runtime.reporting.page import Section
from runtime.signals.decimation import CUTOFF


def residual_section(result: Identification, unit: str = "N m") -> Section:
    """Spectra with the cut-off of the decimation, histograms with the normal law."""
    joints = result.uncertainty.whiteness
    if not joints:
        return Section("Residuals: spectrum and distribution")
    cutoff = decimation_cutoff(result)
    peaks = ", ".join(f"joint {w.joint} {w.peak:.3g} Hz" for w in joints)
    text = [
        "A peak at the frequency of the motion is model error, not noise: friction, flexibility or "
        "a parameter that is missing. A level that is flat up to "
        "the cut-off and falls behind it is filtered noise, the best there is.",
        f"Largest density: {peaks}.",
    ]
    if cutoff is not None:
        text.append(
            f"The rows come {result.observation.rate:g} times a second; the filter of the "
            f"decimation ends at {cutoff:g} Hz (dotted)."
        )
    images = [
        drawn(
            "Spectral density of the residuals",
            spectra_figure(joints, unit, cutoff),
            "Spectral density of the residuals of every joint, by frequency",
        ),
        drawn(
            "Residuals over their deviation; line: normal law",
            residual_histogram(result.comparison, unit),
            "Histograms of the residuals, joint by joint",
            "residuals",
        ),
    ]
    return Section("Residuals: spectrum and distribution", text, images)


def decimation_cutoff(result: Identification) -> float | None:
    """Where the filter of the parallel decimation ends, Hz; None without one."""
    if result.study.signals.decimate is None or result.observation.settings.get("factor") == 1:
        return None
    return CUTOFF * result.observation.rate / 2


def spectra_figure(
    joints: Sequence[Whiteness], unit: str = "N m", cutoff: float | None = None
) -> Figure:
    """Spectral density of the residuals joint by joint, and the level of white residuals of the
    same power.
    """
    columns = min(3, len(joints))
    rows = -(-len(joints) // columns)
    with mpl.rc_context(STYLE):
        figure, axes = panels_figure(
            rows, columns, (max(5.4, 3.2 * columns), 2.0 * rows + 0.6), used=len(joints)
        )
        for ax, w in zip(axes, joints, strict=False):
            positive = w.density > 0
            ax.plot(
                w.frequency[positive],
                w.density[positive],
                color=BLUE,
                linewidth=1.1,
                label="residuals",
            )
            ax.axhline(
                float(np.mean(w.density)) or 1.0,
                color=ORANGE,
                linewidth=1.0,
                linestyle="--",
                label="white, same power",
            )
            ax.axvline(w.half, color=GREY, linewidth=0.9, label="half of the power below")
            if cutoff is not None:
                ax.axvline(
                    cutoff,
                    color=BLACK,
                    linewidth=1.1,
                    linestyle=(0, (1, 2)),
                    label="cut-off of the decimation",
                )
            logarithmic(ax, "y")
            ax.set_title(f"joint {w.joint}", fontsize=9)
            ax.set_xlabel("frequency, Hz")
        figure.supylabel(f"density, ({unit})²/Hz", fontsize=9, x=0.005)
        shared_legend(figure, axes[:1], 2, size=8)
    return figure
