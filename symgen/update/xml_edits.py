"""Replacement of numbers in an XML text; every other byte stays.

`symgen.description.xml_text` reads the text, refuses XML that is not plain, and gives the byte at
which each element starts. Here the start tag is read again, as bytes. An edit is a span of bytes
and the text that replaces these bytes. An attribute or element that does not exist yet is inserted,
and listed in `added`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from symgen.description.xml_text import XmlElement
from symgen.errors import DescriptionError

UNCHANGED = 1e-9  # of its size: a number that changes by less stays as it is written
ZERO = 1e-15  # SI; smaller numbers are zero
NAME = rb"[^\s=/>\"']+"
TAG = re.compile(
    rb"<(?P<tag>" + NAME + rb")(?:\s+" + NAME + rb"\s*=\s*(?:\"[^\"]*\"|'[^']*'))*\s*(?P<end>/?>)"
)
ATTRIBUTE = re.compile(rb"\s+(?P<name>" + NAME + rb")\s*=\s*(?P<quoted>\"[^\"]*\"|'[^']*')")
FIGURES = re.compile(rb"\S+")


@dataclass
class XmlEdits:
    """An XML text, and the edits to make in it, by byte position.

    Attributes
    ----------
    content : bytes
        The text as it was read.
    edits : list
        Start, end and replacement of each edit.
    added : list of str
        Sentences on what was inserted.
    """

    content: bytes
    edits: list[tuple[int, int, bytes]] = field(default_factory=list)
    added: list[str] = field(default_factory=list)

    def edited(self) -> bytes:
        """Return the text with all edits made."""
        parts, last = [], 0
        for start, end, text in sorted(self.edits, key=lambda edit: edit[:2]):
            parts += [self.content[last:start], text]
            last = end
        return b"".join([*parts, self.content[last:]])

    def set_numbers(
        self,
        e: XmlElement,
        name: str,
        values: Sequence[float],
        default: Sequence[float] | None = None,
    ) -> None:
        """Replace the first numbers of attribute `name` by `values`; equal numbers keep their text.

        Parameters
        ----------
        default : sequence of float
            Values that a missing attribute means; the attribute is added only if `values` differ
            from these. None: a missing attribute is always added.
        """
        span = self._value(e, name)
        if span is None:
            if default is None or not all(same(x, y) for x, y in zip(values, default, strict=True)):
                self._add(e, name, values)
            return
        words = list(FIGURES.finditer(self.content, *span))
        if [word[0].decode("ascii", "replace") for word in words] != e.attrib[name].split() or len(
            words
        ) < len(values):
            raise DescriptionError(
                f"<{e.tag} {name}>: the numbers are written as character references (&#...;); write digits",
                line=e.line,
            )
        for word, x in zip(words, values, strict=False):
            if not same(float(word[0]), x):
                self.edits.append((word.start(), word.end(), number(x).encode()))

    def set_word(self, e: XmlElement, name: str, word: str) -> None:
        """Replace the value of an attribute by another word."""
        span = self._value(e, name)
        if span is not None:
            self.edits.append((*span, word.encode()))
            self.added.append(f"line {e.line}: {name}={word} in <{e.tag}>")

    def replace_attribute(self, e: XmlElement, old: str, new: str, values: Sequence[float]) -> None:
        """Replace the attribute `old` by the attribute `new` with the numbers `values`."""
        match = self._attributes(e)[old.encode()]
        self.edits.append((match.start("name"), match.end(), f'{new}="{numbers(values)}"'.encode()))
        self.added.append(f"line {e.line}: {new} in place of {old} of <{e.tag}>")

    def insert_child(self, parent: XmlElement, text: str) -> None:
        """Insert an element before the first child of `parent`, with that child's indentation."""
        tag = self._tag(parent)
        end = tag.end()
        self.added.append(f"line {parent.line}: {text.partition(' ')[0]}> in <{parent.tag}>")
        if tag["end"] == b"/>":
            closed = b">" + text.encode() + b"</" + tag["tag"] + b">"
            self.edits.append((tag.start("end"), end, closed))
            return
        blank = re.match(rb"\s*", self.content[end:])
        space = blank[0] if blank else b""
        line = space[max(space.rfind(b"\n"), 0) :] if b"\n" in space else b""
        line = b"\r" + line if b"\r\n" in space else line
        self.edits.append((end, end, line + text.encode()))

    def _add(self, e: XmlElement, name: str, values: Sequence[float]) -> None:
        tag, attributes = self._tag(e), self._attributes(e)
        at = max((match.end() for match in attributes.values()), default=tag.end("tag"))
        self.edits.append((at, at, f' {name}="{numbers(values)}"'.encode()))
        self.added.append(f"line {e.line}: {name} of <{e.tag}>")

    def _value(self, e: XmlElement, name: str) -> tuple[int, int] | None:
        """Find the byte positions of an attribute value, without quotes; None if it is missing."""
        match = self._attributes(e).get(name.encode())
        return None if match is None else (match.start("quoted") + 1, match.end("quoted") - 1)

    def _attributes(self, e: XmlElement) -> dict[bytes, re.Match[bytes]]:
        tag = self._tag(e)
        return {
            match["name"]: match
            for match in ATTRIBUTE.finditer(self.content, tag.end("tag"), tag.start("end"))
        }

    def _tag(self, e: XmlElement) -> re.Match[bytes]:
        match = TAG.match(self.content, e.byte)
        if match is None or match["tag"] != e.tag.encode():
            raise DescriptionError(
                f"<{e.tag[:40]}> is not found in the text of the file; save the file as UTF-8",
                line=e.line,
            )
        return match


def same(x: float, y: float) -> bool:
    """Whether two numbers differ by no more than 1e-9 of their size (`UNCHANGED`), or both are
    zero.
    """
    return abs(x - y) <= max(UNCHANGED * max(abs(x), abs(y)), ZERO)


def number(x: float) -> str:
    """Write a number as the shortest decimal text that gives exactly this double."""
    return repr(float(x) + 0.0)


def numbers(values: Iterable[float]) -> str:
    return " ".join(map(number, values))
