"""Conversion of link parameters from the frames of a classic (distal) table to Khalil's frames."""

from __future__ import annotations

from typing import Any

import numpy as np

from symgen.description.parts import INERTIAL
from symgen.description.robot import Robot
from symgen.errors import DescriptionError

Array = np.ndarray[Any, Any]
ROUNDING = 1e-14  # cos(pi/2)


def khalil_values(robot: Robot) -> dict[str, float]:
    """Convert the link parameters of a classic (distal) table to Khalil's link frames.

    Frame j of the table lies at Rot(x, alpha_j) Trans(x, d_j) in Khalil's frame j. With the
    rotation R and the position p of this transformation, ms = R MS, and J, M of the link,

        MS' = ms + M p,     J' = R J R' + 2 (ms p) E - p ms' - ms p' + M (p p E - p p')

    A parameter is converted if all values that it depends on are given. Raises DescriptionError if
    a given value enters no converted parameter; the message names the missing values.
    """
    values = dict(robot.values)
    for j in robot.links:
        child = next((f for f in robot.frames if f.ant == j), None)
        names = [f"{family}{j}" for family in INERTIAL]
        known = np.array([name in values for name in names])
        if child is None or not known.any() or not (child.alpha or child.d):
            continue
        T = _transport(child.alpha.value(robot.constants), child.d.value(robot.constants))
        enters = T != 0
        whole = ~(enters & ~known).any(axis=1)
        lost = known & ~(enters & whole[:, None]).any(axis=0)
        if lost.any():
            row = enters[:, lost].any(axis=1) @ enters & ~known
            raise DescriptionError(
                f"values of link {j} are given in the frame at the end of the link (convention: distal); to convert {', '.join(np.array(names)[lost])}, also give {', '.join(np.array(names)[row])}",
                path=("values", names[int(np.argmax(lost))]),
            )
        x = np.array([values.pop(name, 0.0) for name in names])
        values |= {
            name: float(y) for name, y, given in zip(names, T @ x, whole, strict=True) if given
        }
    return values


def _transport(alpha: float, d: float) -> Array:
    """Build the matrix, shape (10, 10), that converts link parameters from the frame at the end of
    a link to Khalil's frame.
    """
    c, s = np.cos(alpha), np.sin(alpha)
    R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    p, E = np.array([d, 0, 0]), np.eye(3)
    T = np.zeros((10, 10))
    upper = np.triu_indices(3)
    for k, unit in enumerate(np.eye(10)):
        J = np.zeros((3, 3))
        J[upper] = unit[:6]
        J = R @ (J + np.triu(J, 1).T) @ R.T
        ms, M = R @ unit[6:9], unit[9]
        J = J + 2 * (ms @ p) * E - np.outer(p, ms) - np.outer(ms, p)
        J = J + M * ((p @ p) * E - np.outer(p, p))
        T[:, k] = [*J[upper], *(ms + M * p), M]
    return np.where(np.abs(T) > ROUNDING * np.abs(T).max(), T, 0.0)
