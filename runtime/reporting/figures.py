"""Draw the figures of a report with matplotlib.

Only this module and its users load matplotlib, through its object interface: no global state and no
window. Equal data give equal bytes. The colours are those of Okabe and Ito, which people with any
colour vision can distinguish. Line styles and widths differ too, so that a grey print can be read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import BytesIO
from typing import Any, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from runtime.core.residuals import Whiteness
from runtime.core.validation import JointComparison
from runtime.ground.part import BLACK, BLUE, DOTTED, GREY, ORANGE, SKY
from runtime.ground.part import Figure as PartFigure
from runtime.reporting.page import Image
from runtime.reporting.series import Series, series

T = TypeVar("T")
STYLE: Any = {
    "font.size": 9.0,
    "text.parse_math": False,  # names of joints are shown as they are
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.titlesize": 9.0,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "svg.hashsalt": "symgen",
    "svg.fonttype": "path",
    "path.simplify": True,
}
DPI = 150
FORMS: Any = {  # without clock and version; level 3 compresses as well as 6, in less time
    "svg": {"metadata": {"Date": None}},
    "png": {"metadata": {"Software": None}, "pil_kwargs": {"compress_level": 3}},
}
MEASURED: Any = {"color": GREY, "linewidth": 2.4}
PREDICTED: Any = {"color": BLACK, "linewidth": 0.8}
ERROR: Any = {"color": BLUE, "linewidth": 0.7, "label": "error"}
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def draw_figure(
    caption: str, figure: Figure, alt: str, name: str = "", series: Series | None = None
) -> Image:
    """Convert a matplotlib figure into an Image, which a report page can show.

    name : name of the files, PNG and SVG, that are written next to the page; "": no files.
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
    """Convert a matplotlib figure to the bytes of an SVG file, with letters as outlines."""
    return _rendered(figure, "svg")


def png(figure: Figure) -> bytes:
    """Convert a matplotlib figure to the bytes of a PNG file, 150 dots per inch."""
    return _rendered(figure, "png")


def joint_overlay(joint: JointComparison, unit: str = "N m", source: str = "measured") -> Figure:
    """Draw measured and predicted torque of one joint, with the error below, over time.

    source : "measured" or "simulated".
    """
    with mpl.rc_context(STYLE):
        figure = empty_figure((5.4, 3.4))
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        _torques(upper, lower, joint, source)
        upper.set_ylabel(f"torque, {unit}")
        lower.set(ylabel=f"error, {unit}", xlabel="time, s")
        upper.set_title(_title(joint), loc="right")
        legend_above(upper, fontsize=8, handlelength=2.0, columnspacing=1.0)
    return figure


def torque_overlay(
    comparison: Sequence[JointComparison], unit: str = "N m", source: str = "measured"
) -> Figure:
    """Draw measured torque, predicted torque and error of each joint, as Fig. 4 of the chapter."""

    def draw(ax: Axes, joint: JointComparison) -> None:
        _torques(ax, ax, joint, source)
        ax.set(title=_title(joint), xlabel="time, s", ylabel=f"torque, {unit}")

    return panels(comparison, draw, 2, cell=(4.8, 2.3), legend=3)


def residual_histogram(comparison: Sequence[JointComparison], unit: str = "N m") -> Figure:
    """Draw a histogram of the residuals of each joint, divided by their standard deviation.

    The line is the normal distribution.
    """
    x = np.linspace(-4, 4, 161)
    normal = np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi)

    def draw(ax: Axes, joint: JointComparison) -> None:
        deviation = float(np.std(joint.error)) or 1.0
        density, edges = np.histogram(joint.error / deviation, bins=40, range=(-4, 4), density=True)
        ax.stairs(density, edges, fill=True, color=SKY, zorder=2)
        ax.plot(x, normal, color=BLACK, linewidth=1.2)
        title = f"joint {joint.joint}, deviation {deviation:.3g} {unit}"
        ax.set(title=title, xlabel="residual / deviation", yticks=[])

    with_rows = [joint for joint in comparison if len(joint.t)]
    return panels(with_rows, draw, 3, cell=(3.2, 2.1), least=5.4)


def spectra_figure(
    joints: Sequence[Whiteness], unit: str = "N m", cutoff: float | None = None
) -> Figure:
    """Draw the spectral density of the residuals of each joint, over frequency.

    A line shows the density of white residuals with the same power.
    """

    def draw(ax: Axes, w: Whiteness) -> None:
        positive, level = w.density > 0, float(np.mean(w.density)) or 1.0
        ax.plot(
            w.frequency[positive], w.density[positive], color=BLUE, linewidth=1.1, label="residuals"
        )
        ax.axhline(level, color=ORANGE, linewidth=1.0, linestyle="--", label="white, same power")
        ax.axvline(w.half, color=GREY, linewidth=0.9, label="half of the power below")
        if cutoff is not None:
            name = "cut-off of the decimation"
            ax.axvline(cutoff, color=BLACK, linewidth=1.1, linestyle=DOTTED, label=name)
        logarithmic(ax, "y")
        ax.set(title=f"joint {w.joint}", xlabel="frequency, Hz")

    figure = panels(joints, draw, 3, cell=(3.2, 2.0), extra=0.6, least=5.4, legend=2, letters=8)
    figure.supylabel(f"density, ({unit})²/Hz", fontsize=9)
    return figure


def _torques(upper: Axes, lower: Axes, joint: JointComparison, source: str) -> None:
    """Plot measured torque, predicted torque and error of one joint into the given axes.

    Lines break where rows were left out or another record starts.
    """
    thinned = series(joint, "", "")
    upper.plot(thinned.t, thinned.measured, label=source, **MEASURED)
    upper.plot(thinned.t, thinned.predicted, label="predicted", **PREDICTED)
    lower.plot(thinned.t, thinned.measured - thinned.predicted, **ERROR)


def _title(joint: JointComparison) -> str:
    return f"joint {joint.joint}, error {joint.relative_error:.1f} %"


def panels(
    items: Sequence[T],
    draw: Callable[[Axes, T], None],
    columns: int,
    *,
    cell: tuple[float, float],
    extra: float = 0.4,
    least: float = 0.0,
    legend: int = 0,
    letters: float = STYLE["font.size"],
) -> Figure:
    """Draw a figure with one panel for each item (for instance each joint), row by row.

    Parameters
    ----------
    draw : function of Axes and an item
        Fills a panel.
    columns : int
        Largest number of panels in a row.
    cell : (float, float), inch
        Width and height of a panel; `extra` is added to the total height, and the figure is at
        least `least` wide.
    legend : int
        Columns of the common legend above the figure, which has every label once, in letters of
        `letters` points; 0: no legend.
    """
    columns = max(1, min(columns, len(items)))
    rows = -(-len(items) // columns)
    with mpl.rc_context(STYLE):
        size = (max(least, cell[0] * columns), cell[1] * rows + extra)
        figure = empty_figure(size)
        grid = figure.add_gridspec(rows, columns)
        for k, item in enumerate(items):
            draw(figure.add_subplot(grid[k]), item)
        if legend:
            labelled = [ax.get_legend_handles_labels() for ax in figure.axes]
            entries = {name: handle for own in labelled for handle, name in zip(*own, strict=True)}
            handles = list(entries.values())
            place: Any = "outside upper center"
            figure.legend(handles, list(entries), ncols=legend, loc=place, fontsize=letters)
    return figure


def of_part(figure: PartFigure) -> Image:
    """Draw the figure that one analysis defines, and return it as an Image for a page."""

    def draw(ax: Axes, fill: Callable[[Axes], None]) -> None:
        if figure.logarithmic:
            logarithmic(ax)
        fill(ax)

    shape: Any = {"cell": figure.cell, "extra": figure.extra, "least": figure.least}
    legend: Any = {"legend": figure.legend, "letters": figure.letters}
    image = panels(figure.panels, draw, figure.columns, **shape, **legend)
    columns = min(figure.columns, len(figure.panels))
    if figure.x or figure.y:
        for k, ax in enumerate(image.axes):
            lowest = k + columns >= len(figure.panels)
            ax.tick_params(labelsize=7, labelleft=k % columns == 0, labelbottom=lowest)
    if figure.x:
        image.supxlabel(figure.x, fontsize=9)
    if figure.y:
        image.supylabel(figure.y, fontsize=9)
    return draw_figure(figure.caption, image, figure.alt, figure.name)


def legend_above(ax: Axes, **style: Any) -> None:
    """Place the legend of a panel above its left edge, in two columns."""
    place: Any = {"loc": "lower left", "bbox_to_anchor": (-0.02, 1.0), "borderaxespad": 0.2}
    ax.legend(ncols=2, **place, **style)


def logarithmic(ax: Axes, axes: str = "xy") -> None:
    """Make the axes of a panel logarithmic, with the labels 0.01, 1, 100, 10⁴.

    There are no ticks between the powers of ten.
    """
    for name in axes:
        ax.set(**{f"{name}scale": "log"})
        axis = getattr(ax, f"{name}axis")
        axis.set_major_formatter(FuncFormatter(_power))
        axis.set_minor_locator(NullLocator())


def _power(x: float, _: int) -> str:
    return f"{x:g}" if 1e-3 < x < 1e4 else "10" + str(round(np.log10(x))).translate(RAISED)


def empty_figure(size: tuple[float, float]) -> Figure:
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _rendered(figure: Figure, form: str) -> bytes:
    """Convert a matplotlib figure to the bytes of a file in the format "svg" or "png".

    The constrained layout is computed once, at the first file; matplotlib would compute it at each
    drawing, and draw twice.
    """
    stream = BytesIO()
    with mpl.rc_context(STYLE):
        if layout := figure.get_layout_engine():
            layout.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(stream, format=form, dpi=DPI, **FORMS[form])
    return stream.getvalue()
