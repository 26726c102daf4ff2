"""What a feasible estimate says beyond its parameters: eigenvalues, standard parameters, and whether least squares alone was feasible."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from typing import Any

from runtime.estimators.estimate import Estimate
from runtime.markup import number
from runtime.reporting.page import Section
from runtime.table import Table


def physical_section(fit: Estimate) -> Section:
    """Conditions with their smallest eigenvalues, then the standard parameters."""
    details = fit.details
    conditions = Table(
        "Conditions of a physical robot",
        ("condition", "smallest eigenvalue", "at its limit"),
        [
            (name, number(value, ".3e"), "yes" if name in details["active"] else "")
            for name, value in details["smallest_eigenvalues"].items()
        ],
    )
    masses = details.get("masses", {})
    standard = Table(
        "Standard parameters of one such robot",
        ("parameter", "value", "what the record says of it"),
        [(n, number(v, ".5g"), mass_text(masses.get(n))) for n, v in details["standard"].items()],
    )
    text = (
        fit.message,
        "Pseudo-inertias of the links and forms of the actuators must be positive semidefinite, inertia and friction not negative; all base parameters "
        "are fitted together. The standard parameters give exactly the torques of the base parameters; what the torques leave open is nearest to "
        "the values of the robot file: a mass that the record does not determine is no value to use by itself.",
    )
    return Section("Physical consistency", text, tables=[conditions, standard])


def mass_text(mass: Mapping[str, Any] | None) -> str:
    """The range of a mass over the physical robots that explain the record; "" for another parameter."""
    if mass is None:
        return ""
    known = "determined" if mass["determined"] else "NOT determined"
    return f"{known}: {number(mass['lowest'], '.3g')} to {number(mass['highest'], '.3g')} kg"


def standard_csv(fit: Estimate) -> str:
    """standard_parameters.csv: name, value."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(("name", "value"))
    writer.writerows((name, repr(value)) for name, value in fit.details["standard"].items())
    return stream.getvalue()
