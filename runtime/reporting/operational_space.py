"""What is felt at the handle, drawn over a sheet of the workspace: values in, figure and section out."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from runtime.identification.operational_space import OperationalSpace
from runtime.markup import number
from runtime.reporting import figures as plots
from runtime.reporting.page import Section
from runtime.table import Table

Array = np.ndarray


def panels(space: OperationalSpace) -> dict[str, tuple[Array, Array]]:
    """(values, deviations), each of shape (N,), by title."""
    lost = space.singular | space.indefinite
    last = space.principal.value.shape[1] - 1
    strongest = np.argmax(np.where(lost[:, None], 0.0, space.friction.value), axis=1)
    stiff = np.abs(space.stiffness.value).reshape(len(lost), -1)
    stiffest = np.argmax(np.where(lost[:, None], 0.0, stiff), axis=1)

    def picked(values: Array, which: Array) -> Array:
        return np.asarray(np.take_along_axis(values, which[:, None], axis=1)[:, 0])

    return {
        "smallest apparent mass, kg": (space.principal.value[:, 0], space.principal.sigma[:, 0]),
        "largest apparent mass, kg": (space.principal.value[:, last], space.principal.sigma[:, last]),
        "friction, worst coordinate, N": (picked(space.friction.value, strongest), picked(space.friction.sigma, strongest)),
        "stiffness, largest element, N/m": (picked(stiff, stiffest), picked(space.stiffness.sigma.reshape(stiff.shape), stiffest)),
    }


def operational_space_figure(space: OperationalSpace, shape: tuple[int, int], axes: tuple[int, int], labels: tuple[str, str]) -> Figure:
    """Filled contours over a sheet of configurations; white with crosses: singular. Levels are in geometric steps up to the 90th percentile.

    shape : the N configurations as a grid.   axes : coordinates of the handle drawn, 0 x, 1 y, 2 z.
    """
    x, y = (space.position[:, k].reshape(shape) for k in axes)
    with mpl.rc_context(plots.STYLE):
        figure = plots.empty_figure((8.2, 6.4))
        drawn = figure.subplots(2, 2).ravel()
        for ax, (title, (value, _)) in zip(drawn, panels(space).items(), strict=True):
            usual = value[np.isfinite(value)]
            lowest, high = float(usual.min()), float(np.quantile(usual, 0.9))
            levels = np.geomspace(max(lowest, 1e-3 * high), 1.0001 * high, 13)
            filled = ax.contourf(
                x, y, np.ma.masked_invalid(value.reshape(shape)), levels=levels, cmap="cividis", norm=LogNorm(), extend="both"
            )
            ax.plot(space.position[space.singular, axes[0]], space.position[space.singular, axes[1]], "x", color=plots.ORANGE, markersize=3)
            figure.colorbar(filled, ax=ax, format="%.3g")
            ax.set_title(title, fontsize=9)
            ax.set_xlabel(labels[0])
            ax.set_ylabel(labels[1])
            ax.set_aspect("equal")
    return figure


def operational_space_section(
    space: OperationalSpace, shape: tuple[int, int], axes: tuple[int, int], labels: tuple[str, str], text: Sequence[str] = ()
) -> Section:
    """The figure, and a table of medians and extremes with their deviations."""
    rows = []
    for title, (value, sigma) in panels(space).items():
        known = np.flatnonzero(np.isfinite(value))
        order = known[np.argsort(value[known])]
        cells = [
            f"{number(float(value[k]), '.3g')} +- {number(float(sigma[k]), '.1g')}" for k in (order[0], order[len(order) // 2], order[-1])
        ]
        rows.append((title, *cells, number(float(100 * np.median(sigma[known] / np.abs(value[known]))), ".2g")))
    image = plots.drawn(
        "What the user feels at the handle, motors off; crosses: singular configurations, where nothing is told",
        operational_space_figure(space, shape, axes, labels),
        "Four maps over the workspace: smallest and largest apparent mass, friction, stiffness",
        "handle",
    )
    table = Table("Over the sheet", ("felt", "smallest", "median", "largest", "median %sigma"), rows)
    notes = [*text, *([space.message] if space.message else [])]
    return Section("At the handle: apparent mass, friction, stiffness", notes, [image], [table])
