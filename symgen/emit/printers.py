"""Graph to lines of Python: which nodes get a line of their own, what they are called, and how an expression is written.

A node has a line if it has a name, or if it is used more than once; then it takes its hint, or a name made of its factors
(C4DV23 = C4*DV23). Everything else is written inside its only user, so each operation of the graph stands in the text exactly once.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from symgen.derive.graph import ADD, CONST, COS, INV, MUL, SIGN, SIN, SQRT, SYM, Node, Scalar, reachable

CALLS = {COS: "np.cos", SIN: "np.sin", SIGN: "np.sign", SQRT: "np.sqrt"}
MAX_NAME = 60


@dataclass(frozen=True)
class Section:
    """A heading and the lines under it."""

    title: str
    lines: tuple[str, ...]


class Text:
    """The lines of one function: `sections`, then an expression for each output by `expression`.

    What is particular to Python and NumPy stands in the attributes and short methods that a printer of another language replaces.
    """

    calls: ClassVar[dict[str, str]] = CALLS
    one: ClassVar[str] = "1"
    pi: ClassVar[str] = "np.pi"

    def __init__(self, outputs: Sequence[Scalar | int], headings: Sequence[tuple[int, str]], taken: Iterable[str]) -> None:
        self.nodes = reachable(outputs)
        self.uses: dict[int, int] = {}
        for s in [x for node in self.nodes for x in node.operands] + [o for o in outputs if isinstance(o, Scalar)]:
            self.uses[s.node.index] = self.uses.get(s.node.index, 0) + 1
        self.taken = set(taken)
        self.called: dict[int, str] = {}
        for node in self.nodes:
            if node.op == SYM:
                self.called[node.index] = self.pi if node.value == "pi" else self._symbol(str(node.value))
        self.named = {node.index for node in self.nodes if node.op not in (SYM, CONST) and self._has_line(node)}
        self._assign_names()
        self.sections = self._sections(headings)

    @property
    def given(self) -> set[str]:
        """Names that the recursions gave."""
        named = [n for n in self.nodes if n.index in self.named and (n.name or n.hint)]
        return {self.called[n.index] for n in named} | self.inputs

    @property
    def inputs(self) -> set[str]:
        """Names of the symbols that the outputs need."""
        return {str(node.value) for node in self.nodes if node.op == SYM}

    @property
    def operations(self) -> tuple[int, int]:
        """(multiplications, additions) in the text."""
        return sum(n.op == MUL for n in self.nodes), sum(n.op == ADD for n in self.nodes)

    @property
    def trigonometry(self) -> tuple[int, int]:
        """(sines, cosines) in the text."""
        return sum(n.op == SIN for n in self.nodes), sum(n.op == COS for n in self.nodes)

    def _symbol(self, name: str) -> str:
        return name

    def _has_line(self, node: Node) -> bool:
        return bool(node.name) or self.uses[node.index] > 1

    def _number(self, c: Fraction) -> str:
        return number(c)

    def _square(self, factor: str) -> str:
        return f"{factor}**2"

    def _clipped(self, x: str, bound: str) -> str:
        """The part of x above (`maximum`) or below (`minimum`) zero."""
        return f"np.{bound}({x}, 0.0)"

    def _assign_names(self) -> None:
        for node in self.nodes:
            if node.index in self.named and node.name:
                self._call(node, node.name)
        for node in self.nodes:
            if node.index in self.named and node.index not in self.called:
                self._call(node, node.hint or self._made_of(node))

    def _call(self, node: Node, name: str) -> None:
        while name in self.taken:  # a constant or parameter of the robot file may be called S2
            name += "b"
        self.taken.add(name)
        self.called[node.index] = name

    def _made_of(self, node: Node) -> str:
        """The value of the node in letters, of the sign in which its line starts without a minus: p is plus, m minus, products stand side by side."""
        node.name_sign, word = self._word(Scalar(None, node, 1))  # type: ignore[arg-type]
        if len(word) > MAX_NAME or not word[0].isalpha():
            word = "K" + word[: MAX_NAME - 1]
        while word in self.taken:
            word += "b"
        return word

    def _word(self, s: Scalar) -> tuple[int, str]:
        """(sign, letters) of a value."""
        node = s.node
        if node.index in self.called:
            return s.sign * self._name_sign(node), self.called[node.index].replace(".", "")
        if node.op == CONST:
            return s.sign, "x" + str(node.value).replace("/", "d")
        if node.op == ADD:
            (sign, word), *rest = sorted(map(self._word, self._addends(s)), key=lambda term: -term[0])
            return sign, word + "".join(("p" if sign * other > 0 else "m") + letters for other, letters in rest)
        words = [self._word(x) for x in node.operands]
        if node.op != MUL:
            return s.sign, node.op + "".join("m" * (sign < 0) + word for sign, word in words)
        sums = [x.node.op == ADD and x.node.index not in self.called for x in node.operands]
        letters = [f"_{word}" if total else word for (_, word), total in zip(words, sums, strict=True)]
        return s.sign * words[0][0] * words[1][0], "".join(sorted(letters, key=lambda w: (w.startswith("_"), w.startswith("x")))).lstrip(
            "_"
        )

    def _sections(self, headings: Sequence[tuple[int, str]]) -> tuple[Section, ...]:
        marks = [(0, "Inputs"), *headings]
        sections: list[Section] = []
        fixed = [n for n in self.nodes if n.index in self.named and n.fixed]
        if fixed:
            sections.append(Section("Constants", tuple(self._line(n) for n in fixed)))
        trigonometry = {n.index for n in reachable([Scalar(None, n, 1) for n in self.nodes if n.op in (COS, SIN)])}  # type: ignore[arg-type]
        angles = [n for n in self.nodes if n.index in self.named and not n.fixed and n.index in trigonometry]
        if angles:
            sections.append(Section("Trigonometry", tuple(self._line(n) for n in angles)))
        done = {n.index for n in fixed + angles}
        starts = [start for start, _ in marks]
        by_mark: dict[int, list[str]] = {}
        for node in self.nodes:
            if node.index in self.named and node.index not in done:
                by_mark.setdefault(bisect_right(starts, node.index) - 1, []).append(self._line(node))
        for k, lines in by_mark.items():
            if sections and sections[-1].title == marks[k][1]:
                sections[-1] = Section(marks[k][1], sections[-1].lines + tuple(lines))
            else:
                sections.append(Section(marks[k][1], tuple(lines)))
        return tuple(sections)

    def _line(self, node: Node) -> str:
        return f"{self.called[node.index]} = {self._body(Scalar(None, node, self._name_sign(node)))}"  # type: ignore[arg-type]

    def _name_sign(self, node: Node) -> int:
        return node.name_sign if node.index in self.named else 1

    # --- expressions ---

    def place(self, result: str, indices: Sequence[int]) -> str:
        """An entry of a result, as the target of an assignment."""
        return f"{result}[{', '.join(map(str, indices))}]"

    def expression(self, s: Scalar | int) -> str:
        """Text of an output."""
        if isinstance(s, int):
            return str(float(s))
        return self._operand(s)

    def _operand(self, s: Scalar) -> str:
        """Text of a named node by name, of another by its body."""
        if s.node.index in self.called:
            return ("-" if s.sign * self._name_sign(s.node) < 0 else "") + self.called[s.node.index]
        return self._body(s)

    def _body(self, s: Scalar) -> str:
        node = s.node
        match node.op:
            case "const":
                return ("-" if s.sign < 0 else "") + self._number(node.value)
            case "add":
                return self._sum(s)
            case "mul":
                return self._product(s)
            case "pos":
                (x,) = node.operands
                inner = self._operand(x if x.sign > 0 else -x)
                text = self._clipped(inner, "maximum" if x.sign > 0 else "minimum")
                return text if (s.sign > 0) == (x.sign > 0) else "-" + text
            case "inv":
                return ("-" if s.sign < 0 else "") + f"{self.one}/{self._divisor(node.operands[0])}"
        return ("-" if s.sign < 0 else "") + f"{self.calls[node.op]}({self._operand(node.operands[0])})"

    def _sum(self, s: Scalar) -> str:
        first, *rest = sorted(
            map(self._operand, self._addends(s)), key=lambda t: t.startswith("-")
        )  # a positive term first saves a negation
        return first + "".join(f" - {term[1:]}" if term.startswith("-") else f" + {term}" for term in rest)

    def _addends(self, s: Scalar) -> list[Scalar]:
        """The terms of a sum, those of sums without a line of their own included."""
        terms: list[Scalar] = []
        for x in s.node.operands:
            x = x if s.sign > 0 else -x
            terms += self._addends(x) if x.node.op == ADD and x.node.index not in self.called else [x]
        return terms

    def _product(self, s: Scalar) -> str:
        sign, factors = s.sign, []
        a, b = s.node.operands
        if a.node is b.node:
            square = self._square(self._factor(Scalar(None, a.node, self._name_sign(a.node))))  # type: ignore[arg-type]
            return ("-" if sign < 0 else "") + square
        for x in sorted((a, b), key=lambda x: not x.node.fixed):
            name_sign = self._name_sign(x.node) if x.node.index in self.called else 1
            sign *= x.sign * name_sign
            factors.append(self._factor(Scalar(None, x.node, name_sign)))  # type: ignore[arg-type]
        return ("-" if sign < 0 else "") + "*".join(factors)

    def _factor(self, s: Scalar) -> str:
        text = self._operand(s)
        return f"({text})" if (s.node.index not in self.called and s.node.op in (ADD, INV)) or text.startswith("-") else text

    def _divisor(self, s: Scalar) -> str:
        text = self._factor(s)
        return f"({text})" if "*" in text and not text.startswith("(") else text


def number(c: Fraction) -> str:
    """A constant as Python reads it back."""
    return str(c.numerator) if c.denominator == 1 and abs(c) < 2**53 else repr(float(c))
