"""Layouts of estimate.json and cestac.json as types, their JSON Schemas, and the estimate in a file that a robot file or a program is given.

SI units, rad, joint side. Equation numbers are those of the chapter. A number that does not exist is null. Readers leave out keys that they do not know; keys may be added under the same version.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import core_schema

from runtime.core.cestac.result import SCHEMA as CESTAC
from runtime.core.cestac.result import LevelResult, Verdict
from runtime.core.cestac.runs import Run
from runtime.core.errors import InputError
from runtime.core.json_results import NanIfNull, Vector, Whole, from_text
from runtime.core.least_squares.estimate import SCHEMA as ESTIMATE
from runtime.core.least_squares.estimate import Estimate, JointFit
from runtime.core.parameter_sets import SetName, whole_set
from runtime.core.validation import RecordError, WeakDirections
from runtime.documents.files import result_text


@dataclass(frozen=True, eq=False)
class EssentialDocument:
    """Essential parameters, fitted alone.

    Attributes
    ----------
    names : tuple of str
        Names in column order; b of them.
    X : ndarray, shape (b,), SI
        Values.
    sigma : ndarray, shape (b,), SI
        Standard deviations, eq. (10).
    relative_sigma : ndarray, shape (b,), %
        100 sigma / |X|, eq. (11).
    sigma_corrected : ndarray, shape (b,), SI
        Sigma without the assumption of independent residuals.
    relative_error : float, %
        100 ||Y - W X|| / ||Y||.
    per_joint : tuple of JointFit
        Fit by joint.
    threshold : float
        Largest ratio of sigma_rho to its first value.
    trail : tuple of mapping
        Parameters in the order in which they were removed.
    """

    names: tuple[str, ...]
    X: Vector
    sigma: Vector
    relative_sigma: Vector
    sigma_corrected: Vector
    relative_error: float
    per_joint: tuple[JointFit, ...]
    threshold: float
    trail: tuple[dict[str, Any], ...]


@dataclass(frozen=True, eq=False)
class SetDocument:
    """One of the nested sets of parameters (`runtime.core.parameter_sets`).

    Attributes
    ----------
    name : str
        essential, feasible or all.
    count : int
        Number of parameters b.
    relative_error : float, %
        100 ||Y - W X|| / ||Y||.
    unseen : float, %
        Error on data that the set was not fitted to; null if nothing was predicted.
    names : tuple of str
        Names in column order.
    X : ndarray, shape (b,), SI
        Values.
    sigma_corrected : ndarray, shape (b,), SI
        Standard deviations without the assumption of independent residuals.
    standard : mapping, SI
        Standard parameters of the physical robot, by name; empty for the other sets.
    """

    name: SetName
    count: Whole
    relative_error: NanIfNull
    unseen: NanIfNull
    names: tuple[str, ...]
    X: Vector
    sigma_corrected: Vector
    standard: dict[str, float] = field(default_factory=dict)  # files of before have none


@dataclass(frozen=True, eq=False, kw_only=True)
class SetsDocument(Estimate):
    """All parameters by the method of the study, and the nested sets.

    Attributes
    ----------
    sets : tuple of SetDocument
        Empty if the method is not linear.
    model_columns : str
        Name of the set that is used.
    """

    sets: tuple[SetDocument, ...]
    model_columns: SetName


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentificationDocument(SetsDocument):
    """Parameters of a robot with their uncertainty; with the keys from `sets` on where a whole identification is written.

    Attributes
    ----------
    sets : tuple of SetDocument
        The essential, the feasible and all parameters; empty if the method is not linear.
    model_columns : str
        Name of the set that is used.
    essential : EssentialDocument
        Essential parameters, fitted alone.
    validation : tuple of mapping
        Predictions of parts of the data with parameters from other parts.
    weak_directions : WeakDirections
        Parameters that trade against each other, and the directions that W sees least.
    warnings : tuple of str
        Sentences to read before the values are used.
    trust : mapping
        Deviations by blocks, whiteness, F-tests.
    by_record : tuple of RecordError
        Of several records, the error of each, with the parameters that are used.
    verdict : str
        One sentence.
    checklist : mapping
        Question by question whether the values can be used; the answer in a word.
    feasibility : mapping
        Whether a physical robot can have the parameters.
    payload : mapping
        Parameters of the load, from records without and with it.
    drive_gains : mapping or None
        Torque constants of the drives, from the load.
    friction : tuple of mapping
        Friction against velocity, one curve per joint.
    laws : mapping
        Scalars of the laws of columns, and their errors on unseen data.
    plausibility : mapping
        Whether record, study and robot file suit each other.
    """

    essential: EssentialDocument
    validation: tuple[dict[str, Any], ...]
    weak_directions: WeakDirections
    warnings: tuple[str, ...]
    trust: dict[str, Any]
    by_record: tuple[RecordError, ...]
    verdict: str
    checklist: dict[str, Any]
    feasibility: dict[str, Any]
    payload: dict[str, Any]
    drive_gains: dict[str, Any] | None
    friction: tuple[dict[str, Any], ...]
    laws: dict[str, Any]
    plausibility: dict[str, Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class LevelDocument(LevelResult):
    """One resolution of a study.

    Attributes
    ----------
    runs : tuple of Run or None
        The runs; null if there are more than a thousand.
    run_count : int
        Number of runs.
    """

    runs: tuple[Run, ...] | None  # type: ignore[assignment]
    run_count: Whole


@dataclass(frozen=True, eq=False)
class CestacDocument:
    """Resolution study of encoders and torques.

    Attributes
    ----------
    names : tuple of str
        Parameters in column order; b of them.
    X_LS : ndarray, shape (b,), SI
        Estimate from the unperturbed record.
    relative_sigma_LS : ndarray, shape (b,), %
        Its relative deviations, eq. (11).
    deciding : tuple of str
        Parameters that decide the verdict.
    verdict : str
        The worst of the levels.
    enough : str or None
        Coarsest encoder step that is practically unbiased, as are all finer ones; None: no step is.
    levels : tuple of LevelDocument
        One result per level.
    settings : mapping
        Settings of the study, complete.
    provenance : mapping
        Hashes, versions, records.
    notes : tuple of str
        What the figures do not say.
    """

    names: tuple[str, ...]
    X_LS: Vector
    relative_sigma_LS: Vector
    deciding: tuple[str, ...]
    verdict: Verdict
    enough: str | None
    levels: tuple[LevelDocument, ...]
    settings: dict[str, Any]
    provenance: dict[str, Any]
    notes: tuple[str, ...] = ()


def load_estimate(path: Path | str) -> Estimate:
    """The Estimate in a file that `Estimate.to_json` or `symgen identify -o` wrote.

    InputError as `Estimate.from_json`.
    """
    return from_text(Estimate, result_text(path), ESTIMATE, str(path))


def load_whole_estimate(path: Path | str) -> Estimate:
    """The estimate of all base parameters in estimate.json that a robot file or a program is given:
    of the set that is used, or where that is the essential one, of the physical
    parameters (`whole_set`). Of its fields, names, X, sigma_corrected, relative_error and
    details.standard are those of that set; the others, the covariance among them, those of
    least squares. InputError as `load_estimate`.
    """
    fit, text = load_estimate(path), result_text(path)
    if not json.loads(text).get("sets"):
        return fit
    document = from_text(SetsDocument, text, ESTIMATE, str(path))
    sets = {one.name: one for one in document.sets}
    whole = sets.get(whole_set(sets, document.model_columns))
    if (
        whole is None
        or whole.names != fit.names
        or not len(whole.X) == len(whole.sigma_corrected) == len(fit.X)
    ):
        raise InputError(
            "its sets are not those of its parameters; the file was changed", file=str(path)
        )
    return replace(
        fit,
        method="feasible" if whole.name == "feasible" else fit.method,
        X=whole.X,
        sigma_corrected=whole.sigma_corrected,
        relative_error=whole.relative_error,
        details={**fit.details, **({"standard": whole.standard} if whole.standard else {})},
    )


class ResultSchema(GenerateJsonSchema):
    """JSON Schema of results, in which null means nan or infinity."""

    def float_schema(self, schema: core_schema.FloatSchema) -> dict[str, Any]:
        """A number or null."""
        return {"type": ["number", "null"]}


def result_schema(of: str) -> dict[str, Any]:
    """JSON Schema of estimate.json ("estimate") or of cestac.json ("cestac")."""
    kind, schema = {
        "estimate": (IdentificationDocument, ESTIMATE),
        "cestac": (CestacDocument, CESTAC),
    }[of]
    made = TypeAdapter(kind).json_schema(mode="serialization", schema_generator=ResultSchema)
    properties = {"schema": {"const": schema}, **made["properties"]}
    optional: set[str] = set()
    if of == "estimate":
        properties |= {"relative_sigma": properties["sigma"], "rows": properties["rank"]}
        optional = {f.name for f in fields(IdentificationDocument)} - {
            f.name for f in fields(Estimate)
        }
    return {
        **made,
        "title": schema,
        "properties": properties,
        "required": sorted({*properties} - optional),
    }
