"""Graph to lines of C: the named quantities and sections of the NumPy module as `const double` declarations.

A kernel treats a tile of samples in two loops over plain doubles: sines and cosines first, which compilers turn into calls of vector
functions, then straight-line arithmetic, which they turn into vectors of any width. What depends on no sample stands before the loops.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from typing import ClassVar

from symgen.derive.graph import CONST, COS, SIGN, SIN, SQRT, SYM, Node, Scalar
from symgen.emit.printers import Section, Text

KEYWORDS = """auto break case char const continue default do double else enum extern float for goto if inline int long register restrict return
short signed sizeof static struct switch typedef union unsigned void volatile while"""
MACROS = "asm typeof errno linux unix NULL NAN INFINITY HUGE_VAL TILE KERNEL PART STREAM PORTABLE WIDTH"
OWN = "sin cos sqrt sign above below load save constants flags m t start row tile U V size_t int32_t int64_t memcpy memset"
RESERVED = frozenset(f"{KEYWORDS} {MACROS} {OWN}".split())
HEADERS = re.compile(r"(M|FP|HUGE|MATH|U?INT\w*|SIZE|PTRDIFF|SIG|WCHAR|WINT)_\w+")  # macros of math.h and stdint.h


class CText(Text):
    """The lines of one kernel: `fixed`, `trigonometry` (with `angles` before them), `sections`, then `expression` for each output."""

    calls: ClassVar[dict[str, str]] = {COS: "cos", SIN: "sin", SIGN: "sign", SQRT: "sqrt"}
    one: ClassVar[str] = "1.0"
    pi: ClassVar[str] = "3.141592653589793"

    def __init__(self, outputs: Sequence[Scalar | int], headings: Sequence[tuple[int, str]], taken: Iterable[str]) -> None:
        self.fixed: tuple[str, ...] = ()
        self.angles: tuple[str, ...] = ()
        self.trigonometry_of: dict[str, str] = {}  # name: call
        self.trigonometry_inputs: set[str] = set()
        self.main_inputs: set[str] = set()
        self.outputs = [o.node for o in outputs if isinstance(o, Scalar)]
        super().__init__(outputs, headings, taken)

    def _symbol(self, name: str) -> str:
        return identifier(name)

    def _has_line(self, node: Node) -> bool:
        return super()._has_line(node) or (node.op in (COS, SIN) and not node.fixed)

    def _number(self, c: Fraction) -> str:
        return repr(float(c))

    def _square(self, factor: str) -> str:
        return f"{factor}*{factor}"

    def _clipped(self, x: str, bound: str) -> str:
        return f"{'above' if bound == 'maximum' else 'below'}({x})"

    def _line(self, node: Node) -> str:
        return f"const double {super()._line(node)};"

    def _sections(self, headings: Sequence[tuple[int, str]]) -> tuple[Section, ...]:
        calls = [n for n in self.nodes if n.op in (COS, SIN) and not n.fixed]
        under = set(_needed([x.node for n in calls for x in n.operands]))
        main = set(_needed(self.outputs))
        self.fixed = tuple(self._line(n) for n in self.nodes if n.index in self.named and n.fixed)
        self.angles = tuple(self._line(n) for n in self.nodes if n.index in self.named & under and not n.fixed)
        self.trigonometry_of = {self.called[n.index]: self._body(Scalar(None, n, self._name_sign(n))) for n in calls}  # type: ignore[arg-type]
        symbols = {n.index: str(n.value) for n in self.nodes if n.op == SYM}
        self.trigonometry_inputs = {symbols[i] for i in under & symbols.keys()}
        self.main_inputs = {symbols[i] for i in main & symbols.keys()}
        marks = [(0, "Inputs"), *headings]
        starts = [start for start, _ in marks]
        lines: dict[tuple[int, str], list[str]] = {}  # a title may come again further down: the order of the lines must stay
        for node in self.nodes:
            if node.index in self.named & main and not node.fixed and node.op not in (COS, SIN):
                mark = bisect_right(starts, node.index) - 1
                lines.setdefault((-1, "Angles") if node.index in under else (mark, marks[mark][1]), []).append(self._line(node))
        return tuple(Section(title, tuple(under_title)) for (_, title), under_title in lines.items())


def _needed(outputs: Iterable[Node]) -> Iterator[int]:
    """Indices of the nodes that a loop over the samples needs: not below a sine or cosine, nor below what is computed before the loop."""
    stack, visited = list(outputs), set()
    while stack:
        node = stack.pop()
        if node.index in visited:
            continue
        visited.add(node.index)
        yield node.index
        if node.op not in (COS, SIN, CONST) and not node.fixed:
            stack.extend(x.node for x in node.operands)


def identifier(name: str) -> str:
    """A name of the robot file as C accepts it beside the names of the kernel."""
    return f"{name}_" if name in RESERVED or HEADERS.fullmatch(name) else name
