"""What runs beside the server: commands and views in processes that end with it, within limits."""

from __future__ import annotations

import os
import signal
import sys
import threading
from contextlib import suppress

MOST_MEMORY = 8 * 2**30  # bytes of address space of one process, or what the machine has
MOST_SECONDS = 3600  # processor time of one command


def watched() -> None:
    """End this process and its own ones when standard input closes: its holder has ended."""
    limited(MOST_SECONDS)
    threading.Thread(target=_end_with_input, daemon=True).start()


def _end_with_input() -> None:
    while os.read(sys.stdin.fileno(), 4096):
        pass
    os.killpg(0, signal.SIGKILL)


def limited(seconds: int = 10**9) -> None:
    """Limits of memory and processor time of this process, where the system has them."""
    with suppress(ImportError, OSError, ValueError):
        import resource

        memory = max(MOST_MEMORY, os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
