"""Show the parameters of an identification on a page and in parameters.csv.

The page has the parameters that are used, all base parameters with their formulas and the values of
the robot file, and the parameters that are strongly correlated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import repeat
from typing import Any, cast

import numpy as np

from runtime.core.least_squares.estimate import Estimate
from runtime.core.model import GeneratedModel
from runtime.core.result import Identification
from runtime.ground.markup import element, formula, symbol, unit
from runtime.ground.table import Table, csv_text, interval, number
from runtime.reporting.page import Matrix, Section

CORRELATIONS_SHOWN = 14
"""Names of a shaded table; the strongest correlations first."""

FILE_NOTE = (
    "Robot file: its values through the same formulas; the difference to it is left out where that "
    "value is smaller than the 95 % interval."
)


def cad_values(model: GeneratedModel) -> dict[str, float]:
    """Compute base parameters X = K chi from the standard parameters chi of the robot file.

    Only base parameters whose standard parameters all have values are returned.
    """
    values: Mapping[str, float] = getattr(model, "VALUES", None) or {}
    if not values or not hasattr(model, "base_parameters"):
        return {}
    emitted = cast(Any, model)
    names = tuple(emitted.STANDARD_PARAMETERS)
    K = np.asarray(emitted.base_parameters(np.eye(len(names))), dtype=float)
    chi = np.array([values.get(name, np.nan) for name in names])
    entering = [np.flatnonzero(row) for row in K]
    X = {
        name: float(row[used] @ chi[used])
        for name, row, used in zip(model.BASE_PARAMETERS, K, entering, strict=True)
    }
    return {name: value for name, value in X.items() if math.isfinite(value)}


def parameter_section(result: Identification) -> Section:
    """Build the section of the final parameters of the robot model: value, 95 % interval, unit."""
    fit = result.model_estimate
    rows = [
        (symbol(name), *_with_interval(fit, name), unit(fit.units.get(name, "")))
        for name in fit.names
    ]
    condition = ", ± 95 % if the others are zero" * (result.model_columns == "essential")
    table = Table(
        f"{result.fitted}{condition}",
        ("parameter", "value", "± 95 %", "unit"),
        rows,
        sortable=True,
    )
    return Section("Parameters", tables=[table])


def every_section(result: Identification) -> Section:
    """Build the section of all base parameters: fitted value, robot file's value, and formula."""
    fit, estimate, cad = result.model_estimate, result.estimate, cad_values(result.model)
    formulas: Mapping[str, str] = getattr(result.model, "FORMULAS", {})
    columns: list[tuple[str, list[str]]] = [
        ("parameter", [symbol(name) for name in estimate.names]),
        ("unit", [unit(estimate.units.get(name, "")) for name in estimate.names]),
        *_columns("", fit, estimate.names),
    ]
    if fit.names != estimate.names:
        columns += _columns("all fitted: ", estimate, estimate.names)
    if cad:
        columns += file_columns(estimate.names, fit, cad)
    if formulas:
        columns.append(("made of", [_made_of(name, formulas) for name in estimate.names]))
    table = Table(
        f"{len(estimate.names)} base parameters; without a value: removed, as if zero",
        [title for title, _ in columns],
        list(zip(*(cells for _, cells in columns), strict=True)),
        wide=(len(columns) - 1,) if formulas else (),
        sortable=True,
    )
    text = (
        "± 95 % is 1.96 corrected standard deviations. They allow for residuals that are correlated "
        "in time, and for friction that the model does not contain. parameters.csv "
        "also has σ of eq. (10), which assumes that all residuals are independent.",
        *([FILE_NOTE] if cad else []),
    )
    return Section("All base parameters, and what they are made of", text, tables=[table])


def file_columns(
    names: Sequence[str], fit: Any, cad: Mapping[str, float]
) -> list[tuple[str, list[str]]]:
    """Make two table columns: values of the robot file, and differences of fitted values from them.

    fit : estimate or set of parameters with names, X and sigma_corrected. cad : see `cad_values`.
    """
    given = [cad.get(name, math.nan) for name in names]
    return [
        ("robot file", ["" if math.isnan(x) else number(x) for x in given]),
        ("difference %", list(map(_difference, repeat(fit), names, given))),
    ]


def _columns(head: str, fit: Estimate, names: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Make two table columns with the values and the 95 % intervals of the given parameters.

    Cells of parameters that are not in the fit are empty. head : start of both column titles.
    """
    cells = [_with_interval(fit, name) if name in fit.names else ("", "") for name in names]
    values, halves = map(list, zip(*cells, strict=True))
    return [(f"{head}value", values), (f"{head}± 95 %", halves)]


def _with_interval(fit: Estimate, name: str) -> tuple[str, str]:
    """Write the value of a parameter and half the width of its 95 % interval."""
    half = _half(fit, name)
    return interval(fit[name], half) if math.isfinite(half) else (number(fit[name]), "-")


def _half(fit: Any, name: str) -> float:
    return 1.96 * float(fit.sigma_corrected[fit.names.index(name)])


def _difference(fit: Any, name: str, given: float) -> str:
    """Write the difference of a fitted value from the robot file's value, in % of the latter.

    The text is empty if the value of the robot file is smaller than half the width of the 95 %
    interval.
    """
    if name not in fit.names or not abs(given) > (half := _half(fit, name)):
        return ""
    fitted = float(fit.X[fit.names.index(name)])
    value, _ = interval(100 * (fitted - given) / abs(given), 100 * half / abs(given))
    return value if value.startswith("-") else f"+{value}"


def _made_of(name: str, formulas: Mapping[str, str]) -> str:
    """Write the formula of a base parameter as an HTML element that the reader can open."""
    made = formulas.get(name, name)
    if made == name:
        return "itself"
    return element(
        "details",
        element("summary", "formula", aria_label=f"formula of {name}"),
        element("span", symbol(name), " = "),
        formula(made),
    )


def correlation_section(result: Identification) -> Section:
    """Build the section of correlated parameters: groups and pairs, and a table of correlations.

    Groups and pairs are those of all parameters; the table has the most correlated of the
    parameters that are used.
    """
    correlations = result.correlations
    groups = "; ".join(", ".join(group) for group in correlations.groups) or "none"
    text = (
        f"Groups, all parameters fitted: {groups}.",
        (
            "Two estimates with a correlation near ±1 are known together, not apart: what one "
            "gains the other loses, and the torques hardly change."
        ),
    )
    matrix = correlation_matrix(result.model_estimate)
    return Section(
        "Parameters that trade against each other",
        text,
        tables=correlations.tables(symbol),
        matrices=[matrix] if matrix else [],
    )


def correlation_matrix(fit: Estimate) -> Matrix | None:
    """Select the most correlated parameters, and make a table of their correlations.

    The result is None for a single parameter, or if the estimate has no covariance.
    """
    deviation = np.sqrt(np.diag(fit.covariance))
    if len(fit.names) < 2 or not np.all(deviation > 0):
        return None
    correlation, most = fit.covariance / np.outer(deviation, deviation), CORRELATIONS_SHOWN
    strongest = np.abs(correlation - np.diag(np.diag(correlation))).max(axis=1)
    shown = np.sort(np.argsort(-strongest, kind="stable")[:most])
    caption = "Correlation of the estimates of the parameters that are used" + (
        f", the {most} strongest" if len(fit.names) > most else ""
    )
    return Matrix(
        caption, [symbol(fit.names[i]) for i in shown], correlation[np.ix_(shown, shown)].tolist()
    )


def parameters_csv(result: Identification) -> str:
    """Write parameters.csv: name, value, sigma, %sigma, corrected sigma and unit of each parameter.

    Two further columns have value and %sigma of the essential fit; they are empty for removed
    parameters.
    """
    fit, essential = result.estimate, result.essential.estimate
    columns = ("X", "sigma", "relative_sigma", "sigma_corrected")
    short = ("X", "relative_sigma")
    alone = {
        name: [float(getattr(essential, column)[k]) for column in short]
        for k, name in enumerate(essential.names)
    }
    rows = [
        (
            name,
            *(float(getattr(fit, column)[i]) for column in columns),
            fit.units.get(name, ""),
            *alone.get(name, ("", "")),
        )
        for i, name in enumerate(fit.names)
    ]
    return csv_text(("name", *columns, "unit", *(f"{x}_essential" for x in short)), rows)
