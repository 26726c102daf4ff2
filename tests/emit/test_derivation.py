"""The recursion runs once per robot, whatever is asked of it, and its result can be copied."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest
from campaign import sampled, some
from typer.testing import CliRunner

import symgen
from symgen.certify.certificate import independent
from symgen.cli.main import app
from symgen.derive.derivation import derive
from symgen.derive.loop_equations import loop_system
from symgen.derive.loops import close
from symgen.derive.models import MODELS, ON_REQUEST
from symgen.derive.newton_euler import Motion
from symgen.description import Robot, load_robot, packaged_robots
from symgen.emit.generate import generate_files
from symgen.emit.spec import function, module_spec, spec_of
from symgen.pages.page import robot_page
from symgen.regroup.regrouping import _regrouped, regroup
from symgen.regroup.states import _acting

TARGETS = ("numpy", "casadi", "xp", "c")


@pytest.fixture
def derivations(monkeypatch: pytest.MonkeyPatch) -> list[Robot]:
    """The robots whose recursion was run, as it happens."""
    robots: list[Robot] = []
    start = Motion.__init__

    def counted(self: Motion, geometry, **options) -> None:
        robots.append(geometry.robot)
        start(self, geometry, **options)

    monkeypatch.setattr(Motion, "__init__", counted)
    for cached in (derive, spec_of, _regrouped, independent, loop_system, close, _acting):
        cached.cache_clear()
    return robots


@pytest.mark.parametrize(
    "command",
    [
        ["generate", "tx40", "two_branch", "sr400", "five_bar"],
        ["check", "two_branch"],
        ["show", "two_branch"],
        ["show", "five_bar", "--model", "inertia_matrix"],
        ["identify", "emps", "emps"],
    ],
    ids=" ".join,
)
def test_a_command_runs_the_recursion_at_most_once_per_robot(
    command: list[str],
    derivations: list[Robot],
    emps_data,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Regrouping, proofs, loops, numbers of the file: all are values of one graph."""
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path))
    output = ["-o", str(tmp_path / "out")] if command[0] in ("generate", "identify") else []
    done = CliRunner().invoke(app, [*command, *output])
    assert done.exit_code == 0, done.output
    assert len(derivations) == len({*derivations}) and derivations[0].name in command


def test_four_targets_are_one_derivation(derivations: list[Robot]) -> None:
    generate_files(load_robot("tx40"), targets=TARGETS)
    assert [robot.name for robot in derivations] == ["tx40"]


def test_everything_else_reads_the_same_derivation(derivations: list[Robot]) -> None:
    robot = load_robot("scara")
    generate_files(robot, targets=TARGETS)
    symgen.symbolic(robot).show("inertia_matrix")
    symgen.symbolic(robot).equations("inverse_dynamics")
    robot_page(regroup(robot))
    assert [robot.name for robot in derivations] == ["scara"]


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


def test_a_function_on_request_does_not_depend_on_what_was_asked_before() -> None:
    regrouping, alone = regroup(load_robot("tx40")), {}
    for name in ON_REQUEST:
        derive.cache_clear()
        alone[name] = function(regrouping, name).nodes
    derive.cache_clear()
    symgen.symbolic("tx40").model("jacobian").listing  # noqa: B018
    for name in reversed(ON_REQUEST):
        after = function(regrouping, name).nodes
        assert [(n.op, n.name) for n in after] == [(n.op, n.name) for n in alone[name]], name


@pytest.mark.parametrize("of", ["inverse_dynamics", "inertia_matrix", "bias", "gravity"])
def test_parameters_of_another_length_are_refused(of: str) -> None:
    module = symgen.model("tx40")
    q = np.zeros((3, 6))
    arguments = [q] * (len(MODELS[of].arguments) - 1)
    with pytest.raises(ValueError, match=r"X of shape \(86,\); expected \(60,\)"):
        getattr(module, of)(*arguments, np.ones(86))


def test_torques_that_only_broadcast_are_refused() -> None:
    module = symgen.model("tx40")
    q, X = np.zeros((3, 6)), np.ones(60)
    with pytest.raises(ValueError, match="states of shape"):
        module.forward_dynamics(q, q, np.zeros(6), X)
