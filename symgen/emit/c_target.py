"""The C file of a robot: its lines, and the tables and signatures of all functions for its template.

Names and sections are the same as in the NumPy module.

A C function computes a tile of samples in several loops: first sines and cosines, which compilers
turn into calls of vector functions, then the other arithmetic, which they turn into vector
instructions of any width. Values that are the same for all samples are computed before the loops.

The body of each function is written once, as a loop over `lanes` samples. The compiler makes two
versions of it, one for a single state and one for a tile, a group of samples that are computed
together. The time of compilers grows faster than the length of a function, so a long body becomes
several functions. Values that later parts need are stored in an array `kept`.

Joints that only the closure equations tie belong to a state struct. One function computes it by
Newton's method; every other function uses it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from math import prod
from typing import Any, NamedTuple

from symgen.derive.graph import CONST, COS, SIN, SYM, Node, Scalar, reachable
from symgen.derive.loop_equations import loop_system
from symgen.derive.models import Entry, Place
from symgen.description.expression import FUNCTIONS, Expression
from symgen.description.naming import Namespace
from symgen.description.robot import FIXED, PRISMATIC
from symgen.emit.blocks import label
from symgen.emit.header import BASE_MOTION, header, line_of, packed, plain
from symgen.emit.printers import Language, Section, Text, under_titles
from symgen.emit.python_target import tuple_of
from symgen.emit.render import WIDTH, laid_out
from symgen.emit.spec import BASE, STATES, Function, ModuleSpec
from symgen.version import VERSION

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
    prose=("/*", "*/"),
    breaks=True,
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


class Signature(NamedTuple):
    """A C function without its body: `int32_t tx40_bias` and `const real *q`, ..."""

    start: str
    parameters: Sequence[str]

    def of(self, real: str) -> str:
        """Write the signature with another name of the type `real`, on several lines if needed."""
        given = [re.sub(r"\breal\b", real, p) for p in self.parameters]
        flat = f"{self.start}({', '.join(given)})"
        if len(flat) < WIDTH:
            return flat
        return "\n".join((f"{self.start}(", *packed(given), ")")).replace(",\n)", "\n)")

    def __str__(self) -> str:
        return self.of("real")


# --- arguments: one pointer for each of q, qd, qdd, or one struct with all of them ---


class CStates(NamedTuple):
    """The arguments by which the C functions of one robot receive the joint states q, qd, ...

    On a moving base, the motion of the base is the state before the others.

    Attributes
    ----------
    robot : str
        Name of the robot; the name of the struct starts with it.
    widths : mapping of str to int
        Number of values of each state per sample, in the order of the struct.
    closed : bool
        Whether loops tie joints, so that q, qd, qdd, G and qdd0 are members of one struct s.
    """

    robot: str
    widths: Mapping[str, int]
    closed: bool

    @classmethod
    def of(cls, spec: ModuleSpec) -> CStates:
        """Make the description of the state arguments that all C functions of a robot have."""
        size, motion = spec.sizes, spec.derivation.algebra.base_motion
        if not spec.tied:
            base = dict.fromkeys(BASE, len(motion)) if motion else {}
            return cls(spec.robot.name, base | dict.fromkeys(STATES, size["n"]), closed=False)
        joints = dict.fromkeys(("q", "qd", "qdd"), size["k"])
        tied = {"G": size["m"] * size["n"], "qdd0": size["m"]}
        return cls(spec.robot.name, joints | tied, closed=True)

    def arguments(self, *states: str) -> list[str]:
        """Return the argument names for the given states: s (the struct), or one per state."""
        return ["s"] if self.closed else [*states]

    def parameters(self, *states: str) -> list[str]:
        """Return the C declarations of the state arguments, such as `const real *q`."""
        kind = f"{self.robot}_state" if self.closed else "real"
        return [f"const {kind} *{x}" for x in self.arguments(*states)]

    def read(self, state: str) -> str:
        """Return the C expression that points to a state of one sample: `s->q`, or `q`."""
        return f"s->{state}" if self.closed else state

    def load(self, state: str) -> str:
        """Return the C arguments that locate a state: distance between samples, and start address.

        The distance, in numbers, is from one sample to the next. The address is the address of the
        first sample of a tile, a group of samples computed together.
        """
        if self.closed:
            return f"sizeof *s/sizeof(real), s[start].{state}"
        n = self.widths[state]
        return f"{n}, {state} + {n}*start"


# --- parts of a long body ---

Titled = tuple[str, Sequence[str]]  # lines that belong together, under a title


class Part(NamedTuple):
    """One part of a long C function body: its lines, and the names that occur in these lines."""

    sections: tuple[Section, ...]
    read: frozenset[str]


def in_parts(
    inputs: Sequence[str], steps: Sequence[Titled], results: Sequence[Titled], longest: int
) -> tuple[list[Part], int]:
    """Split the body of a C function into parts of at most `longest` steps; a step computes one
    variable.

    A result belongs to the part of the last step that it depends on. Each part loads the inputs
    that it uses. Return the parts, and the number of values that must be stored for later parts.
    """
    chunks = [list(steps[k : k + longest]) for k in range(0, max(len(steps), 1), longest)]
    place = {lines[0].split()[2]: p for p, chunk in enumerate(chunks) for _, lines in chunk}
    for title, lines in results:
        last = max((place.get(word, 0) for word in words(lines)), default=0)
        chunks[last].append((title, lines))
    read = [words([line for _, lines in chunk for line in lines]) for chunk in chunks]
    crossing = [x for x, p in place.items() if any(x in later for later in read[p + 1 :])]
    row = {x: k for k, x in enumerate(crossing)}
    parts = []
    for p, chunk in enumerate(chunks):
        recalled = [
            f"const real {x} = AT(kept, {k});"
            for x, k in row.items()
            if x in read[p] and place[x] < p
        ]
        saved = [f"AT(kept, {k}) = {x};" for x, k in row.items() if place[x] == p]
        own = [("Inputs", line) for line in (*read_by(read[p], inputs), *recalled)]
        own += [(title, line) for title, lines in chunk for line in lines]
        own += [("Read by later parts", line) for line in saved]
        parts.append(Part(under_titles(own), words([line for _, line in own])))
    return parts, len(row)


def words(lines: Sequence[str]) -> frozenset[str]:
    """Collect the names that occur in lines of C code, except in comments."""
    return frozenset(word for line in lines for word in re.findall(r"\w+", line.partition("/*")[0]))


def read_by(read: frozenset[str], steps: Sequence[str]) -> list[str]:
    """Select the C lines that compute the variables `read`, and all lines that these depend on.

    Each step has the form `const real x = ...;`.
    """
    needed = []
    for step in reversed(steps):
        if step.split()[2] in read:
            read |= words([step])
            needed.append(step)
    return needed[::-1]


# --- the file ---

SCRATCH = 262144  # bytes of stack for the results of one tile
FLAGS = (
    "-std=c99 -O2 -ftree-vectorize -fno-math-errno -fno-trapping-math -ffp-contract=off "
    "-shared -fPIC"
)
LONGEST, OF_PART = 1000, 100
"""Steps and results of a body; a longer one is cut into parts of so many steps, compiled once."""
RESULTS = (
    *("joints", "rows", "parameters", "energies", "wrench", "standard parameters"),
    *("frames", "pose"),
)
"""Axes of the models that have a kernel."""


def render(spec: ModuleSpec, *, command: str | None = None) -> str:
    """Return the text of the C file with all functions of a robot.

    The same robot file and the same version give the same bytes.
    """
    return laid_out("kernels.c", _context(spec, command), C)


def render_header(spec: ModuleSpec, *, command: str | None = None) -> str:
    """Return the text of the C header file that declares the functions of the C file."""
    real = f"{spec.robot.name.upper()}_REAL"
    return laid_out("header.h", {**_context(spec, command), "real": real}, C)


@lru_cache(maxsize=1)
def _context(spec: ModuleSpec, command: str | None) -> dict[str, Any]:
    """Collect the values that fill the templates of the C file and of its header file."""
    robot, free = spec.robot, spec.regrouping.constants
    names, states = spec.names(is_word), CStates.of(spec)
    kernels = [
        _kernel(spec, states, f, names.inner())
        for f in spec.functions.values()
        if {*f.model.axes} <= {*RESULTS}
    ]
    closing = [
        _kernel(spec, states, f, names.inner()) for f in spec.functions.values() if f.model.of_loops
    ]
    most = max(kernel["computed"] for kernel in kernels)
    lines = [
        line
        for kernel in (*closing, *kernels)
        for body in (kernel, *kernel["parts"])
        for section in (*body["sections"], Section("", tuple(body["before"])))
        for line in section.lines
    ]
    return {
        "title": _comment(robot.title or robot.name),
        "file": _comment(robot.file or robot.name),
        "sha256": robot.sha256,
        "version": VERSION,
        "command": _comment(command or robot.file or robot.name),
        "header": [_comment(line) for line in _header(spec, states, kernels)],
        "name": robot.name,
        **{size: spec.sizes[size] for size in ("n", "m", "frames")},
        "sizes": {"b": len(spec.regrouping), "c": max(len(free), 1)},
        "tile": 16
        if 8 * 16 * most <= SCRATCH
        else 8,  # the rows of a short tile stay in the first cache
        "kernels": kernels,
        "closing": closing,
        "states": states,
        "parameters": packed([f'"{name}"' for name in spec.regrouping.names]),
        "constant_names": packed([f'"{name}"' for name in free] or ['""']),
        "constants": packed([repr(float(x)) for x in free.values()] or ["0.0"]),
        "values": packed(list(map(repr, spec.base_values))) if spec.base_values else [],
        "real": "real",
        "helpers": {
            name: any(f"{name}(" in line for line in lines) for name in ("sign", "above", "below")
        },
        **_kinematics(spec, states, names.inner()),
        **(_loops(spec, states, closing) if spec.tied else {}),
    }


def _loops(
    spec: ModuleSpec, states: CStates, closing: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Collect the values for the C code that closes kinematic loops by Newton's method.

    These are start configuration, units, tolerance, step size and signatures for Newton's method.
    """
    name, loops = spec.robot.name, loop_system(spec.robot)
    start = f"{{{', '.join(map(repr, loops.start.tolist()))}}}"
    actuated = [f"const real *{x}_a" for x in ("q", "qd", "qdd")]
    return {
        "tied": [f"q{u}" for u in spec.tied],
        "start": ", ".join([start, *["{0}"] * (len(states.widths) - 1)]),
        "units": ", ".join(map(repr, loops.units)),
        "closed": loops.tolerance,
        "pace": f"{loops.pace():.2g}",
        "mode": int(loops.mode()),
        "curvatures": spec.functions["curvature"].shape[0],
        "calls": {kernel["name"]: kernel["state_call"] for kernel in closing},
        "closed1": Signature(
            f"int32_t {name}_closed1", [*actuated, "const real *constants", f"{name}_state *s"]
        ),
    }


def _kinematics(spec: ModuleSpec, states: CStates, names: Namespace) -> dict[str, Any]:
    """Make the tables and signatures that the C code for Jacobian and forward dynamics needs."""
    robot, closure, name = spec.robot, spec.derivation.closure, spec.robot.name
    moved = [
        (f.j, k, closure.row[f.j][i])
        for f in robot.frames
        if f.sigma != FIXED
        for k, i in enumerate(closure.independent)
        if closure.row[f.j].get(i)
    ]
    read = {symbol for _, _, rate in moved for symbol in rate.symbols}
    free, n = [*spec.regrouping.constants], len(robot.joints)
    rates: dict[tuple[int, int], list[str]] = {}  # of a frame by an actuated joint, tied ones by G
    for j, k, rate in moved:
        for i in (k,) if k < n else range(n):
            by_tied = "" if k < n else f"*G[{(k - n) * n + i}]"
            rates.setdefault((j, i), []).append(f"({_constant(rate)}){by_tied}")
    first = [sum(j < f.j for j, _ in rates) for f in robot.frames]
    bias = spec.functions["bias"].model.states
    pointers = [*states.parameters(*bias), *(f"const real *{x}" for x in ("tau", "X"))]
    return {
        "ant": ", ".join(str(f.ant) for f in robot.frames),
        "sigma": ", ".join(str(int(f.sigma == PRISMATIC)) for f in robot.frames),
        "rate_constants": [
            f"const real {names.of_file(c)} = constants[{k}];"
            for k, c in enumerate(free)
            if c in read
        ],
        "first": ", ".join(map(str, [*first, len(rates)])),
        "moves": ", ".join(str(i) for _, i in rates),
        "rates": [" + ".join(terms) for terms in rates.values()],
        "jacobian": Signature(
            f"int32_t {name}_jacobian1",
            ["int32_t frame", *states.parameters("q"), "const real *constants", "real *J"],
        ),
        "base": BASE_MOTION if robot.base_moves else "",
        "bias_arguments": ", ".join(states.arguments(*bias)),
        "forward": ""
        if robot.loaded
        else Signature(
            f"int32_t {name}_forward_dynamics1", [*pointers, "const real *constants", "real *qdd"]
        ),
    }


def _constant(e: Expression) -> str:
    """Write a constant expression in C; integers become floats (2.0), because in C 1/2 is 0."""
    if e.constant is not None:
        return repr(float(e.constant))
    return re.sub(r"(?<![\w.])(\d+)(?![\w.])", r"\1.0", C.expression(e))


def _comment(text: str) -> str:
    """Make a text safe inside a C comment, so that it cannot end the comment early.

    The text can neither start another comment nor continue a line.
    """
    shown = "".join(c if c.isprintable() else " " for c in plain(text))
    return re.sub(r"\*(?=/)|/(?=\*)|\?(?=\?)", r"\g<0> ", shown)


def _kernel(spec: ModuleSpec, states: CStates, f: Function, names: Namespace) -> dict[str, Any]:
    """Collect all lines, tables and signatures of one function in C, such as the regressor.

    These are the lines before the loops, the loops for sines and cosines, the main loop over a tile
    of samples, the table {row of the result, number of the value, sign}, and the C signatures.
    Cosines and sines have separate loops, because compilers merge sin(x) and cos(x) of one loop
    into a call that has no vector form.
    """
    robot, model, result = spec.robot, f.model, names.own(f.model.result)
    entries = [
        e
        for e in f.values.entries
        if isinstance(e.value, Scalar) or e.value or not model.by_columns
    ]
    text = CText(
        [e.value for e in entries],
        f.values.algebra.sections,
        names,
        [label(f, e) for e in entries],
    )
    distinct, places = signals(f, entries)
    results = [
        (e.heading, _result(result, k, text.expression(e.value), e.comment))
        for k, e in enumerate(distinct)
    ]
    rows = [f"{{{_row(place, f.shape)}, {signal}, {sign}}}" for place, signal, sign in places]
    algebra, independent = spec.derivation.algebra, spec.derivation.closure.independent
    place = {
        f"{letter}{j}": (state, k)
        for state, letter in STATES.items()
        for k, j in enumerate(independent)
    }
    place |= {motion: (base, k) for base in BASE for k, motion in enumerate(algebra.base_motion)}
    for k, u in enumerate(spec.tied):
        if "qdd" not in model.arguments:
            place[f"QDP{u}"] = ("qdd0", k)
        for i, j in enumerate(robot.joints):
            rate = algebra.named("G", u, j)
            place[rate] = ("G", k * len(robot.joints) + i)
    needed = text.inputs
    free = spec.regrouping.constants
    constants, parameters = (
        [
            f"const real {names.of_file(c)} = {source.format(k)};"
            for k, c in enumerate(every)
            if c in needed
        ]
        for source, every in (("constants[{}]", free), ("X[{}]", spec.regrouping.names))
    )
    fixed = [
        f"const real {names.of_file(c)} = {x!r};"
        for c, x in robot.constants.items()
        if c in needed and c not in free
    ]
    trigonometry = list(text.trigonometry_of.items())
    angles = [_input(name, *place[name]) for name in place if name in text.trigonometry_inputs]
    calls = [
        (call, f"AT(T, {k}) = {call};".ljust(32) + f"/* {called} */")
        for k, (called, call) in enumerate(trigonometry)
    ]
    waves = [
        (title, [line for call, line in calls if function in call])
        for title, function in (("Cosines", "cos("), ("Sines", "sin("))
    ]
    inputs = [_input(name, *place[name]) for name in place if name in text.main_inputs]
    recalled = [f"const real {called} = AT(T, {k});" for k, (called, _) in enumerate(trigonometry)]
    trigonometry_loops = tuple(
        Section(title, (*read_by(words(lines), [*angles, *text.angles]), *lines))
        for title, lines in waves
        if lines
    )
    before = (*fixed, *constants, *parameters, *text.fixed)
    steps = [(section.title, [line]) for section in text.sections for line in section.lines]
    parts: list[Part] = []
    kept = 0
    sections = under_titles(
        (title, line)
        for title, lines in [("Inputs", [*inputs, *recalled]), *steps, *results]
        for line in lines
    )
    if len(steps) + len(results) > LONGEST:
        parts, kept = in_parts([*inputs, *recalled], steps, results, OF_PART)
        sections = ()
    read = text.trigonometry_inputs | text.main_inputs
    used = [s for s in states.widths if any(place[x][0] == s for x in read if x in place)]
    laid: dict[str, Any] = {
        "name": model.name,
        "text": text,
        "result": result,
        "used": used,
        "opening": before,
        "trigonometry": trigonometry_loops,
        "calls": len(trigonometry),
        "sections": sections,
        "cut": parts,
        "kept": kept,
        "rows": packed(rows),
        "entries": len(rows),
        "computed": len(distinct),
    }
    given = {"X": parameters, "constants": constants}
    return laid | _signatures(states, f, laid, [name for name, lines in given.items() if lines])


def signals(
    f: Function, entries: Sequence[Entry]
) -> tuple[list[Entry], list[tuple[Place, int, int]]]:
    """Collect the distinct values among entries of a result; x and -x count as one value.

    Entries that are plain numbers must be 0, 1 or -1. Return for each distinct value the first
    entry that has this value or its negative; its comment joins the comments of all these entries.
    Return also, for every entry, its array index, the number of its value, and the sign by which
    this value is multiplied.
    """
    number: dict[tuple[str, int], tuple[int, int]] = {}  # node or number: signal, its sign
    distinct: list[Entry] = []
    places = []
    for entry in entries:
        value = entry.value
        if isinstance(value, int):
            key, own = ("number", abs(value)), -1 if value < 0 else 1
        else:
            key, own = ("node", value.node.index), value.sign
        signal, sign = number.setdefault(key, (len(distinct), own))
        if signal == len(distinct):
            distinct.append(entry)
        elif entry.comment:
            comment = f"{distinct[signal].comment}, {entry.comment}".removeprefix(", ")
            distinct[signal] = distinct[signal]._replace(comment=comment)
        places += [(place, signal, own * sign) for place in f.places(entry)]
    return distinct, places


def _row(place: Sequence[int], shape: Sequence[int]) -> int:
    """Return the position of an array entry in memory, in C order (last index fastest)."""
    row = 0
    for k, size in zip(place, shape, strict=True):
        row = row * size + k
    return row


def _input(name: str, state: str, k: int) -> str:
    return f"const real {name} = AT({state}, {k});"


def _result(result: str, k: int, expression: str, comment: str) -> list[str]:
    """Write the C line that stores one entry of a result, with its comment.

    The comment gets a line of its own, before the other, if both together are too long.
    """
    line = f"AT({result}, {k}) = {expression};"
    both = f"{line:<64}  /* {comment} */" if comment else line
    return [both] if len(both) <= WIDTH - 8 or not comment else [f"/* {comment} */", line]


def _header(spec: ModuleSpec, states: CStates, kernels: Sequence[Mapping[str, Any]]) -> list[str]:
    lines = header(spec, {k["name"]: k["text"] for k in kernels}, formulas=True)
    so = f"{spec.robot.name}.c -o {spec.robot.name}.so -lm"
    return [
        *lines[: lines.index("Cost per sample") - 1],
        "",
        *line_of(
            "Arguments",
            (
                f"{'s (N,)' if states.closed else 'q, qd, qdd (N, n) in C order, rad or m and seconds'}; "
                "S (rows, N), samples last, comes zeroed: rows that are always zero are not written"
            ),
        ),
        *(line_of("base (N, 9)", BASE_MOTION) if spec.robot.base_moves else ()),
        *line_of("constants", ", ".join(spec.regrouping.constants) or "none"),
        *line_of("X, columns", " ".join(spec.regrouping.names)),
        *line_of("Returned", "0, or 1 if N is negative or a pointer is missing"),
        *line_of("Compile", f"cc {FLAGS} {so}"),
        *line_of(
            "",
            "never with -ffast-math: loading what it links sets subnormal numbers to zero in the "
            "whole process",
        ),
    ]


def _signatures(
    states: CStates, f: Function, laid: Mapping[str, Any], needs: Sequence[str]
) -> dict[str, object]:
    """Make the C signatures and calls of one function, for one state and for many samples.

    `needs` lists which of X and the constants the lines of the function use.
    """
    model, result, name = f.model, laid["result"], states.robot
    used, computed, calls = laid["used"], laid["computed"], laid["calls"]
    pointers = [*(["X"] if model.reads_X else []), "constants"]
    inline, kernel = ("static", "static") if laid["cut"] else ("INLINE", "KERNEL static")
    scratch = ["T"] * bool(calls)
    body = [f"const real *restrict {s}" for s in (*used, *needs)]
    body += [f"real *restrict {s}" for s in (*scratch, result)]
    parts = [
        _part(laid, k, part, [*body, "real *restrict kept"])
        for k, part in enumerate(laid["cut"], 1)
    ]
    taken = states.arguments(*model.states)
    given = [*states.parameters(*model.states), *(f"const real *{p}" for p in pointers)]
    own = ["int64_t N", *given, "real *S"]
    read = used if model.of_loops else map(states.read, used)
    filled = model.result if model.of_loops else "S"
    shape, size = tuple_of(f.shape), prod(f.shape)
    tile = ", ".join([*(f"{s}_tile" for s in used), *needs, *scratch, result])
    rooms = {"T": calls, result: computed}
    read_first = words([line for section in laid["trigonometry"] for line in section.lines])
    return {
        "parts": parts,
        "before": read_by(read_first, laid["opening"]) if parts else laid["opening"],
        "summary": f"/* {model.summary} S has shape {tuple_of([*f.shape, 'N'])}. */",
        "one_summary": f"/* {model.summary} S has shape {shape if f.shape else '(1,)'}. */",
        "size": size,
        "unread": [p for p in (*taken, *pointers) if p not in (*used, *["s"] * bool(used), *needs)],
        "body_prototype": Signature(
            f"{inline} void {model.name}_body", ["const size_t lanes", *body]
        ),
        "tile_prototype": Signature(f"{kernel} void {model.name}_lanes", body),
        "tile_call": ", ".join(["TILE", *used, *needs, *scratch, result]),
        "tile_arguments": tile,
        "one_prototype": Signature(f"void {name}_{model.name}1", [*given, "real *S"]),
        "state_prototype": Signature(
            f"static void {model.name}_state",
            [*(f"const real *{p}" for p in (*used, *needs)), "real *S"],
        ),
        "state_call": f"{model.name}_state({', '.join([*read, *needs, filled])})",
        "one_call": ", ".join(["1", *used, *needs, *scratch, result]),
        "one_scratch": ", ".join(f"{x}[{rooms[x]}]" for x in (*scratch, result)),
        "prototype": Signature(f"int32_t {name}_{model.name}", own),
        "scratch": ", ".join(
            [
                *(f"{s}_tile[{states.widths[s]}*TILE]" for s in used),
                *(f"{x}[{rooms[x]}*TILE]" for x in (*scratch, result)),
            ]
        ),
        "missing": _missing([*taken, *pointers, "S"]),
    }


def _part(
    laid: Mapping[str, Any], number: int, part: Part, parameters: Sequence[str]
) -> dict[str, object]:
    """Make a C function from one part of the body of a long C function.

    Its parameters are the ones among `parameters` that its lines use.
    """
    before = read_by(part.read, laid["opening"])
    read = part.read | words(before)
    given = [p for p in parameters if p.split()[-1].lstrip("*") in read]
    name = f"{laid['name']}_part{number}"
    return {
        "sections": part.sections,
        "before": before,
        "prototype": Signature(f"PART void {name}", ["const size_t lanes", *given]),
        "call": f"{name}({', '.join(['lanes', *(p.split()[-1].lstrip('*') for p in given)])})",
    }


def _missing(pointers: Sequence[str]) -> str:
    return " || ".join(f"{p} == NULL" for p in pointers)
