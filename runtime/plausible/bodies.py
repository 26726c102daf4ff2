"""Fit robot parameters to samples of a record, with or without conditions on physical values.

Bodies stay near the values that are known. Rows of a joint are weighted by its own residuals, so
that a wrist counts as much as a shoulder. The score is the negative logarithm of the likelihood
with the best weights, in nats,

    score = N sum_j log(sigma_j) + D(chi),   sigma_j^2 = max(||Y_j - W_j chi||^2 / N_j, floor_j^2)

N is the number of independent rows of a joint, which is smaller than the number of its rows; a
difference of 5 is a likelihood ratio of 150. Rows j are those of a torque as it was measured, also
if a cause changes the torques (`runtime.plausible.trials`).

`Bodies` minimises half the weighted squares and D over the standard parameters of a physical robot
(`runtime.physical.inertia`): every pseudo-inertia P >= 0, motor inertias and frictions c >= 0, and
M R^2 >= tr S, S the second moments of a link and R its largest extent.

    D(chi) = sum_links 1/2 ||P0^-1/2 (P - P0) P0^-1/2||^2 / tolerance^2
             + sum_elements 1/2 (c/c0 - 1)^2 / tolerance^2 + price sum_links M/M0

The first two sums are over links and motor inertias whose values P0, c0 the robot file gives, the
price of the masses is for the other links. A weak price on all parameters without a known value
keeps them small if the samples do not determine them.

Reference: Lee, Wensing and Park (2020) for the distance, the constant pullback of the entropic one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dposv

from runtime.ground.limits import limits
from runtime.physical.inertia import Condition, PhysicalModel
from runtime.physical.semidefinite import Quadratic

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Grams:
    """Normal equations W_j'W_j X = W_j'Y_j of a least-squares fit, stored for each joint j.

    Attributes
    ----------
    of_joints : ndarray, shape (n, b + 1, b + 1)
        [W_j Y_j]'[W_j Y_j].
    rows : ndarray of int, shape (n,)
        Number of rows of each joint.
    measured : ndarray, shape (n,)
        ||tau_j||^2 over the same rows.
    """

    of_joints: Array
    rows: Array
    measured: Array

    @classmethod
    def of(cls, D: Array, Y: Array, mask: Array, tau: Array | None = None) -> Grams:
        """Form the normal equations of each joint from the regressor D and the torques Y of the
        used rows.

        D : shape (K, n, b).
        Y : shape (K, n).
        mask : rows used, bool (K, n).
        tau : measured torques, shape (K, n), to which errors are related; default: Y.
        """
        columns = np.concatenate([D.T, Y.T[None]])
        grams = []
        for j in range(Y.shape[1]):
            A = columns[:, j, mask[:, j]]
            grams.append(A @ A.T)
        measured = ((Y if tau is None else tau) ** 2 * mask).sum(axis=0)
        return cls(np.array(grams), mask.sum(axis=0), measured)

    def mapped(self, K: Array) -> Grams:
        """Change the unknowns of the normal equations from base to standard parameters: X = K chi.

        K has the shape (b, p): it gives the b base parameters X from the p standard parameters chi.
        """
        M = np.zeros((K.shape[0] + 1, K.shape[1] + 1))
        M[:-1, :-1], M[-1, -1] = K, 1.0
        return Grams(M.T @ self.of_joints @ M, self.rows, self.measured)

    def squares(self, X: Array) -> Array:
        """Compute the squared residual norm of each joint, ||Y_j - W_j X||^2, shape (n,)."""
        v = np.append(X, -1.0)
        return np.asarray(np.maximum(self.of_joints @ v @ v, 0.0))

    def sigma(self, X: Array) -> Array:
        """Compute the root mean square residual of each joint, shape (n,).

        The residual is at least a small share (RESIDUAL_FLOOR in limits.toml) of the torque of the
        joint, and 1 for a joint without rows.
        """
        N = np.maximum(self.rows, 1)
        square = np.maximum(self.squares(X), LIMIT.RESIDUAL_FLOOR**2 * self.measured) / N
        return np.asarray(np.where(square > 0, np.sqrt(square), 1.0), dtype=float)

    def weighted(self, sigma: Array) -> tuple[Array, Array]:
        """Sum the normal equations of all joints, each divided by the residual variance sigma_j^2.

        Return A = sum_j W_j'W_j / sigma_j^2 and g = sum_j W_j'Y_j / sigma_j^2.
        """
        G = np.tensordot(sigma**-2.0, self.of_joints, axes=1)
        return G[:-1, :-1], G[:-1, -1]


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of one fit: parameters, residuals of each joint, and the score (minus log-likelihood).

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
    """Compute the residual and the relative error of each joint, and the score, for parameters X.

    N : number of independent rows of a joint.
    penalty : added to the score, nats.
    """
    sigma, measured = grams.sigma(X), grams.measured
    errors = 100 * np.sqrt(grams.squares(X) / np.where(measured > 0, measured, 1.0))
    return Fit(X, sigma, errors, float(N * np.log(sigma[grams.rows > 0]).sum() + penalty), penalty)


def solve_scaled(A: Array, g: Array, ridge: float = LIMIT.RIDGE) -> Array:
    """Solve A x = g for a positive semidefinite A that is first scaled to a unit diagonal."""
    d = np.diag(A)
    D = 1 / np.sqrt(np.where(d > 0, d, 1.0))
    scaled = A * D * D[:, None]
    scaled.flat[:: len(A) + 1] += ridge
    _, x, failed = dposv(scaled, D * g)
    return np.asarray(D * (np.linalg.lstsq(scaled, D * g, rcond=1e-9)[0] if failed else x))


def least_squares(grams: Grams, N: float, bodies: Bodies | None = None) -> Fit:
    """Fit the parameters by weighted least squares: each row is divided by the rms residual of its
    joint.

    If `bodies` is given, the parameters are the standard parameters, and they are drawn towards the
    values of the robot file.
    """
    sigma = grams.sigma(np.zeros(grams.of_joints.shape[1] - 1))
    for _ in range(LIMIT.WEIGHT_PASSES):
        A, g = grams.weighted(sigma)
        X = solve_scaled(A, g) if bodies is None else solve_scaled(A + bodies.H, g + bodies.h)
        before, sigma = sigma, grams.sigma(X)
        if np.abs(np.log(sigma / before)).max() < LIMIT.SAME_WEIGHTS:
            break
    return fit_of(grams, X, N, 0.0 if bodies is None else bodies.distance(X))


class Bodies:
    """Physical conditions on the standard parameters, and penalties that keep them near known
    values.

    Parameters
    ----------
    physical : PhysicalModel
    mass, length : float, kg, m
        Size of a link without values: P0 = mass diag(length^2, length^2, length^2, 1).
    element : float, SI
        Size c0 of a motor inertia or a friction.
    values : bool
        Whether links and motor inertias stay near the values of the robot file.

    Attributes
    ----------
    known_links : ndarray of bool, shape (links,)
        Whether the penalty draws each link towards its values in the robot file.
    H, h, constant
        Distance from these values: 1/2 chi'H chi - h'chi + constant.
    heavy : ndarray, shape (p,), nats
        Penalty on the masses of links without values.
    price : ndarray, shape (p,), nats
        Weak penalty on the parameters that no known value bounds.
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
        self.physical = physical
        self.links = [c for c in physical.conditions if c.name.startswith("link ")]
        self.elements = [c for c in physical.conditions if c not in self.links]
        extent = max(LIMIT.LINK_EXTENT * length, LIMIT.LEAST_EXTENT) ** 2
        usual = mass * np.diag([length**2, length**2, length**2, 1.0])
        given = [self._of_file(link, length) if values else None for link in self.links]
        self.known_links = np.array([P is not None for P in given], dtype=bool)
        self.P0 = [usual if P is None else P for P in given]
        self.c0 = np.full(len(self.elements), element)
        p = len(physical.standard)
        self.H, self.h, self.constant = np.zeros((p, p)), np.zeros(p), 0.0
        self.heavy, self.price = np.zeros(p), np.zeros(p)
        scale, inside = np.full(p, element), np.zeros((len(self.links), p))
        for k, (link, P0) in enumerate(zip(self.links, self.P0, strict=True)):
            numbers = list(link.numbers)
            second, M0 = np.trace(P0[:3, :3]), P0[3, 3]
            scale[numbers] = [second] * 6 + [np.sqrt(second * M0)] * 3 + [M0]
            largest = max(extent, 4 * second / M0 if self.known_links[k] else 0.0)
            inside[k, numbers] = np.array([-0.5, 0, 0, -0.5, 0, -0.5, 0, 0, 0, largest]) / (
                M0 * largest
            )
            scaled = np.linalg.solve(P0, link.B)
            traces = np.einsum("kaa->k", scaled)
            if self.known_links[k]:
                near = np.einsum("kab,mba->km", scaled, scaled) / LIMIT.LINK_TOLERANCE**2
                self._pull(numbers, near, traces / LIMIT.LINK_TOLERANCE**2, 4.0)
            else:
                self.heavy[numbers[-1]] = LIMIT.MASS_PRICE / mass
                self.price[numbers] += LIMIT.WEAK_PRICE * traces
        for k, element_of in enumerate(self.elements):
            numbers = list(element_of.numbers)
            value = self._motor_inertia(element_of) if values else 0.0
            if value > 0:
                self.c0[k] = value
                near = np.array([[(LIMIT.LINK_TOLERANCE * value) ** -2.0]])
                self._pull(numbers, near, near[0] * value, 1.0)
            else:
                self.price[numbers] += (
                    LIMIT.WEAK_PRICE * np.einsum("kaa->k", element_of.B) / element
                )
        conditions = [
            replace(c, size=size)
            for c, size in (
                *zip(self.links, map(np.diag, self.P0), strict=True),
                *(
                    (c, np.full(c.B.shape[1], c0))
                    for c, c0 in zip(self.elements, self.c0, strict=True)
                ),
            )
        ]
        self.program = Quadratic(conditions, inside, scale)

    def _of_file(self, link: Condition, length: float) -> Array | None:
        """Compute the pseudo-inertia P0 of a link from its values in the robot file.

        Return None if the file does not give all ten parameters, or if no body can have them.
        """
        known = self.physical.values
        ten = np.array([known.get(self.physical.standard[k], np.nan) for k in link.numbers])
        if not np.isfinite(ten).all() or ten[-1] <= 0:
            return None
        P = np.tensordot(ten, link.B, axes=1)
        spread = np.trace(P[:3, :3]) / 3 + ten[-1] * (0.1 * length) ** 2
        P = P + LIMIT.ROUNDNESS * spread * np.diag([1.0, 1.0, 1.0, 0.0])
        return P if np.linalg.eigvalsh(P)[0] > 0 else None

    def _motor_inertia(self, element: Condition) -> float:
        """Look up the value of a motor inertia Ia in the robot file.

        The result is 0 for other elements, or if the file does not give the value.
        """
        names = [self.physical.standard[k] for k in element.numbers]
        single = len(names) == 1 and names[0].startswith("Ia")
        return self.physical.values.get(names[0], 0.0) if single else 0.0

    def _pull(self, numbers: list[int], near: Array, linear: Array, size: float) -> None:
        """Add a penalty on the distance of some parameters, given by their indices, from known
        values.

        The penalty is 1/2 x'near x - linear'x + size/2/tolerance^2, x the parameters.
        """
        self.H[np.ix_(numbers, numbers)] += near
        self.h[numbers] += linear
        self.constant += size / 2 / LIMIT.LINK_TOLERANCE**2

    @property
    def near_values(self) -> bool:
        """Whether the fit keeps the parameters of any link near the values in the robot file."""
        return bool(self.known_links.any())

    def distance(self, chi: Array) -> float:
        """Compute the penalty, nats, on the distance of parameters chi from the file's values."""
        return float(0.5 * chi @ self.H @ chi - self.h @ chi + self.constant)

    def penalty(self, chi: Array) -> float:
        """Compute the penalty D, in nats, that is added to the cost of a fit for standard
        parameters chi.

        D is the distance from known values, plus a penalty on the masses of links without values.
        """
        return self.distance(chi) + float(self.heavy @ chi)

    def minimum(self, A: Array, g: Array) -> Array:
        """Find the physical parameters chi that minimise a least-squares cost plus the penalties.

        The function is 1/2 chi'A chi - g'chi + D(chi) + price'chi, D the distance from known values
        plus the price of the masses.
        """
        return self.program.minimum(A + self.H, g + self.h - self.heavy - self.price)

    def stiffness(self, chi: Array) -> Array:
        """Compute the Hessian matrix of the penalty D plus a barrier that keeps the parameters
        physical.

        The barrier is logarithmic, has a small weight (WEAK_PRICE in limits.toml), and bounds the
        parameters by the physical conditions. The barrier makes the matrix large in the directions
        in which parameters would leave their bounds.
        """
        B = self.H.copy()
        sizes = [
            *self.P0,
            *(c0 * np.eye(c.B.shape[1]) for c, c0 in zip(self.elements, self.c0, strict=True)),
        ]
        for condition, size in zip([*self.links, *self.elements], sizes, strict=True):
            P = condition.matrix(chi) + LIMIT.WEAK_PRICE * size
            scaled = np.linalg.solve(P, condition.B)
            numbers = list(condition.numbers)
            B[np.ix_(numbers, numbers)] += LIMIT.WEAK_PRICE * np.einsum(
                "kab,mba->km", scaled, scaled
            )
        return B


def physical_fit(grams: Grams, bodies: Bodies, N: float, sigma: Array, rounds: int = 8) -> Fit:
    """Fit the standard parameters under physical conditions, and near known values if there are
    any.

    N : number of independent rows of a joint.
    sigma : residuals of the joints that give the first weights; each fit gives new ones, at most
        `rounds` times.
    """
    for _ in range(rounds):
        chi = bodies.minimum(*grams.weighted(sigma))
        before, sigma = sigma, grams.sigma(chi)
        if np.abs(np.log(sigma / before)).max() < LIMIT.SAME_WEIGHTS:
            break
    return fit_of(grams, chi, N, bodies.penalty(chi))


def quick_fit(grams: Grams, bodies: Bodies, N: float, sigma: Array) -> Fit:
    """Fit the standard parameters under physical conditions once, weighted by given residuals.

    The score is at most a few nats above that of `physical_fit`.
    """
    return physical_fit(grams, bodies, N, sigma, rounds=1)
