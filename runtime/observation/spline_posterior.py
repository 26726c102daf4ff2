"""A position as a cubic spline with white jerk, under independent Gaussian knowledge of single samples: means, deviations, draws in linear time.

    x(t) = sum_i c_i B((t - t_i)/h)       B the cubic B-spline: between two knots the jerk j = (c_(i+3) - 3 c_(i+2) + 3 c_(i+1) - c_i)/h^3 is constant
    prior      j_i independent, of variance r_i/h: the white jerk of density r, held over h
    sample k   precision tau_k about nu_k/tau_k
    posterior  precision A = sum_k tau_k b_k b_k' + sum_i (h/r_i) d_i d_i',  a band of 3 beside its diagonal,  A c = sum_k nu_k b_k

A = L L' by LAPACK. Elements of Z = A^-1 within the band follow from L backward in time (Takahashi): c_i given the later ones is normal, of
mean l_i'(c_(i+1), c_(i+2), c_(i+3)) and variance 1/L_ii^2. The recursion is linear in what stands at its end, so stretches of time are passed
side by side from an end without error, and joined afterwards; exact, with few steps of long arrays.

References: Takahashi, Fagan and Chin (1973); Wahba (1978) for splines as posteriors of integrated white noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs, dtbtrs

Array = np.ndarray

PAIRS = [(a, b) for a in range(4) for b in range(a, 4)]
JERK = np.array([-1.0, 3.0, -3.0, 1.0])


class Basis:
    """Splines of n channels over N samples of period Ts, with a knot every m samples.

    Samples are padded to whole intervals: M intervals, m M samples, P = M + 3 coefficients. values : (B, B', B'') at the m samples of an
    interval, shape (m, 4) each.
    """

    def __init__(self, N: int, n: int, m: int, Ts: float) -> None:
        self.N, self.n, self.m, self.M, self.h = N, n, m, -(-N // m), m * Ts
        self.P, self.padded = self.M + 3, self.M * m
        u = np.arange(m) / m
        one = np.ones(m)
        self.values = (
            np.stack([(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3], axis=1) / 6,
            np.stack([-((1 - u) ** 2), 3 * u**2 - 4 * u, -3 * u**2 + 2 * u + one, u**2], axis=1) / (2 * self.h),
            np.stack([1 - u, 3 * u - 2, 1 - 3 * u, u], axis=1) / self.h**2,
        )
        self.products = np.stack([self.values[0][:, a] * self.values[0][:, b] for a, b in PAIRS], axis=1)

    def at_samples(self, c: Array, order: int = 0) -> Array:
        """The spline, or its derivative of that order, shape (n, m M), of coefficients (n, P)."""
        windows = np.lib.stride_tricks.sliding_window_view(c, 4, axis=1)
        return np.asarray((windows @ self.values[order].T).reshape(self.n, -1))

    def variances(self, Z: Array, order: int = 0) -> Array:
        """Variances of the same, shape (n, m M); Z, shape (4, n, P)."""
        b = self.values[order]
        squares = np.stack([(1 if i == j else 2) * b[:, i] * b[:, j] for i, j in PAIRS])
        return np.asarray((self._band(Z) @ squares).reshape(self.n, -1))

    def jerk(self, c: Array) -> Array:
        """Jerk of every interval, shape (n, M)."""
        return np.asarray(np.diff(c, 3, axis=1)) / self.h**3

    def jerk_variances(self, Z: Array) -> Array:
        """Its variances."""
        return np.asarray(self._band(Z) @ np.array([(1 if i == j else 2) * JERK[i] * JERK[j] for i, j in PAIRS])) / self.h**6

    def precision(self, tau: Array, density: Array) -> Array:
        """A by its diagonals, shape (4, n, P); tau, shape (n, m M), density r, shape (n, M)."""
        samples = tau.reshape(self.n, self.M, self.m) @ self.products
        prior = 1 / (self.h**5 * density)
        A = np.zeros((4, self.n, self.P))
        for k, (i, j) in enumerate(PAIRS):
            A[j - i][:, i : i + self.M] += samples[:, :, k] + JERK[i] * JERK[j] * prior
        return A

    def gradient(self, pull: Array, density: Array, c: Array) -> Array:
        """Slope of the log posterior at c, shape (n, P); pull = nu - tau x(c), shape (n, m M)."""
        samples = pull.reshape(self.n, self.M, self.m) @ self.values[0]
        prior = np.diff(c, 3, axis=1) / (self.h**5 * density)
        g = np.zeros((self.n, self.P))
        for i in range(4):
            g[:, i : i + self.M] += samples[:, :, i] - JERK[i] * prior
        return g

    def _band(self, Z: Array) -> Array:
        """Covariances of the pairs of coefficients of every interval, shape (n, M, 10)."""
        return np.stack([Z[j - i][:, i : i + self.M] for i, j in PAIRS], axis=-1)


@dataclass(frozen=True, eq=False)
class Factor:
    """Cholesky factor of A of n channels, one after the other: L by its diagonals, shape (4, n P)."""

    L: Array
    n: int

    @classmethod
    def of(cls, A: Array) -> Factor:
        """Factor of A, shape (4, n, P); where rounding made it indefinite, of A with a diagonal larger by the least share that helps."""
        n = A.shape[1]
        A = A.reshape(4, -1)
        for share in (0.0, 1e-13, 1e-11, 1e-9):
            L, info = dpbtrf(np.vstack([A[:1] * (1 + share), A[1:]]), lower=1)
            if not info:
                return cls(L, n)
        raise np.linalg.LinAlgError(f"the precision of coefficient {info} is not positive")

    def solve(self, g: Array) -> Array:
        """A^-1 g, shape (n, P)."""
        return np.asarray(dpbtrs(self.L, g.reshape(-1, 1), lower=1)[0].reshape(g.shape))

    def draw(self, rng: np.random.Generator) -> Array:
        """A draw of N(0, A^-1), shape (n, P)."""
        z = rng.standard_normal((self.L.shape[1], 1))
        return np.asarray(dtbtrs(self.L, z, uplo="L", trans="T")[0].reshape(self.n, -1))

    def inverse(self) -> Array:
        """Z_(i, i + lag) of lags 0 to 3, shape (4, n, P)."""
        T = self.L.shape[1]
        length = max(8, int(np.sqrt(T)))
        stretches = -(-T // length)
        l, d = np.zeros((3, stretches * length)), np.ones(stretches * length)
        l[:, :T], d[:T] = -self.L[1:] / self.L[0], 1 / self.L[0] ** 2
        l = np.ascontiguousarray(l.reshape(3, stretches, length).transpose(2, 0, 1))
        d = np.ascontiguousarray(d.reshape(stretches, length).T)
        z, f = np.zeros((length + 3, 4, stretches)), np.zeros((length + 3, 3, stretches))
        f[[length, length + 1, length + 2], [0, 1, 2]] = 1
        for i in range(length - 1, -1, -1):
            (l1, l2, l3), z1, z2, z3, own = l[i], z[i + 1], z[i + 2], z[i + 3], z[i]
            own[1] = l1 * z1[0] + l2 * z1[1] + l3 * z1[2]
            own[2] = l1 * z1[1] + l2 * z2[0] + l3 * z2[1]
            own[3] = l1 * z1[2] + l2 * z2[1] + l3 * z3[0]
            own[0] = d[i] + l1 * own[1] + l2 * own[2] + l3 * own[3]
            f[i] = l1 * f[i + 1] + l2 * f[i + 2] + l3 * f[i + 3]
        ends = _joined(z, f)
        weighted = np.einsum("abw,ibw->iaw", ends, f)
        Z = [z[:length, lag] + np.einsum("iaw,iaw->iw", f[:length], weighted[lag : lag + length]) for lag in range(4)]
        return np.stack([x.T.reshape(-1)[:T] for x in Z]).reshape(4, self.n, -1)


def _joined(z: Array, f: Array) -> Array:
    """Covariance of the three coefficients behind every stretch, shape (3, 3, stretches)."""
    stretches = z.shape[2]
    first = np.empty((stretches, 3, 3))
    for a in range(3):
        for b in range(a, 3):
            first[:, a, b] = first[:, b, a] = z[a, b - a]
    through = np.ascontiguousarray(f[:3].transpose(2, 0, 1))
    ends, S = np.empty((stretches, 3, 3)), np.zeros((3, 3))
    for w in range(stretches - 1, -1, -1):
        ends[w] = S
        S = first[w] + through[w] @ S @ through[w].T
    return np.ascontiguousarray(ends.transpose(1, 2, 0))
