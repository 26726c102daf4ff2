"""Printers of SymPy expressions as text, and as LaTeX and MathML with subscripts and dots.

Terms and factors are printed in the order in which they were made. A minus sign or a fraction is
printed before its product, and decimals are printed as decimals. The name of a symbol is printed
as a letter with a subscript: ZZ1R is ZZ with 1R, Ia1 is I with a1, FV2 is F with v2, QP1 is q with
a dot and 1, C23 is C with 23.
"""

from __future__ import annotations

import re
from fractions import Fraction
from html import escape, unescape
from typing import Any

import sympy
from sympy.printing.latex import LatexPrinter
from sympy.printing.mathml import MathMLPresentationPrinter
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.str import StrPrinter

from symgen.description.expression import decimal
from symgen.symbols.expressions import Tree, is_negative, negative

GREEK = {
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "delta": "δ",
    "theta": "θ",
    "vartheta": "ϑ",
    "phi": "φ",
    "psi": "ψ",
    "pi": "π",
    "Gamma": "Γ",
}
FAMILIES = {
    "Ia": ("I", "a"),
    "FV": ("F", "v"),
    "FS": ("F", "s"),
    "FVM": ("F", "vm"),
    "FSM": ("F", "sm"),
    "GAM": ("Gamma", ""),
    "th": ("vartheta", ""),
}
DOTS = {"QP": "dot", "QDP": "ddot"}
ANGLE = re.compile(r"(C|S|th)(\d[\d_mox]*)(b*)")
"""C23 of q2 + q3, C5m2 of q5 - q2, C2x3 of 2 q3, C2o5x3 of 2/5 q3; b with another constant."""
ENTRY = re.compile(r"(\w+)\((.*)\)")  # A(1,2)
INDEXED = re.compile(r"(.*?[^\d_])_?(\d*(?:_\d+)*)(R?)")


def letter(name: str) -> tuple[str, str]:
    """Split the name of a symbol into letter and subscript, for instance ZZ1R into ZZ and 1R.

    Both are printed unchanged, except that Greek letters are printed as such.
    """
    if not name[0].isidentifier():  # a number
        return name, ""
    if match := ENTRY.fullmatch(name):
        return FAMILIES.get(match[1], (match[1], ""))[0], match[2]
    if match := ANGLE.fullmatch(name):
        index = match[2].translate(str.maketrans("m_ox", "-,/·"))
        return FAMILIES.get(match[1], (match[1], ""))[0] + "'" * len(match[3]), index
    match = INDEXED.fullmatch(name)
    if match is None:
        return name, ""
    stem, index, regrouped = match.groups()
    stem, prefix = FAMILIES.get(stem, (stem, "")) if index else (stem, "")
    return stem, prefix + index.replace("_", ",") + regrouped


def split_sign(x: Tree) -> tuple[Any, Tree]:
    """Split a product into the number printed in front, -1 or a fraction, and the other factors.

    Returns (number, rest), or (1, x) if no such number leads the product.
    """
    number, rest = x.as_coeff_Mul()
    before = number == -1 or (not number.is_Integer and rest.free_symbols)
    return (number, rest) if before else (sympy.S.One, x)


class Ordered:
    """Base class of printers that print a minus sign or fraction first, and decimals like 0.4318.

    A subclass sets the text between two factors (`times`), and the text between a number and a
    factor that starts with a digit (`visible`).
    """

    times = visible = "*"

    def _print_Mul(self, x: Tree) -> str:
        number, rest = split_sign(x)
        if number == 1:
            return str(super()._print_Mul(x))  # type: ignore[misc]
        inside = self.parenthesize(rest, PRECEDENCE["Mul"], strict=True)  # type: ignore[attr-defined]
        if number == -1:
            return f"-{inside}"
        times = self.visible if inside[0].isdigit() else self.times
        return f"{self._print_Rational(number)}{times}{inside}"

    def _print_Rational(self, x: Tree) -> str:
        text = decimal(Fraction(x.p, x.q))
        return str(super()._print_Rational(x)) if "/" in text else text  # type: ignore[misc]


class Grammar(Ordered, StrPrinter):  # type: ignore[misc]
    """Printer that writes an expression in the grammar of robot files."""

    def _print_Function(self, x: Tree) -> str:
        return f"{x.func.__name__.lower()}({self.stringify(x.args, ', ')})"

    _print_Abs = _print_Max = _print_Function


def text(x: Tree) -> str:
    """Write an expression in the grammar of robot files."""
    return str(GRAMMAR.doprint(x))


# --- LaTeX ---


class Latex(Ordered, LatexPrinter):  # type: ignore[misc]
    """Printer that writes an expression in LaTeX, with subscripts: ZZ1R is ZZ with subscript 1R."""

    times, visible = r"\,", r" \cdot "

    def _print_Symbol(self, x: Tree) -> str:
        return latex_symbol(x.name)

    def _print_ExpBase(self, x: Tree, exp: str | None = None) -> str:
        """A constant of a robot may be called e."""
        power = f"^{{{exp}}}" if exp else ""
        return rf"\exp{power}{{\left({self._print(x.args[0])} \right)}}"


def latex(x: Tree) -> str:
    """Write an expression in LaTeX."""
    return str(LATEX.doprint(x))


def latex_symbol(name: str) -> str:
    """Write the name of a symbol in LaTeX, with its subscript."""
    stem, subscript = letter(name)
    if stem in DOTS:
        symbol = rf"\{DOTS[stem]}{{q}}"
    else:
        base, primes = stem.rstrip("'"), "'" * stem.count("'")
        word = base.replace("_", r"\_")
        is_word = len(base) > 2 and base[0].isidentifier()
        plain = rf"\mathit{{{word}}}" if is_word else word
        symbol = (rf"\{base}" if base in GREEK else plain) + primes
    subscript = subscript.replace("·", r" \cdot ")
    return f"{symbol}_{{{subscript}}}" if subscript else symbol


# --- MathML ---

MINUS_SIGN = "−"
DOT = {"dot": "˙", "ddot": "¨"}
ENTITY = re.compile(r"&(?!amp;|lt;|gt;|quot;|apos;)\w+;")  # which XML does not know


class MathML(str):
    """Complete, escaped MathML markup, which HTML templates insert without escaping it again."""

    __slots__ = ()

    def __html__(self) -> str:
        return self


class Presentation(MathMLPresentationPrinter):  # type: ignore[misc]
    """Printer that writes an expression in MathML, with subscripts: ZZ1R is ZZ with subscript 1R.

    Every name is escaped, so no name can insert markup into a page.
    """

    def element(self, tag: str, *children: Any, **attributes: str) -> Any:
        """Make an XML element. Texts among its children and values of attributes are escaped."""
        made = self.dom.createElement(tag)
        for name, value in attributes.items():
            made.setAttribute(name, value)
        for x in children:
            made.appendChild(self.dom.createTextNode(escape(x)) if isinstance(x, str) else x)
        return made

    def _l_paren(self) -> Any:
        return self.element("mo", "(", stretchy="false")

    def _r_paren(self) -> Any:
        return self.element("mo", ")", stretchy="false")

    def row(self, *parts: Any) -> Any:
        """Put MathML elements side by side in a row; a single element is returned unchanged."""
        return parts[0] if len(parts) == 1 else self.element("mrow", *parts)

    def term(self, x: Tree, *, first: bool = True) -> Any:
        """Print a term of a sum with its sign; the first term has no plus sign."""
        minus = is_negative(x)
        rest = negative(x) if minus else x
        inside = self._print(rest)
        if minus and (rest.is_Add or is_negative(rest)):
            inside = self.row(self._l_paren(), inside, self._r_paren())
        if first and not minus:
            return inside
        form = "prefix" if first else "infix"
        return self.row(self.element("mo", MINUS_SIGN if minus else "+", form=form), inside)

    def _print_Add(self, x: Tree, order: str | None = None) -> Any:
        return self.row(*(self.term(y, first=not k) for k, y in enumerate(x.args)))

    def _print_Mul(self, x: Tree) -> Any:
        if is_negative(x):
            return self.term(x)
        number, rest = x.as_coeff_Mul()
        if rest is sympy.pi and number.q != 1:  # 2*pi/3
            above = rest if number.p == 1 else sympy.Mul(number.p, rest, evaluate=False)
            return self.element("mfrac", self._print(above), self._print(sympy.Integer(number.q)))
        parts: list[Any] = []
        for y in x.args:
            times = [self.element("mo", "\u2062"), self.element("mspace", width="0.14em")]
            if text(y)[0].isdigit():
                times = [self.element("mo", "·")]
            parts += [
                *(times if parts else ()),
                self.parenthesize(y, PRECEDENCE["Mul"], strict=True),
            ]
        return self.row(*parts)

    def _print_Pow(self, x: Tree) -> Any:
        made = super()._print_Pow(x)
        if [y.nodeName for y in made.childNodes[:1]] == ["msub"] and made.nodeName == "msup":
            base, power = made.childNodes
            return self.element("msubsup", *list(base.childNodes), power)
        return made

    def _print_Symbol(self, x: Tree, **attributes: str) -> Any:
        stem, subscript = letter(x.name)
        if stem in DOTS:
            dots = self.element("mo", DOT[DOTS[stem]])
            base = self.element("mover", self.element("mi", "q"), dots, accent="true")
        else:
            shown = GREEK.get(stem, stem.replace("'", "\u2032"))
            base = self.element("mn" if stem[0].isdigit() else "mi", shown)
            if ENTRY.fullmatch(x.name):  # C(1,2) beside C1_2, the cosine of q1 + q2
                base.setAttribute("class", "matrix")
        if subscript:
            pieces = re.findall(rf"\d[\d,{MINUS_SIGN}]*|[^\d]+", subscript.replace("-", MINUS_SIGN))
            below = [self.element("mn" if p[0].isdigit() else "mi", p) for p in pieces]
            base = self.element("msub", base, self.row(*below))
        for name, value in attributes.items():
            base.setAttribute(name, value)
        return base

    def _print_Parameter(self, x: Tree) -> Any:
        return self._print_Symbol(x, **{"data-p": x.name})

    def _print_Rational(self, x: Tree) -> Any:
        digits = text(x)
        return super()._print_Rational(x) if "/" in digits else self.element("mn", digits)


def math(x: Tree) -> MathML:
    """Write an expression as one <math> element."""
    return _markup(MATHML._print(x))


def math_terms(x: Tree) -> list[MathML]:
    """Write each term of a sum as a <math> element of its own, with its sign.

    A browser can then break the line between two terms.
    """
    return [_markup(MATHML.term(y, first=not k)) for k, y in enumerate(sympy.Add.make_args(x))]


def _markup(node: Any) -> MathML:
    inside = ENTITY.sub(lambda match: unescape(match[0]), node.toxml())
    return MathML(f"<math>{inside}</math>")


GRAMMAR = Grammar({"order": "none"})
LATEX = Latex({"order": "none", "mul_symbol": Latex.times})
MATHML = Presentation({"order": "none"})
