"""Reference pages as Markdown, from the program: commands from the command line, formats from their schemas, modules from their packages."""

from __future__ import annotations

import ast
import inspect
import json
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from typer.main import get_command

from runtime.settings.study import Study, to_mapping
from symgen.cli.main import VERBS, app
from symgen.description import load_robot, packaged_robots
from symgen.description.schema import json_schema
from symgen.regroup.regrouping import Regrouping, regroup

HERE = Path(__file__).resolve().parent.parent
HOMES = {"regroup": "symgen.regroup.regrouping"}  # a package has this public name, too


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A Markdown table; empty without rows."""
    if not rows:
        return ""
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in line) + " |" for line in lines) + "\n"


# Commands


def commands() -> str:
    """Every verb with its arguments and options, as `symgen VERB --help` has them."""
    group: Any = get_command(app)
    return "\n".join(command(name, group.get_command(None, name)) for name in VERBS)


def command(name: str, verb: Any) -> str:
    parameters = [p for p in verb.params if not getattr(p, "hidden", False) and p.name != "help"]
    arguments = [p for p in parameters if not p.opts[0].startswith("-")]
    options = [p for p in parameters if p.opts[0].startswith("-")]
    usage = " ".join(["symgen", name, *(shown(p) for p in arguments), *(["[OPTIONS]"] if options else [])])
    return "\n".join(
        [
            f"## symgen {name}", "", f"```text\n{usage}\n```", "", inspect.cleandoc(verb.help or ""), "",
            table(("argument", ""), [(f"`{shown(p)}`", p.help or "") for p in arguments]),
            table(("option", "", "default"), [(", ".join(f"`{o}`" for o in sorted(p.opts, key=len)), p.help or "", default(p)) for p in options]),
        ]
    )  # fmt: skip


def shown(argument: Any) -> str:
    text = (argument.metavar or argument.name).upper().strip("[]{}.")
    text += " ..." if argument.nargs == -1 else ""
    return text if argument.required else f"[{text}]"


def default(option: Any) -> str:
    return "" if option.default in (None, False, ()) or callable(option.default) else f"`{option.default}`"


# Formats


def robot_file() -> str:
    """The keys of a robot file, table by table, from its JSON Schema."""
    schema = json_schema()
    parts = [section("Top level", schema)]
    parts += [section(heading(name), part) for name, part in schema["$defs"].items()]
    return "\n".join(parts)


HEADINGS = {"FrameRow": "frames", "LoopRow": "loops", "ElementTable": "elements", "DrivesTable": "drives", "LimitsTable": "limits"}


def heading(definition: str) -> str:
    return f"`{HEADINGS.get(definition, definition)}`"


def section(title: str, schema: Mapping[str, Any]) -> str:
    needed = schema.get("required", [])
    rows = [
        (
            f"`{key}`",
            kind(value),
            "required" if key in needed else code(value.get("default", None)),
            value.get("description", "").replace("*", "\\*"),
        )
        for key, value in schema["properties"].items()
    ]
    return f"## {title}\n\n{schema.get('description', '')}\n\n" + table(("key", "holds", "default", ""), rows)


def kind(schema: Mapping[str, Any]) -> str:
    """The type of a value of a JSON Schema, in words."""
    if "$ref" in schema:
        return heading(schema["$ref"].rsplit("/", 1)[-1])
    if "enum" in schema:
        return " or ".join(f"`{v}`" for v in schema["enum"] if v is not None)
    if "const" in schema:
        return f"`{schema['const']}`"
    if "anyOf" in schema:
        return " or ".join(kind(s) for s in schema["anyOf"] if s.get("type") != "null")
    types = schema.get("type", "any")
    if types == "array":
        return "list of " + kind(schema["items"]) if "items" in schema else "list"
    if types == "object":
        return "table of " + kind(schema["additionalProperties"]) if isinstance(schema.get("additionalProperties"), Mapping) else "table"
    names = {"string": "text", "number": "number", "integer": "whole number", "boolean": "true or false", "array": "list"}
    return " or ".join(names.get(t, t) for t in ([types] if isinstance(types, str) else types))


def code(value: Any) -> str:
    return "" if value is None else f"`{json.dumps(value, ensure_ascii=False)}`"


def study_file() -> str:
    """The sections of a study file from the settings classes: what each holds, its keys, types and defaults."""
    parts = [f"{prose(Study)}\n\n{keys(Study)}"]
    parts += [f"## `{path}`\n\n{prose(cls)}\n\n{keys(cls)}" for path, cls in settings(Study)]
    return "\n".join(parts)


def settings(cls: type, path: str = "") -> Iterator[tuple[str, type]]:
    """The dataclasses within a dataclass, each with the dotted key it stands under, in the order of the file."""
    for key, hint in get_type_hints(cls).items():
        for inner in classes(hint):
            if not (cls is not Study and inner.__name__ == "RecordSettings"):  # described once
                here = f"{path}.{key}" if path else key
                yield here, inner
                yield from settings(inner, here)


def classes(hint: Any) -> Iterator[type]:
    if is_dataclass(hint) and isinstance(hint, type):
        yield hint
    for inner in get_args(hint):
        yield from classes(inner)


def prose(cls: type) -> str:
    """The docstring of a settings class: its first lines as text, its entries as a list."""
    from plain_docstrings import ENTRY, entries, paragraphs

    parts = []
    for part in paragraphs(inspect.getdoc(cls).splitlines() if cls.__doc__ else []):
        found = entries(part) if ENTRY.match(part[0]) else None
        parts.append("\n".join(line.replace("``", "`").replace("`\\ ", "`") for line in found) if found else "\n".join(map(verbatim, part)))
    return "\n\n".join(parts)


def verbatim(line: str) -> str:
    return line.replace("*", "\\*").replace("<", "&lt;")


def keys(cls: Any) -> str:
    hints = get_type_hints(cls)
    return table(("key", "holds", "default"), [(f"`{f.name}`", words(hints[f.name]), given(f)) for f in fields(cls)])


def words(hint: Any) -> str:
    """A type hint in words."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Literal:
        return " or ".join(f"`{v}`" for v in inner)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys("null" if a is type(None) else words(a) for a in inner))
    if origin is tuple:
        return f"list of {words(inner[0])}" if inner[-1] is Ellipsis else "[" + ", ".join(map(words, inner)) + "]"
    if is_dataclass(hint):
        return "section"
    if origin is not None:
        return "table"
    return {"int": "whole number", "float": "number", "str": "text", "bool": "true or false"}.get(getattr(hint, "__name__", ""), "any")


def given(field: Field[Any]) -> str:
    """The default of a key, as it would be written."""
    if field.default_factory is not MISSING:
        value = field.default_factory()
        return "" if is_dataclass(value) or value == {} else code(value)
    if field.default is MISSING:
        return "required"
    value = to_mapping(field.default) if is_dataclass(field.default) else field.default
    return code(list(value) if isinstance(value, tuple) else value) or "`null`"


# Modules


def modules(package: str, *left_out: str) -> str:
    """A package and its public modules but those of `left_out`, with all their public functions and classes."""
    inner = [m.name for m in iter_modules(import_module(package).__path__) if not (m.ispkg or m.name.startswith("_"))]
    own = [f".. autofunction:: {package}.{f.__name__}" for f in defined(package)]
    parts = [rst(package, f".. automodule:: {package}", *own)]
    parts += [rst(f"{package}.{m}", f".. automodule:: {package}.{m}\n   :members:\n   :undoc-members:") for m in inner if m not in left_out]
    return "\n".join(parts)


def defined(package: str) -> list[Any]:
    """Public functions written in the __init__.py of a package."""
    found = inspect.getmembers(import_module(package), inspect.isfunction)
    return [f for name, f in found if f.__module__ == package and not name.startswith("_")]


def rst(title: str, *lines: str) -> str:
    return "\n".join([f"## {title}", "", "```{eval-rst}", "\n\n".join(lines), "```", ""])


def names(package: str) -> str:
    """The names a package offers, each with its first line and a link to where it is described."""
    parent = import_module(package)
    rows = []
    for name in parent.__all__:
        thing = getattr(import_module(HOMES.get(name, package)), name)
        first = (inspect.getdoc(thing) or "").split("\n")[0]
        rows.append((f"[](#{thing.__module__}.{name})", verbatim(first)))
    return table(("name", ""), rows)


# Robots and examples


@cache
def regrouped(name: str) -> Regrouping:
    """Base parameters of a packaged robot, derived once for the gallery's list and its pages."""
    return regroup(load_robot(name))


def robots() -> str:
    """Every packaged robot: title, counts, a link to its page, its source, its longest formulas."""
    return "\n".join(robot(name) for name in packaged_robots())


def robot(name: str) -> str:
    regrouping = regrouped(name)
    description = regrouping.robot
    gathered = [b for b in regrouping.base if b.name != b.own]
    formulas = "\n".join(f"{b.name} = {b.formula}" for b in gathered[:3])
    return "\n".join(
        [
            f"## {name}", "", f"{verbatim(description.title or name)}. Actuated joints: {len(description.joints)}; frames: {len(description.frames)}; "
            f"{len(regrouping)} base parameters of {len(description.parameters)}.", "",
            f'<p><a href="../robots/{name}.html">{name}: skeleton, frames, formulas</a></p>', "",
            f"```text\n{formulas}\n```" if formulas else "", "", verbatim(" ".join((description.source or "").split())), "",
        ]
    )  # fmt: skip


def examples() -> str:
    """Every file of docs/examples: its first line as the title, its text."""
    parts = []
    for path in sorted((HERE / "examples").glob("*.py")):
        text = path.read_text(encoding="utf-8")
        title = (ast.get_docstring(ast.parse(text)) or path.stem).split("\n")[0].rstrip(".")
        parts.append(f"## {title}\n\n`docs/examples/{path.name}`\n\n```python\n{text}```\n")
    return "\n".join(parts)
