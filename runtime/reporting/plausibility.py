"""Whether record, study and robot file suit each other, on a page: what would explain the record
better, delays, values of the robot file.
"""

from __future__ import annotations

from runtime.checks.plausibility import Plausibility
from runtime.markup import number
from runtime.reporting.page import Section
from runtime.table import Table


def plausibility_section(found: Plausibility) -> Section:
    """The checks stand with the others at the top; here is what they rest on."""
    tables = [found.table()] if any(trial.fit is not None for trial in found.trials) else []
    text = [f"No record can tell: {change}." for change in found.equivalent]
    if found.gravity is not None:
        text.append(f"Gravity fitted freely: {found.gravity.text}.")
    if found.delay is not None:
        rows = zip(
            found.delay.joints,
            found.delay.shift,
            found.delay.sigma,
            found.delay.before,
            found.delay.after,
            strict=True,
        )
        cells = [
            (j, number(1e3 * d, ".2f"), number(1e3 * s, ".2f"), number(a, ".2f"), number(b, ".2f"))
            for j, d, s, a, b in rows
        ]
        header = ("joint", "torque late by, ms", "deviation, ms", "error without, %", "with, %")
        tables.append(Table("Delay of the torques against the positions", header, cells))
    if found.robot_values is not None:
        values = zip(
            found.robot_values.joints,
            found.robot_values.gravity,
            found.robot_values.inertia,
            found.robot_values.error,
            strict=True,
        )
        ratios = [
            (j, number(g, ".2f"), number(a, ".2f"), number(e, ".1f")) for j, g, a, e in values
        ]
        header_of_values = (
            "joint",
            "gravity torque, measured over computed",
            "inertia torque, measured over computed",
            "error of the values, %",
        )
        tables.append(
            Table(
                "Values of the robot file against the record, friction fitted",
                header_of_values,
                ratios,
            )
        )
    return Section("Record, study and robot file", tuple(text), tables=tables)
