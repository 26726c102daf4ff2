"""Uncertainty of the parameters X for correlated residuals: jackknife and block bootstrap.

Filtered residuals are correlated over time, and the joints of one instant with each other; eq. (10)
accounts for neither. Time is cut into K blocks, longer than the memory of the residuals, and only
blocks are assumed to be independent; a block holds the rows of all joints in its interval. With
T T' = (W'W)^-1, G_k = T' W_k'W_k T the share of block k in the information on X, and
g_k = W_k' (Y_k - W_k X), the estimate without block k is

    X - T (1 - G_k)^-1 T' g_k         so that         C_b = (K - 1)/K  sum_k u_k u_k',
            u_k = T (1 - G_k)^-1 T' g_k

the jackknife over blocks. Without (1 - G_k)^-1 the residuals are too small, because the fit has
reduced them: sigma is 0.8 of the scatter with 60 parameters and 50 blocks. (1 - G_k)^-1/2 in its
place (CR2) is exact for independent residuals and too small for correlated ones, for which blocks
are used.

Friction that the model lacks causes the same error in every block of time, because every block has
the same strokes. So the rows of every joint are divided again, into bands with equally many rows:
bands of its speed |qd_j|, of its load |W_j X|, of its position q_j, and of its way since the last
reversal, which shows hysteresis. The jackknife over the bands of speed leaves out slow or fast
motion, and so on; few and unequal bands make it larger than (10) for independent residuals too, by
diag(C_0)/diag(T T'):

    C_v = (K - 1)/K  sum_k u_k u_k',        C_0 = (K - 1)/K  sum_k T G_k (1 - G_k)^-1 T',
            v = diag(C_v) diag(T T')/diag(C_0)

The corrected variance is diag(C_b), or the largest v where that is clearly larger (BANDS_SHOW of
the limits).

References: Bell and McCaffrey (2002) for (1 - G_k); MacKinnon, Nielsen and Webb (2023), CV3, for
the jackknife; Kunsch (1989) for drawn blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from runtime.core.rows.factor import Array
from runtime.ground.limits import LIMIT


def block_covariance(blocks: Iterable[Array], X: Array, T: Array) -> Array:
    """Compute the jackknife covariance of X over blocks of time, shape (b, b).

    Entries are nan for fewer than two blocks, and for a parameter that only one block determines.

    Parameters
    ----------
    blocks : iterable of ndarray, shape (rows, b + 1)
        Rows [W Y] of every block, weighted as for the fit.
    X : ndarray, shape (b,)
        Parameters of the fit.
    T : ndarray, shape (b, rank)
        T T' = (W'W)^-1.
    """
    U = deletions(blocks, X, T, T)
    return np.asarray(U.T @ U) if len(U) > 1 else np.full((len(T), len(T)), np.nan)


def corrected_deviations(
    blocks: Iterable[Array], bands: Iterable[Iterable[Array]], X: Array, T: Array
) -> Array:
    """Compute standard deviations of X, shape (b,), corrected for slow noise and unmodelled
    friction.

    The deviations come from the jackknife over blocks of time; over one kind of bands where that
    deviation is clearly larger. A deviation is nan if only one block determines the parameter.

    Parameters
    ----------
    blocks : iterable of ndarray, shape (rows, b + 1)
        Rows [W Y] of every block of time, weighted as for the fit.
    bands : iterable of iterables of ndarray, shape (rows, b + 1)
        Rows of every band, for each kind of bands.
    X, T
        As for `block_covariance`.
    """
    by_time = np.diag(block_covariance(blocks, X, T))
    by_bands = [band_variances(one, X, T) for one in bands]
    most = np.max([np.zeros(len(T)), *by_bands], axis=0)
    return np.asarray(np.sqrt(np.where(most > LIMIT.BANDS_SHOW * by_time, most, by_time)))


def band_variances(bands: Iterable[Array], X: Array, T: Array) -> Array:
    """Compute the variances of X, shape (b,), by a jackknife over bands of one kind.

    The variances are v = diag(C_v) diag(T T')/diag(C_0), and about zero for one band. The
    parameters are those of `block_covariance`.
    """
    squares, independent = np.zeros(len(T)), np.zeros(len(T))
    for rows in bands:
        share, V, g = _directions(rows, X, T)
        others = (1 - share).clip(LIMIT.BLOCK_ALONE)  # what the other bands know
        directions = T @ V
        squares += (directions @ (g / others)) ** 2
        independent += directions**2 @ (share / others)
    scale = np.sum(T**2, axis=1) / np.where(independent > 0, independent, 1.0)
    return np.asarray(squares * scale)


def deletions(blocks: Iterable[Array], X: Array, T: Array, into: Array) -> Array:
    """Compute how X changes if one block of time is left out, for every block (jackknife).

    Row k is sqrt((K - 1)/K) into (1 - G_k)^-1 T'g_k, shape (K, b).

    into : ndarray, shape (b, rank): T for least squares.
    """
    size = np.linalg.norm(into, axis=1, keepdims=True)
    changes = []
    for rows in blocks:
        share, V, g = _directions(rows, X, T)
        others = share < 1 - LIMIT.BLOCK_ALONE
        directions = into @ V
        u = directions[:, others] @ (g[others] / (1 - share[others]))
        alone = np.abs(directions[:, ~others]) > LIMIT.BLOCK_PARTICIPATION * size
        u[alone.any(axis=1)] = np.nan  # a parameter that only this block determines
        changes.append(u)
    return np.asarray(
        np.sqrt(1 - 1 / max(len(changes), 1)) * np.array(changes).reshape(-1, len(into))
    )


def _directions(rows: Array, X: Array, T: Array) -> tuple[Array, Array, Array]:
    """Decompose the share G_k = V diag(share) V' of a block; return share, V and V'T' g_k."""
    P = rows[:, :-1] @ T
    share, V = np.linalg.eigh(P.T @ P)
    return share, V, V.T @ (P.T @ (rows[:, -1] - rows[:, :-1] @ X))


def drawn_again(
    blocks: Iterable[Array], estimator: Callable[[Array], Array], runs: int, seed: int
) -> Array:
    """Estimate X again, shape (runs, b), from records made of blocks drawn with replacement.

    Parameters
    ----------
    blocks : iterable of ndarray, shape (rows, b + 1)
        Rows [W Y] of every block, weighted as for the fit.
    estimator : callable
        Function that returns X, shape (b,), from the Gram matrix of a whole record.
    runs : int
        Number of draws.
    seed : int
        Seed of the draws.
    """
    grams = np.array([rows.T @ rows for rows in blocks])
    counts = np.random.default_rng(seed).multinomial(
        len(grams), np.full(len(grams), 1 / len(grams)), size=runs
    )
    return np.array(
        [estimator(np.tensordot(count, grams, axes=1)) for count in counts.astype(float)]
    )


def scatter(
    blocks: Iterable[Array], estimator: Callable[[Array], Array], runs: int, seed: int
) -> Array:
    """Compute the standard deviation of X, shape (b,), over records resampled by blocks.

    The records are those of `drawn_again`.
    """
    return np.asarray(np.std(drawn_again(blocks, estimator, runs, seed), axis=0, ddof=1))


def gram_root(gram: Array) -> Array:
    """Compute an upper triangular R, shape (c, c), such that R'R is the Gram matrix `gram`.

    gram is any positive semidefinite matrix. Columns are first scaled to 1.
    """
    size = np.sqrt(np.where(np.diag(gram) > 0, np.diag(gram), 1.0))
    values, vectors = np.linalg.eigh(gram / np.outer(size, size))
    return np.asarray(
        np.linalg.qr(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * size, mode="r")
    )


def gram_solution(gram: Array) -> Array:
    """Compute the least-squares X, shape (b,), from the Gram matrix of [W Y].

    Columns are first scaled to 1.
    """
    A, y = gram[:-1, :-1], gram[:-1, -1]
    D = 1 / np.sqrt(np.where(np.diag(A) > 0, np.diag(A), 1.0))
    return np.asarray(D * np.linalg.lstsq(A * np.outer(D, D), D * y, rcond=None)[0])
