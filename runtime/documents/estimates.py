"""Types and JSON Schemas of estimate.json and cestac.json, and reading of estimates from files.

SI units, rad, joint side. Equation numbers are those of the chapter. A number that does not exist
is null. Readers ignore keys that they do not know; keys may be added under the same version.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import core_schema

from runtime.core.cestac.result import SCHEMA as CESTAC
from runtime.core.cestac.result import LevelResult, Verdict
from runtime.core.cestac.runs import Run
from runtime.core.least_squares.estimate import SCHEMA as ESTIMATE
from runtime.core.least_squares.estimate import Estimate, JointFit
from runtime.core.parameter_sets import SetDocument, SetName, whole_set
from runtime.core.validation import RecordError, WeakDirections
from runtime.documents.files import result_text
from runtime.ground.documents import Vector, Whole, from_text
from runtime.ground.errors import InputError


@dataclass(frozen=True, eq=False)
class EssentialDocument:
    """Estimate of the essential parameters alone, the subset that suffices to explain the torques.

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
        Standard deviations without the assumption of independent residuals.
    relative_error : float, %
        100 ||Y - W X|| / ||Y||.
    per_joint : tuple of JointFit
        Fit by joint.
    threshold : float
        Largest allowed ratio of sigma_rho to its first value.
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


@dataclass(frozen=True, eq=False, kw_only=True)
class SetsDocument(Estimate):
    """Content of an estimate file: the estimate of all parameters, then one estimate for each set.
    The sets are the essential, the feasible and all parameters.

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
    """Content of estimate.json: the parameters of a robot, their uncertainty and all checks.

    The keys from `sets` on are present only if a whole identification was written.

    Attributes
    ----------
    sets : tuple of SetDocument
        The essential, the feasible and all parameters; empty if the method is not linear.
    model_columns : str
        Name of the set that is used.
    essential : EssentialDocument
        Essential parameters, fitted without the others.
    validation : tuple of mapping
        Predictions of parts of the data with parameters from other parts.
    weak_directions : WeakDirections
        Parameters whose changes compensate each other, and the directions with the smallest
        effect in W.
    warnings : tuple of str
        Sentences to read before the values are used.
    trust : mapping
        Standard deviations by blocks, whiteness, F-tests.
    by_record : tuple of RecordError
        Error of each record, with the parameters that are used, if there are several records.
    verdict : str
        One sentence.
    checklist : mapping
        Questions whether the values can be used, each with its answer in a word.
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
    """Part of cestac.json: results for one pair of rounding steps, of positions and of torques.

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
    """Content of cestac.json: the result of a study of the encoder resolution.

    Attributes
    ----------
    names : tuple of str
        Parameters in column order; b of them.
    X_LS : ndarray, shape (b,), SI
        Estimate from the unperturbed record.
    relative_sigma_LS : ndarray, shape (b,), %
        Relative standard deviations of X_LS, eq. (11).
    deciding : tuple of str
        Parameters that decide the verdict.
    verdict : str
        The worst verdict of the levels.
    enough : str or None
        Coarsest encoder step that is practically unbiased, as are all finer ones; None: no step is.
    levels : tuple of LevelDocument
        One result per level.
    settings : mapping
        Settings of the study, complete.
    provenance : mapping
        Hashes, versions, records.
    notes : tuple of str
        Remarks for the user, a sentence each.
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
    """Read an estimate from a file that `Estimate.to_json` or `symgen identify -o` wrote.

    Raise InputError as for `Estimate.from_json`.
    """
    return from_text(Estimate, result_text(path), ESTIMATE, str(path))


def load_whole_estimate(path: Path | str) -> Estimate:
    """Read from estimate.json the values of all base parameters that a robot model should use.

    The estimate has names, X, sigma_corrected, relative_error and details.standard of the parameter
    set that is used, or of the physical parameters if the essential set is used (`whole_set`). The
    other fields, for instance the covariance, are those of least squares. Raises InputError as
    `load_estimate` does.
    """
    fit, document = _fit_and_sets(path)
    if document is None:
        return fit
    sets = {one.name: one for one in document.sets}
    whole = sets.get(whole_set(sets, document.model_columns))
    if (
        whole is None
        or whole.names != fit.names
        or not len(whole.X) == len(whole.sigma_corrected) == len(fit.X)
    ):
        raise InputError(
            "the parameters in the list `sets` differ from the other parameters of the file, so "
            "the file was edited; write the file again with symgen identify",
            file=str(path),
        )
    return replace(
        fit,
        method="feasible" if whole.name == "feasible" else fit.method,
        X=whole.X,
        sigma_corrected=whole.sigma_corrected,
        relative_error=whole.relative_error,
        details={**fit.details, **({"standard": whole.standard} if whole.standard else {})},
    )


def load_used_set(path: Path | str) -> tuple[Estimate, Estimate | SetDocument]:
    """Read two estimates from estimate.json: the estimate of all parameters, and that of the set in
    use.

    Raises InputError as `load_estimate` does.
    """
    fit, document = _fit_and_sets(path)
    if document is None:
        return fit, fit
    return fit, next((one for one in document.sets if one.name == document.model_columns), fit)


def _fit_and_sets(path: Path | str) -> tuple[Estimate, SetsDocument | None]:
    """Read estimate.json twice: as a plain estimate, and as an estimate with all sets, if the file
    has several.
    """
    text = result_text(path)
    fit = from_text(Estimate, text, ESTIMATE, str(path))
    has_sets = json.loads(text).get("sets")
    return fit, from_text(SetsDocument, text, ESTIMATE, str(path)) if has_sets else None


class ResultSchema(GenerateJsonSchema):
    """Generator of the JSON Schema of result files, in which null means nan or infinity."""

    def float_schema(self, schema: core_schema.FloatSchema) -> dict[str, Any]:
        """Return the JSON Schema of a value that is a number or null."""
        return {"type": ["number", "null"]}


def result_schema(of: str) -> dict[str, Any]:
    """Return the JSON Schema of estimate.json ("estimate") or of cestac.json ("cestac")."""
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
