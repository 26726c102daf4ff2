"""Notebooks of docs/examples as pages: their cells are run, what they show stands under them."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent.parent


def notebook(name: str) -> str:
    """A notebook of docs/examples with the results of its cells, in the form of a page."""
    cells = json.loads((HERE / "examples" / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
    space: dict[str, Any] = {}
    parts = []
    for cell in cells:
        text = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(text)
            continue
        printed, value = StringIO(), None
        tree = ast.parse(text)
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        with redirect_stdout(printed):
            exec(compile(tree, name, "exec"), space)  # noqa: S102 (our own notebook)
            if last is not None:
                value = eval(compile(ast.Expression(last.value), name, "eval"), space)  # noqa: S307
        parts += [f"```python\n{text}\n```", *results(printed.getvalue(), value)]
    return "\n\n".join(parts)


def results(printed: str, value: Any) -> Iterator[str]:
    """What a cell printed, and its value: formulas typeset, an equation a line."""
    if printed:
        yield f"```text\n{printed.rstrip()}\n```"
    if hasattr(value, "_repr_latex_") and "aligned" in value._repr_latex_():
        rows = value._repr_latex_().replace(" \\\\\n&\\quad", "").split("\n")[1:-1]
        yield "\n\n".join(f"$${row.removesuffix(chr(92) * 2).replace('&', '')}$$" for row in rows)
    elif value is not None:
        yield f"```text\n{value}\n```"
