"""The public list of `runtime`, and what importing it brings along."""

import subprocess
import sys

import pytest

import runtime


def test_public_names_exist():
    assert all(callable(getattr(runtime, name)) for name in runtime.__all__)
    assert runtime.__all__ == sorted(runtime.__all__) == dir(runtime)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        runtime.nothing  # noqa: B018


def test_importing_runtime_is_light():
    heavy = [
        "numpy",
        "ruamel",
        "pooch",
        "pydantic",
        "sympy",
        "casadi",
        "matplotlib",
        "jinja2",
        "symgen",
        "generated",
    ]
    code = f"import runtime, sys; print([name for name in {heavy} if name in sys.modules])"
    assert (
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        ).stdout.strip()
        == "[]"
    )
