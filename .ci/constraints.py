"""Versions of everything that `pip install '.[test]'` brings, as installed in this environment: `python .ci/constraints.py > constraints.txt`."""

import re
from importlib.metadata import PackageNotFoundError, distribution
from platform import python_version


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def needed(name: str, extras: frozenset[str], found: dict[str, str]) -> None:
    """Adds the distribution and what it requires, where that is installed."""
    try:
        of = distribution(name)
    except PackageNotFoundError:
        return
    found[normal(name)] = of.version
    for text in of.requires or ():
        requirement, _, marker = text.partition(";")
        extra = re.search(r"extra\s*==\s*['\"]([^'\"]+)", marker)
        inner = normal(re.split(r"[\s<>=!~\[(]", requirement.strip(), maxsplit=1)[0])
        if (extra is None or extra[1] in extras) and inner not in found:
            asked = re.search(r"\[([^\]]*)\]", requirement)
            needed(inner, frozenset(asked[1].split(",")) if asked else frozenset(), found)


versions: dict[str, str] = {}
needed("symgen", frozenset({"test"}), versions)
for own in ("symgen", "setuptools", "pip"):
    versions.pop(own, None)
print(
    f"# Versions that the checks last passed with, Python {python_version()}: pip install -c constraints.txt '.[test]'. By .ci/constraints.py."
)
for package in sorted(versions):
    print(f"{package}=={versions[package]}")
