"""What the standard parameters of a robot are, as constants of its module: the links that carry inertia, and the elements on its joints.

A runtime that asks whether parameters are those of a physical robot needs to know which ten belong to one link and which quadratic form an
element stands for; nothing here enters the formulas.
"""

from __future__ import annotations

from typing import Any

from symgen.derive.columns import element_names
from symgen.description.robot import Robot
from symgen.emit.header import literal, packed


def physical_tables(robot: Robot) -> list[str]:
    """LINKS and ELEMENTS, as Python source."""
    return [*literal("LINKS", robot.links), *_elements(robot)]


def _elements(robot: Robot) -> list[str]:
    entries = {name: _element(robot, name) for name in robot.parameters if name in element_names(robot)}
    if not entries:
        return ["ELEMENTS = {}"]
    return [
        "ELEMENTS = {  # (kind, direction of motion, row G of s = G q as {j: G_j} or form q'Bq as {(i, j): B_ij}, i <= j)",
        *packed([f"{name!r}: {entry!r}" for name, entry in entries.items()]),
        "}",
    ]


def _element(robot: Robot, name: str) -> tuple[str, str, dict[Any, float]]:
    e, j = element_names(robot)[name]
    if j in e.form:
        form = {(i, k): float(b.value(robot.constants)) for (i, k), b in sorted(e.form[j].items()) if i <= k}
        return e.kind, e.when or "both", form
    return e.kind, e.when or "both", {i: float(g.value(robot.constants)) for i, g in e.along[j].items()}
