"""The columns of W, decimated: only the entries of the regressor that are not identically zero, and
equal ones once.

Most entries of W are structurally zero or repeat each other up to the sign, and decimation is
linear: filter
the signals, then place them. The regressor is evaluated in blocks on one reused store and decimated
block by block: the signals are not stored.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.errors import InputError
from runtime.model.compiled import CompiledSignals
from runtime.model.generated import GeneratedModel
from runtime.signals.decimation import Decimation, Plan
from runtime.signals.filters import States

Array = np.ndarray

# samples evaluated at a time: those that an emitted module takes at once, whose rows stay in cache
BLOCK = 4096
PROBES = 64  # random states that tell signals apart


@dataclass(frozen=True, eq=False)
class Entries:
    """Where the signals stand: model store[k[m], j[m]] = sign[m] * signal[which[m]]; signal s is
    first met at entry source[s].

    row : row of each entry in the wanted store; row = k where every column is wanted.
    """

    row: Array
    k: Array
    j: Array
    which: Array
    sign: Array
    source: Array


def decimated_columns(
    model: GeneratedModel,
    states: States,
    plan: Plan | None,
    constants: Mapping[str, float],
    columns: Sequence[int] | None = None,
) -> Array:
    """Store of decimated columns, shape (b, n, K): column k of joint j, of the states (N, n) of the
    window.

    plan : of the decimation; None keeps every sample.
    columns : numbers of the columns wanted, in the order wanted; default: all b. Others are not
    filtered.
    """
    wanted = (
        np.arange(len(model.BASE_PARAMETERS)) if columns is None else np.asarray(columns, dtype=int)
    )
    entries = distinct_entries(model, constants, wanted)
    signals = DecimatedSignals(model, entries, constants, plan)(states)
    store = np.zeros((len(wanted), len(model.JOINTS), signals.shape[-1]))
    store[entries.row, entries.j] = entries.sign[:, None] * signals[entries.which]
    return store


class DistinctSignals:
    """The distinct signals of a regressor, in room that the next call uses again."""

    def __init__(
        self, model: GeneratedModel, entries: Entries, constants: Mapping[str, float]
    ) -> None:
        self.model, self.constants = model, constants
        self.rows = (entries.k * len(model.JOINTS) + entries.j)[entries.source]
        self.numbers = (
            _numbers(model, entries) if isinstance(model, CompiledSignals) else None
        )  # in the C file; None: its order, or NumPy
        self._room: dict[int, tuple[Array, Array]] = {}  # by number of samples: store, signals

    def __call__(self, states: States) -> Array:
        """Signals of the states (B, n), shape (S, B)."""
        B = len(states)
        if isinstance(self.model, CompiledSignals):
            return self._in_c(self.model, states)
        if B not in self._room:
            self._room[B] = self.model.store(B), np.empty((len(self.rows), B))
        out, signals = self._room[B]
        try:
            D = self.model.regressor(states.q, states.qd, states.qdd, out=out, **self.constants)
        except ValueError as e:  # what an emitted module of a general loop raises
            raise InputError(
                f"{self.model.NAME}: {e}; look at units and zeros of the positions, and at the "
                "lengths of the robot file"
            ) from None
        return np.take(
            D.transpose(2, 1, 0).reshape(-1, B), self.rows, axis=0, out=signals, mode="clip"
        )

    def _in_c(self, model: CompiledSignals, states: States) -> Array:
        """The same from a compiled model, which gives them without a store."""
        B = len(states)
        if B not in self._room:
            self._room[B] = np.empty((model.signals.count, B)), np.empty((len(self.rows), B))
        every, signals = self._room[B]
        model.signal_rows(states.q, states.qd, states.qdd, every, **self.constants)
        return (
            every
            if self.numbers is None
            else np.take(every, self.numbers, axis=0, out=signals, mode="clip")
        )


class DecimatedSignals:
    """The distinct signals, decimated; room is kept from one call to the next. plan : None keeps
    every sample.
    """

    def __init__(
        self,
        model: GeneratedModel,
        entries: Entries,
        constants: Mapping[str, float],
        plan: Plan | None,
    ) -> None:
        self.signals = DistinctSignals(model, entries, constants)
        self.decimation = None if plan is None else Decimation(plan, len(entries.source))

    def __call__(self, states: States) -> Array:
        """Signals of the states (N, n) of the window, shape (S, K)."""
        if self.decimation is None:
            blocks = [
                self.signals(states[t0 : t0 + BLOCK]).copy() for t0 in range(0, len(states), BLOCK)
            ]
            return np.concatenate(blocks, axis=1)
        for t0, t1 in self.decimation.plan.pieces(BLOCK):
            self.decimation.take(self.signals(states[t0:t1]), t0)
        return self.decimation.result()


def distinct_entries(
    model: GeneratedModel, constants: Mapping[str, float], columns: Array | None = None
) -> Entries:
    """Entries of STRUCTURE in the columns (default: all) grouped by equal values, up to the sign,
    at random states.

    The emitted text copies equal rows, so equal signals agree in every bit; different ones do not
    agree at 64 random states. Where the random
    states are out of reach (loops that do not close), every entry stands for itself.
    """
    columns = np.arange(len(model.BASE_PARAMETERS)) if columns is None else columns
    if isinstance(model, CompiledSignals):
        return _entries_in_c(model, columns)
    row, j = np.nonzero(np.asarray(model.STRUCTURE)[columns])
    k = columns[row]
    values = _probed(model, constants)[k, j]
    if not np.isfinite(values).all():
        every = np.arange(len(k))
        return Entries(row, k, j, every, np.ones(len(k)), every)
    sign = np.where(values[:, 0] < 0, -1.0, 1.0)
    _, source, which = np.unique(
        sign[:, None] * values + 0.0, axis=0, return_index=True, return_inverse=True
    )
    which = which.reshape(-1)
    return Entries(row, k, j, which, sign * sign[source][which], source)


def _entries_in_c(model: CompiledSignals, columns: Array) -> Entries:
    """The same of a compiled model, whose C file says which entries are equal."""
    table = model.signals
    order = np.argsort(columns)
    place = np.searchsorted(columns[order], table.column).clip(max=len(columns) - 1)
    wanted = np.flatnonzero(columns[order][place] == table.column)
    _, source, which = np.unique(table.signal[wanted], return_index=True, return_inverse=True)
    return Entries(
        order[place[wanted]],
        table.column[wanted],
        table.row[wanted],
        which.reshape(-1),
        table.sign[wanted].astype(float),
        source,
    )


def _numbers(model: CompiledSignals, entries: Entries) -> Array | None:
    """Number of each signal in the C file; None where all of them are wanted, in its order."""
    table, n = model.signals, len(model.JOINTS)
    number = dict(zip((table.column * n + table.row).tolist(), table.signal.tolist(), strict=True))
    numbers = [number[place] for place in (entries.k * n + entries.j)[entries.source].tolist()]
    return None if numbers == list(range(table.count)) else np.array(numbers, dtype=np.intp)


def _probed(model: GeneratedModel, constants: Mapping[str, float]) -> Array:
    """The store at random states, shape (b, n, PROBES); nan where a loop does not close at one of
    them.
    """
    q, qd, qdd = np.random.default_rng(0).uniform(-np.pi, np.pi, (3, PROBES, len(model.JOINTS)))
    try:
        with np.errstate(all="ignore"):
            return np.asarray(
                model.regressor(q, qd, qdd, out=model.store(PROBES), **constants).transpose(2, 1, 0)
            )
    except ValueError:  # what an emitted module of a general loop raises
        return np.full((len(model.BASE_PARAMETERS), len(model.JOINTS), PROBES), np.nan)
