"""A resolution study and an advice on encoders: figures, text and sections of a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from runtime.advisor.advice import NAMES, Advice, EncoderAdvice
from runtime.core.cestac.result import Cestac
from runtime.reporting import figures as plots
from runtime.reporting.page import Number, Section, State

COLUMNS = 5
LOWEST, HIGHEST = 0.03, 300.0  # %, of the axes


def resolution_section(
    result: Cestac,
    title: str = "Encoder resolution",
    *,
    curve: Cestac | None = None,
    names: Sequence[str] = (),
) -> Section:
    """Table 3 of the chapter with %e and %sigma, both readings of %e(rho), and the curve of %e
    against Delta.
    """
    shown = curve or result
    several = sum(1 for r in shown.levels if r.level.delta and not r.level.torque) > 0
    image = (
        plots.drawn(
            "%e against resolution; dotted: the limits of the verdict, 1 % and 5 %; dashed: "
            "increase of the residual norm in % of |Y|; grey: the "
            "other parameters that decide",
            plots.error_against_resolution(shown, names),
            "Change of the estimates in per cent against encoder resolution, logarithmic axes",
            "resolution",
        )
        if several
        else None
    )
    text = (
        "Two verdicts stand below. The printed rule asks every parameter that decides, and "
        "%e(rho), to stay below 1 % (practically unbiased) and calls "
        "5 % biased. The chapter's section 4.1.4 calls the residual the best single indicator, as "
        "it sees the whole model: the last verdict applies "
        "the same limits to the increase of its norm alone.",
        *(f"{r.level.label}: {r.message}" for r in result.levels),
        *result.notes,
    )
    return Section(
        title,
        text,
        [image] if image else [],
        [result.mean_table(), result.error_table(), result.residual_table()],
    )


def level_numbers(result: Cestac) -> list[Number]:
    """The verdict of every step, for the head of a page."""
    states: dict[str, State] = {"unbiased": "good", "doubtful": "doubtful", "biased": "no"}
    return [Number(r.level.label, r.verdict, states[r.verdict]) for r in result.levels]


def advice_figure(advice: Advice) -> Figure:
    """%e against Delta for every parameter that matters, all encoders alike: line predicted, points
    sampled with their Student intervals.

    Real encoders, where they were judged, by both readers; else those of the chapter's law.
    """
    names, colors = advice.deciding, (plots.ORANGE, plots.BLUE)
    curves = [("", advice.encoders[0], plots.BLUE, plots.ORANGE)]
    if advice.real:
        curves = [
            (f"{NAMES[r.reader]}, ", r.encoders[0], color, color)
            for r, color in zip(advice.real, colors, strict=True)
        ]

    def draw(ax: Axes, name: str) -> None:
        for curve in curves:
            _panel(ax, *curve, advice.names.index(name))
        ax.set_title(name)

    size: Any = {"cell": (2.1, 1.5), "extra": 1.0, "least": 4.6}
    figure = plots.panels(names, draw, COLUMNS, legend=4, letters=8, **size)
    columns = min(COLUMNS, len(names))
    for k, ax in enumerate(figure.axes):
        outer: Any = {"labelleft": k % columns == 0, "labelbottom": k + columns >= len(names)}
        ax.tick_params(labelsize=7, **outer)
    figure.supxlabel(f"resolution Δ of every encoder, {advice.unit}", fontsize=9)
    figure.supylabel("%e: change of the estimate, %", fontsize=9)
    return figure


def _panel(ax: Axes, reader: str, encoder: EncoderAdvice, line: str, points: str, i: int) -> None:
    e = np.abs(encoder.change[:, i])
    shown = np.where(e > 0, e, np.nan)
    ax.plot(encoder.delta, shown, color=line, linewidth=1.3, label=f"{reader}predicted")
    delta = np.array([point.delta for point in encoder.sampled])
    change = np.array([abs(point.change[i]) for point in encoder.sampled])
    half = np.array([point.half_width[i] for point in encoder.sampled])
    below = np.minimum(half, change - LOWEST / 10).clip(
        min=0
    )  # an interval that holds zero ends below the axis
    style: Any = {"fmt": "o", "markersize": 3.5, "linewidth": 1.0, "capsize": 2}
    label = f"{reader}sampled, 95 %"
    ax.errorbar(delta, change, yerr=np.array([below, half]), color=points, label=label, **style)
    for limit in encoder.limits:
        ax.axhline(limit.percent, color=plots.BLACK, linewidth=0.8, linestyle=plots.DOTTED)
        if np.isfinite(limit.delta):
            ax.axvline(limit.delta, color=plots.GREY, linewidth=0.8)
    plots.logarithmic(ax)
    ax.set_ylim(LOWEST, HIGHEST)


def advice_section(advice: Advice) -> Section:
    """Steps by encoder and by parameter, the figure, the assumptions."""
    images = []
    if advice.deciding:
        images.append(
            plots.drawn(
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
