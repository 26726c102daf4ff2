"""Layout of emitted files: the only module that fills in jinja2 templates of source files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from typing import TYPE_CHECKING

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


def laid_out(template: str, context: Mapping[str, object]) -> str:
    """Fill in the template `templates/<template>.jinja` and break lines that are too long.

    `context` holds the values for the template.
    """
    text = _environment().get_template(f"{template}.jinja").render(context)
    return "\n".join(_lines_that_fit(text.split("\n"), template.endswith((".c", ".h"))))


def _lines_that_fit(lines: Iterable[str], in_c: bool) -> Iterator[str]:
    """Yield the lines of a text, with lines longer than 100 columns broken at a space.

    A line stays long if it has no space at which the language allows a break.
    """
    in_text = False
    for line in lines:
        quotes = line.count('"""')
        while len(line) > WIDTH and (end := _end(line, in_c or in_text or quotes > 0)):
            yield line[:end].rstrip()
            indent = " " * (len(line) - len(line.lstrip()) + (0 if in_text or quotes else 4))
            remark = "# " if line.lstrip().startswith("# ") else ""
            line = f"{indent}{remark}{line[end:].lstrip()}"
        in_text ^= quotes % 2 == 1
        yield line


def _end(line: str, in_text: bool) -> int:
    """Find the column at which to break a line: its last suitable space within 100 columns.

    In code, only spaces inside brackets and outside strings count. The result is 0 without such a
    space.
    """
    start = len(line) - len(line.lstrip())
    free = in_text or line[start:].startswith("# ")
    depth, quote, end = 0, "", 0
    for k, c in enumerate(line[: WIDTH + 1]):
        if quote:
            quote = "" if c == quote else quote
        elif c in "\"'" and not free:
            quote = c
        elif c in "([{":
            depth += 1
        elif c in ")]}":
            depth -= 1
        elif c == " " and k > start + 4 and (free or depth > 0):
            end = k
    return end
