"""Draw exciting and simulated motions, and build the page of an exciting motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from runtime.core.model import joint_labels
from runtime.ground.limits import LIMIT
from runtime.ground.part import BLUE, DOTTED, GREY, ORANGE
from runtime.reporting.figures import draw_figure, legend_above, panels
from runtime.reporting.page import Page, Section
from runtime.reporting.series import extremes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from runtime.excitation.result import Excitation
    from runtime.loop.result import Simulation

LINES = ("-", "--", ":", "-.")


def motion_figure(excitation: Excitation) -> Figure:
    """Draw q, qd and qdd of every joint over time, as shares of their limits, and the torques."""
    (t, q, qd, qdd, tau), limits = excitation.sampled(), excitation.limits
    middle, half = (limits.lower + limits.upper) / 2, (limits.upper - limits.lower) / 2
    limited = bool(np.all(np.isfinite(limits.tau)))
    torques = ("torque, N m or N", tau, False)
    if limited:
        torques = ("torque, of its limit", tau / limits.tau, True)
    names = joint_labels(excitation.model)

    def draw(ax: Axes, panel: tuple[str, np.ndarray, bool]) -> None:
        title, x, share = panel
        for j, name in enumerate(names):
            style: Any = {"linestyle": LINES[j // 7 % 4], "color": f"C{j % 7}"}
            ax.plot(t, x[:, j], linewidth=1.0, label=f"joint {name}", **style)
        if share:
            ax.set_ylim(-1.08, 1.08)
            for bound in (-1, 1):
                ax.axhline(bound, color="black", linewidth=0.8, linestyle=DOTTED)
        ax.set(title=title, xlim=(t[0], t[-1]), xlabel="time, s" if panel is torques else "")

    shares = (
        ("position, of its range", (q - middle) / half, True),
        ("velocity, of its limit", qd / limits.qd, True),
        ("acceleration, of its limit", qdd / limits.qdd, True),
        torques,
    )
    columns = min(6, len(names))
    return panels(shares, draw, 1, cell=(7.2, 2.0), legend=columns, letters=8)


def simulation_figure(
    joints: Sequence[str], simulation: Simulation, units: Sequence[tuple[str, str]]
) -> Figure:
    """Draw a simulation, one row per joint: position with reference, tracking error, torque.

    units : units of position and torque of each joint.
    """
    s, cells = simulation, []
    for k, (j, (position, torque)) in enumerate(zip(joints, units, strict=True)):
        last = "time, s" if k == len(joints) - 1 else ""
        reference = (s.q_r[:, k], GREY, "reference"), (s.q[:, k], BLUE, "simulated")
        error = ((s.q[:, k] - s.q_r[:, k], ORANGE, ""),)
        effort = (s.tau_measured[:, k], GREY, "recorded"), (s.tau[:, k], BLUE, "exact")
        cells += [
            (f"q{j}, {position}", last, reference, k == 0),
            (f"q{j} - qr{j}, {position}", last, error, False),
            (f"torque {j}, {torque}", last, effort, k == 0),
        ]

    def draw(ax: Axes, cell: tuple[str, str, Any, bool]) -> None:
        label, below, lines, named = cell
        shown = extremes(np.array([x for x, _, _ in lines]), LIMIT.INSTANTS_SHOWN)
        for x, color, name in lines:  # the first of two shows behind the second
            width = 2.4 if color == GREY else 0.9
            ax.plot(s.t[shown], x[shown], linewidth=width, color=color, label=name)
        ax.set_ylabel(label, fontsize=8)
        ax.set_xlabel(below)
        if named:
            legend_above(ax, fontsize=7)

    return panels(cells, draw, 3, cell=(3.5, 1.6), extra=0.8)


def excitation_page(excitation: Excitation) -> Page:
    """Build the report page of an exciting motion, with the expected standard deviations."""
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
                [excitation.limits.assumed] if excitation.limits.assumed else [],
                images=[draw_figure("The motion", motion_figure(excitation), shown, "motion")],
                tables=[excitation.usage_table()],
            ),
            Section("Expected standard deviations", tables=[excitation.sigma_table()]),
            Section("Search", tables=[excitation.starts_table()]),
        ],
    )
