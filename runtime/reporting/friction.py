"""Friction curves of the joints: figure and section of a report."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.figure import Figure

from runtime.identification.friction import FrictionCurve
from runtime.markup import number
from runtime.reporting import figures as plots
from runtime.reporting.page import Section
from runtime.table import Table


def friction_figure(curves: Sequence[FrictionCurve], unit: str = "N m") -> Figure:
    """Friction against velocity: rows in grey, bins with their 95 % intervals, the first law and
    the one that predicts.
    """
    columns = 1 if len(curves) == 1 else 2
    lines = -(-len(curves) // columns)
    speed = "m/s" if unit == "N" else "rad/s"
    with mpl.rc_context(plots.STYLE):
        figure, axes = plots.panels_figure(
            lines, columns, (4.8 * columns, 2.9 * lines + 0.4), used=len(curves)
        )
        for ax, curve in zip(axes, curves, strict=False):
            ax.plot(
                curve.v,
                curve.f,
                ".",
                color="#C8C8C8",
                markersize=2,
                zorder=1,
                label="rows",
                rasterized=True,
            )
            ax.errorbar(
                curve.centre,
                curve.mean,
                curve.half,
                fmt="o",
                color=plots.BLACK,
                markersize=3,
                linewidth=1.0,
                label="bins, 95 %",
            )
            first, predicting = curve.laws[0].name, curve.law_name
            for side in (curve.centre < 0, curve.centre >= 0):
                x = curve.centre[side]
                ax.plot(
                    x,
                    curve.law_torques[first][side],
                    color=plots.BLUE,
                    linewidth=1.2,
                    linestyle="--",
                    label="Coulomb and viscous",
                )
                if predicting != first:
                    ax.plot(
                        x,
                        curve.law_torques[predicting][side],
                        color=plots.ORANGE,
                        linewidth=1.4,
                        label="chosen law",
                    )
            ax.set_title(f"joint {curve.joint}: {curve.label}", fontsize=9)
            ax.set_xlabel(f"velocity, {speed}")
            ax.set_ylabel(f"friction, {unit}")
            ax.axhline(0, color=plots.GREY, linewidth=0.6)
            ax.axvline(0, color=plots.GREY, linewidth=0.6)
        plots.shared_legend(figure, axes, 2 * columns)
    return figure


def friction_section(curves: Sequence[FrictionCurve], unit: str = "N m") -> Section:
    """The figure, the laws compared joint by joint, the parameters of those that predict."""
    compared = [
        (
            curve.joint,
            law.name,
            number(law.error, ".2f"),
            number(law.held_out, ".2f"),
            number(law.aic, "+.1f"),
            number(law.p_value, ".2g"),
        )
        for curve in curves
        for law in curve.laws
    ]
    laws = [
        (
            curve.joint,
            curve.label,
            ", ".join(
                f"{name} {x:.4g} ± {curve.law.sigma[name]:.2g}"
                for name, x in curve.law.parameters.items()
            ),
        )
        for curve in curves
    ]
    text = (
        "What the rest of the model leaves of the torque of each joint, against its velocity. A "
        "law with more terms is chosen only if it predicts "
        "blocks of time that did not fit it at least 1 % better and passes the F-test, which "
        "counts independent samples.",
        *(f"Joint {curve.joint}: {curve.note}." for curve in curves if curve.note),
    )
    image = plots.drawn(
        "Friction against velocity",
        friction_figure(curves, unit),
        "Friction torque against velocity, joint by joint, with laws",
        "friction",
    )
    tables = [
        Table(
            "Laws compared",
            (
                "joint",
                "law",
                "error %",
                "held-out error %",
                "AIC against the first",
                "p of the F-test",
            ),
            compared,
        ),
        Table("Chosen laws, SI", ("joint", "law", "parameters"), laws),
    ]
    return Section("Friction curves", text, [image], tables)
