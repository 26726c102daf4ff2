"""Formulas on a terminal: names with subscripts, families in colour, long ones broken before + and - under their first term.

What is piped, or asked for without colour (NO_COLOR, TERM=dumb), is the plain text of `symgen show`: these lines are for reading alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from rich.console import Console
from rich.text import Text

from symgen.description.robot import Robot
from symgen.report.symbols import subscripted, superscripted

TOKEN = re.compile(r"(?P<name>[A-Za-z]\w*)|\*\*(?P<power>-?\d+)|(?P<number>\d+(?:\.\d+)?)|(?P<other>\s+|.)", re.DOTALL)
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
SIGNS = {"-": "−", "*": "·"}


def terminal() -> Console | None:
    """The terminal that formulas go to, or None where they are piped or no colour is wanted."""
    console = Console(highlight=False)
    return console if console.is_terminal and not console.no_color and not console.is_dumb_terminal else None


class FormulaText:
    """Lines of formulas for one robot; `ascii` keeps names and operators as robot files write them."""

    def __init__(self, robot: Robot, width: int, *, ascii: bool = False) -> None:
        self.width, self.ascii = width, ascii
        self.kinds = dict(kinds(robot))

    def definition(self, name: str, formula: str, column: int) -> Text:
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
        there: dict[str, dict[str, None]] = {}
        for name, kind in self.kinds.items():
            sample = STYLES[kind][1] or (name if kind == "constant" else name.rstrip("0123456789"))
            there.setdefault(kind, {})[sample] = None
        pieces = [
            Text.assemble((" ".join(map(self._printed, [*there[kind]][:5])), style), f" {meaning}")
            for kind, (style, _, meaning) in STYLES.items()
            if kind in there
        ]
        return self._filled(Text(), (("   " if k else "", piece) for k, piece in enumerate(pieces)), 0)

    def symbol(self, name: str) -> Text:
        """A name in the colour of its kind; a regrouped one has that of the parameter it is called after."""
        kind = self.kinds.get(name) or self.kinds.get(name.removesuffix("R")) or "function"
        return Text.assemble((self._printed(name), STYLES[kind][0]))

    def _printed(self, name: str) -> str:
        return name if self.ascii else subscripted(name)

    def formula(self, formula: str) -> Text:
        """The formula on one line."""
        text = Text()
        for match in TOKEN.finditer(formula):
            if match["name"]:
                text.append_text(self.symbol(match["name"]))
            elif self.ascii:
                text.append(match[0])
            else:
                text.append(superscripted(match["power"]) if match["power"] else SIGNS.get(match[0], match[0]))
        return text

    def _pieces(self, formula: str, room: int) -> Iterator[tuple[str, Text]]:
        """The formula cut before its signs, inside brackets only where a term is wider than `room`; with the gap before each piece."""
        gap = ""
        for term in terms(formula):
            whole = self.formula(term)
            for piece in [whole] if whole.cell_len <= room else map(self.formula, re.split(r" (?=[+-] )", term)):
                yield gap, piece
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


def terms(formula: str) -> Iterator[str]:
    """The terms outside brackets, from the second on with their sign."""
    depth = start = 0
    for k, c in enumerate(formula):
        depth += (c == "(") - (c == ")")
        if not depth and formula[k : k + 3] in (" + ", " - "):
            yield formula[start:k]
            start = k + 1
    yield formula[start:]


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
