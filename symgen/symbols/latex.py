r"""LaTeX of models: closed forms and listings in `align*` with lines broken before + and -, and a document with frame table and conventions.

Uses amsmath alone; velocities are \dot{q}, accelerations \ddot{q}, torques \Gamma; intermediates of a recursion keep the names of SYMORO.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from fractions import Fraction

from symgen.derive.graph import COS, INV, SIGN, SIN, SQRT, Scalar
from symgen.description.expression import Expression
from symgen.description.robot import Robot
from symgen.emit.header import informative_columns
from symgen.emit.printers import Text
from symgen.regroup.latex import Latex
from symgen.symbols.breaking import lines

WIDTH = 76  # characters of a line as they are printed
STATES = {"QP": r"\dot{q}", "QDP": r"\ddot{q}", "GAM": r"\Gamma", "th": r"\theta"}
_WORD = re.compile(r"^([A-Za-z]{2,})(?=_|$)")  # several letters, one name
HEADINGS = {"ant": "a(j)", "mu": r"\mu", "sigma": r"\sigma", "gamma": r"\gamma", "alpha": r"\alpha", "theta": r"\theta"}
_INDEXED = re.compile(r"([A-Za-z]+?)(\d+(?:_\d+)*)")
_ANGLE = re.compile(r"(C|S|th)(\d[\d_mx]*)(b*)")  # of a sum of angles: 23, 5m2 for q5 - q2; b with another constant
_SPECIAL = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", **{c: "\\" + c for c in "&%$#_{}"}}


class ModelLatex(Latex):
    """Symbols of models; brackets that a line may be broken in."""

    def parameter(self, name: str) -> str:
        if match := _ANGLE.fullmatch(name):
            letter = STATES.get(match[1], match[1]) + "'" * len(match[3])
            return f"{letter}_{{{match[2].replace('m', '-').replace('_', ',')}}}"
        match = _INDEXED.fullmatch(name)
        if match and (match[1] in STATES or "_" in name):
            return f"{STATES.get(match[1], match[1])}_{{{match[2].replace('_', ',')}}}"
        return _WORD.sub(r"\\mathit{\1}", super().parameter(name))

    def call(self, function: str, argument: Expression, n: int) -> str:
        if function not in ("sign", "Abs"):
            return super().call(function, argument, n)
        inside = self.expression(argument)
        text = rf"\left|{inside}\right|" if function == "Abs" else rf"\operatorname{{sign}}({inside})"
        return text if n == 1 else self.raised(text, n)

    def bracketed(self, inside: str) -> str:
        return f"({inside})"


LATEX = ModelLatex()


class LatexText(Text):
    """The lines of a listing."""

    calls = {COS: r"\cos", SIN: r"\sin", SIGN: r"\operatorname{sign}"}  # noqa: RUF012
    pi = "pi"

    def _number(self, c: Fraction) -> str:
        return str(c) if c.denominator == 1 else rf"\frac{{{c.numerator}}}{{{c.denominator}}}"

    def _square(self, factor: str) -> str:
        return f"{{{factor}}}^{{2}}"

    def _clipped(self, x: str, bound: str) -> str:
        return rf"\{bound[:3]}({x}, 0)"

    def _line(self, node: object) -> str:
        name, _, body = super()._line(node).partition(" = ")  # type: ignore[arg-type]
        return f"{LATEX.parameter(name)} &= {body}"

    def _operand(self, s: Scalar) -> str:
        if s.node.index not in self.called:
            return self._body(s)
        sign = "-" if s.sign * self._name_sign(s.node) < 0 else ""
        return sign + LATEX.symbol(self.called[s.node.index])

    def _product(self, s: Scalar) -> str:
        return super()._product(s).replace("*", r"\,")

    def _body(self, s: Scalar) -> str:
        sign = "-" if s.sign < 0 else ""
        if s.node.op == SQRT:
            return rf"{sign}\sqrt{{{self._operand(s.node.operands[0])}}}"
        if s.node.op == INV:
            return rf"{sign}\frac{{1}}{{{self._operand(s.node.operands[0])}}}"
        return super()._body(s)


def aligned(equations: Iterable[str], environment: str = "align*") -> str:
    """An environment of equations `left &= right`, long ones broken."""
    rows = [" \\\\\n".join(broken(line)) for line in equations]
    return f"\\begin{{{environment}}}\n" + " \\\\\n".join(rows) + f"\n\\end{{{environment}}}"


def broken(line: str) -> list[str]:
    """`left &= right` on as many lines as it needs."""
    left, _, right = line.partition(" &= ")
    return lines(f"{left} &= ", right, WIDTH, r"&\quad ", width)


def width(text: str) -> int:
    """Characters as they are printed, about."""
    return len(re.sub(r"\\(mathit|mathbf|operatorname|dot|ddot|left|right|frac|quad|,)|[{}^_&\\]", "", text))


def escaped(text: str) -> str:
    """Plain text in LaTeX."""
    return "".join(_SPECIAL.get(c, c) for c in text)


def document(title: str, summary: str, robot: Robot, notes: Sequence[str], body: str) -> str:
    """A document that compiles by itself: the frame table, the conventions, then `body`."""
    kept = informative_columns(robot)
    head = " & ".join(f"${HEADINGS.get(c, c)}$" for c in kept)
    rows = [" & ".join(f"${cell(getattr(f, c))}$" for c in kept) + r" \\" for f in robot.frames]
    gravity = ",\\ ".join(LATEX.expression(e) for e in robot.gravity)
    return "\n".join(
        [
            r"\documentclass[a4paper,10pt]{article}",
            r"\usepackage[utf8]{inputenc}",
            r"\usepackage[T1]{fontenc}",
            r"\usepackage{amsmath}",
            r"\setlength{\oddsidemargin}{-10mm}\setlength{\textwidth}{180mm}\setlength{\topmargin}{-20mm}\setlength{\textheight}{250mm}",
            r"\setlength{\parindent}{0pt}\allowdisplaybreaks",
            r"\begin{document}",
            rf"\section*{{{escaped(title)}}}",
            rf"{escaped(summary)}\par\medskip",
            r"Modified Denavit-Hartenberg (Khalil and Kleinfinger 1986); SI and rad.\par\medskip",
            rf"\begin{{tabular}}{{{'r' * len(kept)}}}",
            head + r" \\ \hline",
            *rows,
            r"\end{tabular}\par\medskip",
            rf"Acceleration of gravity in frame 0: $({gravity})$. Torques $\Gamma$ are those of the actuators, so friction enters with a plus.\par",
            *(rf"{escaped(note)}\par" for note in notes),
            body,
            r"\end{document}",
            "",
        ]
    )


def cell(value: object) -> str:
    """A cell of the frame table."""
    return LATEX.expression(value) if isinstance(value, Expression) else str(value)
