"""Printer: turns the nodes of an expression graph into lines of source text.

A node gets a line of its own if it has a name or is used more than once. A node without a name gets
one from its hint, from its factors (C4DV23 = C4*DV23), from its function and the argument (signQP1 =
sign(QP1)), or from the quantity that it is a part of (N16a, a part of N16).

Every other node is written inside the only expression that uses it, so that each operation of the
graph occurs in the text exactly once.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import partial
from itertools import count, groupby
from operator import itemgetter
from string import ascii_lowercase
from typing import NamedTuple

from symgen.derive.graph import ADD, CONST, COS, INV, MUL, POS, SIN, SYM, Node, Scalar, reachable
from symgen.description.expression import FUNCTIONS, decimal
from symgen.description.naming import Namespace

SAYABLE = 3  # factors of a name that is made of them


def number(c: Fraction) -> str:
    """Write a rational number in Python: an integer as digits, another number as a float."""
    return str(c.numerator) if c.denominator == 1 and abs(c) < 2**53 else repr(float(c))


class Language(NamedTuple):
    """Rules by which a programming language writes operations, assignments and comments.

    Attributes
    ----------
    calls : mapping
        Name in the language of each function of `description.expression.FUNCTIONS`.
    above, below : str
        Text of max(x, 0) and of min(x, 0), with {} for x.
    pi, one, square : str
        Text of pi, of the 1 in 1/x, and of the square of {0}.
    times, over, power : str
        Operators of a product, a quotient and a power.
    number : callable
        Writes a rational number.
    comment : str
        Mark that starts a comment up to the end of the line.
    prose : tuple of str
        Marks at the start and at the end of a text of several lines.
    breaks : bool
        Whether a line may be broken at every space, or only within brackets.
    continues : str
        Text at the end of a line of code that continues in the next line.
    step, entry : str
        Line that gives a name to a value, and line that assigns a value to an entry of a result; {}
        stands for the name, then for the value.
    chained : bool
        Whether one line may assign several entries, `A[0, 1] = A[1, 0] = x`.
    is_word : callable
        Tests whether the language, or the code around the functions, reserves a name.
    """

    calls: Mapping[str, str]
    above: str
    below: str
    pi: str
    one: str = "1"
    square: str = "{0}**2"
    times: str = "*"
    over: str = "/"
    power: str = "**"
    number: Callable[[Fraction], str] = number
    comment: str = "#"
    prose: tuple[str, str] = ('"""', '"""')
    breaks: bool = False
    continues: str = ""
    step: str = "{} = {}"
    entry: str = "{} = {}"
    chained: bool = True
    is_word: Callable[[str], bool] = lambda name: False

    def expression(self, e: object) -> str:
        """Write an expression of constants, a linear expression of joint positions, or a formula of
        parameters as code. The text of the expression follows the grammar of robot files.
        """
        text = re.sub(r"\b(cos|sin|sqrt)\(", lambda name: f"{self.calls[name[1]]}(", str(e))
        text = re.sub(r"\bpi\b", self.pi, text)
        if self.times == "*":
            return text
        operators = {"**": self.power, "*": self.times, "/": self.over}
        return re.sub(r"\*\*|[*/]", lambda operator: operators[operator[0]], text)

    def entries(self, targets: Sequence[str], value: str, remark: str) -> list[str]:
        """Write the lines that assign a value to array entries, each line with a comment after a
        tab.
        """
        targets = [" = ".join(targets)] if self.chained else targets
        return [f"{self.entry.format(target, value)}\t{remark}" for target in targets]


def _calls(package: str) -> dict[str, str]:
    return {op: f"{package}{f.numpy}" for op, f in FUNCTIONS.items() if f.numpy}


PYTHON = Language(_calls("xp."), "xp.maximum({}, 0.0)", "xp.minimum({}, 0.0)", "xp.pi")
"""Over a namespace `xp`: NumPy, or the functions of another package under the same names."""
PLAIN = Language(
    {op: op for op in FUNCTIONS},
    "max({}, 0)",
    "min({}, 0)",
    "pi",
    number=partial(decimal, fractions=False),
)
"""The grammar of robot files, numbers exact."""


class Section(NamedTuple):
    """A heading in source text, and the lines under it."""

    title: str
    lines: tuple[str, ...]


def under_titles(lines: Iterable[tuple[str, str]]) -> tuple[Section, ...]:
    """Group pairs of title and line: consecutive lines with the same title form one section."""
    return tuple(
        Section(title, tuple(line for _, line in group))
        for title, group in groupby(lines, key=itemgetter(0))
    )


class Text:
    """The lines of source text that compute one function.

    `sections` holds the steps; then `expression` writes each output.

    Parameters
    ----------
    outputs : sequence
        Values to compute, all of one graph.
    headings : sequence of (index of the first node, title)
        Headings of the steps.
    names : Namespace
        Names in use in the function.
    labels : sequence of str
        Name of each output; its shared parts are named after the output.
    """

    language: Language = PYTHON

    def __init__(
        self,
        outputs: Sequence[Scalar | int],
        headings: Sequence[tuple[int, str]],
        names: Namespace,
        labels: Sequence[str] = (),
        language: Language | None = None,
    ) -> None:
        self.language = language or self.language
        self.nodes, self.names = reachable(outputs), names
        self.uses: dict[int, int] = {}
        for s in self._uses(outputs):
            self.uses[s.node.index] = self.uses.get(s.node.index, 0) + 1
        self.called: dict[int, str] = {}
        self.sign: dict[int, int] = {}  # of the value that is called so
        for node in self.nodes:
            if node.op == SYM:
                self.called[node.index] = self._symbol(node)
        self.named = {n.index for n in self.nodes if n.op not in (SYM, CONST) and self._has_line(n)}
        self._assign_names(outputs, labels)
        self._marks = [(0, "Inputs"), *headings]
        self.sections = self.sections_of({n.index for n in self.nodes})

    def _uses(self, outputs: Sequence[Scalar | int]) -> Iterator[Scalar]:
        for node in self.nodes:
            yield from node.operands
        yield from (o for o in outputs if isinstance(o, Scalar))

    @property
    def given(self) -> set[str]:
        """Names of the inputs, and of intermediate variables named by the symbolic derivation."""
        named = [n for n in self.nodes if n.index in self.named and (n.name or n.hint)]
        return {self.called[n.index] for n in named} | self.inputs

    @property
    def inputs(self) -> set[str]:
        """Names of the inputs on which the outputs depend, before any renaming for the language."""
        return {str(node.value) for node in self.nodes if node.op == SYM}

    def _symbol(self, node: Node) -> str:
        kind, name = node.value
        if kind == "pi":
            return self.language.pi
        return self.names.own(name) if kind == "rate" else self.names.of_file(name)

    def _has_line(self, node: Node) -> bool:
        return bool(node.name) or self.uses[node.index] > 1

    # --- names ---

    def _assign_names(self, outputs: Sequence[Scalar | int], labels: Sequence[str]) -> None:
        waiting = [n for n in self.nodes if n.index in self.named]
        for node in waiting:
            self.sign[node.index] = node.name_sign if node.name or node.hint else 1
            if node.name:
                self.called[node.index] = self.names.own(node.name)
        waiting = [n for n in waiting if not n.name]
        for node in waiting:
            if node.hint:
                self.called[node.index] = self.names.own(node.hint)
        whole = self._wholes(outputs, labels)
        for node in waiting:
            if not node.hint:
                name = self._made_of(node) or self._value_of(node)
                self.called[node.index] = name or self._part_of(node, whole)

    def _wholes(self, outputs: Sequence[Scalar | int], labels: Sequence[str]) -> dict[int, str]:
        """Find, for each graph node, the named quantity that is computed from it, such as N16 for
        node N16a.

        The quantity is the first named one that uses the node, or else the first output. An unnamed
        node gets a name from it.
        """
        whole: dict[int, str] = {}
        for o, label in zip(outputs, labels, strict=bool(labels)):
            if isinstance(o, Scalar) and label:
                whole.setdefault(o.node.index, label)
        for node in reversed(self.nodes):
            name = self.called.get(node.index) or whole.get(node.index)
            for x in node.operands if name else ():
                whole[x.node.index] = str(name)
        return whole

    def _made_of(self, node: Node) -> str:
        """Name an intermediate variable after its factors, such as C4DV23 = C4*DV23.

        The name is empty if the node is not a product of at most three named factors. The sign of
        the node is chosen such that its line starts without a minus.
        """
        words = self._factors(node)
        if words is None or len(words) > SAYABLE:
            return ""
        self.sign[node.index] = self._sign_of(node)
        return self.names.own("".join(sorted(words, key=lambda w: w.startswith("x"))))

    def _value_of(self, node: Node) -> str:
        """Name an intermediate variable after its function and argument: signQP1 = sign(QP1).

        posQP1 is max(QP1, 0), negQP1 is min(QP1, 0). The name is empty for an operation that is no
        function of one named variable.
        """
        x, *more = node.operands
        if more or node.op == INV or x.node.index not in self.called:
            return ""
        positive = x.sign * self._name_sign(x.node) > 0
        if not positive and node.op != POS:
            return ""
        self.sign[node.index] = 1 if positive else -1
        function = node.op if positive else "neg"
        return self.names.own(function + self.called[x.node.index])

    def _factors(self, node: Node) -> list[str] | None:
        if node.op != MUL:
            return None
        words: list[str] = []
        for x in node.operands:
            if x.node.index in self.called:
                words.append(self.called[x.node.index].replace(".", ""))
            elif x.node.op == CONST:
                words.append("x" + str(x.node.value).replace("/", "d"))
            elif (inner := self._factors(x.node)) is not None:
                words += inner
            else:
                return None
        return words if words[0][0].isalpha() and not words[0].startswith("x") else None

    def _sign_of(self, node: Node) -> int:
        sign = 1
        for x in node.operands:
            sign *= x.sign * (
                self._name_sign(x.node) if x.node.index in self.called else self._sign_of(x.node)
            )
        return sign

    def _part_of(self, node: Node, whole: Mapping[int, str]) -> str:
        """Name an intermediate variable after the quantity that contains it: N16a after N16."""
        of = whole.get(node.index, "K").rstrip(ascii_lowercase + "_") or "K"
        names = (f"{of}{ascii_lowercase[k % 26] * (k // 26 + 1)}" for k in count())
        return self.names.own(next(name for name in names if not self.names.has(name)))

    # --- lines ---

    def sections_of(self, nodes: Collection[int]) -> tuple[Section, ...]:
        """Write the lines that compute the given graph nodes, grouped under headings."""
        circular = [self._positive(n) for n in self.nodes if n.op in (COS, SIN)]
        trigonometry = {n.index for n in reachable(circular)}

        def place(node: Node) -> int:
            return 0 if node.fixed else 1 if node.index in trigonometry else 2

        def title(node: Node) -> str:
            return ("Constants", "Trigonometry", self._title(node))[place(node)]

        lines = (n for n in self.nodes if n.index in self.named and n.index in nodes)
        named = sorted(lines, key=place)
        return under_titles((title(n), self._line(n)) for n in named)

    def _title(self, node: Node) -> str:
        """Return the heading, such as a step of the recursion, to which a graph node belongs."""
        return self._marks[bisect_right(self._marks, node.index, key=itemgetter(0)) - 1][1]

    def _line(self, node: Node) -> str:
        return self.language.step.format(self.called[node.index], self._body(self._as_named(node)))

    def _name_sign(self, node: Node) -> int:
        return self.sign.get(node.index, 1)

    @staticmethod
    def _positive(node: Node, sign: int = 1) -> Scalar:
        return Scalar(None, node, sign)  # type: ignore[arg-type]

    def _as_named(self, node: Node) -> Scalar:
        return self._positive(node, self._name_sign(node))

    # --- expressions ---

    def expression(self, s: Scalar | int) -> str:
        """Write the value of an output as a variable name, an expression, or a number."""
        return self._operand(s) if isinstance(s, Scalar) else f"{float(s)}"

    def _operand(self, s: Scalar) -> str:
        if s.node.index in self.called:
            return ("-" if s.sign * self._name_sign(s.node) < 0 else "") + self.called[s.node.index]
        return self._body(s)

    def _body(self, s: Scalar) -> str:
        node, language = s.node, self.language
        minus = "-" if s.sign < 0 else ""
        match node.op:
            case "const":
                return minus + language.number(node.value)
            case "add":
                return self._sum(s)
            case "mul":
                return self._product(s)
            case "pos":
                (x,) = node.operands
                form = language.above if x.sign > 0 else language.below
                text = form.format(self._operand(x if x.sign > 0 else -x))
                return text if (s.sign > 0) == (x.sign > 0) else "-" + text
            case "inv":
                return f"{minus}{language.one}{language.over}{self._divisor(node.operands[0])}"
        operands = ", ".join(map(self._operand, node.operands))
        return f"{minus}{language.calls[node.op]}({operands})"

    def _sum(self, s: Scalar) -> str:
        """Write a sum, positive terms first, so that it seldom starts with a minus sign."""
        terms = map(self._operand, self._addends(s))
        first, *rest = sorted(terms, key=lambda t: t.startswith("-"))
        return first + "".join(
            f" - {term[1:]}" if term.startswith("-") else f" + {term}" for term in rest
        )

    def _addends(self, s: Scalar) -> list[Scalar]:
        """List the terms of a sum; an inner sum that has no name is replaced by its terms."""
        terms: list[Scalar] = []
        for x in s.node.operands:
            x = x if s.sign > 0 else -x
            inside = x.node.op == ADD and x.node.index not in self.called
            terms += self._addends(x) if inside else [x]
        return terms

    def _product(self, s: Scalar) -> str:
        sign, factors = s.sign, []
        a, b = s.node.operands
        if a.node is b.node:
            square = self.language.square.format(self._factor(self._as_named(a.node)))
            return ("-" if sign < 0 else "") + square
        for x in sorted((a, b), key=lambda x: not x.node.fixed):
            own = self._own_sign(x.node)
            sign *= x.sign * own
            factors.append(self._factor(self._positive(x.node, own)))
        return ("-" if sign < 0 else "") + self.language.times.join(factors)

    def _own_sign(self, node: Node) -> int:
        """Return the sign with which a node is written without a minus, as min(x, 0) is."""
        if node.index in self.called:
            return self._name_sign(node)
        return -1 if node.op == POS and node.operands[0].sign < 0 else 1

    def _factor(self, s: Scalar) -> str:
        text = self._operand(s)
        whole = s.node.index in self.called or s.node.op not in (ADD, INV)
        return text if whole and not text.startswith("-") else f"({text})"

    def _divisor(self, s: Scalar) -> str:
        text = self._factor(s)
        return f"({text})" if "*" in text and not text.startswith("(") else text
