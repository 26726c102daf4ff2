"""Uncertainty without the assumption of independent residuals.

Filtered residuals are correlated over time, and the joints of one instant with each other; eq. (10) knows neither. Time is cut into K blocks,
longer than the memory of the residuals, and only blocks are taken as independent. With X = A Y, A = (W'W)^-1 W', and S_k the residual of
block k (zero elsewhere, all joints together: rows are joint-major, so a block is gathered by the time of its rows),

    C_b = c A (sum_k S_k S_k') A',    c = K/(K - 1) (r - 1)/(r - b)

c is the usual correction for residuals that a fit has shrunk. A S_k = (W'W)^-1 g_k with g_k = W' S_k, so one (K, b) matrix suffices.

Reference: the cluster-robust covariance of Liang and Zeger (1986); c as in Cameron and Miller (2015), section II.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from runtime.observation.observation import Observation
from runtime.observation.qr_factor import Array

BLOCKS = 50
"""Blocks that the record is cut into by default: their number alone makes sigma uncertain by 1/sqrt(2*50) = 10 %."""
SHORTEST = 5
"""Shortest default block, rows of one joint: 2/cutoff, the memory of the low-pass filter, at the rate of eq. (13)."""


def default_block(observation: Observation) -> float:
    """Length of a block, s: a 50th of the record, at least five rows."""
    return float(max(max(observation.rows) / BLOCKS, SHORTEST) / observation.rate)


def block_of_rows(observation: Observation, block: float) -> Array:
    """Number of the block (from 0) of every row, shape (r,): same record, same interval of `block` seconds."""
    _, record = np.unique(observation.record, return_inverse=True)
    first = np.full(record.max() + 1, np.inf)
    np.minimum.at(first, record, observation.t)
    interval = np.floor((observation.t - first[record]) / block + 1e-9).astype(np.intp)
    _, number = np.unique(record * (interval.max() + 1) + interval, return_inverse=True)
    return np.asarray(number)


def block_covariance(W: Array, residual: Array, blocks: Array, T: Array) -> Array:
    """C_b, shape (b, b).

    Parameters
    ----------
    W : ndarray, shape (r, b).
    residual : ndarray, shape (r,): Y - W X, times 1/s_j^2 on the rows of joint j for weighted least squares.
    blocks : ndarray of int, shape (r,), block of each row.
    T : ndarray, shape (b, rank), T T' = (W'W)^-1 of the (weighted) system.
    """
    r, K = len(W), int(blocks.max()) + 1
    return score_covariance(csr_array((residual, (blocks, np.arange(r))), shape=(K, r)) @ W, r, T)


def score_covariance(g: Array, r: int, T: Array) -> Array:
    """C_b, shape (b, b), from the g_k, shape (K, b), of K blocks and r rows in all."""
    K, b = g.shape
    if K < 2 or r <= b:
        return np.full((b, b), np.nan)
    U = (g @ T) @ T.T
    return np.asarray(K / (K - 1) * (r - 1) / (r - b) * (U.T @ U))
