"""Split a long C function body into parts, each a C function of its own.

The time of compilers grows faster than the length of a function. Values that later parts need are
stored in an array `kept`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from symgen.emit.printers import Section, under_titles

Titled = tuple[str, Sequence[str]]  # lines that belong together, under a title


class Part(NamedTuple):
    """One part of a long C function body: its lines, and the names that occur in these lines."""

    sections: tuple[Section, ...]
    read: frozenset[str]


def in_parts(
    inputs: Sequence[str], steps: Sequence[Titled], results: Sequence[Titled], longest: int
) -> tuple[list[Part], int]:
    """Split the body of a C function into parts of at most `longest` steps; a step computes one
    variable.

    A result belongs to the part of the last step that it depends on. Each part loads the inputs
    that it uses. Return the parts, and the number of values that must be stored for later parts.
    """
    chunks = [list(steps[k : k + longest]) for k in range(0, len(steps), longest)]
    place = {lines[0].split()[2]: p for p, chunk in enumerate(chunks) for _, lines in chunk}
    for title, lines in results:
        last = max((place.get(word, 0) for word in words(lines)), default=0)
        chunks[last].append((title, lines))
    read = [words([line for _, lines in chunk for line in lines]) for chunk in chunks]
    crossing = [x for x, p in place.items() if any(x in later for later in read[p + 1 :])]
    row = {x: k for k, x in enumerate(crossing)}
    parts = []
    for p, chunk in enumerate(chunks):
        recalled = [
            f"const real {x} = AT(kept, {k});"
            for x, k in row.items()
            if x in read[p] and place[x] < p
        ]
        saved = [f"AT(kept, {k}) = {x};" for x, k in row.items() if place[x] == p]
        own = [("Inputs", line) for line in (*read_by(read[p], inputs), *recalled)]
        own += [(title, line) for title, lines in chunk for line in lines]
        own += [("Read by later parts", line) for line in saved]
        parts.append(Part(under_titles(own), words([line for _, line in own])))
    return parts, len(row)


def words(lines: Sequence[str]) -> frozenset[str]:
    """Collect the names that occur in lines of C code, except in comments."""
    return frozenset(word for line in lines for word in re.findall(r"\w+", line.partition("/*")[0]))


def read_by(read: frozenset[str], steps: Sequence[str]) -> list[str]:
    """Select the C lines that compute the variables `read`, and all lines that these depend on.

    Each step has the form `const real x = ...;`.
    """
    needed = []
    for step in reversed(steps):
        if step.split()[2] in read:
            read |= words([step])
            needed.append(step)
    return needed[::-1]
