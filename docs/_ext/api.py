"""The page of the public names of both packages, with signatures and docstrings."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from importlib import import_module
from typing import Any

from docstrings import first_sentence, markdown
from reference import table

WIDTH = 100  # of a signature on one line


def described_in_full(public: str, value: Any) -> Iterator[str]:
    """Signature under the public name, docstring and, of a class, its methods and properties."""
    yield f"```text\n{signature(public, value)}\n```"
    yield markdown(value.__doc__)
    if inspect.isclass(value):
        methods = [
            described_method(name, member)
            for name, member in vars(value).items()
            if not name.startswith("_")
        ]
        if shown := [line for line in methods if line]:
            yield "**Methods and properties**"
            yield "\n".join(shown)


def described_method(name: str, member: Any) -> str:
    """One line of a method, a class method or a property with a docstring."""
    if isinstance(member, property):
        return (
            f"- `{name}`: {first_sentence(member.fget.__doc__)}"
            if member.fget and member.fget.__doc__
            else ""
        )
    function = member.__func__ if isinstance(member, classmethod | staticmethod) else member
    if not inspect.isfunction(function) or not function.__doc__:
        return ""
    kind = "class method " if isinstance(member, classmethod) else ""
    return (
        f"- {kind}`{arguments(name, function, bound=not isinstance(member, staticmethod))}`: "
        f"{first_sentence(function.__doc__)}"
    )


def signature(name: str, value: Any) -> str:
    """The call, on one line or one parameter a line."""
    prefix = "class " if inspect.isclass(value) else ""
    line = prefix + arguments(name, value)
    if len(line) <= WIDTH:
        return line
    inner = parameters(value)
    return prefix + name + "(\n" + "".join(f"    {p},\n" for p in inner) + ")" + returned(value)


def arguments(name: str, value: Any, *, bound: bool = False) -> str:
    return f"{name}({', '.join(parameters(value)[bound:])}){returned(value)}"


def parameters(value: Any) -> list[str]:
    """Names and defaults; types are in the docstring. Those of a dataclass are its fields, which
    pydantic completes only when it makes the first.
    """
    if inspect.isclass(value) and is_dataclass(value):
        starred = [f for f in fields(value) if f.init and f.kw_only]
        return (
            [field(f) for f in fields(value) if f.init and not f.kw_only]
            + ["*"] * bool(starred)
            + [field(f) for f in starred]
        )
    try:
        listed = list(inspect.signature(value).parameters.values())
    except (ValueError, TypeError):
        return ["..."]
    found: list[str] = []
    starred = False
    for p in listed:
        if p.kind is p.KEYWORD_ONLY and not starred:
            found.append("*")
        starred = starred or p.kind in (p.KEYWORD_ONLY, p.VAR_POSITIONAL)
        star = {p.VAR_POSITIONAL: "*", p.VAR_KEYWORD: "**"}.get(p.kind, "")
        found.append(star + p.name + ("" if p.default is p.empty else f"={default(p.default)}"))
    return found


def field(f: Field[Any]) -> str:
    if f.default_factory is not MISSING:
        return f"{f.name}=..."
    return f.name if f.default is MISSING else f"{f.name}={default(f.default)}"


def default(value: Any) -> str:
    """How a default is written; objects that have no short form are left out."""
    if inspect.isfunction(value) or inspect.isclass(value):
        return value.__name__
    shown = repr(value)
    return (
        shown if len(shown) <= 30 and " at 0x" not in shown and not shown.startswith("<") else "..."
    )


def returned(value: Any) -> str:
    """The type of the result, as written in the source."""
    given = getattr(value, "__annotations__", {}).get("return", "")
    given = given if isinstance(given, str) else getattr(given, "__name__", "")
    return f" -> {given}" if given and not inspect.isclass(value) else ""


def names(package: str) -> str:
    """The names a package offers, each with its signature and docstring, after a table of them."""
    parent, rows, parts = import_module(package), [], []
    for name in parent.__all__:
        thing = getattr(parent, name)
        link = f"[`{name}`](#{name.lower()})" if callable(thing) else f"`{name}`"
        rows.append((link, first_sentence(thing.__doc__)))
        parts += [f"### `{name}`", *described_in_full(name, thing)]
    return "\n\n".join(part for part in [table(("name", ""), rows).strip(), *parts] if part) + "\n"
