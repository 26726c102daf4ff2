"""Write the parts of the pages that are made from the program: `python docs/write_reference.py`.

The function NAME makes the text between `<!-- generated: NAME ARGUMENT -->` and `<!-- end -->`.
`--check` writes nothing. It names the pages that are not current and ends with exit code 1.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent), str(DOCS / "_ext")]

import api  # noqa: E402
import reference  # noqa: E402

MARK = re.compile(
    r"^<!-- generated: (?P<name>\w+)(?: (?P<argument>[\w.]+))? -->\n.*?^<!-- end -->$",
    re.MULTILINE | re.DOTALL,
)
SOURCES: dict[str, Callable[..., str]] = {
    "commands": reference.commands,
    "names": api.names,
    "robot_file": reference.robot_file,
    "robots": reference.robots,
    "study_file": reference.study_file,
}


def filled(text: str) -> str:
    """A page with its generated parts made anew."""

    def made(mark: re.Match[str]) -> str:
        begin = mark[0].split("\n", 1)[0]
        content = SOURCES[mark["name"]](*filter(None, [mark["argument"]]))
        return f"{begin}\n\n{tidy(content)}\n<!-- end -->"

    return MARK.sub(made, text)


def tidy(text: str) -> str:
    """Without blanks at the ends of lines and, outside of code, without more than one empty line in
    a row.
    """
    text = re.sub(r"[ \t]+$", "", text, flags=re.MULTILINE)
    parts = re.split(r"(^```.*?^```$)", text, flags=re.MULTILINE | re.DOTALL)
    return (
        "".join(
            part if k % 2 else re.sub(r"\n{3,}", "\n\n", part) for k, part in enumerate(parts)
        ).strip()
        + "\n"
    )


def pages() -> Iterator[tuple[Path, str]]:
    """(path, text) of every page with generated text."""
    for path in sorted(DOCS.rglob("*.md")):
        text = path.read_text(encoding="utf-8")
        if MARK.search(text):
            yield path, filled(text)


def outdated() -> dict[Path, str]:
    """{path: text it should have} of pages that are not current."""
    return {path: text for path, text in pages() if text != path.read_text(encoding="utf-8")}


def main() -> None:
    stale = outdated()
    for path, text in stale.items():
        if "--check" not in sys.argv:
            path.write_text(text, encoding="utf-8")
        print(
            f"{path.relative_to(DOCS.parent)}{' is not current' if '--check' in sys.argv else ''}"
        )
    if "--check" in sys.argv and stale:
        sys.exit("run python docs/write_reference.py")


if __name__ == "__main__":
    main()
