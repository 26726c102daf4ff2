"""Text that a mechanical wrap has torn: `python .ci/reflow.py PATH...` names each place, exit code 1.

ragged    a line of a docstring or comment that ends within a sentence, though the next word fits
literals  two string literals on one line, or one of two words at a break: "robot " "file"
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

WIDTH, SLACK, NARROW = 100, 25, 72  # columns; of a paragraph at least, whatever it is wrapped to
SPECIAL = re.compile(
    r"\s*([-*+>|#]|\d+[.)]|>>>|\.\.|:\w+:?|```)"  # lists, doctests, directives, tables
    r"|\s*\S+( *, *\S+)* : |.*\S\s{3,}\S|.*[│┌└├─=]{3,}|\s*[-=~^]{3,}\s*$"  # entries, equations
)
ENDED = re.compile(r".*([.:;,!?…)\]}>`\"'=+*/(\\-]|--)$")  # a break there may be meant
Line = tuple[int, str]


def paragraphs(lines: list[Line]) -> Iterator[list[Line]]:
    """Runs of plain lines of one indent."""
    run: list[Line] = []
    for number, text in [*lines, (0, "")]:
        plain = bool(text.strip()) and not SPECIAL.match(text.strip())
        depth = len(text) - len(text.lstrip())
        if run and (not plain or depth != len(run[0][1]) - len(run[0][1].lstrip())):
            yield run
            run = []
        if plain:
            run.append((number, text))


def ragged(lines: list[Line]) -> Iterator[tuple[int, str]]:
    """Lines that stop although the next word fits with SLACK columns to spare."""
    for run in paragraphs(lines):
        goal = min(WIDTH, max(NARROW, *(len(text) for _, text in run)))
        for (number, text), (_, after) in pairwise(run):
            word = after.split()[0]
            meant = ENDED.match(text.rstrip()) or word[0].isupper() or word[0] in "`([{"
            if not meant and len(text.rstrip()) + 1 + len(word) + SLACK <= goal:
                yield number, f"ragged: {text.strip()} / {after.strip()}"


def texts(tree: ast.AST, source: list[str]) -> Iterator[list[Line]]:
    """Docstrings, and blocks of comments, as numbered lines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if first is not None and ast.get_docstring(node, clean=False) is not None:
                rows = range(first.lineno, (first.end_lineno or first.lineno) + 1)
                quotes = re.compile(r'^(\s*)[rRuU]*"""|"""\s*$')
                yield [(k, quotes.sub(r"\1", source[k - 1])) for k in rows]
    block: list[Line] = []
    for k, text in enumerate([*source, ""], 1):
        if comment := re.match(r"(\s*)#+ ?(?!!)(.*)$", text):
            block.append((k, f"{comment[1]}  {comment[2]}"))
        elif block:
            yield block
            block = []


def literals(text: str, source: list[str]) -> Iterator[tuple[int, str]]:
    """Adjacent literals that one would do for, or whose break leaves one of two words."""
    previous: tokenize.TokenInfo | None = None
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.STRING:
            if previous and previous.start[0] == previous.end[0] and token.start[0] == token.end[0]:
                one, two = previous.string, token.string
                bare = [x.lstrip("rfbuRFBU").strip("\"'") for x in (one, two)]
                whole = previous.start[1] + len(one) + len(two) - 1
                word = (bare[1].split() or [""])[0]
                torn = min(len(x.split()) for x in bare) <= 2 and (
                    whole <= WIDTH or previous.start[1] + len(one) + len(word) + SLACK <= WIDTH
                )
                ended = re.search(r"(\\n|[.:;!?] ?)$", bare[0])
                if re.search(r"[<=|\\{]", one + two):  # markup, code and parts of formats
                    previous = token
                    continue
                if previous.end[0] == token.start[0] or (torn and not ended):
                    yield previous.start[0], f"literals: {one} / {two}"
            previous = token
        elif token.type not in (tokenize.NL, tokenize.COMMENT):
            previous = None


def findings(path: Path) -> list[tuple[int, str]]:
    """Line and text of what is torn in one file."""
    text = path.read_text(encoding="utf-8")
    source = text.splitlines()
    found = {f for lines in texts(ast.parse(text), source) for f in ragged(lines)}
    return sorted(found | set(literals(text, source)))


def main(roots: list[str]) -> int:
    files = [
        f for root in map(Path, roots) for f in ([root] if root.is_file() else root.rglob("*.py"))
    ]
    torn = [(file, *found) for file in sorted(files) for found in findings(file)]
    for file, number, text in torn:
        print(f"{file}:{number}: {text[:160]}")
    return int(bool(torn))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
