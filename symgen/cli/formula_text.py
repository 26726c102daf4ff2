"""Formulas on a terminal: names with subscripts, families in colour, long ones broken before + and - under their first term.

What is piped, or asked for without colour (NO_COLOR, TERM=dumb), is the plain text of `symgen show`: these lines are for reading alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from rich.console import Console
from rich.text import Text

from symgen.description.expression import Expression
from symgen.description.robot import Robot
from symgen.regroup.formula import Formula, Printer, Signed
from symgen.regroup.regrouping import Regrouping
from symgen.regroup.symbols import subscripted, superscripted
from symgen.report.formulas import operation_lines, recursive_formulas, relation_lines, selected, title

STYLES = {
    "inertia": ("cyan", "XX ... ZZ", "moments and products of inertia"),
    "first moment": ("green", "MX MY MZ", "first moments"),
    "mass": ("bold green", "M", "masses"),
    "actuator": ("magenta", "", "inertia of actuators"),
    "torque": ("red", "", "friction, offsets, springs"),
    "constant": ("yellow", "", "constants"),
    "function": ("bold", "", ""),
}
"""Style, names and meaning of each kind of symbol."""
INSIDE = re.compile(" (?=[+−-] )")  # where a term that is wider than the terminal may be broken


def terminal() -> Console | None:
    """The terminal that formulas go to, or None where they are piped or no colour is wanted."""
    console = Console(highlight=False)
    return console if console.is_terminal and not console.no_color and not console.is_dumb_terminal else None


class FormulaText(Printer[Text]):
    """Lines of formulas for one robot; `ascii` keeps names and operators as robot files write them."""

    def __init__(self, robot: Robot, width: int, *, ascii: bool = False) -> None:
        self.width, self.ascii = width, ascii
        self.minus, self.times = ("-", "*") if ascii else ("−", "·")
        self.kinds = dict(kinds(robot))

    # --- language ---

    def symbol(self, name: str) -> Text:
        """A name in the colour of its kind; a regrouped one has that of the parameter it is called after."""
        kind = self.kinds.get(name) or self.kinds.get(name.removesuffix("R")) or "function"
        return Text.assemble((self._shown(name), STYLES[kind][0]))

    def number(self, digits: str) -> Text:
        return Text(digits)

    def call(self, function: str, argument: Expression, n: int) -> Text:
        text = self.symbol(function).append_text(self.bracketed(self.expression(argument)))
        return text if n == 1 else self.raised(text, n)

    def raised(self, base: Text, n: int) -> Text:
        return Text.assemble(base, f"**{n}" if self.ascii else superscripted(str(n)))

    def bracketed(self, inside: Text) -> Text:
        return Text.assemble("(", inside, ")")

    def product(self, factors: Sequence[Text]) -> Text:
        return Text(self.times).join(factors)

    def quotient(self, up: Sequence[Text], down: Sequence[Text]) -> Text:
        return Text("/").join([self.product(up), *down])

    def sum(self, terms: Sequence[Signed[Text]]) -> Text:
        return Text(" ").join(self._signed(terms))

    def _signed(self, terms: Sequence[Signed[Text]]) -> Iterator[Text]:
        for k, (added, term) in enumerate(terms):
            sign = ("+" if k else "") if added else self.minus
            yield Text.assemble(f"{sign} " if k else sign, term)

    def _shown(self, name: str) -> str:
        return name if self.ascii else subscripted(name)

    # --- lines ---

    def definition(self, name: str, formula: Formula, column: int) -> Text:
        """`name = formula`, the sign = in column `column`, continued under the first term."""
        head = self.symbol(name)
        head.pad_right(max(column - head.cell_len, 0))
        return self._filled(head.append(" = "), self._pieces(formula, self.width - column - 3), column + 3)

    def listed(self, head: str, names: Iterable[str]) -> Text:
        """`head: names`, continued under the first of them."""
        start = Text(f"{head}: ")
        return self._filled(start, ((" " if k else "", self.symbol(name)) for k, name in enumerate(names)), start.cell_len)

    def legend(self) -> Text:
        """What the colours of this robot's symbols mean."""
        samples: dict[str, dict[str, None]] = {}
        for name, kind in self.kinds.items():
            sample = STYLES[kind][1] or (name if kind == "constant" else name.rstrip("0123456789"))
            samples.setdefault(kind, {})[sample] = None
        pieces = [
            Text.assemble((" ".join(map(self._shown, [*samples[kind]][:5])), style), f" {meaning}")
            for kind, (style, _, meaning) in STYLES.items()
            if kind in samples
        ]
        return self._filled(Text(), (("   " if k else "", piece) for k, piece in enumerate(pieces)), 0)

    def _pieces(self, formula: Formula, room: int) -> Iterator[tuple[str, Text]]:
        """The formula cut before its signs, inside brackets only where a term is wider than `room`; with the gap before each piece."""
        gap = ""
        for term in self._signed(self.terms(formula)):
            cuts = [] if term.cell_len <= room else [m.start() for m in INSIDE.finditer(term.plain)]
            for piece in term.divide(cuts):
                yield gap, piece[1:] if piece.plain.startswith(" ") else piece
                gap = " "

    def _filled(self, line: Text, pieces: Iterable[tuple[str, Text]], indent: int) -> Text:
        """As many pieces on each line as fit the width."""
        done = Text()
        for gap, piece in pieces:
            if gap and line.cell_len + len(gap) + piece.cell_len > self.width:
                done.append_text(line).append("\n")
                line = Text(" " * indent)
                gap = ""
            line = line.append(gap).append_text(piece)
        return done.append_text(line)


def kinds(robot: Robot) -> Iterator[tuple[str, str]]:
    """(symbol, kind) of every standard parameter and constant."""
    families: Mapping[str, str] = {e.family: e.kind for e in robot.elements}
    for name in robot.parameters:
        family = name.rstrip("0123456789")
        if family in families:
            yield name, "actuator" if families[family] == "inertia" else "torque"
        else:
            yield name, "mass" if family == "M" else "first moment" if family[0] == "M" else "inertia"
    for name in robot.constants:
        yield name, "constant"


def print_coloured(regrouping: Regrouping, only: str | None, recursive: bool, ascii: bool) -> bool:
    """Print the formulas for a reader at a terminal; False where there is none."""
    console = terminal()
    if console is None:
        return False
    text = FormulaText(regrouping.robot, console.width, ascii=ascii or not console.encoding.startswith("utf"))
    base = selected(regrouping, only)
    formulas = recursive_formulas(regrouping) if recursive else [(b.name, b.formula) for b in base if only or b.name != b.own]
    column = max((len(name) for name, _ in formulas), default=0)
    lines: list[Text | str] = [text.definition(name, formula, column) for name, formula in formulas]
    if not only and not recursive:
        console.print(title(regrouping), style="bold", markup=False)
        alone = [b.name for b in base if b.name == b.own]
        lists = [text.listed(head, names) for head, names in (("as they are", alone), ("no effect", regrouping.no_effect)) if names]
        costs = ["operations per sample", *operation_lines(regrouping)]
        lines = ["", *relation_lines(regrouping), *lines, "", *lists, "", text.legend(), "", *costs]
    for line in lines:
        console.print(line, soft_wrap=True, markup=False)
    return True
