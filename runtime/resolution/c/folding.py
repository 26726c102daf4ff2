"""The zero-phase decimation of `runtime.signals.decimation` with half as many products, for C.

Forward and backward filter together are one filter without a direction, whose poles are those of
both:

    H(z) H(1/z) = d + sum_i g_i [1/(z - lambda_i) + 1/(1/z - lambda_i)] + conj
            g_i = c_i H(1/lambda_i)
    x_(t+1) = lambda x_t + e_t          w_(t-1) = lambda w_t + e_t
            y_t = d e_t + 2 Re g'(x_t + w_t)

so that both states are driven by the signal e itself. Over an interval of n_d samples, from one
kept sample to the next, they need the sums of
lambda^(n_d-1-t) e_t and of lambda^t e_t, whose half sum and half difference are sums over pairs of
samples, e_t + e_(n_d-1-t) and e_t - e_(n_d-1-t):
half the products, and none for y between kept samples. With w_t = (w_(t-1) - e_t)/lambda and d - 2
Re sum_i g_i/lambda_i = D H(0),

    y_t = D H(0) e_t + 2 Re g'x_t + 2 Re (g/lambda)'w_(t-1).

The backward state of the reference, driven by the forward filter's output f, is w^f_t = n w_t + S
x_(t+1), n_i = H(1/lambda_i), with
S_ij = c_j/(1 - lambda_i lambda_j), j over all poles; so the end of the record, where it starts in
the steady state of the last f, is the reference's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from runtime.signals.decimation import ORDER, Plan, operator

Array = np.ndarray

STATE = ORDER  # real numbers of a state: real parts of the modes, then imaginary parts


@dataclass(frozen=True, eq=False)
class Folding:
    """Matrices of struct decimation in kernels.c.

    direct : D H(0).   matrices : modes, pairs, start, back, end.
    """

    direct: float
    matrices: tuple[Array, Array, Array, Array, Array]


@lru_cache(maxsize=8)
def folding_of(p: Plan) -> Folding:
    """The matrices for one plan of the reference."""
    op = operator(p.factor)
    lam, m = op.lam, len(op.lam)
    S = np.concatenate([op.c, op.c.conj()]) / (1 - lam[:, None] * np.concatenate([lam, lam.conj()]))
    n = op.D + lam * S.sum(axis=1)
    g, step = op.c * n, lam**p.factor
    t = np.arange((p.factor + 1) // 2)[:, None]
    near, far = lam**t, lam ** (p.factor - 1 - t)
    even, odd = (near + far) / 2, (near - far) / 2
    if p.factor % 2:
        even[-1] /= 2  # the sample in the middle is its own partner
    behind = g / lam * step ** (p.G - np.arange(p.G))[:, None]
    back = np.zeros((STATE, 2 * STATE))
    back[:, :STATE] = np.block(
        [
            [np.diag((lam**p.L).real), np.diag((lam**p.L).imag)],
            [-np.diag((lam**p.L).imag), np.diag((lam**p.L).real)],
        ]
    )
    back[:, STATE : STATE + p.G] = _output(behind).T
    end = np.zeros((len(p.A) + STATE, 2 * STATE))
    S_x = np.stack(
        [S[:, :m] + S[:, m:], 1j * (S[:, :m] - S[:, m:])], axis=1
    )  # on real and imaginary parts of x
    end[: len(p.A), :STATE] = _halves(_complex(p.A) / n)
    end[len(p.A) :, :STATE] = _halves((_complex(_parts_first(p.Ax)) - S_x.reshape(m, STATE).T) / n)
    end[: len(p.A), STATE : STATE + p.A.shape[1] - STATE] = p.A[:, STATE:]
    end[len(p.A) :, STATE : STATE + p.A.shape[1] - STATE] = _parts_first(p.Ax)[:, STATE:]
    modes = np.stack(
        [
            _halves(step.real + 1j * step.real),
            _halves(-step.imag + 1j * step.imag),
            _output(g),
            _output(g / lam),
        ]
    )
    direct = op.D * (op.D - 2 * (op.c / lam).sum().real)
    pairs = np.hstack([_halves(even), _halves(odd)])
    return Folding(direct, (modes, pairs, _halves(_complex(p.X0)), back, end))


def _halves(z: Array) -> Array:
    """Real parts, then imaginary parts, along the last axis."""
    return np.ascontiguousarray(np.concatenate([z.real, z.imag], axis=-1))


def _output(g: Array) -> Array:
    """2 Re g'x as a row on the parts of x."""
    return 2 * np.concatenate([g.real, -g.imag], axis=-1)


def _complex(pairs: Array) -> Array:
    """The first STATE columns, pairs Re, Im, as complex numbers."""
    return np.asarray(pairs[:, :STATE:2] + 1j * pairs[:, 1:STATE:2])


def _parts_first(rows: Array) -> Array:
    """Rows of pairs Re, Im as rows of real parts, then of imaginary parts."""
    return np.vstack([rows[::2], rows[1::2]])
