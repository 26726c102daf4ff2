"""A script that uses a robot in another program: its links from a URDF, its motors, friction and offsets as matrices over the joints.

    Gamma = links(q, qd, qdd) + MOTORS qdd + VISCOUS qd + STIFFNESS q + OFFSET + dry friction along s = G qd

The matrices sum the elements of the robot file: c G'G of one along s = G q, c B of a form.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from symgen.description.robot import Element, Robot
from symgen.emit.render import laid_out
from symgen.errors import SymgenError
from symgen.version import VERSION

PROGRAMS = ("pinocchio", "drake")
LINEAR_KINDS = ("inertia", "viscous", "stiffness")

Matrix = list[list[float]]


def use_script(robot: Robot, program: str, values: Mapping[str, float]) -> str:
    """Text of the script for one of PROGRAMS.

    values : standard parameters by name, those of the URDF beside it. Raises SymgenError where some are missing or joints are passive.
    """
    if robot.passive:
        raise SymgenError(f"{robot.name}: joints {list(robot.passive)} are passive; a snippet needs a robot whose joints are all actuated")
    if missing := [name for name in robot.parameters if name not in values]:
        more = " ..." * (len(missing) > 12)
        raise SymgenError(
            f"{robot.name}: no value of {', '.join(missing[:12])}{more}; add them under values, 0 where one is zero, or give --estimate"
        )
    n = len(robot.joints)
    matrices: dict[str, Matrix] = {kind: [[0.0] * n for _ in range(n)] for kind in LINEAR_KINDS}
    offset = [0.0] * n
    along: list[tuple[str, float, list[float], str]] = []
    for e in robot.elements:
        for j in e.keys:
            c = float(values[f"{e.family}{j}"])
            if j in e.along and (e.kind == "coulomb" or e.when):
                along.append((e.kind, c, _row(robot, e, j), e.when or "both"))
            elif e.kind == "offset":
                offset = [total + c * g for total, g in zip(offset, _row(robot, e, j), strict=True)]
            else:
                matrices[e.kind] = _sum(matrices[e.kind], c, _form(robot, e, j))
    context: dict[str, Any] = {
        "name": robot.name,
        "version": VERSION,
        "joints": tuple(f"q{j}" for j in robot.joints),
        "gravity": [float(e.value(robot.constants)) for e in robot.gravity],
        **matrices,
        "offset": offset,
        "along": along,
        "standard": {name: float(values[name]) for name in robot.parameters},
    }
    return laid_out(f"use_{program}.py", context)


def _row(robot: Robot, e: Element, j: int) -> list[float]:
    """G of s = G q, over the joints."""
    return [float(e.along[j][i].value(robot.constants)) if i in e.along[j] else 0.0 for i in robot.joints]


def _form(robot: Robot, e: Element, j: int) -> Matrix:
    """B of the element, over the joints."""
    if j in e.along:
        G = _row(robot, e, j)
        return [[a * b for b in G] for a in G]
    B = e.form[j]
    return [[float(B[i, k].value(robot.constants)) if (i, k) in B else 0.0 for k in robot.joints] for i in robot.joints]


def _sum(A: Matrix, c: float, B: Matrix) -> Matrix:
    return [[a + c * b for a, b in zip(*rows, strict=True)] for rows in zip(A, B, strict=True)]
