"""Text from templates: the only place where jinja2 lays out an emitted file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache

from jinja2 import Environment, PackageLoader, StrictUndefined

WIDTH = 100


@lru_cache(maxsize=1)
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("symgen.emit"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def laid_out(template: str, context: Mapping[str, object]) -> str:
    """The text of `templates/<template>.jinja` with the values of `context`, in lines that fit."""
    text = _environment().get_template(f"{template}.jinja").render(context)
    return "\n".join(_lines_that_fit(text.split("\n"), template.endswith((".c", ".h"))))


def _lines_that_fit(lines: Iterable[str], in_c: bool) -> Iterator[str]:
    """Lines of at most WIDTH columns: long ones go on, indented, behind a space that may end
    one.
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
    """Where a line may end: the last space within WIDTH, in code outside strings and in
    brackets.
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
