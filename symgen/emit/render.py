"""Text from templates: the only place where jinja2 lays out an emitted file."""

from __future__ import annotations

import ast
import re
from collections.abc import Collection, Iterator, Mapping
from functools import lru_cache

from jinja2 import Environment, PackageLoader, StrictUndefined

from symgen.errors import SymgenError


@lru_cache(maxsize=1)
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("symgen.emit"), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )


def laid_out(template: str, context: Mapping[str, object]) -> str:
    """The text of `templates/<template>.jinja` with the values of `context`."""
    return _environment().get_template(f"{template}.jinja").render(context)


def python_module(template: str, context: Mapping[str, object], constants: Collection[str], results: Collection[str] = ()) -> str:
    """`laid_out`, of a Python module whose functions take `constants` as arguments.

    SymgenError where such a function binds or calls one of these names for a purpose of its own; `results` are the names of arrays that lines in
    `context` assign.
    """
    text = laid_out(template, context)
    if _words().union(results) & {*constants} and (clash := sorted(set(_clashes(ast.parse(text), {*constants})))):
        raise SymgenError(f"constants.{', '.join(clash)}: the emitted module calls something else so; rename it in the robot file")
    return text


@lru_cache(maxsize=1)
def _words() -> frozenset[str]:
    """Every word of the templates: the names that their functions use are among them."""
    environment = _environment()
    assert environment.loader is not None
    return frozenset(
        w for name in environment.list_templates() for w in re.findall(r"\w+", environment.loader.get_source(environment, name)[0])
    )


def _clashes(module: ast.Module, constants: set[str]) -> Iterator[str]:
    """Constants that a function takes twice, uses as a name of the module, or assigns before it passes them on."""
    classes, functions = ({node.name for node in module.body if isinstance(node, kind)} for kind in (ast.ClassDef, ast.FunctionDef))
    for function in (node for node in module.body if isinstance(node, ast.FunctionDef)):
        arguments = [a.arg for a in (*function.args.args, *function.args.kwonlyargs)]
        taken = constants & {*arguments}
        if not taken:
            continue
        assigned: dict[str, int] = {}  # name: first line
        nodes = list(ast.walk(function))
        apart = {id(x) for node in nodes if isinstance(node, ast.comprehension) for x in ast.walk(node.target)}
        for node in nodes:
            first = node.lineno - 1 if isinstance(node, ast.For | ast.While) else None  # what a loop assigns its next pass reads
            for x in ast.walk(node) if first is not None else [node]:
                if isinstance(x, ast.Name) and isinstance(x.ctx, ast.Store) and id(x) not in apart:
                    assigned[x.id] = min(assigned.get(x.id, x.lineno), x.lineno if first is None else first)
        for call in (node for node in nodes if isinstance(node, ast.Call)):
            if not isinstance(call.func, ast.Name):
                continue
            passed = {x.id: x.lineno for x in (*call.args, *(k.value for k in call.keywords)) if isinstance(x, ast.Name)}
            if call.func.id in functions:
                yield from (name for name in taken & {*passed} if assigned.get(name, passed[name]) < passed[name])
            yield from taken & {call.func.id, *(classes & {*passed})}
        yield from (name for name in taken if arguments.count(name) > 1)
