"""Graph to lines of C: the named quantities and sections of the NumPy module as `const double`
declarations.

A kernel treats a tile of samples in two loops over plain doubles: sines and cosines first, which
compilers turn into calls of vector
functions, then straight-line arithmetic, which they turn into vectors of any width. What depends on
no sample stands before the loops.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence

from symgen.derive.graph import CONST, COS, SIGN, SIN, SQRT, SYM, Node, Scalar
from symgen.description.namespace import Namespace
from symgen.emit.printers import Language, Section, Text

KEYWORDS = """auto break case char const continue default do double else enum extern float for goto
if inline int long register restrict return short signed sizeof static struct switch typedef union
unsigned void volatile while"""
MACROS = """asm typeof errno linux unix NULL NAN INFINITY HUGE_VAL TILE KERNEL STREAM PORTABLE
WIDTH"""
OWN = """sin cos sqrt sign above below load save constants flags m t start row tile U T S N
size_t int32_t int64_t memcpy memset"""
RESERVED = frozenset(f"{KEYWORDS} {MACROS} {OWN}".split())
HEADERS = re.compile(r"(M|FP|HUGE|MATH|U?INT\w*|SIZE|PTRDIFF|SIG|WCHAR|WINT)_\w+")
"""Macros of math.h and stdint.h."""
C = Language(
    {op: op for op in (COS, SIN, SIGN, SQRT)},
    "above({})",
    "below({})",
    "3.141592653589793",
    one="1.0",
    square="{0}*{0}",
    number=lambda c: repr(float(c)),
)


def is_word(name: str) -> bool:
    """Whether C, its headers or the frame of a kernel use the name."""
    return name in RESERVED or bool(HEADERS.fullmatch(name))


class CText(Text):
    """The lines of one kernel: `fixed`, `trigonometry_of` (with `angles` before them), `sections`,
    then `expression` for each output.
    """

    language: Language = C

    def __init__(
        self,
        outputs: Sequence[Scalar | int],
        headings: Sequence[tuple[int, str]],
        names: Namespace,
        labels: Sequence[str],
    ) -> None:
        self.fixed: tuple[str, ...] = ()
        self.angles: tuple[str, ...] = ()
        self.trigonometry_of: dict[str, str] = {}  # name: call
        self.trigonometry_inputs: set[str] = set()
        self.main_inputs: set[str] = set()
        self.outputs = [o.node for o in outputs if isinstance(o, Scalar)]
        super().__init__(outputs, headings, names, labels)

    def _has_line(self, node: Node) -> bool:
        return super()._has_line(node) or (node.op in (COS, SIN) and not node.fixed)

    def _line(self, node: Node) -> str:
        return f"const double {super()._line(node)};"

    def _sections(self, headings: Sequence[tuple[int, str]]) -> tuple[Section, ...]:
        calls = [n for n in self.nodes if n.op in (COS, SIN) and not n.fixed]
        under = set(_needed([x.node for n in calls for x in n.operands]))
        main = set(_needed(self.outputs))
        self.fixed = tuple(self._line(n) for n in self.nodes if n.index in self.named and n.fixed)
        self.angles = tuple(
            self._line(n) for n in self.nodes if n.index in self.named & under and not n.fixed
        )
        self.trigonometry_of = {self.called[n.index]: self._body(self._as_named(n)) for n in calls}
        symbols = {n.index: str(n.value) for n in self.nodes if n.op == SYM}
        self.trigonometry_inputs = {symbols[i] for i in under & symbols.keys()}
        self.main_inputs = {symbols[i] for i in main & symbols.keys()}
        marks = [(0, "Inputs"), *headings]
        starts = [start for start, _ in marks]
        # A title may come again further down: the order of the lines must stay.
        lines: dict[tuple[int, str], list[str]] = {}
        for node in self.nodes:
            if node.index in self.named & main and not node.fixed and node.op not in (COS, SIN):
                mark = bisect_right(starts, node.index) - 1
                lines.setdefault(
                    (-1, "Angles") if node.index in under else (mark, marks[mark][1]), []
                ).append(self._line(node))
        return tuple(
            Section(title, tuple(under_title)) for (_, title), under_title in lines.items()
        )


def _needed(outputs: Iterable[Node]) -> Iterator[int]:
    """Indices of the nodes that a loop over the samples needs: not below a sine or cosine, nor
    below what is computed before the loop.
    """
    stack, visited = list(outputs), set()
    while stack:
        node = stack.pop()
        if node.index in visited:
            continue
        visited.add(node.index)
        yield node.index
        if node.op not in (COS, SIN, CONST) and not node.fixed:
            stack.extend(x.node for x in node.operands)
