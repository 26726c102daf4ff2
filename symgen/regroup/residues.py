"""Columns of the standard regressor at random states and geometries, exact modulo a prime p."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from symgen.derive.constants import Variable
from symgen.derive.derivation import derive
from symgen.derive.exact import Array, Draw
from symgen.derive.graph import interpret
from symgen.derive.loops import close
from symgen.description.robot import Robot
from symgen.regroup.closed_draw import closed_draw


def draw_states(
    robot: Robot,
    seed: int,
    samples: int,
    *,
    p: int | None = None,
    geometry: Mapping[Variable, Array] | None = None,
    count: int = 0,
) -> Draw:
    """Draw `samples` random states modulo p, for one robot geometry or each of `count` geometries.

    If closure equations tie joints, the states satisfy these equations. ArithmeticError is raised
    for loops that cannot be closed exactly modulo p, such as spatial loops.
    """
    if close(robot).tied:
        return closed_draw(robot, seed, samples, p=p, count=max(count, 1), geometry=geometry)
    return Draw(robot, seed, samples, p=p, geometry=geometry, count=count)


def sample(draw: Draw, names: tuple[str, ...]) -> Array:
    """Compute the regressor columns `names` at the random states of `draw`, modulo p.

    The result has shape (..., n_active * samples, len(names)), int64 residues; the axis ... counts
    the geometries if the draw has several.
    """
    robot = draw.robot
    D = derive(robot).columns
    entries = {
        (k, row): D[name][j]
        for k, name in enumerate(names)
        for row, j in enumerate(robot.joints)
        if j in D[name]
    }
    W = np.zeros((len(names), len(robot.joints), *draw.shape), dtype=np.int64)
    for place, value in zip(entries, interpret([*entries.values()], draw), strict=True):
        W[place] = draw.spread(value)
    W = np.moveaxis(W, -1, 2)  # names, joints, samples, geometries
    return np.moveaxis(W.reshape(len(names), -1, *draw.shape[:-1]), (0, 1), (-1, -2))


def states_for(robot: Robot, names: Sequence[str], spare: int = 4) -> int:
    """Return how many random states are enough to show the rank of the regressor columns `names`.

    The columns that act only on the joints of a set S need |columns| <= states |S|. This is
    required for the set of every column, and for all joints. At least `spare` states are added.
    """
    acting = _acting(robot)
    acts = np.stack([acting[name] for name in names])
    sets = {tuple(row) for row in acts.tolist() if any(row)} | {(True,) * len(robot.joints)}
    needed = max(np.count_nonzero((acts <= S).all(axis=1)) / sum(S) for S in sets)
    return int(np.ceil(needed + (6 + spare) / len(robot.joints))) + spare


@lru_cache(maxsize=8)
def _acting(robot: Robot) -> dict[str, Array]:
    """Find, with random states, the joints whose torques depend on each standard parameter."""
    W = sample(Draw(robot, 5, 2), robot.parameters).reshape(len(robot.joints), 2, -1)
    return dict(zip(robot.parameters, (W != 0).any(axis=1).T, strict=True))
