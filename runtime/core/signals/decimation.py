"""Exact zero-phase decimation of signals, piece by piece, computed at the kept samples only.

Reference: a Chebyshev I low-pass forward and backward in second-order sections with odd padding of
p samples, then every n_d-th sample, which computes N outputs and discards all but N/n_d. In
modal form, lambda_i the poles of positive imaginary part and c_i their residues,

    H(z) = D + sum_i [c_i/(z - lambda_i) + conj],     h_0 = D,   h_j = 2 Re sum_i c_i lambda_i^(j-1)
    forward    x_(r+1) = lambda x_r + e_r,            f_r = D e_r + 2 Re c'x_r
    backward   w_(r-1) = lambda w_r + f_r,            y_r = D f_r + 2 Re c'w_r
               (' transposes, products componentwise)

with e the padded signal; both passes start in the steady state of their first value. Cut into
blocks u_b of L = G n_d samples from the first kept sample phi on, with x_b the forward state at the
first sample of block b and v_b the backward state w at its last one, everything is linear in
blocks:

    x_(b+1) = lambda^L x_b + P u_b          v_(b-1) = lambda^L v_b + Q u_b + Mx x_b
                                            y_b = Y u_b + Yx x_b + Yv v_b

[P; Q; Y] u is one matrix product for all signals and blocks, 2 (16 + G) operations a sample; x and
v are K/G short steps. The start, and the samples after the last whole block with their reflection,
have matrix products of their own: x_0 = X0 u, [v; y] = A u + Ax x. The signals are never stored. A
long record is computed in parts (`PART` kept samples), each from the samples that determine it: the
effect of all other samples is negligible (below `TRUNCATION`).

|lambda|^n_d is between 0.4 and 0.83 whatever n_d, so nothing grows. The residues are computed from
zeros and poles, because polynomial coefficients would lose all digits at n_d = 100.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise
from math import ceil, log

import numpy as np
from scipy.linalg import toeplitz
from scipy.signal import cheby1

Array = np.ndarray

ORDER, RIPPLE, CUTOFF = (
    8,
    0.05,
    0.8,
)  # of MATLAB's and scipy's decimate: ripple in dB, cut-off over the new Nyquist frequency
LONGEST, MOST_KEPT = (
    320,
    8,
)  # samples and kept samples of a block; the time is flat around these
# samples of a signal treated at a time, as many as an emitted module takes at once: rows of 32 kB,
# which stay in cache
PIECE = 4096
PART = 16384
"""Kept samples that are computed at a time."""
TRUNCATION = 1e-20
"""What is left of the slowest mode of the filter after `reach` samples."""


@dataclass(frozen=True, eq=False)
class Operator:
    """Decimation filter for one factor n_d in modal form: its poles and residues, m = 4 modes.

    D : real.   c, lam : complex, shape (m,).
    """

    factor: int
    D: float
    c: Array
    lam: Array

    def impulse(self, length: int) -> Array:
        """Compute the impulse response h_0 ... h_(length-1) of the filter."""
        return np.concatenate(
            [[self.D], 2 * (self.lam ** np.arange(length - 1)[:, None] @ self.c).real]
        )

    @property
    def reach(self) -> int:
        """Number of samples until the slowest mode of the filter has decayed to nothing
        (`TRUNCATION`).
        """
        return ceil(log(TRUNCATION) / log(np.abs(self.lam).max()))


@lru_cache(maxsize=32)
def operator(factor: int) -> Operator:
    """Design the decimation filter for a factor of at least 2, in modal form."""
    zeros, poles, D = cheby1(ORDER, RIPPLE, CUTOFF / factor, output="zpk")
    lam = poles[poles.imag > 0]
    others = np.array([[p for p in poles if p != pole] for pole in lam])
    c = D * np.prod(lam[:, None] - zeros, axis=1) / np.prod(lam[:, None] - others, axis=1)
    return Operator(factor, float(D), c, lam)


@dataclass(frozen=True, eq=False)
class Plan:
    """Matrices that decimate N samples to K kept samples; they do not depend on the signals.

    The m complex numbers of a state are stored as 2 m real numbers, in pairs Re, Im.

    factor, phase, pad : n_d, phi, p.
    L, G, blocks : samples of a block, its kept samples, number of blocks.
    step : lambda^L, complex, shape (m,).
    PQY : shape (L, 4 m + G).
    Mx : shape (2 m, 2 m).
    Yx, Yv : shape (2 m, G).
    X0 : shape (T0, 2 m).
    A : shape (T, 2 m + G'), Ax : shape (2 m, 2 m + G'), G' kept samples at the end.
    """

    factor: int
    phase: int
    pad: int
    N: int
    K: int
    L: int
    G: int
    blocks: int
    step: Array
    PQY: Array
    Mx: Array
    Yx: Array
    Yv: Array
    X0: Array
    A: Array
    Ax: Array

    def pieces(self) -> list[tuple[int, int]]:
        """Divide the N samples into pieces [t0, t1) of about equal length.

        The pieces are made of whole blocks, except the first and the last piece.
        """
        length = max(1, PIECE // self.L) * self.L
        cuts = [0, *range(self.phase + length, self.N, length), self.N]
        return list(pairwise(cuts))


@lru_cache(maxsize=32)
def plan(N: int, factor: int, phase: int, pad: int) -> Plan:
    """Compute the matrices that decimate N samples by a factor of at least 2.

    phase : first kept sample, 0 to factor - 1. pad : number p < N of samples that extend each end.
    """
    op = operator(factor)
    K = len(range(phase, N, factor))
    G = max(1, min(MOST_KEPT, LONGEST // factor))
    L, blocks = G * factor, (K - 1) // G
    f_u, f_x = _forward(op, L)
    v_f, y_f = _backward(op, L, G)
    P = op.lam[:, None] ** np.arange(L)[::-1]
    A, Ax = _end(op, N - phase - blocks * L, K - blocks * G, pad)
    return Plan(
        factor=factor,
        phase=phase,
        pad=pad,
        N=N,
        K=K,
        L=L,
        G=G,
        blocks=blocks,
        step=op.lam**L,
        PQY=_transposed(_pairs(P), _pairs(v_f @ f_u), y_f @ f_u),
        Mx=_transposed(_pairs(v_f @ f_x)),
        Yx=_transposed(y_f @ f_x),
        Yv=_transposed(_output(op, op.lam[:, None] ** (L - 1 - factor * np.arange(G)))),
        X0=_start(op, phase, pad),
        A=A,
        Ax=Ax,
    )


def decimate(u: Array, plan: Plan) -> Array:
    """Decimate signals u, shape (S, N), to the kept samples, shape (S, K)."""
    return decimated_pieces(lambda t0, t1: u[:, t0:t1], len(u), plan)


def decimated_parts(
    read: Callable[[int, int], Array], S: int, whole: Plan, most: int = PART
) -> Iterator[tuple[slice, Array]]:
    """Yield S decimated signals in parts: each part is a slice [a, b) of samples, and its values.

    The values have shape (S, b - a), b - a being at most `most`.

    read : as for `decimated_pieces`; samples that several slices need are read again.
    """
    far = operator(whole.factor).reach
    for a in range(0, whole.K, most):
        b = min(a + most, whole.K)
        first = whole.phase + a * whole.factor
        last = whole.phase + (b - 1) * whole.factor
        begin, end = max(first - far, 0), min(last + far + 1, whole.N)
        ahead, phase = divmod(first - begin, whole.factor)
        part = plan(end - begin, whole.factor, phase, whole.pad)
        y = decimated_pieces(partial(_later, read, begin), S, part)
        yield slice(a, b), y[:, ahead : ahead + b - a]


def decimated_pieces(read: Callable[[int, int], Array], S: int, plan: Plan) -> Array:
    """Decimate S signals to shape (S, K); the samples are read only once, piece by piece.

    read(t0, t1) gives the samples [t0, t1) of every signal, shape (S, t1 - t0); the array may be
    reused.
    """
    p, m2 = plan, len(plan.Mx)
    products = np.empty((p.blocks, S, p.PQY.shape[1]))
    first, last = np.empty((S, len(p.X0))), np.empty((S, len(p.A)))
    for t0, t1 in p.pieces():
        u, start = read(t0, t1), max(t0, p.phase)
        b0, b1 = (start - p.phase) // p.L, min(p.blocks, (t1 - p.phase) // p.L)
        if b1 > b0:
            blocks = u[:, start - t0 : start - t0 + (b1 - b0) * p.L].reshape(-1, p.L)
            products[b0:b1] = (blocks @ p.PQY).reshape(S, b1 - b0, -1).swapaxes(0, 1)
        copy_overlap(u, t0, first, 0)
        copy_overlap(u, t0, last, p.N - last.shape[1])
    K, x, v = p.blocks * p.G, np.empty((p.blocks + 1, S, m2)), np.empty((p.blocks, S, m2))
    x[0] = first @ p.X0
    recursion(p.step, x, products[..., :m2])
    end = last @ p.A + x[-1] @ p.Ax
    y = np.empty((S, p.K))
    y[:, K:] = end[:, m2:]
    if p.blocks:
        v[-1] = end[:, :m2]
        states = x[:-1].reshape(-1, m2)
        drive = products[..., m2 : 2 * m2] + (states @ p.Mx).reshape(v.shape)
        recursion(p.step, v[::-1], drive[:0:-1])
        outputs = products[..., 2 * m2 :] + (states @ p.Yx + v.reshape(-1, m2) @ p.Yv).reshape(
            p.blocks, S, -1
        )
        y[:, :K] = outputs.swapaxes(0, 1).reshape(S, K)
    return y


def _later(read: Callable[[int, int], Array], begin: int, t0: int, t1: int) -> Array:
    """Read samples t0 to t1 - 1 of the signals, where t0 and t1 count from sample `begin`."""
    return read(begin + t0, begin + t1)


def recursion(a: Array, x: Array, drive: Array) -> None:
    """Compute the filter state x_(b+1) = a x_b + drive_b of each block in place, from x_0.

    x : shape (B + 1, S, 2 m). drive : shape (B, S, 2 m).
    """
    z = x.view(complex)
    for before, after, d in zip(z, z[1:], drive.view(complex), strict=False):
        np.multiply(a, before, out=after)
        np.add(after, d, out=after)


def copy_overlap(u: Array, t0: int, window: Array, start: int) -> None:
    """Copy samples from u, which starts at sample t0, to `window`, which starts at sample `start`.

    Only samples that lie in both are copied.
    """
    a, b = max(t0, start), min(t0 + u.shape[1], start + window.shape[1])
    if a < b:
        window[:, a - start : b - start] = u[:, a - t0 : b - t0]


def _forward(op: Operator, length: int) -> tuple[Array, Array]:
    """Return two matrices that give the forward filter's output f from its input and state.

    One is applied to `length` samples, shape (length, length), the other to the state x at the
    first sample, shape (length, 2 m).
    """
    return np.tril(toeplitz(op.impulse(length))), _output(op, op.lam[:, None] ** np.arange(length))


def _backward(op: Operator, length: int, kept: int) -> tuple[Array, Array]:
    """Return two matrices that give the backward filter's state and output from its input f.

    f is the output of the forward filter. One matrix gives f_0 + lambda w_0, complex, shape
    (m, length), the other y at the first `kept` instants, shape (kept, length).
    """
    h = op.impulse(length)
    later = np.arange(length) - op.factor * np.arange(kept)[:, None]
    return op.lam[:, None] ** np.arange(length), np.where(later < 0, 0.0, h[np.maximum(later, 0)])


def _start(op: Operator, phase: int, pad: int) -> Array:
    """Return the matrix that maps the first samples to the filter state x at the first kept sample.

    Shape (T0, 2 m). The filter starts in the steady state of the first reflected sample; then it
    runs over the other reflected samples.
    """
    T0, length = max(pad + 1, phase), pad + phase
    extended = np.zeros((length, T0))
    extended[:pad, 0] = 2
    extended[np.arange(pad), np.arange(pad, 0, -1)] = -1
    extended[np.arange(pad, length), np.arange(phase)] = 1
    effect = op.lam[:, None] ** np.arange(length)[::-1]
    effect[:, 0] += op.lam**length / (1 - op.lam)
    return _transposed(_pairs(effect @ extended))


def _end(op: Operator, left: int, kept: int, pad: int) -> tuple[Array, Array]:
    """Return two matrices that decimate the last samples of a record, after the last whole block.

    They give v before the last `kept` instants, and y at these instants. One matrix is applied to
    the last samples, shape (T, 2 m + kept), the other to x at the first of the `left` samples.
    """
    length, T = left + pad, max(left, pad + 1)
    extended = np.zeros((length, T))
    extended[np.arange(left), np.arange(T - left, T)] = 1
    extended[left:, -1] = 2
    extended[np.arange(left, length), T - 2 - np.arange(pad)] = -1
    f_u, f_x = _forward(op, length)
    v_f, y_f = _backward(op, length, kept)
    v_f[:, -1] += op.lam**length / (
        1 - op.lam
    )  # the backward filter starts in the steady state of the last f
    response = (op.c / (1 - op.lam))[:, None] * op.lam[:, None] ** (
        length - 1 - op.factor * np.arange(kept)
    )
    y_f[:, -1] += 2 * response.sum(axis=0).real
    return (
        _transposed(_pairs(v_f @ (f_u @ extended)), y_f @ (f_u @ extended)),
        _transposed(_pairs(v_f @ f_x), y_f @ f_x),
    )


def _output(op: Operator, factors: Array) -> Array:
    """Return the matrix, shape (k, 2 m), that computes filter outputs from the filter state x.

    The outputs are 2 Re c'(factors x). The state x is given as pairs Re, Im; `factors` is complex,
    shape (m, k).
    """
    C = 2 * op.c[:, None] * factors
    return np.asarray(np.stack([C.real, -C.imag], axis=1).reshape(-1, C.shape[1]).T)


def _pairs(C: Array) -> Array:
    """Convert complex rows, shape (m, k), to rows of real and imaginary parts, shape (2 m, k)."""
    return np.asarray(np.stack([C.real, C.imag], axis=1).reshape(-1, C.shape[-1]))


def _transposed(*rows: Array) -> Array:
    """Stack matrices and transpose the stack, for products with signals that are rows.

    The result is contiguous in memory.
    """
    return np.ascontiguousarray(np.vstack(rows).T)
