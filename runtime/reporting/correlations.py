"""Parameters that trade against each other, by name: groups, a shaded table of their correlations,
the directions that W sees least.
"""

from __future__ import annotations

import numpy as np

from runtime.estimators.estimate import Estimate
from runtime.identification.result import Identification
from runtime.limits import LIMIT
from runtime.markup import symbol
from runtime.reporting.page import Matrix, Section
from runtime.table import Table


def correlation_section(result: Identification) -> Section:
    """Groups and pairs of all parameters, then the most correlated of those that carry the
    model.
    """
    correlations = result.correlations
    groups = "; ".join(", ".join(group) for group in correlations.groups) or "none"
    pairs = Table(
        f"Pairs with |correlation| above {correlations.threshold:g}, all parameters fitted",
        ("first", "second", "correlation"),
        [(symbol(p.first), symbol(p.second), f"{p.correlation:+.3f}") for p in correlations.pairs],
    )
    directions = Table(
        "Directions that W sees least (columns of norm 1), all parameters fitted",
        ("singular value ratio", "combination"),
        [
            (f"{d.ratio:.2e}", " ".join(f"{w:+.2f} {name}" for name, w in d.weights.items()))
            for d in correlations.directions
        ],
        wide=(1,),
    )
    text = (
        f"Groups, all parameters fitted: {groups}.",
        (
            "Two estimates with a correlation near ±1 are known together, not apart: what one "
            "gains "
            "the other loses, and the torques hardly change."
        ),
    )
    matrix = correlation_matrix(result.model_estimate)
    return Section(
        "Parameters that trade against each other",
        text,
        tables=[*([pairs] if correlations.pairs else []), directions],
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
