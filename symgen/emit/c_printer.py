"""Printer of C: writes the intermediate variables of a model as `const real` declarations.

Names and sections are the same as in the NumPy module.

A C function computes a tile of samples in several loops: first sines and cosines, which compilers
turn into calls of vector functions, then the other arithmetic, which they turn into vector
instructions of any width. Values that are the same for all samples are computed before the loops.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from fractions import Fraction

from symgen.derive.graph import CONST, COS, SIN, SYM, Node, Scalar, reachable
from symgen.description.expression import FUNCTIONS
from symgen.description.naming import Namespace
from symgen.emit.printers import Language, Section, Text, under_titles

KEYWORDS = """auto break case char const continue default do double else enum extern float for goto
if inline int long register restrict return short signed sizeof static struct switch typedef union
unsigned void volatile while"""
MACROS = """asm typeof errno linux unix NULL NAN INFINITY HUGE_VAL TILE KERNEL STREAM PORTABLE
WIDTH REAL AT INLINE PART"""
OWN = """sin cos sqrt exp tanh pow sign above below load save real lanes kept rate constants m t start row
tile U T S N size_t int32_t int64_t memcpy memset"""
RESERVED = frozenset(f"{KEYWORDS} {MACROS} {OWN}".split())
HEADERS = re.compile(r"(M|FP|HUGE|MATH|U?INT\w*|SIZE|PTRDIFF|SIG|WCHAR|WINT)_\w+")
"""Macros of math.h and stdint.h."""


def is_word(name: str) -> bool:
    """Whether a name is reserved: a word of C, of its header files or of the emitted C code."""
    return name in RESERVED or bool(HEADERS.fullmatch(name))


def number(c: Fraction) -> str:
    """Write a rational number in C: a small integer as digits, others with the type `real`."""
    whole = c.denominator == 1 and abs(c) < 2**31
    return str(c.numerator) if whole else f"(real){float(c)!r}"


C = Language(
    {op: f.c for op, f in FUNCTIONS.items()},
    "above({})",
    "below({})",
    "(real)3.141592653589793",
    one="1",
    square="{0}*{0}",
    number=number,
    comment="//",
    step="const real {} = {};",
    entry="{} = {};",
    is_word=is_word,
)


class CText(Text):
    """The lines of C that compute one function for a tile, a group of samples computed together.

    They run in this order: `fixed` (the same for all samples), `angles`, `trigonometry_of` (sines
    and cosines of the angles), `sections`, and `expression` for each output.
    """

    language: Language = C

    def __init__(
        self,
        outputs: Sequence[Scalar | int],
        headings: Sequence[tuple[int, str]],
        names: Namespace,
        labels: Sequence[str],
    ) -> None:
        self._calls = [n for n in reachable(outputs) if n.op in (COS, SIN) and not n.fixed]
        self._under = set(_needed([x.node for n in self._calls for x in n.operands]))
        self._main = set(_needed([o.node for o in outputs if isinstance(o, Scalar)]))
        super().__init__(outputs, headings, names, labels)
        lines = [n for n in self.nodes if n.index in self.named]
        self.fixed = tuple(self._line(n) for n in lines if n.fixed)
        self.angles = tuple(self._line(n) for n in lines if n.index in self._under and not n.fixed)
        self.trigonometry_of = {  # name: call
            self.called[n.index]: self._body(self._as_named(n)) for n in self._calls
        }
        symbols = {n.index: str(n.value) for n in self.nodes if n.op == SYM}
        self.trigonometry_inputs = {symbols[i] for i in self._under & symbols.keys()}
        self.main_inputs = {symbols[i] for i in self._main & symbols.keys()}

    def _has_line(self, node: Node) -> bool:
        return super()._has_line(node) or (node.op in (COS, SIN) and not node.fixed)

    def sections_of(self, nodes: Collection[int]) -> tuple[Section, ...]:
        own = self.named & self._main & {*nodes}
        lines = [n for n in self.nodes if n.index in own and not n.fixed and n.op not in (COS, SIN)]
        return under_titles(
            ("Angles" if n.index in self._under else self._title(n), self._line(n)) for n in lines
        )


def _needed(outputs: Iterable[Node]) -> Iterator[int]:
    """Yield the indices of the graph nodes that a C loop over the samples must compute or load.

    Operands of sines and cosines are left out, because another loop computes them; so are operands
    of values that are computed before the loops.
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
