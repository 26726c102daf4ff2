"""The load and the torque constants it weighs, as a section of a report."""

from __future__ import annotations

from runtime.identification.payload_study import PayloadStudy
from runtime.markup import number
from runtime.reporting.page import Section
from runtime.table import Table


def payload_section(study: PayloadStudy) -> Section:
    """Parameters of the load; gains motor by motor."""
    joint, difference = study.payload, study.difference
    rows = [(name, number(value, ".5g"), "given", "", "") for name, value in joint.known.items()]
    for k, name in enumerate(joint.names):
        second = ("-", "-") if difference is None else (number(difference.value[k], ".5g"), number(difference.sigma[k], ".2g"))
        rows.append((name, number(joint.value[k], ".5g"), number(joint.sigma[k], ".2g"), *second))
    header = ("parameter", "joint solution", "sigma", "difference of two estimates", "sigma")
    tables = [Table(f"Load on {joint.place}, its parameters there, SI", header, rows)]
    text = ["Records with and without the load, fitted together; the difference of two separate estimates beside it."]
    if study.gains is not None:
        gains = study.gains
        lines = [
            (j, *(number(float(x), ".5g") for x in values))
            for j, *values in zip(gains.joints, gains.together, gains.sigma, gains.alone, gains.sigma_alone, strict=True)
        ]
        tables.append(Table("Factors on the torque constants of the robot file", ("motor", "together", "sigma", "alone", "sigma"), lines))
        text.append(f"Torque constants: {gains.text}.")
    return Section("Load", text, tables=tables)
