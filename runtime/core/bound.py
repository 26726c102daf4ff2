"""A model with new values for some of its constants, such as those of a fitted friction law."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from inspect import signature
from typing import Any

from runtime.core.model import GeneratedModel


class BoundModel:
    """A model in which new values replace some constants of the robot file.

    Every function of the model has the new values as default arguments.

    Parameters
    ----------
    model : GeneratedModel
        An emitted module.
    constants : mapping of str to float
        New values of some of its CONSTANTS, by name.
    """

    def __init__(self, model: GeneratedModel, constants: Mapping[str, float]) -> None:
        self._model, self._given = model, dict(constants)
        self.CONSTANTS = {**model.CONSTANTS, **constants}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        value = getattr(self._model, name)
        if name == "ELEMENTS":
            return self._model.elements(**self._given)  # type: ignore[attr-defined]
        if not callable(value) or isinstance(value, type):
            return value
        own = signature(value).parameters
        rest = any(p.kind is p.VAR_KEYWORD for p in own.values())
        return partial(value, **{key: x for key, x in self._given.items() if rest or key in own})
