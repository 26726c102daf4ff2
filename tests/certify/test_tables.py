"""Tables of emitted modules, read back: what the robot file, the regrouping and the witness say."""

from __future__ import annotations

import re

import pytest
from campaign import some
from certify.tables import table_errors
from emit.test_casadi import loaded

from symgen.certify.witness import Witness
from symgen.description import load_robot, packaged_robots
from symgen.emit.generate import generate_module
from symgen.regroup.regrouping import regroup


@pytest.mark.parametrize("name", packaged_robots())
@some(4)
def test_tables_of_packaged_robots_are_right(name: str) -> None:
    robot = load_robot(name)
    errors = table_errors(loaded(name, generate_module(robot)), Witness(regroup(robot)))
    assert len(errors) >= 18 and set(errors.values()) == {0.0}


WRONG = {
    "CONSTANTS": (r"'D3': 0\.225", "'D3': 0.235"),
    "FORMULAS": (r"'ZZ3 \+ YY4", "'ZZ3 - YY4"),
    "STRUCTURE": (r'"xx\.\.\.\.", "xx', '"x.....", "xx'),
    "ELEMENTS": (r"'FSM6': \('coulomb', 'both', \{5: 1\.0", "'FSM6': ('coulomb', 'both', {5: -1.0"),
    "DEFAULTS": (r"D3: float = 0\.225", "D3: float = 0.235"),
    "UNITS": (r"kg\*m\*\*2 N\*m\*s/rad N\*m", "kg*m N*m*s/rad N*m"),
}


@pytest.mark.parametrize("table", WRONG)
def test_a_wrong_entry_is_seen(table: str) -> None:
    robot, (old, new) = load_robot("tx40"), WRONG[table]
    text, count = re.subn(old, new, generate_module(robot), count=1)
    assert count == 1
    assert table_errors(loaded("tx40", text), Witness(regroup(robot)))[table] == float("inf")
