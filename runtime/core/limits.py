"""Limits and thresholds of all checks, in one table: runtime/core/limits.toml.

For each limit, the table gives the value, the unit, the meaning, and where it was measured.

    LIMIT.DECISIVE           the value
"""

import tomllib
from importlib.resources import files
from types import SimpleNamespace
from typing import Any

ENTRIES: dict[str, dict[str, Any]] = {
    name: limit
    for module in tomllib.loads(
        files("runtime.core").joinpath("limits.toml").read_text("utf-8")
    ).values()
    for name, limit in module.items()
}
LIMIT: Any = SimpleNamespace(**{name: limit["value"] for name, limit in ENTRIES.items()})
"""Values of the limits, as attributes, for instance LIMIT.DECISIVE."""
