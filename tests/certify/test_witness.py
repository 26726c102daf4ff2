"""What the witness asks of texts of robots with general loops, and of every model of the table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from symgen.certify.certificate import Certificate
from symgen.certify.modules import certify
from symgen.certify.witness import OF_THE_FILE, RANDOM, Witness
from symgen.derive.models import EMITTED
from symgen.description import load_robot
from symgen.emit.generate import generate_files
from symgen.regroup.regrouping import EXACT, Regrouping, regroup

LIFT = """
symgen: 1
name: lift
gravity: [0, 0, -g]
constants: {L0: 0.45, L1: 0.2, L2: 0.5, L3: 0.4, g: 9.81, D7: 0.3}
frames:   # a four-bar on a turret, a wrist on its coupler
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: pi/2, d: 0,  theta: q2, r: 0}
  3: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: L1, theta: q3, r: 0}
  4: {ant: 1, sigma: 0, mu: 0, alpha: pi/2, d: L0, theta: q4, r: 0}
  5: {ant: 3, sigma: 0, mu: 0, alpha: 0, d: L2, theta: q5, r: 0}
  6: {ant: 4, sigma: 2, alpha: 0, d: L3, theta: 0,  r: 0}
  7: {ant: 3, sigma: 0, alpha: 0, d: D7, theta: q7, r: 0}
loops: [{cut: 5, twin: 6, start: {q2: 1, q3: -0.5518, q4: 1.2956, q5: 0.8475}}]
"""
JACKS = """
symgen: 1
name: jacks
gravity: [0, -g, 0]
constants: {a: 0.5, a2: 0.45, d1: 0.35, LB: 1.3, g: 9.81}
frames:   # boom and stick of an excavator
  1: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 0, sigma: 0, mu: 0, gamma: -0.5, alpha: 0, d: d1, theta: q2, r: 0}
  3: {ant: 2, sigma: 1, alpha: pi/2, d: 0, theta: 0, r: q3}
  4: {ant: 3, sigma: 0, mu: 0, alpha: -pi/2, d: 0, theta: q4, r: 0}
  5: {ant: 1, sigma: 2, alpha: 0, d: a, theta: 0, r: 0}
  6: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: LB, theta: q6, r: 0}
  7: {ant: 1, sigma: 0, mu: 0, gamma: 0.4, alpha: 0, d: a2, theta: q7, r: 0}
  8: {ant: 7, sigma: 1, alpha: pi/2, d: 0, theta: 0, r: q8}
  9: {ant: 8, sigma: 0, mu: 0, alpha: -pi/2, d: 0, theta: q9, r: 0}
  10: {ant: 6, sigma: 2, alpha: 0, d: 0.25, theta: 0, r: 0}
loops:
  - {cut: 4, twin: 5, start: {q1: 0.6, q3: 0.5}}
  - {cut: 9, twin: 10, start: {q6: 1.6, q8: 0.9}}
"""
BENNETT = """
symgen: 1
name: bennett
gravity: [0, -9.81, 0]
constants: {a: 0.3, AA: 0.6, BB: 1.1}
frames:   # spatial 4R, a/sin(A) = b/sin(B)
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, mu: 0, alpha: AA, d: a, theta: q2, r: 0}
  3: {ant: 2, sigma: 0, mu: 0, alpha: BB, d: a*sin(BB)/sin(AA), theta: q3, r: 0}
  4: {ant: 0, sigma: 0, mu: 0, alpha: -BB, d: -a*sin(BB)/sin(AA), theta: q4, r: 0}
  5: {ant: 4, sigma: 2, alpha: -AA, d: -a, theta: 0, r: 0}
loops: [{cut: 3, twin: 5, start: {q1: 1.0}}]
"""


def regrouped(text: str, folder: Path) -> Regrouping:
    path = folder / "robot.yaml"
    path.write_text(text)
    return regroup(load_robot(path))


def marked(regrouping: Regrouping, name: str, joint: int, mark: str) -> Certificate:
    """The certificate of the module in which STRUCTURE marks an entry otherwise."""
    ((file, text),) = generate_files(regrouping.robot, regrouping=regrouping).items()
    head, table, tail = text.partition("for mark in row] for row in (")
    rows = tail.split('"')
    k, j = regrouping.names.index(name), regrouping.robot.joints.index(joint)
    row = rows[2 * k + 1]
    assert len(row) == len(regrouping.robot.joints) and row[j] != mark
    rows[2 * k + 1] = row[:j] + mark + row[j + 1 :]
    return certify(regrouping, {file: head + table + '"'.join(rows)})


@pytest.mark.parametrize("text", [LIFT, JACKS], ids=["lift", "jacks"])
def test_entries_may_be_zero_on_the_closed_mechanism_alone(text: str, tmp_path: Path) -> None:
    """Links of a loop act on others by rates that the loop makes zero: a right table was FALSE."""
    certificate = certify(regrouped(text, tmp_path))
    assert certificate.valid, str(certificate)


@pytest.mark.parametrize(("name", "joint", "mark"), [("ZZ7", 2, "."), ("ZZ1R", 2, "x")])
def test_a_wrong_mark_of_a_loop_is_refused(name, joint, mark, tmp_path) -> None:
    """One that acts and is not marked; one that acts in no way, were the loop open, and is."""
    (check,) = marked(regrouped(LIFT, tmp_path), name, joint, mark).texts.values()
    assert check.wrong == ["STRUCTURE"]


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
    monkeypatch.setitem(EMITTED, "new", replace(EMITTED["bias"], name="new"))
    with pytest.raises(KeyError, match="new"):
        _ = Witness(regrouping).checks
