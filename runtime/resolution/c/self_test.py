"""Whether the fused kernels can be had and compute what NumPy computes: every one of them once, on
a small made-up model.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from runtime.model.compile_cache import NotCompiledError
from runtime.model.compiled import CompiledModel, SignalTable
from runtime.resolution.c import kernels as fused
from runtime.settings.study import Decimate, Lowpass
from runtime.settings.study import Signals as SignalSettings
from runtime.signals.filters import decimated, filtered_states

Array = np.ndarray

TOLERANCE = 1e-9  # of the largest value: this looks for wrong code, not for rounding
SETTINGS = SignalSettings(median=1, lowpass=Lowpass(cutoff=8.0), decimate=Decimate(factor=3))
N, RATE = 200, 100.0


@lru_cache(maxsize=1)
def unavailable() -> str:
    """Why the fused kernels cannot be used, empty where they can."""
    try:
        fused.library()
        return (
            ""
            if _agree()
            else f"{fused.SOURCE.name} differs from NumPy; report compiler and processor"
        )
    except (NotCompiledError, OSError) as e:
        return str(e)


def _agree() -> bool:
    """Filtered states and decimated signals of two joints with the signals q1, q2, 1."""
    q = np.cumsum(np.random.default_rng(3).normal(size=(N, 2)), axis=0)
    room, callback = fused.Room(), _SIGNALS(_signals)
    model = _model(cast(int, ctypes.cast(callback, ctypes.c_void_p).value))
    entries = fused.SignalEntries(model, model.BASE_PARAMETERS)
    expected = filtered_states(q, RATE, SETTINGS)
    states = fused.FilteredStates(fused.Positions(q, 1, room), RATE, SETTINGS, room)
    y = fused.decimated(entries, states, slice(0, N), 3, SETTINGS.decimate, np.zeros(1), room)
    u = decimated(np.vstack([expected.q.T, np.ones(N)]), 3, SETTINGS.decimate)
    pairs = [
        (states.rows(slice(0, N)), np.stack([expected.q.T, expected.qd.T, expected.qdd.T])),
        (y, u),
    ]
    return all(
        np.abs(found - right).max() <= TOLERANCE * np.abs(right).max() for found, right in pairs
    )


_SIGNALS = ctypes.CFUNCTYPE(
    ctypes.c_int32,
    ctypes.c_int64,
    *[ctypes.POINTER(ctypes.c_double)] * 3,
    ctypes.c_int64,
    *[ctypes.POINTER(ctypes.c_double)] * 2,
    ctypes.c_int64,
)


def _signals(
    m: int, q: Any, qd: Any, qdd: Any, stride: int, constants: Any, U: Any, ustride: int
) -> int:
    """q1, q2 and 1."""
    for t in range(m):
        U[t], U[ustride + t], U[2 * ustride + t] = q[t], q[stride + t], 1.0
    return 0


def _model(address: int) -> CompiledModel:
    """Gamma_1 = q1 X_1 + X_2, Gamma_2 = -X_2 + q2 X_3."""
    column, row, signal = np.array([0, 1, 1, 2]), np.array([0, 0, 1, 1]), np.array([0, 2, 2, 1])
    table = SignalTable(address, 3, 16, column, row, signal, np.array([1, 1, -1, 1]), signal == 2)
    return cast(
        CompiledModel,
        SimpleNamespace(
            NAME="check", JOINTS=(1, 2), BASE_PARAMETERS=("X1", "X2", "X3"), signals=table
        ),
    )
