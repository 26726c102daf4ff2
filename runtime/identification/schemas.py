"""Layouts of estimate.json and cestac.json as types, and the JSON Schemas made from them and from
the settings.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from runtime.estimators.estimate import SCHEMA as ESTIMATE
from runtime.estimators.estimate import Estimate, JointFit
from runtime.identification.validation import RecordError, WeakDirections
from runtime.json_documents import Vector, Whole, json_schema
from runtime.model.drives import Coupling
from runtime.resolution.result import SCHEMA as CESTAC
from runtime.resolution.result import LevelResult, Verdict
from runtime.resolution.runs import Run
from runtime.settings.study import Study

RESULT = (
    "SI units, rad, joint side. Equation numbers are those of the chapter. A number that "
    "does "
    "not exist is null. Readers leave out keys they do not know; keys may be added under the "
    "same version."
)


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
class CouplingDocument:
    """Fit with a part of the coupling of the drives.

    Attributes
    ----------
    relative_error : float, %
        100 ||Y - W X|| / ||Y||.
    per_joint : tuple of JointFit
        Fit by joint.
    """

    relative_error: float
    per_joint: tuple[JointFit, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentificationDocument(Estimate):
    """Parameters of a robot with their uncertainty; with the keys from `essential` on where a whole
    identification is written.

    Attributes
    ----------
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
    coupling : mapping of CouplingDocument
        Fit with the coupling of the drives in both directions, one or none.
    by_record : tuple of RecordError
        Of several records, the error of each, with the parameters that stand for the robot.
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
        Scalars of the laws of columns, and what these are worth on unseen data.
    plausibility : mapping
        Whether record, study and robot file suit each other.
    """

    essential: EssentialDocument
    validation: tuple[dict[str, Any], ...]
    weak_directions: WeakDirections
    warnings: tuple[str, ...]
    trust: dict[str, Any]
    coupling: dict[Coupling, CouplingDocument]
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
        The runs; null where there are more than a thousand.
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
    levels: tuple[LevelDocument, ...]
    settings: dict[str, Any]
    provenance: dict[str, Any]
    notes: tuple[str, ...] = ()


def schemas() -> dict[str, str]:
    """The JSON Schemas of study files, estimate.json and cestac.json, by kind."""
    optional = {f.name for f in fields(IdentificationDocument)} - {f.name for f in fields(Estimate)}
    study = (
        "Everything about an experiment that is not the robot. SI units and rad; numbers may be "
        "arithmetic texts such as 2*pi/10000, and one "
        "value stands for a list of one."
    )
    return {
        "study": json_schema(Study, "symgen study file", study),
        "estimate": json_schema(
            IdentificationDocument,
            ESTIMATE,
            (
                "Parameters of a robot with their uncertainty: Estimate.to_json, and estimate.json "
                "of "
                f"`symgen identify`. {RESULT}"
            ),
            const=ESTIMATE,
            computed=("relative_sigma", "rows"),
            optional=optional,
        ),
        "cestac": json_schema(
            CestacDocument,
            CESTAC,
            (
                "Resolution study of encoders and torques: Cestac.to_json, and cestac.json of "
                "`symgen "
                f"cestac`. {RESULT}"
            ),
            const=CESTAC,
        ),
    }
