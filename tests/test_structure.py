"""Who may import whom: the table of the layout, read from the syntax trees of every module."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted(p.relative_to(ROOT) for package in ("symgen", "runtime", "generated") for p in (ROOT / package).rglob("*.py"))

BASE = {"symgen.errors", "symgen.version"}
ARROWS = {  # part: parts of symgen it may import, itself and BASE aside
    "symgen.description": set(),
    "symgen.derive": {"symgen.description"},
    "symgen.regroup": {"symgen.description", "symgen.derive"},
    "symgen.emit": {"symgen.description", "symgen.derive", "symgen.regroup"},
    "symgen.report": {"symgen.description", "symgen.derive", "symgen.regroup", "symgen.emit"},
    "symgen.cli": {"symgen.description", "symgen.derive", "symgen.regroup", "symgen.emit", "symgen.report"},
}
ONLY_IN = {  # library: files and folders that may import it
    "jinja2": ("symgen/emit/render.py", "symgen/report/page.py", "runtime/report/"),
    "matplotlib": ("runtime/report/",),
    "typer": ("symgen/cli/",),
    "rich": ("symgen/cli/",),
    "pydantic": ("symgen/description/",),
    "ruamel": ("symgen/description/", "symgen/cli/", "runtime/io/yaml_text.py"),
    "sympy": ("symgen/regroup/symbolic.py",),
    "mpmath": ("symgen/derive/precise.py", "symgen/regroup/general.py"),
    "casadi": ("symgen/derive/lagrange.py", "runtime/studies/simulation", "runtime/studies/excitation.py", "generated/"),
    "pooch": ("runtime/io/datasets.py",),
    "pint": ("runtime/io/units.py",),
    "mujoco": ("symgen/description/mjcf.py",),
    "polars": ("runtime/io/tables.py",),
    "h5py": ("runtime/io/mat.py",),
    "rosbags": ("runtime/io/bags.py",),
    "cvxpy": ("runtime/studies/consistency.py",),
    "array_api_compat": ("runtime/studies/device.py", "generated/"),
    "dask": ("runtime/studies/distributed.py",),
    "distributed": ("runtime/studies/distributed.py",),
    "threadpoolctl": ("runtime/studies/distributed.py",),
    "scipy": ("runtime/",),
}
LAZY = {  # pooch and its requests are loaded only for a dataset, YAML only for a folder, numpy only for a URDF, the text of pages only in a notebook
    "runtime.io.records": {"runtime.io.datasets"},
    "runtime.io.bag_contents": {"runtime.io.yaml_text"},
    "symgen.description.files": {"symgen.description.urdf", "symgen.description.mjcf"},
    "symgen.regroup": {"symgen.regroup.regrouping"},
    "symgen.regroup.regrouping": {"symgen.report.notebook"},
}
FORBIDDEN_CALLS = {"eval", "exec", "sympify", "parse_expr", "__import__"}


def module_name(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(p): p for p in FILES}
TREES = {name: ast.parse((ROOT / p).read_text(encoding="utf-8")) for name, p in MODULES.items()}


def type_checking(tree: ast.Module) -> set[ast.AST]:
    """Nodes under `if TYPE_CHECKING:`, which are never run."""
    blocks = [n for n in ast.walk(tree) if isinstance(n, ast.If) and isinstance(n.test, ast.Name) and n.test.id == "TYPE_CHECKING"]
    return {node for block in blocks for statement in block.body for node in ast.walk(statement)}


def imports(name: str, *, at_run_time: bool = False, at_start: bool = False) -> set[str]:
    """Modules that `name` imports, `from package import module` resolved; `at_start`: when it is loaded, not inside a function."""
    tree = TREES[name]
    skipped = type_checking(tree) if at_run_time or at_start else set()
    if at_start:
        skipped |= {n for f in ast.walk(tree) if isinstance(f, ast.FunctionDef) for n in ast.walk(f)}
    found: set[str] = set()
    for node in ast.walk(tree):
        if node in skipped:
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module, f"{name}: relative import"
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {full if full in MODULES else node.module for full in inner}
    return found


def part(module: str) -> str:
    return ".".join(module.split(".")[:2])


@pytest.mark.parametrize("name", [n for n in MODULES if n.startswith("symgen.") and n not in BASE])
def test_arrows_inside_symgen(name: str) -> None:
    allowed = ARROWS[part(name)] | {part(name)} | BASE
    own = {m for m in imports(name) if m.split(".")[0] == "symgen"} - LAZY.get(name, set())
    assert {m for m in own if part(m) not in allowed and m not in allowed} == set()


def test_only_the_command_line_imports_both_halves() -> None:
    for name in MODULES:
        tops = {m.split(".")[0] for m in imports(name)}
        if name.startswith("runtime"):
            assert not tops & {"symgen", "generated", "sympy"}, name
        elif not name.startswith("symgen.cli"):
            assert not tops & {"runtime", "generated"}, name


@pytest.mark.parametrize("name", [n for n in MODULES if n.startswith("generated.")])
def test_emitted_modules_import_one_array_package(name: str) -> None:
    package = {"casadi": "casadi", "xp": "array_api_compat"}.get(name.rpartition("_")[2], "numpy")
    assert imports(name) == {package}


@pytest.mark.parametrize("library", ONLY_IN)
def test_libraries_stay_in_their_place(library: str) -> None:
    users = {MODULES[name].as_posix() for name in MODULES if library in {m.split(".")[0] for m in imports(name, at_run_time=True)}}
    assert {path for path in users if not path.startswith(ONLY_IN[library])} == set()


def test_no_cycles() -> None:
    """Among the imports made when a module is loaded; lazy ones belong to the command line and the list of public names."""
    graph = {name: {m for m in imports(name, at_start=True) if m in MODULES and m != name} for name in MODULES}
    done: set[str] = set()

    def visit(name: str, trail: tuple[str, ...]) -> None:
        assert name not in trail, " -> ".join([*trail[trail.index(name) :], name])
        if name not in done:
            for m in sorted(graph[name]):
                visit(m, (*trail, name))
            done.add(name)

    for name in graph:
        visit(name, ())


def test_lazy_imports_only_in_the_command_line() -> None:
    """An import inside a function hides a cycle or a missing arrow; optional libraries have files of their own."""
    hidden = {
        name: imports(name, at_run_time=True) - imports(name, at_start=True)
        for name in MODULES
        if not name.startswith("symgen.cli") and imports(name, at_run_time=True) != imports(name, at_start=True)
    }
    ours = {name: {m for m in found if m.split(".")[0] in ("symgen", "runtime")} for name, found in hidden.items()}
    assert {name: found for name, found in ours.items() if found - LAZY.get(name, set())} == {}


@pytest.mark.parametrize("name", MODULES)
def test_nothing_runs_text_as_code(name: str) -> None:
    called = {n.func.id if isinstance(n.func, ast.Name) else n.func.attr for n in ast.walk(TREES[name])
              if isinstance(n, ast.Call) and isinstance(n.func, ast.Name | ast.Attribute)}  # fmt: skip
    builtins = {n.func.id for n in ast.walk(TREES[name]) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)}
    assert not builtins & FORBIDDEN_CALLS and not called & {"sympify", "parse_expr"}
    assert not {m.split(".")[0] for m in imports(name)} & {"pickle", "marshal", "shelve", "dill", "cloudpickle"}


READERS = {"load", "full_load", "unsafe_load", "read_pickle", "Unpickler", "from_file", "fromfile", "memmap"}
LIBRARIES = {"np", "numpy", "yaml", "ruamel", "torch", "joblib", "pandas", "pl"}


@pytest.mark.parametrize("name", MODULES)
def test_nothing_is_unpickled(name: str) -> None:
    """No library turns a file into objects by running what it holds: numpy.load says allow_pickle=False, YAML makes plain data."""
    for call in (n for n in ast.walk(TREES[name]) if isinstance(n, ast.Call)):
        said = {k.arg: k.value.value for k in call.keywords if isinstance(k.value, ast.Constant)}
        called, place = ast.unparse(call.func), f"{name}, line {call.lineno}"
        if called.rpartition(".")[2] in READERS and called.partition(".")[0] in LIBRARIES:
            assert called == "np.load" and said.get("allow_pickle") is False, place
        assert not said.get("allow_pickle"), place
        if called.rpartition(".")[2] == "YAML":
            assert said.get("typ") in ("safe", "rt"), place


def test_no_utils() -> None:
    assert not [p for p in FILES if p.stem in ("utils", "util", "helpers", "misc", "common")]
