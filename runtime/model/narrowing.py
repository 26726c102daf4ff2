"""An emitted module whose regressor evaluates some entries alone: what only the others need is left out of its text.

The body of a regressor is straight-line code, so that one pass from its end finds what the wanted entries D[k, j] need. Shapes stay: the other
entries of a store are never written. Same operations on the same numbers, hence the same bits.
"""

from __future__ import annotations

import ast
from collections.abc import Collection
from pathlib import Path
from types import ModuleType
from typing import cast

from runtime.model.generated import GeneratedModel
from runtime.model.loading import run

BLOCK = "_regressor_block"  # fills D, shape (b, n, N)


def narrowed(model: GeneratedModel, entries: Collection[tuple[int, int]]) -> GeneratedModel:
    """The model, its regressor filling the `entries` of D alone; `model` itself where it has no text in NumPy.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    entries : collection of (int, int)
        Column k and joint j of each entry D[k, j] wanted, shape (b, n).
    """
    if not isinstance(model, ModuleType):
        return model
    source = getattr(model.__loader__, "get_source", None)
    tree = ast.parse(source(model.__name__) if source else "")
    block = next((node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == BLOCK), None)
    if block is None:
        return model
    block.body = _needed(block.body, {f"D[{k}, {j}]" for k, j in entries})
    return cast(GeneratedModel, run(ast.unparse(tree), Path(str(model.__file__))))


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
