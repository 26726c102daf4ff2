"""Search for estimates that are physically impossible: friction and motor inertia below zero."""

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
    """Whether an element on the joints, such as a spring, is given by a quadratic form q'Bq.

    Other elements act along a combination s = G q of joints. acts : coefficients of the element, by
    joint; in a quadratic form by pair of joints.
    """
    return any(isinstance(key, tuple) for key in acts)


def negative_elements(model: GeneratedModel, fit: Estimate) -> tuple[str, ...]:
    """Return the friction parameters and motor inertias of a fit that are certainly below zero.

    Certainly means by LIMIT.CERTAIN_SIGN standard deviations, of which the larger kind is used.
    Parameters that are regrouped with others are not tested.
    """
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
