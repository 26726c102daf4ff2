"""Dry (Coulomb) friction of a robot model: its columns of W, and the directions of its forces.

Every Coulomb element acts along a row of G. Its slip is s = G qd; its force is c_plus if s > 0 and
-c_minus if s < 0. There may be more elements than joints (on a wrist, FS5, FS6 and FSM6 act along
q5, q6 and q5 + q6). Forces at rest: `runtime.loop.stick_slip`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from runtime.core.model import GeneratedModel
from runtime.ground.limits import limits

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class DryFriction:
    """Coulomb friction elements of a model: the directions of their forces, and their parameters.

    Attributes
    ----------
    G : ndarray, shape (m, n)
        One row per element: its slip is s = G qd.
    plus, minus : ndarray, shape (m, b), 0 or 1
        c_plus = plus @ X and c_minus = minus @ X, the largest forces in each direction.
    smooth : ndarray, shape (b,), 0 or 1
        0 for the parameters of dry friction, 1 for all others.
    """

    G: Array
    plus: Array
    minus: Array
    smooth: Array


def dry_friction(model: GeneratedModel) -> DryFriction:
    """Find the Coulomb friction elements of a model from values of its regressor.

    A column of the regressor belongs to dry friction if it is zero at rest, and if it is the same
    at velocities qd and 2 qd. Such a column is G' sign(G qd), or its part of one direction of
    motion.
    """
    n, b = len(model.JOINTS), len(model.BASE_PARAMETERS)
    rng = np.random.default_rng(1)
    q, qd = rng.uniform(0.1, 1.0, (2, n, LIMIT.FRICTION_DRAWS)) * rng.choice(
        [-1, 1], (2, n, LIMIT.FRICTION_DRAWS)
    )
    fast, faster, rest = (
        np.array(model.regressor(q.T, speed.T, np.zeros((LIMIT.FRICTION_DRAWS, n)))).transpose(
            1, 0, 2
        )
        for speed in (qd, 2 * qd, 0 * qd)
    )
    dry = (
        (fast == faster).all(axis=(0, 1))
        & (rest == 0).all(axis=(0, 1))
        & (fast != 0).any(axis=(0, 1))
    )
    rows: dict[tuple[float, ...], tuple[Array, Array]] = {}
    for k in np.flatnonzero(dry):
        acting = fast[:, (fast[:, :, k] != 0).any(axis=0).argmax(), k]
        G = acting * np.sign(acting[np.flatnonzero(acting)[0]]) + 0.0  # no -0
        plus, minus = rows.setdefault(tuple(G), (np.zeros(b), np.zeros(b)))
        force, slip = G @ fast[:, :, k], G @ qd
        plus[k], minus[k] = (force[slip > 0] > 0).any(), (force[slip < 0] < 0).any()
    plus, minus = (np.array([sides[i] for sides in rows.values()]).reshape(-1, b) for i in (0, 1))
    return DryFriction(np.array(list(rows)).reshape(-1, n), plus, minus, (~dry).astype(float))
