"""Validation: does the model predict other data, and which parameters have correlated estimates?

    direct comparison    measured Y and W X, joint by joint (chapter, Fig. 4)
    cross-validation     fit on one part of the data, predict the others: 100 ||Y_j - W_j X|| /
                         ||Y_j|| for every joint
    weak directions      parameters whose errors are correlated, eq. (10), and the combinations
                         that hardly change W X

Errors are reported per joint, because the total error is dominated by the shoulder and hides a
wrong wrist.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse.csgraph import connected_components

from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.linear import System, percent
from runtime.core.least_squares.solution import unit_columns
from runtime.core.problem import Problem, estimated, point_estimate
from runtime.core.rows.observation import Observation, Window
from runtime.core.study import EstimateSettings
from runtime.ground.documents import Result
from runtime.ground.errors import InputError, instant
from runtime.ground.limits import LIMIT
from runtime.ground.table import Table, number

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class JointComparison:
    """Measured and predicted torques of one joint.

    Attributes
    ----------
    joint : str
        Label of the joint.
    t : ndarray, shape (N_j,), s
        Time of the rows.
    measured, predicted : ndarray, shape (N_j,), N m or N
        Y_j and W_j X.
    """

    joint: str
    t: Array
    measured: Array
    predicted: Array

    @property
    def error(self) -> Array:
        """Measured minus predicted torque, N m or N, shape (N_j,)."""
        return np.asarray(self.measured - self.predicted)

    @property
    def relative_error(self) -> float:
        """Relative error of the prediction, 100 ||measured - predicted|| / ||measured||, in %."""
        return percent(self.error, self.measured)


def direct_comparison(observation: Observation, fit: Estimate) -> tuple[JointComparison, ...]:
    """Compare the measured torques Y with the predicted torques W X of each joint, row by row."""
    missing = [name for name in fit.names if name not in observation.names]
    if missing:
        raise InputError(
            f"the observation has no columns {', '.join(missing)}; its columns "
            f"are {', '.join(observation.names)}"
        )
    columns = [observation.names.index(name) for name in fit.names]
    predicted = observation.W[:, columns] @ fit.X
    parts = []
    for j in range(observation.n):
        rows = observation.joint(j)
        label = fit.per_joint[j].joint if len(fit.per_joint) == observation.n else str(j + 1)
        parts.append(
            JointComparison(label, observation.t[rows], observation.Y[rows], predicted[rows])
        )
    return tuple(parts)


@dataclass(frozen=True)
class Prediction:
    """Relative torque error of one set of parameters on one part of the data.

    Attributes
    ----------
    part : str
        Label of the part.
    columns : str
        all, essential or feasible.
    count : int
        Number of columns.
    fitted : bool
        Whether the parameters were fitted to this part.
    relative_error : float, %
        100 ||Y - W X|| / ||Y||.
    per_joint : tuple of float, %
        The same by joint.
    """

    part: str
    columns: str
    count: int
    fitted: bool
    relative_error: float
    per_joint: tuple[float, ...]


@dataclass(frozen=True)
class CrossValidation(Result):
    """Relative torque errors of every set of parameters on every part of the data.

    missing : sentences on the sets that could not be fitted. further : whether the predicted parts
    are separate records. folds : number of equal parts of which each is predicted from the others;
    0 if windows or records are predicted.
    """

    joints: tuple[str, ...]
    predictions: tuple[Prediction, ...]
    missing: tuple[str, ...] = ()
    further: bool = False
    folds: int = 0

    def errors(self) -> dict[str, float]:
        """Return the relative error, %, of torques that each set of parameters predicts.

        The error of a set is the largest of its predictions of data outside the fit.
        """
        unseen = [p for p in self.predictions if not p.fitted]
        return {
            columns: max(p.relative_error for p in unseen if p.columns == columns)
            for columns in dict.fromkeys(p.columns for p in unseen)
        }

    def beside(self, other: CrossValidation) -> CrossValidation:
        """Combine two validations on the same data, of different sets of parameters, into one."""
        predictions = (*self.predictions, *other.predictions)
        joints = self.joints or other.joints
        missing = (*self.missing, *other.missing)
        return CrossValidation(joints, predictions, missing, self.further)

    def table(self, form: str = ".3f") -> Table:
        """Make a table of the errors in %, one line for each part and set of parameters."""
        return Table(
            "Relative error, %",
            ("part", "parameters", "use", "total", *(f"joint {j}" for j in self.joints)),
            [
                (
                    *(p.part, f"{p.columns} ({p.count})", "fitted" if p.fitted else "predicted"),
                    *(number(x, form) for x in (p.relative_error, *p.per_joint)),
                )
                for p in self.predictions
            ],
        )

    def to_table(self) -> str:
        """Write the table of errors, then sentences on the sets that could not be fitted."""
        return "\n".join([self.table().caption, self.table().to_text(), *self.missing])

    def summary(self) -> dict[str, Any]:
        """Return the validation as a mapping, for JSON."""
        return {
            "schema": 1,
            "joints": self.joints,
            "predictions": self.predictions,
            **({"missing": self.missing} if self.missing else {}),
        }


def prediction_errors(observation: Observation, fit: Estimate) -> tuple[float, tuple[float, ...]]:
    """Compute the relative error 100 ||Y - W X|| / ||Y||, in %, over all joints and by joint."""
    residual, measured = observation.norms(fit.names, fit.X)
    return percent(residual, measured), tuple(
        percent(e, m) for e, m in zip(residual, measured, strict=True)
    )


@dataclass(frozen=True)
class RecordError:
    """Relative error of one record with parameters that were fitted to several records together.

    Attributes
    ----------
    name : str
        Name of the record.
    rows : int
        Rows of W from this record.
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
    """Compute the relative error of each record with the parameters of one common fit.

    names : names of the records, in the order of `observation`.
    """
    parts = [observation.of_record(k) for k in range(len(names))]
    return tuple(
        RecordError(name, sum(part.rows), *prediction_errors(part, fit))
        for name, part in zip(names, parts, strict=True)
    )


def cross_validation(
    problem: Problem,
    fit: Observation,
    predict: Mapping[str, Observation],
    choices: Mapping[Any, EstimateSettings],
    *,
    name: str = "fit",
    fitted: Mapping[Any, Estimate] | None = None,
    further: bool = False,
) -> CrossValidation:
    """Fit every set of parameters to some rows Y = W X + rho, and predict Y of other rows.

    A set whose fit fails is left out, with a sentence in `missing`.

    Parameters
    ----------
    fit : Observation
        Rows to which the parameters are fitted.
    predict : mapping of str to Observation
        Other rows, by label.
    choices : mapping of str to EstimateSettings
        Method and columns of every set, by its name.
    name : str
        Label of `fit`.
    fitted : mapping of str to Estimate
        Estimates from `fit` that exist already, by set.
    further : bool
        Whether `predict` are separate records, not parts of the records of `fit`.
    """
    predictions = []
    missing: list[str] = []
    labels: tuple[str, ...] = ()
    for columns, settings in choices.items():
        try:
            known = (fitted or {}).get(columns)
            estimate = (
                known
                if known is not None
                else estimated(
                    problem, fit, point_estimate(settings, problem.methods), corrected=False
                )
            )
        except InputError as e:
            missing.append(f"validation of {columns} parameters, fitted on {name}: {e}")
            continue
        labels = tuple(joint.joint for joint in estimate.per_joint)
        for part, observation in {name: fit, **predict}.items():
            total, errors = prediction_errors(observation, estimate)
            predictions.append(
                Prediction(part, columns, len(estimate.names), observation is fit, total, errors)
            )
    return CrossValidation(labels, tuple(predictions), tuple(missing), further)


def split_validation(
    problem: Problem,
    observation: Observation,
    windows: Sequence[Window],
    choices: Mapping[Any, EstimateSettings],
) -> CrossValidation:
    """Fit the first time window, s, of the records, and predict the other windows."""
    if len(windows) < 2:
        raise InputError(
            f"{len(windows)} window is given; expected at least two: the first to fit, the others "
            "to predict (validate.split)"
        )
    labels = [
        f"[{', '.join('' if t is None else instant(t) for t in window)}] s" for window in windows
    ]
    parts = {
        label: observation.between(t0, t1) for label, (t0, t1) in zip(labels, windows, strict=True)
    }
    first = labels[0]
    others = {label: part for label, part in parts.items() if label != first}
    return cross_validation(problem, parts[first], others, choices, name=first)


@dataclass(frozen=True)
class Pair:
    """Two parameters and the correlation of their estimates."""

    first: str
    second: str
    correlation: float


@dataclass(frozen=True)
class Direction:
    """A combination of parameters that hardly changes W X, so that the record determines it badly.

    Attributes
    ----------
    ratio : float
        s_i / s_1 of W with unit columns.
    weights : mapping of str to float
        Entries of the singular vector, largest first.
    """

    ratio: float
    weights: Mapping[str, float]


@dataclass(frozen=True)
class WeakDirections(Result, keys="threshold pairs groups directions", schema=1):
    """Parameters that the record separates badly, because their estimates are correlated.

    The result lists correlated pairs, groups of such pairs, and the directions of the smallest
    singular values of W with unit columns.
    """

    pairs: tuple[Pair, ...]
    groups: tuple[tuple[str, ...], ...]
    directions: tuple[Direction, ...]
    threshold: float

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for each group of correlated parameters: their correlation and a remedy."""
        sentences = []
        for group in self.groups:
            pairs = [p for p in self.pairs if p.first in group]
            strongest = max(pairs, key=lambda p: abs(p.correlation))
            between = f"{strongest.first}, {strongest.second} " if len(group) > 2 else ""
            sentences.append(
                f"{', '.join(group[:-1])} and {group[-1]} are strongly correlated on this record "
                f"(correlation {between}{strongest.correlation:+.2f}): their combined effect is "
                "more certain than each value. Set one of them to a value from another source, or "
                "record a motion that separates them (symgen excite)."
            )
        return tuple(sentences)

    def tables(self, name: Callable[[str], str] = str) -> list[Table]:
        """Return a table of correlated pairs (if any) and one of badly determined combinations.

        name : function that writes the name of a parameter.
        """
        pairs = Table(
            f"Pairs with |correlation| above {self.threshold:g}, all parameters fitted",
            ("first", "second", "correlation"),
            [(name(p.first), name(p.second), f"{p.correlation:+.3f}") for p in self.pairs],
        )
        directions = Table(
            "Directions that W sees least (columns of norm 1), all parameters fitted",
            ("singular value ratio", "combination"),
            [
                (f"{d.ratio:.2e}", " ".join(f"{w:+.2f} {own}" for own, w in d.weights.items()))
                for d in self.directions
            ],
            wide=(1,),
        )
        return [pairs, directions] if self.pairs else [directions]

    def to_table(self) -> str:
        """Write the groups of correlated parameters, then the tables with their captions."""
        groups = f"groups: {'; '.join(', '.join(group) for group in self.groups) or 'none'}"
        tables = (f"{own.caption}\n{own.to_text()}" for own in self.tables())
        return "\n\n".join([groups, *tables])


def weak_directions(
    system: System,
    *,
    threshold: float = LIMIT.CORRELATION,
) -> WeakDirections:
    """Find correlated parameters, and the three parameter combinations that change W X least.

    system : rows as least squares weighs them. threshold : smallest |correlation| that is reported.
    """
    names = system.names
    R, _ = unit_columns(system.weighted.R11)
    _, s, Vt = np.linalg.svd(R)
    T = system.solve().T
    norms = np.linalg.norm(T, axis=1)
    correlation = (T @ T.T) / np.outer(norms, norms).clip(min=np.finfo(float).tiny)
    linked = np.abs(correlation) > threshold
    np.fill_diagonal(linked, False)
    pairs = [
        Pair(names[i], names[k], float(correlation[i, k]))
        for i, k in zip(*np.nonzero(np.triu(linked)), strict=True)
    ]
    components, label = connected_components(linked, directed=False)
    groups = [tuple(names[i] for i in np.flatnonzero(label == c)) for c in range(components)]
    weakest = range(len(names) - 1, max(len(names) - 4, -1), -1)
    return WeakDirections(
        pairs=tuple(sorted(pairs, key=lambda pair: -abs(pair.correlation))),
        groups=tuple(group for group in groups if len(group) > 1),
        directions=tuple(
            Direction(float(s[i] / s[0]), _named_entries(Vt[i], names)) for i in weakest
        ),
        threshold=threshold,
    )


def _named_entries(v: Array, names: Sequence[str]) -> dict[str, float]:
    """Return the largest entries of a singular vector by name of the parameter, largest first.

    The sign is chosen so that the largest entry is positive.
    """
    order = np.argsort(-np.abs(v), kind="stable")
    v = v * np.sign(v[order[0]])
    return {
        names[i]: float(v[i])
        for i in order
        if abs(v[i]) >= LIMIT.DIRECTION_PARTICIPATION * abs(v[order[0]])
    }
