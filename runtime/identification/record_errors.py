"""How well one set of parameters explains each of several records: the record that fits worse than
the others is the one to look at.

e_k = 100 ||Y_k - W_k X|| / ||Y_k||     over the rows of record k
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from runtime.estimators.estimate import Estimate
from runtime.identification.validation import prediction_errors
from runtime.rows.observation import Observation


@dataclass(frozen=True)
class RecordError:
    """Fit of one record.

    Attributes
    ----------
    name : str
        Name of the record.
    rows : int
        Rows of W that it gave.
    relative_error : float, %
        100 ||Y_k - W_k X|| / ||Y_k||.
    per_joint : tuple of float, %
        The same by joint.
    """

    name: str
    rows: int
    relative_error: float
    per_joint: tuple[float, ...]


def record_errors(
    observation: Observation, fit: Estimate, names: Sequence[str]
) -> tuple[RecordError, ...]:
    """Errors of the records called `names`, in the order in which `observation` holds them, with
    the parameters of `fit`.
    """
    parts = [observation.of_record(k) for k in range(len(names))]
    return tuple(
        RecordError(name, sum(part.rows), *prediction_errors(part, fit))
        for name, part in zip(names, parts, strict=True)
    )
