"""Named places of a robot at which loads and contacts may be: links of its file, sites, fixed
frames.
"""

from __future__ import annotations

import numpy as np

from symgen.description.parts import FIXED
from symgen.description.robot import Robot
from symgen.description.tree import Array, transform

Rows = tuple[tuple[float, ...], ...]


def mounts(robot: Robot) -> dict[str, tuple[int, Rows]]:
    """Return the places of a robot by name: number of the link, and pose (4, 4) in its frame.

    A URDF or MJCF has the links, bodies and sites of its moving bodies, in the order of the file,
    each with the frame that the file gives it; a base that moves also has the places on link 0. The
    places of any other robot are its fixed frames, named by their labels or as "frame 7".
    """
    if robot.mounts:
        moves = robot.base != "fixed"
        return {name: (j, rows) for name, j, rows in robot.mounts if j or moves}
    found = {}
    for f in robot.frames:
        if f.sigma != FIXED or f.j in robot.cut:
            continue
        T, j = np.eye(4), f.j
        while j and j not in robot.links and robot.frame(j).sigma == FIXED:
            row = [e.value(robot.constants) for e in robot.frame(j).at_zero]
            T, j = transform(row) @ T, robot.frame(j).ant
        if j in robot.links:
            found[robot.labels.get(f.j, f"frame {f.j}")] = (j, rows_of(T))
    return found


def rows_of(T: Array) -> Rows:
    """Convert a pose, shape (4, 4), to a tuple of its rows."""
    return tuple(tuple(map(float, row)) for row in T)
