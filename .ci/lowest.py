"""Constraints that take every package at its lower bound: `lowest.py [EXTRA ...]`, for pip -c."""

import sys
import tomllib
from pathlib import Path

project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
bounds = [*project["dependencies"]]
for extra in sys.argv[1:]:
    bounds += project["optional-dependencies"][extra]
print("\n".join(sorted({bound.replace(">=", "==") for bound in bounds})))
