"""The load and the torque constants it weighs, as a section of a report."""

from __future__ import annotations

from runtime.identification.payload_study import PayloadStudy
from runtime.markup import number
from runtime.reporting.page import Section
from runtime.table import Table


def payload_section(study: PayloadStudy) -> Section:
    """Parameters of the load; gains motor by motor."""
    load = study.payload
    rows = [(name, number(value, ".5g"), "given") for name, value in load.given.items()]
    rows += [
        (name, number(value, ".5g"), number(sigma, ".2g"))
        for name, value, sigma in zip(load.names, load.value, load.sigma, strict=True)
    ]
    caption = f"Load on {load.place}, its parameters there, SI"
    tables = [Table(caption, ("parameter", "value", "sigma"), rows)]
    text = ["Records with and without the load, fitted together."]
    if study.gains is not None:
        gains = study.gains
        lines = [
            (j, *(number(float(x), ".5g") for x in values))
            for j, *values in zip(
                gains.joints,
                gains.together,
                gains.sigma,
                gains.alone,
                gains.sigma_alone,
                strict=True,
            )
        ]
        tables.append(
            Table(
                "Factors on the torque constants of the robot file",
                ("motor", "together", "sigma", "alone", "sigma"),
                lines,
            )
        )
        text.append(f"Torque constants: {gains.text}.")
    return Section("Load", text, tables=tables)
