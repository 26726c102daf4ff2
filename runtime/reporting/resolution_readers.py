"""Two studies of the same steps, read as positions and read as counts, side by side: figure, table, page."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from runtime.markup import number
from runtime.reporting.figures import BLACK, BLUE, ORANGE, STYLE, drawn, logarithmic, panels_figure, shared_legend
from runtime.reporting.page import Section
from runtime.resolution.result import BIASED, NEGLIGIBLE, Cestac
from runtime.table import Table

Array = np.ndarray

READ = (("read as positions", ORANGE, "s"), ("read as counts", BLUE, "o"))


def errors(result: Cestac, names: Sequence[str]) -> tuple[Array, Array, Array]:
    """Delta, shape (m,), and root mean square and maximum over the parameters `names` of %e (21), shape (m,) each."""
    columns = [result.names.index(name) for name in names]
    e = np.array([level.e[columns] for level in result.levels])
    return np.array([level.level.delta for level in result.levels]), np.sqrt(np.mean(e**2, axis=1)), e.max(axis=1)


def readers_figure(by_positions: Cestac, by_counts: Cestac, names: Sequence[str], key: str) -> Figure:
    """%e of the parameters `names` against Delta, and the mean of the parameter `key`, by both readers."""
    i = by_positions.names.index(key)
    unit = by_positions.reference.units.get(key, "").replace("**", "^").replace("*", " ")
    with mpl.rc_context(STYLE):
        figure, (left, right) = panels_figure(1, 2, (9.6, 4.2), right=0.35, below=0.25)
        for result, (label, color, marker) in zip((by_positions, by_counts), READ, strict=True):
            delta, rms, largest = errors(result, names)
            left.plot(delta, rms, color=color, marker=marker, markersize=5, linewidth=1.6, label=label)
            left.fill_between(delta, rms, largest, color=color, alpha=0.15, linewidth=0)
            mean, spread = (np.array([getattr(level, name)[i] for level in result.levels]) for name in ("mean", "sigma"))
            right.errorbar(delta, mean, yerr=spread, color=color, marker=marker, markersize=5, linewidth=1.6, capsize=2)
        for limit in (NEGLIGIBLE, BIASED):
            left.axhline(limit, color=BLACK, linewidth=0.9, linestyle=(0, (1, 2)))
            left.annotate(
                f"{limit:g} %",
                (1.0, limit),
                xycoords=("axes fraction", "data"),
                xytext=(3, 0),
                textcoords="offset points",
                va="center",
                fontsize=8,
            )
        right.axhline(by_positions.reference.X[i], color=BLACK, linewidth=0.9, linestyle="--")
        right.annotate("as recorded", (1.0, by_positions.reference.X[i]), xycoords=("axes fraction", "data"), xytext=(-4, 4),
                       textcoords="offset points", ha="right", fontsize=8)  # fmt: skip
        logarithmic(left, "y")
        left.set_ylabel("%e: change of the estimate, %")
        left.set_title(f"rms of {len(names)} parameters; shaded: up to the largest", fontsize=9)
        right.set_ylim(min(0.0, right.get_ylim()[0]), None)
        right.set_ylabel(f"{key}, {unit}" if unit else key)
        right.set_title(f"mean of {key} with the spread of the runs", fontsize=9)
        delta = errors(by_positions, names)[0]
        for ax in (left, right):
            logarithmic(ax, "x")
            ax.set_xticks(
                delta, [level.level.label.replace("2*pi/", "2π/") for level in by_positions.levels], rotation=30, ha="right", fontsize=8
            )
            ax.set_xlabel("step of every encoder")
        shared_legend(figure, [left], 2, size=9)
    return figure


def readers_table(by_positions: Cestac, by_counts: Cestac, names: Sequence[str], key: str) -> Table:
    """Step, then rms and largest %e of the parameters `names` and the mean of `key`, by both readers."""
    i, rows = by_positions.names.index(key), []
    both = [errors(result, names) for result in (by_positions, by_counts)]
    for k, level in enumerate(by_positions.levels):
        cells = [level.level.label]
        for (_, rms, largest), result in zip(both, (by_positions, by_counts), strict=True):
            cells += [number(rms[k], ".1f"), number(largest[k], ".1f"), number(result.levels[k].mean[i], ".3f")]
        rows.append(tuple(cells))
    header = ["step"]
    for name in ("positions", "counts"):
        header += [f"{name}: rms %e", "largest %e", key]
    return Table(
        f"The same encoders read both ways; {len(names)} parameters; as recorded {key} = {by_positions.reference.X[i]:.3f}", header, rows
    )


def readers_section(by_positions: Cestac, by_counts: Cestac, names: Sequence[str], key: str, text: Sequence[str] = ()) -> Section:
    """Figure and table."""
    image = drawn(
        "%e against the step, and the mean of one parameter; squares: counts taken as positions; circles: counts read as counts; dotted: 1 % and 5 %",
        readers_figure(by_positions, by_counts, names, key),
        "Change of the estimates against encoder step by both readers, logarithmic axes",
        "counts",
    )
    return Section("The same encoders read both ways", text, [image], [readers_table(by_positions, by_counts, names, key)])
