"""A derivation that takes too long ends with one sentence, from Python and from the command line."""

import pytest

from symgen import load_robot, regrouping, time_limit
from symgen.cli.main import main
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
