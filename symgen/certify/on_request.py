"""Expected results of the functions that the code generator writes only on request.

They follow from the regressor and the energies of Lagrange's equations alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from symgen.derive.exact import Array
from symgen.description.robot import Element, Robot, parameter
from symgen.regroup.regrouping import Regrouping

if TYPE_CHECKING:
    from symgen.certify.lagrange import Lagrange

ANGLE_STEP = 1e-2  # rad or m
SIX_POINTS = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}  # central differences of sixth order


States = tuple[Array, Array, Array]


def requested_values(
    model: Lagrange, regrouping: Regrouping, chi: Array, states: States, tree: States, qddr: Array
) -> dict[str, Callable[[], Array]]:
    """Return functions that compute the expected results of models, such as the Slotine-Li
    regressor, that the code generator writes only on request.

    The results have shape (N, ...).

    `states` are q, qd, qdd of the actuated joints, shape (N, n); qdd serves as qdr too. `tree` are
    the positions, rates and accelerations of all moving joints. `qddr` are reference accelerations.
    """
    robot, (q, qd, qdr), zero = regrouping.robot, states, 0 * states[0]
    own = [robot.parameters.index(name) for name in regrouping.own]

    def columns(q: Array, qd: Array, qdd: Array) -> Array:
        return np.asarray(model.actuated_regressor(q, qd, qdd)[..., own])

    def friction() -> Array:
        rubs = of_elements(robot, lambda e: e.is_friction)[own]
        return np.asarray((columns(q, qd, zero) - columns(q, zero, zero)) * rubs)

    def slotine_li() -> Array:
        """Compute the regressor of the torque A qddr + C qdr + Q + friction of the Slotine-Li
        controller.

        C qdr is a difference of torques that are quadratic in the velocities.
        """
        h = [columns(q, u, zero) for u in (qd + qdr, qd, qdr, zero)]
        rubs = of_elements(robot, lambda e: e.is_friction)[own]
        C = (h[0] - h[1] - h[2] + h[3]) / 2 * ~rubs
        return np.asarray(columns(q, zero, qddr) + C + friction())

    def momentum(q: Array) -> Array:
        return np.asarray(columns(q, zero, qd) - columns(q, zero, zero))

    def momentum_rate() -> Array:
        """Compute the regressor of dE/dq - Q - friction, the rate of the momentum A qd without
        joint torques.

        E = qd' A qd / 2 is the kinetic energy, Q the torques at rest.
        """
        slope = np.zeros((*q.shape, len(own)))
        for i, e in enumerate(np.eye(q.shape[1])):
            for m, c in SIX_POINTS.items():
                p = [momentum(q + s * m * ANGLE_STEP * e) for s in (1, -1)]
                slope[:, i] += c / ANGLE_STEP * np.einsum("ti,tik->tk", qd, p[0] - p[1]) / 2
        return np.asarray(slope - columns(q, zero, zero) - friction())

    def energies() -> Array:
        kinetic = np.einsum("ti,tik->tk", qd, momentum(q)) / 2
        units = np.eye(len(chi))[own]
        potential = [model.potential_energy(tree[0], unit) for unit in units]
        return np.stack([kinetic, np.stack(potential, axis=-1)], axis=1)

    return {
        "slotine_li_regressor": slotine_li,
        "momentum_regressor": lambda: momentum(q),
        "momentum_rate_regressor": momentum_rate,
        "energy_regressor": energies,
        "base_wrench_regressor": lambda: model.base_regressor(*tree),
    }


def of_elements(robot: Robot, which: Callable[[Element], bool]) -> Array:
    """Return, for each standard parameter, whether `which` is true for its element, such as
    friction.

    The result has shape (p,).
    """
    own = {parameter(e.family, j) for e in robot.elements if which(e) for j in e.keys}
    return np.array([name in own for name in robot.parameters])
