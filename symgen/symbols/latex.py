r"""LaTeX of models: closed forms and recursions in `align*` with lines broken before + and -, and a
document with frame table and conventions.

Uses amsmath alone; velocities are \dot{q}, accelerations \ddot{q}, torques \Gamma; intermediates of
a recursion keep the names of SYMORO.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from sympy.printing.latex import LatexPrinter

from symgen.description.expression import Expression
from symgen.description.robot import Robot
from symgen.emit.header import informative_columns
from symgen.regroup.formula import Formula
from symgen.symbols import trees
from symgen.symbols.breaking import lines
from symgen.symbols.letters import DOTS, GREEK, letter
from symgen.symbols.text import Ordered
from symgen.symbols.trees import Tree

WIDTH = 76  # characters of a line as they are printed
HEADINGS = {
    "ant": "a(j)",
    "mu": r"\mu",
    "sigma": r"\sigma",
    "gamma": r"\gamma",
    "alpha": r"\alpha",
    "theta": r"\theta",
}
# Engines and scripts: letters beyond Latin and Greek by a font that has them
PREAMBLE = (
    r"\usepackage{iftex}",
    r"\ifPDFTeX",
    r"\usepackage[utf8]{inputenc}\usepackage[T1]{fontenc}",
    r"\newcommand{\other}[2]{{\footnotesize U+#1}} % XeLaTeX and LuaLaTeX print the letter",
    r"\else",
    r"\usepackage{fontspec}",
    r"""\newcommand{\other}[2]{{\otherfont\iffontchar\font"#1 #2\else U+#1\fi}}""",
    *(
        rf"\ifdefined\otherfont\else\IfFontExistsTF{{{font}}}"
        rf"{{\newfontfamily{{\otherfont}}{{{font}}}}}{{}}\fi"
        for font in ("Noto Serif CJK SC", "Noto Sans CJK SC", "SimSun", "DejaVu Serif")
    ),
    r"\providecommand{\otherfont}{}",
    r"\fi",
)
_GREEK = """
    alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho varsigma sigma
    tau upsilon phi chi psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega
"""
_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{c: "\\" + c for c in "&%$#_{}"},
    **{
        c: rf"\ensuremath{{\{name}}}"
        for c, name in zip(
            "αβγδεζηθικλμνξπρςστυφχψωΓΔΘΛΞΠΣΦΨΩ",
            _GREEK.split(),
            strict=True,
        )
    },
}


class Latex(Ordered, LatexPrinter):  # type: ignore[misc]
    """SymPy's LaTeX with the subscripts of the literature."""

    times, visible = r"\,", r" \cdot "

    def _print_Symbol(self, x: Tree) -> str:
        return symbol(x.name)


_PRINTER = Latex({"order": "none", "mul_symbol": Latex.times})


def latex(x: Tree) -> str:
    """An expression."""
    return str(_PRINTER.doprint(x))


def symbol(name: str) -> str:
    """A name with its subscript."""
    stem, subscript = letter(name)
    if stem in DOTS:
        text = rf"\{DOTS[stem]}{{q}}"
    else:
        base, primes = stem.rstrip("'"), "'" * stem.count("'")
        word = base.replace("_", r"\_")
        is_word = len(base) > 2 and base[0].isidentifier()
        plain = rf"\mathit{{{word}}}" if is_word else word
        text = (rf"\{base}" if base in GREEK else plain) + primes
    return f"{text}_{{{subscript}}}" if subscript else text


def formulas(definitions: Mapping[str, Formula]) -> str:
    r"""Regrouping formulas in an `aligned` environment: ZZ_{1R} &= ZZ_{1} + I_{a1} + ..."""
    rows = (f"{symbol(name)} &= {latex(trees.formula(f))}" for name, f in definitions.items())
    return aligned(rows, "aligned")


def aligned(equations: Iterable[str], environment: str = "align*") -> str:
    """An environment of equations `left &= right`, long ones broken."""
    rows = [" \\\\\n".join(broken(line)) for line in equations]
    return f"\\begin{{{environment}}}\n" + " \\\\\n".join(rows) + f"\n\\end{{{environment}}}"


def broken(line: str) -> list[str]:
    """`left &= right` on as many lines as it needs."""
    left, _, right = line.partition(" &= ")
    if width(line) > WIDTH:  # brackets that grow cannot be broken
        right = re.sub(r"\\(left|right)\b", "", right)
    return lines(f"{left} &= ", right, WIDTH, r"&\quad ", width)


def width(text: str) -> int:
    """Characters as they are printed, about."""
    return len(
        re.sub(r"\\(mathbf|operatorname|dot|ddot|left|right|frac|quad|,)|[{}^_&\\]", "", text)
    )


def escaped(text: str) -> str:
    """Plain text in LaTeX; what not every font of it has by \\other, which PREAMBLE defines."""
    return "".join(_SPECIAL.get(c) or _written(c) for c in text)


def _written(c: str) -> str:
    """A letter as it is, or with its number beside it."""
    common = (c < "\u0180" and c not in "ĦħĸĿŀŉŦŧſ") or c in "–—‘’“”„…•€"
    return c if common else rf"\other{{{ord(c):04X}}}{{{c}}}"


def document(title: str, summary: str, robot: Robot, notes: Sequence[str], body: str) -> str:
    """A document that compiles by itself: the frame table, the conventions, then `body`."""
    kept = informative_columns(robot)
    head = " & ".join(f"${HEADINGS.get(c, c)}$" for c in kept)
    rows = [" & ".join(f"${cell(getattr(f, c))}$" for c in kept) + r" \\" for f in robot.frames]
    gravity = ",\\ ".join(map(cell, robot.gravity))
    return "\n".join(
        [
            r"\documentclass[a4paper,10pt]{article}",
            *PREAMBLE,
            r"\usepackage{amsmath,graphicx}",
            r"\setlength{\oddsidemargin}{-10mm}\setlength{\textwidth}{180mm}\setlength{\topmargin}{-20mm}\setlength{\textheight}{250mm}",
            r"\setlength{\parindent}{0pt}\allowdisplaybreaks",
            r"\begin{document}",
            rf"\section*{{{escaped(title)}}}",
            rf"{escaped(summary)}\par\medskip",
            r"Modified Denavit-Hartenberg (Khalil and Kleinfinger 1986); SI and rad.\par\medskip",
            rf"\sbox0{{\begin{{tabular}}{{{'r' * len(kept)}}}",
            head + r" \\ \hline",
            *rows,
            r"\end{tabular}}",
            r"\ifdim\wd0>\textwidth\resizebox{\textwidth}{!}{\usebox0}\else\usebox0\fi\par\medskip",
            (
                rf"Acceleration of gravity in frame 0: $({gravity})$. Torques $\Gamma$ are those "
                r"of "
                r"the actuators, so friction enters with a plus.\par"
            ),
            *(rf"{escaped(note)}\par" for note in notes),
            body,
            r"\end{document}",
            "",
        ]
    )


def cell(value: object) -> str:
    """A cell of the frame table."""
    return latex(trees.expression(value)) if isinstance(value, Expression) else str(value)
