"""What the Python modules of every array package share: signatures with hints, formulas of the base parameters, tables that depend on constants."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from symgen.derive.columns import element_names
from symgen.derive.loops import close
from symgen.description.expression import Expression
from symgen.description.robot import FIXED, Robot
from symgen.emit.header import header, packed, plain
from symgen.emit.models import MODELS
from symgen.emit.spec import WIDTH, Function, ModuleSpec, unpacked
from symgen.regroup.formula import Python
from symgen.regroup.regrouping import sign_conditions
from symgen.version import VERSION


def context(spec: ModuleSpec, command: str | None, language: Python, array: str, quote: str = "") -> dict[str, Any]:
    """Values for the template of a Python module; `array` is the hint of its arrays, between `quote` where it is no class."""
    robot, regrouping, closure = spec.robot, spec.regrouping, close(spec.robot)
    formulas = [(b.name, b.formula) for b in regrouping.base if b.name != b.own]
    read = {name for b in regrouping.base for name in b.combination}
    takes = {name: arguments(f) for name, f in spec.functions.items()}
    closing = constants_of(robot, *(spec.functions[name].constants for name in ("closure", "curvature") if name in spec.functions))
    paths = _paths(robot, language)
    return {
        **spec.sizes,
        "title": plain(robot.title or robot.name),
        "file": plain(robot.file or robot.name),
        "sha256": robot.sha256,
        "version": VERSION,
        "command": plain(command or robot.file or robot.name),
        "header": [plain(line) for line in header(spec)],
        "tied": spec.tied,
        "passive": robot.passive,
        "models": MODELS,
        "functions": spec.functions,
        "takes": takes,
        "listed": listed,
        "shapes": {name: f.model.shape(robot, len(regrouping)) for name, f in spec.functions.items()},
        "head": Heads(robot, array, quote),
        "closing": closing,
        "storing": constants_of(robot, spec.functions["regressor"].constants, closing),
        "constants": listed(robot.constants),
        "keywords": {name: "".join(f", {c}={c}" for c in constants_of(robot, f.constants, closing)) for name, f in spec.functions.items()},
        "passed": {name: f.constants for name, f in spec.functions.items()},
        "unpack": unpacked([name if name in read else "_" for name in robot.parameters], "standard"),
        "formulas": [f"{name} = {language.formula(formula)}" for name, formula in formulas],
        "conditions": [
            (
                f"{source(language, ratio)} {'>' if sign > 0 else '<'} 0",
                f"{name} holds where {ratio} is {'positive' if sign > 0 else 'negative'}",
                name,
            )
            for name, ratio, sign in sign_conditions(regrouping)
        ],
        "packed": packed(list(regrouping.names)),
        "paths": paths,
        "path_constants": constants_of(robot, _symbols(row for rows in closure.row.values() for row in rows.values())),
        "passive_constants": constants_of(robot, _symbols(e for j in robot.passive for e in (closure.offset[j], *closure.row[j].values()))),
        "passive_rows": _passive_rows(robot, language),
    }


class Heads:
    """First lines of public functions: signature with hints, then the summary."""

    def __init__(self, robot: Robot, array: str, quote: str) -> None:
        self.constants = [f"{name}: float = {value!r}" for name, value in robot.constants.items()]
        self.array, self.quote = array, quote

    def hint(self, kind: str) -> str:
        """A hint, quoted where its names are no classes of the module."""
        return f"{self.quote}{kind}{self.quote}"

    def __call__(self, name: str, arguments: Sequence[str], keywords: Sequence[str] = (), returns: str = "", optional: bool = False) -> str:
        """`arguments` without hints are arrays; those behind the first are `optional` or not."""
        first, later = self.hint(self.array), f"{self.hint(f'{self.array} | None')} = None" if optional else self.hint(self.array)
        named = [*keywords, *self.constants]
        parameters = [f"{a}: {later if k else first}" for k, a in enumerate(arguments)] + ["*", *named] * bool(named)
        return signature(f"def {name}", parameters) + f" -> {self.hint(returns or self.array)}:"


def signature(start: str, parameters: Sequence[str]) -> str:
    """`start(parameters)`, on as few lines as it needs."""
    flat = f"{start}({', '.join(parameters)})"
    return flat if len(flat) < WIDTH else "\n".join(packed(parameters)).removesuffix(",").join((f"{start}(\n", "\n)"))


def arguments(f: Function) -> list[str]:
    """What the block of a model reads, in the order of its arguments."""
    return [*f.states, *(["X"] if f.reads_X else []), *f.constants]


def listed(names: Iterable[str]) -> str:
    """Names behind other arguments."""
    return "".join(f", {name}" for name in names)


def constants_of(robot: Robot, *used: Iterable[str]) -> tuple[str, ...]:
    """The constants of the robot that are among those used, in its order."""
    return tuple(name for name in robot.constants if any(name in names for names in used))


def _symbols(expressions: Iterable[Expression]) -> set[str]:
    return {name for e in expressions for name in e.symbols}


def source(language: Python, e: Expression) -> str:
    """A constant expression as source, numbers as floats."""
    return repr(float(e.constant)) if e.constant is not None else language.expression(e)


def _paths(robot: Robot, language: Python) -> list[str]:
    """Entries {frame: ((joint, sigma, ((column, rate), ...)), ...)}: the moving joints below each frame and how the actuated ones move them."""
    closure = close(robot)
    column = {j: k for k, j in enumerate(closure.independent)}
    entries = []
    for f in robot.frames:
        steps = []
        for j in (i for i in robot.path(f.j) if robot.frame(i).sigma != FIXED):
            rates = " ".join(f"({column[i]}, {source(language, g)})," for i, g in closure.row[j].items())
            steps.append(f"({j}, {robot.frame(j).sigma}, ({rates})),")
        entries.append(f"{f.j}: ({' '.join(steps)})")
    return packed(entries)


def _passive_rows(robot: Robot, language: Python) -> list[tuple[str, list[tuple[int, str]]]]:
    """Each passive joint over the independent ones: constant, then (column, rate), as source."""
    closure = close(robot)
    rows = []
    for j in robot.passive:
        rates = [(closure.independent.index(i), source(language, g)) for i, g in closure.row[j].items()]
        rows.append((source(language, closure.offset[j]), rates))
    return rows


def element_lines(robot: Robot, language: Python) -> list[str]:
    """Entries {parameter: (kind, direction of motion, row or form)} of the elements, as source."""
    entries = []
    for name, (e, j) in element_names(robot).items():
        if j in e.form:
            acts = {f"({i}, {k})": b for (i, k), b in sorted(e.form[j].items()) if i <= k}
        else:
            acts = {str(i): g for i, g in e.along[j].items()}
        text = ", ".join(f"{place}: {source(language, g)}" for place, g in acts.items())
        entries.append((robot.parameters.index(name), f"{name!r}: ({e.kind!r}, {e.when or 'both'!r}, {{{text}}})"))
    return packed([entry for _, entry in sorted(entries)])
