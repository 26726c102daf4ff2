"""A position as a cubic spline with white jerk, estimated from samples with Gaussian errors.

Means, standard deviations and draws need a time linear in the number of samples.

    x(t) = sum_i c_i B((t - t_i)/h)
        B the cubic B-spline: between two knots the jerk j = (c_(i+3) - 3 c_(i+2) + 3 c_(i+1) -
        c_i)/h^3 is constant
    prior      j_i independent, of variance r_i/h: the white jerk of density r, held over h
    sample k   precision tau_k about nu_k/tau_k
    posterior  precision A = sum_k tau_k b_k b_k' + sum_i (h/r_i) d_i d_i',  a band of 3 next to
    its diagonal,  A c = sum_k nu_k b_k

A = L L' by LAPACK. The elements of Z = A^-1 within the band follow from L backward in time
(Takahashi): c_i given the later coefficients is normal, of mean l_i'(c_(i+1), c_(i+2), c_(i+3)) and
variance 1/L_ii^2. This recursion is linear in its end values. Stretches of time are therefore
computed in parallel, each from an end without error, and joined afterwards; the result is exact,
and the computation has few steps on long arrays.

References: Takahashi, Fagan and Chin (1973); Wahba (1978) for splines as posteriors of integrated
white noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs, dtbtrs
from scipy.sparse import csr_array

Array = np.ndarray

PAIRS = [(a, b) for a in range(4) for b in range(a, 4)]
JERK = np.array([-1.0, 3.0, -3.0, 1.0])
SLOPE = 1e-3
"""Difference of log r by which log |A| is differentiated."""
LENGTH = 0.5
"""Coefficients of a stretch that is passed side by side with others, in roots of their number: a
step of the joining costs a quarter of one of the passing.
"""
CONDITION = 1e-9
"""Least density that a Cholesky factor resolves, by h^5."""


class Basis:
    """Cubic B-splines that represent a position at N samples, with a knot every m samples.

    The sampling period is Ts. Samples are padded to whole intervals: M intervals, m M samples, P =
    M + 3 coefficients.

    values : (B, B', B'') at the m samples of an interval, shape (m, 4) each.
    """

    def __init__(self, N: int, m: int, Ts: float) -> None:
        self.N, self.m, self.M, self.Ts, self.h = N, m, -(-N // m), Ts, m * Ts
        self.P = self.M + 3
        u = np.arange(m) / m
        one = np.ones(m)
        self.values = (
            np.stack(
                [(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3],
                axis=1,
            )
            / 6,
            np.stack([-((1 - u) ** 2), 3 * u**2 - 4 * u, -3 * u**2 + 2 * u + one, u**2], axis=1)
            / (2 * self.h),
            np.stack([1 - u, 3 * u - 2, 1 - 3 * u, u], axis=1) / self.h**2,
        )
        self.products = np.stack(
            [self.values[0][:, a] * self.values[0][:, b] for a, b in PAIRS], axis=1
        )

    def filled(self, x: Array) -> Array:
        """Pad N samples with zeros up to M whole intervals of m samples, shape (m M,)."""
        return np.pad(x, (0, self.M * self.m - self.N))

    @property
    def least_density(self) -> float:
        """Smallest spectral density of the jerk for which the precision matrix A can be factored.

        A is the precision of the spline coefficients. Unit: steps^2/s^5.

        The precision of a site is 0.06 or more.
        """
        return CONDITION / (self.h**5 * self.m)

    def at_samples(self, c: Array, order: int = 0) -> Array:
        """Compute the spline of coefficients c, or a derivative, at all samples.

        The shape is (m M,), for M intervals of m samples.

        `order` is the order of the derivative, 0 for the position.
        """
        windows = np.lib.stride_tricks.sliding_window_view(c, 4)
        return np.asarray((windows @ self.values[order].T).ravel())

    def rows(self, samples: Array) -> csr_array:
        """Return the values of the P B-splines at S samples, a sparse matrix of shape (S, P)."""
        interval, u = np.divmod(samples, self.m)
        columns = (interval[:, None] + np.arange(4)).ravel()
        ends = np.arange(0, len(columns) + 1, 4)
        return csr_array((self.values[0][u].ravel(), columns, ends), shape=(len(samples), self.P))

    def variances(self, Z: Array, order: int = 0) -> Array:
        """Compute the variance of the spline, or of a derivative, at all samples.

        The shape is (m M,), for M intervals of m samples.

        Z : covariances of its coefficients, from `Factor.inverse`, shape (4, P).
        """
        b = self.values[order]
        squares = np.stack([(1 if i == j else 2) * b[:, i] * b[:, j] for i, j in PAIRS])
        pairs = np.stack([Z[j - i, i : i + self.M] for i, j in PAIRS])
        return np.asarray((pairs.T @ squares).ravel())

    def jerk(self, c: Array) -> Array:
        """Compute the jerk of the spline in each of its M intervals between knots, shape (M,)."""
        return third_differences(c) / self.h**3

    def jerk_variances(self, Z: Array) -> Array:
        """Compute the variance of the jerk in each of the M intervals of the spline, shape (M,).

        Z : covariances of its coefficients, shape (4, P).
        """
        total = np.zeros(self.M)
        for i, j in PAIRS:
            total += (1 if i == j else 2) * JERK[i] * JERK[j] * Z[j - i, i : i + self.M]
        return np.asarray(total / self.h**6)

    def precision(self, tau: Array, density: Array) -> Array:
        """Compute the precision matrix A (inverse covariance) of the spline coefficients.

        Returns its diagonals, shape (4, P).

        tau : precisions of the samples, shape (m M,).
        density : density r of the jerk, shape (M,).
        """
        return np.asarray(self.of_samples(tau) + self.of_prior(density))

    def of_samples(self, tau: Array) -> Array:
        """Compute how much the samples add to the precision matrix A of the spline, shape (4, P).

        The addition is sum_k tau_k b_k b_k', with tau_k the precision of sample k and b_k the
        B-splines at this sample.
        """
        samples = self.products.T @ tau.reshape(-1, self.m).T
        A = np.zeros((4, self.P))
        for (i, j), of_pair in zip(PAIRS, samples, strict=True):
            A[j - i, i : i + self.M] += of_pair
        return A

    def of_prior(self, density: Array) -> Array:
        """Compute how much the prior, a white jerk, adds to the precision matrix A of the spline.

        The addition is sum_i (h/r_i) d_i d_i', with r_i the density and d_i'c the jerk in interval
        i.
        """
        prior = 1 / (self.h**5 * density)
        A = np.zeros((4, self.P))
        for i, j in PAIRS:
            A[j - i, i : i + self.M] += JERK[i] * JERK[j] * prior
        return A

    def gradient(self, pull: Array, density: Array, c: Array) -> Array:
        """Compute the gradient of the log posterior with respect to the P spline coefficients c.

        pull : nu - tau x(c) at all samples, shape (m M,).
        """
        samples = self.values[0].T @ pull.reshape(-1, self.m).T
        prior = third_differences(c) / (self.h**5 * density)
        g = np.zeros(self.P)
        for i in range(4):
            g[i : i + self.M] += samples[i] - JERK[i] * prior
        return g


def third_differences(c: Array) -> Array:
    """Compute the third differences of the spline coefficients c, one for each of M intervals.

    A third difference is c_(i+3) - 3 c_(i+2) + 3 c_(i+1) - c_i.
    """
    return np.asarray(c[3:] - c[:-3] + 3 * (c[1:-2] - c[2:-1]))


@dataclass(frozen=True, eq=False)
class Factor:
    """Cholesky factor of the precision matrix of P coefficients: 4 diagonals, shape (4, P)."""

    L: Array

    @classmethod
    def of(cls, A: Array) -> Factor:
        """Compute the Cholesky factor of the precision matrix A.

        A is given by its diagonals, shape (4, P). If rounding errors made A indefinite, its
        diagonal is increased by the smallest share that helps.
        """
        for share in (0.0, 1e-13, 1e-11, 1e-9):
            L, info = dpbtrf(np.vstack([A[:1] * (1 + share), A[1:]]), lower=1)
            if not info:
                return cls(L)
        raise np.linalg.LinAlgError(
            f"the precision matrix of the spline is not positive definite (coefficient {info})"
        )

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant of the precision matrix A."""
        return float(2 * np.log(self.L[0]).sum())

    def solve(self, g: Array) -> Array:
        """Solve A x = g with the precision matrix A, for g of shape (P,) or (P, k)."""
        return np.asarray(dpbtrs(self.L, g, lower=1)[0].reshape(g.shape))

    def draw(self, rng: np.random.Generator) -> Array:
        """Draw a random vector from the normal distribution of mean 0 and covariance A^-1."""
        z = rng.standard_normal((self.L.shape[1], 1))
        return np.asarray(dtbtrs(self.L, z, uplo="L", trans="T")[0].ravel())

    def inverse(self) -> Array:
        """Compute the elements of the covariance matrix Z = A^-1 near its diagonal, shape (4, P).

        The elements are Z_(i, i + lag) for lags 0 to 3.
        """
        T = self.L.shape[1]
        length = max(8, int(LENGTH * np.sqrt(T)))
        stretches = -(-T // length)
        l, d = np.zeros((3, stretches * length)), np.ones(stretches * length)
        l[:, :T], d[:T] = -self.L[1:] / self.L[0], 1 / self.L[0] ** 2
        l = np.ascontiguousarray(l.reshape(3, stretches, length).transpose(2, 0, 1))
        d = np.ascontiguousarray(d.reshape(stretches, length).T)
        z, f = np.empty((length, 4, stretches)), np.zeros((length + 3, 3, stretches))
        f[[length, length + 1, length + 2], [0, 1, 2]] = 1
        S, products = (
            np.zeros((2, 3, 3, stretches)),
            np.empty((3, 3, stretches)),
        )  # S : covariances of c_(i+1), c_(i+2), c_(i+3)
        now, after = S
        for i in range(length - 1, -1, -1):
            each = l[i][:, None]
            np.add.reduce(np.multiply(each, now, out=products), axis=0, out=z[i, 1:])
            np.add(d[i], np.add.reduce(l[i] * z[i, 1:], axis=0), out=z[i, 0])
            np.add.reduce(np.multiply(each, f[i + 1 : i + 4], out=products), axis=0, out=f[i])
            after[1:, 1:], after[0], after[1:, 0] = now[:2, :2], z[i, :3], z[i, 1:3]
            now, after = after, now
        first = np.ascontiguousarray(now.transpose(2, 0, 1))
        ends = _joined(first, np.ascontiguousarray(f[:3].transpose(2, 0, 1)))
        weighted = np.einsum("abw,ibw->iaw", ends, f)
        Z = np.empty((4, stretches, length))
        for lag in range(4):
            Z[lag] = (
                z[:, lag] + np.einsum("iaw,iaw->iw", f[:length], weighted[lag : lag + length])
            ).T
        return Z.reshape(4, -1)[:, :T]


def next_density(basis: Basis, samples: Array, unit: Array, g: Array, r: float) -> float:
    """Compute the next estimate of the spectral density r of a spline's jerk by MacKay's rule.

    The density is the sum of squared jerks over the number of jerks that the samples determine.

    samples, unit : parts of A that come from the samples, and from a prior of density one.
    g : gradient at c = 0.

    The number is M less the trace of A^-1 unit/r, which is the slope of log |A| by log 1/r. This
    needs two factors and no inverse. The density is never below basis.least_density: if the counts
    do not determine the jerk, the rule would end at zero.
    """
    factor, beside = (Factor.of(samples + unit / x) for x in (r, r * np.exp(SLOPE)))
    determined = basis.M - (factor.log_determinant - beside.log_determinant) / SLOPE
    squares = (basis.jerk(factor.solve(g)) ** 2).sum() * basis.h
    return float(max(squares / max(determined, 1e-9 * basis.M), basis.least_density))


def _joined(first: Array, through: Array) -> Array:
    """Compute the covariance of the three coefficients that follow each stretch of a spline.

    Returns an array of shape (3, 3, stretches).

    first : covariance of the first three coefficients of a stretch, given the three coefficients
      after the stretch.
    through : matrix by which the first three coefficients depend on the three after the stretch.
    Both have the shape (stretches, 3, 3).
    """
    ends, S = np.empty_like(first), np.zeros((3, 3))
    for w in range(len(first) - 1, -1, -1):
        ends[w], T = S, through[w]
        S = first[w] + T.dot(S).dot(T.T)
    return np.ascontiguousarray(ends.transpose(1, 2, 0))
