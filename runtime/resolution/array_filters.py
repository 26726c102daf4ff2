"""The filters of `runtime.observation.filters` on arrays of any package, as matrix products: nothing steps from sample to sample.

In modal form (`runtime.observation.decimation`), lambda_i the poles and c_i their residues, one pass of a filter over blocks e_k of B samples is

    x_(k+1) = lambda^B x_k + P e_k          f_k = H e_k + 2 Re F x_k          P[l, i] = lambda_l^(B-1-i),  H[i, j] = h_(i-j),  F[i, l] = c_l lambda_l^i

and the short recursion over the blocks is itself a product with powers of lambda, block by block and blocks of blocks in turn (`scan`). The
transfer function and the odd ends are those of the reference, so results differ by rounding only: times 2 sum |c_i|/|1 - lambda_i|, which for a
Butterworth filter grows with its order alone, 3 for order 4, 26 for 8, 220 for 12.

`put` makes an array of the package and device in use from one of NumPy, `xp` is the namespace of the package.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import toeplitz
from scipy.signal import butter

from runtime.observation.decimation import Plan
from runtime.settings.study import Lowpass

Array = Any  # of the package in use
Host = np.ndarray

BLOCK = 64  # samples of a block of the filter
SCAN = 32  # steps of a recursion that one product takes


@dataclass(frozen=True)
class Arrays:
    """A package and a device."""

    xp: Any
    put: Callable[[Host], Array]
    device: str = ""

    def of_pairs(self, x: Array) -> Array:
        """Complex numbers, shape (m, ...), from pairs Re, Im along the last axis, shape (..., 2 m)."""
        xp = self.xp
        re, im = xp.astype(x[..., 0::2], xp.complex128), xp.astype(x[..., 1::2], xp.complex128)
        return xp.moveaxis(re + 1j * im, -1, 0)

    def to_pairs(self, x: Array) -> Array:
        """The inverse of `of_pairs`."""
        xp = self.xp
        x = xp.moveaxis(x, 0, -1)
        return xp.reshape(xp.stack([xp.real(x), xp.imag(x)], axis=-1), (*x.shape[:-1], 2 * x.shape[-1]))


@dataclass(frozen=True, eq=False)
class Modes:
    """H(z) = D + sum_i [c_i/(z - lam_i) + conj]; c, lam : complex, shape (m,). A real pole counts once, with half its residue."""

    D: float
    c: Host
    lam: Host

    def impulse(self, length: int) -> Host:
        """h_0 ... h_(length-1)."""
        return np.concatenate([[self.D], 2 * (self.lam ** np.arange(length - 1)[:, None] @ self.c).real])


def lowpass_modes(low: Lowpass, rate: float) -> Modes:
    """The Butterworth filter of `low` at `rate`, Hz."""
    zeros, poles, D = butter(low.order, low.cutoff, fs=rate, output="zpk")
    lam = poles[poles.imag >= 0]
    others = np.array([[p for p in poles if p != pole] for pole in lam])
    c = D * np.prod(lam[:, None] - zeros, axis=1) / np.prod(lam[:, None] - others, axis=1)
    return Modes(float(D), np.where(lam.imag > 0, c, c / 2), lam)


def scan(arrays: Arrays, a: Host, start: Array, drive: Array) -> Array:
    """x_0 = start, x_(k+1) = a x_k + drive_k; a : complex, shape (m,); start (m, S), drive (m, S, K) complex; returns (m, S, K + 1)."""
    xp, (m, S, K) = arrays.xp, drive.shape
    if K == 0:
        return start[..., None]
    B = min(SCAN, K)
    blocks = -(-K // B)
    if blocks * B > K:
        drive = xp.concat([drive, xp.zeros_like(drive[..., : blocks * B - K])], axis=2)
    power = a[:, None] ** np.arange(B + 1)
    within = np.stack([np.tril(toeplitz(row[:-1])) for row in power])  # [l, i, j] = a_l^(i-j)
    y = xp.matmul(xp.reshape(drive, (m, S * blocks, B)), arrays.put(np.swapaxes(within, 1, 2)))
    y = xp.reshape(y, (m, S, blocks, B))
    x = scan(arrays, a**B, start, y[:, :, :-1, -1])  # at the first step of each block
    y = y + x[..., None] * arrays.put(power[:, None, None, 1:])
    return xp.concat([start[..., None], xp.reshape(y, (m, S, blocks * B))[..., :K]], axis=2)


def zero_phase(arrays: Arrays, modes: Modes, u: Array, pad: int) -> Array:
    """Rows of u, shape (S, N), filtered forward and backward after odd reflection of `pad` samples at each end."""
    f = one_pass(arrays, modes, extended(arrays, u, pad))
    y = arrays.xp.flip(one_pass(arrays, modes, arrays.xp.flip(f, axis=1)), axis=1)
    return y[:, pad : y.shape[1] - pad]


def extended(arrays: Arrays, u: Array, pad: int) -> Array:
    """Odd reflection about the first and the last value, shape (S, N + 2 pad)."""
    xp, N = arrays.xp, u.shape[1]
    before = 2 * u[:, :1] - xp.flip(u[:, 1 : pad + 1], axis=1)
    after = 2 * u[:, N - 1 :] - xp.flip(u[:, N - 1 - pad : N - 1], axis=1)
    return xp.concat([before, u, after], axis=1)


def one_pass(arrays: Arrays, modes: Modes, e: Array) -> Array:
    """Rows of e, shape (S, L), through the filter once, from the steady state of their first value."""
    xp, put, (S, L) = arrays.xp, arrays.put, e.shape
    blocks = -(-L // BLOCK)
    if blocks * BLOCK > L:
        e = xp.concat([e, xp.zeros_like(e[:, : blocks * BLOCK - L])], axis=1)
    E = xp.reshape(e, (S, blocks, BLOCK))
    P = modes.lam[:, None] ** np.arange(BLOCK)[::-1]
    F = 2 * modes.c * modes.lam ** np.arange(BLOCK)[:, None]
    H = np.tril(toeplitz(modes.impulse(BLOCK)))
    x0 = put(1 / (1 - modes.lam))[:, None] * e[:, 0]
    x = scan(arrays, modes.lam**BLOCK, x0, arrays.of_pairs(xp.matmul(E[:, :-1, :], put(_pairs(P.T)))))
    f = xp.matmul(E, put(H.T)) + xp.matmul(arrays.to_pairs(x), put(_pairs(F.conj()).T))
    return xp.reshape(f, (S, blocks * BLOCK))[:, :L]


def _pairs(C: Host) -> Host:
    """Complex columns, shape (k, m), as columns Re, Im, shape (k, 2 m)."""
    return np.stack([C.real, C.imag], axis=-1).reshape(len(C), -1)


def derivative(arrays: Arrays, x: Array, rate: float, ends: str) -> Array:
    """Central differences along the last axis, at both ends one-sided or of second order, as `runtime.observation.filters.derivative`."""
    inside = (x[..., 2:] - x[..., :-2]) * (rate / 2)
    if ends == "one-sided":
        first, last = x[..., 1:2] - x[..., :1], x[..., -1:] - x[..., -2:-1]
    else:
        first = 2 * x[..., 1:2] - 1.5 * x[..., :1] - 0.5 * x[..., 2:3]
        last = 1.5 * x[..., -1:] - 2 * x[..., -2:-1] + 0.5 * x[..., -3:-2]
    return arrays.xp.concat([first * rate, inside, last * rate], axis=-1)


def decimate(arrays: Arrays, u: Array, plan: Plan) -> Array:
    """Kept samples, shape (S, K), of the rows of u, shape (S, N), as `runtime.observation.decimation.decimate`."""
    xp, put, (S, N), blocks = arrays.xp, arrays.put, u.shape, plan.blocks
    m2 = len(plan.Mx)
    x0 = arrays.of_pairs(xp.matmul(u[:, : len(plan.X0)], put(plan.X0)))
    last = xp.matmul(u[:, N - len(plan.A) :], put(plan.A))
    if blocks == 0:
        return (last + xp.matmul(arrays.to_pairs(x0), put(plan.Ax)))[:, m2:]
    rows = xp.reshape(u[:, plan.phase : plan.phase + blocks * plan.L], (S * blocks, plan.L))
    products = xp.reshape(xp.matmul(rows, put(plan.PQY)), (S, blocks, plan.PQY.shape[1]))
    x = scan(arrays, plan.step, x0, arrays.of_pairs(products[..., :m2]))
    states = arrays.to_pairs(x[..., :-1])
    end = last + xp.matmul(arrays.to_pairs(x[..., -1]), put(plan.Ax))
    drive = arrays.of_pairs(products[:, 1:, m2 : 2 * m2] + xp.matmul(states[:, 1:, :], put(plan.Mx)))
    v = xp.flip(scan(arrays, plan.step, arrays.of_pairs(end[:, :m2]), xp.flip(drive, axis=-1)), axis=-1)
    y = products[..., 2 * m2 :] + xp.matmul(states, put(plan.Yx)) + xp.matmul(arrays.to_pairs(v), put(plan.Yv))
    return xp.concat([xp.reshape(y, (S, blocks * plan.G)), end[:, m2:]], axis=1)
