"""Why parameters are taken in, against columns by energies, and what an edit does to the base."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import symgen
from symgen.certify.lagrange import in_one_mode, sampled
from symgen.description.grammar import parse


@pytest.mark.parametrize("name", ["tx40", "scara", "sr400", "two_branch", "emps"])
def test_columns_are_as_said(name: str) -> None:
    """Each sentence read back, its columns those of Lagrange's equations."""
    robot = symgen.load_robot(name)
    regrouping = symgen.regrouping(robot)
    W = sampled(in_one_mode(robot), 20, seed=3).W
    column = {name: W[:, k] for k, name in enumerate(robot.parameters)}
    own = {b.name: column[b.own] for b in regrouping.base}
    absorbed = symgen.absorptions(regrouping)
    assert {a.name for a in absorbed} == {
        name for b in regrouping.base for name in b.combination if name != b.own
    }
    for a in absorbed:
        if same := re.fullmatch(r"the columns of (\w+) and (\w+) are (equal|opposite)", a.columns):
            assert same[1] == a.name
            expected = own[same[2]] * (1 if same[3] == "equal" else -1)
            assert a.base == (same[2],)
        else:
            left, right = a.columns.removeprefix("of the columns, ").split(" = ")
            assert left == f"D_{a.name}"
            formula = parse(right)
            expected = sum(
                own[b] * formula.coefficient(f"D_{b}").value(robot.constants) for b in a.base
            )
        assert np.allclose(column[a.name], expected, rtol=1e-9, atol=1e-9 * np.abs(W).max()), a


def test_rules_are_named() -> None:
    rules = {
        a.name: a.rule for a in symgen.absorptions(symgen.regrouping(symgen.load_robot("scara")))
    }
    assert (
        rules["M3"] == "the origin of frame 3 is fixed in link 2: mass there acts as mass of link 2"
    )
    assert rules["ZZ4"].startswith("link 4 does not turn against link 3: its inertia tensor")
    assert rules["Ia1"] == "a relation of this robot (exact, proved modulo primes)"


def test_an_edit_and_what_becomes_of_the_base() -> None:
    robot = symgen.load_robot("planar_2r")
    frames = list(robot.frames)
    frames[1] = replace(frames[1], alpha=parse("pi/2"))
    turned = replace(robot, frames=tuple(frames), constants={"D2": 0.7, "g": 9.81})
    base = symgen.regrouping(robot)
    told = symgen.base_difference(base, symgen.regrouping(turned))
    assert told.edits == ("constants.D2: 0.5 -> 0.7", "alpha of frame 2: 0 -> pi/2")
    assert told.appeared == ("XX2R", "XY2", "XZ2", "YZ2")
    assert told.gone == ("Ia2",)
    assert ("MY1", "MY1R = MY1 - MZ2") in told.changed
    assert str(told).startswith(
        "constants.D2: 0.5 -> 0.7, alpha of frame 2: 0 -> pi/2: XX2R, XY2, XZ2, YZ2 appear; "
        "Ia2 disappears; ZZ1R = ZZ1 + Ia1 + YY2 + D2**2*M2 (was ZZ1R = ZZ1 + Ia1 + D2**2*M2); "
    )
    back = symgen.base_difference(symgen.regrouping(turned), base)
    assert (back.appeared, back.gone) == (told.gone, told.appeared)


def test_no_edit_and_edits_without_effect() -> None:
    robot = symgen.load_robot("planar_2r")
    base = symgen.regrouping(robot)
    assert (
        str(symgen.base_difference(base, base)) == "no edit that matters: the base parameters stay"
    )
    longer = symgen.regrouping(replace(robot, constants={"D2": 0.7, "g": 9.81}, title="another"))
    assert str(symgen.base_difference(base, longer)) == (
        "constants.D2: 0.5 -> 0.7: the base parameters stay"
    )
    fewer = symgen.regrouping(replace(robot, elements=robot.elements[:1], values={}))
    told = symgen.base_difference(base, fewer)
    assert "elements.FV.kind: viscous -> none" in told.edits and "FV1" in told.gone
