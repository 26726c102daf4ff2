"""Running an emitted file given by path: only if its syntax tree is one an emitter writes.

Allowed at the top: a docstring, one import (`import numpy as np`, `import casadi as ca` or `from array_api_compat import array_namespace`),
assignments, functions and classes. Inside: no further import, no name with two leading underscores besides a few, no global state, and only names
that the file defines itself, a short list of builtins and the numerical part of the one package it imports. A file for arrays of any package sees
their namespaces under names of its own, so there every attribute, of whatever object, is one of a short list. CasADi functions can compile and run C, and write files: of them only the construction from
expressions is allowed, with `default_in` as the one option. What is checked is what runs: the text is read once.
"""

from __future__ import annotations

import ast
import builtins
import importlib.abc
import importlib.util
from pathlib import Path
from types import ModuleType

from runtime.errors import ModelError

LONGEST = 20_000_000  # characters


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


DUNDERS = frozenset(
    {
        "__all__",
        "__doc__",
        "__name__",
        "__init__",
        "__call__",
        "__getitem__",
        "__len__",
        "__iter__",
        "__contains__",
        "__slots__",
        "__post_init__",
        "__array_finalize__",
    }
)
BUILTINS = _words(
    "ArithmeticError AttributeError Exception False IndexError KeyError None NotImplementedError RuntimeError True TypeError ValueError ZeroDivisionError "
    "abs all any bool bytes callable dict divmod enumerate filter float frozenset hasattr hash int isinstance issubclass iter len list map max min next object "
    "property range repr reversed round set slice sorted staticmethod str sum super tuple type zip"
)
NUMPY = _words(
    "abs absolute add all allclose any append arange arccos argmax arccosh arcsin arcsinh arctan arctan2 arctanh array array_equal asarray ascontiguousarray asfortranarray "
    "atleast_1d atleast_2d atleast_3d block bool bool_ broadcast_arrays broadcast_shapes broadcast_to cbrt ceil clip column_stack concatenate copysign copyto cos cosh "
    "count_nonzero cross cumsum deg2rad diag diagonal diff divide dot e einsum empty empty_like errstate exp expand_dims eye fabs finfo flatnonzero float32 "
    "float64 floating floor full full_like hstack hypot identity inf int32 int64 integer interp intp isfinite isinf isnan isscalar issubdtype kron linalg linspace log log10 log2 "
    "logical_and logical_not logical_or matmul max maximum may_share_memory mean meshgrid min minimum mod moveaxis multiply nan ndarray ndim negative newaxis nonzero "
    "number ones ones_like outer pi power prod promote_types rad2deg reciprocal remainder repeat require reshape result_type rint round shape shares_memory sign signbit "
    "sin sinh size sqrt square squeeze stack subtract sum swapaxes take tan tanh tensordot tile trace transpose tri tril triu true_divide trunc unique vstack where "
    "zeros zeros_like"
)
LINALG = frozenset({"LinAlgError", "cholesky", "cond", "det", "eigvalsh", "inv", "lstsq", "norm", "qr", "solve", "svd"})
CASADI = _words("Function SX cos cross fmax fmin horzcat jacobian pi sign sin sqrt vertcat vertsplit")
CASADI_ATTRIBUTES = frozenset(
    {"T", "eye", "sym", "values"}
)  # of anything else in a file that imports casadi: no save, generate, from_file ...
ARRAYS = "array_namespace"  # called, never passed on
ARRAY_ATTRIBUTES = _words(
    "clip concat cos cross dtype float64 keys linalg moveaxis permute_dims pi reshape shape sin solve sqrt stack where zeros_like"
)
PACKAGES = {"np": ("numpy", NUMPY), "ca": ("casadi", CASADI)}
HIDDEN = (frozenset(dir(builtins)) - BUILTINS) | {"np"}  # open, eval, exec, getattr, vars ...: neither used nor redefined
FILES = frozenset(
    {"tofile", "dump", "dumps", "ctypes", "ctypeslib", "format", "format_map"}
)  # attributes that reach files, memory or text templates
FRAMES = ("gi_", "f_", "tb_", "cr_", "ag_", "co_", "func_")  # interpreter internals

REFUSED = (
    ast.Match,
    ast.Import,
    ast.ImportFrom,
    ast.Global,
    ast.Nonlocal,
    ast.AsyncFunctionDef,
    ast.Await,
    ast.Yield,
    ast.YieldFrom,
    ast.Delete,
    ast.AsyncWith,
    ast.AsyncFor,
)


class _Checked(importlib.abc.InspectLoader):
    """Loader of a text that has been checked."""

    def __init__(self, text: str) -> None:
        self.text = text

    def get_source(self, fullname: str) -> str:
        return self.text

    def is_package(self, fullname: str) -> bool:
        return False


def module_of(path: Path) -> ModuleType:
    """The module of an emitted file; ModelError with the line of anything an emitter does not write."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as e:
        raise ModelError(f"cannot be read: {e}", file=str(path)) from e
    check_source(text, path.name)
    name = f"generated_{path.stem}"
    loader = _Checked(text)
    spec = importlib.util.spec_from_loader(name, loader, origin=str(path))
    if spec is None:
        raise ModelError("cannot be loaded", file=str(path))
    module = importlib.util.module_from_spec(spec)
    module.__file__ = str(path)
    try:
        loader.exec_module(module)
    except ModuleNotFoundError as e:
        extra = ": pip install symgen[gpu]" if e.name == "array_api_compat" else ""
        raise ModelError(f"needs {e.name}, which is not installed{extra}", file=str(path)) from e
    except Exception as e:  # whatever a broken file raises becomes one kind of error
        raise ModelError(f"fails on import with {type(e).__name__}: {e}; emit it again", file=str(path)) from e
    return module


def check_source(text: str, file: str) -> None:
    """Raise ModelError unless the text could have been emitted."""
    if len(text) > LONGEST:
        raise ModelError(f"{len(text)} characters; an emitted model has at most {LONGEST}", file=file)
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as e:
        raise ModelError(f"not Python: {e}", file=file) from None
    for statement in tree.body:
        _check_statement(statement, file)
    aliases = {alias for statement in tree.body if (alias := _imported(statement))}
    if len(aliases) > 1:
        raise ModelError("imports several packages; an emitted model has one array package", file=file)
    own = _defined(tree)
    shadowed = sorted(own & (HIDDEN | aliases))
    if shadowed:
        raise ModelError(f"defines {', '.join(shadowed)}, names that emitted models do not touch", file=file)
    imports = {id(node) for node in tree.body if _imported(node)}
    modules = {
        id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute)
    }  # np, np.linalg only as np.name, np.linalg.name
    modules |= {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call) and _is_name(node.func, ARRAYS)}
    known = BUILTINS | own | aliases
    for part in ast.walk(tree):
        if id(part) not in imports:
            _check_node(part, known, file)
        if isinstance(part, ast.Name) and part.id in aliases and id(part) not in modules:
            _refuse(part, f"{PACKAGES[part.id][0] if part.id in PACKAGES else part.id} itself is not passed on", file)
        if _is_linalg(part) and id(part) not in modules:
            _refuse(part, "numpy.linalg itself is not passed on", file)
    if "ca" in aliases:
        _check_casadi(tree, file)
    if ARRAYS in aliases:
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and node.attr not in ARRAY_ATTRIBUTES:
                _refuse(node, "an attribute that emitted models of arrays do not use", file)


def _check_statement(node: ast.stmt, file: str) -> None:
    text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    if not (text or _imported(node) or isinstance(node, ast.Assign | ast.AnnAssign | ast.FunctionDef | ast.ClassDef)):
        _refuse(node, "expected a docstring, the import of an array package, an assignment, a function or a class", file)


def _imported(node: ast.AST) -> str | None:
    """What the statement, an import of an array package as emitters write it, makes known."""
    if isinstance(node, ast.ImportFrom):
        found = (node.module, node.level, [(a.name, a.asname) for a in node.names])
        return ARRAYS if found == ("array_api_compat", 0, [(ARRAYS, None)]) else None
    if not isinstance(node, ast.Import):
        return None
    return next((alias for alias, (name, _) in PACKAGES.items() if [(a.name, a.asname) for a in node.names] == [(name, alias)]), None)


def _is_name(node: ast.AST, name: str) -> bool:
    return isinstance(node, ast.Name) and node.id == name


def _is_linalg(node: ast.AST) -> bool:
    return isinstance(node, ast.Attribute) and node.attr == "linalg" and _is_name(node.value, "np")


def _check_casadi(tree: ast.Module, file: str) -> None:
    """Functions are built from expressions and called; nothing is loaded, saved, compiled or given options that do so."""
    called = {id(node.func): node for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Attribute):
            continue
        if not _is_name(node.value, "ca") and node.attr not in CASADI_ATTRIBUTES:
            _refuse(node, "an attribute that emitted CasADi models do not use", file)
        if _is_name(node.value, "ca") and node.attr in ("Function", "jacobian"):
            call = called.get(id(node))
            if call is None or call.keywords or any(isinstance(x, ast.Starred) for x in call.args):
                _refuse(node, "called with plain arguments only", file)
            elif node.attr == "jacobian" and len(call.args) != 2:
                _refuse(call, "expected an expression and a variable, no options", file)
            elif node.attr == "Function" and not (len(call.args) == 6 and _is_defaults(call.args[5])):
                _refuse(call, "expected name, inputs, results, their names, and default_in as the one option", file)


def _is_defaults(node: ast.expr) -> bool:
    return isinstance(node, ast.Dict) and [k.value if isinstance(k, ast.Constant) else None for k in node.keys] == ["default_in"]


def _defined(tree: ast.Module) -> set[str]:
    """Names the file itself assigns, defines or takes as arguments."""
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.arg):
            names.add(node.arg)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.ExceptHandler) and node.name:
            names.add(node.name)
    return names


def _check_node(node: ast.AST, known: set[str] | frozenset[str], file: str) -> None:
    if isinstance(node, REFUSED):
        _refuse(node, "an emitted model has no such statement", file)
    elif isinstance(node, ast.Name):
        if (node.id not in known and node.id not in DUNDERS) or (node.id.startswith("__") and node.id not in DUNDERS):
            _refuse(node, "a name the file does not define; allowed are its own names, its array package and a few builtins", file)
    elif isinstance(node, ast.Attribute):
        package = PACKAGES.get(node.value.id) if isinstance(node.value, ast.Name) else None
        if (package and node.attr not in package[1]) or (_is_linalg(node.value) and node.attr not in LINALG):
            _refuse(node, f"not in the numerical part of {package[0] if package else 'numpy'} that emitted models use", file)
        if (node.attr.startswith("__") and node.attr not in DUNDERS) or node.attr in FILES or node.attr.startswith(FRAMES):
            _refuse(node, "an attribute emitted models do not use", file)
    elif isinstance(node, ast.FunctionDef | ast.ClassDef):
        if node.name.startswith("__") and node.name not in DUNDERS:
            _refuse(node, "a name emitted models do not use", file)
    elif isinstance(node, ast.arg) and node.arg.startswith("__"):
        _refuse(node, "an argument name emitted models do not use", file)


def _refuse(node: ast.AST, why: str, file: str) -> None:
    text = ast.unparse(node).splitlines()[0][:60] if isinstance(node, ast.stmt | ast.expr | ast.arg) else type(node).__name__
    line = getattr(node, "lineno", None)
    raise ModelError(
        f"`{text}`: {why}. If you trust the file, import it yourself and pass the module",
        file=file,
        row=None if line is None else f"line {line}",
    )
