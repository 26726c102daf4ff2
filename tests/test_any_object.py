"""The border to callers, by force: 75 kinds of object in every argument of every public function of
both packages and of an emitted module.

The answer is one sentence of the project, or, for the kinds that an argument takes, the right
result. `pytest -m campaign -rP tests/test_any_object.py` prints how many calls were made.
"""

from __future__ import annotations

import datetime
import inspect
import sys
import warnings
from collections import deque
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import casadi
import jax.numpy
import numpy as np
import pint
import polars
import pytest
import sympy
from campaign import campaign

import runtime
import symgen
from runtime.ground.errors import InputError
from symgen.errors import SymgenError

N = 200
T = np.arange(N) / 100.0
Q = np.column_stack([np.sin(2 * T), 0.5 * np.cos(3 * T)])
TAU = np.column_stack([np.cos(T), T])
MODEL = symgen.model("planar_2r")
RECORD = runtime.Record(T, Q, TAU)
STUDY = runtime.Study()
UNITS = pint.UnitRegistry()
X = np.arange(1.0, 1 + len(MODEL.BASE_PARAMETERS))
STANDARD = np.arange(1.0, 1 + len(MODEL.STANDARD_PARAMETERS))


class Odd:
    """An object of a class of the user."""


KINDS: dict[str, Callable[[], Any]] = {
    name: lambda x=x: x
    for name, x in {
        "None": None, "true": True, "false": False, "whole": 2, "negative": -3, "huge": 10**400,
        "decimal fraction": 2.5, "nan": np.nan, "inf": np.inf, "large": 1e100, "complex": 1j,
        "Decimal": Decimal("1.5"), "Fraction": Fraction(1, 3), "float64": np.float64(1.5),
        "int32": np.int32(2), "numpy bool": np.bool_(True), "complex128": np.complex128(1j),
        "text": "x.none", "empty text": "", "spaces": "  ", "accent": "é", "two lines": "a\nb",
        "nul": "a\0b", "surrogate": "\udcff", "long text": "x" * 5000, "bytes": b"x",
        "bytearray": bytearray(b"x"), "memoryview": memoryview(b"xyz"), "path": Path("none/x"),
        "folder": Path("/"), "empty list": [], "list": [1, 2], "ragged": [[1, 2], [3]],
        "tuple": (1, 2), "empty tuple": (), "mapping": {"a": 1}, "empty mapping": {},
        "mapping of numbers": {1: 2}, "proxy": MappingProxyType({"a": 1}), "set": {1.0, 2.0},
        "frozenset": frozenset("ab"), "range": range(3), "deque": deque([1]), "times": T,
        "positions": Q, "0-d": np.array(1.5), "empty array": np.array([]),
        "objects": np.array([object()]), "masked": np.ma.masked_greater(T, 1),
        "structured": np.zeros(3, dtype=[("a", float)]), "truths": Q > 0,
        "dates": np.array(["2026-01-01"], dtype="M8[s]"), "date": datetime.datetime(2026, 1, 1),
        "function": len, "lambda": lambda *a, **k: None, "class": int, "package": sys,
        "object": Odd(), "exception": ValueError("x"), "namespace": SimpleNamespace(a=1),
        "ellipsis": ..., "NotImplemented": NotImplemented, "model": MODEL, "record": RECORD,
        "robot": symgen.load_robot("planar_2r"), "regrouping": symgen.regrouping("planar_2r"),
        "study": STUDY, "degrees": Q * UNITS.degree, "one degree": UNITS.Quantity(3, "degree"),
        "unit": UNITS.meter, "jax": jax.numpy.ones(3), "sympy": sympy.Symbol("x"),
        "casadi": casadi.SX.sym("x", 3), "frame": polars.DataFrame({"a": [1.0]}),
        "stream": sys.__stdin__,
    }.items()
} | {"generator": lambda: (i for i in range(3)), "iterator": lambda: iter([1, 2])}  # fmt: skip

NUMBER = {"whole", "negative", "decimal fraction", "nan", "inf", "large", "float64", "int32", "0-d"}
STATES = {"positions"}
ONE_STATE = {"positions", "list", "tuple"}  # with nothing beside that has N rows
FLAG = {"true", "false"}
TEXT = {"text", "empty text", "spaces", "accent", "two lines", "nul", "surrogate", "long text"}
ANY_NAME = {*TEXT, "path", "folder"}
ROBOT = {"robot"}
BASE = {"robot", "regrouping"}
EMPTY = {"empty list", "empty tuple"}
NOTHING = {"None"}
Row = tuple[Callable[..., Any], dict[str, Any], dict[str, set[str]]]


def _table(folder: Path) -> dict[str, Row]:
    """Name: function, arguments that it takes, and for each argument to be replaced its kinds."""
    robot, named = {"robot": "planar_2r"}, {"robot": ROBOT}
    table: dict[str, Row] = {
        "absorptions": (symgen.absorptions, robot, {"robot": BASE}),
        "base_difference": (
            symgen.base_difference,
            {"before": "planar_2r", "after": "planar_2r"},
            {"before": BASE, "after": BASE},
        ),
        "certificate": (
            symgen.certificate,
            robot,
            {"robot": BASE, "files": {"None", "empty mapping"}, "options": {*EMPTY, "empty mapping"}},
        ),
        "corrected": (
            symgen.corrected,
            {**robot, "study": STUDY},
            {"robot": ROBOT, "study": {"None", "empty mapping", "study"}},
        ),
        "generate_module": (symgen.generate_module, robot, {**named, "command": {"None", *TEXT}}),
        "load_robot": (
            symgen.load_robot,
            {"source": "planar_2r"},
            {"source": set(), "keep_fixed": FLAG, "exact": FLAG, "base": NOTHING},
        ),
        "symgen.model": (
            symgen.model, robot, {**named, "options": {*EMPTY, "empty mapping"}, "base": NOTHING},
        ),
        "parse_robot": (symgen.parse_robot, {"content": b"x", "file": "x"}, {"content": set(), "file": set()}),
        "regrouping": (symgen.regrouping, robot, {**named, "seed": {"whole", "negative", "huge"}}),
        "symbolic": (
            symgen.symbolic,
            robot,
            {
                **named, "parameters": set(), "values": {"None", "empty mapping"}, "passive": NOTHING,
                "limit": {"whole", "negative", "huge"}, "decimals": FLAG,
            },
        ),
        "SymbolicRobot.model": (
            symgen.symbolic("planar_2r").model,
            {"name": "pose"},
            {
                "name": set(), "of": {"None", "whole"}, "frame": {"whole"}, "rows": NOTHING,
            },
        ),
        "variants": (symgen.variants, robot, {**named, "base": NOTHING}),
        "apply": (
            symgen.apply,
            {"estimate": "none", "model": "none.urdf"},
            {key: set() for key in ("estimate", "model", "robot", "lock", "chain", "exact", "base")},
        ),
        "load_model": (
            runtime.load_model,
            {"model": MODEL},
            {"model": {"model"}, "folder": {"None", *ANY_NAME}, "trust": FLAG},
        ),
        "load_study": (runtime.load_study, {"path": "none"}, {"path": set()}),
        "read_record": (
            runtime.read_record,
            {"path": "none.csv"},
            {key: set() for key in ("path", "model", "folder", "missing")},
        ),
        "report": (
            runtime.report,
            {"result": 1, "folder": folder},
            {"result": set(), "folder": set(), "study": set()},
        ),
        "identify_each": (
            runtime.identify_each,
            {"model": MODEL, "study": STUDY, "folder": folder},
            {
                key: set()
                for key in (
                    "model", "study", "folder", "map", "progress", "physical", "friction",
                    "variants", "plausible",
                )
            },
        ),
        "resample": (
            runtime.resample,
            {"t": T, "x": Q},
            {
                "t": {"times"}, "x": {"times", "positions"}, "rate": NOTHING, "method": set(),
                "longest": {"whole", "decimal fraction", "Decimal", "float64", "int32", "0-d"},
            },
        ),
        "Record": (
            runtime.Record,
            {"t": T, "q": Q, "tau": TAU},
            {
                "t": {"times"}, "q": STATES, "tau": STATES, "rate": NOTHING, "name": TEXT,
                "tau_known": {"None", "positions"}, "missing": {"None", "truths"},
                "channels": {"None", "empty mapping"}, "origin": NOTHING,
                "qd": {"None", "positions"}, "tau_ff": {"None", "positions"},
            },
        ),
        "simulate": (
            runtime.simulate,
            {"model": MODEL, "study": STUDY},
            {key: set() for key in ("model", "study", "folder", "ideal", "name")},
        ),
        "compare": (
            runtime.compare,
            {"model": MODEL, "candidates": {"a": (STUDY, RECORD, RECORD)}},
            {"model": {"model"}, "candidates": set(), "variants": {"None", "model"}},
        ),
        "casadi": (MODEL.casadi, {"name": "regressor"}, {"name": set(), "frame": NOTHING}),
        "base_parameters": (
            MODEL.base_parameters, {"standard": STANDARD}, {"standard": set(), "D2": NUMBER, "g": NUMBER},
        ),
        "elements": (MODEL.elements, {}, {"D2": NUMBER, "g": NUMBER}),
        "store": (MODEL.store, {"N": 3}, {"N": {"whole", "int32"}}),
    }  # fmt: skip
    of_states = {
        "regressor": "q qd qdd out", "observation_matrix": "q qd qdd out",
        "inverse_dynamics": "q qd qdd X", "inertia_matrix": "q X", "bias": "q qd X",
        "gravity": "q X", "forward_dynamics": "q qd tau X", "frame_poses": "q",
        "jacobian": "q frame",
    }  # fmt: skip
    for name, text in of_states.items():
        arguments = text.split()
        states = [a for a in arguments if a in ("q", "qd", "qdd", "tau")]
        given = dict.fromkeys(states, Q) | ({"X": X} if "X" in arguments else {})
        takes = dict.fromkeys(states, ONE_STATE if len(states) == 1 else STATES)
        takes |= {"X": set()} if "X" in arguments else {}
        takes |= {"out": NOTHING} if "out" in arguments else {}
        takes |= {"frame": {"None", "whole", "int32"}} if "frame" in arguments else {}
        read = {"D2", "g"} - {"gravity": {"D2"}}.get(name, set())
        read -= {"g"} if name in ("inertia_matrix", "frame_poses", "jacobian") else set()
        table[name] = getattr(MODEL, name), given, takes | dict.fromkeys(read, NUMBER)
    further = {
        "identify": {
            "further": {"None", "record", *EMPTY}, "loaded": {"None", "record", *EMPTY}, "simulator": NOTHING,
            "physical": FLAG, "friction": FLAG, "variants": {"None", "model"},
            "plausible": {"None", *FLAG}, "provenance": {"None", "empty mapping", "mapping", "mapping of numbers", "proxy"},
        },
        "problem": {"unseen": {"record", *EMPTY}, "simulator": NOTHING},
        "estimate": {"simulator": NOTHING}, "essential": {"simulator": NOTHING},
        "observe": {"simulator": NOTHING}, "plausibility": {"variants": {"None", "model"}},
        "cestac": {"simulator": NOTHING, "map": set()},
        "advise": {"readers": {"None", *EMPTY}}, "excite": {"map": set(), "progress": NOTHING},
        "static_poses": {}, "delay": {},
        "repair": {"variants": {"None", "model"}, "further": {"None", "record", *EMPTY},
                   "folder": {"None", *ANY_NAME}},
    }  # fmt: skip
    for name, takes in further.items():
        records = "record" if name == "delay" else "records"
        without = EMPTY if name in ("problem", "excite", "static_poses") else set()
        own = {"model": {"model"}, records: {"record", *without}, "study": {"None", "study"}}
        table[name] = getattr(runtime, name), {"model": MODEL, records: RECORD}, own | takes
    return table


SLOW = {"repair", "plausibility", "identify", "compare", "delay", "advise", "cestac", "excite", "static_poses"}  # fmt: skip
"""Not called with what they take: other tests do."""
UNKNOWN = {("store", "N", "jax")} | {
    (name, argument, kind)
    for name, argument in (("cestac", "map"), ("excite", "map"), ("excite", "progress"))
    for kind in ("function", "lambda", "class", "sympy")
}
"""A sentence of JAX on its way to an index, and functions that are called with what they refuse."""


def _wrong(name: str, function: Callable[..., Any], given: dict[str, Any]) -> str | None:
    """None for a result, "" for one sentence of the project, else what happened."""
    try:
        function(**given)
    except Exception as error:
        raised = Path(inspect.trace()[-1].filename)
        own = isinstance(error, InputError | SymgenError) or (
            isinstance(error, ValueError | TypeError) and raised.name == "planar_2r.py"
        )
        one = own and "\n" not in str(error) and str(error)
        return "" if one else f"{type(error).__name__}: {str(error)[:150]} ({raised.name})"
    return None


def test_every_public_function_is_in_the_table(tmp_path: Path) -> None:
    table = _table(tmp_path)
    functions = {f for f, _, _ in table.values()}
    for package in (symgen, runtime):
        for name in set(package.__all__) - {"packaged_robots"}:
            value = getattr(package, name)
            assert not inspect.isfunction(value) or value in functions, name
    for name, value in vars(MODEL).items():
        public = inspect.isfunction(value) and not name.startswith("_")
        assert not public or name in table, name
    for function, given, takes in table.values():
        named = {
            p.name
            for p in inspect.signature(function).parameters.values()
            if p.kind is not p.VAR_KEYWORD
        }
        assert given.keys() <= named | {"qd", "tau_ff"} and named - {"D2", "g"} <= takes.keys(), (
            function
        )


@campaign
@pytest.mark.filterwarnings("ignore")
def test_any_object_in_any_argument(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert len(KINDS) >= 75
    faults, calls, taken = [], 0, 0
    for name, (function, given, takes) in _table(tmp_path).items():
        for argument, kinds in takes.items():
            for kind, made in KINDS.items():
                if (kind in kinds and name in SLOW) or (name, argument, kind) in UNKNOWN:
                    continue
                calls += 1
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    wrong = _wrong(name, function, {**given, argument: made()})
                taken += wrong is None
                if (wrong is None) != (kind in kinds) or wrong:
                    faults.append(f"{name}({argument}), {kind}: {wrong or wrong is None}")
    print(f"{calls} calls, {taken} results, the others one sentence each")
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("kind", sorted(NUMBER))
def test_a_constant_is_the_number_that_it_is(kind: str) -> None:
    number = KINDS[kind]()
    for name in ("regressor", "observation_matrix"):
        function = getattr(MODEL, name)
        with np.errstate(all="ignore"):
            np.testing.assert_array_equal(
                function(Q, Q, Q, D2=number), function(Q, Q, Q, D2=float(number))
            )


def test_no_imaginary_part_is_dropped() -> None:
    for constant in (1j, True, [0.5], "0.5", UNITS.Quantity(1, "m")):
        with pytest.raises(ValueError, match=r"a constant: .*; expected"):
            MODEL.regressor(Q, Q, Q, D2=constant)
