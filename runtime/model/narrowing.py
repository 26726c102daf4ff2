"""An emitted regressor that evaluates some entries alone: what only the others need is left out of
its text, in NumPy or C.

The body of a regressor is straight-line code, so that one pass from its end finds what the wanted
entries need: D[k, j] of a module, signals D[s]
of a C file. Shapes stay: the other entries are never written. Same operations on the same numbers,
hence the same bits.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Collection, Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import cast

from runtime.model.generated import GeneratedModel
from runtime.model.loading import run

BLOCK = "_regressor_block"  # fills D, shape (b, n, N)
# begins each C function of the body: its parts, then the one that calls them, which has loops of
# its own before
TILE = "/* One tile of regressor"
BODY_ENDS = "/* Entries that are not zero"
STATEMENT = re.compile(r"\s*(?:const double )?(?P<target>\w+(?:\[\d+\]\[t\])?) = (?P<value>[^;]*);")
BEGINS = re.compile(r"\s*(?:const double )?\w+(?:\[\d+\]\[t\])? = ")
TILE_ARRAY = re.compile(r"void regressor_lanes\([^)]*double (D_*)\[restrict")
VALUE = re.compile(r"\w+\[\d+\]\[t\]|[A-Za-z_]\w*")


def narrowed(model: GeneratedModel, entries: Collection[tuple[int, int]]) -> GeneratedModel:
    """The model, its regressor filling the `entries` of D alone; `model` itself where it has no
    text in NumPy.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    entries : collection of (int, int)
        Column k and joint j of each entry D[k, j] wanted, shape (b, n).
    """
    return _narrowed(model, frozenset(entries)) if isinstance(model, ModuleType) else model


@lru_cache(maxsize=8)
def _narrowed(model: ModuleType, entries: frozenset[tuple[int, int]]) -> GeneratedModel:
    """`narrowed`, compiled once for the studies of a process that have the same columns."""
    source = getattr(model.__loader__, "get_source", None)
    tree = ast.parse(source(model.__name__) if source else "")
    block = next(
        (node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == BLOCK),
        None,
    )
    if block is None:
        return cast(GeneratedModel, model)
    D = next(a.arg for a in block.args.args if a.arg.rstrip("_") == "D")  # D_ beside a constant D
    block.body = _needed(block.body, D, {f"{D}[{k}, {j}]" for k, j in entries})
    return cast(GeneratedModel, run(ast.unparse(tree), Path(str(model.__file__))))


def narrowed_source(text: str, signals: Collection[int]) -> str:
    """The C file of a model, its regressor giving the distinct `signals` alone, by their
    numbers.
    """
    lines = text.split("\n")
    starts = [k for k, line in enumerate(lines) if line.startswith(TILE)]
    end = next((k for k, line in enumerate(lines) if line.startswith(BODY_ENDS)), 0)
    functions = [range(a, b) for a, b in pairwise([*starts, end])]
    D = next(iter(TILE_ARRAY.findall(text)), "D")
    needed = {f"{D}[{s}][t]" for s in signals}
    unused: set[int] = set()
    for function in (*reversed(functions[:-1]), *functions[-1:]):
        for rows in reversed(_statements(lines, function)):
            statement = STATEMENT.match(" ".join(lines[k].strip() for k in rows))
            if statement is None:
                continue
            if statement["target"] in needed:
                needed.discard(statement["target"])  # what it held before is not needed
                needed.update(VALUE.findall(statement["value"]))
            else:
                unused.update(rows)
    return "\n".join(line for k, line in enumerate(lines) if k not in unused)


def _statements(lines: Sequence[str], function: range) -> list[range]:
    """The lines of each statement: one, or those up to its semicolon."""
    statements, start = [], None
    for k in function:
        start = k if start is None else start
        if BEGINS.match(lines[start]) and ";" not in lines[k]:
            continue
        statements.append(range(start, k + 1))
        start = None
    return statements


def _needed(body: list[ast.stmt], D: str, wanted: set[str]) -> list[ast.stmt]:
    """The statements that the values called `wanted` need, in order."""
    needed, kept = {*wanted}, []
    for statement in reversed(body):
        if isinstance(statement, ast.Assign) and needed.isdisjoint(
            name for target in statement.targets for name in _names(target, D)
        ):
            continue
        needed |= _names(statement.value if isinstance(statement, ast.Assign) else statement, D)
        kept.append(statement)
    return kept[::-1]


def _names(e: ast.AST, D: str) -> set[str]:
    """Names of the values in a piece of text: variables, and entries of the store `D` as "D[7,
    1]".
    """
    entries = {
        ast.unparse(node)
        for node in ast.walk(e)
        if isinstance(node, ast.Subscript) and ast.unparse(node.value) == D
    }
    return entries | {
        node.id for node in ast.walk(e) if isinstance(node, ast.Name) and node.id != D
    }
