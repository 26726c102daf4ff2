"""Reference pages as Markdown, from the program: commands from the command line, formats from their
schemas, robots and examples from their files.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import docstrings
from typer.main import get_command

from runtime.ground.settings import to_mapping
from runtime.study import Study
from symgen.cli.main import VERBS, app
from symgen.description import load_robot, packaged_robots
from symgen.description.yaml import json_schema
from symgen.regroup.regrouping import Regrouping, regroup

HERE = Path(__file__).resolve().parent.parent


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A Markdown table; empty without rows."""
    if not rows:
        return ""
    lines = [head, ("---",) * len(head), *rows]
    return (
        "\n".join(
            "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in line) + " |"
            for line in lines
        )
        + "\n"
    )


# Commands


def commands() -> str:
    """Every verb with its arguments and options, as `symgen VERB --help` has them."""
    group: Any = get_command(app)
    return "\n".join(command(name, group.get_command(None, name)) for name in VERBS)


def command(name: str, verb: Any) -> str:
    parameters = [p for p in verb.params if not getattr(p, "hidden", False) and p.name != "help"]
    arguments = [p for p in parameters if not p.opts[0].startswith("-")]
    options = [p for p in parameters if p.opts[0].startswith("-")]
    usage = " ".join(
        ["symgen", name, *(shown(p) for p in arguments), *(["[OPTIONS]"] if options else [])]
    )
    return "\n".join(
        [
            f"## symgen {name}", "", f"```text\n{usage}\n```", "",
            inspect.cleandoc(verb.help or ""), "",
            table(("argument", ""), [(f"`{shown(p)}`", p.help or "") for p in arguments]),
            table(
                ("option", "", "default"),
                [
                    (
                        ", ".join(f"`{o}`" for o in sorted(p.opts, key=len)),
                        p.help or "",
                        default(p),
                    )
                    for p in options
                ],
            ),
        ]
    )  # fmt: skip


def shown(argument: Any) -> str:
    text = (argument.metavar or argument.name).upper().strip("[]{}.")
    text += " ..." if argument.nargs == -1 else ""
    return text if argument.required else f"[{text}]"


def default(option: Any) -> str:
    return (
        ""
        if option.default in (None, False, ()) or callable(option.default)
        else f"`{option.default}`"
    )


# Formats


def robot_file() -> str:
    """The keys of a robot file, table by table, from its JSON Schema."""
    schema = json_schema()
    parts = [section("Top level", schema)]
    parts += [section(heading(name), part) for name, part in schema["$defs"].items()]
    return "\n".join(parts)


HEADINGS = {
    "Frame": "frames",
    "Loop": "loops",
    "Element": "elements",
    "Drives": "drives",
    "LimitsTable": "limits",
}


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
    return f"## {title}\n\n{schema.get('description', '')}\n\n" + table(
        ("key", "holds", "default", ""), rows
    )


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
        return (
            "table of " + kind(schema["additionalProperties"])
            if isinstance(schema.get("additionalProperties"), Mapping)
            else "table"
        )
    names = {
        "string": "text",
        "number": "number",
        "integer": "whole number",
        "boolean": "true or false",
        "array": "list",
    }
    return " or ".join(names.get(t, t) for t in ([types] if isinstance(types, str) else types))


def code(value: Any) -> str:
    return "" if value is None else f"`{json.dumps(value, ensure_ascii=False, default=to_mapping)}`"


def study_file() -> str:
    """The sections of a study file from the settings classes: what each holds, its keys, types and
    defaults.
    """
    parts = [f"{prose(Study)}\n\n{keys(Study)}"]
    parts += [f"## `{path}`\n\n{prose(cls)}\n\n{keys(cls)}" for path, cls in settings(Study)]
    return "\n".join(parts)


def settings(cls: type, path: str = "") -> Iterator[tuple[str, type]]:
    """The dataclasses within a dataclass, each with the dotted key it stands under, in the order of
    the file.
    """
    for key, hint in get_type_hints(cls).items():
        for inner in classes(hint):
            if not (cls is not Study and inner.__name__ == "RecordSettings"):  # described once
                here = f"{path}.{key}" if path else key
                if hasattr(inner, "family"):
                    here += f" of family {inner.family}"
                yield here, inner
                yield from settings(inner, here)


def classes(hint: Any) -> Iterator[type]:
    if is_dataclass(hint) and isinstance(hint, type):
        yield hint
    for inner in get_args(hint):
        yield from classes(inner)


def prose(cls: type) -> str:
    """The docstring of a settings class but its attributes, which the table of its keys holds."""
    return "\n\n".join(
        docstrings.paragraph(part)
        for part in docstrings.paragraphs(
            docstrings.sections(inspect.cleandoc(cls.__doc__ or "").splitlines())[0][1]
        )
    )


def keys(cls: Any) -> str:
    hints, meanings = get_type_hints(cls, include_extras=False), meaning(cls)
    rows = [
        (f"`{f.name}`", words(hints[f.name]), given(f), meanings.get(f.name, ""))
        for f in fields(cls)
    ]
    return table(("key", "holds", "default", ""), rows)


def meaning(cls: type) -> dict[str, str]:
    """{key: what its docstring says, or that of its base, with shape and unit} of a settings class."""
    found = {}
    texts = [inspect.cleandoc(base.__doc__ or "") for base in reversed(cls.__mro__)]
    parts = [part for text in texts for part in docstrings.sections(text.splitlines())]
    for title, lines in parts:
        for names, kind, said in docstrings.entries(lines) if title == "Attributes" else ():
            unit = ", ".join(
                part
                for part in kind.split(", ")[1:]
                if not part.startswith(("tuple", "or ", "list"))
            )
            for name in names.split(", "):
                found[name] = docstrings.text(said + (f" ({unit})" if unit else ""))
    return found


def words(hint: Any) -> str:
    """A type hint in words."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Literal:
        return " or ".join(f"`{v}`" for v in inner)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys("null" if a is type(None) else words(a) for a in inner))
    if origin is tuple:
        return (
            f"list of {words(inner[0])}"
            if inner[-1] is Ellipsis
            else "[" + ", ".join(map(words, inner)) + "]"
        )
    if is_dataclass(hint):
        return "section"
    if origin is not None:
        return "table"
    return {"int": "whole number", "float": "number", "str": "text", "bool": "true or false"}.get(
        getattr(hint, "__name__", ""), "any"
    )


def given(field: Field[Any]) -> str:
    """The default of a key, as it would be written."""
    if field.default_factory is not MISSING:
        value = field.default_factory()
        return "" if is_dataclass(value) or value == {} else code(value)
    if field.default is MISSING:
        return "required"
    value = to_mapping(field.default) if is_dataclass(field.default) else field.default
    return code(list(value) if isinstance(value, tuple) else value) or "`null`"


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
            f"## {name}", "",
            f"{docstrings.text(description.title or name)}. Actuated joints: "
            f"{len(description.joints)}; frames: {len(description.frames)}; "
            f"{len(regrouping)} base parameters of {len(description.parameters)}.", "",
            f'<p><a href="../robots/{name}.html"><img src="../robots/{name}.svg" alt="skeleton of {name}">'
            f"<br>{name}: frames, formulas, the skeleton to turn</a></p>", "",
            f"```text\n{formulas}\n```" if formulas else "", "",
            docstrings.text(" ".join((description.source or "").split())), "",
        ]
    )  # fmt: skip
