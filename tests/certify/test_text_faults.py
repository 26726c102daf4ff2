"""Seeded faults in every function of every emitted text are refused: a few by default, 20 more as a campaign, 300 for
the table of `benchmarks/every_case.py`.
"""

from __future__ import annotations

import re

import pytest
from campaign import FULL, campaign, some
from certify.text_faults import WAYS, Fault, equivalent, faults, refused

from symgen.certify.modules import certify
from symgen.description import parse_robot
from symgen.errors import SymgenError
from symgen.regroup.regrouping import regroup

HOLES = (  # what older certificates let pass: target, function, old, new
    ("tx40.py", "numpy", r"^(    P13 = .*)D3", r"\1RL4"),  # both 0.225 in the file
    ("tx40.py", "numpy", r"^(def frame_poses.* D3: float = )0\.225", r"\g<1>0.2"),
    ("tx40.py", "numpy", r"^    T\[2, 0, 3\] = P13", "    T[2, 0, 3] = P23"),
    ("tx40.py", "numpy", r"return \[x\[\.\.\., k\] for", "return [x[..., k - 1] for"),  # other packages
    ("tx40.py", "numpy", r"triplet\(rows, columns, e", "triplet(rows, columns, -e"),  # CasADi
    ("tx40.py", "numpy", r"ca\.jacobian\(results\[y\]", "ca.jacobian(2*results[y]"),
    ("tx40.c", "c", r"AT\(GAM, 0\) = OFFSET1", "AT(GAM, 0) = -OFFSET1"),
    ("tx40.c", "c", r"z\[1\]\*P\[2\] - ", "z[1]*P[2] + "),
    ("tx40.c", "c", r"qdd\[j\] = tau\[j\] - qdd", "qdd[j] = tau[j] + qdd"),
    ("sr400.c", "c", r"rows, N, S \+ start\)", "rows, N, S)"),  # the first tile alone
    ("scara.py", "numpy", r"_evaluated\(_frame_poses_block, \(4, 4, 4\), \(q,\), \(\), \(D2, D3\)\)", "_evaluated(_frame_poses_block, (4, 4, 4), (q,), (), (D2, D2))"),
)  # fmt: skip


def survivors(found: list[Fault]) -> list[Fault]:
    left = [fault for fault in found if not refused(fault) and not equivalent(fault)]
    return [
        f for f in left if not any(re.search(pattern, f"{f.file} {f.new}") for pattern, _ in WAYS)
    ]


def test_a_few_faults_are_refused() -> None:
    assert survivors(faults(7, 5)) == []


def test_a_text_too_long_for_python_is_no_verdict() -> None:
    """A length that is a sum of 85 constants: its square is a formula that Python cannot compile."""
    names = [f"c{k}" for k in range(85)]
    robot = parse_robot(
        f"""\
symgen: 1
name: long
gravity: [0, 0, -9.81]
constants: {{{", ".join(f"{name}: 0.01" for name in names)}}}
frames:
  1: {{ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}}
  2: {{ant: 1, sigma: 0, alpha: 0, d: {" + ".join(names)}, theta: q2, r: 0}}
""".encode(),
        "long.yaml",
    )
    with pytest.raises(SymgenError, match=r"long\.py has expressions that are too long for Python"):
        certify(regroup(robot))


@campaign
@pytest.mark.parametrize("seed", range(1, 7 if FULL else 2))
def test_faults_are_refused(seed: int) -> None:
    assert survivors(faults(50 if FULL else 20, seed)) == []


@pytest.mark.parametrize(("file", "target", "old", "new"), HOLES)
@some(3)
def test_holes_are_closed(file: str, target: str, old: str, new: str) -> None:
    from certify.text_faults import texts

    from symgen.certify.texts import text_check

    witness, files = texts(file.partition(".")[0])
    text = files[file][1]
    changed, count = re.subn(old, new, text, count=1, flags=re.MULTILINE)
    assert count == 1
    assert text_check(file, text, target, witness).valid
    assert not text_check(file, changed, target, witness).valid
