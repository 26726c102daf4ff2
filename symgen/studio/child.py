"""Run commands and computations of the studio in child processes, limited in memory and time.

These processes end when the server ends.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from importlib import import_module
from multiprocessing import get_context, parent_process
from typing import Any

MOST_MEMORY = 8 * 2**30  # bytes of address space of one process, or what the machine has
MOST_SECONDS = 3600  # processor time of one command


def watched() -> None:
    """End this process and its child processes when standard input closes.

    Standard input closes when the server has ended. Memory and processor time are limited too.
    """
    limited(MOST_SECONDS)
    threading.Thread(target=_end_with_input, daemon=True).start()


def _end_with_input() -> None:
    while os.read(sys.stdin.fileno(), 4096):
        pass
    os.killpg(0, signal.SIGKILL)


def limited(seconds: int = 10**9) -> None:
    """Limit memory and processor time of this process, if the system allows it.

    seconds : processor time.
    """
    with suppress(ImportError, OSError, ValueError):
        import resource

        memory = max(MOST_MEMORY, os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))


class ViewProcess:
    """A child process that computes the data of pages (views), and is restarted if it was ended."""

    def __init__(self) -> None:
        self.pool: ProcessPoolExecutor | None = None

    def start(self) -> ProcessPoolExecutor:
        """Start the child process unless it is running; it imports the views in the background."""
        if self.pool is None:
            self.pool = ProcessPoolExecutor(
                1, mp_context=get_context("spawn"), initializer=_of_parent
            )
            self.number = self.pool.submit(os.getpid)
            self.pool.submit(import_module, "symgen.studio.views")
        return self.pool

    def submit(self, view: Callable[..., Any], *args: Any) -> Future[Any]:
        """Run a view function, which computes data for a page, in the child process.

        View functions run in the order in which they are submitted. Return a Future of the data.
        """
        return self.start().submit(view, *args)

    def end(self) -> None:
        """Kill the child process at once, even during a computation."""
        if self.pool is not None:
            with suppress(BrokenProcessPool, ProcessLookupError):
                os.kill(self.number.result(), signal.SIGKILL)
            self.pool.shutdown()
            self.pool = None


def _of_parent() -> None:
    """Prepare the child process: limit its memory, ignore Ctrl-C, and end it with the server."""
    limited()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
