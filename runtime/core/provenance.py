"""Provenance of results: names and time stamps of the records, and whether they were measured."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from runtime.core.record import Record


def record_names(records: Sequence[Record]) -> tuple[str, ...]:
    """Give each record a unique name: of two equal names, the second becomes "name (2)"."""
    names: list[str] = []
    for record in records:
        name, k = record.name, 1
        while name in names:
            k += 1
            name = f"{record.name} ({k})"
        names.append(name)
    return tuple(names)


def origin(records: Sequence[Record]) -> dict[str, Any]:
    """Return the origin of the data: names and time stamps of records, measured or simulated.

    Texts about subtracted known torques are included.
    """
    names = record_names(records)
    simulated = any(record.origin.simulated for record in records)
    note = {"note": "SIMULATED record: nothing was measured"} if simulated else {}
    named = list(zip(names, records, strict=True))
    said = {
        "time": {name: record.origin.time for name, record in named if record.origin.time},
        "known_torques": {name: record.subtracted for name, record in named if record.subtracted},
    }
    return {
        "records": list(names),
        "simulated": simulated,
        **{key: texts for key, texts in said.items() if texts},
        **note,
    }


def versions() -> dict[str, str]:
    """Return the versions of symgen, numpy and scipy."""
    try:
        own = version("symgen")
    except PackageNotFoundError:
        own = "not installed"
    return {"symgen": own, "numpy": np.__version__, "scipy": scipy.__version__}


def processor() -> str:
    """Return the name of the machine and the processor; the last bits of results depend on them."""
    name = cpuinfo("model name").partition(":")[2].strip() or platform.processor()
    return f"{platform.machine()} {name}".strip()


def cpuinfo(*starts: str) -> str:
    """Return the first line of /proc/cpuinfo that begins with one of the texts `starts`.

    Without this file, the name of the processor is searched. Return "" if there is no such line.
    """
    info = Path("/proc/cpuinfo")
    text = info.read_text(errors="replace") if info.is_file() else platform.processor()
    return next((line for line in text.splitlines() if line.startswith(starts)), "")
