"""`.par` files of SYMORO: those of packaged robots are the same mechanisms; a foreign file; every
fault is an error with its line.
"""

import re
import time
import warnings
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgen.description import AngleWarning, load_robot, packaged_robots, read_par, write_yaml
from symgen.description.yaml import parse_robot
from symgen.errors import DescriptionError
from symgen.regroup.regrouping import regroup

# A parallelogram in a vertical plane, as older programs write it: Pi, ^, capital keys, lists over
# lines, constants without values.
FOREIGN = """\
(*****  SYMORO+ : Parameters of a robot  *****)
(* General parameters
   over two lines *)
(* Robotname = 'pantograph' *)
NF = 6
NL = 4
NJ = 5
Type = 2   (* Closed *)
Ant = {0, 1, 0,
 3, 4, 2}
Sigma = {0,0,0,0,0,2}
B = {0,0,0,0,0,0}
d = {0,L1,0,2*L2^2/(2*L2),L1,-L2}
R = {0,0,0,0,0,0}
gamma = {0,0,0,0,0,0}
Alpha = {0,0,0,0,0,0}
Mu = {1,0,1,0,0,0}
Theta = {t1,t2,t3,t4,t5,0}
XX = {XX1,XX2,XX3,0}
XY = {XY1,XY2,XY3,0}
XZ = {XZ1,XZ2,XZ3,0}
YY = {YY1,YY2,YY3,0}
YZ = {YZ1,YZ2,YZ3,0}
ZZ = {0.25,J2,ZZ3,0}
MX = {MX1,MX2,MX3,0}
MY = {0,MY2,MY3,0}
MZ = {MZ1,MZ2,MZ3,0}
M = {M1,M2,M3,0}
IA = {IA1,0,IA3,0}
FV = {FV1,FV2,0,FV4}
FS = {0,0,0,0}
FX = {0,0,0,FX4}
QP = {QP1,QP2,QP3,QP4,QP5}
G = {0,G2,0}
Z = {1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1}
(* End of definition *)
"""
VALUES = {"L1": 0.4, "L2": 0.2, "G2": -9.81}


def error_of(text, constants=VALUES):
    with pytest.raises(DescriptionError) as caught:
        read_par(text.encode(), "arm.par", constants)
    assert caught.value.file == "arm.par" and caught.value.line is not None
    return caught.value


def formulas(robot):
    return {b.name: str(b.formula) for b in regroup(robot).base}


FILES = Path(__file__).parent / "par_files"  # of packaged robots, with all that the format holds


@pytest.mark.parametrize("name", sorted(path.stem for path in FILES.iterdir()))
def test_files_of_packaged_robots_have_their_formulas(name):
    """Families beside Ia, FV and FS have no place in the format; others may carry the rest."""
    robot = load_robot(name)
    again, _ = read_par((FILES / f"{name}.par").read_bytes(), f"{name}.par")
    lost = set(robot.parameters) - set(again.parameters)
    assert {p.rstrip("0123456789") for p in lost} <= {"OFFSET", "FVM", "FSM"} | {
        e.family for e in robot.elements if e.form
    }
    assert again.parameters == tuple(p for p in robot.parameters if p not in lost)
    assert (again.constants, again.gravity, again.frames, again.massless) == (
        robot.constants,
        robot.gravity,
        robot.frames,
        robot.massless,
    )
    assert again.loops == robot.loops
    assert dict(again.values) == {p: v for p, v in robot.values.items() if p not in lost}
    kept = replace(robot, elements=again.elements, values={}, drives=None)
    assert again.elements == kept.elements  # with the above: the same mechanism
    assert formulas(again) == formulas(kept) and formulas(kept)


def test_foreign_file():
    robot, notes = read_par(FOREIGN.encode("latin-1"), "pantograph.par", VALUES)
    assert robot.name == "pantograph" and robot.joints == (1, 3) and robot.links == (1, 2, 3)
    assert [str(robot.frame(4).d), str(robot.frame(2).theta)] == ["L2", "q2"]
    assert [(loop.cut, loop.twin) for loop in robot.loops] == [(5, 6)]
    assert dict(robot.values) == {"ZZ1": 0.25, "MY1": 0.0}
    assert [name for name in robot.parameters if name[:2] in ("Ia", "FV", "FS")] == [
        "Ia1",
        "FV1",
        "FV2",
        "Ia3",
        "FV4",
    ]
    assert "ZZ2 (written J2)" in notes[0] and "MY1" in notes[1] and len(notes) == 2
    assert robot.not_read == ("forces of the environment (FX ... CZ)",)
    assert regroup(robot).base


def test_all_digits_of_a_multiple_are_that_multiple():
    content = FOREIGN.replace("gamma = {0", "gamma = {1.5707963267948966").encode()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for exact in (False, True):
            robot, _ = read_par(content, "a.par", VALUES, exact=exact)
            assert str(robot.frame(1).gamma) == "pi/2" and robot.angles == ""


def test_values_of_symbols_from_a_comment_or_an_argument():
    assert "no value of G2, L1, L2" in error_of(FOREIGN, {}).message
    text = FOREIGN + "(* constants: L1 = 0.4, L2 = 2/10,\n G2 = -9.81 *)"
    assert dict(read_par(text.encode(), "a.par")[0].constants) == VALUES
    assert read_par(text.encode(), "a.par", {"L1": 7})[0].constants["L1"] == 7


def test_decimal_quarter_turns_become_exact_and_are_told():
    content = FOREIGN.replace("gamma = {0", "gamma = {1.5708").encode()
    with pytest.warns(AngleWarning, match=r"gamma of frame 1 \(line 15\) from 1.5708 to pi/2"):
        robot, notes = read_par(content, "a.par", VALUES)
    assert str(robot.frame(1).gamma) == "pi/2"
    assert any("1.5708 to pi/2, by -3.7e-06 rad" in note for note in notes)
    robot, notes = read_par(content, "a.par", VALUES, exact=True)
    assert str(robot.frame(1).gamma) == "1.5708" and not any("1.5708" in note for note in notes)


WRONG = [  # what is replaced, by what, line of the error, words of the message
    ("NL = 4", "NL = four", 6, "whole number"),
    ("NL = 4\n", "", 1, "NL is missing"),
    ("NJ = 5", "NJ = 6", 6, "NF = 2 NJ - NL"),
    ("Type = 2", "Type = 0", 6, "closed loops"),
    ("NF = 6\n", "NF = 6\nis_mobile = 1\n", 6, "base that moves"),
    ("R = {0,0,0,0,0,0}", "R = {0,0,0}", 14, "3 entries; expected 6"),
    ("R = {0,0,0,0,0,0}", "R = {0,0,0,0,0,0", 14, "expected `name = value`"),
    ("R = {0,0,0,0,0,0}\n", "", 1, "r is missing"),
    ("3, 4, 2}", "3, 9, 2}", 10, "ant = 9"),
    ("Sigma = {0", "Sigma = {3", 11, "sigma = 3"),
    ("Mu = {1", "Mu = {2", 17, "mu = 2"),
    ("d = {0", "d = {import(os)", 13, "import"),
    ("d = {0", "d = {t2", 13, "t2 is the variable of a joint"),
    ("d = {0", "d = {1/0", 13, "division by zero"),
    ("d = {0", "d = {2^9999", 13, "exponent"),
    ("d = {0", "d = {" + "(" * 99, 13, "deep"),
    ("Theta = {t1", "Theta = {2*t1", 18, "q1 once"),
    ("Theta = {t1", "Theta = {a + b", 18, "joint variable"),
    ("ZZ = {0.25", "ZZ = {sqrt(sqrt(2)-2)", 24, "no finite real value"),
    ("(* End of definition *)", "(* End of definition", 36, "does not end"),
    ("G = {0,G2,0}", "G = {0,G2}", 34, "2 entries"),
    ("Mu = ", "Ant = {0,1,0,3,4,2}\nMu = ", 17, "given twice (first on line 9)"),
    ("(* End", "(* constants: L1 = x *)\n(* End", 36, "expected name = number"),
]


@pytest.mark.parametrize(("old", "new", "line", "words"), WRONG)
def test_faults_are_errors_with_their_line(old, new, line, words):
    assert old in FOREIGN
    error = error_of(FOREIGN.replace(old, new, 1))
    assert words in error.message and error.line == line


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_mangled_files_raise_nothing_else(data):
    text = FOREIGN
    for _ in range(data.draw(st.integers(1, 4))):
        at, length = data.draw(st.integers(0, len(text))), data.draw(st.integers(0, 12))
        text = (
            text[:at]
            + data.draw(st.text(alphabet="{}(*)=,^0123456789.eEqtXM \n\x00é", max_size=8))
            + text[at + length :]
        )
    try:
        read_par(text.encode("utf-8", "surrogatepass"), "arm.par", VALUES)
    except DescriptionError as error:
        assert re.search(r"\(arm\.par, line \d+\)$", str(error))


@pytest.mark.parametrize("name", packaged_robots())
def test_robot_files_written_and_read_are_the_same_robot(name):
    robot = load_robot(name)
    again = parse_robot(write_yaml(robot, comments=["written by a test"]).encode(), robot.file)
    for field in (
        "name",
        "title",
        "source",
        "frames",
        "gravity",
        "constants",
        "elements",
        "loops",
        "constraints",
        "massless",
        "drives",
    ):
        assert getattr(again, field) == getattr(robot, field), field
    assert dict(again.limits) == dict(robot.limits) and dict(again.values) == dict(robot.values)


@pytest.mark.parametrize(
    "text",
    [
        "(*" * 90_000,
        "(**)" * 45_000,
        "a={" * 60_000,
        "{" * 190_000,
        "x" * 300_000,
        "NL=1 " * 30_000,
        "NL=1\nd={" + "1," * 90_000,
    ],
)
def test_hostile_files_are_refused_at_once(text):
    start = time.process_time()
    error_of(text)
    assert time.process_time() - start < 5  # the contract of issue 6: no hang above 5 s
