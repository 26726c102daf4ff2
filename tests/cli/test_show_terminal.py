"""`symgen show` at a terminal: colour, subscripts, lines that fit; plain where it is not one."""

import io
import os
import re
import subprocess
import sys

import pytest
from rich.console import Console
from typer.testing import CliRunner

from symgen.cli.formula_text import STYLES, FormulaText
from symgen.cli.main import app
from symgen.description import load_robot
from symgen.regroup.regrouping import regroup
from symgen.regroup.symbols import SUBSCRIPTS, SUPERSCRIPTS, subscripted
from symgen.report.formulas import recursive_formulas

pty = pytest.importorskip("pty")
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
BACK = {v: chr(k) for k, v in SUBSCRIPTS.items()} | {"−": "-", "·": "*"}
POWERS = {v: chr(k) for k, v in SUPERSCRIPTS.items()}


def at_terminal(columns, *arguments, **environment):
    """Output of `symgen show` on a pseudo-terminal of so many columns."""
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": str(columns), "PYTHONUTF8": "1"} | environment
    environment = {k: v for k, v in environment.items() if v is not None}
    command = [sys.executable, "-c", "from symgen.cli.main import main; main()", "show", *arguments]
    process = subprocess.Popen(command, stdout=theirs, stderr=theirs, env=environment)
    os.close(theirs)
    said = b""
    while True:
        try:
            part = os.read(ours, 65536)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        said += part
    os.close(ours)
    assert process.wait(60) == 0, said
    return said.decode().replace("\r\n", "\n")


def back(text):
    """Text of the terminal as robot files write it."""
    text = re.sub("[" + "".join(map(chr, SUPERSCRIPTS.values())) + "]+", lambda m: "**" + "".join(POWERS[ord(c)] for c in m[0]), text)
    return "".join(BACK.get(ord(c), BACK.get(c, c)) for c in text)


@pytest.fixture(scope="module")
def shown():
    return at_terminal(80, "tx40", NO_COLOR=None)


def test_terminal_has_colour_and_subscripts(shown):
    plain = COLOUR.sub("", shown)
    assert shown != plain and max(map(len, plain.splitlines())) <= 80
    assert "XX₃R = XX₃ − YY₃ + YY₄ + 2·RL₄·MZ₄ + RL₄²·(M₄ + M₅ + M₆)" in plain
    assert "\x1b[36mZZ₁R\x1b[0m = \x1b[36mZZ₁\x1b[0m + \x1b[35mIa₁\x1b[0m" in shown  # the sign between has no colour
    assert "operations per sample" in plain and "no effect: XX₁ XY₁" in plain and "D₃ RL₄ g constants" in plain


@pytest.mark.parametrize("environment", [{"NO_COLOR": "1"}, {"TERM": "dumb"}])
def test_no_colour_is_the_plain_text(environment):
    piped = CliRunner().invoke(app, ["show", "tx40"]).stdout
    assert at_terminal(80, "tx40", **{"NO_COLOR": None} | environment) == piped and "XX3R" in piped


def test_names_of_files_on_request():
    said = at_terminal(200, "tx40", "--only", "XX3R", "--ascii", NO_COLOR=None)
    assert "\x1b[" in said and COLOUR.sub("", said) == "XX3R = XX3 - YY3 + YY4 + 2*RL4*MZ4 + RL4**2*(M4 + M5 + M6)\n"


@pytest.fixture(scope="module", params=["tx40", "sr400", "two_branch"])
def regrouping(request):
    return regroup(load_robot(request.param))


@pytest.mark.parametrize("width", [50, 80, 200])
@pytest.mark.parametrize("ascii", [True, False])
def test_lines_fit_and_say_the_formula(regrouping, width, ascii):
    text = FormulaText(regrouping.robot, width, ascii=ascii)
    formulas = [(b.name, b.formula) for b in regrouping.base] + recursive_formulas(regrouping)
    column = max(len(name) for name, _ in formulas)
    for name, formula in formulas:
        lines = text.definition(name, formula, column).plain.split("\n")
        assert all(len(line) <= width for line in lines), lines
        assert all(line[: column + 3].isspace() and line[column + 3] in "+-−" for line in lines[1:]), lines
        joined = " ".join([lines[0], *(line.strip() for line in lines[1:])])
        assert (joined if ascii else back(joined)) == f"{name:<{column}} = {formula}"
        assert len(lines) == 1 or width < 200
    assert all(len(line) <= width for line in text.legend().plain.split("\n"))


def test_every_symbol_has_a_style(regrouping):
    kinds = FormulaText(regrouping.robot, 80).kinds
    assert set(kinds) == {*regrouping.robot.parameters, *regrouping.robot.constants} and set(kinds.values()) <= set(STYLES)
    console = Console(force_terminal=True, color_system="truecolor", width=80, file=io.StringIO())
    with console.capture() as capture:
        console.print(FormulaText(regrouping.robot, 80).symbol(regrouping.names[0]))
    assert "\x1b[" in capture.get()


def test_names():
    assert [subscripted(n) for n in ("ZZ1R", "OFFSET12", "pi", "g", "C2_3", "alpha3")] == ["ZZ₁R", "OFFSET₁₂", "π", "g", "C2_₃", "α₃"]
