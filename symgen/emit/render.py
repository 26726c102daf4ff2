"""Layout of emitted files: the only module that fills in jinja2 templates of source files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from typing import TYPE_CHECKING

from symgen.emit.printers import Language

if TYPE_CHECKING:
    from jinja2 import Environment
    from jinja2.bccache import Bucket

WIDTH = 100


@lru_cache(maxsize=1)
def _environment() -> Environment:
    from jinja2 import (  # slow to load
        Environment,
        FileSystemBytecodeCache,
        PackageLoader,
        StrictUndefined,
    )

    class Compiled(FileSystemBytecodeCache):
        def dump_bytecode(self, bucket: Bucket) -> None:
            with suppress(OSError):  # the disk is full
                super().dump_bytecode(bucket)

    try:  # templates that an earlier process compiled
        compiled = Compiled()
    except (OSError, RuntimeError):  # no temporary folder, or one of another user
        compiled = None
    return Environment(
        loader=PackageLoader("symgen.emit"),
        bytecode_cache=compiled,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def laid_out(template: str, context: Mapping[str, object], language: Language) -> str:
    """Fill in the template `templates/<template>.jinja` and break lines that are too long.

    `context` holds the values for the template.
    """
    text = _environment().get_template(f"{template}.jinja").render(context)
    return "\n".join(lines_that_fit(text.split("\n"), language))


def lines_that_fit(lines: Iterable[str], language: Language) -> Iterator[str]:
    """Yield the lines of a text, with lines longer than 100 columns broken at a space.

    A comment at the end of a long line gets a line of its own, before it. A line stays long if it
    has no space at which the language allows a break.
    """
    start, end = language.prose
    mark = f"{language.comment} "
    prose = False
    for line in lines:
        before = line[: len(line) - len(line.lstrip())]
        opens = not prose and line.lstrip().startswith(start)
        code, remark, comment = line.partition(f"  {mark}")
        if len(line) > WIDTH and remark and not prose and not opens and code.strip():
            yield from _fitted(f"{before}{mark}{comment}", before + mark, True, True, "")
            line = code.rstrip()
        if prose or opens:
            more = before + " " * (3 if opens and start != end else 0)
        else:
            more = before + (mark if line.lstrip().startswith(mark) else "    ")
        words = prose or opens or line.lstrip().startswith(mark)
        continues = "" if words else language.continues
        yield from _fitted(line, more, words, words or language.breaks, continues)
        marks = line.count(start) if start == end else line.count(start) - line.count(end)
        prose = prose ^ (marks % 2 == 1) if start == end else prose + marks > 0


def _fitted(line: str, more: str, words: bool, free: bool, continues: str) -> Iterator[str]:
    """Yield the parts of a line; all parts but the first start with `more`, all but the last end
    with `continues`.

    `words` : whether the line is a comment. `free` : whether the line may be broken outside
    brackets.
    """
    while len(line) > WIDTH and (end := _end(line, more, words, free, WIDTH - len(continues))):
        yield line[:end].rstrip() + continues
        line = f"{more}{line[end:].lstrip()}"
    yield line


def _end(line: str, more: str, words: bool, free: bool, width: int) -> int:
    """Find the column at which to break a line: its last suitable space within `width` columns.

    A space outside inner brackets is better, if it leaves no short line. Spaces inside strings do
    not count; in a comment, all spaces count. The result is 0 if there is no such space.
    """
    start = len(more) if line.startswith(more) else len(line) - len(line.lstrip())
    depth, quote = 0, ""
    ends: dict[int, int] = {}  # the last space at each depth of brackets
    for k, c in enumerate(line[: width + 1]):
        if quote:
            quote = "" if c == quote else quote
        elif c in "\"'" and not words:
            quote = c
        elif c in "([{":
            depth += 1
        elif c in ")]}":
            depth -= 1
        elif c == " " and k > start + 4 and (free or depth > 0):
            ends[0 if words else depth] = k
    good = [end for _, end in sorted(ends.items()) if end > width // 2]
    return [*good, *ends.values(), 0][0]
