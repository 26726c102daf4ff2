"""The examples in the docstrings of the public names run, and print what they say.

They run in an empty folder that contains only `generated`, as a user runs them in the checkout.
"""

from __future__ import annotations

import doctest
import inspect
from pathlib import Path

import pytest

import runtime
import symgen

ROOT = Path(__file__).resolve().parents[2]
PUBLIC = [(package, name) for package in (symgen, runtime) for name in package.__all__]
FUNCTIONS = [(p, name) for p, name in PUBLIC if inspect.isfunction(getattr(p, name))]


@pytest.mark.parametrize(
    ("package", "name"), PUBLIC, ids=[f"{p.__name__}.{name}" for p, name in PUBLIC]
)
def test_examples_print_what_they_say(
    package: object, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Long lines may end in `...`, and breaks of lines do not count."""
    (tmp_path / "generated").symlink_to(ROOT / "generated")
    monkeypatch.chdir(tmp_path)
    test = doctest.DocTestParser().get_doctest(
        inspect.getdoc(getattr(package, name)) or "", {}, name, None, 0
    )
    printed: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert runner.run(test, out=printed.append).failed == 0, "".join(printed)


@pytest.mark.parametrize(
    ("package", "name"), FUNCTIONS, ids=[f"{p.__name__}.{name}" for p, name in FUNCTIONS]
)
def test_help_of_a_public_function_has_an_example(package: object, name: str) -> None:
    function = getattr(package, name)
    assert doctest.DocTestParser().get_examples(inspect.getdoc(function) or "")
