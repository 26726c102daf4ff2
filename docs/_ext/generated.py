"""Lines `<!-- generated: NAME ARGUMENT -->` of a page become Markdown made from the program itself each time the site is built."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

import reference
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

MARK = re.compile(r"^<!-- generated: (?P<name>\w+)(?: (?P<argument>[\w. ]+))? -->$", re.MULTILINE)
SOURCES: dict[str, Callable[..., str]] = {
    "commands": reference.commands,
    "examples": reference.examples,
    "modules": reference.modules,
    "names": reference.names,
    "robot_file": reference.robot_file,
    "robots": reference.robots,
    "study_file": reference.study_file,
}


def fill(app: Sphinx, page: str, source: list[str]) -> None:
    source[0] = MARK.sub(lambda mark: SOURCES[mark["name"]](*(mark["argument"] or "").split()), source[0])


def always(app: Sphinx, environment: BuildEnvironment, added: set[str], changed: set[str], removed: set[str]) -> Iterable[str]:
    """Generated pages are read anew at each build."""
    return [page for page in environment.found_docs if MARK.search(environment.doc2path(page).read_text(encoding="utf-8"))]


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", fill)
    app.connect("env-get-outdated", always)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
