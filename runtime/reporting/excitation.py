"""Figures and page of an exciting motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from runtime.reporting.figures import STYLE, panels_figure
from runtime.reporting.page import Image, Page, Section
from runtime.table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from runtime.excitation.criteria import Limits

LINES = ("-", "--", ":", "-.")


def motion_figure(joints: Sequence[int], t: np.ndarray, states: Sequence[np.ndarray], limits: Limits) -> Figure:
    """q, qd, qdd of every joint as a share of its limits, and the torques; t (N,), states four arrays (N, n)."""
    q, qd, qdd, tau = states
    middle, half = (limits.lower + limits.upper) / 2, (limits.upper - limits.lower) / 2
    limited = bool(np.all(np.isfinite(limits.tau)))
    panels = (
        ("position, of its range", (q - middle) / half, True),
        ("velocity, of its limit", qd / limits.qd, True),
        ("acceleration, of its limit", qdd / limits.qdd, True),
        ("torque, of its limit" if limited else "torque, N m or N", tau / limits.tau if limited else tau, limited),
    )
    with mpl.rc_context(STYLE):
        figure, axes = panels_figure(4, 1, (7.2, 8.4))
        for ax, (title, x, share) in zip(axes, panels, strict=True):
            for j, name in enumerate(joints):
                ax.plot(t, x[:, j], linewidth=1.0, linestyle=LINES[j // 7 % 4], color=f"C{j % 7}", label=f"joint {name}")
            if share:
                ax.set_ylim(-1.08, 1.08)
                for bound in (-1, 1):
                    ax.axhline(bound, color="black", linewidth=0.8, linestyle=(0, (1, 2)))
            ax.set_title(title, fontsize=9)
            ax.set_xlim(t[0], t[-1])
        axes[-1].set_xlabel("time, s")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, ncols=min(6, len(joints)), loc="outside upper center", fontsize=8)
    return figure


def excitation_page(robot: str, verdict: str, svg: bytes, summary: Mapping[str, Any]) -> Page:
    """The report of a search."""
    before = summary["relative_sigma_of_record"]
    sigma = sorted(summary["relative_sigma"].items(), key=lambda item: -item[1])
    rows = [(name, f"{value:.3g}", *((f"{before[name]:.3g}",) if before else ())) for name, value in sigma]
    predicted = Table(
        "Predicted %sigma",
        ("parameter", "this motion", *(("motion of the record",) if before else ())),
        rows,
        f"Parameters and torque deviations: {summary['parameters_from']}. Torque noise is taken as white at the sampling rate; model error is not.",
    )
    count = len(next(iter(summary["limits_used"].values())))
    used = Table(
        "Share of the limits used, %",
        ("", *(f"joint {j + 1}" for j in range(count))),
        [(what, *(f"{100 * x:.1f}" for x in shares)) for what, shares in summary["limits_used"].items()],
        "At the controller rate. 100 is the limit; the optimiser keeps a margin.",
    )
    starts = Table(
        "Starts",
        ("start", "criterion", "violation", "end"),
        [(str(s["number"]), f"{s['criterion']:.4g}", f"{s['violation']:.1e}", s["message"]) for s in summary["starts"]],
    )
    shown = "position, velocity, acceleration of every joint as a share of its limits, and torques, over time"
    motion = Section("Motion", images=[Image("The motion", svg, shown)], tables=[used])
    return Page(
        title=f"{robot}: exciting motion",
        verdict=verdict,
        sections=[motion, Section("What it will tell", tables=[predicted]), Section("Search", tables=[starts])],
    )
