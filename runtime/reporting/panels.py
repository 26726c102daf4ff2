"""Places of the panels of a figure, from the letters that stand around them: no text is measured, nothing is drawn to find out.

matplotlib's own search (constrained layout) draws every tick twice; it took a third of the time of a report. Ticks are then drawn as few artists.
"""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.layout_engine import LayoutEngine

from runtime.reporting.ticks import LINE, Ticks, draw_ticks

POINT = 1 / 72  # inch
LABEL = 1.6  # height of a label with the space to it, in sizes of its letters
SIZE = 9.0  # points, of titles and labels
TICK = 0.11  # inch, a tick and the space to its label
EDGE = 0.06  # inch, to the edge of the figure and between rows
GAP = 0.04  # inch, from the labels of ticks beside a panel to the label of its axis


class PanelLayout(LayoutEngine):
    """Panels of one grid, each with room for its ticks, labels and title, below the legend of the figure.

    right : room to the right of every panel, inch.
    """

    _adjust_compatible = True
    _colorbar_gridspec = True

    def __init__(self, *, right: float = 0.12) -> None:
        super().__init__()
        self.right = right

    def execute(self, fig: Figure) -> None:
        """Place the panels; twice, as the places decide how many ticks there are."""
        panels = [(ax, place) for ax in fig.axes if (place := ax.get_subplotspec()) is not None]
        for _ in range(2):
            fig.subplots_adjust(**self._places(fig, panels))
        shown = [(ax, Ticks.of(ax.xaxis), Ticks.of(ax.yaxis)) for ax, _ in panels]  # before any of them changes: some share their ticks
        for ax, below, beside in shown:
            width, height = fig.get_size_inches() * ax.get_position().size
            ax.xaxis.set_label_coords(0.5, -_room(below.height) / height)
            ax.yaxis.set_label_coords(-(_room(beside.width) + GAP) / width, 0.5)
            draw_ticks(ax, ax.xaxis, below)
            draw_ticks(ax, ax.yaxis, beside)

    def _places(self, fig: Figure, panels: Sequence[tuple[Axes, SubplotSpec]]) -> dict[str, float]:
        """Arguments of subplots_adjust."""
        grid = panels[0][1].get_gridspec()
        left, below, above = [0.0] * grid.ncols, [0.0] * grid.nrows, [0.0] * grid.nrows
        for ax, place in panels:
            column, row = place.colspan.start, place.rowspan.start
            left[column] = max(left[column], _beside(ax, Ticks.of(ax.yaxis)))
            below[row] = max(below[row], _under(ax, Ticks.of(ax.xaxis)))
            above[row] = max(above[row], _over(ax))
        line = LINE * SIZE * POINT
        horizontal = _spread(
            fig.get_figwidth(),
            left[0] + EDGE + (line if fig.get_supylabel() else 0.0),
            self.right,
            max(left[1:], default=0.0) + self.right,
            grid.ncols,
        )
        vertical = _spread(
            fig.get_figheight(),
            below[-1] + EDGE + (line if fig.get_supxlabel() else 0.0),
            above[0] + EDGE + sum(legend.get_window_extent().height / fig.dpi for legend in fig.legends),
            max((b + a for b, a in zip(below, above[1:], strict=False)), default=0.0) + EDGE,
            grid.nrows,
        )
        return dict(zip(("left", "right", "wspace", "bottom", "top", "hspace"), (*horizontal, *vertical), strict=True))


def _spread(whole: float, before: float, after: float, between: float, count: int) -> tuple[float, float, float]:
    """(first edge, last edge, space over size of a panel) of `count` panels on `whole` inches; edges as shares of them."""
    size = max((whole - before - after - (count - 1) * between) / count, EDGE)
    return before / whole, (before + count * size + (count - 1) * between) / whole, between / size


def _beside(ax: Axes, ticks: Ticks) -> float:
    """Room to the left of a panel, inch."""
    return (LABEL * SIZE * POINT if ax.get_ylabel() else 0.0) + (_room(ticks.width) or EDGE)


def _under(ax: Axes, ticks: Ticks) -> float:
    """Room below a panel, inch."""
    return (LABEL * SIZE * POINT if ax.get_xlabel() else 0.0) + _room(ticks.height)


def _room(points: float) -> float:
    """Room of ticks whose labels take so many points, inch; none without labels."""
    return TICK + points * POINT if points else 0.0


def _over(ax: Axes) -> float:
    """Room above a panel, inch: its title, or its legend, which stands there."""
    named = ax.get_legend() or any(ax.get_title(loc) for loc in ("left", "center", "right"))
    return (LINE + 0.7) * SIZE * POINT if named else EDGE
