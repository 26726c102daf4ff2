"""Every public name exists and is documented; importing and asking for help stay light."""

import importlib
import inspect
import pkgutil
import subprocess
import sys
from collections.abc import Iterator

import pytest

import runtime
import symgen


def with_public_list() -> Iterator[str]:
    """Modules of both packages that state their public names."""
    for package in (symgen, runtime):
        yield package.__name__
        for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            if hasattr(importlib.import_module(found.name), "__all__"):
                yield found.name


def test_public_names_exist_and_have_docstrings() -> None:
    for module in with_public_list():
        loaded = importlib.import_module(module)
        assert len(loaded.__all__) == len(set(loaded.__all__))
        for name in loaded.__all__:
            value = getattr(loaded, name)
            if inspect.isclass(value) or callable(value):
                doc = value.__doc__ or ""
                assert doc and not doc.startswith(f"{name}("), (
                    f"{module}.{name} has no docstring"
                )  # a dataclass writes its signature there


def test_every_module_has_a_docstring() -> None:
    for package in (symgen, runtime):
        for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            assert importlib.import_module(found.name).__doc__, found.name


def loaded_by(code: str) -> set[str]:
    """Top-level modules in a fresh process after `code`."""
    result = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}\nprint(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    )
    return {name.partition(".")[0] for name in result.stdout.splitlines()[-1].split()}


def test_import_runtime_is_light() -> None:
    assert not loaded_by("import runtime") & {
        "sympy",
        "casadi",
        "matplotlib",
        "symgen",
        "generated",
    }


def test_help_is_light() -> None:
    code = (
        "from typer.testing import CliRunner\nfrom symgen.cli.main import app\nassert "
        "CliRunner().invoke(app, ['--help']).exit_code == 0"
    )
    assert not loaded_by(code) & {
        "sympy",
        "numpy",
        "scipy",
        "casadi",
        "matplotlib",
        "pydantic",
        "ruamel",
        "runtime",
    }


def test_import_symgen_is_light() -> None:
    assert not loaded_by("import symgen") & {"sympy", "numpy", "casadi", "pydantic"}
    assert dir(symgen) == sorted(symgen.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        symgen.nothing  # noqa: B018


def test_regrouping_is_a_function_to_its_users() -> None:
    """The room of the formulas is called regroup: no public function has the name of a room."""
    from symgen import certificate, load_robot, regrouping

    assert certificate(regrouping(load_robot("planar_2r"))).valid
    assert not set(symgen.__all__) & {found.name for found in pkgutil.iter_modules(symgen.__path__)}
