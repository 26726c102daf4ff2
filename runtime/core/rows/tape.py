"""Recording of the operations by which an emitted module computes its regressor D.

    tape = recorded(model, [(k, j), ...])       # entries of D, column k, joint j
    tape.evaluate(q, qd, qdd, out)              # out, shape (S, B)

An emitted module writes D by operations on whole rows. The operations are recorded once, by calling
the module with rows that remember every operation. An operation that no wanted entry needs is left
out, and a row is overwritten once no later operation uses it, so that all rows stay in the cache.
The remaining operations are repeated in the order of the module: the results agree with those of
the module in every bit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from inspect import signature
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from runtime.core.model import GeneratedModel, channels_of

Array = np.ndarray

STATES = ("q", "qd", "qdd")
POWERS = {2: np.square, 0.5: np.sqrt, -1: np.reciprocal}
"""What NumPy does for a power of an array."""


class NotRecordedError(Exception):
    """Error: an emitted module does more than arithmetic, so its regressor cannot be recorded."""


@dataclass(eq=False)
class Row(NDArrayOperatorsMixin):
    """A symbolic signal that records its computation: an input q, qd, qdd or an operation.

    function : None for a state, whose arguments are its array (0 for q) and its joint.
    """

    function: np.ufunc | None
    arguments: tuple[Any, ...]

    def __array_ufunc__(self, function: np.ufunc, method: str, *arguments: Any) -> Row:
        """Record a function of NumPy that is called with rows; operators call it too."""
        if function is np.power and arguments[1] in POWERS:
            return Row(POWERS[arguments[1]], arguments[:1])
        return Row(function, arguments)

    def __array_function__(self, function: Any, *called: Any) -> Any:
        raise NotRecordedError(f"{function.__name__} is no operation on the elements of signals")

    def __bool__(self) -> bool:
        raise NotRecordedError("the function branches on the value of a signal")


class Tape:
    """The list of operations that compute selected entries of the regressor D.

    Parameters
    ----------
    entries : sequence of Row or float
    n : int
        Number of joints.
    """

    def __init__(self, entries: Sequence[Row | float], n: int) -> None:
        self.entries = entries
        self.n = n
        self.operations = in_order(entries)
        self._rooms: dict[int, tuple[Array, list[Any], list[Any]]] = {}

    def evaluate(self, q: Array, qd: Array, qdd: Array, out: Array) -> Array:
        """Compute S entries of the regressor D at B states into the array `out`, shape (S, B)."""
        B = len(q)
        if B not in self._rooms:
            self._rooms[B] = self._bound(B)
        states, operations, entries = self._rooms[B]
        for rows, x in zip(states, (q, qd, qdd), strict=True):
            rows[:] = x.T
        for function, arguments, row in operations:
            function(*arguments, out=row)
        for row, entry in zip(out, entries, strict=True):
            row[:] = entry
        return out

    def _bound(self, B: int) -> tuple[Array, list[Any], list[Any]]:
        """Allocate arrays of B samples for the states and for the results of all operations.

        Returns the rows of the states, the operations with their rows, and the rows of the entries.
        A row that no later operation needs is overwritten.
        """
        states = np.empty((len(STATES), self.n, B))
        rows: dict[int, Array] = {}

        def bound(x: Any) -> Any:
            if not isinstance(x, Row):
                return x
            return states[x.arguments] if x.function is None else rows[id(x)]

        read = Counter(id(x) for x in self.entries)
        for row in self.operations:
            read.update({id(x) for x in row.arguments})
        operations = []
        free: list[Array] = []
        for row in self.operations:
            arguments = [bound(x) for x in row.arguments]
            for key in {id(x) for x in row.arguments}:
                read[key] -= 1
                if read[key] == 0 and key in rows:
                    free.append(rows[key])
            rows[id(row)] = free.pop() if free else np.empty(B)
            operations.append((row.function, arguments, rows[id(row)]))
        return states, operations, [bound(x) for x in self.entries]


def in_order(entries: Sequence[Row | float]) -> list[Row]:
    """List the operations that compute the entries, each one after the operations it depends on."""
    order: list[Row] = []
    done: set[int] = set()
    stack = _operations(entries)
    while stack:
        row = stack[-1]
        waiting = [x for x in _operations(row.arguments) if id(x) not in done]
        if waiting and id(row) not in done:
            stack += waiting
            continue
        stack.pop()
        if id(row) not in done:
            done.add(id(row))
            order.append(row)
    return order


def _operations(values: Sequence[Any]) -> list[Row]:
    return [x for x in values if isinstance(x, Row) and x.function is not None]


def recorded(model: GeneratedModel, places: Sequence[tuple[int, int]]) -> Tape | None:
    """Record the operations by which an emitted module computes given entries of its regressor D.

    Returns None if the module does more than operations on rows, or depends on measured functions
    of time.
    """
    block = getattr(model, "_regressor_block", None)
    n = len(model.JOINTS)
    states = {name: [Row(None, (i, j)) for j in range(n)] for i, name in enumerate(STATES)}
    if block is None or channels_of(model):
        return None
    table: dict[tuple[int, int], Any] = {}
    known: dict[str, Any] = {**model.CONSTANTS, **states, "xp": np, "D": table}
    names = tuple(signature(block).parameters)
    if not known.keys() >= set(names):
        return None
    try:
        block(*(known[name] for name in names))
    except (NotRecordedError, AttributeError, TypeError, ValueError):
        return None
    constant = model.store(1)
    return Tape([table.get(place, float(constant[(*place, 0)])) for place in places], n)
