"""Features that are imported only when they are used, so that they do not slow down other calls.

Late("runtime.friction:friction")                  a function
When(Late("runtime.wrench:force_sensors"), ...)    a step of some problems, or a correction of some
                                                   identifications; PartWhen: an analysis
Listed({"iv": "runtime.loop.iv:METHOD"})           a list of names
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, MutableMapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Generic, TypeVar, cast

from runtime.core.result import Identification
from runtime.ground.part import Part

T = TypeVar("T")


def at(place: str) -> Any:
    """Import the module of a place "module:name", and return its attribute `name`."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


@dataclass(frozen=True)
class Late:
    """A function at a place "module:name", which is imported at the first call."""

    place: str

    def __call__(self, *given: Any, **options: Any) -> Any:
        return at(self.place)(*given, **options)


@dataclass(frozen=True)
class When(Generic[T]):
    """A step that changes only the problems, or the identifications, that meet a condition."""

    step: Callable[[T], T]
    condition: Callable[[T], bool]

    def __call__(self, given: T) -> T:
        return self.step(given) if self.condition(given) else given


@dataclass(frozen=True)
class PartWhen:
    """An analysis that is made only of the identifications that meet a condition."""

    make: Callable[[Identification], Part | None]
    condition: Callable[[Identification], bool]

    def __call__(self, result: Identification) -> Part | None:
        return self.make(result) if self.condition(result) else None


class Listed(MutableMapping[str, T]):
    """Objects by name, in their order; an object at a place "module:name" is imported when it is
    first used.
    """

    def __init__(self, listed: Mapping[str, T | str]) -> None:
        self._listed = dict(listed)

    def __getitem__(self, name: str) -> T:
        known = self._listed[name]
        if isinstance(known, str):
            known = self._listed[name] = cast(T, at(known))
        return known

    def __setitem__(self, name: str, known: T) -> None:
        self._listed[name] = known

    def __delitem__(self, name: str) -> None:
        del self._listed[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._listed)

    def __len__(self) -> int:
        return len(self._listed)
