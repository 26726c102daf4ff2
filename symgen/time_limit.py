"""A limit on the processor time of a derivation: whatever a robot file holds, a command ends with a result or with one sentence."""

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
    """Let `require_time` raise after SECONDS of processor time. what : what is being done, "the
    regrouping of tx40".
    """
    token = _end.set((time.process_time() + SECONDS, what))
    try:
        yield
    finally:
        _end.reset(token)


def require_time() -> None:
    """Raise SymgenError if the time of what is being done has passed."""
    end, what = _end.get()
    if time.process_time() > end:
        raise SymgenError(
            f"{what} takes more than {SECONDS:g} s of processor time and was ended; write decimal "
            "angles as fractions of pi and let fewer symbols "
            "into the frame table, or divide the robot (convert --chain, --lock)"
        )
