"""The homogeneous box with the mass and the inertia of each link, for the drawing of a robot.

With principal moments I1, I2, I3 about the centre of mass, its sides are a1, a2, a3 along the
principal axes:

    I1 = M (a2^2 + a3^2) / 12, ...        a1^2 = 6 (I2 + I3 - I1) / M, ...
"""

from __future__ import annotations

from typing import Any

import numpy as np

from symgen.description.bodies import centred, no_body
from symgen.description.robot import INERTIAL, Robot, parameter


def boxes(robot: Robot) -> list[dict[str, Any]]:
    """List the boxes of the links whose ten parameters the robot file gives, if bodies can have them.

    Each box has the entries `link`; `centre`, m, and `axes`, three unit vectors, both in the frame
    of the link; and `sides`, m.
    """
    found = []
    for j in robot.links:
        given = [robot.values.get(parameter(name, j)) for name in INERTIAL]
        if None in given or given[9] <= 0:  # type: ignore[operator]
            continue
        ten = np.array(given, dtype=float)
        M, tensor = ten[9], centred(ten)
        if no_body(M, tensor):
            continue
        moments, axes = np.linalg.eigh(tensor)
        squares = 6 * (moments.sum() - 2 * moments) / M
        found.append(
            {
                "link": j,
                "centre": (ten[6:9] / M).tolist(),
                "axes": axes.T.tolist(),
                "sides": np.sqrt(squares.clip(min=0.0)).tolist(),
            }
        )
    return found
