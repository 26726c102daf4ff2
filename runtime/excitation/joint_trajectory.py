"""A motion as a message trajectory_msgs/JointTrajectory of ROS, in YAML.

Source: https://docs.ros.org/en/rolling/p/trajectory_msgs/msg/JointTrajectory.html
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from math import ceil

import numpy as np

from runtime.core.model import GeneratedModel
from runtime.ground.limits import limits

LIMIT = limits(__package__)

Array = np.ndarray
FIELDS = ("positions", "velocities", "accelerations")


def joint_names(model: GeneratedModel) -> tuple[str, ...]:
    """Return the names of the joints in the robot file, or joint1, joint2 ... for joints without a
    name.
    """
    names = getattr(model, "LABELS", {})
    return tuple(str(names.get(j, f"joint{j}")) for j in model.JOINTS)


def joint_trajectory(
    names: Sequence[str], t: Array, q: Array, qd: Array, qdd: Array, rate: float
) -> str:
    """Write the points of a motion as a JointTrajectory, YAML text.

    A controller interpolates between points; so every k-th sample is a point (at most
    POINTS_PER_SECOND in limits.toml), and the last sample.

    names : names of the joints. t : shape (N,), s, from 0. q, qd, qdd : shape (N, n), rad or m, per
        s, per s^2. rate : Hz.
    """
    kept = np.unique([*range(0, len(t), ceil(rate / LIMIT.POINTS_PER_SECOND)), len(t) - 1])
    lines = [f"joint_names: {json.dumps(list(names))}", "points:"]
    for k in kept:
        mark = "-"
        for field, x in zip(FIELDS, (q, qd, qdd), strict=True):
            lines.append(f"{mark} {field}: [{', '.join(map(_number, x[k]))}]")
            mark = " "
        sec, nanosec = divmod(round(t[k] * 1e9), 10**9)
        lines.append(f"  time_from_start: {{sec: {sec}, nanosec: {nanosec}}}")
    return "\n".join([*lines, ""])


def _number(x: float) -> str:
    """Write a number with ten digits, as the table of the motion; readers of YAML 1.1 need a point."""
    digits, *exponent = f"{x:.10g}".split("e")
    return "e".join([digits if "." in digits else f"{digits}.0", *exponent])
