"""An emitted regressor that evaluates some entries alone: what only the others need is left out of its text, in NumPy or C.

The body of a regressor is straight-line code, so that one pass from its end finds what the wanted entries need: D[k, j] of a module, signals D[s]
of a C file. Shapes stay: the other entries are never written. Same operations on the same numbers, hence the same bits.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Collection
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import cast

from runtime.model.generated import GeneratedModel
from runtime.model.loading import run

BLOCK = "_regressor_block"  # fills D, shape (b, n, N)
TILE = "/* One tile of regressor"  # begins each C function of the body: its parts, then the one that calls them, which has loops of its own before
BODY_ENDS = "/* Entries that are not zero"
STATEMENT = re.compile(r"\s*(?:const double )?(?P<target>\w+(?:\[\d+\]\[t\])?) = (?P<value>[^;]*);")
VALUE = re.compile(r"\w+\[\d+\]\[t\]|[A-Za-z_]\w*")


def narrowed(model: GeneratedModel, entries: Collection[tuple[int, int]]) -> GeneratedModel:
    """The model, its regressor filling the `entries` of D alone; `model` itself where it has no text in NumPy.

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
    block = next((node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == BLOCK), None)
    if block is None:
        return cast(GeneratedModel, model)
    block.body = _needed(block.body, {f"D[{k}, {j}]" for k, j in entries})
    return cast(GeneratedModel, run(ast.unparse(tree), Path(str(model.__file__))))


def narrowed_source(text: str, signals: Collection[int]) -> str:
    """The C file of a model, its regressor giving the distinct `signals` alone, by their numbers."""
    lines = text.split("\n")
    starts = [k for k, line in enumerate(lines) if line.startswith(TILE)]
    end = next((k for k, line in enumerate(lines) if line.startswith(BODY_ENDS)), 0)
    functions = [range(a, b) for a, b in pairwise([*starts, end])]
    needed = {f"D[{s}][t]" for s in signals}
    unused = set()
    for k in reversed([k for function in [*functions[-1:], *functions[:-1]] for k in function]):
        statement = STATEMENT.match(lines[k])
        if statement is None:
            continue
        if statement["target"] in needed:
            needed.discard(statement["target"])  # written here: what it held before is not needed
            needed.update(VALUE.findall(statement["value"]))
        else:
            unused.add(k)
    return "\n".join(line for k, line in enumerate(lines) if k not in unused)


def _needed(body: list[ast.stmt], wanted: set[str]) -> list[ast.stmt]:
    """The statements that the values called `wanted` need, in order."""
    needed, kept = {*wanted}, []
    for statement in reversed(body):
        if isinstance(statement, ast.Assign) and needed.isdisjoint(name for target in statement.targets for name in _names(target)):
            continue
        needed |= _names(statement.value if isinstance(statement, ast.Assign) else statement)
        kept.append(statement)
    return kept[::-1]


def _names(e: ast.AST) -> set[str]:
    """Names of the values in a piece of text: variables, and entries of the store as "D[7, 1]"."""
    entries = {ast.unparse(node) for node in ast.walk(e) if isinstance(node, ast.Subscript) and ast.unparse(node.value) == "D"}
    return entries | {node.id for node in ast.walk(e) if isinstance(node, ast.Name) and node.id != "D"}
