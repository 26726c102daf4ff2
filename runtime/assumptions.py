"""Use a record to test parameters that the robot file assumes to be zero.

The model without the assumptions has X = K chi = K' y + K_p p, with p one assumed parameter and y
all other parameters, the other assumed ones among them. Generalised least squares with the
covariance C of X, from blocks of time, gives p with its standard deviation sigma. If the assumption
is true, (p/sigma)**2 has the distribution chi2(1). If K_p is in the range of K', no record can
show p.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from runtime.core.least_squares.estimate import Estimate
from runtime.core.model import GeneratedModel
from runtime.physical.inertia import physical_model

CONTRADICTED = 0.001  # p below which a record contradicts an assumption
SMALL = 1e-8  # of a column of K: what the others leave of one that they span


@dataclass(frozen=True)
class Assumption:
    """Test of one parameter that is assumed to be zero.

    Attributes
    ----------
    name : str
    value, sigma : float
        Value from the record and its standard deviation; nan if no record can show them.
    p_value : float
        Probability of a value at least as large if the assumption is true; nan if it cannot be
        tested.
    """

    name: str
    value: float
    sigma: float
    p_value: float

    @property
    def text(self) -> str:
        """Sentence that says whether the record contradicts the assumed value zero."""
        if np.isnan(self.p_value):
            return f"{self.name} = 0 cannot be tested: other parameters cause the same torque"
        said = f"{self.value:.3g} ± {1.96 * self.sigma:.2g} (p = {self.p_value:.2g})"
        if self.p_value < CONTRADICTED:
            return f"the record contradicts {self.name} = 0: it says {said}"
        return f"{self.name} = 0 agrees with the record, which says {said}"


def assumptions_asked(
    model: GeneratedModel, fit: Estimate, names: Sequence[str]
) -> tuple[Assumption, ...]:
    """Test each parameter that the robot file assumes to be zero, with all other parameters free.

    Parameters
    ----------
    model : GeneratedModel
        The module of the robot without `assume`.
    fit : Estimate
        Estimate of all parameters of this module from the record.
    names : sequence of str
        The parameters that are assumed to be zero.
    """
    physical = physical_model(model)
    K = physical.K[[model.BASE_PARAMETERS.index(name) for name in fit.names]]
    scale = fit.sigma_corrected / fit.sigma
    C = fit.covariance * np.outer(scale, scale)
    weight = np.linalg.inv(C)
    result = []
    for name in names:
        place = physical.standard.index(name)
        column = K[:, place]
        U, s, _ = np.linalg.svd(np.delete(K, place, axis=1), full_matrices=False)
        Q = U[:, s > SMALL * s[0]]
        rest = column - Q @ (Q.T @ column)
        if np.linalg.norm(rest) <= SMALL * np.linalg.norm(column):
            result.append(Assumption(name, np.nan, np.nan, np.nan))
            continue
        A = np.column_stack([Q, column])  # X = A y, weighted by C^-1
        gram = np.linalg.inv(A.T @ weight @ A)
        value, sigma = float((gram @ A.T @ weight @ fit.X)[-1]), float(np.sqrt(gram[-1, -1]))
        result.append(Assumption(name, value, sigma, float(chi2.sf((value / sigma) ** 2, 1))))
    return tuple(result)
