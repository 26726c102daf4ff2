"""Estimates that no drive has: friction and motor inertia below zero."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from runtime.core.least_squares.estimate import Estimate
from runtime.core.limits import LIMIT
from runtime.core.model import GeneratedModel

SIGNED = ("inertia", "viscous", "coulomb", "dissipative")
"""Kinds of elements whose parameter is not negative."""


def is_form(acts: Mapping[Any, float]) -> bool:
    """Whether an element of ELEMENTS is a form q'Bq (its keys are pairs of joints), not an element along s = G q."""
    return any(isinstance(key, tuple) for key in acts)


def negative_elements(model: GeneratedModel, fit: Estimate) -> tuple[str, ...]:
    """Motor inertias and frictions with a column of their own that are below zero by LIMIT.CERTAIN_SIGN corrected deviations."""
    elements: Mapping[str, Any] = getattr(model, "ELEMENTS", {})
    signed = {
        name for name, (kind, _, acts) in elements.items() if kind in SIGNED and not is_form(acts)
    }
    sigma = np.fmax(fit.sigma, fit.sigma_corrected)
    return tuple(
        name
        for i, name in enumerate(fit.names)
        if name in signed and fit.X[i] < -LIMIT.CERTAIN_SIGN * sigma[i]
    )
