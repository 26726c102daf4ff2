"""Figures and page of an exciting motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from runtime.model.generated import joint_labels
from runtime.reporting.figures import STYLE, drawn, panels_figure, shared_legend
from runtime.reporting.page import Page, Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from runtime.excitation.result import Excitation

LINES = ("-", "--", ":", "-.")


def motion_figure(excitation: Excitation) -> Figure:
    """q, qd, qdd of every joint as a share of its limits, and the torques."""
    (t, q, qd, qdd, tau), limits = excitation.sampled(), excitation.limits
    middle, half = (limits.lower + limits.upper) / 2, (limits.upper - limits.lower) / 2
    limited = bool(np.all(np.isfinite(limits.tau)))
    panels = (
        ("position, of its range", (q - middle) / half, True),
        ("velocity, of its limit", qd / limits.qd, True),
        ("acceleration, of its limit", qdd / limits.qdd, True),
        (
            "torque, of its limit" if limited else "torque, N m or N",
            tau / limits.tau if limited else tau,
            limited,
        ),
    )
    with mpl.rc_context(STYLE):
        figure, axes = panels_figure(4, 1, (7.2, 8.4))
        for ax, (title, x, share) in zip(axes, panels, strict=True):
            for j, name in enumerate(joint_labels(excitation.model)):
                ax.plot(
                    t,
                    x[:, j],
                    linewidth=1.0,
                    linestyle=LINES[j // 7 % 4],
                    color=f"C{j % 7}",
                    label=f"joint {name}",
                )
            if share:
                ax.set_ylim(-1.08, 1.08)
                for bound in (-1, 1):
                    ax.axhline(bound, color="black", linewidth=0.8, linestyle=(0, (1, 2)))
            ax.set_title(title, fontsize=9)
            ax.set_xlim(t[0], t[-1])
        axes[-1].set_xlabel("time, s")
        shared_legend(figure, axes[:1], min(6, len(excitation.model.JOINTS)), size=8)
    return figure


def excitation_page(excitation: Excitation) -> Page:
    """The report of a search."""
    shown = (
        "position, velocity, acceleration of every joint as a share of its limits, and "
        "torques, over time"
    )
    return Page(
        title=f"{excitation.model.NAME}: exciting motion",
        verdict=excitation.verdict,
        sections=[
            Section(
                "Motion",
                images=[drawn("The motion", motion_figure(excitation), shown, "motion")],
                tables=[excitation.usage_table()],
            ),
            Section("What it will tell", tables=[excitation.sigma_table()]),
            Section("Search", tables=[excitation.starts_table()]),
        ],
    )
