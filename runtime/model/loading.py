"""Running an emitted file given by path: only if its syntax tree has the shape of one an emitter writes (`runtime.model.source_check`).

What is checked is what runs: the text is read once, and nothing of it is cached.
"""

from __future__ import annotations

import importlib.abc
import importlib.util
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

from runtime.errors import ModelError
from runtime.model.source_check import LONGEST, check_source


class _Checked(importlib.abc.InspectLoader):
    """Loader of a text that has been checked."""

    def __init__(self, text: str) -> None:
        self.text = text

    def get_source(self, fullname: str) -> str:
        return self.text


def module_of(path: Path) -> ModuleType:
    """The module of an emitted file; ModelError with the line of anything an emitter does not write."""
    try:
        with path.open(encoding="utf-8") as stream:
            text = stream.read(LONGEST + 1)
    except (OSError, UnicodeDecodeError) as e:
        raise ModelError(f"cannot be read: {e}", file=str(path)) from e
    check_source(text, path.name)
    return run(text, path)


def run(text: str, path: Path) -> ModuleType:
    """The module of a text that has been checked; `path` is where it stands."""
    name = f"generated_{path.stem}"
    loader = _Checked(text)
    module = importlib.util.module_from_spec(ModuleSpec(name, loader, origin=str(path)))
    module.__file__ = str(path)
    try:
        loader.exec_module(module)
    except ModuleNotFoundError as e:
        extra = ": pip install symgen[gpu]" if e.name == "array_api_compat" else ""
        raise ModelError(f"needs {e.name}, which is not installed{extra}", file=str(path)) from e
    except Exception as e:  # whatever a broken file raises becomes one kind of error
        raise ModelError(f"fails on import with {type(e).__name__}: {e}; emit it again", file=str(path)) from e
    return module
