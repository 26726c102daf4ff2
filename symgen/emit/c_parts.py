"""A long body of C in parts, each a function of its own: the time of compilers grows faster than a
function. Values that later parts read stand in an array, `kept`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from symgen.emit.printers import Section, under_titles

Titled = tuple[str, Sequence[str]]  # lines that belong together, under a title


@dataclass(frozen=True)
class Part:
    """The lines of a part over `lanes` samples, and all words in them."""

    sections: tuple[Section, ...]
    read: frozenset[str]


def in_parts(
    inputs: Sequence[str], steps: Sequence[Titled], results: Sequence[Titled], longest: int
) -> tuple[list[Part], int]:
    """Steps `const real x = ...;` cut after every `longest`, results behind the last step that they
    read, each part with the inputs it reads; and the number of values that are kept.
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
    """Collect the names in lines of C, without those in comments."""
    return frozenset(word for line in lines for word in re.findall(r"\w+", line.partition("/*")[0]))


def read_by(read: frozenset[str], steps: Sequence[str]) -> list[str]:
    """Select the steps `const real x = ...;` that compute the names in `read`, and those that these need."""
    needed = []
    for step in reversed(steps):
        if step.split()[2] in read:
            read |= words([step])
            needed.append(step)
    return needed[::-1]
