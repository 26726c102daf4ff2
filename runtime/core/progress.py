"""What long work is at: sentences for whoever asked, by `logging`, logger "runtime.core.progress", level INFO.

logging.getLogger("runtime.core.progress").setLevel(logging.INFO)

and a handler: `symgen` prints them after two seconds
"""

from __future__ import annotations

import logging

LOGGER = logging.getLogger("runtime.core.progress")


def at(part: str) -> None:
    """Report the start of a phase to the progress callback, if one is set."""
    LOGGER.info("%s", part)
