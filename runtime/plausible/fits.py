"""How well a model can explain the samples: by any parameters, and by those of a physical robot
near the values that are known.

Rows are weighed by joint with their own residuals, so that a wrist counts as much as a shoulder.
The score is the negative logarithm of the
likelihood with those weights profiled out, in nats,

    score = N sum_j log(sigma_j),   sigma_j^2 = max(||Y_j - W_j chi||^2 / N_j, floor_j^2)

N the rows of a joint that count (residuals are coloured); a difference of 5 is a likelihood ratio
of 150. Rows j are those of a torque as it was
measured, whatever map of the torques is tried (`runtime.plausible.trials`).
`physical_fit` minimises half the weighted squares plus a barrier

    mu sum_links [tr(P P0^-1) - log det P - log(M R^2 - tr S)] + mu sum_elements [c/c0 - log c] +
    LIMIT.MASS_PRICE M/M0

over the standard parameters (pseudo-inertias P, motor inertias and frictions c:
`runtime.model.inertia`) with mu small, by Newton's method; P0,
c0 and R, the largest extent of a link (S its second moments), bound what the samples leave open.
Links and motor inertias whose values the robot
file gives have these as P0 and c0, and LIMIT.LINK_TOLERANCE^-2 in place of mu.

Reference: Lee, Wensing and Park (2020) for the entropic distance; Boyd and Vandenberghe (2004),
chapter 11, for the barrier.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dposv

from runtime.limits import LIMIT
from runtime.model.inertia import PhysicalModel

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Grams:
    """Normal equations of every torque.

    Attributes
    ----------
    of_joints : ndarray, shape (n, b + 1, b + 1)
        [W_j Y_j]'[W_j Y_j].
    rows : ndarray of int, shape (n,)
    measured : ndarray, shape (n,)
        ||tau_j||^2 over the same rows.
    """

    of_joints: Array
    rows: Array
    measured: Array

    @classmethod
    def of(cls, D: Array, Y: Array, mask: Array, tau: Array | None = None) -> Grams:
        """Of a regressor (K, n, b), torques (K, n) and the rows used, bool (K, n). tau : measured
        torques; default: Y.
        """
        grams = []
        for j in range(Y.shape[1]):
            A = np.column_stack([D[:, j], Y[:, j]])[mask[:, j]]
            grams.append(A.T @ A)
        return cls(
            np.array(grams), mask.sum(axis=0), ((Y if tau is None else tau) ** 2 * mask).sum(axis=0)
        )

    def mapped(self, K: Array) -> Grams:
        """With the columns W K, K of shape (b, p)."""
        M = np.zeros((K.shape[0] + 1, K.shape[1] + 1))
        M[:-1, :-1], M[-1, -1] = K, 1.0
        return Grams(M.T @ self.of_joints @ M, self.rows, self.measured)

    def squares(self, X: Array) -> Array:
        """||Y_j - W_j X||^2, shape (n,)."""
        v = np.append(X, -1.0)
        return np.asarray(np.maximum(np.einsum("i,jik,k->j", v, self.of_joints, v), 0.0))

    def sigma(self, X: Array) -> Array:
        """Root mean square residual of each joint, at least LIMIT.RESIDUAL_FLOOR of its torque,
        shape (n,); 1 of a joint without rows.
        """
        N = np.maximum(self.rows, 1)
        square = np.maximum(self.squares(X), LIMIT.RESIDUAL_FLOOR**2 * self.measured) / N
        return np.asarray(np.where(square > 0, np.sqrt(square), 1.0), dtype=float)

    def weighted(self, sigma: Array) -> tuple[Array, Array]:
        """A = sum_j W_j'W_j / sigma_j^2 and g = sum_j W_j'Y_j / sigma_j^2."""
        G = np.einsum("j,jik->ik", sigma**-2.0, self.of_joints)
        return G[:-1, :-1], G[:-1, -1]


@dataclass(frozen=True, eq=False)
class Fit:
    """Parameters, residuals by joint, and the score in nats.

    Attributes
    ----------
    X : ndarray, shape (b,) or (p,), SI
    sigma : ndarray, shape (n,), N m or N
    errors : ndarray, shape (n,)
        100 ||Y_j - W_j X|| / ||tau_j||, %.
    score : float, nats
        Smaller is better.
    penalty : float, nats
        Part of the score that is the distance from the values of the robot file.
    """

    X: Array
    sigma: Array
    errors: Array
    score: float
    penalty: float = 0.0


def fit_of(grams: Grams, X: Array, N: float, penalty: float = 0.0) -> Fit:
    """The Fit of given parameters. N : rows of a joint that count."""
    sigma, measured = grams.sigma(X), grams.measured
    errors = 100 * np.sqrt(grams.squares(X) / np.where(measured > 0, measured, 1.0))
    return Fit(X, sigma, errors, float(N * np.log(sigma[grams.rows > 0]).sum() + penalty), penalty)


def solved(A: Array, g: Array, ridge: float = LIMIT.RIDGE) -> Array:
    """A^-1 g, A positive semidefinite, its columns scaled."""
    d = np.diag(A)
    D = 1 / np.sqrt(np.where(d > 0, d, 1.0))
    scaled = A * D * D[:, None]
    scaled.flat[:: len(A) + 1] += ridge
    _, x, failed = dposv(scaled, D * g)
    return np.asarray(D * (np.linalg.lstsq(scaled, D * g, rcond=1e-9)[0] if failed else x))


def least_squares(grams: Grams, N: float) -> Fit:
    """Weighted least squares, weights by joint from their own residuals."""
    sigma = grams.sigma(np.zeros(grams.of_joints.shape[1] - 1))
    for _ in range(LIMIT.WEIGHT_PASSES):
        X = solved(*grams.weighted(sigma))
        sigma = grams.sigma(X)
    return fit_of(grams, X, N)


class Barrier:
    """What keeps standard parameters those of a physical robot, near the values that are known.

    Parameters
    ----------
    physical : PhysicalModel
    mass, length : float, kg, m
        Size of a link: P0 = mass diag(length^2, length^2, length^2, 1).
    element : float, SI
        Size c0 of a motor inertia or a friction.
    values : bool
        Whether links and motor inertias stay near the values of the robot file.
    """

    def __init__(
        self,
        physical: PhysicalModel,
        mass: float,
        length: float,
        element: float,
        *,
        values: bool = False,
    ) -> None:
        self.physical, self.p = physical, len(physical.standard)
        links = [c for c in physical.conditions if c.name.startswith("link ")]
        self.place = np.array([c.numbers for c in links], dtype=int).reshape(-1, 10)
        self.B = links[0].B if links else np.zeros((10, 4, 4))
        scalars = [c for c in physical.conditions if c not in links and c.B.shape[1] == 1]
        signed = np.zeros((len(scalars), self.p))
        for row, c in zip(signed, scalars, strict=True):
            row[list(c.numbers)] = 1.0
        inside = np.zeros((len(links), self.p))
        extent = max(LIMIT.LINK_EXTENT * length, LIMIT.LEAST_EXTENT) ** 2
        for row, numbers in zip(inside, self.place, strict=True):
            row[numbers] = [-0.5, 0, 0, -0.5, 0, -0.5, 0, 0, 0, extent]
        self.rows = np.vstack([signed, inside])
        self.forms = [
            (list(c.numbers), c.B)
            for c in physical.conditions
            if c not in links and c.B.shape[1] > 1
        ]
        self.known_links, self.known_rows = (
            np.zeros(len(links), dtype=bool),
            np.zeros(len(self.rows), dtype=bool),
        )
        P0 = np.broadcast_to(mass * np.diag([length**2] * 3 + [1.0]), (len(links), 4, 4)).copy()
        self.size = np.concatenate(
            [np.full(len(signed), element), np.full(len(inside), mass * extent)]
        )
        self.heavy = np.zeros(self.p)
        if values:
            self._near_values(P0, length)
        for known, numbers in zip(self.known_links, self.place, strict=True):
            self.heavy[numbers[-1]] = 0.0 if known else LIMIT.MASS_PRICE / mass
        self.unit = np.linalg.inv(P0) if links else P0
        self.volume = np.linalg.slogdet(P0)[1]
        self.pull = np.einsum("kab,lba->lk", self.B, self.unit)
        self.start = self._start(P0)

    def _near_values(self, P0: Array, length: float) -> None:
        """P0 and c0 of the robot file, where it gives all ten parameters of a link, or a motor
        inertia.
        """
        known = self.physical.values
        given = np.array([known.get(name, np.nan) for name in self.physical.standard])
        for k, numbers in enumerate(self.place):
            ten = given[numbers]
            if np.isfinite(ten).all() and ten[-1] > 0:
                P = np.tensordot(ten, self.B, axes=1)
                spread = np.trace(P[:3, :3]) / 3 + ten[-1] * (0.1 * length) ** 2
                P = P + LIMIT.ROUNDNESS * spread * np.diag([1.0, 1.0, 1.0, 0.0])
                if np.linalg.eigvalsh(P)[0] > 0:
                    P0[k], self.known_links[k] = P, True
                    self.size[len(self.rows) - len(self.place) + k] = max(
                        self.size[-1], 10 * np.trace(P[:3, :3])
                    )
        for k, row in enumerate(self.rows[: len(self.rows) - len(self.place)]):
            (own, *more) = np.flatnonzero(row)
            if (
                not more
                and self.physical.standard[own].startswith("Ia")
                and known.get(self.physical.standard[own], 0.0) > 0
            ):
                self.size[k], self.known_rows[k] = given[own], True

    def _start(self, P0: Array) -> Array:
        """A point inside: links at P0, elements at their size."""
        chi = np.zeros(self.p)
        for numbers, P in zip(self.place, P0, strict=True):
            S = P[:3, :3]
            J = np.trace(S) * np.eye(3) - S
            chi[numbers] = [*J[np.triu_indices(3)], *P[:3, 3], P[3, 3]]
        for k, row in enumerate(self.rows):
            if k < len(self.rows) - len(self.place):
                chi[row > 0] = np.maximum(chi[row > 0], self.size[k])
            elif row @ chi <= 0:  # values of a link beyond the usual extent
                row[row < 0] *= (
                    0.25 * (chi[row > 0] @ row[row > 0]) / -(chi[row < 0] @ row[row < 0])
                )
        for places, B in self.forms:
            # coefficients of a positive definite sum: those of the identity, by least squares
            forms, identity = B.reshape(len(B), -1), np.eye(B.shape[1]).ravel()
            inside = np.linalg.lstsq(forms.T, identity, rcond=None)[0]
            chi[places] = np.maximum(chi[places], inside * float(self.size[0]))
        return chi

    @property
    def near_values(self) -> bool:
        """Whether the robot file holds values of links that pull."""
        return bool(self.known_links.any())

    def weights(self, mu: float) -> tuple[Array, Array]:
        """Weights of the links and of the rows, nats."""
        strong = LIMIT.LINK_TOLERANCE**-2.0
        return np.where(self.known_links, strong, mu), np.where(self.known_rows, strong, mu)

    def penalty(self, chi: Array) -> float:
        """Distance from the values of the robot file, and the price of masses that it does not
        give, nats.
        """
        links = chi[self.place[self.known_links]]
        P = np.einsum("lk,kab->lab", links, self.B)
        far = (
            np.einsum("lab,lba->", P, self.unit[self.known_links])
            - (np.linalg.slogdet(P)[1] - self.volume[self.known_links] + 4).sum()
        )
        ratio = (self.rows @ chi / self.size)[self.known_rows]
        return float(
            self.heavy @ chi
            + LIMIT.LINK_TOLERANCE**-2.0 * (far + (ratio - np.log(ratio) - 1).sum())
        )

    def value(self, chi: Array, mu: float) -> float:
        """The barrier; infinite outside."""
        of_links, of_rows = self.weights(mu)
        P = np.einsum("lk,kab->lab", chi[self.place], self.B)
        c = self.rows @ chi
        if (c <= 0).any():
            return np.inf
        try:
            logs = (
                2
                * np.log(np.diagonal(np.linalg.cholesky(P), axis1=1, axis2=2)).sum(axis=1)
                @ of_links
            )
            for numbers, B in self.forms:
                logs += (
                    mu
                    * 2
                    * np.log(
                        np.diag(np.linalg.cholesky(np.tensordot(chi[numbers], B, axes=1)))
                    ).sum()
                )
        except np.linalg.LinAlgError:
            return np.inf
        sizes = np.einsum("l,lab,lba->", of_links, P, self.unit)
        return float(sizes - logs + of_rows @ (c / self.size - np.log(c)) + self.heavy @ chi)

    def derivatives(self, chi: Array, mu: float) -> tuple[Array, Array]:
        """Gradient and Hessian of the barrier."""
        of_links, of_rows = self.weights(mu)
        gradient, H = self.heavy.copy(), np.zeros((self.p, self.p))
        inverse = np.linalg.inv(np.einsum("lk,kab->lab", chi[self.place], self.B))
        T = np.einsum("lab,kbc->lkac", inverse, self.B)
        slope = self.pull - np.einsum("lkaa->lk", T)
        gradient[self.place] += of_links[:, None] * slope  # no parameter belongs to two links
        H[self.place[:, :, None], self.place[:, None, :]] = of_links[:, None, None] * np.einsum(
            "lkab,lmba->lkm", T, T
        )
        c = self.rows @ chi
        gradient += (of_rows * (1 / self.size - 1 / c)) @ self.rows
        H += (self.rows.T * (of_rows * c**-2.0)) @ self.rows
        for numbers, B in self.forms:
            T = np.einsum("ab,kbc->kac", np.linalg.inv(np.tensordot(chi[numbers], B, axes=1)), B)
            gradient[numbers] -= mu * np.einsum("kaa->k", T)
            H[np.ix_(numbers, numbers)] += mu * np.einsum("kab,mba->km", T, T)
        return gradient, H

    def minimum(
        self, A: Array, g: Array, chi: Array, weights: Sequence[float], enough: float = 1e-2
    ) -> Array:
        """chi of min 1/2 chi'A chi - g'chi + barrier, from an interior point chi."""

        def criterion(x: Array, mu: float) -> float:
            return float(0.5 * x @ A @ x - g @ x) + self.value(x, mu)

        for mu in weights:
            now = criterion(chi, mu)
            for _ in range(40):
                try:
                    gradient, H = self.derivatives(chi, mu)
                except np.linalg.LinAlgError:  # a link without mass to working precision
                    break
                gradient += A @ chi - g
                step = -solved(A + H, gradient, 1e-13)
                decrement = -float(gradient @ step)
                if not decrement > (enough if mu == weights[-1] else 0.3):
                    break
                t = 1.0
                while (
                    not (after := criterion(chi + t * step, mu)) <= now - 1e-3 * t * decrement
                    and t > 1e-7
                ):
                    t /= 2
                if not after < now:
                    break
                chi, now = chi + t * step, after
        return chi


def quick_fit(grams: Grams, barrier: Barrier, N: float, sigma: Array) -> Fit:
    """About what `physical_fit` gives, to a few nats above it."""
    chi = barrier.minimum(*grams.weighted(sigma), barrier.start, LIMIT.BARRIER[:2], 1.0)
    return fit_of(grams, chi, N, barrier.penalty(chi))


def physical_fit(grams: Grams, barrier: Barrier, N: float, sigma: Array, rounds: int = 3) -> Fit:
    """Fit of a physical robot, near the values where the barrier holds them. sigma : first weights.

    It starts in the middle of the cone: from a neighbour, near the boundary, Newton steps are
    short.
    """
    chi = barrier.start
    for k in range(rounds):
        chi = barrier.minimum(
            *grams.weighted(sigma), chi, LIMIT.BARRIER[-1:] if k else LIMIT.BARRIER
        )
        sigma = grams.sigma(chi)
    return fit_of(grams, chi, N, barrier.penalty(chi))
