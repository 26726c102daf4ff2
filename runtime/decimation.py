"""Zero-phase decimation computed at the kept samples only, exactly.

Reference: a Chebyshev I low-pass forward and backward in second-order sections with odd padding of p samples, then every n_d-th sample, which
computes N outputs and throws all but N/n_d away. In modal form, lambda_i the poles of positive imaginary part and c_i their residues,

    H(z) = D + sum_i [c_i/(z - lambda_i) + conj],     h_0 = D,   h_j = 2 Re sum_i c_i lambda_i^(j-1)
    forward    x_(r+1) = lambda x_r + e_r,            f_r = D e_r + 2 Re c'x_r
    backward   w_(r-1) = lambda w_r + f_r,            y_r = D f_r + 2 Re c'w_r          (' transposes, products componentwise)

with e the padded signal; both start in the steady state of their first value. Between kept samples r_k = phi + k n_d, with u_k the block of n_d samples from r_k on,

    x_(k+1) = lambda^n_d x_k + P u_k                                                           k = 0 .. K-2
    w_k     = lambda^n_d w_(k+1) + lambda^(n_d-1) f_(k+1) + Q u_k + Ma x_k + Mb conj(x_k)      k = K-2 .. 0

One matrix product and two first-order recursions over K samples replace the serial filter over N. |lambda|^n_d is between 0.4 and 0.83 whatever n_d,
so nothing grows; residues come from zeros and poles, polynomial coefficients would lose all digits at n_d = 100.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import toeplitz
from scipy.signal import cheby1, lfilter

Array = np.ndarray

ORDER, RIPPLE, CUTOFF = 8, 0.05, 0.8  # of MATLAB's and scipy's decimate: ripple in dB, cut-off as a fraction of the new Nyquist frequency
SMALL = 2**17  # multiplications of one matrix product


@dataclass(frozen=True, eq=False)
class Operator:
    """Modal form of the filter for one factor n_d; m = 4 modes.

    D : real.   c, lam : complex, shape (m,).   h : shape (n_d,), impulse response.   P, Q : complex, shape (m, n_d).   Ma, Mb : complex, shape (m, m).
    """

    factor: int
    D: float
    c: Array
    lam: Array
    P: Array
    Q: Array
    Ma: Array
    Mb: Array

    def impulse(self, length: int) -> Array:
        """h_0 ... h_(length-1)."""
        return np.concatenate([[self.D], 2 * (self.lam ** np.arange(length - 1)[:, None] @ self.c).real])


@lru_cache(maxsize=32)
def operator(factor: int) -> Operator:
    """The operator of a decimation factor of at least 2."""
    zeros, poles, D = cheby1(ORDER, RIPPLE, CUTOFF / factor, output="zpk")
    lam = poles[poles.imag > 0]
    others = np.array([[p for p in poles if p != pole] for pole in lam])
    c = D * np.prod(lam[:, None] - zeros, axis=1) / np.prod(lam[:, None] - others, axis=1)
    j = np.arange(factor)
    bare = Operator(factor, float(D), c, lam, *(np.empty(0),) * 4)
    h = bare.impulse(factor)
    tail = np.tril(toeplitz(h))[1:]  # tail[j-1, i] = h_(j-i), j = 1 .. n_d - 1
    Q = lam[:, None] ** j[:-1] @ tail
    direct, mirror = lam[:, None] * lam, lam[:, None] * lam.conj()
    Ma = c * lam * (1 - direct ** (factor - 1)) / (1 - direct)
    Mb = (c * lam).conj() * (1 - mirror ** (factor - 1)) / (1 - mirror)
    return Operator(factor, float(D), c, lam, lam[:, None] ** j[::-1], Q, Ma, Mb)


def decimate(u: Array, factor: int, phase: int, pad: int) -> Array:
    """Filtered samples phase, phase + factor, ... of each row of u.

    u : ndarray, shape (S, N), N > pad.   phase : first kept sample, 0 to factor - 1.   Returns shape (S, K).
    """
    op = operator(factor)
    K = len(range(phase, u.shape[1], factor))
    last = phase + (K - 1) * factor
    Pu, Qu = _block_products(op, u[:, phase:last].reshape(len(u), K - 1, factor))
    x = _recursion(op.lam**factor, _start(op, u, phase, pad), Pu)
    f = op.D * u[:, phase::factor] + _output(op, x)
    drive = op.lam[:, None] ** (factor - 1) * f[:, None, 1:] + Qu + op.Ma @ x[..., :-1] + op.Mb @ x[..., :-1].conj()
    w = _recursion(op.lam**factor, _end(op, u, x[..., -1], last, pad), drive[..., ::-1])[..., ::-1]
    return np.asarray(op.D * f + _output(op, w))


def _block_products(op: Operator, blocks: Array) -> tuple[Array, Array]:
    """P u_k and Q u_k, complex, shape (S, m, K - 1) each, of blocks, shape (S, K - 1, n_d).

    Products stay below the size at which BLAS starts threads: hundreds of short parallel products wait for each other more than they compute.
    """
    S, K1, _ = blocks.shape
    m = len(op.lam)
    M = np.vstack([op.P.real, op.P.imag, op.Q.real, op.Q.imag])
    products = np.empty((S, 4 * m, K1))
    step = max(1, SMALL // M.size)
    for k in range(0, K1, step):
        np.matmul(M, blocks[:, k : k + step].transpose(0, 2, 1), out=products[..., k : k + step])
    return products[:, :m] + 1j * products[:, m : 2 * m], products[:, 2 * m : 3 * m] + 1j * products[:, 3 * m :]


def _output(op: Operator, x: Array) -> Array:
    """2 Re c'x, shape (S, K), by einsum: BLAS would start threads for each of the S short products."""
    return np.asarray(2 * np.einsum("i,sik->sk", op.c, x).real)


def _recursion(a: Array, start: Array, drive: Array) -> Array:
    """x_0 = start, x_(k+1) = a x_k + drive_k along the last axis; start (S, m), drive (S, m, K - 1), a (m,); returns (S, m, K)."""
    x = np.empty((*start.shape, drive.shape[-1] + 1), dtype=complex)
    x[..., 0], x[..., 1:] = start, drive
    for i in range(len(a)):
        x[:, i] = lfilter([1.0], [1.0, -a[i]], x[:, i], axis=-1)
    return x


def _start(op: Operator, u: Array, phase: int, pad: int) -> Array:
    """x at the first kept sample, shape (S, m): steady state of e_(-pad), then the samples before."""
    e = np.concatenate([2 * u[:, :1] - u[:, pad:0:-1], u[:, :phase]], axis=1)
    length = e.shape[1]
    return np.asarray(op.lam**length / (1 - op.lam) * e[:, :1] + e @ (op.lam ** np.arange(length)[::-1, None]))


def _end(op: Operator, u: Array, x: Array, last: int, pad: int) -> Array:
    """w at the last kept sample, shape (S, m): forward filter over the tail and its reflection, then backward from its steady state."""
    N = u.shape[1]
    e = np.concatenate([u[:, last:], 2 * u[:, -1:] - u[:, N - 1 - pad : N - 1][:, ::-1]], axis=1)
    L = e.shape[1]
    j = np.arange(L)[:, None]
    f = 2 * (x @ (op.c * op.lam**j).T).real + e @ np.tril(toeplitz(op.impulse(L))).T
    return np.asarray(op.lam ** (L - 1) / (1 - op.lam) * f[:, -1:] + f[:, 1:] @ (op.lam ** j[:-1]))
