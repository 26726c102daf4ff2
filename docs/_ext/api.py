"""Pages of docs/api: the public names of both packages, and room by room what other rooms use, with
signatures and docstrings.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType
from typing import Any

from docstrings import first_line, markdown
from reference import table

ROOT = Path(__file__).resolve().parents[2]
LEFT_OUT = {"symgen.cli"}  # what they do is described under Commands
WIDTH = 100  # of a signature on one line


class Slugs:
    """Anchors of the headings of a page, as GitHub and MyST make them."""

    def __init__(self) -> None:
        self.given: dict[str, int] = {}

    def __call__(self, title: str) -> str:
        slug = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
        self.given[slug] = self.given.get(slug, -1) + 1
        return slug if not self.given[slug] else f"{slug}-{self.given[slug]}"


def rooms() -> list[str]:
    """Packages with a page: the rooms, and `runtime` for the files of the ground."""
    found = ["runtime"]
    for package in ("symgen", "runtime"):
        found += [
            f"{package}.{m.name}" for m in iter_modules(import_module(package).__path__) if m.ispkg
        ]
    return [name for name in found if name not in LEFT_OUT]


def page_of(package: str) -> str:
    """Name of the page of a room, without its ending."""
    return "ground" if package == "runtime" else package.rpartition(".")[2]


def modules(package: str) -> Iterator[ModuleType]:
    """The package and its public modules, those within packages of its own included; of `runtime`,
    its files alone.
    """
    yield import_module(package)
    for m in iter_modules(import_module(package).__path__):
        if m.name.startswith("_") or (package == "runtime" and m.ispkg):
            continue
        if m.ispkg:
            yield from modules(f"{package}.{m.name}")
        else:
            yield import_module(f"{package}.{m.name}")


@cache
def used() -> frozenset[str]:
    """Dotted names that a module of another room, an example or a page's script imports, or reaches
    through their module.
    """
    found: set[str] = set()
    for path in [
        *(ROOT / "symgen").rglob("*.py"),
        *(ROOT / "runtime").rglob("*.py"),
        *(ROOT / "docs").rglob("*.py"),
    ]:
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        imported = {
            alias.asname or alias.name: f"{n.module}.{alias.name}"
            for n in nodes
            if isinstance(n, ast.ImportFrom)
            for alias in n.names
        }
        reached = {
            f"{imported[n.value.id]}.{n.attr}"
            for n in nodes
            if isinstance(n, ast.Attribute) and getattr(n.value, "id", None) in imported
        }
        own = ".".join(path.relative_to(ROOT).parts[:-1][:2])
        found |= {
            name for name in {*imported.values(), *reached} if ".".join(name.split(".")[:2]) != own
        }
    return frozenset(found)


def is_shown(name: str, module: str) -> bool:
    public = any(
        name in getattr(import_module(package), "__all__", ()) for package in ("symgen", "runtime")
    )
    return public or f"{module}.{name}" in used() or name.endswith("Options")


def members(module: ModuleType) -> list[Any]:
    """Functions and classes that a module writes itself, describes, and that other rooms use, in
    its order.
    """
    written = [
        value
        for name, value in vars(module).items()
        if not name.startswith("_")
        and (
            inspect.isclass(value)
            or inspect.isfunction(inspect.unwrap(value) if callable(value) else value)
        )
        and getattr(value, "__module__", None) == module.__name__
        and getattr(value, "__name__", None) == name
        and described(value)
        and is_shown(name, module.__name__)
    ]
    return sorted(
        written,
        key=lambda value: (
            inspect.unwrap(value).__code__.co_firstlineno
            if not inspect.isclass(value)
            else line_of(value)
        ),
    )


def line_of(cls: type) -> int:
    try:
        return inspect.getsourcelines(cls)[1]
    except (OSError, TypeError):
        return 0


def described(value: Any) -> bool:
    doc = value.__doc__ or ""
    return bool(doc) and not doc.startswith(
        f"{value.__name__}("
    )  # a dataclass writes its signature there


def room(package: str) -> str:
    """The page of a room: its docstring, a table of its names, then its subjects with their
    functions and classes.
    """
    title = (
        "Files of the ground"
        if package == "runtime"
        else page_of(package).replace("_", " ").capitalize()
    )
    subjects = [(module, members(module)) for module in modules(package)]
    if package == "runtime":
        subjects = subjects[1:]  # the public names of the package itself are on the index page
    slugs, rows, parts = Slugs(), [], []
    slugs(title)
    for module, values in subjects:
        own = module.__name__ == package
        if not own and not values:
            continue
        if values or not own:
            heading = (
                module.__name__.rpartition(".")[2].replace("_", " ").capitalize()
                if not own
                else "Of the room itself"
            )
            slugs(heading)
            parts += [
                f"## {heading}",
                f"`from {module.__name__} import {', '.join(v.__name__ for v in values)}`",
                markdown(module.__doc__),
            ]
        for value in values:
            rows.append(
                (f"[`{value.__name__}`](#{slugs(value.__name__)})", first_line(value.__doc__))
            )
            parts += [f"### `{value.__name__}`", *described_in_full(value)]
    head = [
        f"# {title}",
        f"`{package}`",
        markdown(import_module(package).__doc__)
        if package != "runtime"
        else "What every room may use.",
    ]
    return (
        "\n\n".join(part for part in [*head, table(("name", ""), rows).strip(), *parts] if part)
        + "\n"
    )


def described_in_full(value: Any) -> Iterator[str]:
    """Signature, docstring and, of a class, its methods and properties."""
    yield f"```text\n{signature(value)}\n```"
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
            f"- `{name}`: {first_line(member.fget.__doc__)}"
            if member.fget and member.fget.__doc__
            else ""
        )
    function = member.__func__ if isinstance(member, classmethod | staticmethod) else member
    if not inspect.isfunction(function) or not function.__doc__:
        return ""
    kind = "class method " if isinstance(member, classmethod) else ""
    return (
        f"- {kind}`{arguments(function, bound=not isinstance(member, staticmethod))}`: "
        f"{first_line(function.__doc__)}"
    )


def signature(value: Any) -> str:
    """The call, on one line or one parameter a line."""
    prefix = "class " if inspect.isclass(value) else ""
    line = prefix + arguments(value)
    if len(line) <= WIDTH:
        return line
    inner = parameters(value)
    return (
        prefix
        + value.__name__
        + "(\n"
        + "".join(f"    {p},\n" for p in inner)
        + ")"
        + returned(value)
    )


def arguments(value: Any, *, bound: bool = False) -> str:
    return f"{value.__name__}({', '.join(parameters(value)[bound:])}){returned(value)}"


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
        home = (
            page_of(".".join(thing.__module__.split(".")[:2]))
            if thing.__module__.count(".") > 1
            else "ground"
        )
        link = f"[`{name}`](#{name.lower()})" if callable(thing) else f"`{name}`"
        rows.append((link, first_line(thing.__doc__)))
        described_here = (
            list(described_in_full(thing))
            if inspect.isfunction(thing)
            else [f"```text\n{signature(thing)}\n```", markdown(thing.__doc__)]
        )
        parts += [
            f"### `{name}`",
            *described_here,
            f"More of this room: [{home}]({home}.md)." if f"{package}.{home}" in rooms() else "",
        ]
    return "\n\n".join(part for part in [table(("name", ""), rows).strip(), *parts] if part) + "\n"


def contents() -> str:
    """A list of the pages of the rooms, each with the first line of its package."""
    listed = [(name, page_of(name)) for name in rooms()]
    ground = "Files that every room may use."
    about = {
        name: ground if name == "runtime" else first_line(import_module(name).__doc__)
        for name, _ in listed
    }
    rows = [(f"[{page}]({page}.md)", f"`{name}`", about[name]) for name, page in listed]
    tree = "\n".join(
        ["```{toctree}", ":maxdepth: 1", ":hidden:", "", *(page for _, page in listed), "```"]
    )
    return table(("page", "room", ""), rows) + "\n" + tree + "\n"
