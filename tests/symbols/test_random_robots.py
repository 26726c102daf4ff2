"""Random robots: both forms against Lagrange by CasADi; C by recursion against Christoffel symbols;
dU/dq = Q; transforms compose.
"""

from __future__ import annotations

import numpy as np
import pytest
from campaign import sampled

from oracles.exact_zero import valued
from oracles.random_robots import random_robot
from symgen.certify.lagrange import Lagrange
from symgen.symbols.symbolic import symbolic

N, LARGEST = 3, 400  # states; terms of a closed form that is compared


@pytest.mark.parametrize("seed", sampled(range(15), 1))
def test_random_robot(seed: int) -> None:
    robot, rng = random_robot(seed), np.random.default_rng(seed)
    models, n = symbolic(robot, parameters="standard", limit=4000), len(robot.joints)
    q, qd, qdd = rng.standard_normal((3, N, n))
    chi = rng.standard_normal(len(robot.parameters))
    values = dict(robot.constants) | dict(zip(robot.parameters, chi, strict=True))
    values |= {
        f"{s}{j}": x[:, k]
        for s, x in (("q", q), ("QP", qd), ("QDP", qdd))
        for k, j in enumerate(robot.joints)
    }

    def at(model: str, inputs=values, **request) -> np.ndarray:
        steps, result = models.equations(model, **request)
        return valued(result, inputs, steps)

    def agrees(found: np.ndarray, expected: np.ndarray) -> None:
        assert np.abs(found.reshape(expected.shape) - expected).max() <= 1e-11 * max(
            np.abs(expected).max(), 1.0
        )

    agrees(at("inverse_dynamics"), Lagrange(robot).torque(q, qd, qdd, chi))
    C, Q = at("coriolis").reshape(N, n, n), at("gravity").reshape(N, n)
    agrees(
        np.einsum("nij,nj->ni", C, qd) + Q + at("friction").reshape(N, n), at("bias").reshape(N, n)
    )
    for k, j in enumerate(robot.joints):
        agrees(at("potential_energy", values | {f"q{j}": q[:, k] + 1e-30j}).imag / 1e-30, Q[:, k])
    j, i = (int(x) for x in rng.integers(0, len(robot.frames) + 1, 2))
    agrees(
        valued(models.pose(of=i), values) @ valued(models.pose(of=j, frame=i), values),
        valued(models.pose(of=j), values),
    )
    agrees(valued(models.jacobian(), values), at("jacobian"))
    for model, size in (("inverse_dynamics", n), ("coriolis", n * n), ("bias", n)):
        if (
            len(models.model("inverse_dynamics").listing.lines) < 120
            and models.model(model).closed.size < LARGEST
        ):
            expected = C.reshape(N, size) if model == "coriolis" else at(model).reshape(N, size)
            agrees(valued(getattr(models, model)(), values).reshape(N, size), expected)
