"""A derivation that takes too long ends with one sentence, from Python and from the command line."""

from dataclasses import replace

import pytest

from symgen import load_robot, regrouping, time_limit
from symgen.certify.modules import certified_files
from symgen.cli.main import main
from symgen.derive.graph import LOOKS, Graph
from symgen.description.expression import Expression
from symgen.errors import SymgenError
from symgen.regroup.regrouping import _regrouped


def test_regrouping_ends(monkeypatch):
    _regrouped.cache_clear()
    monkeypatch.setattr(time_limit, "SECONDS", 0.0)
    with pytest.raises(
        SymgenError, match="the regrouping of scara takes more than 0 s of processor time"
    ):
        regrouping(load_robot("scara"))


def test_check_ends_with_one_sentence(monkeypatch, capsys):
    _regrouped.cache_clear()
    monkeypatch.setattr(time_limit, "SECONDS", 0.0)
    monkeypatch.setattr("sys.argv", ["symgen", "check", "scara"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2 and "takes more than 0 s" in " ".join(
        capsys.readouterr().err.split()
    )


def test_products_of_long_coefficients_end(monkeypatch):
    """A table of many decimals: its rules multiply polynomials and look at no clock of their own."""
    monkeypatch.setattr(time_limit, "SECONDS", 0.0)
    a = Expression.symbol("a")
    with time_limit.limited("the derivation"), pytest.raises(SymgenError, match="the derivation"):
        a * a


def test_derivations_end(monkeypatch):
    """The models of a robot are derived after its regrouping, within a limit of their own."""
    robot = replace(load_robot("panda"), name="late")
    regrouping(robot)
    monkeypatch.setattr(time_limit, "SECONDS", 0.0)
    with pytest.raises(SymgenError, match="the derivation of late takes more than 0 s"):
        certified_files(robot)


def test_a_graph_looks_at_the_clock(monkeypatch):
    graph = Graph()
    monkeypatch.setattr(time_limit, "SECONDS", 0.0)
    with time_limit.limited("a graph"), pytest.raises(SymgenError, match="a graph takes"):
        for k in range(2 * LOOKS):
            graph.number(k)
