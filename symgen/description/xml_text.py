"""Reader of XML files; it numbers the lines of elements and refuses unsafe constructs.

The file is read by expat alone. A document type (hence entities, internal or external) is refused
where it starts, depth and number of elements are limited during reading, and no file that the text
names is opened. Every error names its line.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from symgen.errors import DescriptionError

Array = np.ndarray
EXPAND = "this file is a xacro macro; expand it first (xacro FILE > robot.urdf)"
MAX_BYTES, MAX_DEPTH, MAX_ELEMENTS, LARGEST = 5_000_000, 30, 50_000, 1e9


class XmlElement(ElementTree.Element):
    """An element of an XML file, with the line and the byte at which it starts.

    `content` is the text between its tags, without the text of its children.
    """

    def __init__(self, tag: str, attributes: dict[str, str], line: int, byte: int) -> None:
        super().__init__(tag, attributes)
        self.line, self.byte, self.content = line, byte, ""

    if TYPE_CHECKING:  # an element holds elements of its class

        def __iter__(self) -> Iterator[XmlElement]: ...
        def iter(self, tag: str | None = None) -> Generator[XmlElement, None, None]: ...
        def find(self, path: str, namespaces: Any = None) -> XmlElement | None: ...

    def own(self, *tags: str) -> Iterator[XmlElement]:
        """Yield the child elements with the given tags, including those inside <frame> elements of
        an MJCF.
        """
        for child in self:
            if child.tag in tags:
                yield child
            elif child.tag == "frame":
                yield from child.own(*tags)

    def word(self, name: str, default: str | None = None) -> str:
        """Return the attribute `name` as text, or `default` if the attribute is missing.

        Raises DescriptionError if both are missing.
        """
        value = self.attrib.get(name, default)
        if value is None:
            raise DescriptionError(
                f"<{self.tag}> has no {name}; add this attribute", line=self.line
            )
        return value

    def numbers(
        self, name: str, n: int, default: str | None = None, largest: float = LARGEST
    ) -> Array:
        """Read an attribute that holds n finite numbers."""
        text = self.word(name, default)
        words = text.split()
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if len(words) != n or len(values) != n or not all(abs(x) <= largest for x in values):
            remedy = (
                f"; {EXPAND}" if "$" in text else "; put blanks in place of commas" * ("," in text)
            )
            raise DescriptionError(
                f"<{self.tag} {name}={text[:60]!r}>: expected {n} number{'s' * (n > 1)} of magnitude at most {largest:g}{remedy}",
                line=self.line,
            )
        return np.array(values)

    def number(self, name: str, default: str | None = None, largest: float = LARGEST) -> float:
        """Read an attribute that holds one finite number."""
        return float(self.numbers(name, 1, default, largest)[0])


def read_elements(content: bytes, max_depth: int = MAX_DEPTH) -> XmlElement:
    """Parse an XML file and return its root element.

    Raise DescriptionError, with the line, if the file is not plain XML.
    """
    if len(content) > MAX_BYTES:
        raise DescriptionError(
            f"the file has more than {MAX_BYTES} bytes; put meshes into separate files", line=1
        )
    parser = expat.ParserCreate()
    top = XmlElement("", {}, 0, 0)
    open_, count = [top], 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        line = parser.CurrentLineNumber
        if len(open_) > max_depth or count > MAX_ELEMENTS:
            raise DescriptionError(
                f"the XML elements are nested more than {max_depth} deep, or the file has more than {MAX_ELEMENTS} elements",
                line=line,
            )
        if tag.startswith("xacro:"):
            raise DescriptionError(
                f"<{tag}>: {EXPAND}",
                line=line,
            )
        open_.append(XmlElement(tag, attributes, line, parser.CurrentByteIndex))
        open_[-2].append(open_[-1])

    def characters(text: str) -> None:
        open_[-1].content += text

    def refuse(*_: object) -> int:
        raise DescriptionError(
            "the file declares a document type or an entity, which are not read; remove <!DOCTYPE ...>",
            line=parser.CurrentLineNumber,
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_.pop()
    parser.CharacterDataHandler = characters
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = parser.ExternalEntityRefHandler = (
        refuse
    )
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise DescriptionError(
            f"this is not valid XML: {expat.ErrorString(error.code)}", line=error.lineno
        ) from error
    except (LookupError, ValueError) as error:  # of an encoding that is not one
        raise DescriptionError(
            f"the encoding of this XML file cannot be read ({error}); save the file as UTF-8",
            line=1,
        ) from error
    return next(iter(top))
