"""What the witness asks of texts of robots with general loops, and of every model of the table."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest
from certify.tables import table_errors
from emit.test_casadi import loaded

from oracles.loop_robots import BENNETT, JACKS, LIFT
from symgen.certify.modules import certify
from symgen.certify.witness import OF_THE_FILE, RANDOM, Witness
from symgen.derive.models import EMITTED
from symgen.description import load_robot
from symgen.emit.generate import generate_files
from symgen.regroup.regrouping import EXACT, Regrouping, regroup


def regrouped(text: str, folder: Path) -> Regrouping:
    path = folder / "robot.yaml"
    path.write_text(text)
    return regroup(load_robot(path))


def marked(regrouping: Regrouping, name: str, joint: int, mark: str) -> ModuleType:
    """The module in which STRUCTURE marks an entry otherwise."""
    ((file, text),) = generate_files(regrouping.robot, regrouping=regrouping).items()
    head, table, tail = text.partition("for mark in row] for row in (")
    rows = tail.split('"')
    k, j = regrouping.names.index(name), regrouping.robot.joints.index(joint)
    row = rows[2 * k + 1]
    assert len(row) == len(regrouping.robot.joints) and row[j] != mark
    rows[2 * k + 1] = row[:j] + mark + row[j + 1 :]
    return loaded(file, head + table + '"'.join(rows))


@pytest.mark.parametrize(
    "text", [LIFT, pytest.param(JACKS, marks=pytest.mark.campaign)], ids=["lift", "jacks"]
)
def test_entries_may_be_zero_on_the_closed_mechanism_alone(text: str, tmp_path: Path) -> None:
    """Links of a loop act on others by rates that the loop makes zero: a right table was FALSE."""
    regrouping = regrouped(text, tmp_path)
    certificate = certify(regrouping)
    assert certificate.valid, str(certificate)
    ((file, module),) = generate_files(regrouping.robot, regrouping=regrouping).items()
    assert not any(table_errors(loaded(file, module), Witness(regrouping)).values())


@pytest.mark.parametrize(("name", "joint", "mark"), [("ZZ7", 2, "."), ("ZZ1R", 2, "x")])
def test_a_wrong_mark_of_a_loop_is_refused(name, joint, mark, tmp_path) -> None:
    """One that acts and is not marked; one that acts in no way, were the loop open, and is."""
    regrouping = regrouped(LIFT, tmp_path)
    errors = table_errors(marked(regrouping, name, joint, mark), Witness(regrouping))
    assert [table for table, error in errors.items() if error] == ["STRUCTURE"]


def test_formulas_that_are_numbers_are_checked_at_the_constants_of_the_file(tmp_path: Path) -> None:
    """They were called with others, for which they do not hold: inverse dynamics off by 4e-3."""
    regrouping = regrouped(BENNETT, tmp_path)
    certificate = certify(regrouping)
    (check,) = certificate.texts.values()
    assert regrouping.method != EXACT and certificate.valid, str(certificate)
    assert check.constants == OF_THE_FILE and OF_THE_FILE in check.sentence
    assert Witness(regroup(load_robot("planar_2r"))).drawn == RANDOM


def test_every_model_of_the_targets_has_a_witness(monkeypatch: pytest.MonkeyPatch) -> None:
    regrouping = regroup(load_robot("planar_2r"))
    assert {*EMITTED} <= {*Witness(regrouping).checks}
    monkeypatch.setitem(EMITTED, "new", EMITTED["bias"]._replace(name="new"))
    with pytest.raises(KeyError, match="new"):
        _ = Witness(regrouping).checks
