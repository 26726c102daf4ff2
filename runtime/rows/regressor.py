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
from functools import partial
from typing import Any

import numpy as np

from runtime.errors import InputError
from runtime.model.compiled import CompiledSignals
from runtime.model.generated import GeneratedModel, channels_of
from runtime.signals.decimation import PIECE, Plan, decimated_pieces
from runtime.signals.filters import States

Array = np.ndarray

PROBES = 64  # random states that tell signals apart


@dataclass(frozen=True, eq=False)
class Entries:
    """Where the signals stand: model store[k[m], j[m]] = sign[m] * signal[which[m]]; signal s is
    first met at entry source[s].

    row : row of each entry in the wanted store; row = k where every column is wanted.
    place : row of each signal in what the model evaluates: its store, shape (b n, N), or the
        signals of a compiled one.
    """

    row: Array
    k: Array
    j: Array
    which: Array
    sign: Array
    source: Array
    place: Array


def decimated_columns(
    model: GeneratedModel,
    states: States,
    plan: Plan | None,
    constants: Mapping[str, float],
    columns: Sequence[int] | None = None,
    instants: slice = slice(None),
) -> Array:
    """Store of decimated columns, shape (b, n, K): column k of joint j, of the states (N, n) of the
    window.

    plan : of the decimation; None keeps every sample.
    columns : numbers of the columns wanted, in the order wanted; default: all b. Others are not
    filtered.
    instants : those of the K that are stored.
    """
    wanted = (
        np.arange(len(model.BASE_PARAMETERS)) if columns is None else np.asarray(columns, dtype=int)
    )
    entries = distinct_entries(model, constants, wanted)
    signals = decimated_signals(model, entries, constants, plan, states)[:, instants]
    store = np.zeros((len(wanted), len(model.JOINTS), signals.shape[-1]))
    store[entries.row, entries.j] = entries.sign[:, None] * signals[entries.which]
    return store


def decimated_signals(
    model: GeneratedModel,
    entries: Entries,
    constants: Mapping[str, float],
    plan: Plan | None,
    states: States,
) -> Array:
    """The distinct signals of the states (N, n) of the window, decimated, shape (S, K).

    plan : None keeps every sample.
    """
    signals, N = partial(_signals, model, entries, constants, {}), len(states)
    if plan is None:
        blocks = [signals(states[t0 : t0 + PIECE]).copy() for t0 in range(0, N, PIECE)]
        return np.concatenate(blocks, axis=1)
    return decimated_pieces(lambda t0, t1: signals(states[t0:t1]), len(entries.source), plan)


def _signals(
    model: GeneratedModel,
    entries: Entries,
    constants: Mapping[str, float],
    room: dict[int, tuple[Array, Array]],
    states: States,
) -> Array:
    """Distinct signals of the states (B, n), shape (S, B).

    room : what the model evaluates and the signals, by B, which the next call uses again.
    """
    B, compiled = len(states), model if isinstance(model, CompiledSignals) else None
    if B not in room:
        values = model.store(B) if compiled is None else np.empty((compiled.signals.count, B))
        room[B] = values, np.empty((len(entries.place), B))
    values, signals = room[B]
    if compiled is not None:  # without a store
        compiled.signal_rows(states.q, states.qd, states.qdd, values, **constants)
        if np.array_equal(entries.place, np.arange(len(values))):
            return values
    else:
        timed = in_time(model, states)
        try:
            D = model.regressor(states.q, states.qd, states.qdd, out=values, **constants, **timed)
        except ValueError as e:  # what an emitted module of a general loop raises
            raise InputError(
                f"{model.NAME}: {e}; look at units and zeros of the positions, and at the "
                "lengths of the robot file"
            ) from None
        values = D.transpose(2, 1, 0).reshape(-1, B)
    return np.take(values, entries.place, axis=0, out=signals, mode="clip")


def in_time(model: GeneratedModel, states: States) -> dict[str, Any]:
    """The channels that laws of the model read, shape (N,); InputError where the states have
    none.
    """
    channels = channels_of(model)
    if missing := [c for c in channels if c not in states.channels]:
        read = ", ".join(channels[missing[0]])
        raise InputError(
            f"{model.NAME}: {read} read {missing[0]}, which these states do not have; "
            f"name its column, record.columns: {{channels: {{{missing[0]}: COLUMN}}}}, of a whole "
            "record (stream: off)"
        )
    return {c: states.channels[c] for c in channels}


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
    place = k * len(model.JOINTS) + j
    values = _probed(model, constants)[k, j]
    if not np.isfinite(values).all():
        every = np.arange(len(k))
        return Entries(row, k, j, every, np.ones(len(k)), every, place)
    sign = np.where(values[:, 0] < 0, -1.0, 1.0)
    _, source, which = np.unique(
        sign[:, None] * values + 0.0, axis=0, return_index=True, return_inverse=True
    )
    which = which.reshape(-1)
    return Entries(row, k, j, which, sign * sign[source][which], source, place[source])


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
        table.signal[wanted][source],
    )


def _probed(model: GeneratedModel, constants: Mapping[str, float]) -> Array:
    """The store at random states, shape (b, n, PROBES); nan where a loop does not close at one of
    them.
    """
    rng = np.random.default_rng(0)
    q, qd, qdd = rng.uniform(-np.pi, np.pi, (3, PROBES, len(model.JOINTS)))
    timed: dict[str, Any] = {c: rng.uniform(0.5, 2, PROBES) for c in channels_of(model)}
    try:
        with np.errstate(all="ignore"):
            return np.asarray(
                model.regressor(
                    q, qd, qdd, out=model.store(PROBES), **constants, **timed
                ).transpose(2, 1, 0)
            )
    except ValueError:  # what an emitted module of a general loop raises
        return np.full((len(model.BASE_PARAMETERS), len(model.JOINTS), PROBES), np.nan)
