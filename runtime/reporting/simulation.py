"""Figure of a closed-loop simulation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from runtime.limits import LIMIT
from runtime.reporting.figures import BLUE, GREY, ORANGE, STYLE, panels_figure
from runtime.reporting.series import extremes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from runtime.loop.result import Simulation


def simulation_figure(
    joints: Sequence[str], simulation: Simulation, units: Sequence[tuple[str, str]]
) -> Figure:
    """A row per joint: position and reference, tracking error, torque. units : of position and
    torque, by joint.
    """
    with mpl.rc_context(STYLE):
        figure, axes = panels_figure(len(joints), 3, (10.5, 1.6 * len(joints) + 0.8))
        for row, (j, (position, torque)) in enumerate(zip(joints, units, strict=True)):
            motion, error, effort = axes[3 * row : 3 * row + 3]
            _lines(
                motion,
                simulation.t,
                f"q{j}, {position}",
                (simulation.q_r[:, row], GREY, "reference"),
                (simulation.q[:, row], BLUE, "simulated"),
            )
            _lines(
                error,
                simulation.t,
                f"q{j} - qr{j}, {position}",
                (simulation.q[:, row] - simulation.q_r[:, row], ORANGE, ""),
            )
            _lines(
                effort,
                simulation.t,
                f"torque {j}, {torque}",
                (simulation.tau_measured[:, row], GREY, "recorded"),
                (simulation.tau[:, row], BLUE, "exact"),
            )
        for ax in axes[-3:]:
            ax.set_xlabel("time, s")
        for ax in (axes[0], axes[2]):
            ax.legend(
                fontsize=7,
                ncols=2,
                loc="lower left",
                bbox_to_anchor=(-0.02, 1.0),
                borderaxespad=0.2,
            )
    return figure


def _lines(ax: Any, t: Any, label: str, *lines: tuple[Any, str, str]) -> None:
    kept = extremes(np.array([x for x, _, _ in lines]), LIMIT.INSTANTS_SHOWN)
    for x, color, name in lines:  # the first of two shows behind the second
        ax.plot(t[kept], x[kept], linewidth=2.4 if color == GREY else 0.9, color=color, label=name)
    ax.set_ylabel(label, fontsize=8)
