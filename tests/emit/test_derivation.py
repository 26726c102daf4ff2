"""The recursion runs once per robot, whatever is asked of it, and its result can be copied."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from campaign import sampled, some

import symgen
from symgen.derive.derivation import derive
from symgen.derive.graph_algebra import GraphAlgebra
from symgen.derive.models import MODELS
from symgen.derive.newton_euler import Motion
from symgen.description import load_robot, packaged_robots
from symgen.emit.generate import generate_files
from symgen.emit.spec import module_spec, spec_of
from symgen.regroup.regrouping import regroup
from symgen.report.page import robot_page

TARGETS = ("numpy", "casadi", "xp", "c")


@pytest.fixture
def derivations(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The robots whose recursion was run over graph nodes, as it happens."""
    robots: list[str] = []
    start = Motion.__init__

    def counted(self: Motion, geometry, **options) -> None:
        if isinstance(geometry.algebra, GraphAlgebra):
            robots.append(geometry.robot.name)
        start(self, geometry, **options)

    monkeypatch.setattr(Motion, "__init__", counted)
    for cached in (derive, spec_of):
        cached.cache_clear()
    return robots


def test_four_targets_are_one_derivation(derivations: list[str]) -> None:
    generate_files(load_robot("tx40"), targets=TARGETS)
    assert derivations == ["tx40"]


def test_everything_else_reads_the_same_derivation(derivations: list[str]) -> None:
    robot = load_robot("scara")
    generate_files(robot, targets=TARGETS)
    symgen.symbolic(robot).show("inertia_matrix")
    symgen.symbolic(robot).equations("inverse_dynamics")
    robot_page(regroup(robot))
    assert derivations == ["scara"]


@pytest.mark.parametrize(
    "name", sampled(packaged_robots(), 3, always=("tx40", "four_bar", "sr400"))
)
@some(2)
def test_a_derivation_is_pickled_and_copied(name: str) -> None:
    robot = load_robot(name)
    regrouping, text = regroup(robot), generate_files(robot)
    for copied in (lambda x: pickle.loads(pickle.dumps(x)), copy.deepcopy):  # noqa: S301
        d = copied(derive(robot))
        assert d.robot == robot and d.columns.keys() == derive(robot).columns.keys()
        assert [n.name for n in d.algebra.graph.nodes] == [
            n.name for n in derive(robot).algebra.graph.nodes
        ]
        again = copied(regrouping)
        assert again.names == regrouping.names
        assert [b.formula for b in again.base] == [b.formula for b in regrouping.base]
        assert generate_files(again.robot, regrouping=again) == text


def test_later_models_change_no_emitted_byte() -> None:
    """Models asked in between add nodes to the graph and rename none."""
    derive.cache_clear()
    regrouping = regroup(load_robot("tx40"))
    before = module_spec(regrouping)
    for name, model in MODELS.items():
        if model.cases and model.symbolic and name != "closure":
            symgen.symbolic("tx40").model(name).listing  # noqa: B018
    after = module_spec(regrouping)
    for name, f in before.functions.items():
        g = after.functions[name]
        assert [(n.op, n.name, n.value) for n in f.nodes] == [
            (n.op, n.name, n.value) for n in g.nodes
        ]


@pytest.mark.parametrize("function", ["inverse_dynamics", "inertia_matrix", "bias", "gravity"])
def test_parameters_of_another_length_are_refused(function: str) -> None:
    module = symgen.model("tx40")
    q = np.zeros((3, 6))
    arguments = [q] * (len(MODELS[function].arguments) - 1)
    with pytest.raises(ValueError, match=r"X of shape \(86,\); expected \(60,\)"):
        getattr(module, function)(*arguments, np.ones(86))


def test_torques_that_only_broadcast_are_refused() -> None:
    module = symgen.model("tx40")
    q, X = np.zeros((3, 6)), np.ones(60)
    with pytest.raises(ValueError, match="states of shape"):
        module.forward_dynamics(q, q, np.zeros(6), X)
