"""Ticks of a panel as few artists. matplotlib makes five of every tick and lays all of them out three times: half of the time of a figure."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import compress
from math import cos, radians, sin

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.markers import TICKDOWN, TICKLEFT, MarkerStyle
from matplotlib.ticker import NullLocator

Array = np.ndarray

LETTER, LINE = 0.64, 1.3  # width of a digit, height of a line: in sizes of the letters
ROOM = 7.0  # points, from the edge of a panel to the labels of its ticks


@dataclass(frozen=True)
class Ticks:
    """The ticks that an axis shows.

    Attributes
    ----------
    places : ndarray, shape (m,)
    labels : tuple of str
        As many, or none where the axis shows no labels.
    size : float, points
        Of the letters.
    rotation : float, degrees
        Of labels that end below their tick; 0: they are centred.
    """

    places: Array
    labels: tuple[str, ...]
    size: float
    rotation: float = 0.0

    @classmethod
    def of(cls, axis: Axis) -> Ticks:
        """Those of a matplotlib axis, within its limits."""
        settings, (low, high) = axis.get_tick_params(), sorted(axis.get_view_interval())
        places = np.asarray(axis.get_majorticklocs(), dtype=float)
        within = (places >= low) & (places <= high)
        shown = settings.get("labelbottom" if isinstance(axis, XAxis) else "labelleft", True)
        labels = axis.get_major_formatter().format_ticks(places.tolist()) if shown else []
        size = float(settings.get("labelsize", mpl.rcParams["font.size"]))
        return cls(places[within], tuple(compress(labels, within)), size, float(settings.get("rotation", 0.0)))

    @property
    def width(self) -> float:
        """Room that the longest label takes along its line, points."""
        return max(map(len, self.labels), default=0) * LETTER * self.size

    @property
    def height(self) -> float:
        """Room that the labels take below a panel, points."""
        turned = radians(self.rotation)
        return self.width * sin(turned) + LINE * self.size * cos(turned) if self.width else 0.0


def draw_ticks(ax: Axes, axis: Axis, ticks: Ticks) -> None:
    """Grid, marks and texts of `ticks`, in place of those of an axis of the panel."""
    along, at = isinstance(axis, XAxis), ticks.places
    scale = ax.get_xaxis_transform if along else ax.get_yaxis_transform
    ends = np.array([[(place, 0.0), (place, 1.0)] for place in at]).reshape(-1, 2, 2)  # (place on the axis, height over it)
    grid = {"colors": mpl.rcParams["grid.color"], "linewidths": mpl.rcParams["grid.linewidth"], "zorder": 1.5}
    ax.add_collection(LineCollection(list(ends if along else ends[..., ::-1]), transform=scale(), **grid), autolim=False)
    marks = Line2D(
        at if along else np.zeros_like(at),
        np.zeros_like(at) if along else at,
        linestyle="none",
        marker=MarkerStyle(TICKDOWN if along else TICKLEFT),
        markersize=mpl.rcParams["xtick.major.size"],
        markeredgewidth=mpl.rcParams["xtick.major.width"],
        color=mpl.rcParams["xtick.color"],
        transform=scale(),
        clip_on=False,
    )
    ax.add_artist(marks)
    transform, va, ha = (ax.get_xaxis_text1_transform if along else ax.get_yaxis_text1_transform)(ROOM)
    for place, text in zip(at.tolist(), ticks.labels, strict=False):
        x, y = (place, 0.0) if along else (0.0, place)
        ax.text(x, y, text, transform=transform, va=va, ha="right" if ticks.rotation else ha, fontsize=ticks.size, rotation=ticks.rotation)
    axis.set_major_locator(NullLocator())
