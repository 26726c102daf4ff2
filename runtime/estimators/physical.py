"""Estimates that no drive has: motor inertias and frictions that are certainly negative. The conditions themselves: `runtime.model.inertia`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from runtime.estimators.estimate import Estimate
from runtime.model.generated import GeneratedModel
from runtime.model.inertia import SIGNED, is_form

CERTAIN = 3.0  # deviations


def negative_elements(model: GeneratedModel, fit: Estimate) -> tuple[str, ...]:
    """Motor inertias and frictions of their own column that are negative by more than CERTAIN corrected deviations: no drive has them."""
    elements: Mapping[str, Any] = getattr(model, "ELEMENTS", {})
    signed = {name for name, (kind, _, acts) in elements.items() if kind in SIGNED and not is_form(acts)}
    sigma = np.fmax(fit.sigma, fit.sigma_corrected)
    return tuple(name for i, name in enumerate(fit.names) if name in signed and fit.X[i] < -CERTAIN * sigma[i])
