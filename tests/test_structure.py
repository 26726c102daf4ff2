"""Who may import whom: the table of the layout, read from the syntax trees of every module."""

import ast
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted(
    p.relative_to(ROOT)
    for package in ("symgen", "runtime", "generated")
    for p in (ROOT / package).rglob("*.py")
)

# of each package, in order: a room imports itself and rooms before it, files in the package itself
# (the ground) only each other
ROOMS = {
    "symgen": (
        "description",
        "derive",
        "regroup",
        "emit",
        "symbols",
        "certify",
        "pages",
        "update",
        "demo",
        "studio",
        "cli",
    ),
}
LOWER: dict[str, set[str]] = {"ground": set(), "core": set()}
"""Rooms of runtime below the core: what they import beside the ground; all others import the core."""
CORE = {"numpy", "scipy", "pydantic", "pydantic_core"}
"""Libraries of runtime/core and runtime/ground, beside the standard library and itself."""
EDGES = {  # of runtime: a feature imports the ground, the core and itself; what else it uses, and why
    "advisor": {"counts": "a real encoder may be read as counts"},
    "assumptions": {"physical": "an assumption is about the bodies of the robot"},
    "expected": {
        "counts": "the steps of an encoder are an error of predictions",
        "physical": "predictions are those of bodies that exist",
        "unmodelled": "a torque that the model lacks is an error of predictions",
    },
    "friction": {"physical": "which base parameters are friction alone follows from the bodies"},
    "payload": {
        "physical": "a load is a body",
        "reading": "the records with the load have the settings of all records",
    },
    "plausible": {
        "physical": "a cause is judged by bodies that exist",
        "counts": "a counter that starts anew after its turn is no jump of the position",
    },
    "reporting": {
        "excitation": "the figure of a motion is drawn from its samples",
        "loop": "the figure of a simulation is drawn from its samples",
    },
    "wrench": {"physical": "a wrench sees parameters of bodies that no joint torque depends on"},
    "mending": {
        "plausible": "causes are those of the check whether a study is right",
        "reading": "messages of a second publisher are looked for in the record",
    },
    "controller": {
        "loop": "the law of a controller has the settings of the loop that simulates it"
    },
    "excitation": {"loop": "the control law, its parameters and dry friction"},
    "loop": {
        "counts": "a missing count is knowledge, not a gap",
        "reading": "the reference of a controller may lie in a measured file",
    },
    "reading": {
        "documents": "a bag is described by a text in YAML; a pipe is no file",
        "loop": "the torque of a record may be the law of a controller",
        "controller": "the law completes a record that logs no torque",
    },
}
ONLY_IN = {  # library: files and folders that may import it
    "jinja2": (
        "symgen/emit/render.py",
        "symgen/pages/page.py",
        "symgen/studio/server.py",
        "runtime/reporting/page.py",
    ),
    "starlette": ("symgen/studio/",),
    "uvicorn": ("symgen/studio/serving.py",),
    "matplotlib": ("runtime/reporting/",),
    "typer": ("symgen/cli/",),
    "rich": ("symgen/cli/",),
    "pydantic": (
        "symgen/description/",
        "runtime/core/",
        "runtime/ground/",
        "runtime/documents/estimates.py",
        "runtime/reading/settings.py",
        "runtime/loop/",
        "runtime/excitation/",
        "runtime/mending/",
        "runtime/study.py",
    ),
    "ruamel": ("symgen/description/", "symgen/cli/", "runtime/documents/yaml_text.py"),
    "sympy": ("symgen/symbols/",),
    "casadi": (
        "symgen/certify/lagrange.py",
        "runtime/loop/",
        "runtime/excitation/optimiser.py",
        "generated/",
    ),
    "pooch": ("runtime/reading/datasets.py",),
    "pint": ("runtime/reading/units.py",),
    "mujoco": ("symgen/description/mjcf.py",),
    "polars": ("runtime/reading/parquet.py",),
    "h5py": ("runtime/reading/hdf5.py", "runtime/reading/mat.py"),
    "rosbags": ("runtime/reading/bags.py",),
    "clarabel": ("runtime/physical/semidefinite.py",),
    "array_api_compat": ("generated/",),
    "dask": (),
    "distributed": (),
    "threadpoolctl": ("runtime/threads.py",),
    "scipy": ("runtime/",),
}
LAZY: dict[str, set[str]] = {  # imports against the order of the rooms: to be mended, then empty
}
FORBIDDEN_CALLS = {"eval", "exec", "sympify", "parse_expr", "__import__"}


def module_name(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(p): p for p in FILES}


@cache
def nodes(name: str) -> tuple[ast.AST, ...]:
    """The syntax tree of a module, flat: parsed and walked once for all tests."""
    return tuple(ast.walk(ast.parse((ROOT / MODULES[name]).read_text(encoding="utf-8"))))


def calls(name: str) -> Iterator[ast.Call]:
    return (n for n in nodes(name) if isinstance(n, ast.Call))


def type_checking(name: str) -> set[ast.AST]:
    """Nodes of a module under `if TYPE_CHECKING:`, which are never run."""
    blocks = [
        n
        for n in nodes(name)
        if isinstance(n, ast.If) and isinstance(n.test, ast.Name) and n.test.id == "TYPE_CHECKING"
    ]
    return {node for block in blocks for statement in block.body for node in ast.walk(statement)}


@cache
def imports(name: str, *, at_run_time: bool = False) -> set[str]:
    """Modules that `name` imports, inside functions too, `from package import module` resolved;
    `at_run_time`: without those for annotations.
    """
    skipped = type_checking(name) if at_run_time else set()
    found: set[str] = set()
    for node in nodes(name):
        if node in skipped:
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module, f"{name}: relative import"
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {full if full in MODULES else node.module for full in inner}
    return found


def room(module: str) -> float:
    """Place of a module in the order of its package; 0 for the ground. The package itself, the list
    of public names, stands before its users.
    """
    package, _, rest = module.partition(".")
    if not rest:
        return (
            ROOMS[package].index("demo") + 0.5
            if "demo" in ROOMS[package]
            else len(ROOMS[package]) + 1
        )
    first = "cli" if rest == "__main__" else rest.partition(".")[0]  # python -m symgen
    return ROOMS[package].index(first) + 1 if first in ROOMS[package] else 0


def feature(module: str) -> str:
    """The part of runtime that a module belongs to: the ground, the core, a folder, or a file; "" for the lists, the whole study, the files of results, many records and the package."""
    first = module.split(".")[1] if "." in module else ""
    return "" if first in ("compose", "each", "files", "study") else first


def test_a_feature_of_the_runtime_imports_the_core_and_itself() -> None:
    """`runtime.compose`, `runtime.study`, `runtime.files`, `runtime.each` and the package itself name features; no feature imports these."""
    wrong = set()
    for name in (n for n in MODULES if n.partition(".")[0] == "runtime" and feature(n)):
        own = feature(name)
        allowed = {"ground", *LOWER.get(own, {"core"}), own, *EDGES.get(own, ())}
        users = {m for m in imports(name) if m.partition(".")[0] == "runtime"}
        wrong |= {f"{name} -> {m}" for m in users if feature(m) not in allowed}
    assert wrong == set()


def test_the_core_needs_three_libraries() -> None:
    standard = sys.stdlib_module_names
    for name in (n for n in MODULES if feature(n) in LOWER and n.startswith("runtime")):
        tops = {m.partition(".")[0] for m in imports(name)} - standard - {"runtime"}
        assert tops <= CORE, (name, tops)


@pytest.mark.parametrize("package", ROOMS)
def test_a_room_imports_only_rooms_before_it(package: str) -> None:
    """At load time, inside functions and for annotations alike."""
    wrong = {}
    for name in (n for n in MODULES if n.partition(".")[0] == package):
        later = {
            m for m in imports(name) if m.partition(".")[0] == package and room(m) > room(name)
        }
        wrong[name] = later - LAZY.get(name, set())
    assert {name: later for name, later in wrong.items() if later} == {}


@pytest.mark.parametrize("package", ROOMS)
def test_every_folder_is_a_room(package: str) -> None:
    folders = {
        p.parent.relative_to(ROOT / package).parts[0]
        for p in (ROOT / package).rglob("*.py")
        if p.parent != ROOT / package
    }
    assert folders <= set(ROOMS[package])


def test_only_what_needs_records_imports_both_halves() -> None:
    """The command line, the demonstrations, and what writes estimates into the files of robots."""
    for name in MODULES:
        tops = {m.split(".")[0] for m in imports(name)}
        if name.startswith("runtime"):
            assert not tops & {"symgen", "generated", "sympy"}, name
        elif not name.startswith(("symgen.cli", "symgen.demo", "symgen.studio", "symgen.update")):
            assert not tops & {"runtime", "generated"}, name


def test_emitted_modules_import_numpy_and_others_where_they_are_used() -> None:
    for name in (n for n in MODULES if n.startswith("generated.")):
        assert {"numpy"} <= imports(name) <= {"numpy", "casadi", "array_api_compat"}, name


@pytest.mark.parametrize("library", ONLY_IN)
def test_libraries_stay_in_their_place(library: str) -> None:
    users = {
        MODULES[name].as_posix()
        for name in MODULES
        if library in {m.split(".")[0] for m in imports(name, at_run_time=True)}
    }
    assert {path for path in users if not path.startswith(ONLY_IN[library])} == set()


def test_no_two_modules_import_each_other_by_any_way() -> None:
    """Imports inside functions and for annotations included; the list of public names of a package
    aside.
    """
    graph = {
        name: {m for m in imports(name) if m in MODULES and m != name}
        for name in MODULES
        if "." in name
    }
    done: set[str] = set()

    def visit(name: str, trail: tuple[str, ...]) -> None:
        assert name not in trail, " -> ".join([*trail[trail.index(name) :], name])
        if name not in done:
            for m in sorted(graph.get(name, ())):
                visit(m, (*trail, name))
            done.add(name)

    for name in graph:
        visit(name, ())


def test_nothing_runs_text_as_code() -> None:
    for name in MODULES:
        called = {
            n.func.id if isinstance(n.func, ast.Name) else n.func.attr
            for n in calls(name)
            if isinstance(n.func, ast.Name | ast.Attribute)
        }
        builtins = {n.func.id for n in calls(name) if isinstance(n.func, ast.Name)}
        assert not builtins & FORBIDDEN_CALLS and not called & {"sympify", "parse_expr"}, name
        assert not {m.split(".")[0] for m in imports(name)} & {
            "pickle",
            "marshal",
            "shelve",
            "dill",
            "cloudpickle",
        }, name


READERS = {
    "load",
    "full_load",
    "unsafe_load",
    "read_pickle",
    "Unpickler",
    "from_file",
    "fromfile",
    "memmap",
}
LIBRARIES = {"np", "numpy", "yaml", "ruamel", "torch", "joblib", "pandas", "pl"}


def test_nothing_is_unpickled() -> None:
    """No library turns a file into objects by running what it holds: numpy.load says
    allow_pickle=False, YAML makes plain data.
    """
    for name, call in ((module, call) for module in MODULES for call in calls(module)):
        said = {k.arg: k.value.value for k in call.keywords if isinstance(k.value, ast.Constant)}
        called, place = ast.unparse(call.func), f"{name}, line {call.lineno}"
        if called.rpartition(".")[2] in READERS and called.partition(".")[0] in LIBRARIES:
            assert called == "np.load" and said.get("allow_pickle") is False, place
        assert not said.get("allow_pickle"), place
        if called.rpartition(".")[2] == "YAML":
            assert said.get("typ") in ("safe", "rt"), place


def test_no_utils() -> None:
    assert not [p for p in FILES if p.stem in ("utils", "util", "helpers", "misc", "common")]


def test_seeded_faults_are_where_they_were() -> None:
    """`tests/mutations.py`: the text of every fault stands once, and its tests are there."""
    from mutations import FAULTS

    for fault in FAULTS:
        assert (ROOT / fault.file).read_text(encoding="utf-8").count(fault.old) == 1, fault.meaning
        assert all((ROOT / "tests" / test).is_file() for test in fault.tests), fault.meaning
