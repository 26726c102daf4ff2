"""Limit the processor time of a derivation.

The limit ensures that a command ends with a result or with one sentence for any robot file.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from symgen.errors import SymgenError

SECONDS = 600.0  # of the process; trees of a hundred joints need a tenth of it

_end: ContextVar[tuple[float, str]] = ContextVar("_end", default=(math.inf, ""))


@contextmanager
def limited(what: str) -> Iterator[None]:
    """Limit the processor time of the block: after ten minutes (`SECONDS`), `require_time` raises
    an error.

    what : name of the task for the message, such as "the regrouping of tx40".
    """
    token = _end.set((time.process_time() + SECONDS, what))
    try:
        yield
    finally:
        _end.reset(token)


def require_time() -> None:
    """Raise SymgenError if the present task has used up its processor time."""
    end, what = _end.get()
    if time.process_time() > end:
        raise SymgenError(
            f"{what} takes more than {SECONDS:g} s of processor time and was stopped; write decimal "
            "angles as fractions of pi and use fewer symbols in the frame table, "
            "or divide the robot (convert --chain, --lock)"
        )
