"""Limits and thresholds of all checks, in one table: runtime/core/limits.toml.

For each limit, the table gives the value, the unit, the meaning, and where it was measured.

    LIMIT.DECISIVE           the value
"""

import tomllib
from importlib.resources import files
from typing import Any

ENTRIES: dict[str, dict[str, Any]] = {
    name: limit
    for module in tomllib.loads(
        files("runtime.core").joinpath("limits.toml").read_text("utf-8")
    ).values()
    for name, limit in module.items()
}


class LimitValues:
    """Numerical thresholds of all verdicts and checks, as attributes, for instance LIMIT.DECISIVE."""

    def __init__(self) -> None:
        self.__dict__.update({name: limit["value"] for name, limit in ENTRIES.items()})

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"the file runtime/core/limits.toml has no limit {name}")


LIMIT = LimitValues()
