"""What a feasible estimate says beyond its parameters: eigenvalues, standard parameters, and
whether least squares alone was feasible.
"""

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
        [(n, *_value_cells(v, masses.get(n))) for n, v in details["standard"].items()],
    )
    text = (
        fit.message,
        "Pseudo-inertias of the links and forms of the actuators must be positive semidefinite, "
        "inertia and friction not negative; all base parameters "
        "are fitted together. The standard parameters give exactly the torques of the base "
        "parameters; what the torques leave open is nearest to "
        "the values of the robot file. A mass that the record does not determine has a dash and "
        "its range here: standard_parameters.csv holds one complete "
        "set, to be used as a whole.",
    )
    return Section("Physical consistency", text, tables=[conditions, standard])


def _value_cells(value: float, mass: Mapping[str, Any] | None) -> tuple[str, str]:
    """Value and remark of a standard parameter; of a mass that the record does not determine, a
    dash and its range.
    """
    text = number(value, ".5g")
    return (text, "") if mass is None else (text if mass["determined"] else "-", mass_text(mass))


def mass_text(mass: Mapping[str, Any]) -> str:
    """The range of a mass over the physical robots that explain the record."""
    known = "determined" if mass["determined"] else "NOT determined"
    return f"{known}: {number(mass['lowest'], '.2g')} to {number(mass['highest'], '.3g')} kg"


def standard_csv(fit: Estimate) -> str:
    """standard_parameters.csv: name, value, note; a note says which masses the record does not
    determine.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(("name", "value", "note"))
    loose = {
        name: mass_text(mass)
        for name, mass in fit.details.get("masses", {}).items()
        if not mass["determined"]
    }
    writer.writerows(
        (name, repr(value), loose.get(name, "")) for name, value in fit.details["standard"].items()
    )
    return stream.getvalue()
