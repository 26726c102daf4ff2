"""Conversion of YAML 1.2 texts to plain values, with line numbers of all keys and limits of size.

Only the parts of YAML that settings need are accepted: mappings, lists and scalars of the core
schema. Anchors, aliases, tags, merge keys, repeated keys and second documents are refused, so that
a person sees all values in the file, and no text expands to a larger one in memory.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from io import StringIO
from typing import TYPE_CHECKING, Any

from runtime.ground.errors import InputError, SettingsError, first_line
from runtime.ground.limits import LIMIT

if TYPE_CHECKING:
    from ruamel.yaml import Node

YAML_LEVELS = 50
"""Depth of a study file, levels."""
YAML_VALUES = 20000
"""Keys and values of a study file, and the ends of its lists: counted in about half a second, before anything is built, values."""

Path = tuple[str | int, ...]

NUMBER = re.compile(
    r"(?P<whole>[-+]?[0-9]{1,40})|[-+]?(\.[0-9]{1,400}|[0-9]{1,400}(\.[0-9]{0,400})?)([eE][-+]?[0-9]{1,3})?"
)
CONSTANTS: dict[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


def yaml_values(text: str, *, file: str) -> tuple[Any, dict[Path, int]]:
    """Convert a YAML text to plain values; also return the line number of every key.

    Line numbers start at 1, and a key is identified by its path. Plain values are dict (keys as
    texts), list, str, int, float, bool and None. A SettingsError names file and line.
    """
    if len(text) > LIMIT.YAML_CHARACTERS:
        raise InputError(
            f"the file has {len(text)} characters; expected at most {LIMIT.YAML_CHARACTERS}",
            file=file,
        )
    from ruamel.yaml.error import MarkedYAMLError

    lines: dict[Path, int] = {}
    try:
        _require_plain(text, file)
        node = _yaml().compose(text)
        return (None if node is None else _value(node, (), lines, file)), lines
    except InputError:
        raise
    except MarkedYAMLError as e:
        mark = e.problem_mark or e.context_mark
        raise SettingsError(
            f"the text is not YAML: {e.problem or e.context}",
            file=file,
            line=None if mark is None else mark.line + 1,
        ) from None
    except Exception as e:  # the scanner raises IndexError, AttributeError and others too
        raise SettingsError(f"the text is not YAML: {first_line(e)}", file=file) from None


def yaml_text(mapping: Mapping[str, Any], comments: Mapping[Path, str] | None = None) -> str:
    """Write a mapping of plain values as YAML, with keys in their order.

    Lists of numbers are on one line.

    comments : comment at the end of the line that has the key of each path.
    """
    if comments:
        return _commented(yaml_text(mapping), comments)
    yaml = _yaml()
    yaml.default_flow_style = None
    yaml.sort_base_mapping_type_on_output = False
    yaml.width = 140
    stream = StringIO()
    yaml.dump(mapping, stream)
    return stream.getvalue()


def _commented(text: str, comments: Mapping[Path, str]) -> str:
    """Add comments at the ends of the lines of a YAML text, each at the line of its path.

    A key inside a mapping on one line, such as {t: s, q: rad}, has its comment at the end of that
    line.
    """
    _, numbers = yaml_values(text, file="study")
    lines = text.split("\n")
    told: dict[int, list[str]] = {}
    for path, comment in comments.items():
        places = (path[:k] for k in range(len(path), -1, -1) if path[:k] in numbers)
        told.setdefault(numbers[next(places)] - 1, []).append(" ".join(comment.split()))
    for number, said in told.items():
        lines[number] += f"  # {'; '.join(said)}"
    return "\n".join(lines)


def _yaml() -> Any:
    """Return a reader and writer of YAML 1.2; its package is loaded by the first call of this
    function.
    """
    from ruamel.yaml import YAML

    return YAML(typ="safe", pure=True)


def _require_plain(text: str, file: str) -> None:
    """Raise SettingsError if a YAML text has tags or anchors, is too deep or has too many values.

    The test comes before any value is built from the text.
    """
    depth = 0
    documents = 0
    for count, event in enumerate(_yaml().parse(text)):
        kind = type(event).__name__
        depth += kind.endswith("StartEvent") - kind.endswith("EndEvent")
        documents += kind == "DocumentStartEvent"
        refused = ""
        if kind == "AliasEvent" or getattr(event, "anchor", None) is not None:
            refused = "anchors and aliases (& and *) are not supported; write the value itself"
        elif getattr(event, "tag", None) not in (None, "!"):
            refused = "tags (!) are not supported; write a plain value"
        elif documents > 1:
            refused = "a second document starts here; expected one document per file"
        elif depth > YAML_LEVELS + 2 or count > YAML_VALUES:
            refused = f"nested deeper than {YAML_LEVELS} levels or more than {YAML_VALUES} keys and values; write fewer"
        if refused:
            raise SettingsError(refused, file=file, line=event.start_mark.line + 1)


def _value(node: Node, path: Path, lines: dict[Path, int], file: str) -> Any:
    """Convert a YAML node to a plain value; store its line number and those of its keys."""
    from ruamel.yaml import MappingNode, ScalarNode

    lines.setdefault(path, node.start_mark.line + 1)
    if isinstance(node, ScalarNode):
        return node.value if node.style is not None else _scalar(node.value)
    if not isinstance(node, MappingNode):
        return [_value(item, (*path, k), lines, file) for k, item in enumerate(node.value)]
    table: dict[str, Any] = {}
    for key, item in node.value:
        line = key.start_mark.line + 1
        if not isinstance(key, ScalarNode) or key.value == "<<":
            raise SettingsError(
                "this key is not a name; use a plain word (merge keys << and lists as keys are not supported)",
                path=path,
                file=file,
                line=line,
            )
        name = str(key.value)
        place = (*path, name)
        if name in table:
            raise SettingsError(
                f"key {name!r:.60} is given twice (first on line {lines[place]}); keep one",
                path=path,
                file=file,
                line=line,
            )
        lines[place] = line
        table[name] = _value(item, place, lines, file)
    return table


def _scalar(text: str) -> Any:
    """Convert a YAML scalar to None, bool, int or float; any other word stays a text."""
    if text in CONSTANTS:
        return CONSTANTS[text]
    number = NUMBER.fullmatch(text)
    if number is None:
        return text
    if number["whole"]:
        return int(text)
    value = float(text)
    return value if value - value == 0 else text
