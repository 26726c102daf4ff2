"""Messages about the progress of long work, by the logger "runtime.ground.progress", level INFO.

    logging.getLogger("runtime.ground.progress").setLevel(logging.INFO)

A handler is needed too; `symgen` has one, which prints the messages after two seconds.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

LOGGER = logging.getLogger("runtime.ground.progress")


@dataclass
class Work:
    """Count of the finished parts of long work; their number is not known in advance.

    Attributes
    ----------
    tell : callable, optional
        Called with the number of finished parts, and of all parts as far as they are expected.
    later : int
        Expected parts of the stages to come.
    left : int
        Expected parts of this stage that are not finished.
    done : int
        Finished parts.
    """

    tell: Callable[[int, int], None] | None = None
    later: int = 0
    left: int = 0
    done: int = 0

    def begin(self, parts: int) -> None:
        """Begin a stage that has `parts` of the parts expected later."""
        self.later, self.left = self.later - parts, parts
        self.advance(0)

    def advance(self, parts: int = 1) -> None:
        """Count parts as finished."""
        self.done, self.left = self.done + parts, max(self.left - parts, 0)
        if self.tell is not None:
            self.tell(self.done, self.done + self.left + self.later)

    def end(self) -> None:
        """End a stage, even if some of its expected parts were not needed."""
        self.left = 0
        self.advance(0)


def at(part: str) -> None:
    """Report the start of a phase of the work to the logger of this module."""
    LOGGER.info("%s", part)
