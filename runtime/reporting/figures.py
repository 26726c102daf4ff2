"""Figures of a report. matplotlib only here, through its object interface: no global state, no
window, same data same bytes.

Colours are those of Okabe and Ito, distinct with any colour vision; line styles and widths differ
too, so that a grey print can be read.
"""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from runtime.identification.validation import Comparison, JointComparison
from runtime.limits import LIMIT
from runtime.reporting.page import Image
from runtime.reporting.panels import PanelLayout
from runtime.reporting.series import Series, series
from runtime.resolution.result import Cestac

BLACK, BLUE, ORANGE, GREEN, PURPLE, SKY, GREY = (
    "#000000",
    "#0072B2",
    "#D55E00",
    "#007A5A",
    "#AA4499",
    "#56B4E9",
    "#9A9A9A",
)
MARKED = ((BLUE, "o"), (ORANGE, "s"), (GREEN, "^"), (PURPLE, "D"), (SKY, "v"), ("#8C6D00", "P"))
STYLE: Any = {
    "font.size": 9.0,
    "text.parse_math": False,  # names of joints are shown as they are
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.titley": 1.0,  # not sought
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "svg.hashsalt": "symgen",
    "svg.fonttype": "path",
    "path.simplify": True,
}
DPI = 150
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def drawn(
    caption: str, figure: Figure, alt: str, name: str = "", series: Series | None = None
) -> Image:
    """The figure for a page.   name : of its files beside the page, PNG and SVG; none: the page
    alone has it.
    """
    picture = svg(figure)
    return Image(
        caption,
        picture,
        alt,
        series,
        {f"{name}.png": png(figure), f"{name}.svg": picture} if name else {},
    )


def svg(figure: Figure) -> bytes:
    """The figure as SVG, letters as outlines."""
    return _rendered(figure, "svg")


def png(figure: Figure) -> bytes:
    """The figure as PNG, 150 dots per inch."""
    return _rendered(figure, "png")


def joint_overlay(joint: JointComparison, unit: str = "N m", source: str = "measured") -> Figure:
    """Measured and predicted torque of one joint, and their difference below (chapter, Fig. 4).
    source : "measured" or "simulated".
    """
    with mpl.rc_context(STYLE):
        figure = empty_figure((5.4, 3.4), layout=PanelLayout())
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        t, measured, predicted, error = _broken(joint)
        upper.plot(t, measured, color=BLACK, linewidth=1.5, label=source)
        upper.plot(
            t, predicted, color=ORANGE, linewidth=1.0, linestyle=(0, (4, 1)), label="predicted"
        )
        lower.plot(t, error, color=BLUE, linewidth=0.7, label="error")
        upper.set_ylabel(f"torque, {unit}")
        lower.set_ylabel(f"error, {unit}")
        lower.set_xlabel("time, s")
        upper.set_title(_title(joint), fontsize=9, loc="right")
        upper.legend(
            ncols=2,
            loc="lower left",
            bbox_to_anchor=(-0.02, 1.0),
            fontsize=8,
            handlelength=2.0,
            columnspacing=1.0,
            borderaxespad=0.2,
        )
    return figure


def torque_overlay(comparison: Comparison, unit: str = "N m", source: str = "measured") -> Figure:
    """Fig. 4 of the chapter: every joint in a panel of its own."""
    joints = comparison.joints
    columns = 1 if len(joints) == 1 else 2
    rows = -(-len(joints) // columns)
    with mpl.rc_context(STYLE):
        figure, axes = panels_figure(
            rows, columns, (4.8 * columns, 2.3 * rows + 0.4), used=len(joints)
        )
        for ax, joint in zip(axes, joints, strict=False):
            _overlay(ax, joint, unit, source)
        shared_legend(figure, axes[:1], 3)
    return figure


def residual_histogram(comparison: Comparison, unit: str = "N m") -> Figure:
    """Residuals of every joint, each beside the normal law of the same deviation."""
    joints = comparison.joints
    columns = min(3, len(joints))
    rows = -(-len(joints) // columns)
    with mpl.rc_context(STYLE):
        figure, axes = panels_figure(
            rows, columns, (max(5.4, 3.2 * columns), 2.1 * rows + 0.4), used=len(joints)
        )
        for ax, joint in zip(axes, joints, strict=False):
            deviation = float(np.std(joint.error)) or 1.0
            x = np.linspace(-4, 4, 161)
            ax.stairs(
                *np.histogram(joint.error / deviation, bins=40, range=(-4, 4), density=True),
                fill=True,
                color=SKY,
                zorder=2,
            )
            ax.plot(x, np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), color=BLACK, linewidth=1.2)
            ax.set_title(f"joint {joint.joint}, deviation {deviation:.3g} {unit}", fontsize=9)
            ax.set_xlabel("residual / deviation")
            ax.set_yticks([])
    return figure


def error_against_resolution(result: Cestac, names: Sequence[str] = ()) -> Figure:
    """%e (21) against Delta on logarithmic axes, with the limits of the verdict and the increase of
    the residual.

    names : parameters drawn in colour; default: the six of smallest %sigma (11). The other deciding
    ones are grey.
    """
    levels = [level for level in result.levels if level.level.delta and not level.level.torque]
    levels.sort(key=lambda level: level.level.delta)
    unit = (
        "m"
        if {result.reference.units.get(name, "") for name in result.names} & {"N*s/m", "kg"}
        else "rad"
    )
    delta = np.array([level.level.delta for level in levels])
    e = np.array([level.e for level in levels]).reshape(len(levels), -1)
    coloured = [name for name in names if name in result.names] or _sharpest(result)
    with mpl.rc_context(STYLE):
        figure, (ax,) = panels_figure(1, 1, (6.4, 4.4), right=0.45, below=0.25)
        for name in result.deciding:
            if name not in coloured:
                ax.plot(
                    delta,
                    _drawn(e[:, result.names.index(name)]),
                    color="#C8C8C8",
                    linewidth=0.8,
                    zorder=1,
                )
        for (color, marker), name in zip(MARKED, coloured, strict=False):
            ax.plot(
                delta,
                _drawn(e[:, result.names.index(name)]),
                color=color,
                marker=marker,
                markersize=5,
                linewidth=1.4,
                label=name,
            )
        ax.plot(
            delta,
            _drawn(np.array([abs(level.increase) for level in levels])),
            color=BLACK,
            linestyle="--",
            linewidth=1.8,
            label="residual, of |Y|",
        )
        logarithmic(ax)
        ax.set_ylim(0.01, 1000)
        for limit in (LIMIT.NEGLIGIBLE, LIMIT.BIASED):
            ax.axhline(limit, color=BLACK, linewidth=0.9, linestyle=(0, (1, 2)))
            ax.annotate(
                f"{limit:g} %",
                (1.0, limit),
                xycoords=("axes fraction", "data"),
                xytext=(3, 0),
                textcoords="offset points",
                va="center",
            )
        ax.set_xticks(
            delta,
            [level.level.label.replace("2*pi/", "2π/") for level in levels],
            rotation=30,
            ha="right",
            fontsize=8,
        )
        ax.set_xlabel(f"resolution Δ, {unit}")
        ax.set_ylabel("%e: change of the estimate, %")
        shared_legend(figure, [ax], 4, size=8)
    return figure


def _overlay(ax: Axes, joint: JointComparison, unit: str, source: str) -> None:
    """Lines break where rows were left out or another record starts."""
    t, measured, predicted, error = _broken(joint)
    ax.plot(t, measured, color=BLACK, linewidth=1.5, label=source)
    ax.plot(t, predicted, color=ORANGE, linewidth=1.0, linestyle=(0, (4, 1)), label="predicted")
    ax.plot(t, error, color=BLUE, linewidth=0.7, label="error")
    ax.set_title(_title(joint), fontsize=9)
    ax.set_xlabel("time, s")
    ax.set_ylabel(f"torque, {unit}")


def _title(joint: JointComparison) -> str:
    return f"joint {joint.joint}, error {joint.relative_error:.1f} %"


def _broken(joint: JointComparison) -> tuple[np.ndarray, ...]:
    """Time, measured, predicted torque and error as they are drawn: as many instants as show."""
    thinned = series(joint, "", "")
    return thinned.t, thinned.first, thinned.second, thinned.first - thinned.second


def _sharpest(result: Cestac) -> list[str]:
    order = np.argsort(result.reference.relative_sigma, kind="stable")
    return [result.names[i] for i in order[: len(MARKED)]]


def _drawn(values: np.ndarray) -> np.ndarray:
    """Values of a logarithmic axis: zeros and what is not finite are not drawn."""
    return np.where(np.isfinite(values) & (values > 0), values, np.nan)


def panels_figure(
    rows: int,
    columns: int,
    size: tuple[float, float],
    *,
    used: int | None = None,
    right: float = 0.12,
    below: float = 0.0,
) -> tuple[Figure, list[Axes]]:
    """A figure of `size`, inch, and its panels row by row; there are none beyond `used`.

    right, below : room for what stands to the right of a panel, and below it besides a line of
    ticks and a label, inch.
    """
    figure = empty_figure(size, layout=PanelLayout(right=right, below=below))
    grid = figure.add_gridspec(rows, columns)
    return figure, [
        figure.add_subplot(grid[k]) for k in range(rows * columns if used is None else used)
    ]


def shared_legend(
    figure: Figure, panels: Sequence[Axes], columns: int, *, size: float = STYLE["font.size"]
) -> None:
    """One legend of some panels above the figure, every label once."""
    entries = {
        label: handle
        for ax in panels
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        list(entries.values()), list(entries), ncols=columns, loc="upper center", fontsize=size
    )


def logarithmic(ax: Axes, axes: str = "xy") -> None:
    """Logarithmic axes of a panel: 0.01, 1, 100, 10⁴; no ticks between the powers of ten."""
    for name in axes:
        ax.set(**{f"{name}scale": "log"})
        axis = getattr(ax, f"{name}axis")
        axis.set_major_formatter(FuncFormatter(_power))
        axis.set_minor_locator(NullLocator())


def _power(x: float, _: int) -> str:
    return f"{x:g}" if 1e-3 < x < 1e4 else "10" + str(round(np.log10(x))).translate(RAISED)


def empty_figure(size: tuple[float, float], layout: Any = "constrained") -> Figure:
    figure = Figure(figsize=size, layout=layout)
    FigureCanvasAgg(figure)
    return figure


def _rendered(figure: Figure, form: str) -> bytes:
    """The figure in one form. Panels get their places once: matplotlib alone would seek them twice
    for each form.
    """
    stream = BytesIO()
    with mpl.rc_context(STYLE):
        if (engine := figure.get_layout_engine()) is not None:
            engine.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(
            stream,
            format=form,
            dpi=DPI,
            metadata={"Date": None} if form == "svg" else {"Software": None},
        )
    return stream.getvalue()
