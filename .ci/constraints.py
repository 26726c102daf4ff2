"""Versions of everything that `pip install '.[test]'` brings, as installed in this environment:
`python .ci/constraints.py > constraints.txt`.
"""

import re
import tomllib
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from platform import python_version


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def needed(requirements: Iterable[str], extras: frozenset[str], found: dict[str, str]) -> None:
    """Adds the distributions of these requirements and what they require, where installed."""
    for text in requirements:
        requirement, _, marker = text.partition(";")
        extra = re.search(r"extra\s*==\s*['\"]([^'\"]+)", marker)
        name = normal(re.split(r"[\s<>=!~\[(]", requirement.strip(), maxsplit=1)[0])
        if (extra is not None and extra[1] not in extras) or name in found:
            continue
        try:
            of = distribution(name)
        except PackageNotFoundError:
            continue
        found[name] = of.version
        asked = re.search(r"\[([^\]]*)\]", requirement)
        needed(of.requires or (), frozenset(asked[1].split(",")) if asked else frozenset(), found)


project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))[
    "project"
]
versions: dict[str, str] = {}
needed([*project["dependencies"], *project["optional-dependencies"]["test"]], frozenset(), versions)
for own in ("symgen", "setuptools", "pip"):
    versions.pop(own, None)
print(
    f"# Versions that the checks last passed with, Python {python_version()}: pip install -c "
    "constraints.txt '.[test]'. By .ci/constraints.py."
)
for package in sorted(versions):
    print(f"{package}=={versions[package]}")
