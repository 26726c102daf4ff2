"""The parameters of an identification in one table: value, deviations, CAD, what became of each,
and what it is made of.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from runtime.estimators.essential import Removal
from runtime.estimators.estimate import Estimate
from runtime.identification.result import Identification
from runtime.markup import element, formula, number, symbol, unit
from runtime.model.generated import GeneratedModel
from runtime.reporting.page import Section
from runtime.table import Table

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
    """One line per base parameter; essential ones carry the value to use."""
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
    kinds = ["essential" if name in fit.names else "removed" for name in estimate.names]
    shown = [k for k in range(len(HEADER)) if (cad or k not in (6, 7)) and (formulas or k != 11)]
    table = Table(
        f"{len(estimate.names)} base parameters, {len(fit.names)} of them carry the model",
        [HEADER[k] for k in shown],
        [[row[k] for k in shown] for row in rows],
        wide=[shown.index(k) for k in (10, 11) if k in shown],
        sortable=True,
        kinds=kinds,
        only="only those that carry the model",
    )
    text = [
        "The value to use stands first. σ is eq. (10), which takes residuals as independent; "
        "filtered ones are not, and the corrected deviation takes "
        "blocks of time as independent instead: it is the one to trust. %σ is 100 σ/|value|, eq. "
        "(11).",
        "A parameter that was removed has no value to use: what it would do is below the error of "
        "the model; numbered in the order of removal. Beside stands "
        "the fit of all parameters together. Ratio: of σρ, eq. (9), without it to its first value.",
    ]
    if cad:
        text.append(
            "CAD: the values of the robot file through the same formulas; difference: of the value "
            "to it, in % of it."
        )
    return Section("Parameters", text, tables=[table])


def roles_of(result: Identification) -> dict[str, str]:
    """Essential, or when and at which ratio it was removed, by name."""
    essential = result.essential
    roles = dict.fromkeys(result.estimate.names, "essential")
    if result.model_columns == "all":
        roles |= dict.fromkeys(essential.names, "essential by least squares")
    removed = [step for step in essential.trail if step.removed]
    for k, step in enumerate(removed, start=1):
        roles[step.name] = f"removed no. {k}, ratio {step.ratio:.4f}"
    refused: list[Removal] = [step for step in essential.trail if not step.removed]
    for step in refused:
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
