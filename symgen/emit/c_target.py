"""What a C file says, as data: the kernels over a tile of samples, the rows of the stores they fill, the header.

Everything is computed here; the template only lays it out. Joints that only the closure equations tie have no C kernels: their Newton
iteration stays in the NumPy module.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from symgen.derive.graph import Scalar
from symgen.derive.loops import close
from symgen.description.robot import Robot
from symgen.emit.c_parts import Part, definitions, parts, words_of
from symgen.emit.c_printer import CText, identifier
from symgen.emit.header import header, packed, wrapped
from symgen.emit.printers import Section
from symgen.emit.spec import LOCALS, STATES, WIDTH, Headings, ModuleSpec, inertia_graph, regressor_program, torque_graph
from symgen.regroup.regrouping import Regrouping

ABI = 2
SCRATCH = 262144  # bytes of stack for the results of one tile
FLAGS = "-std=c11 -O2 -ftree-vectorize -fno-math-errno -fno-trapping-math -ffp-contract=off -shared -fPIC"
SUMMARIES = {  # states, whether X is read, result, summary
    "regressor": (("q", "qd", "qdd"), False, "D", "S, shape (b, n, N): Gamma_j = sum_k S[k][j] X[k]; only rows that are not constant"),
    "inverse_dynamics": (("q", "qd", "qdd"), True, "GAM", "Gamma, shape (n, N)"),
    "inertia_matrix": (("q",), True, "A", "A(q), shape (n, n, N): column i is Gamma for a unit acceleration of joint i from rest"),
    "bias": (("q", "qd"), True, "GAM", "Gamma at qdd = 0, shape (n, N)"),
    "gravity": (("q",), True, "GAM", "Gamma at rest without friction, shape (n, N)"),
}

Outputs = list[tuple[int, str, str, Scalar | int]]  # row of the store, heading, comment, value


@dataclass(frozen=True)
class Kernel:
    """One function of the C file; `rows` holds {row of the store, signal, sign}, `count` of them written by the function itself."""

    name: str
    summary: str
    states: tuple[str, ...]
    reads_X: bool
    result: str
    used: tuple[str, ...]
    needs_X: bool
    needs_constants: bool
    before: tuple[str, ...]
    trigonometry: tuple[Section, ...]  # apart: compilers merge sin(x) and cos(x) of one loop into a call that has no vector form
    calls: int
    sections: tuple[Section, ...]
    parts: tuple[Part, ...]  # of the sections, where those are long
    crossing: int  # rows of V, which the parts hand over
    rows: tuple[str, ...]
    entries: int
    count: int
    computed: int


@dataclass(frozen=True)
class CSpec:
    """All that the template of the C file lays out."""

    robot: Robot
    header: tuple[str, ...]
    kernels: tuple[Kernel, ...]
    tile: int
    joints: int


def has_c_target(robot: Robot) -> bool:
    """Whether every joint is an explicit function of the actuated ones."""
    return not close(robot).tied


def c_spec(spec: ModuleSpec) -> CSpec:
    """The kernels of the models of `spec`."""
    regrouping = spec.regrouping
    robot, n = regrouping.robot, len(regrouping.robot.joints)
    entries, program = regressor_program(regrouping, regrouping.own)
    regressor: Outputs = [
        (k * n + row, f"Joint {robot.joints[row]}", f"DG{robot.joints[row]}{regrouping.own[k]}", value)
        for (k, row), value in sorted(zip(entries, program.outputs, strict=True), key=lambda entry: entry[0][1])
        if isinstance(value, Scalar) or value
    ]
    triangle, headings = inertia_graph(regrouping)
    matrix: Outputs = []
    for (j, i), value in triangle.items():
        matrix += [(r * n + c, "Inertia matrix", "", value) for r, c in dict.fromkeys(((j, i), (i, j)))]
    kernels = [_kernel(regrouping, "regressor", regressor, program.sections)]
    kernels.append(_torques(regrouping, "inverse_dynamics", *torque_graph(regrouping)))
    kernels.append(_kernel(regrouping, "inertia_matrix", matrix, headings))
    kernels.append(_torques(regrouping, "bias", *torque_graph(regrouping, acceleration=False)))
    kernels.append(_torques(regrouping, "gravity", *torque_graph(regrouping, acceleration=False, velocity=False)))
    most = max(kernel.computed + kernel.crossing for kernel in kernels)
    tile = 16 if 8 * 16 * most <= SCRATCH else 8  # the rows of a short tile stay in the first cache
    return CSpec(robot, tuple(_header(spec)), tuple(kernels), tile, n)


def _torques(regrouping: Regrouping, name: str, outputs: Sequence[Scalar | int], headings: Headings) -> Kernel:
    return _kernel(regrouping, name, [(row, "Torques", "", value) for row, value in enumerate(outputs)], headings)


def _kernel(regrouping: Regrouping, name: str, outputs: Outputs, headings: Headings) -> Kernel:
    robot = regrouping.robot
    states, reads_X, result, summary = SUMMARIES[name]
    text = CText([value for *_, value in outputs], headings, (*LOCALS, *robot.constants))
    signals = Signals(outputs)
    under: dict[str, list[str]] = {}  # heading: lines
    for k, (heading, value, comments) in enumerate(signals.computed):
        under.setdefault(heading, []).append(_result(result, k, text.expression(value), comments))
    independent = close(robot).independent
    place = {f"{letter}{j}": (state, k) for state, letter in STATES.items() for k, j in enumerate(independent)}
    needed = text.inputs
    before = [f"const double {identifier(c)} = constants[{k}];" for k, c in enumerate(robot.constants) if c in needed]
    needs_constants = bool(before)
    parameters = [f"const double {identifier(p)} = X[{k}];" for k, p in enumerate(regrouping.names) if p in needed]
    trigonometry = list(text.trigonometry_of.items())
    angles = [_input(name, *place[name]) for name in place if name in text.trigonometry_inputs]
    calls = [(call, f"T[{k}][t] = {call};".ljust(32) + f"/* {called} */") for k, (called, call) in enumerate(trigonometry)]
    waves = [(title, [line for call, line in calls if function in call]) for title, function in (("Cosines", "cos("), ("Sines", "sin("))]
    inputs = [_input(name, *place[name]) for name in place if name in text.main_inputs]
    recalled = [f"const double {called} = T[{k}][t];" for k, (called, _) in enumerate(trigonometry)]
    results = (Section(title, tuple(lines)) for title, lines in under.items())
    trigonometry_loops = tuple(Section(title, (*angles, *text.angles, *lines)) for title, lines in waves if lines)
    body = [*text.sections, *results]
    before = [*before, *parameters, *text.fixed]
    divided, crossing = parts(before, [*inputs, *recalled], body)
    sections = [Section("Inputs", (*inputs, *recalled)), *body]
    read = text.trigonometry_inputs | text.main_inputs
    return Kernel(
        name=name,
        summary=summary,
        states=states,
        reads_X=reads_X,
        result=result,
        used=tuple(s for s in states if any(place[x][0] == s for x in read if x in place)),
        needs_X=bool(parameters),
        needs_constants=needs_constants,
        before=definitions(before, words_of(line for s in trigonometry_loops for line in s.lines)) if divided else tuple(before),
        trigonometry=trigonometry_loops,
        calls=len(trigonometry),
        sections=tuple(s for s in sections if s.lines),
        parts=tuple(divided),
        crossing=crossing,
        rows=tuple(packed([f"{{{row}, {signal}, {sign}}}" for row, signal, sign in signals.rows])),
        entries=len(signals.rows),
        count=len(signals.rows) - signals.constant * (name == "regressor"),  # its store holds constants from the start
        computed=len(signals.computed),
    )


class Signals:
    """The distinct rows of a result, up to sign: `rows` of the store as (row, signal, sign), the `constant` last of them numbers."""

    def __init__(self, outputs: Outputs) -> None:
        self.computed: list[tuple[str, Scalar | int, list[str]]] = []  # heading, value, comments
        self.rows: list[tuple[int, int, int]] = []
        first: dict[tuple[str, int], tuple[int, int]] = {}  # node or number: signal, sign
        numbers = [output for output in outputs if not isinstance(output[-1], Scalar)]
        self.constant = len(numbers)
        for row, heading, comment, value in [*(o for o in outputs if isinstance(o[-1], Scalar)), *numbers]:
            key = ("node", value.node.index) if isinstance(value, Scalar) else ("number", abs(value))
            own = value.sign if isinstance(value, Scalar) else -1 if value < 0 else 1
            signal, sign = first.setdefault(key, (len(self.computed), own))
            if signal == len(self.computed):
                self.computed.append((heading, value, []))
            self.computed[signal][2].append(comment)
            self.rows.append((row, signal, own * sign))


def _input(name: str, state: str, k: int) -> str:
    return f"const double {name} = {state}[{k}][t];"


def _result(result: str, k: int, expression: str, comments: Sequence[str]) -> str:
    line, comment = f"{result}[{k}][t] = {expression};", ", ".join(c for c in comments if c)
    return f"{line:<64}  /* {comment} */" if comment else line


def _header(spec: ModuleSpec) -> list[str]:
    lines = header(spec)
    hanging = " " * 12
    return [
        *lines[: lines.index("Cost per sample") - 1],
        "",
        "Arguments   q, qd, qdd (N, n) in C order, rad or m and seconds; S receives (rows, N), samples last",
        *wrapped("flags       1 writes past the caches, for results larger than those", "", hanging),
        *wrapped(f"constants   {', '.join(spec.robot.constants) or 'none'}", "", hanging),
        *wrapped(f"X, columns  {' '.join(spec.regrouping.names)}", "", hanging),
        "Results     0, or 1 if N is negative or a pointer is missing; rows that are zero or constant are never written",
        f"Compile     cc {FLAGS}",
        f"            {spec.robot.name}.c -o {spec.robot.name}.so -lm",
        "            never with -ffast-math: loading what it links sets subnormal numbers to zero in the whole process",
    ]


def layout(spec: CSpec) -> list[dict[str, object]]:
    """The kernels with their C signatures written out."""
    n = spec.joints
    found: list[dict[str, object]] = []
    for k in spec.kernels:
        pointers = [*k.states, *(["X"] if k.reads_X else []), "constants"]
        tile = [f"double {s}[restrict {n}][TILE]" for s in k.used]
        tile += ["const double *restrict X"] * k.needs_X + ["const double *restrict constants"] * k.needs_constants
        tile.append(f"double {k.result}[restrict {k.computed}][TILE]")
        arguments = [f"{s}_tile" for s in k.used] + ["X"] * k.needs_X + ["constants"] * k.needs_constants + [k.result]
        own = ["int64_t N", *(f"const double *{p}" for p in pointers), "double *S", "int32_t flags"]
        found.append(
            {
                **vars(k),
                "tile_prototype": signature(f"KERNEL static void {k.name}_lanes", tile),
                "part_functions": _part_functions(k, n),
                "tile_arguments": ", ".join(arguments),
                "prototype": signature(f"int32_t {spec.robot.name}_{k.name}", own),
                "scratch": ", ".join([*(f"{s}_tile[{n}][TILE]" for s in k.used), f"{k.result}[{k.computed}][TILE]"]),
                "missing": " || ".join(f"{p} == NULL" for p in [*pointers, "S"]),
            }
        )
    return found


def _part_functions(k: Kernel, n: int) -> list[dict[str, object]]:
    parameters = {
        **{s: f"double {s}[restrict {n}][TILE]" for s in k.used},
        "X": "const double *restrict X",
        "constants": "const double *restrict constants",
        "T": f"double T[restrict {k.calls}][TILE]",
        "V": f"double V[restrict {k.crossing}][TILE]",
        k.result: f"double {k.result}[restrict {k.computed}][TILE]",
    }
    found: list[dict[str, object]] = []
    for number, part in enumerate(k.parts, 1):
        own = {name: text for name, text in parameters.items() if name in part.words}
        name = f"{k.name}_part{number}"
        prototype = signature(f"PART static void {name}", list(own.values()))
        found.append({"prototype": prototype, "call": f"{name}({', '.join(own)})", "before": part.before, "sections": part.sections})
    return found


def signals_layout(spec: CSpec) -> dict[str, object]:
    """The function that gives the distinct signals of the regressor, with its table of entries."""
    k = spec.kernels[0]
    own = [
        "int64_t m",
        *(f"const double *{s}" for s in k.states),
        "int64_t stride",
        "const double *constants",
        "double *U",
        "int64_t ustride",
    ]
    return {
        "prototype": signature(f"int32_t {spec.robot.name}_signals", own),
        "missing": " || ".join(f"{p} == NULL" for p in [*k.states, "constants", "U"]),
    }


def signature(name: str, parameters: Sequence[str]) -> str:
    """A C function with its parameters, on as few lines as they need."""
    flat = f"{name}({', '.join(parameters)})"
    return flat if len(flat) < WIDTH else "\n".join(packed(parameters)).join((f"{name}(\n", ")")).replace(",)", ")")
