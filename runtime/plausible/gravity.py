"""The direction of gravity, fitted beside the model by the step of `runtime.plausible.continuous`.

The direction of gravity, |g| fixed, is two such numbers, and tells the sign and the axis of the
base. W is linear in gravity, W(g) = W_0 + sum_a g_a W_a. From the best of the given direction and
the six axes, Gauss-Newton over the two angles by the same step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from runtime.limits import LIMIT
from runtime.plausible.alternatives import unchanged
from runtime.plausible.fits import Fit, Grams, solved
from runtime.plausible.trials import Problem

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Gravity:
    """Direction of gravity in frame 0.

    Attributes
    ----------
    given, fitted : ndarray, shape (3,)
        Unit vectors: of the robot file, and the one that explains the record best.
    angle : float, degrees
        Between them.
    sigma : float, degrees
        Deviation of the fitted direction, the larger of the two angles.
    gain : float, nats
        What the fitted direction gains over that of the robot file.
    """

    given: Array
    fitted: Array
    angle: float
    sigma: float
    gain: float

    @property
    def text(self) -> str:
        """The fitted direction with its deviation."""
        x, y, z = self.fitted
        return (
            f"({x:+.2f}, {y:+.2f}, {z:+.2f}) in frame 0, {self.angle:.0f} degrees from that of "
            f"the robot file, deviation {self.sigma:.0f} degrees"
        )


def gravity_direction(problem: Problem) -> Gravity | None:
    """The direction fitted freely; None without free gravity, or where the samples do not show it
    to 60 degrees.
    """
    if problem.variants is None:
        return None
    free = problem.variants.CONSTANTS
    given = np.array([free[f"free_g{axis}"] for axis in "xyz"])
    size = float(np.linalg.norm(given))
    if not size:
        return None

    def rows(g: Array) -> tuple[Array, Array, Array] | None:
        constants = dict(zip(("free_gx", "free_gy", "free_gz"), map(float, g), strict=True))
        return problem.rows(unchanged(problem.samples.n, constants=constants))

    weightless, *axes = (rows(g) for g in (np.zeros(3), *np.eye(3)))
    if weightless is None:
        return None
    rest, Y, mask = weightless
    by_axis = np.stack([axis[0] - rest for axis in axes if axis is not None])

    def along(u: Array) -> Array:
        return np.asarray(rest + size * np.tensordot(u, by_axis, axes=1))

    def fit(u: Array) -> Fit:
        return problem.fit(Grams.of(along(u), Y, mask, problem.tau), rounds=2)

    starts = [given / size, *(sign * np.eye(3)[a] for a in range(3) for sign in (1.0, -1.0))]
    fits = [fit(u) for u in starts]
    u, now = min(zip(starts, fits, strict=True), key=lambda one: one[1].score)
    sigma = np.inf
    for _ in range(LIMIT.GRAVITY_PASSES):
        tangents = np.linalg.svd(u[None])[2][1:]
        turn = np.tensordot(tangents, size * by_axis, axes=1)
        moved = np.einsum("akjp,p->akj", turn, now.X)
        found = gauss_newton_step(problem, along(u), moved, now, Y, mask)
        if found is None:
            return None
        step, C = found
        sigma = float(np.degrees(np.sqrt(np.linalg.eigvalsh(C)[-1])))
        turned = u + step * min(1.0, 0.5 / max(float(np.linalg.norm(step)), 1e-9)) @ tangents
        turned = turned / np.linalg.norm(turned)
        better = fit(turned)
        if better.score > now.score - 0.05:
            break
        u, now = turned, better
    if not sigma < 60:
        return None
    angle = float(np.degrees(np.arccos(np.clip(u @ given / size, -1, 1))))
    return Gravity(given / size, u, angle, sigma, fits[0].score - now.score)


def gauss_newton_step(
    problem: Problem, D: Array, J: Array, fit: Fit, Y: Array, mask: Array
) -> tuple[Array, Array] | None:
    """Step of some numbers of effect J, shape (a, K, n), and their covariance, without combinations
    that the samples do not show (their variance is finite, large); None where they show none.
    """
    weight = mask / fit.sigma
    J = J * weight
    e = (Y - D @ fit.X) * weight
    A, _ = Grams.of(D, Y, mask).weighted(fit.sigma)
    H = A + problem.barrier.derivatives(fit.X, LIMIT.BARRIER[-1])[1]
    WJ = np.einsum("kjp,akj->pa", D, J * weight)
    left = np.einsum("akj,bkj->ab", J, J) - WJ.T @ np.column_stack(
        [solved(H, column) for column in WJ.T]
    )
    share = problem.N / max(float(mask.sum(axis=0).mean()), 1.0)
    eigenvalues, V = np.linalg.eigh(left)
    if not eigenvalues[-1] * share > 0.1:
        return None
    certain, variances = eigenvalues * share > 0.1, 1 / eigenvalues.clip(1e-9 * eigenvalues[-1])
    step = (V * variances * certain) @ V.T @ np.einsum("akj,kj->a", J, e)
    return step, (V * variances) @ V.T / share
