"""The Python module of a robot: one text for NumPy, for other array packages and for CasADi.

Each function is written as a block of plain expressions over a namespace `xp`. The block fills a
container by index: an array of NumPy, or a table that later becomes an array of another package or
a matrix of CasADi. The steps that several functions share (the motion of the links) are a block of
their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from textwrap import wrap

from symgen.derive.closure import Closure
from symgen.derive.loop_equations import loop_system
from symgen.derive.models import EMITTED, ON_REQUEST, Model
from symgen.derive.regressor import acting, element_names
from symgen.description.expression import ZERO, Expression
from symgen.description.robot import FIXED, PRISMATIC, Robot
from symgen.emit.blocks import Block, FunctionPrinter
from symgen.emit.header import data, header, literal, packed, plain, tables, wrap_text
from symgen.emit.printers import PYTHON, Section
from symgen.emit.render import WIDTH, laid_out
from symgen.emit.spec import BASE, SHARING, Function, ModuleSpec
from symgen.regroup.regrouping import Regrouping, sign_conditions
from symgen.version import VERSION

BLOCK = 4096  # samples
MANY = 8  # values of a source that are named in one assignment, others beside them
LARGE = 20  # joints above which CasADi factorizes the inertia matrix, in an order without fill-in
FEWEST_SHARED = 8  # steps of the motion of the links that are worth one text for two functions


def render(spec: ModuleSpec, *, command: str | None = None) -> str:
    """Return the text of the Python module of a robot.

    The same robot file and the same version give the same bytes.
    """
    robot, regrouping, closure = spec.robot, spec.regrouping, spec.derivation.closure
    free = regrouping.constants
    blocks, motion = _blocks(spec)
    models = {
        name: m.on(robot)
        for name, m in (EMITTED | ON_REQUEST).items()
        if (name in spec.functions or not m.option)
        and not (name == "forward_dynamics" and robot.loaded)
    }
    read = {name for b in regrouping.base for name in b.combination}
    rates = {e for row in closure.row.values() for e in row.values()}
    passive = [e for j in robot.passive for e in (closure.offset[j], *closure.row[j].values())]
    coefficients = {*regrouping.coefficients, *(r for _, r, _ in sign_conditions(regrouping))}
    taken = {name: {*b.constants} for name, b in blocks.items()} | {
        "base_parameters": _symbols(coefficients),
        "moving": _symbols(rates),
        "passive_joints": _symbols(passive),
    }
    if motion:
        taken |= dict.fromkeys(SHARING, set.union(*(taken[name] for name in SHARING)))
    constants = {name: [c for c in free if c in used] for name, used in taken.items()}
    for names in constants.values():
        names.sort(key=robot.channels.__contains__)
    slides = any(robot.frame(j).sigma == PRISMATIC for j in closure.independent)
    return laid_out(
        "module.py",
        {
            **spec.sizes,
            "opening": wrap_text(
                f'"""{plain(robot.title or robot.name)}: base parameters, regressor, dynamics.', ""
            ),
            "file": plain(robot.file or robot.name),
            "sha256": robot.sha256,
            "version": VERSION,
            "command": plain(command or robot.file or robot.name),
            "header": [
                plain(line)
                for line in header(spec, {n: b.text for n, b in blocks.items()}, formulas=False)
            ],
            "tables": [*tables(spec), *_loop_tables(spec, slides)],
            "data": [*literal("LINKS", robot.links), *data(spec)],
            "head": Heads(regrouping),
            "models": models,
            "shapes": {name: f.shape for name, f in spec.functions.items()},
            "outputs": _outputs(spec, models.values()),
            "constants": constants,
            "passed": {name: _passed_constants(robot, names) for name, names in constants.items()},
            "tuple_of": tuple_of,
            "numbers": tuple_of([c for c in constants["regressor"] if c not in robot.channels]),
            "listed": further_arguments,
            "keywords": "".join(f", {c}={c}" for c in free),
            "channels": robot.channels,
            "base": robot.base_moves,
            "free": robot.base_is_free,
            "tied": spec.tied,
            "passive": robot.passive,
            "size": BLOCK,
            "store_constants": _constant_entries(spec.functions["regressor"], "D"),
            "elements": _element_lines(robot),
            "unpack": unpacked(
                [name if name in read else "_" for name in robot.parameters], "standard"
            ),
            "formulas": broken(
                f"{b.name} = {b.formula.text(PYTHON.expression)}"
                for b in regrouping.base
                if b.name != b.own
            ),
            "conditions": [
                (
                    f"{source(ratio)} {'>' if sign > 0 else '<'} 0",
                    f"{name} holds where {ratio} is {'positive' if sign > 0 else 'negative'}",
                    name,
                )
                for name, ratio, sign in sign_conditions(regrouping)
            ],
            "packed": packed(list(regrouping.names)),
            "moving": _moving(robot, closure),
            "passive_rows": _passive_rows(robot, closure),
            "motion": _broken(motion),
            "blocks": {
                name: _laid_out(spec, b, 8 if motion and name in SHARING else 4)
                for name, b in blocks.items()
            },
            "functions": spec.functions,
            "slides": slides,
            "large": len(robot.joints) > LARGE,
            "turn": loop_system(robot).turn() if spec.tied else None,
            "pace": f"{loop_system(robot).pace():.2g}" if spec.tied else "",
            "joint": robot.joints[0],
            "closed": loop_system(robot).tolerance if spec.tied else "",
            "valued": spec.base_values,
        },
        PYTHON,
    )


def _blocks(spec: ModuleSpec) -> tuple[dict[str, Block], tuple[Section, ...]]:
    """Write all functions of the Python module, and the motion of the links that two of them share.

    The motion is empty if the regressor and the inverse dynamics share only few steps.
    """
    names = spec.names(PYTHON.is_word)
    functions = {name: f for name, f in spec.functions.items() if not f.model.case_of}
    both = [functions[name] for name in SHARING]
    shared = FunctionPrinter(spec, both, names.inner(), PYTHON, _unpack)
    in_one = len(shared.shared & shared.text.named) >= FEWEST_SHARED
    blocks = {
        name: shared.block(f)
        if in_one and name in SHARING
        else FunctionPrinter(spec, [f], names.inner(), PYTHON, _unpack).block(f)
        for name, f in functions.items()
    }
    return blocks, shared.motion if in_one else ()


def _laid_out(spec: ModuleSpec, block: Block, indent: int = 4) -> dict[str, object]:
    """Collect the lines of one function for the template, which indents them."""
    f = block.function
    results = block.results(lambda place: _entry(block.result, place))
    constant = [] if f.model.by_columns else _constant_entries(f, block.result)
    sections = [*block.sections, *results, Section("Constants", tuple(constant))]
    states = block.arguments[: len(block.arguments) - len(block.constants) - f.model.reads_X]
    k, rates = spec.sizes["k"], spec.sizes["m"] * spec.sizes["n"]
    base = states[:1] == BASE
    joints = states[base:]
    rows = "base (9, N) and " * base + f"{', '.join(joints[:3])} ({k}, N)"
    rows += f" and {joints[-1]} ({rates}, N)" * (len(joints) > 3)
    return {
        "states": ", ".join(["xp", *states]),
        "result": block.result,
        "X": ", X" * f.model.reads_X,
        "filled": f"{block.result}, shape {tuple_of([*f.shape, 'N'])}"
        + ", where it is not constant" * f.model.by_columns,
        "rows": rows,
        "sections": _broken(sections, indent),
    }


def _broken(sections: Iterable[Section], indent: int = 4) -> list[Section]:
    """Break the long lines of sections; sections without lines are left out."""
    return [Section(s.title, tuple(broken(s.lines, indent))) for s in sections if s.lines]


def _entry(result: str, place: Sequence[int]) -> str:
    """Write an entry of a result array: A[0, 1], or PW[()] of a model that is one number."""
    return f"{result}[{', '.join(map(str, place)) or '()'}]"


def _passed_constants(robot: Robot, names: Sequence[str]) -> str:
    """Write the constants that a call passes on: one tuple, and a second tuple for constants that
    vary with time.
    """
    timed = [c for c in names if c in robot.channels]
    rest = tuple_of([c for c in names if c not in timed])
    return f"{rest}, {tuple_of(timed)}" if timed else rest


def _outputs(spec: ModuleSpec, models: Iterable[Model]) -> list[str]:
    """Write the table of functions for CasADi: arguments and result names of each function."""
    names, rows = spec.names(PYTHON.is_word), {"base_parameters": ("standard", "X")}
    own = {result: names.own(result) for result in dict.fromkeys(m.result for m in models)}
    for m in models:
        results = [own[m.result]]
        if m.name == "frame_poses":
            results = [names.own(f"T{f.j}") for f in spec.robot.frames]
        rows[m.name] = (" ".join(m.arguments), " ".join(results))
    if spec.robot.passive:
        rows["passive_joints"] = ("q qd qdd", "q_passive qd_passive qdd_passive")
    return [f"    {name!r}: {row!r}," for name, row in rows.items()]


def _constant_entries(f: Function, result: str) -> list[str]:
    """Write the assignments of result entries that are constant numbers other than zero.

    Entries with the same number are assigned together.
    """
    by_value: dict[float, list[str]] = {}
    for place, value in f.preset:
        by_value.setdefault(value, []).append(_entry(result, place))
    lines = []
    for value, targets in by_value.items():
        line = ""
        for target in targets:
            if len(line) + len(target) > WIDTH - 12:
                lines.append(f"{line}{value}")
                line = ""
            line += f"{target} = "
        lines.append(f"{line}{value}")
    return lines


def _loop_tables(spec: ModuleSpec, slides: bool) -> Iterator[str]:
    """Yield source lines with data to close kinematic loops: start position, assembly mode, units.

    A unit is a typical motion of an independent joint: 1 rad, or the longest length of the robot
    file if the joint is prismatic. Units are written only if `slides` is true.
    """
    robot, closure = spec.robot, spec.derivation.closure
    if not spec.tied:
        return
    yield f"_START = {tuple(closure.start[j] for j in closure.independent)!r}"
    mode = loop_system(robot).mode()
    yield f"_MODE = {mode}  # sign of det J_u in the assembly mode of _START"
    if slides:
        yield f"_UNITS = {loop_system(robot).units}  # rad; of slides the longest length, m"


class Heads:
    """Writer of the `def` lines of public functions, with type hints."""

    def __init__(self, regrouping: Regrouping) -> None:
        channels = regrouping.robot.channels
        self.constants = [
            f"{name}: {hint('Array | float') if name in channels else 'float'} = {value!r}"
            for name, value in regrouping.constants.items()
        ]

    def __call__(
        self,
        name: str,
        arguments: Sequence[str],
        keywords: Sequence[str] = (),
        returns: str = "Array",
        optional: bool = False,
    ) -> str:
        """Write the `def` line of a public function whose `arguments` are arrays.

        If `optional`, all arguments except the first may be None.
        """
        later = f"{hint('Array | None')} = None" if optional else hint("Array")
        named = [*keywords, *self.constants]
        parameters = [f"{a}: {later if k else hint('Array')}" for k, a in enumerate(arguments)]
        if named:
            parameters += ["*", *named]
        return signature(f"def {name}", parameters, f" -> {hint(returns)}:")


def hint(kind: str) -> str:
    """Return a type hint as source text; the hint is in quotes if it contains the name Array.

    The arrays may be of any package.
    """
    return f'"{kind}"' if "Array" in kind else kind


def signature(start: str, parameters: Sequence[str], end: str = "") -> str:
    """Write a signature `start(parameters)end`, on several lines if it is too long for one line."""
    flat = f"{start}({', '.join(parameters)}){end}"
    if len(flat) <= WIDTH:
        return flat
    return "\n".join((f"{start}(", *packed(parameters), f"){end}")).replace(",\n)", "\n)")


def _unpack(source: str, used: Sequence[tuple[int, str]], count: int) -> list[str]:
    """Write the lines that give names to the used entries of an array, such as `q1, q2 = q`.

    `used` holds index and name of each used entry, `count` is the length of the array. Adjacent
    entries are unpacked from one slice, other entries one by one. If many entries are used, the
    whole array is unpacked.
    """
    if len(used) > MANY and used[-1][0] - used[0][0] >= len(used):
        called = dict(used)
        return unpacked([called.get(k, "_") for k in range(count)], source)
    if len(used) < 2 or used[-1][0] - used[0][0] >= len(used):
        return [f"{name} = {source}[{k}]" for k, name in used]
    start, stop = used[0][0] or "", used[-1][0] + 1
    span = "" if len(used) == count else f"[{start}:{stop if stop < count else ''}]"
    return unpacked([name for _, name in used], f"{source}{span}")


def unpacked(names: Sequence[str], source: str) -> list[str]:
    """Write the assignment `names = source` of a tuple, on several lines if it is long."""
    text = ", ".join(names) + ("," if len(names) == 1 else "")
    if len(text) + len(source) + 3 < WIDTH - 4:
        return [f"{text} = {source}"]
    return ["(", *(f"    {line}" for line in wrap(text, WIDTH - 12)), f") = {source}"]


def broken(lines: Iterable[str], indent: int = 4) -> list[str]:
    """Enclose in brackets the values of assignments that are too long for one line."""
    return [_bracketed(line) if len(line) > WIDTH - indent else line for line in lines]


def _bracketed(line: str) -> str:
    code, mark, remark = line.partition("  # ")
    target, _, value = code.rstrip().rpartition(" = ")
    return f"{target} = ({value})" + mark + remark


def tuple_of(names: Sequence[object]) -> str:
    return f"({', '.join(map(str, names))}{',' * (len(names) == 1)})"


def further_arguments(names: Iterable[str]) -> str:
    """Write names as the continuation of a list of arguments, for instance ", D3, RL4"."""
    return "".join(f", {name}" for name in names)


def _symbols(expressions: Iterable[Expression]) -> set[str]:
    return {name for e in expressions for name in e.symbols}


def source(e: Expression) -> str:
    """Write a constant expression as Python source; a plain number becomes a float."""
    return repr(float(e.constant)) if e.constant is not None else PYTHON.expression(e)


def _moving(robot: Robot, closure: Closure) -> list[str]:
    """Write, as Python source, how the joint of each frame depends on the independent joints.

    Entries are {frame: (antecedent, sigma, ((column, rate), ...))}. The rate is the velocity of the
    joint per velocity of the independent joint that the column counts.
    """
    column = {j: k for k, j in enumerate(closure.independent)}
    entries = []
    for f in robot.frames:
        rates = [] if f.sigma == FIXED else closure.row[f.j].items()
        text = tuple_of([f"({column[i]}, {source(g)})" for i, g in rates])
        entries.append(f"{f.j}: ({f.ant}, {f.sigma}, {text})")
    return packed(entries)


def _passive_rows(robot: Robot, closure: Closure) -> list[str]:
    """Write, as Python source, each passive joint as a linear function of independent joints.

    A row is (position at zero, rate for each independent joint).
    """
    rows = []
    for j in robot.passive:
        rates = [source(closure.row[j].get(i, ZERO)) for i in closure.independent]
        rows.append(f"({source(closure.offset[j])}, {tuple_of(rates)}),")
    return rows


def _element_lines(robot: Robot) -> list[str]:
    """Write the table of elements (friction, springs, ...) as Python source.

    Entries are {parameter: (kind, direction of motion, row or form)}. The row is linear, the form
    quadratic in the joint motions.
    """
    entries = []
    for name, (e, j) in element_names(robot).items():
        text = ", ".join(f"{at}: {source(g)}" for at, g in acting(e, j).items())
        row = f"{name!r}: ({e.acts_as!r}, {e.when or 'both'!r}, {{{text}}})"
        entries.append((robot.parameters.index(name), row))
    return packed([entry for _, entry in sorted(entries)])
