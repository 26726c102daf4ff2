"""The shape of an emitted module: what its syntax tree may hold, all of it on short lists; what is not listed is refused.

At the top stand docstrings, one import (`import numpy as np`, `import casadi as ca` or `from array_api_compat import array_namespace`), assignments
to names, functions and, for NumPy, the class of the stores. Statements, expressions, builtins, functions of the package and attributes are those
that emitters write, no decorators, no hints but HINTS, no name or attribute with two underscores but the two below. An attribute is set only where a
store is marked ready, so nothing of the process (numpy.sin, say) can be replaced; packages themselves are never values. CasADi functions can
compile and run C, and write files: of them only the construction from expressions is allowed, with `default_in` as the one option.

What remains is arithmetic. It may be wrong, and it may take for ever: a file is trusted with the numbers it returns.
"""

from __future__ import annotations

import ast
import builtins
import re
import warnings
from dataclasses import dataclass, field

from runtime.errors import ModelError

LONGEST, MOST_WORDS = 20_000_000, 800_000  # characters; words and marks, each up to a kilobyte of syntax tree
MOST_POWER = 100  # robot files have exponents up to 32
MOST_DIGITS = 18  # of the power of a whole number


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


NODES = _words(
    "Module Expr Import ImportFrom alias Assign AugAssign FunctionDef ClassDef Return For If Raise arguments arg keyword Constant Name Tuple List Dict Call "
    "Attribute Subscript Slice Starred ListComp GeneratorExp DictComp comprehension IfExp Lambda JoinedStr FormattedValue BinOp UnaryOp BoolOp Compare "
    "Add Sub Mult Div FloorDiv Pow MatMult BitOr BitAnd USub Not Invert And Or Eq NotEq Lt LtE Gt GtE Is IsNot Load Store"
)
BUILTINS = _words("TypeError ValueError bool dict enumerate float hasattr int isinstance len list max min range sum tuple type zip")
NUMPY = _words(
    "abs append arange arccos arcsin arctan arctan2 array asarray ascontiguousarray atleast_2d ceil clip concatenate cos cross diff einsum empty eye "
    "float64 interp linalg maximum minimum moveaxis ndarray ndim pi prod round shape sign sin size sqrt stack tan tile unique where zeros zeros_like"
)
LINALG = frozenset({"solve"})
CASADI = _words("Function SX cos cross fmax fmin horzcat jacobian pi sign sin sqrt vertcat vertsplit")
ATTRIBUTES = {  # of anything but the package itself: no tofile, save, generate, from_file, data, ctypes, format ...
    "np": _words("T all any argmax argmin max min ndim ready reshape shape sum transpose view"),
    "ca": _words("T eye sym values"),
    "array_namespace": _words(
        "clip concat cos cross dtype float64 keys linalg moveaxis permute_dims pi reshape shape sin solve sqrt stack where zeros_like"
    ),
}
PACKAGES = {"np": ("numpy", NUMPY), "ca": ("casadi", CASADI)}
ARRAYS = "array_namespace"  # called, never passed on
FINALIZE = "__array_finalize__"  # the one special method, of Store(np.ndarray)
UNTOUCHED = (
    frozenset(dir(builtins)) | PACKAGES.keys() | {ARRAYS}
)  # neither assigned nor taken as an argument: names are looked at without scopes
HINTS = frozenset(
    {"np.ndarray", "np.ndarray | None", "np.ndarray | tuple", "Store", "Store | None", "ca.Function", "int", "int | None", "float", "dict"}
) | {repr(hint) for hint in ("Array", "Array | None", "Array | tuple", "dict", "int | None")}
LITERALS = (str, int, float, bool, type(None), type(...))


def check_source(text: str, file: str) -> None:
    """Raise ModelError unless the text could have been emitted."""
    if len(text) > LONGEST or sum(1 for _ in re.finditer(r"\w+|[^\w\s]", text)) > MOST_WORDS:
        raise ModelError(f"{len(text)} characters; an emitted model has at most {LONGEST}, and {MOST_WORDS} words and marks", file=file)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # what a compiler remarks on, an emitter has not written
            tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as e:
        raise ModelError(f"not Python: {e}", file=file) from None
    _Shape(tree, file).check()


@dataclass
class _Shape:
    """One syntax tree while it is checked; `parent` of every node, the one `package` it imports."""

    tree: ast.Module
    file: str
    parent: dict[int, ast.AST] = field(default_factory=dict)
    package: str | None = None
    known: frozenset[str] = frozenset()  # names that may stand anywhere: its own, the package, a few builtins

    def check(self) -> None:
        for statement in self.tree.body:
            self.statement(statement)
        self.parent = {id(child): node for node in ast.walk(self.tree) for child in ast.iter_child_nodes(node)}
        own = _defined(self.tree)
        if taken := sorted(own & UNTOUCHED):
            raise ModelError(f"defines {', '.join(taken)}, names that emitted models do not touch", file=self.file)
        self.known = frozenset(BUILTINS | own | ({self.package} if self.package else set()))
        for node in ast.walk(self.tree):
            self.node(node)

    def statement(self, node: ast.stmt) -> None:
        """A statement at the top."""
        if found := _imported(node):
            if self.package:
                self.refuse(node, "an emitted model has one array package")
            self.package = found
        elif not (_is_text(node) or _names(node) or isinstance(node, ast.FunctionDef | ast.ClassDef)):
            self.refuse(node, "expected a docstring, the import of an array package, an assignment to names, a function or a class")

    def node(self, node: ast.AST) -> None:
        kind = type(node).__name__
        if kind not in NODES:
            self.refuse(node, "emitted models have no such statement or expression")
        special = getattr(self, f"of_{kind.lower()}", None)
        if special is not None:
            special(node)

    def of_import(self, node: ast.Import) -> None:
        if self.parent[id(node)] is not self.tree:
            self.refuse(node, "imports stand at the top")

    of_importfrom = of_import

    def of_expr(self, node: ast.Expr) -> None:
        if not (_is_text(node) or isinstance(node.value, ast.Call)):
            self.refuse(node, "an expression that emitted models do not have as a statement")

    def of_constant(self, node: ast.Constant) -> None:
        if not isinstance(node.value, LITERALS):
            self.refuse(node, "a literal that emitted models do not use")

    def of_functiondef(self, node: ast.FunctionDef) -> None:
        method = isinstance(self.parent[id(node)], ast.ClassDef)
        strange = node.name != FINALIZE if method else node.name.startswith("__")
        if node.decorator_list or strange or (node.returns and ast.unparse(node.returns) not in HINTS):
            self.refuse(node, "a function that emitted models do not have")

    def of_classdef(self, node: ast.ClassDef) -> None:
        bases = [ast.unparse(base) for base in node.bases]
        if bases != ["np.ndarray"] or node.keywords or node.decorator_list or self.parent[id(node)] is not self.tree:
            self.refuse(node, "emitted models have one class, Store(np.ndarray)")
        if not all(_is_text(part) or _names(part) or isinstance(part, ast.FunctionDef) for part in node.body):
            self.refuse(node, "a class that emitted models do not have")

    def of_arg(self, node: ast.arg) -> None:
        if node.arg.startswith("__") or (node.annotation and ast.unparse(node.annotation) not in HINTS):
            self.refuse(node, "an argument that emitted models do not have")

    def of_binop(self, node: ast.BinOp) -> None:
        exponent = node.right.operand if isinstance(node.right, ast.UnaryOp) else node.right
        power = exponent.value if isinstance(exponent, ast.Constant) and isinstance(exponent.value, int) else MOST_POWER + 1
        base = node.left.value if isinstance(node.left, ast.Constant) else 0.0
        short = isinstance(base, float) or (type(base) is int and len(str(base)) * power <= MOST_DIGITS)
        if isinstance(node.op, ast.Pow) and not (power <= MOST_POWER and short):
            self.refuse(node, f"a power that emitted models do not take; their exponents are numbers up to {MOST_POWER}")

    def of_name(self, node: ast.Name) -> None:
        above = self.parent[id(node)]
        if node.id.startswith("__") or node.id not in self.known:
            self.refuse(node, "a name the file does not define; allowed are its own names, its array package and a few builtins")
        if node.id in PACKAGES and not isinstance(above, ast.Attribute):
            self.refuse(node, f"{PACKAGES[node.id][0]} itself is not passed on")
        if node.id in (ARRAYS, "type", "hasattr") and not (isinstance(above, ast.Call) and above.func is node):
            self.refuse(node, f"{node.id} is called, never passed on")

    def of_call(self, node: ast.Call) -> None:
        if not isinstance(node.func, ast.Name | ast.Attribute):
            self.refuse(node, "only what has a name is called")
        called = ast.unparse(node.func)
        if called == "type" and not (len(node.args) == 1 and not node.keywords and _is_attribute(self.parent[id(node)], "__name__")):
            self.refuse(node, "expected type(x).__name__")
        if called == "hasattr" and not (len(node.args) == 2 and isinstance(node.args[1], ast.Constant) and node.args[1].value == "keys"):
            self.refuse(node, "expected hasattr(x, 'keys')")
        if called in ("ca.Function", "ca.jacobian"):
            self.casadi_call(node, called)
        if _is_attribute(node.func, "view") and not (
            [ast.unparse(x) for x in node.args] in (["Store"], ["np.ndarray"]) and not node.keywords
        ):
            self.refuse(node, "a view is of a store or of an array")

    def of_attribute(self, node: ast.Attribute) -> None:
        above = self.parent[id(node)]
        if not isinstance(node.ctx, ast.Load) and node.attr != "ready":
            self.refuse(node, "emitted models set no attribute but `ready` of a store")
        if isinstance(node.value, ast.Name) and node.value.id in PACKAGES:
            package, numerical = PACKAGES[node.value.id]
            if node.attr not in numerical or not isinstance(node.ctx, ast.Load):
                self.refuse(node, f"not in the numerical part of {package} that emitted models use")
            if ast.unparse(node) in ("ca.Function", "ca.jacobian", "np.ndarray", "np.linalg") and not self.is_hint(node):
                self.package_attribute(node, above)
        elif ast.unparse(node.value) == "np.linalg":
            if node.attr not in LINALG:
                self.refuse(node, "not in the numerical part of numpy.linalg that emitted models use")
        elif node.attr == "__name__":
            if not (isinstance(node.value, ast.Call) and _is_name(node.value.func, "type")):
                self.refuse(node, "expected type(x).__name__")
        elif node.attr not in ATTRIBUTES.get(self.package or "", ()):
            self.refuse(node, "an attribute emitted models do not use")

    def is_hint(self, node: ast.AST) -> bool:
        """Whether the node is a hint of an argument or a result, or one of its alternatives; hints are checked as a whole."""
        above = self.parent[id(node)]
        if isinstance(above, ast.BinOp):
            return isinstance(above.op, ast.BitOr) and self.is_hint(above)
        return (isinstance(above, ast.arg) and above.annotation is node) or (isinstance(above, ast.FunctionDef) and above.returns is node)

    def package_attribute(self, node: ast.Attribute, above: ast.AST) -> None:
        """numpy.linalg only as numpy.linalg.name, numpy.ndarray never called, constructors of CasADi only called."""
        if node.attr == "linalg" and not isinstance(above, ast.Attribute):
            self.refuse(node, "numpy.linalg itself is not passed on")
        if node.attr == "ndarray" and not (isinstance(above, ast.ClassDef) or (isinstance(above, ast.Call) and above.func is not node)):
            self.refuse(node, "arrays are made by functions")
        if node.attr in ("Function", "jacobian") and not (isinstance(above, ast.Call) and above.func is node):
            self.refuse(node, "called with plain arguments only")

    def casadi_call(self, node: ast.Call, called: str) -> None:
        """Functions are built from expressions; nothing is loaded, saved, compiled or given options that do so."""
        if node.keywords or any(isinstance(x, ast.Starred) for x in node.args):
            self.refuse(node, "called with plain arguments only")
        if called == "ca.jacobian" and len(node.args) != 2:
            self.refuse(node, "expected an expression and a variable, no options")
        if called == "ca.Function" and not (len(node.args) == 6 and _is_defaults(node.args[5])):
            self.refuse(node, "expected name, inputs, results, their names, and default_in as the one option")

    def refuse(self, node: ast.AST, why: str) -> None:
        text = ast.unparse(node).splitlines()[0][:60] if isinstance(node, ast.stmt | ast.expr | ast.arg) else type(node).__name__
        line = getattr(node, "lineno", None)
        raise ModelError(
            f"`{text}`: {why}. If you trust the file, import it yourself and pass the module",
            file=self.file,
            row=None if line is None else f"line {line}",
        )


def _imported(node: ast.AST) -> str | None:
    """What the statement, an import of an array package as emitters write it, makes known."""
    if isinstance(node, ast.ImportFrom):
        found = (node.module, node.level, [(a.name, a.asname) for a in node.names])
        return ARRAYS if found == ("array_api_compat", 0, [(ARRAYS, None)]) else None
    if not isinstance(node, ast.Import):
        return None
    return next((alias for alias, (name, _) in PACKAGES.items() if [(a.name, a.asname) for a in node.names] == [(name, alias)]), None)


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
    return names


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _names(node: ast.AST) -> bool:
    """Whether the statement is an assignment to names."""
    return isinstance(node, ast.Assign) and all(isinstance(target, ast.Name) for target in node.targets)


def _is_name(node: ast.AST, name: str) -> bool:
    return isinstance(node, ast.Name) and node.id == name


def _is_attribute(node: ast.AST, name: str) -> bool:
    return isinstance(node, ast.Attribute) and node.attr == name


def _is_defaults(node: ast.expr) -> bool:
    return isinstance(node, ast.Dict) and [k.value if isinstance(k, ast.Constant) else None for k in node.keys] == ["default_in"]
