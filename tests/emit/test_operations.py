"""Operation counts: those of the emitted text, and at most what the theory notes state."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable

import numpy as np
import pytest
from campaign import sampled

from symgen.derive.derivation import derive
from symgen.derive.graph import ADD, CONST, INV, MUL, POS, SYM
from symgen.derive.models import OPTIONS
from symgen.description import load_robot, packaged_robots
from symgen.emit.generate import generate_module
from symgen.emit.spec import (
    SHARING,
    Function,
    function,
    is_inertial,
    is_inertial_or_actuator,
    module_spec,
)
from symgen.regroup.regrouping import Regrouping, regroup


def counted(source: str) -> tuple[int, int]:
    """(multiplications, additions) of a text by its syntax tree; a square is one multiplication, a
    sign is free.
    """
    operators = [node.op for node in ast.walk(ast.parse(source)) if isinstance(node, ast.BinOp)]
    return sum(isinstance(op, ast.Mult | ast.Pow) for op in operators), sum(
        isinstance(op, ast.Add | ast.Sub) for op in operators
    )


def every_operation(f: Function) -> tuple[int, int]:
    """(multiplications, additions), those of constants and parameters too."""
    return sum(n.op == MUL for n in f.nodes), sum(n.op == ADD for n in f.nodes)


def values(f: Function) -> dict[int, np.ndarray]:
    """Values of the nodes of a function at eight random states of one robot, by node."""
    rng = np.random.default_rng(3)
    value: dict[int, np.ndarray] = {}
    for node in f.nodes:
        x = [o.sign * value[o.node.index] for o in node.operands]
        match node.op:
            case op if op == SYM:
                varies = node.value.kind not in ("constant", "pi", "parameter", "gravity")
                value[node.index] = rng.uniform(-2.0, 2.0, 8 if varies else 1) * np.ones(8)
            case op if op == CONST:
                value[node.index] = np.full(8, float(node.value))
            case op if op == ADD:
                value[node.index] = x[0] + x[1]
            case op if op == MUL:
                value[node.index] = x[0] * x[1]
            case op if op == POS:
                value[node.index] = np.maximum(x[0], 0.0)
            case op if op == INV:
                value[node.index] = 1 / x[0]
            case op:
                value[node.index] = getattr(np, op)(*x)
    return value


@pytest.mark.parametrize("name", sampled(packaged_robots(), 5, always=("tx40",)))
def test_header_counts_are_those_of_the_text(name: str) -> None:
    """Those of the text but for what no sample changes: sums and products of constants and
    parameters.
    """
    robot = load_robot(name)
    tree = ast.parse(generate_module(robot))
    functions = module_spec(regroup(robot)).functions
    header = ast.get_docstring(tree) or ""
    blocks = {
        node.name: node
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and node.name.endswith(("_block", "_motion"))
    }
    motion = getattr(blocks.pop("_motion", None), "body", [])
    inner = {f.name: f.body for f in motion if isinstance(f, ast.FunctionDef)}
    motion = [s for s in motion if not isinstance(s, ast.FunctionDef)]
    for composed in ("_jacobian_block", "_passive_joints_block"):
        blocks.pop(composed, None)
    stated = re.findall(r"^ {4}(\w+) +(\d+) multiplications, (\d+) additions", header, re.MULTILINE)
    assert len(stated) >= 5 and {f"_{function}_block" for function, *_ in stated} >= blocks.keys()
    for model, mul, add in stated:  # a model in which nothing acts has no block
        body = "\n".join(
            ast.unparse(statement)
            for statement in [
                *(motion if model in SHARING else []),
                *inner.get({"inverse_dynamics": "_torques"}.get(model, f"_{model}"), []),
                *getattr(blocks.get(f"_{model}_block"), "body", []),
            ]
        )
        f = functions[model]
        assert counted(body) == every_operation(f), model
        value = values(f)
        changed = [node.op for node in f.nodes if np.ptp(value[node.index])]
        assert (changed.count(MUL), changed.count(ADD)) == (int(mul), int(add)), model


def regressor_operations(regrouping: Regrouping, only: Callable[[str], bool]) -> tuple[int, int]:
    return function(regrouping, "regressor", only).operations


def at_most(found: tuple[int, int], limit: tuple[int, int]) -> bool:
    return found[0] <= limit[0] and found[1] <= limit[1]


# Limits: regrouping theory, section 6 (axis form; product form). Peers: OpenSYMORO 577/336 and
# 287/226, SymPyBotics 548/339 and 298/228.
def test_tx40_table1_limits() -> None:
    regrouping = regroup(load_robot("tx40_table1"))
    robot = regrouping.robot
    columns = [own for own in regrouping.own if is_inertial_or_actuator(robot)(own)]
    assert len(columns) == 40
    assert at_most(regressor_operations(regrouping, is_inertial_or_actuator(robot)), (367, 272))
    model = function(regrouping, "inverse_dynamics", is_inertial(robot))
    assert at_most(model.operations, (247, 233))


def test_panda_limits() -> None:
    regrouping = regroup(load_robot("panda"))
    robot = regrouping.robot
    assert at_most(regressor_operations(regrouping, is_inertial_or_actuator(robot)), (688, 500))
    model = function(regrouping, "inverse_dynamics", is_inertial(robot))
    assert at_most(model.operations, (314, 297))


@pytest.mark.parametrize("name", sampled(packaged_robots(), 5, always=("tx40",)))
def test_names_come_from_structure(name: str) -> None:
    """No temporaries, no running numbers: every local is a family with indices, a product of names,
    or a constant.
    """
    for block in ast.parse(generate_module(load_robot(name))).body:
        if isinstance(block, ast.FunctionDef) and block.name.endswith(("_block", "_motion")):
            targets = [t for s in block.body if isinstance(s, ast.Assign) for t in s.targets]
            names = [t.id for t in targets if isinstance(t, ast.Name)]
            assert not [n for n in names if re.fullmatch(r"(tmp|t|x|K)\d+", n)]
            assert len(set(names)) == len(names)


def distinct_operations(f: Function) -> set[tuple[float, ...]]:
    """Values of the sums and products of a function, up to sign, at random states."""
    value = values(f)
    operations = [value[n.index] for n in f.nodes if n.op in (ADD, MUL)]
    return {tuple((x * np.sign(x[0])).round(9)) for x in operations}


@pytest.mark.parametrize("name", ["tx40", "panda"])
def test_no_operation_is_computed_twice(name: str) -> None:
    """A node that was merged into an equal one comes back merged when it is made again."""
    derive.cache_clear()  # what was asked for before orders the nodes
    spec = module_spec(regroup(load_robot(name)), OPTIONS)
    for model, f in spec.functions.items():
        operations = [node for node in f.nodes if node.op in (ADD, MUL)]
        assert len(distinct_operations(f)) == len(operations), model
    if name == "panda":
        assert at_most(spec.functions["coriolis"].operations, (762, 646))
    if name == "tx40":
        assert at_most(spec.functions["coriolis"].operations, (507, 423))
        assert at_most(every_operation(spec.functions["momentum_rate_regressor"]), (384, 268))
        assert at_most(every_operation(spec.functions["base_wrench_regressor"]), (583, 429))


@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("tx40", (136, 114)),
        ("rx90", (136, 113)),
        ("puma560", (176, 151)),
        ("stanford", (111, 96)),
        ("panda", (208, 175)),
        ("two_branch", (118, 108)),
        ("sr400", (166, 132)),
    ],
)
def test_composite_links_halve_the_inertia_matrix(name: str, limit: tuple[int, int]) -> None:
    """OpenSYMORO has 195 + 133 for the RX90; unit accelerations of the whole recursion 259 + 193."""
    f = function(regroup(load_robot(name)), "inertia_matrix")
    assert at_most(every_operation(f), limit)
