"""Places of the panels of a figure, from the letters that stand around them: no text is measured,
nothing is drawn to find out.

matplotlib's own search (constrained layout) draws every tick twice; it took a third of the time of
a report.
"""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.layout_engine import LayoutEngine

POINT = 1 / 72  # inch
LETTER, LINE, LABEL = (
    0.64,
    1.3,
    1.6,
)  # width of a digit, height of a line, of a label with the space to it: in sizes of the letters
SIZE = 9.0  # points, of titles and labels
TICK = 0.11  # inch, a tick and the space to its label
EDGE = 0.06  # inch, to the edge of the figure and between rows


class PanelLayout(LayoutEngine):
    """Panels of one grid, each with room for its ticks, labels and title, below the legend of the
    figure.

    right, below : room to the right of every panel, and further room below it, inch.
    """

    _adjust_compatible = True
    _colorbar_gridspec = True

    def __init__(self, *, right: float = 0.12, below: float = 0.0) -> None:
        super().__init__()
        self.right, self.below = right, below

    def execute(self, fig: Figure) -> None:
        """Place the panels; twice, as the places decide how many ticks there are."""
        panels = [(ax, place) for ax in fig.axes if (place := ax.get_subplotspec()) is not None]
        for axis in (
            axis for ax, _ in panels for axis in (ax.xaxis, ax.yaxis) if not axis.get_label_text()
        ):
            axis.set_label_coords(
                0.0, 0.0
            )  # else matplotlib seeks a place for the empty label, among all ticks
        for _ in range(2):
            fig.subplots_adjust(**self._places(fig, panels))

    def _places(self, fig: Figure, panels: Sequence[tuple[Axes, SubplotSpec]]) -> dict[str, float]:
        """Arguments of subplots_adjust."""
        grid = panels[0][1].get_gridspec()
        left, below, above = [0.0] * grid.ncols, [0.0] * grid.nrows, [0.0] * grid.nrows
        for ax, place in panels:
            column, row = place.colspan.start, place.rowspan.start
            left[column] = max(left[column], _beside(ax))
            below[row] = max(below[row], _under(ax) + self.below)
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
            above[0]
            + EDGE
            + sum(legend.get_window_extent().height / fig.dpi for legend in fig.legends),
            max((b + a for b, a in zip(below, above[1:], strict=False)), default=0.0) + EDGE,
            grid.nrows,
        )
        return dict(
            zip(
                ("left", "right", "wspace", "bottom", "top", "hspace"),
                (*horizontal, *vertical),
                strict=True,
            )
        )


def _spread(
    whole: float, before: float, after: float, between: float, count: int
) -> tuple[float, float, float]:
    """(first edge, last edge, space over size of a panel) of `count` panels on `whole` inches;
    edges as shares of them.
    """
    size = max((whole - before - after - (count - 1) * between) / count, EDGE)
    return before / whole, (before + count * size + (count - 1) * between) / whole, between / size


def _beside(ax: Axes) -> float:
    """Room to the left of a panel, inch."""
    letters, size = _ticks(ax.yaxis, "labelleft")
    label = LABEL * SIZE * POINT if ax.get_ylabel() else 0.0
    return label + (TICK + letters * LETTER * size * POINT if letters else EDGE)


def _under(ax: Axes) -> float:
    """Room below a panel, inch."""
    letters, size = _ticks(ax.xaxis, "labelbottom")
    label = LABEL * SIZE * POINT if ax.get_xlabel() else 0.0
    return label + (TICK + LINE * size * POINT if letters else 0.0)


def _over(ax: Axes) -> float:
    """Room above a panel, inch: its title, or its legend, which stands there."""
    named = ax.get_legend() or any(ax.get_title(loc) for loc in ("left", "center", "right"))
    return (LINE + 0.7) * SIZE * POINT if named else EDGE


def _ticks(axis: Axis, shown: str) -> tuple[int, float]:
    """Letters of the longest label at the ticks that an axis shows, and their size, points."""
    settings = axis.get_tick_params()
    low, high = sorted(axis.get_view_interval())
    places = [place for place in axis.get_majorticklocs() if low <= place <= high]
    labels = axis.get_major_formatter().format_ticks(places) if settings.get(shown, True) else []
    return max(map(len, labels), default=0), float(settings.get("labelsize", SIZE))
