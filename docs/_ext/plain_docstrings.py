"""Our docstrings are plain text: equations laid out by eye, `names` in backquotes, entries "name : meaning". Here they become what Sphinx reads.

A paragraph that is indented is kept as it stands; entries become a list; all else is text in which no character means anything but `code`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from sphinx.application import Sphinx

ENTRY = re.compile(r"^(?P<names>`?\w+`?(?:, `?\w+`?)*) : (?P<meaning>.+)$")
SECTION = re.compile(r"^-{3,}$")


def text(line: str) -> str:
    """One line of prose: `code` as code, the rest escaped."""
    parts = re.split(r"``?([^`]+)``?", line)
    return "".join(code(part) if i % 2 else escaped(part) for i, part in enumerate(parts))


def escaped(part: str) -> str:
    return re.sub(r"([\\*_|`<>])", r"\\\1", part)


def code(part: str) -> str:
    return f"``{part.strip()}``\\ " if part.strip() else ""


def entries(lines: Sequence[str]) -> list[str] | None:
    """A list of the entries of a paragraph, several on a line apart by three blanks, or None where it holds none."""
    if not ENTRY.match(lines[0]):
        return None
    found: list[str] = []
    for line in (part for whole in lines for part in re.split(r"(?<=[.;]) {2,}", whole.strip())):
        match = ENTRY.match(line)
        if match:
            found.append(f"- ``{match['names'].replace('`', '')}``: {text(match['meaning'])}")
        else:
            found[-1] += " " + text(line)
    return found


def paragraphs(lines: Sequence[str]) -> list[list[str]]:
    """Split at blank lines, and where the indentation begins or ends."""
    found: list[list[str]] = [[]]
    for line in lines:
        if not line.strip():
            found.append([])
        elif found[-1] and indented(line) != indented(found[-1][-1]) and not ENTRY.match(found[-1][0]):
            found.append([line])
        else:
            found[-1].append(line)
    return [part for part in found if part]


def indented(line: str) -> bool:
    return line.startswith("    ")


def restructured(lines: Sequence[str]) -> list[str]:
    """reStructuredText of a docstring."""
    result: list[str] = []
    for part in paragraphs([line for line in lines if not SECTION.match(line.strip())]):
        if indented(part[0]):
            result += ["::", "", *("  " + line for line in part), ""]
        else:
            result += [*(entries(part) or [text(line) for line in part]), ""]
    return result


def process(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    lines[:] = restructured(lines)


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", process)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
