"""Conversion of classic Denavit-Hartenberg tables (1955) into tables of Khalil and Kleinfinger.

In the classic convention, here called distal, frame j lies at the far end of link j, and joint j
turns about or moves along z of its antecedent:

    iTj = Rot(z, theta_j) Trans(z, r_j) Trans(x, d_j) Rot(x, alpha_j)

Textbooks write a_j for this d_j, and d_j for this r_j.

With the factors grouped as [Rot(x, alpha_i) Trans(x, d_i)] Rot(z, theta_j) Trans(z, r_j), this is
Khalil's transformation: theta_j and r_j stay; alpha and d are those of the antecedent i, or 0 for
joints on the base. The last alpha and d of a branch give a fixed frame without link, the last frame
of the textbook. Link frames, hence standard parameters, are Khalil's. `values` of such a file refer
to the textbook's frames and are converted.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin
from typing import Any

from symgen.description.expression import ZERO
from symgen.description.parts import FIXED, INERTIAL, Frame, parameter
from symgen.errors import DescriptionError

ROUNDING = 1e-14  # cos(pi/2)


def khalil_frames(frames: tuple[Frame, ...]) -> tuple[Frame, ...]:
    """Convert the rows of a classic (distal) table into rows of Khalil's table.

    Fixed frames for the ends of branches come last. Raises DescriptionError if gamma or b is given.
    """
    for f in frames:
        for key in ("gamma", "b"):
            if getattr(f, key):
                raise DescriptionError(
                    f"frame {f.j}: {key} is not part of the distal convention; leave {key} out",
                    path=(f.j, key),
                )
    distal = {f.j: {"alpha": f.alpha, "d": f.d} for f in frames}
    base = {"alpha": ZERO, "d": ZERO}
    turned = [replace(f, **distal.get(f.ant, base)) for f in frames]  # type: ignore[arg-type]
    ends = [f for f in frames if (f.alpha or f.d) and not any(other.ant == f.j for other in frames)]
    rest = dict.fromkeys(("gamma", "b", "theta", "r"), ZERO)
    tips = [
        Frame(j, f.j, FIXED, 0, **rest, **distal[f.j])
        for j, f in enumerate(ends, start=len(frames) + 1)
    ]
    return (*turned, *tips)


def frames_text(robot: Any) -> str:
    """Say to which frames the parameters refer, if the file of the robot has a classic table;
    otherwise, return "".
    """
    if not robot.distal:
        return ""
    values = f", but `values` of {robot.file or robot.name} in those of its classic table"
    return (
        "parameters are in Khalil's frames, frame j at joint j"
        f"{values if robot.values else ', not in those of the classic table'}: one name, such as MX2, "
        "has another number in each. Numbers under `values` are converted"
    )


def khalil_values(robot: Any) -> dict[str, float]:
    """Convert the link parameters of a classic (distal) table to Khalil's link frames.

    Frame j of the table lies at Rot(x, alpha_j) Trans(x, d_j) in Khalil's frame j. With the
    rotation R and the position p of this transformation, ms = R MS, and J, M of the link,

        MS' = ms + M p,     J' = R J R' + 2 (ms p) E - p ms' - ms p' + M (p p E - p p')

    A parameter is converted if all values on which it depends are given. Raises DescriptionError if
    a given value enters no converted parameter; the message names the missing values.
    """
    values = dict(robot.values)
    for j in robot.links:
        child = next((f for f in robot.frames if f.ant == j), None)
        given = {p: values[parameter(p, j)] for p in INERTIAL if parameter(p, j) in values}
        if child is None or not given or not (child.alpha or child.d):
            continue
        rows = _transport(child.alpha.value(robot.constants), child.d.value(robot.constants))
        whole = {p: row for p, row in rows.items() if row.keys() <= given.keys()}
        if lost := [p for p in given if not any(p in row for row in whole.values())]:
            beside = {p for row in rows.values() if row.keys() & {*lost} for p in row}
            missing = [parameter(p, j) for p in INERTIAL if p in beside - given.keys()]
            raise DescriptionError(
                f"values of link {j} are given in the frame at the end of the link (convention: distal); to convert {', '.join(parameter(p, j) for p in lost)}, also give {', '.join(missing)}",
                path=("values", parameter(lost[0], j)),
            )
        for p in given:
            del values[parameter(p, j)]
        values |= {
            parameter(p, j): float(sum(c * given[k] for k, c in row.items()))
            for p, row in whole.items()
        }
    return values


def _transport(alpha: float, d: float) -> dict[str, dict[str, float]]:
    """Return each parameter of a link in Khalil's frame as a combination of the parameters at its
    far end.

    The result is {parameter: {parameter at the far end: coefficient that is not zero}}.
    """
    c, s = cos(alpha), sin(alpha)
    rows = {
        "XX": {"XX": 1.0},
        "XY": {"XY": c, "XZ": -s, "MY": -d * c, "MZ": d * s},
        "XZ": {"XY": s, "XZ": c, "MY": -d * s, "MZ": -d * c},
        "YY": {"YY": c * c, "YZ": -2 * c * s, "ZZ": s * s, "MX": 2 * d, "M": d * d},
        "YZ": {"YY": c * s, "YZ": c * c - s * s, "ZZ": -c * s},
        "ZZ": {"YY": s * s, "YZ": 2 * c * s, "ZZ": c * c, "MX": 2 * d, "M": d * d},
        "MX": {"MX": 1.0, "M": d},
        "MY": {"MY": c, "MZ": -s},
        "MZ": {"MY": s, "MZ": c},
        "M": {"M": 1.0},
    }
    least = ROUNDING * max(abs(x) for row in rows.values() for x in row.values())
    return {p: {k: x for k, x in row.items() if abs(x) > least} for p, row in rows.items()}
