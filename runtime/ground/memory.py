"""Announce a computation that needs much memory before it begins, and refuse it in one sentence if
the memory is too small.
"""

from __future__ import annotations

import os
from math import inf
from pathlib import Path

from runtime.ground import progress
from runtime.ground.errors import MemoryTooSmallError
from runtime.ground.limits import LIMIT

GB = 1e9
SMALL = 0.05 * GB
"""Bytes that every machine has."""
MEMINFO = Path("/proc/meminfo")
CONTAINER = Path("/sys/fs/cgroup")
"""Folder of the limit of a container (cgroup v2)."""


def require_memory(needed: float, what: str, remedy: str) -> None:
    """Check that `needed` bytes of memory are available; report a need above MEMORY_TOLD in
    limits.toml.

    what : object that needs the memory, such as "the rows of the records". remedy : what to do, for
        the message.

    If less is available, a MemoryTooSmallError gives both numbers and the remedy.
    """
    if needed < SMALL:
        return
    most = available_memory()
    if needed > most:
        raise MemoryTooSmallError(
            f"{what} need about {needed / GB:.2g} GB of memory, and {most / GB:.2g} GB are available; {remedy}"
        )
    if needed > LIMIT.MEMORY_TOLD * GB:
        progress.at(f"{what}: about {needed / GB:.2g} GB of memory")


def available_memory() -> float:
    """Return the bytes of memory that a process can still take, swap space included.

    On Linux, the number is that of the system, or the limit of a container if that is smaller. On
    other systems, it is the whole memory of the machine, or infinity if the system does not report
    it.
    """
    return min(_of_machine(), _of_container())


def _of_machine() -> float:
    """Bytes that are free or can be freed on this machine."""
    try:
        lines = dict(line.split(":", 1) for line in MEMINFO.read_text("ascii").splitlines())
        return 1024.0 * sum(int(lines[key].split()[0]) for key in ("MemAvailable", "SwapFree"))
    except (OSError, ValueError, KeyError):
        pass
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return inf


def _of_container() -> float:
    """Bytes up to the limit of the container of this process; infinity without a limit."""
    try:
        limit = int((CONTAINER / "memory.max").read_text("ascii"))
        stat = (CONTAINER / "memory.stat").read_text("ascii").splitlines()
        return float(limit - int(dict(line.split() for line in stat)["anon"]))
    except (OSError, ValueError, KeyError):
        return inf
