"""Limits and thresholds of all checks: limits.toml in the folder of each feature.

For each limit, the table gives the value, the unit, the meaning, and where it was measured.

    LIMIT = limits(__package__)
    LIMIT.DECISIVE           the value
"""

import tomllib
from functools import cache
from importlib.resources import files
from types import SimpleNamespace
from typing import Any


@cache
def entries(package: str) -> dict[str, dict[str, Any]]:
    """Read the limits in the folder of a package: value, unit, meaning and source of each."""
    text = files(package).joinpath("limits.toml").read_text("utf-8")
    return {name: limit for file in tomllib.loads(text).values() for name, limit in file.items()}


@cache
def limits(package: str) -> Any:
    """Return the limits of a feature, and the limits that several folders share, as attributes."""
    known = entries("runtime.ground") | entries(package)
    return SimpleNamespace(**{name: limit["value"] for name, limit in known.items()})


LIMIT: Any = limits("runtime.ground")
"""Values of the limits of the core, and of those that several rooms share."""
