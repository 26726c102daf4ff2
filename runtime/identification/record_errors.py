"""How well one set of parameters explains each of several records: the record that fits worse than the others is the one to look at.

e_k = 100 ||Y_k - W_k X|| / ||Y_k||     over the rows of record k
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime.estimators.estimate import Estimate
from runtime.observation.observation import Observation
from runtime.observation.reduction import Reduction, merged

Array = np.ndarray


@dataclass(frozen=True)
class RecordError:
    """Relative error of one record, %, in total and by joint; rows : of W that it gave."""

    name: str
    rows: int
    relative_error: float
    per_joint: tuple[float, ...]


def record_errors(data: Observation | Reduction, fit: Estimate, names: Sequence[str]) -> tuple[RecordError, ...]:
    """Errors of the records called `names`, in the order in which `data` holds them, with the parameters of `fit`."""
    own = data.columns(fit.names)
    found = []
    for k, name in enumerate(names):
        residual, size, rows = _of_rows(own, fit.X, k) if isinstance(own, Observation) else _of_factors(own, fit.X, k)
        found.append(
            RecordError(
                name, rows, _percent(float(np.linalg.norm(residual)), float(np.linalg.norm(size))), tuple(map(_percent, residual, size))
            )
        )
    return tuple(found)


def _of_rows(data: Observation, X: Array, k: int) -> tuple[Array, Array, int]:
    """Norms of Y - W X and of Y by joint, of the rows of record k, and the number of these."""
    ours = data.record == k
    joints = [ours & (data.joints == j) for j in range(data.n)]
    rho = data.Y - data.W @ X
    return np.array([np.linalg.norm(rho[m]) for m in joints]), np.array([np.linalg.norm(data.Y[m]) for m in joints]), int(ours.sum())


def _of_factors(data: Reduction, X: Array, k: int) -> tuple[Array, Array, int]:
    joints = merged(s.joints for s in data.segments if s.record == k)
    size = np.array([np.linalg.norm(joint.R[:, -1]) for joint in joints])
    return np.array([joint.residual_norm(X) for joint in joints]), size, sum(joint.rows for joint in joints)


def _percent(residual: float, size: float) -> float:
    return float(100 * residual / size) if size > 0 else float("nan")
