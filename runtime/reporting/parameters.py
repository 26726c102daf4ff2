"""Parameters on a page and in files: base parameters with deviations, CAD, what became of each, and
what it is made of; those that trade.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from runtime.core.least_squares.estimate import Estimate
from runtime.core.limits import LIMIT
from runtime.core.markup import element, formula, number, symbol, unit
from runtime.core.model import GeneratedModel
from runtime.core.result import Identification
from runtime.core.table import Table, csv_text
from runtime.reporting.page import Matrix, Section

HEADER = (
    "parameter",
    "value",
    "σ",
    "%σ",
    "corrected σ",
    "unit",
    "CAD",
    "difference %",
    "all fitted",
    "%σ of it",
    "role",
    "made of",
)


def cad_values(model: GeneratedModel) -> dict[str, float]:
    """Base parameters from the values of the robot file, X = K chi, where those that enter are all
    given.
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
    """One line per base parameter."""
    fit, estimate = result.model_estimate, result.estimate
    cad, roles = cad_values(result.model), roles_of(result)
    formulas: Mapping[str, str] = getattr(result.model, "FORMULAS", {})
    rows = []
    for i, name in enumerate(estimate.names):
        made = formulas.get(name, name)
        fold = element(
            "details",
            element("summary", "formula", aria_label=f"formula of {name}"),
            element("span", symbol(name), " = "),
            formula(made),
        )
        rows.append(
            (
                symbol(name),
                *_own(fit, name),
                unit(estimate.units.get(name, "")),
                *_compared(cad.get(name, math.nan), fit[name] if name in fit.names else math.nan),
                number(estimate.X[i], ".5g"),
                number(estimate.relative_sigma[i], ".2f"),
                roles[name],
                "itself" if made == name else fold,
            )
        )
    carry = result.essential.names
    kinds = ["essential" if name in carry else "removed" for name in estimate.names]
    shown = [k for k in range(len(HEADER)) if (cad or k not in (6, 7)) and (formulas or k != 11)]
    table = Table(
        f"{len(estimate.names)} base parameters, {len(carry)} of them carry the model",
        [HEADER[k] for k in shown],
        [[row[k] for k in shown] for row in rows],
        wide=[shown.index(k) for k in (10, 11) if k in shown],
        sortable=True,
        kinds=kinds,
        only="only those that carry the model",
    )
    text = [
        "The value to use stands first. σ is eq. (10), which takes residuals as independent; "
        "filtered ones are not, and the corrected deviation takes blocks of time as independent "
        "instead: quote it. Two of them hold the truth about 95 times in 100 or more while the "
        "model is right and the residuals do not remember for longer than two blocks. "
        "%σ is 100 σ/|value|, eq. (11).",
        "The role is an aid to reading: essential parameters explain the record nearly as well "
        "alone, the others are numbered in the order in which they go. "
        + (
            "One without a value was removed, as if it were zero; the deviations of the others do "
            "not know of that and hold the truth less often. "
            if len(fit.names) < len(estimate.names)
            else ""
        )
        + "The last columns are the fit of all parameters together. Ratio: σρ of eq. (9) without "
        "the parameter, over its first value.",
    ]
    if cad:
        text.append(
            "CAD: the values of the robot file through the same formulas; difference: of the value "
            "to it, in % of it."
        )
    return Section("Parameters", text, tables=[table])


def roles_of(result: Identification) -> dict[str, str]:
    """Essential, or when and at which ratio it is removed, by name."""
    essential = result.essential
    roles = dict.fromkeys(result.estimate.names, "essential")
    for k, step in enumerate(essential.trail, start=1):
        if step.removed:
            roles[step.name] = f"goes as no. {k}, ratio {step.ratio:.4f}"
        else:
            roles[step.name] += f", the next to go: ratio {step.ratio:.4f}"
    return roles


def _own(fit: Estimate, name: str) -> tuple[str, str, str, str]:
    """Value, sigma, %sigma and corrected sigma; empty for a parameter that is not in the fit."""
    if name not in fit.names:
        return "", "", "", ""
    i = fit.names.index(name)
    return (
        number(fit.X[i], ".5g"),
        number(fit.sigma[i], ".2g"),
        number(fit.relative_sigma[i], ".2f"),
        number(fit.sigma_corrected[i], ".2g"),
    )


def _compared(cad: float, value: float) -> tuple[str, str]:
    """A CAD value and the difference of an estimate to it, %."""
    with np.errstate(divide="ignore", invalid="ignore"):
        difference = 100 * (np.float64(value) - cad) / abs(np.float64(cad))
    return ("" if math.isnan(cad) else number(cad)), (
        f"{difference:+.1f}" if math.isfinite(difference) else ""
    )


def correlation_section(result: Identification) -> Section:
    """Groups and pairs of all parameters, then the most correlated of those that carry the
    model.
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


def correlation_matrix(fit: Estimate, most: int = LIMIT.CORRELATIONS_SHOWN) -> Matrix | None:
    """Correlations, eq. (10), among the parameters with the strongest ones, in column order; None
    of a single parameter, or without covariance.
    """
    deviation = np.sqrt(np.diag(fit.covariance))
    if len(fit.names) < 2 or not np.all(deviation > 0):
        return None
    correlation = fit.covariance / np.outer(deviation, deviation)
    strongest = np.abs(correlation - np.diag(np.diag(correlation))).max(axis=1)
    shown = np.sort(np.argsort(-strongest, kind="stable")[:most])
    caption = "Correlation of the estimates that carry the model" + (
        f", the {most} strongest" if len(fit.names) > most else ""
    )
    return Matrix(
        caption, [symbol(fit.names[i]) for i in shown], correlation[np.ix_(shown, shown)].tolist()
    )


def parameters_csv(result: Identification) -> str:
    """parameters.csv: name, value, sigma, %sigma, corrected sigma, unit; then value and %sigma of
    the essential fit, empty where removed.
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
