"""The C kernels of resolution studies (kernels.c), compiled on first use: filters, decimation and
least squares around the signals of a robot in C.

    FilteredStates(positions, rate, signals, room)
            as runtime.signals.filters.filtered_states, of Positions(q, window, room)
    SignalEntries(model, names)
            which signals stand where in the wanted columns, and the factor that they make
    decimated(entries, states, samples, ...)
            kept samples of the wanted signals; the signals are not stored

The same matrices and the same order of operations as the NumPy path where that costs nothing:
filtered states agree with scipy's in every bit on
x86-64, the rest to rounding. Nothing is allocated in C; `Room` holds what calls reuse, one for each
thread.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgeqrf
from scipy.signal import sosfilt_zi

from runtime.errors import InputError
from runtime.model.compile_cache import FLAGS, NotCompiledError, shared_object
from runtime.model.compiled import CompiledSignals
from runtime.model.loading import cache_folder
from runtime.resolution.c.folding import STATE, folding_of
from runtime.rows.factor import Factor, JointFactor
from runtime.settings.study import Decimate, Lowpass
from runtime.settings.study import Signals as SignalSettings
from runtime.signals.filters import (
    States,
    butterworth,
    decimation_plan,
    median_filtered,
    require_longer,
)

Array = np.ndarray

SOURCE = Path(__file__).with_name("kernels.c")
FUSED_FLAGS = tuple(
    {"-O2": "-O3", "-ffp-contract=off": "-ffp-contract=fast"}.get(flag, flag) for flag in FLAGS
)
ABI = 4
LANES = 8  # of kernels.c; 1 without vector types
# most samples of signals evaluated together, except where one block is longer: these stay in cache
TOGETHER = 640
REFUSALS = {
    1: "arguments that do not fit each other",
    2: "a block that the signals of the robot refuse",
}


def _fields(numbers: str = "", pointers: str = "") -> list[tuple[str, Any]]:
    """Fields of a structure: int64 numbers, then pointers."""
    return [(name, ctypes.c_int64) for name in numbers.split()] + [
        (name, ctypes.c_void_p) for name in pointers.split()
    ]


class LowpassStructure(ctypes.Structure):
    """struct lowpass."""

    _fields_ = _fields("sections pad", "sos zi")


class StatesStructure(ctypes.Structure):
    """struct states."""

    _fields_ = [
        *_fields("N n pad ends"),
        ("rate", ctypes.c_double),
        ("step", ctypes.c_double),
        ("on_q", LowpassStructure),
        ("on_qd", LowpassStructure),
        *_fields(pointers="given up q qd qdd"),
    ]


class SourceStructure(ctypes.Structure):
    """struct source."""

    _fields_ = [
        *_fields(pointers="signals constants"),
        *_fields("count S tile length stride", "wanted U rows u"),
    ]


class DecimationStructure(ctypes.Structure):
    """struct decimation."""

    _fields_ = [
        *_fields("begin N phase factor G blocks most first final rest ystride"),
        ("direct", ctypes.c_double),
        *_fields(pointers="modes pairs start back end d x y"),
    ]


STRUCTURES = (StatesStructure, SourceStructure, DecimationStructure)


@lru_cache(maxsize=4)
def library(folder: Path | None = None) -> ctypes.CDLL:
    """kernels.c, from the cache or compiled; NotCompiledError or OSError where it cannot be had."""
    return shared_object(
        SOURCE, SOURCE.read_bytes(), folder or cache_folder(), _opened, FUSED_FLAGS
    )


def _opened(path: Path) -> ctypes.CDLL:
    """The object, if it has this interface."""
    opened = ctypes.CDLL(str(path))
    layout = (ctypes.c_int64 * 4)()
    try:
        opened.fused_abi.restype = ctypes.c_int32
        abi = opened.fused_abi()
        opened.fused_layout.restype = None
        opened.fused_layout(layout)
        for name in ("states", "gather", "decimated"):
            getattr(opened, f"fused_{name}").restype = ctypes.c_int32
    except AttributeError as e:
        raise NotCompiledError(f"{SOURCE.name} is not the one of this version: {e}") from e
    expected = [*map(ctypes.sizeof, STRUCTURES)]
    if abi != ABI or layout[0] not in (1, LANES) or list(layout[1:]) != expected:
        raise NotCompiledError(
            f"{SOURCE.name} has interface {abi} and sizes {list(layout)}, expected {ABI} and "
            f"{[LANES, *expected]}"
        )
    return opened


class Room:
    """Arrays that calls reuse, by name: a fresh one costs more than what is computed in it. One
    Room for each thread.
    """

    def __init__(self) -> None:
        self._arrays: dict[str, Array] = {}

    def array(self, name: str, *shape: int, dtype: Any = float) -> Array:
        """An array of this shape, not initialised, on a 64-byte boundary: the one given under this
        name before, where it fits.
        """
        array = self._arrays.get(name)
        if array is None or array.shape != shape:
            size = int(np.prod(shape)) * np.dtype(dtype).itemsize
            raw = np.empty(size + 64, dtype=np.uint8)
            start = -raw.ctypes.data % 64
            array = self._arrays[name] = raw[start : start + size].view(dtype).reshape(shape)
        return array


def address(x: Array) -> int:
    """Where the numbers lie. Keep the array for as long as C may read it."""
    return int(x.ctypes.data)


def call(name: str, *arguments: Any) -> None:
    """fused_NAME of the C file; InputError where it refuses."""
    status = getattr(library(), f"fused_{name}")(*arguments)
    if status:
        raise InputError(
            f"fused_{name} in C refused {REFUSALS.get(status, f'its arguments with {status}')}"
        )


@lru_cache(maxsize=8)
def _lowpass(low: Lowpass | None, name: str, rate: float) -> tuple[LowpassStructure, Array, Array]:
    """Filter of one signal, and the arrays it points to; no sections where the signal is not
    filtered.
    """
    if low is None or name not in low.on:
        return LowpassStructure(0, 0, None, None), np.empty(0), np.empty(0)
    sos, pad = butterworth(rate, low)
    sos, zi = np.ascontiguousarray(sos), np.ascontiguousarray(sosfilt_zi(sos))
    return LowpassStructure(len(sos), pad, address(sos), address(zi)), sos, zi


class Positions:
    """Positions as C reads them: joints side by side in groups of LANES, the last group filled up
    with zeros.

    Parameters
    ----------
    q : ndarray, shape (N, n), rad or m
    window : int
        Samples of the running median.
    room : Room
        Arrays that calls reuse: the next positions in this room take the place of these.
    """

    def __init__(self, q: Array, window: int, room: Room) -> None:
        self.N, self.n = q.shape
        self.lanes = room.array("given", -(-self.n // LANES), self.N, LANES)
        side_by_side(median_filtered(q, window), self.lanes)


def side_by_side(x: Array, lanes: Array) -> None:
    """Columns of x, shape (N, n), into groups of LANES, shape (groups, N, LANES)."""
    lanes[-1] = 0
    for j, group in zip(range(0, x.shape[1], LANES), lanes, strict=True):
        group[:, : x.shape[1] - j] = x[:, j : j + LANES]


class FilteredStates:
    """q, qd, qdd of measured positions: low-pass, difference, low-pass, difference. As C keeps
    them, in `room`.

    Parameters
    ----------
    positions : Positions
    rate : float, Hz
    signals : SignalSettings
    room : Room
    up : ndarray of uint8, optional
        Bits as `runtime.resolution.rounding.packed_bits` gives them: bit t*n + j moves position t
        of joint j, by +step where it is 1, else by -step.
    step : float, rad or m
    """

    def __init__(
        self,
        positions: Positions,
        rate: float,
        signals: SignalSettings,
        room: Room,
        *,
        up: Array | None = None,
        step: float = 0.0,
    ) -> None:
        self.N, self.n = positions.N, positions.n
        (on_q, *_), (on_qd, *_) = (_lowpass(signals.lowpass, name, rate) for name in ("q", "qd"))
        pad, ends = max(on_q.pad, on_qd.pad), 1 if signals.ends == "one-sided" else 2
        require_longer(self.N, max(pad, ends))
        if up is not None and up.size <= -(-self.N * self.n // 8):
            raise InputError(
                f"{up.size} bytes for {self.N * self.n} bits; expected one byte more than these "
                "fill"
            )
        lanes = room.array("lanes", 3, len(positions.lanes), self.N + 2 * pad, LANES)
        pointers = (
            address(positions.lanes),
            None if up is None else address(up),
            *map(address, lanes),
        )
        self.lanes, self.structure = (
            lanes,
            StatesStructure(self.N, self.n, pad, ends, rate, step, on_q, on_qd, *pointers),
        )
        call("states", ctypes.byref(self.structure))

    def rows(self, samples: slice) -> Array:
        """q, qd, qdd of these samples, shape (3, n, samples)."""
        m = samples.stop - samples.start
        states = np.empty((3, self.n, m))
        pointers = [ctypes.c_void_p(address(x)) for x in states]
        call(
            "gather",
            ctypes.byref(self.structure),
            *map(ctypes.c_int64, (samples.start, m)),
            *pointers,
            ctypes.c_int64(m),
        )
        return states


class GivenStates(FilteredStates):
    """q, qd, qdd as they are, shape (N, n) each, as C keeps them, in `room`."""

    def __init__(self, states: States, room: Room) -> None:
        self.N, self.n = states.q.shape
        self.lanes = room.array("lanes", 3, -(-self.n // LANES), self.N, LANES)
        for x, lanes in zip((states.q, states.qd, states.qdd), self.lanes, strict=True):
            side_by_side(x, lanes)
        q, qd, qdd = map(address, self.lanes)
        self.structure = StatesStructure(self.N, self.n, q=q, qd=qd, qdd=qdd)  # without padding


class SignalEntries:
    """Where the signals of a robot stand in the columns `names`: entry e of joint j is
    sign[e]*U[wanted[number[e]]], start[j] <= e < start[j + 1].

    Attributes
    ----------
    columns : tuple of ndarray
        By joint, positions in `names` of its entries; `place` the same by entry.
    wanted : ndarray
        Signals that occur.
    whole_groups : ndarray
        The same, the last one repeated up to a multiple of LANES.
    number : ndarray
        Position in `wanted` of the signal of each entry.
    table : SignalTable
        Function that gives the wanted signals.
    """

    def __init__(self, model: CompiledSignals, names: Sequence[str]) -> None:
        unknown = [name for name in names if name not in model.BASE_PARAMETERS]
        if unknown:
            raise InputError(
                f"no column {', '.join(unknown)}; {model.NAME} has "
                f"{', '.join(model.BASE_PARAMETERS)}"
            )
        table, n = model.signals, len(model.JOINTS)
        place = np.array(
            [
                {name: k for k, name in enumerate(names)}.get(name, -1)
                for name in model.BASE_PARAMETERS
            ]
        )[table.column]
        order = np.lexsort((place, table.row))
        order = order[place[order] >= 0]
        self.model, self.names, self.n = model, tuple(names), n
        self.start = np.concatenate(
            [[0], np.cumsum(np.bincount(table.row[order], minlength=n))]
        ).astype(np.int32)
        self.columns = tuple(place[order][self.start[j] : self.start[j + 1]] for j in range(n))
        self.place: Array = place[order]
        self.sign = np.ascontiguousarray(table.sign[order], dtype=float)
        self.wanted, number = np.unique(table.signal[order].astype(np.int32), return_inverse=True)
        self.whole_groups = np.pad(self.wanted, (0, -len(self.wanted) % LANES), mode="edge")
        self.number: Array = number.reshape(-1).astype(np.int32)
        self.table = (
            table if len(self.wanted) == table.count else model.signals_alone(self.wanted.tolist())
        )

    def factor(self, parts: Sequence[tuple[Array, Array, Array]]) -> Factor:
        """Triangular factor of [W Y] of decimated signals.

        parts : of each record the signals y, shape (S, K), as `decimated` gives them; torques Y,
        shape (n, K), N m (N); mask, bool, shape (n, K), of the rows used.
        """
        joints = []
        for j, (a, b) in enumerate(pairwise(self.start)):
            blocks = [
                np.vstack([self.sign[a:b, None] * y[self.number[a:b]], Y[j]])[:, mask[j]]
                for y, Y, mask in parts
            ]
            rows = np.hstack(blocks)  # of [W_j Y_j]', which LAPACK factors in place
            R = dgeqrf(rows.T, overwrite_a=1)[0][: len(rows)]
            joints.append(JointFactor(self.columns[j], np.triu(R), rows.shape[1]))
        return Factor.of(self.names, joints)


def decimated(
    entries: SignalEntries,
    states: FilteredStates,
    samples: slice,
    factor: int,
    settings: Decimate | None,
    constants: Array,
    room: Room,
) -> Array:
    """The kept samples of the wanted signals, shape (S, K): row i is signal entries.wanted[i].

    samples : those used of the states.   constants : of `CompiledSignals.constant_values`.
            The result is one of `room`.
    """
    p = decimation_plan(samples.stop - samples.start, factor, settings)
    if p is None:
        return _every_sample(entries, states, samples, constants, room)
    table, folding, wanted = entries.table, folding_of(p), entries.whole_groups
    S = len(wanted)
    most = _blocks_together(p.L, table.tile)
    length = max(len(p.X0), len(p.A), p.L * most)
    U, rows = room.array("U", table.count, table.tile), room.array("rows", 3, states.n, table.tile)
    u = room.array("u", S, length + 2 * LANES)
    y, d, x = (
        room.array("y", S, p.K),
        room.array("d", p.blocks, S, 2 * STATE),
        room.array("x", S, STATE),
    )
    numbers = table.count, S, table.tile, length, u.shape[1]
    source = SourceStructure(
        table.address,
        address(constants),
        *numbers,
        *map(address, (wanted, U, rows)),
        address(u) + 8 * LANES,
    )
    sizes = p.blocks, most, len(p.X0), len(p.A), p.K - p.blocks * p.G, p.K
    pointers = map(address, (*folding.matrices, d, x, y))
    plan = DecimationStructure(
        samples.start, p.N, p.phase, p.factor, p.G, *sizes, folding.direct, *pointers
    )
    call("decimated", *map(ctypes.byref, (states.structure, source, plan)))
    return y[: len(entries.wanted)]


def _blocks_together(L: int, tile: int) -> int:
    """Blocks of L samples evaluated together: those that fill the tiles best, up to TOGETHER
    samples.
    """
    return min(range(1, max(1, TOGETHER // L) + 1), key=lambda k: (-k * L % tile) / (k * L))


def _every_sample(
    entries: SignalEntries, states: FilteredStates, samples: slice, constants: Array, room: Room
) -> Array:
    """The wanted signals at all samples, shape (S, N)."""
    N, table = samples.stop - samples.start, entries.table
    U, rows = room.array("every", table.count, N), states.rows(samples)
    pointers = [ctypes.c_void_p(address(x)) for x in (*rows, constants, U)]
    size = ctypes.c_int64(N)
    if ctypes.CFUNCTYPE(ctypes.c_int32)(table.address)(
        size, *pointers[:3], size, *pointers[3:], size
    ):
        raise InputError(f"{entries.model.NAME}: its signals in C refused {N} samples")
    return np.take(
        U, entries.wanted, axis=0, out=room.array("y", len(entries.wanted), N), mode="clip"
    )
