"""Friction laws, fitted to the friction torque of one joint by least squares.

The prediction error of each law is measured on rows that were not used in its fit. The laws, their
signs and references are in `runtime.friction.curves`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np
from scipy.optimize import minimize_scalar

from runtime.core.least_squares.block_covariance import block_covariance
from runtime.core.least_squares.linear import percent
from runtime.core.limits import LIMIT
from runtime.core.rows.observation import split_rows

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Terms:
    """Friction torque, velocity and terms of the friction laws of one joint, sample by sample.

    Attributes
    ----------
    f : ndarray, shape (N,), N m or N
        Friction torque.
    v : ndarray, shape (N,), rad/s or m/s
        Velocity.
    block : ndarray of int, shape (N,)
        Block of time of each row.
    linear : mapping of str to ndarray, shape (N,)
        Linear terms of the laws, by the name of their parameter.
    excess : function of float to ndarray, shape (N,), or of ndarray, shape (k,), to (k, N)
        The Stribeck term, multiplied by FST, for one value of VS or for several.
    """

    f: Array
    v: Array
    block: Array
    linear: Mapping[str, Array]
    excess: Callable[[float | Array], Array]

    @cached_property
    def grid(self) -> tuple[Array, Array]:
        """Logarithms of trial Stribeck velocities, shape (k,), and the Stribeck terms, (k, N)."""
        x = np.log(
            np.abs(self.v).max()
            * np.geomspace(LIMIT.STRIBECK_SLOWEST, LIMIT.STRIBECK_FASTEST, LIMIT.STRIBECK_GRID)
        )
        return x, self.excess(np.exp(x))


LAWS: Mapping[str, tuple[str, ...]] = {
    "coulomb+viscous": ("FS", "FV", "OFFSET"),
    "asymmetric": ("FSP", "FVP", "FSN", "FVN"),
    "stribeck": ("FS", "FV", "OFFSET", "FST", "VS"),
    "load": ("FS", "FV", "OFFSET", "FL"),
    "stribeck+load": ("FS", "FV", "OFFSET", "FL", "FST", "VS"),
}


def joined(parts: Sequence[Terms]) -> Terms:
    """Join the friction torque and the terms of one joint from several records."""
    linear = {
        name: np.concatenate([part.linear[name] for part in parts]) for name in parts[0].linear
    }
    _, block = np.unique(np.concatenate([part.block for part in parts]), return_inverse=True)
    f, v = (np.concatenate([getattr(part, name) for part in parts]) for name in ("f", "v"))
    return Terms(
        f, v, block, linear, lambda VS: np.concatenate([part.excess(VS) for part in parts], axis=-1)
    )


def _columns(terms: Terms, names: Sequence[str], VS: float | None) -> Array:
    """Build the matrix whose columns are the terms with linear parameters of a friction law.

    Shape (N, terms).
    """
    return np.column_stack(
        [
            terms.excess(cast(float, VS)) if name == "FST" else terms.linear[name]
            for name in names
            if name != "VS"
        ]
    )


def fit_law(terms: Terms, names: Sequence[str], rows: Array) -> dict[str, float]:
    """Fit the parameters of a friction law to a subset of the samples by least squares.

    VS is searched on a logarithmic axis.
    """
    f = terms.f[rows]
    VS = _excess_velocity(terms, names, rows) if "VS" in names else None
    x = np.linalg.lstsq(_columns(terms, names, VS)[rows], f, rcond=None)[0]
    law = dict(zip((name for name in names if name != "VS"), map(float, x), strict=True))
    return law if VS is None else {**law, "VS": VS}


def _excess_velocity(terms: Terms, names: Sequence[str], rows: Array) -> float:
    """Find the Stribeck velocity VS that gives the least sum of squared residuals of a law.

    With e the Stribeck term orthogonal to the other terms, and r the residual of the other terms,
    it reduces the sum of squares by (e'r)^2 / e'e.
    """
    others = _columns(terms, [name for name in names if name not in ("FST", "VS")], None)[rows]
    U, s, _ = np.linalg.svd(others, full_matrices=False)
    Q = U[:, s > s[0] * max(others.shape) * np.finfo(float).eps]
    r = terms.f[rows] - Q @ (Q.T @ terms.f[rows])

    def left(excess: Array) -> Array:
        """Return the change of the sum of squared residuals if the Stribeck term is added.

        The change is zero or negative.

        `excess` has shape (..., N).
        """
        e = excess[..., rows]
        e = e - (e @ Q) @ Q.T
        length = np.sum(e**2, axis=-1)
        taken: Array = np.divide((e @ r) ** 2, length, out=np.zeros_like(length), where=length > 0)
        return -taken

    grid, excesses = terms.grid
    best, step = grid[np.argmin(left(excesses))], grid[1] - grid[0]
    ends = (max(best - step, grid[0]), min(best + step, grid[-1]))
    found = minimize_scalar(
        lambda x: float(left(terms.excess(float(np.exp(x))))),
        bounds=ends,
        method="bounded",
        options={"xatol": 1e-3},
    )
    return float(np.exp(found.x))


def law_torque(terms: Terms, law: Mapping[str, float]) -> Array:
    """Compute the torque of a friction law at all samples, shape (N,), from its parameters."""
    names = tuple(law)
    return np.asarray(
        _columns(terms, names, law.get("VS")) @ [law[name] for name in names if name != "VS"]
    )


def held_out_error(terms: Terms, names: Sequence[str], even: Array) -> float:
    """Compute the prediction error of a friction law, %, on samples not used in its fit.

    The fit to one half of the blocks of time predicts the other half.
    """
    residual = np.empty_like(terms.f)
    for rows in (even, ~even):
        residual[~rows] = (terms.f - law_torque(terms, fit_law(terms, names, rows)))[~rows]
    return percent(residual, terms.f)


def deviations(terms: Terms, law: Mapping[str, float], residual: Array) -> dict[str, float]:
    """Compute the standard deviations of the parameters of a friction law, by name.

    Blocks of time are taken as independent. For VS, the derivative of the law with respect to VS is
    used as its column.
    """
    A = _columns(terms, tuple(law), law.get("VS"))
    if "VS" in law:
        VS, h = law["VS"], 1e-4 * law["VS"]
        A = np.column_stack(
            [A, law["FST"] * (terms.excess(VS + h) - terms.excess(VS - h)) / (2 * h)]
        )
    T = np.linalg.pinv(np.linalg.qr(A, mode="r"))
    blocks = split_rows(np.column_stack([A, residual]), terms.block)
    return dict(
        zip(
            law,
            map(float, np.sqrt(np.diag(block_covariance(blocks, np.zeros(A.shape[1]), T)))),
            strict=True,
        )
    )
