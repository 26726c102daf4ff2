"""Copies of the code of a feature under another name, in place of the feature in a list of `runtime.compose`.

A name of a function, class or part that other code asks for, and a class that it checks, shows by such a copy.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType
from typing import Any

from runtime.core.identify import OnRequest
from runtime.late import Late, PartWhen, When

TWIN = "another_"


@cache
def module_copy(name: str) -> ModuleType:
    """The module, run a second time under another name beside its own."""
    folder, _, file = name.rpartition(".")
    spec = spec_from_file_location(f"{folder}.{TWIN}{file}", import_module(name).__file__)
    assert spec is not None and spec.loader is not None
    copy = module_from_spec(spec)
    sys.modules[spec.name] = copy
    spec.loader.exec_module(copy)
    return copy


def copied(feature: Any) -> Any:
    """A step or an analysis made by a copy of its code."""
    if isinstance(feature, When):
        return When(copied(feature.step), feature.condition)
    if isinstance(feature, PartWhen):
        return PartWhen(copied(feature.make), feature.condition)
    if isinstance(feature, partial):
        return partial(copied(feature.func), *feature.args, **feature.keywords)
    if isinstance(feature, Late):
        module, _, name = feature.place.partition(":")
        return Late(f"{module_copy(module).__name__}:{name}")
    return getattr(module_copy(feature.__module__), feature.__name__)


def renamed(extra: Any) -> Any:
    """A copy of an analysis whose part has another name."""
    if isinstance(extra, OnRequest):
        otherwise = extra.otherwise and _named(copied(extra.otherwise))
        return replace(extra, make=_named(copied(extra.make)), otherwise=otherwise)
    return _named(copied(extra))


def _named(make: Callable[..., Any]) -> Callable[..., Any]:
    def made(*given: Any, **options: Any) -> Any:
        part = make(*given, **options)
        if part is not None:
            object.__setattr__(part, "name", TWIN + part.name)  # of frozen data
        return part

    return made
