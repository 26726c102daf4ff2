"""Regrouping formulas and counts against published ones: eq. (27) of the chapter, counts of
Khalil's robots.
"""

from __future__ import annotations

import pytest

from symgen.description import Robot, load_robot
from symgen.description.grammar import parse
from symgen.regroup import solve
from symgen.regroup.regrouping import Regrouping, _regrouped, regroup

# Chapter, eq. (27), all fifteen, as printed (d3 = D3); typed from the chapter, not from symgen.
EQ27 = {
    "ZZ1R": "Ia1 + D3**2*(M3 + M4 + M5 + M6) + YY2 + YY3 + ZZ1",
    "XX2R": "-D3**2*(M3 + M4 + M5 + M6) + XX2 - YY2",
    "XZ2R": "-D3*MZ3 + XZ2",
    "ZZ2R": "Ia2 + D3**2*(M3 + M4 + M5 + M6) + ZZ2",
    "MX2R": "D3*(M3 + M4 + M5 + M6) + MX2",
    "XX3R": "2*MZ4*RL4 + (M4 + M5 + M6)*RL4**2 + XX3 - YY3 + YY4",
    "ZZ3R": "2*MZ4*RL4 + (M4 + M5 + M6)*RL4**2 + YY4 + ZZ3",
    "MY3R": "MY3 - MZ4 - (M4 + M5 + M6)*RL4",
    "XX4R": "XX4 - YY4 + YY5",
    "ZZ4R": "YY5 + ZZ4",
    "MY4R": "MY4 + MZ5",
    "XX5R": "XX5 - YY5 + YY6",
    "ZZ5R": "YY6 + ZZ5",
    "MY5R": "MY5 - MZ6",
    "XX6R": "XX6 - YY6",
}
# with the alpha of Table 1 as printed: the OpenSYMORO listing of the RX-90 has these
TABLE1_SIGNS = {
    "MY3R": "MY3 + MZ4 + (M4 + M5 + M6)*RL4",
    "MY4R": "MY4 - MZ5",
    "MY5R": "MY5 + MZ6",
}
# Base parameters with Ia, FV, FS, OFFSET on every joint; regrouping theory, numerical ranks of
# several authors.
COUNTS = {
    "tx40_table1": 58, "tx40": 60, "rx90": 58, "puma560": 58, "stanford": 55, "scara": 22, "panda": 69,
    "emps": 4, "emps_asymmetric": 5, "planar_2r": 13,
}  # fmt: skip


def regrouped(regrouping: Regrouping) -> dict[str, object]:
    """{name: formula as a polynomial} of the parameters that absorb others."""
    return {b.name: parse(str(b.formula)) for b in regrouping.base if b.name != b.own}


def test_eq_27_term_by_term() -> None:
    assert regrouped(regroup(load_robot("tx40"))) == {
        name: parse(text) for name, text in EQ27.items()
    }


def test_table_1_changes_three_signs() -> None:
    assert regrouped(regroup(load_robot("tx40_table1"))) == {
        name: parse(text) for name, text in (EQ27 | TABLE1_SIGNS).items()
    }


@pytest.mark.parametrize(("name", "count"), COUNTS.items())
def test_counts(name: str, count: int) -> None:
    regrouping = regroup(load_robot(name))
    assert len(regrouping) == count
    used = {p for b in regrouping.base for p in b.combination}
    assert used | set(regrouping.no_effect) == set(regrouping.robot.parameters)
    assert not used & set(regrouping.no_effect)


def test_independent_wrist_inertia_adds_one() -> None:
    """With a coupling inertia of its own beside Ia6 the TX40 has 61 base parameters."""
    robot = load_robot("tx40")
    elements = tuple(e for e in robot.elements if e.family != "Ia")
    ia = next(e for e in robot.elements if e.family == "Ia")
    viscous = next(e for e in robot.elements if e.family == "FVM")
    alone = type(ia)("Ia", "inertia", {**ia.along, 6: {6: parse("1")}}, {})
    coupling = type(ia)("IAM", "inertia", {}, viscous.form)
    assert len(regroup(_with_elements(robot, (alone, coupling, *elements)))) == 61


def _with_elements(robot: Robot, elements: tuple) -> Robot:
    from dataclasses import replace

    return replace(robot, elements=elements, values={})


def test_prismatic_mass_stands_before_actuator_inertia() -> None:
    base = {b.name: str(b.formula) for b in regroup(load_robot("emps")).base}
    assert base["M1R"] == "M1 + Ia1"


def test_seed_does_not_change_the_result() -> None:
    robot = load_robot("two_branch")
    assert [b.formula for b in regroup(robot).base] == [
        b.formula for b in regroup(robot, seed=77).base
    ]


def test_a_search_that_took_long_leaves_time_for_simple_coefficients(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Once the work of a robot was spent, every coefficient after it became a number."""
    robot = load_robot("puma560")
    expected = regroup(robot)
    monkeypatch.setattr(solve, "MAX_WORK", 0)
    assert _regrouped.__wrapped__(robot, 1) == expected
