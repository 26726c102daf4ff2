"""Decimated columns of W: entries that are always zero are skipped, equal ones computed once.

Most entries of W are structurally zero or repeat each other up to the sign, and decimation is
linear. Therefore only the distinct signals are filtered and then copied to their entries of W. The
distinct signals are evaluated in pieces of samples, by the operations of the module that they need
(`runtime.core.rows.tape`), and decimated piece by piece, so that they are never stored whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np

from runtime.core.model import GeneratedModel, channels_of
from runtime.core.rows.observation import column_numbers
from runtime.core.rows.streamed import Entries
from runtime.core.rows.tape import Tape, recorded
from runtime.core.signals.decimation import PART, PIECE, Plan, copy_overlap, decimated_parts
from runtime.core.signals.filters import States
from runtime.ground.errors import InputError

Array = np.ndarray

PROBES = 64  # random states that tell signals apart


class Columns:
    """Evaluator of the columns of the observation matrix W of one model, for all its records.

    Parameters
    ----------
    model : GeneratedModel
    names : sequence of str, optional
        Base parameters of the columns wanted, in the order wanted; default: all b. Other columns
        are not filtered.
    """

    def __init__(
        self,
        model: GeneratedModel,
        names: Sequence[str] | None = None,
    ) -> None:
        self.model = model
        self.names = tuple(model.BASE_PARAMETERS) if names is None else tuple(names)
        self._signals: dict[int, Array] = {}
        self._stores: dict[int, Array] = {}

    @cached_property
    def entries(self) -> Entries:
        """Table of the nonzero regressor entries of these columns, with equal entries marked."""
        numbers = np.array(column_numbers(self.names, self.model.BASE_PARAMETERS), dtype=int)
        return distinct_entries(self.model, numbers)

    @cached_property
    def tape(self) -> Tape | None:
        """Recorded operations that compute the regressor entries; None if recording them failed."""
        n = len(self.model.JOINTS)
        return recorded(self.model, [divmod(int(place), n) for place in self.entries.place])

    def decimated(self, states: States, plan: Plan | None, instants: slice = slice(None)) -> Array:
        """Compute the decimated columns of W, shape (b, n, K), from states in the time window.

        Entry [k, j] has column k in the rows of joint j. The states have shape (N, n).

        plan : plan of the decimation; None keeps every sample.
        instants : which of the K instants are stored.
        """
        entries = self.entries
        first, last, _ = instants.indices(len(states) if plan is None else plan.K)
        store = np.zeros((len(self.names), len(self.model.JOINTS), last - first))
        for part, signals in self.signals(states, plan):
            a, b = max(part.start, first), min(part.stop, last)
            if a < b:
                values = signals[entries.which, a - part.start : b - part.start]
                store[entries.row, entries.j, a - first : b - first] = (
                    entries.sign[:, None] * values
                )
        return store

    def read(
        self, states: States, plan: Plan | None, instants: slice
    ) -> Callable[[int, int], Array]:
        """Return a function that gives the distinct entries of W at the instants [a, b).

        The parameters are those of `decimated`; the instants count from the first of `instants`.
        Decimated entries are kept, those of every sample are computed when they are asked for.
        """
        first, last, _ = instants.indices(len(states) if plan is None else plan.K)
        if plan is None:
            return partial(self._between, states[first:last])
        kept = np.empty((len(self.entries.place), last - first))
        for part, signals in self.signals(states, plan, PIECE):
            copy_overlap(signals, part.start, kept, first)
        return lambda a, b: kept[:, a:b]

    def _between(self, states: States, a: int, b: int) -> Array:
        return self._evaluated(states[a:b])

    def signals(
        self, states: States, plan: Plan | None, most: int = PART
    ) -> Iterator[tuple[slice, Array]]:
        """Yield the distinct entries of W, decimated, one slice of the kept samples at a time.

        The shape is (S, instants). An array is valid until the next array is requested.

        plan : plan of the decimation; None keeps every sample. most : kept samples of a slice.
        """
        if plan is not None:
            yield from decimated_parts(
                lambda t0, t1: self._evaluated(states[t0:t1]), len(self.entries.place), plan, most
            )
            return
        for t0 in range(0, len(states), PIECE):
            t1 = min(t0 + PIECE, len(states))
            yield slice(t0, t1), self._evaluated(states[t0:t1])

    def _evaluated(self, states: States) -> Array:
        """Compute the S distinct entries of the regressor at B given states, shape (S, B).

        The array is valid until the next call.
        """
        B = len(states)
        if B not in self._signals:
            self._signals[B] = np.empty((len(self.entries.place), B))
        signals = self._signals[B]
        if self.tape is not None:
            return self.tape.evaluate(states.q, states.qd, states.qdd, signals)
        if B not in self._stores:
            self._stores[B] = self.model.store(B)
        store = self._stores[B]
        timed = in_time(self.model, states)
        try:
            D = self.model.regressor(states.q, states.qd, states.qdd, out=store, **timed)
        except ValueError as e:  # what an emitted module of a general loop raises
            raise InputError(
                f"{self.model.NAME}: {e}; check units and zeros of the positions, and the "
                "lengths in the robot file"
            ) from None
        rows = D.transpose(2, 1, 0).reshape(-1, B)
        return np.take(rows, self.entries.place, axis=0, out=signals, mode="clip")


def in_time(model: GeneratedModel, states: States) -> dict[str, Any]:
    """Return the recorded signals that the model needs, such as a temperature, by name, shape (N,).

    Raise InputError if the states lack one of these signals.
    """
    channels = channels_of(model)
    if missing := [c for c in channels if c not in states.channels]:
        read = ", ".join(channels[missing[0]])
        raise InputError(
            f"{model.NAME}: the laws of {read} need the signal {missing[0]}, which is not given; "
            f"give its column in record.columns: {{channels: {{{missing[0]}: COLUMN}}}}"
        )
    return {c: states.channels[c] for c in channels}


def distinct_entries(model: GeneratedModel, columns: Array | None = None) -> Entries:
    """Group the regressor entries that are equal up to sign, by their values at random states.

    The attribute STRUCTURE of the model marks the entries that are not identically zero. The
    emitted text copies equal rows, so equal entries agree in every bit; different entries do not
    agree at 64 random states. If random states are out of reach (loops that do not close), each
    entry is its own signal.

    columns : numbers of the columns; default: all.
    """
    columns = np.arange(len(model.BASE_PARAMETERS)) if columns is None else columns
    row, j = np.nonzero(np.asarray(model.STRUCTURE)[columns])
    k = columns[row]
    place = k * len(model.JOINTS) + j
    values = _probed(model)[k, j]
    if not np.isfinite(values).all():
        return Entries(row, j, np.arange(len(k)), np.ones(len(k)), place)
    sign = np.where(values[:, 0] < 0, -1.0, 1.0)
    _, source, which = np.unique(
        sign[:, None] * values + 0.0, axis=0, return_index=True, return_inverse=True
    )
    which = which.reshape(-1)
    return Entries(row, j, which, sign * sign[source][which], place[source])


def _probed(model: GeneratedModel) -> Array:
    """Evaluate the regressor at m random states, shape (b, n, m).

    The result is nan if a loop does not close at one of the states.
    """
    rng = np.random.default_rng(0)
    q, qd, qdd = rng.uniform(-np.pi, np.pi, (3, PROBES, len(model.JOINTS)))
    timed: dict[str, Any] = {c: rng.uniform(0.5, 2, PROBES) for c in channels_of(model)}
    try:
        with np.errstate(all="ignore"):
            return np.asarray(
                model.regressor(q, qd, qdd, out=model.store(PROBES), **timed).transpose(2, 1, 0)
            )
    except ValueError:  # what an emitted module of a general loop raises
        return np.full((len(model.BASE_PARAMETERS), len(model.JOINTS), PROBES), np.nan)
