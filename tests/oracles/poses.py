"""Poses of the frames of a robot in floats, by its one derivation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from symgen.derive.derivation import derive
from symgen.derive.graph import Floats, interpret, states_of
from symgen.description.robot import Robot


def poses_in_floats(robot: Robot, q: Mapping[int, float]) -> dict[int, np.ndarray]:
    """{frame: A_0j beside P_0j}, (3, 4), at positions q by joint."""
    poses = derive(robot).poses
    entries = [x for A, P in poses.values() for row, p in zip(A, P, strict=True) for x in (*row, p)]
    values = np.array(interpret(entries, Floats(robot, states_of(q=q))), dtype=float)
    return dict(zip(poses, values.reshape(-1, 3, 4), strict=True))
