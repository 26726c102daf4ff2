"""A derivation that takes too long ends with one sentence, from Python and from the command line."""

import pytest

from symgen import load_robot, regrouping
from symgen.cli.main import main
from symgen.derive import time_limit
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
