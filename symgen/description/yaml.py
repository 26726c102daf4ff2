"""YAML 1.2 text to plain data with line numbers, and from there to a checked Robot.

Only what a table of numbers needs is read: mappings, lists and scalars of the core schema. Tags, anchors and aliases, merge
keys, repeated keys, second documents and non-finite numbers are refused, so that a file means what it shows. Whatever the
bytes are, the only exception that leaves this module is DescriptionError, with file and line.
"""

from __future__ import annotations

import hashlib
import re
from typing import Any

from pydantic import ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentEndEvent,
    Event,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

from symgen.description import robot as model
from symgen.description.advice import yaml_advice
from symgen.description.build import build
from symgen.description.robot import Robot
from symgen.description.schema import SCHEMA, RobotFile, explain
from symgen.errors import DescriptionError

MAX_BYTES, MAX_NESTING, MAX_SCALAR = 200_000, 12, 4000

_INTEGER = re.compile(r"[-+]?[0-9]{1,15}\Z")
_DECIMAL = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]{1,3})?\Z")
_CONSTANTS: dict[str, bool | None] = {"": None, "~": None, "null": None, "Null": None, "NULL": None}
_CONSTANTS |= {word: value for value, words in ((True, "true True TRUE"), (False, "false False FALSE")) for word in words.split()}


def parse_robot(content: bytes, file: str) -> Robot:
    """The robot described by the bytes of a file called `file`."""
    lines: dict[model.Path, int] = {}
    try:
        data = _document(content, lines)
        _check_version(data)
        try:
            table = RobotFile.model_validate(data)
        except ValidationError as error:
            message, path = explain(error)
            raise DescriptionError(message, path=path) from error
        return build(table, file=file, sha256=hashlib.sha256(content).hexdigest())
    except DescriptionError as error:
        line = error.line or next((lines[error.path[:k]] for k in range(len(error.path), -1, -1) if error.path[:k] in lines), 1)
        raise DescriptionError(error.message, path=error.path, file=file, line=line) from error.__cause__


def _check_version(data: Any) -> None:
    if not isinstance(data, dict):
        raise DescriptionError(
            f"found {'nothing' if data is None else repr(data)[:60]}; expected a robot file: a table that starts with `symgen: {SCHEMA}`"
        )
    version = data.get("symgen")
    if isinstance(version, bool) or version != SCHEMA:
        given = f"symgen: {version!r}"[:60] if "symgen" in data else "no key `symgen`"
        raise DescriptionError(f"{given}; expected `symgen: {SCHEMA}`, the schema version this release reads", path=("symgen",))


def _document(content: bytes, lines: dict[model.Path, int]) -> Any:
    """Plain data of the one document in `content`; `lines` receives the line of every key path."""
    if len(content) > MAX_BYTES:
        raise DescriptionError(f"more than {MAX_BYTES} bytes; a robot file has a few thousand")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise DescriptionError(f"byte 0x{content[error.start]:02x} is not UTF-8; save the file as UTF-8", line=line) from error
    try:
        events = YAML(typ="safe", pure=True).parse(text)
        return _Reader(iter(events), lines).document()
    except DescriptionError:
        raise
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        problem = str(error.problem or error.context)
        raise DescriptionError(f"not YAML: {problem}{yaml_advice(problem)}", line=mark.line + 1 if mark else None) from error
    except Exception as error:  # on malformed text the scanner also raises IndexError, AttributeError and others: none of it is YAML
        raise DescriptionError(f"not YAML: {str(error).splitlines()[0] if str(error) else type(error).__name__}") from error


class _Reader:
    """Builds plain data from the events of one document."""

    def __init__(self, events: Any, lines: dict[model.Path, int]) -> None:
        self.events, self.lines = events, lines

    def next(self) -> Event:
        event: Event = next(self.events)
        line = event.start_mark.line + 1
        if isinstance(event, AliasEvent) or getattr(event, "anchor", None) is not None:
            raise DescriptionError("anchors and aliases (& and *) are not read; write the value out", line=line)
        if getattr(event, "tag", None) not in (None, "!"):
            raise DescriptionError("tags (!) are not read; write a plain value", line=line)
        return event

    def document(self) -> Any:
        data = None
        for event in iter(self.next, None):
            if isinstance(event, ScalarEvent | MappingStartEvent | SequenceStartEvent):
                data = self.value(event, ())
            elif isinstance(event, DocumentEndEvent):
                break
            elif type(event).__name__ == "StreamEndEvent":
                return None
        end = self.next()
        if type(end).__name__ != "StreamEndEvent":
            raise DescriptionError("a second document starts here; a robot file holds one", line=end.start_mark.line + 1)
        return data

    def value(self, event: Event, path: model.Path) -> Any:
        self.lines.setdefault(path, event.start_mark.line + 1)
        if len(path) > MAX_NESTING:
            raise DescriptionError(f"nested more than {MAX_NESTING} deep", line=event.start_mark.line + 1)
        if isinstance(event, MappingStartEvent):
            return self.mapping(path)
        if isinstance(event, SequenceStartEvent):
            items: list[Any] = []
            while not isinstance(item := self.next(), SequenceEndEvent):
                items.append(self.value(item, (*path, len(items))))
            return items
        return _scalar(event)

    def mapping(self, path: model.Path) -> dict[Any, Any]:
        table: dict[Any, Any] = {}
        while not isinstance(event := self.next(), MappingEndEvent):
            line = event.start_mark.line + 1
            key = _scalar(event) if isinstance(event, ScalarEvent) else None
            if not isinstance(key, int | str) or isinstance(key, bool) or key == "<<":
                raise DescriptionError(f"key {getattr(event, 'value', '[...]')!r:.40}: expected a name or a whole number", line=line)
            if key in table:
                raise DescriptionError(
                    f"key {key!r} is given twice (first on line {self.lines[(*path, key)]}); keep one", path=(*path, key), line=line
                )
            self.lines[(*path, key)] = line
            table[key] = self.value(self.next(), (*path, key))
        return table


def _scalar(event: Any) -> Any:
    """null, bool, int and float of the YAML 1.2 core schema when plain, else text."""
    text: str = event.value
    if len(text) > MAX_SCALAR:
        raise DescriptionError(f"text of {len(text)} characters; at most {MAX_SCALAR} are read", line=event.start_mark.line + 1)
    if event.style is not None:
        return text
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if _INTEGER.match(text):
        return int(text)
    if _DECIMAL.match(text) and (number := float(text)) - number == 0:
        return number
    return text
