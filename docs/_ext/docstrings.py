"""Docstrings as Markdown. Ours are plain text: equations laid out by eye, `names` in backquotes,
numpydoc sections, entries "name : meaning".
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from inspect import cleandoc

ENTRY = re.compile(r"^(?P<names>`?\*{0,2}\w+`?(?:, `?\*{0,2}\w+`?)*) : (?P<meaning>.+)$")
UNDERLINE = re.compile(r"^-{3,}$")
LIST = re.compile(r"^(- |\d+\. )")


def text(line: str) -> str:
    """A piece of prose: `code` as code, the rest without a meaning in Markdown."""
    parts = re.split(r"``?([^`]+)``?", line)
    return "".join(f"`{part.strip()}`" if i % 2 else escaped(part) for i, part in enumerate(parts))


def escaped(part: str) -> str:
    part = re.sub(r"([\\*<>$])", r"\\\1", part)
    return re.sub(r"(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])", r"\\_", part)


def markdown(doc: str | None) -> str:
    """A docstring; an indented paragraph is kept as it stands, a section becomes a list under its
    title.
    """
    parts: list[str] = []
    for title, lines in sections(cleandoc(doc or "").splitlines()):
        if not title:
            parts += [paragraph(block) for block in paragraphs(lines)]
        elif title in ("Notes", "Examples", "References", "See Also"):
            parts += [f"**{title}**", *(paragraph(block) for block in paragraphs(lines))]
        elif lines:
            parts += [f"**{title}**", "\n".join(bullet(*entry) for entry in entries(lines))]
    return "\n\n".join(part for part in parts if part)


def sections(lines: Sequence[str]) -> list[tuple[str, list[str]]]:
    """(title, lines) of the text before any section, then of each section of numpydoc."""
    found: list[tuple[str, list[str]]] = [("", [])]
    for line, after in zip(lines, [*lines[1:], ""], strict=True):
        if UNDERLINE.match(line.strip()):
            continue
        if UNDERLINE.match(after.strip()) and line.strip():
            found.append((line.strip(), []))
        else:
            found[-1][1].append(line)
    return found


def entries(lines: Sequence[str]) -> list[tuple[str, str, str]]:
    """(names, type, meaning) of the entries of a section: a line, the indented lines after it."""
    found: list[tuple[str, str, list[str]]] = []
    for line in (
        part
        for whole in lines
        if whole.strip()
        for part in re.split(r"(?<=[.;]) {2,}(?=`?\w+`? : )", whole.rstrip())
    ):
        if line.startswith(" ") and found:
            found[-1][2].append(line.strip())
        else:
            names, _, kind = line.strip().partition(" : ")
            found.append((names.replace("`", ""), kind, []))
    return [(names, kind, " ".join(meaning)) for names, kind, meaning in found]


def bullet(names: str, kind: str, meaning: str) -> str:
    shown = f"`{names}`" if kind or re.fullmatch(r"[\w., *\[\]|]+", names) else text(names)
    described = f" ({text(kind)})" if kind and meaning else f": {text(kind)}" if kind else ""
    return f"- {shown}{described}" + (f": {text(meaning)}" if meaning else "")


def paragraphs(lines: Sequence[str]) -> list[list[str]]:
    """Split at blank lines, and where the indentation begins or ends; an example stays whole."""
    found: list[list[str]] = [[]]
    for line in lines:
        if not line.strip():
            found.append([])
        elif (
            found[-1]
            and indented(line) != indented(found[-1][-1])
            and not found[-1][0].startswith(">>> ")
            and not ENTRY.match(found[-1][0])
            and not LIST.match(found[-1][0])
        ):
            found.append([line])
        else:
            found[-1].append(line)
    return [part for part in found if part]


def indented(line: str) -> bool:
    return line.startswith("    ")


def paragraph(lines: Sequence[str]) -> str:
    """Prose, a list of entries (several on a line apart by blanks), an example, or a block that
    stays.
    """
    if indented(lines[0]):
        return "\n".join(["```text", *(line[4:] for line in lines), "```"])
    if lines[0].startswith(">>> "):
        return "\n".join(["```pycon", *lines, "```"])
    if not ENTRY.match(lines[0]):
        return "\n".join(
            "\\" + line if line[:2] in ("+ ", "# ", "> ") else line for line in map(text, lines)
        )
    found: list[str] = []
    for line in (part for whole in lines for part in re.split(r"(?<=[.;]) {2,}", whole.strip())):
        match = ENTRY.match(line)
        if match:
            found.append(f"- `{match['names'].replace('`', '')}`: {text(match['meaning'])}")
        else:
            found[-1] += " " + text(line)
    return "\n".join(found)


def first_sentence(doc: str | None) -> str:
    """The first sentence of a docstring, on one line."""
    paragraph = " ".join(cleandoc(doc or "").partition("\n\n")[0].split())
    return text(re.split(r"(?<=[.])\s+(?=[A-Z`])", paragraph)[0])
