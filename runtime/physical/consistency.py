"""Part of a result that says whether a physical robot can have the identified parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from runtime.core.least_squares.estimate import Estimate
from runtime.core.result import Identification
from runtime.ground.check import Answer, Check, Question
from runtime.ground.errors import InputError
from runtime.ground.part import Part
from runtime.ground.table import Table, csv_text, number
from runtime.physical.feasibility import Feasibility, feasibility, within_noise
from runtime.physical.inertia import physical_model

CONDITIONS = "Pseudo-inertias of the links and forms of the actuators must be positive semidefinite, inertia and friction not negative; all base parameters are fitted together. The standard parameters give exactly the torques of the base parameters; what the torques leave open is nearest to the values of the robot file. No single one of them is a value to use by itself: standard_parameters.csv holds one complete set, to be used as a whole."


@dataclass(frozen=True, eq=False)
class Consistency(Part):
    """Part of a result: whether a physical robot can have the identified parameters.

    Attributes
    ----------
    estimate : Estimate
        Estimate of all parameters.
    fit : Estimate
        Estimate of the parameters that are used.
    judged : Feasibility or None
        Physical check of `estimate`; None if it was not requested.
    """

    estimate: Estimate
    fit: Estimate
    judged: Feasibility | None = None

    name = "feasibility"
    title = "Physical consistency"

    @property
    def fitted(self) -> bool:
        """Whether the parameters were fitted under the conditions of a physical robot."""
        return "standard" in self.fit.details

    def text(self) -> str:
        """Write whether a physical robot can have the parameters.

        If `fit` was made under the conditions of a physical robot, the text also gives these
        conditions.
        """
        fitted = [self.fit.message, CONDITIONS] if self.fitted else []
        return "\n".join([*fitted, self.brief()]).strip()

    def brief(self) -> str:
        """Write in one sentence whether the parameters are physical; "" if this was not checked."""
        return "" if self.judged is None else f"The parameters are {self.judged.text}."

    def tables(self) -> list[Table]:
        """Make tables of physical conditions and standard parameters, if the fit used conditions.

        The first table gives the smallest eigenvalue of each condition. If the parameters were not
        fitted under these conditions, the list is empty.
        """
        if not self.fitted:
            return []
        details = self.fit.details
        conditions = [
            (name, number(value, ".3e"), "yes" if name in details["active"] else "")
            for name, value in details["smallest_eigenvalues"].items()
        ]
        standard = [(name, number(value, ".5g")) for name, value in details["standard"].items()]
        header = ("condition", "smallest eigenvalue", "at its limit")
        return [
            Table("Conditions of a physical robot", header, conditions),
            Table("Standard parameters of one such robot", ("parameter", "value"), standard),
        ]

    def checks(self) -> tuple[Check, ...]:
        """Return one check: whether a physical robot can have the estimated parameters."""
        return (physical(self),)

    def summary(self) -> dict[str, Any] | None:
        """Return the physical check as a mapping for JSON; None if it was not requested."""
        if self.judged is None:
            return None
        blocking = [{"condition": name, "margin": margin} for name, margin in self.judged.blocking]
        return {
            "feasible": self.judged.feasible,
            "margin": self.judged.margin,
            "blocking": blocking,
        }

    def files(self) -> dict[str, str]:
        """Return a CSV file with one complete set of standard parameters, if the fit gave one."""
        if not self.fitted:
            return {}
        standard = list(self.fit.details["standard"].items())
        return {"standard_parameters.csv": csv_text(("name", "value"), standard)}


@Question(
    "Can a physical robot have them?",
    "every pseudo-inertia positive semidefinite, friction and motor inertia not negative",
)
def physical(part: Consistency) -> Answer:
    """Answer whether a physical robot can have all estimated parameters."""
    if part.fitted or "standard" in part.estimate.details:
        return Answer("good", "Yes: they were fitted under these conditions")
    judged = part.judged
    if judged is None:
        return Answer("open", "Not asked", "symgen report, or symgen identify --physical")
    if judged.feasible:
        return Answer("good", f"Yes, margin {judged.margin:.2g}")
    blocking = ", ".join(name for name, _ in judged.blocking)
    return Answer(
        "doubtful",
        f"No: no body can have the values that the fit of all parameters gives {blocking}",
        "before you simulate or control with them, fit under these conditions (estimate: "
        "{method: feasible}); predicted torques are not affected",
    )


def as_fitted(result: Identification) -> Consistency:
    """Make the result part on physical consistency without running the physical check.

    The part still shows parameters that were fitted under the conditions of a physical robot.
    """
    return Consistency(result.estimate, result.model_estimate)


def consistency(result: Identification) -> Consistency:
    """Check whether a physical robot can have all parameters of an identification.

    Parameters that are not physical also pass if the record cannot distinguish them from physical
    ones. Raise InputError if the record does not determine all parameters.
    """
    if not result.determined:
        groups = "; ".join(", ".join(group) for group in result.estimate.groups)
        raise InputError(
            f"the record does not determine {groups} separately; record a richer motion"
        )
    return Consistency(result.estimate, result.model_estimate, _judged(result))


def _judged(result: Identification) -> Feasibility:
    bodies = physical_model(result.model)
    fit = result.estimate
    judged = feasibility(bodies, fit.names, fit.X)
    if judged.feasible or fit.covariance is None or not np.isfinite(fit.covariance).all():
        return judged
    wider = max(1.0, float(np.median(fit.sigma_corrected / fit.sigma)))
    return within_noise(judged, bodies, fit.names, fit.X, wider**2 * fit.covariance)
