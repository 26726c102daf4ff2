"""Figure and section of the resolution advisor: predicted curves beside sampled points, parameter
by parameter.
"""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from runtime.reporting.figures import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    STYLE,
    drawn,
    logarithmic,
    panels_figure,
    shared_legend,
)
from runtime.reporting.page import Section
from runtime.resolution.advice import NAMES, Advice, EncoderAdvice

COLUMNS = 5
LOWEST, HIGHEST = 0.03, 300.0  # %, of the axes


def advice_figure(advice: Advice) -> Figure:
    """%e against Delta for every parameter that matters, all encoders alike: line predicted, points
    sampled with their Student intervals.

    Real encoders, where they were judged, by both readers; else those of the chapter's law.
    """
    names = advice.deciding
    columns = min(COLUMNS, max(1, len(names)))
    rows = -(-len(names) // columns)
    curves = [("", advice.encoders[0], BLUE, ORANGE)]
    if advice.real:
        colors = (ORANGE, BLUE)
        curves = [
            (f"{NAMES[r.reader]}, ", r.encoders[0], color, color)
            for r, color in zip(advice.real, colors, strict=True)
        ]
    with mpl.rc_context(STYLE):
        figure, axes = panels_figure(
            rows, columns, (max(4.6, 2.1 * columns), 1.5 * rows + 1.0), used=len(names)
        )
        for ax, name in zip(axes, names, strict=False):
            for curve in curves:
                _panel(ax, *curve, advice.names.index(name))
            ax.set_title(name, fontsize=9)
        for k, ax in enumerate(axes):
            ax.tick_params(
                labelleft=k % columns == 0, labelbottom=k + columns >= len(names), labelsize=7
            )
        shared_legend(figure, axes[:1], 4, size=8)
        figure.supxlabel(f"resolution Δ of every encoder, {advice.unit}", fontsize=9)
        figure.supylabel("%e: change of the estimate, %", fontsize=9, x=0.005)
    return figure


def _panel(ax: Axes, reader: str, encoder: EncoderAdvice, line: str, points: str, i: int) -> None:
    e = np.abs(encoder.change[:, i])
    ax.plot(
        encoder.delta,
        np.where(e > 0, e, np.nan),
        color=line,
        linewidth=1.3,
        label=f"{reader}predicted",
    )
    delta = np.array([point.delta for point in encoder.sampled])
    change = np.array([abs(point.change[i]) for point in encoder.sampled])
    half = np.array([point.half_width[i] for point in encoder.sampled])
    below = np.minimum(half, change - LOWEST / 10).clip(
        min=0
    )  # an interval that holds zero ends below the axis
    ax.errorbar(
        delta,
        change,
        yerr=np.array([below, half]),
        color=points,
        fmt="o",
        markersize=3.5,
        linewidth=1.0,
        capsize=2,
        label=f"{reader}sampled, 95 %",
    )
    for limit in encoder.limits:
        ax.axhline(limit.percent, color=BLACK, linewidth=0.8, linestyle=(0, (1, 2)))
        if np.isfinite(limit.delta):
            ax.axvline(limit.delta, color=GREY, linewidth=0.8)
    logarithmic(ax)
    ax.set_ylim(LOWEST, HIGHEST)


def advice_section(advice: Advice) -> Section:
    """Steps by encoder and by parameter, the figure, the assumptions."""
    images = []
    if advice.deciding:
        images.append(
            drawn(
                (
                    "%e against resolution: predicted curve and sampled points of every parameter "
                    "that "
                    "matters; dotted: 1 % and 5 %; grey: the steps advised"
                ),
                advice_figure(advice),
                (
                    "Change of every parameter in per cent against encoder resolution, predicted "
                    "and "
                    "sampled, logarithmic axes"
                ),
                "advice",
            )
        )
    return Section(
        "Resolution advice",
        (advice.verdict, *advice.asked_lines(), *advice.assumptions),
        images,
        advice.tables(),
    )
