"""YAML 1.2 to plain values with the line of every key, within limits.

Only what settings need is read: mappings, lists and scalars of the core schema. Anchors, aliases,
tags, merge keys, repeated keys and second
documents are refused, so that a file means what it shows and no text grows in memory. The text is
read event by event and left at the first
thing that is too deep or too much.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from io import StringIO
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

from runtime.errors import InputError, SettingsError, first_line
from runtime.limits import LIMIT

Path = tuple[str | int, ...]


_INTEGER = re.compile(r"[-+]?[0-9]{1,40}\Z")
_DECIMAL = re.compile(
    r"[-+]?(\.[0-9]{1,400}|[0-9]{1,400}(\.[0-9]{0,400})?)([eE][-+]?[0-9]{1,3})?\Z"
)
_CONSTANTS: dict[str, bool | None] = {"": None, "~": None, "null": None, "Null": None, "NULL": None}
_CONSTANTS |= {
    word: value
    for value, words in ((True, "true True TRUE"), (False, "false False FALSE"))
    for word in words.split()
}


def yaml_values(text: str, *, file: str) -> tuple[Any, dict[Path, int]]:
    """Built-in dict (keys as texts), list, str, int, float, bool and None, and the line, from 1, of
    every key path; SettingsError with file and line.
    """
    if len(text) > LIMIT.YAML_CHARACTERS:
        raise InputError(
            f"{len(text)} characters; such a file has at most {LIMIT.YAML_CHARACTERS}", file=file
        )
    reader = _Reader(YAML(typ="safe", pure=True).parse(text), file)
    try:
        return reader.document(), reader.lines
    except InputError:
        raise
    except MarkedYAMLError as e:
        mark = e.problem_mark or e.context_mark
        raise SettingsError(
            f"not YAML: {e.problem or e.context}",
            file=file,
            line=None if mark is None else mark.line + 1,
        ) from None
    except Exception as e:  # the scanner raises IndexError, AttributeError and others too
        raise SettingsError(f"not YAML: {first_line(e)}", file=file) from None


def yaml_text(mapping: Mapping[str, Any]) -> str:
    """A mapping of plain values as YAML, keys in their order, lists of numbers on one line."""
    yaml: Any = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None
    yaml.sort_base_mapping_type_on_output = False
    yaml.width = 140
    stream = StringIO()
    yaml.dump(mapping, stream)
    return stream.getvalue()


class _Reader:
    """Builds plain values from the events of one document."""

    def __init__(self, events: Iterator[Event], file: str) -> None:
        self.events, self.file, self.count = events, file, 0
        self.lines: dict[Path, int] = {}

    def refuse(self, message: str, event: Event, path: Path = ()) -> SettingsError:
        return SettingsError(message, path=path, file=self.file, line=event.start_mark.line + 1)

    def next(self) -> Event:
        event: Event = next(self.events)
        if isinstance(event, AliasEvent) or getattr(event, "anchor", None) is not None:
            raise self.refuse(
                "anchors and aliases (& and *) are not read; write the value out", event
            )
        if getattr(event, "tag", None) not in (None, "!"):
            raise self.refuse("tags (!) are not read; write a plain value", event)
        return event

    def document(self) -> Any:
        self.next()  # start of the stream
        if not isinstance(self.next(), DocumentStartEvent):
            return None
        value = self.value(self.next(), ())
        self.next()  # end of the document
        if isinstance(more := self.next(), DocumentStartEvent):
            raise self.refuse("a second document starts here; such a file holds one", more)
        return value

    def value(self, event: Event, path: Path) -> Any:
        self.count += 1
        if len(path) > LIMIT.YAML_LEVELS or self.count > LIMIT.YAML_VALUES:
            raise self.refuse(
                (
                    f"nested deeper than {LIMIT.YAML_LEVELS} levels or more than "
                    f"{LIMIT.YAML_VALUES} values"
                ),
                event,
            )
        self.lines.setdefault(path, event.start_mark.line + 1)
        if isinstance(event, MappingStartEvent):
            return self.mapping(path)
        if isinstance(event, SequenceStartEvent):
            items: list[Any] = []
            while not isinstance(item := self.next(), SequenceEndEvent):
                items.append(self.value(item, (*path, len(items))))
            return items
        return _scalar(event)

    def mapping(self, path: Path) -> dict[str, Any]:
        table: dict[str, Any] = {}
        while not isinstance(event := self.next(), MappingEndEvent):
            if not isinstance(event, ScalarEvent) or event.value == "<<":
                raise self.refuse(
                    "a key that is no name; merge keys (<<) and lists as keys are not read",
                    event,
                    path,
                )
            key = str(event.value)
            if key in table:
                raise self.refuse(
                    (
                        f"key {key!r:.60} is given twice (first on line "
                        f"{self.lines[(*path, key)]}); "
                        "keep one"
                    ),
                    event,
                    path,
                )
            self.lines[(*path, key)] = event.start_mark.line + 1
            table[key] = self.value(self.next(), (*path, key))
        return table


def _scalar(event: Any) -> Any:
    """null, bool, int and float of the core schema when plain, else text."""
    text: str = event.value
    if event.style is not None:
        return text
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if _INTEGER.match(text):
        return int(text)
    if _DECIMAL.match(text) and (number := float(text)) - number == 0:
        return number
    return text
