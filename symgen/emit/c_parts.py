"""The body of a long kernel in parts, each a C function: compilers take time with the square of a
function's length.

What one part computes and a later one reads crosses over in a row of V, shape (rows, TILE); rows
are used again once their last reader is done.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from symgen.emit.printers import Section

LONG = 600  # lines; a body that is not longer stays whole
PART = 300  # lines of a part
WORD = re.compile(r"\b[A-Za-z_]\w*")
DEFINED = re.compile(r"const double (\w+) = ")


@dataclass(frozen=True)
class Part:
    """A function over one tile.

    Attributes
    ----------
    before : tuple of str
        Lines before its loop.
    sections : tuple of Section
        Lines of the loop.
    words : frozenset of str
        Every identifier in them.
    """

    before: tuple[str, ...]
    sections: tuple[Section, ...]
    words: frozenset[str]


def parts(
    before: Sequence[str], inputs: Sequence[str], sections: Sequence[Section]
) -> tuple[list[Part], int]:
    """The parts of a body and the rows of V; none where the body is short. `inputs` are lines that
    any part may repeat.
    """
    lines = [(section.title, line) for section in sections for line in section.lines]
    if len(lines) <= LONG:
        return [], 0
    count = -(-len(lines) // PART)
    size = -(-len(lines) // count)
    groups = [lines[start : start + size] for start in range(0, len(lines), size)]
    home = {
        name: p for p, group in enumerate(groups) for _, line in group if (name := _defined(line))
    }
    reads = [
        [name for name in words_of(line for _, line in group) if home.get(name, p) < p]
        for p, group in enumerate(groups)
    ]
    row, rows = _rows(home, reads)
    return [_part(before, inputs, groups[p], reads[p], row) for p in range(len(groups))], rows


def _rows(home: dict[str, int], reads: Sequence[Sequence[str]]) -> tuple[dict[str, int], int]:
    """Row of V of every quantity that crosses over, and how many rows there are."""
    last = {name: p for p, names in enumerate(reads) for name in names}
    row: dict[str, int] = {}
    free: list[int] = []
    rows = 0
    for p in range(len(reads)):
        for name in (name for name in last if home[name] == p):
            if not free:
                free, rows = [rows], rows + 1
            row[name] = free.pop()
        free += [row[name] for name in reads[p] if last[name] == p]
    return row, rows


def _part(
    before: Sequence[str],
    inputs: Sequence[str],
    group: Sequence[tuple[str, str]],
    reads: Sequence[str],
    row: dict[str, int],
) -> Part:
    words = words_of(line for _, line in group)
    own = [line for line in inputs if _defined(line) in words] + [
        f"const double {name} = V[{row[name]}][t];" for name in reads
    ]
    under: list[tuple[str, list[str]]] = [("Inputs", own)]
    for title, line in group:
        if title != under[-1][0]:  # the same heading may come again, later: lines stay in order
            under.append((title, []))
        name = _defined(line)
        under[-1][1].extend([line, f"V[{row[name]}][t] = {name};"] if name in row else [line])
    fixed = definitions(before, words)
    sections = tuple(Section(title, tuple(lines)) for title, lines in under if lines)
    return Part(
        fixed,
        sections,
        frozenset(words_of([*fixed, *(line for section in sections for line in section.lines)])),
    )


def definitions(before: Sequence[str], words: Iterable[str]) -> tuple[str, ...]:
    """The lines that define `words`, and what those need in turn."""
    wanted, lines = set(words), []
    for line in reversed(before):
        if _defined(line) in wanted:
            lines.append(line)
            wanted.update(words_of([line]))
    return tuple(reversed(lines))


def words_of(lines: Iterable[str]) -> dict[str, None]:
    """The identifiers of lines of C, in order."""
    return {word: None for line in lines for word in WORD.findall(line.partition("/*")[0])}


def _defined(line: str) -> str:
    match = DEFINED.match(line)
    return match[1] if match else ""
