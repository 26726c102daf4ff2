"""Text from templates: the only place where jinja2 lays out an emitted file."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from jinja2 import Environment, PackageLoader, StrictUndefined


@lru_cache(maxsize=1)
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("symgen.emit"), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )


def laid_out(template: str, context: Mapping[str, object]) -> str:
    """The text of `templates/<template>.jinja` with the values of `context`."""
    return _environment().get_template(f"{template}.jinja").render(context)
