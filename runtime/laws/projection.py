"""Variable projection: least squares in parameters X and in constants a that enter W nonlinearly.

A scalar is a constant in the law of a column that the robot file adds to W, for instance the
velocity of a Stribeck law. The table FIT of the emitted module lists the scalars. The torque is
linear in X but not in the scalars a, Y = W(a) X + rho. With P the projector orthogonal to the
columns of W, X is eliminated,

    a = argmin ||P(a) Y||^2,    X = W(a)^+ Y

(Golub and Pereyra 1973), by Gauss-Newton with Kaufman's Jacobian (1975), J_k = -P (dW/da_k) X. The
columns of W without scalars are factored only once. The search for the scalars of each law starts
from the grid given in the robot file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, cast

import numpy as np
from scipy.optimize import least_squares

from runtime.core.model import BoundModel, GeneratedModel, channels_of
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import Prepared

Array = np.ndarray

SAME_MINIMUM = 0.02  # of the bounds: minima closer together are one
SLOPE_STEP = 1e-4  # of log(a), or of the bounds: differences of columns


class LawProblem:
    """W and Y of all records, if columns of W are functions (laws) with nonlinear constants.

    The coordinate of a constant a in the search is u = log(a) if its lower bound is positive, else
    u = a.
    """

    def __init__(
        self, model: GeneratedModel, records: Sequence[Prepared], columns: Sequence[str]
    ) -> None:
        self.model, self.records, self.names = model, records, tuple(columns)
        self.table = cast(Mapping[str, Any], cast(Any, model).FIT)
        self.scalars = tuple(self.table)
        bounds = np.array([self.table[s][0] for s in self.scalars], dtype=float)
        self.log = bounds[:, 0] > 0
        self.lower, self.upper = (self._into(b) for b in bounds.T)
        self.start = self._into(np.array([model.CONSTANTS[s] for s in self.scalars]))
        self.varying = self._varying()
        first = self._observations(None, self.start)
        self.W, self.Y = np.vstack([o.W for o in first]), np.concatenate([o.Y for o in first])
        self.joint = np.concatenate([o.joints for o in first])
        self.first = first
        self.block = np.concatenate([o.blocks() + (k << 20) for k, o in enumerate(first)])
        moving = sorted({c for own in self.varying for c in own})
        self.fixed = [c for c in range(len(self.names)) if c not in moving]
        self.moving = moving
        self._columns: dict[tuple[Any, ...], Array] = {}

    def _into(self, a: Array) -> Array:
        return np.where(self.log, np.log(np.where(self.log, a, 1.0)), a)

    def values(self, u: Array) -> Array:
        """Convert search coordinates u to the nonlinear constants a: a = exp(u) or a = u."""
        return np.where(self.log, np.exp(np.where(self.log, u, 0.0)), u)

    def bound(self, u: Array) -> Any:
        """Return the model with its nonlinear constants set to those of search coordinates u."""
        return BoundModel(self.model, dict(zip(self.scalars, self.values(u).tolist(), strict=True)))

    def _varying(self) -> list[list[int]]:
        """Find the columns of W that depend on each nonlinear constant, by varying the constant."""
        model, rng = cast(Any, self.model), np.random.default_rng(3)
        q, qd, qdd = rng.uniform(-1, 1, (3, 200, len(model.JOINTS)))
        qd = qd * 10 ** rng.uniform(-3, 0, qd.shape)
        timed = {c: rng.uniform(0.5, 2, 200) for c in channels_of(self.model)}
        place = [model.BASE_PARAMETERS.index(name) for name in self.names]
        middle = (self.lower + self.upper) / 2

        def columns(u: Array) -> Array:
            D = self.bound(u).regressor(q, qd, qdd, **timed)[..., place]
            return np.array(D)

        here, result = columns(middle), []
        for k in range(len(self.scalars)):
            u = middle.copy()
            u[k] = 0.7 * self.lower[k] + 0.3 * self.upper[k]
            changed = np.abs(columns(u) - here).max(axis=(0, 1))
            result.append([int(c) for c in np.flatnonzero(changed)])
        return result

    def _observations(self, columns: Sequence[str] | None, u: Array) -> list[Observation]:
        model = self.bound(u)
        return [record.observation(model, columns or self.names) for record in self.records]

    def column(self, c: int, u: Array) -> Array:
        """Compute column c of W at all rows; u: search coordinates of the nonlinear constants."""
        own = [k for k, columns in enumerate(self.varying) if c in columns]
        key = (c, *(float(u[k]) for k in own))
        if key not in self._columns:
            if len(self._columns) > 400:
                self._columns.clear()
            parts = self._observations([self.names[c]], u)
            self._columns[key] = np.concatenate([o.W[:, 0] for o in parts])
        return self._columns[key]

    def slope(self, k: int, u: Array, X: Array) -> Array:
        """Compute the derivative of W X with respect to the search coordinate u_k, shape (r,).

        A central difference is used.
        """
        h = SLOPE_STEP if self.log[k] else SLOPE_STEP * (self.upper[k] - self.lower[k])
        ahead, behind = u.copy(), u.copy()
        ahead[k], behind[k] = u[k] + h, u[k] - h
        total = np.zeros(len(self.Y))
        for c in self.varying[k]:
            total += X[c] * (self.column(c, ahead) - self.column(c, behind)) / (2 * h)
        return total


class Projection:
    """Least-squares problem in the nonlinear constants only: X is optimal for given constants.

    A subset of the rows is used; each row is divided by its scale.
    """

    def __init__(self, problem: LawProblem, rows: Array, scale: Array) -> None:
        self.problem, self.rows = problem, rows
        self.scale = scale[rows]
        self.Q = orthonormal_basis(problem.W[rows][:, problem.fixed] / self.scale[:, None])
        Y = problem.Y[rows] / self.scale
        self.Y = Y - self.Q @ (self.Q.T @ Y)

    def _off(self, A: Array) -> Array:
        return np.asarray(A - self.Q @ (self.Q.T @ A))

    def parts(self, u: Array) -> tuple[Array, Array, Array]:
        """Compute the residual that the best parameters X leave at the search coordinates u.

        Returns P Y, an orthonormal basis of these columns (projected orthogonally to the fixed
        columns), and their coefficients in X.
        """
        p = self.problem
        V = np.column_stack([p.column(c, u)[self.rows] for c in p.moving]) / self.scale[:, None]
        V = self._off(V)
        B = orthonormal_basis(V)
        X = np.linalg.lstsq(V, self.Y, rcond=1e-10)[0]
        return self.Y - B @ (B.T @ self.Y), B, X

    def residual(self, u: Array) -> Array:
        return self.parts(u)[0]

    def jacobian(self, u: Array) -> Array:
        """Compute Kaufman's Jacobian of the residual with respect to the search coordinates u.

        It is -P (dW/du) X, with P the projector orthogonal to the columns of W.
        """
        p = self.problem
        _, B, X = self.parts(u)
        whole = np.zeros(len(p.names))
        whole[p.moving] = X
        slopes = [p.slope(k, u, whole)[self.rows] / self.scale for k in range(len(u))]
        S = self._off(np.column_stack(slopes))
        return np.asarray(B @ (B.T @ S) - S)

    def polished(self, u: Array) -> tuple[Array, float]:
        """Find the local minimum of the sum of squared residuals near the search coordinates u.

        Returns the coordinates of the minimum and the sum of squares there.
        """
        p = self.problem
        margin = 1e-6 * (p.upper - p.lower)
        fit = least_squares(
            self.residual,
            np.clip(u, p.lower + margin, p.upper - margin),
            self.jacobian,
            bounds=(p.lower, p.upper),
            x_scale=p.upper - p.lower,
            xtol=1e-10,
            ftol=1e-12,
            max_nfev=60,
        )
        return fit.x, 2 * float(fit.cost)

    def fitted(
        self, groups: Sequence[Sequence[int]]
    ) -> tuple[Array, float, dict[int, list[Array]]]:
        """Find the nonlinear constants of least squared residuals, first on grids, then locally.

        `groups` lists the scalars of each law. Returns the coordinates u of the minimum, its sum of
        squares, and the other local minima of each law, by the number of the law.
        """
        p = self.problem
        u, seeds = p.start.copy(), {}
        for g, group in enumerate(groups):
            counts = [int(p.table[p.scalars[k]][1]) for k in group]
            grids = [
                p.lower[k] + (np.arange(n) + 0.5) / n * (p.upper[k] - p.lower[k])
                for k, n in zip(group, counts, strict=True)
            ]
            starts = [np.array(x) for x in product(*grids)] + [u[list(group)]]
            costs = []
            for x in starts:
                u[list(group)] = x
                r = self.residual(u)
                costs.append(float(r @ r))
            order = np.argsort(costs)
            u[list(group)] = starts[order[0]]
            seeds[g] = _valleys(starts, costs, counts)
        best, cost = self.polished(u)
        others: dict[int, list[Array]] = {}
        width = p.upper - p.lower
        for g, group in enumerate(groups):
            for x in seeds[g]:
                trial = best.copy()
                trial[list(group)] = x
                end, value = self.polished(trial)
                if value < cost * (1 - 1e-9):
                    end, best, cost = best, end, value
                told = [best, *others.get(g, [])]
                away = [np.abs(end - o)[list(group)] / width[list(group)] for o in told]
                if min(x.max() for x in away) > SAME_MINIMUM:
                    others.setdefault(g, []).append(end)
        return best, cost, others


def _valleys(starts: Sequence[Array], costs: Sequence[float], counts: Sequence[int]) -> list[Array]:
    """Select at most four points of a grid whose cost does not exceed the cost of any neighbour.

    The last of `starts` is no point of the grid and is ignored.
    """
    grid = np.asarray(costs[:-1]).reshape(counts)
    found = []
    for place in np.ndindex(*counts):
        around = tuple(slice(max(i - 1, 0), i + 2) for i in place)
        if grid[place] <= grid[around].min():
            found.append(starts[int(np.ravel_multi_index(place, counts))])
    return found[:4]


def orthonormal_basis(A: Array) -> Array:
    """Compute an orthonormal basis of the column space of A, as columns."""
    size = np.linalg.norm(A, axis=0)
    A = A[:, size > 0] / size[size > 0]
    Q, R = np.linalg.qr(A)
    U, s, _ = np.linalg.svd(R)
    return np.asarray(Q @ U[:, : int((s > 1e-10 * s.max(initial=0.0)).sum())])
