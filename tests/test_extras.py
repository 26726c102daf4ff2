"""Optional libraries: what a message tells the user to install is there, and is what the code then
imports.
"""

import ast
import re
import sys
import tomllib
from functools import cache
from importlib.metadata import packages_distributions, requires
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FOR_DEVELOPERS = {"test", "docs"}
INSTALL = re.compile(r"pip install symgen\[([^\]]*)\]")
WITH_PYTHON = {
    *sys.stdlib_module_names,
    "compression",
    "symgen",
    "runtime",
}  # compression: from 3.14 on
FILES = sorted(path for package in ("symgen", "runtime") for path in (ROOT / package).rglob("*.py"))
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def libraries(requirements: list[str]) -> set[str]:
    """Normalised names of requirement strings, those for another extra left out."""
    wanted = [text.partition(";")[0] for text in requirements if "extra ==" not in text]
    return {normal(re.split(r"[\s<>=!~\[(]", text.strip(), maxsplit=1)[0]) for text in wanted}


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


CORE = libraries(PROJECT["dependencies"])
EXTRAS = {name: libraries(listed) for name, listed in PROJECT["optional-dependencies"].items()}


def named_in(path: Path) -> set[str]:
    """Extras that the text of a file tells the reader to install."""
    return {
        name
        for group in INSTALL.findall(path.read_text(encoding="utf-8"))
        for name in group.split(",")
    }


def optional_imports(path: Path) -> set[str]:
    """Top-level packages imported by a file that are neither Python's, nor ours, nor a core
    dependency.
    """
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    names = {alias.name for n in nodes if isinstance(n, ast.Import) for alias in n.names}
    names |= {n.module for n in nodes if isinstance(n, ast.ImportFrom) and n.module}
    return {
        top
        for name in names
        if (top := name.partition(".")[0]) not in WITH_PYTHON and not distributions(top) & core()
    }


@cache
def distributions(package: str) -> set[str]:
    """Distributions that hold a top-level package."""
    return {normal(name) for name in installed().get(package, [])}


installed = cache(packages_distributions)


@cache
def brought_by(extra: str) -> set[str]:
    """What installing an extra installs: its libraries, and what those require."""
    return with_required(EXTRAS[extra])


@cache
def core() -> set[str]:
    """What a plain installation installs."""
    return with_required(CORE)


def with_required(listed: set[str]) -> set[str]:
    """Libraries, and what they require themselves."""
    return listed | {name for library in listed for name in libraries(requires(library) or [])}


def test_the_extras_that_messages_name_exist() -> None:
    named = {path: named_in(path) for path in (*FILES, *PAGES)}
    assert {path: names - set(EXTRAS) for path, names in named.items() if names - set(EXTRAS)} == {}
    assert set().union(*(named[path] for path in FILES)) == set(EXTRAS) - FOR_DEVELOPERS


def test_a_file_names_the_extra_of_what_it_imports() -> None:
    asking = {path: optional_imports(path) for path in FILES}
    assert sum(map(bool, asking.values())) >= 5  # there are such files
    for path, package in (
        (path, package) for path, packages in asking.items() for package in packages
    ):
        assert any(distributions(package) & brought_by(extra) for extra in named_in(path)), (
            path.name,
            package,
        )


def test_what_ci_tests_holds_every_extra() -> None:
    assert {
        name: listed - EXTRAS["test"] for name, listed in EXTRAS.items() if listed - EXTRAS["test"]
    } == {}


def test_no_test_is_skipped_for_a_library_of_the_test_extra() -> None:
    """Who installs it expects these tests to run: a library that is missing or broken fails them."""
    asked = {
        name
        for path in (ROOT / "tests").rglob("*.py")
        for name in re.findall(r'importorskip\("(\w+)"', path.read_text(encoding="utf-8"))
    }
    assert {
        name for name in asked if distributions(name) & EXTRAS["test"]
    } == set() and "torch" in asked
