"""Prepare the data of the robot drawing: frame table, passive joints, ranges of the sliders.

The script of the page computes the geometry itself.
"""

from __future__ import annotations

import math
from typing import Any

from symgen.derive.closure import Closure
from symgen.description.parts import GEOMETRY
from symgen.description.robot import PRISMATIC, Robot


def figure(robot: Robot, closure: Closure) -> dict[str, Any]:
    """Collect the data of the robot drawing as plain values for JSON, in SI units and rad.

    `theta` and `r` are without the joint position. `follows` gives each passive joint as
    q_j = offset + sum_i of_i q_i.
    """
    follows = {
        j: {
            "of": {i: g.value(robot.constants) for i, g in closure.row[j].items()},
            "offset": closure.offset[j].value(robot.constants),
        }
        for j in robot.passive
        if j not in closure.tied
    }
    frames = [
        {"j": f.j, "ant": f.ant, "sigma": f.sigma}
        | {name: e.value(robot.constants) for name, e in zip(GEOMETRY, f.at_zero, strict=True)}
        for f in robot.frames
    ]
    return {
        "frames": frames,
        "gravity": [e.value(robot.constants) for e in robot.gravity],
        "joints": joint_ranges(
            robot, closure, sum(abs(f[name]) for f in frames for name in ("b", "d", "r"))
        ),
        "follows": follows,
        "tied": {j: closure.start[j] for j in closure.tied},
        "loops": [{"cut": loop.cut, "twin": loop.twin} for loop in robot.loops],
    }


def joint_ranges(robot: Robot, closure: Closure, size: float) -> list[dict[str, Any]]:
    """Choose the range and the initial position of the slider of every actuated joint.

    The range is that of the joint limits. Without limits it is half a turn to either side, or half
    of `size`, the size of the robot, for a prismatic joint. The start is 0 if 0 is in the range.
    """
    ranges = []
    for row, j in enumerate(robot.joints):
        slides = robot.frame(j).sigma == PRISMATIC
        half = (size / 2 or 0.5) if slides else math.pi
        low, high = robot.limits["q"][row] if "q" in robot.limits else (-half, half)  # type: ignore[misc]
        start = closure.start[j] if closure.tied else 0.0 if low <= 0 <= high else (low + high) / 2
        ranges.append(
            {
                "j": j,
                "slides": slides,
                "low": min(low, start),
                "high": max(high, start),
                "start": start,
            }
        )
    return ranges


def passive_text(robot: Robot, closure: Closure) -> dict[int, str]:
    """Describe how each passive joint position is found: declared, or from the kinematic loop."""
    words = {True: "declared", False: "found from the loop"}
    return {
        j: "solved from the loop" if j in closure.tied else words[j in robot.constraints]
        for j in robot.passive
    }
