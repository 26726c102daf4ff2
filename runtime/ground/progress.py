"""Messages about the progress of long work, by the logger "runtime.ground.progress", level INFO.

    logging.getLogger("runtime.ground.progress").setLevel(logging.INFO)

A handler is needed too; `symgen` has one, which prints the messages after two seconds.
"""

from __future__ import annotations

import logging

LOGGER = logging.getLogger("runtime.ground.progress")


def at(part: str) -> None:
    """Report the start of a phase of the work to the logger of this module."""
    LOGGER.info("%s", part)
