"""Text at the start of an emitted file: its header comment and its tables of constants.

The header shows frames, elements, base parameters and costs, so that a reader understands the code
below.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Any

from symgen.derive.closure import Closure
from symgen.derive.names import FAMILIES, families_of
from symgen.derive.regressor import element_names, unit
from symgen.description.distal import frames_text
from symgen.description.element import TRANSMITTED
from symgen.description.robot import BASE_ROWS, FIXED, KINDS, Element, Robot
from symgen.emit.printers import Text
from symgen.emit.render import WIDTH
from symgen.emit.spec import ModuleSpec
from symgen.regroup.regrouping import Regrouping

BASE_MOTION = (
    "w0 (rad/s), wd0 (rad/s**2) and a0 (m/s**2): angular velocity and acceleration of frame 0, and "
    "the acceleration of its origin minus gravity, in the axes of frame 0"
)
COLUMNS = ("j", "ant", "mu", "sigma", "gamma", "b", "alpha", "d", "theta", "r")


def header(spec: ModuleSpec, texts: Mapping[str, Text], formulas: bool) -> list[str]:
    """Write the header comment of an emitted file: frames, gravity, base parameters, operations.

    `texts` are the printed models by name. `formulas` decides whether the regrouping formulas are
    listed.
    """
    robot, regrouping = spec.robot, spec.regrouping
    gravity = ", ".join(str(e) for e in robot.gravity)
    lines = [
        "",
        "Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS",
        *(f"    {line}" for line in frame_table(robot)),
        *(wrap_text(f"Angles      {robot.angles}", "") if robot.angles else ()),
        *(
            line_of("Base", _base_text(robot))
            if robot.base_moves
            else line_of("Gravity", f"acceleration ({gravity}) in frame 0, m/s**2")
        ),
        *line_of(
            "Torques",
            "delivered by the actuators, so friction enters with a plus: "
            "Gamma = A*qdd + H + FV*qd + FS*sign(qd) + OFFSET",
        ),
        *line_of(
            "Parameters",
            "XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), "
            "MX MY MZ first moments",
        ),
        *(line_of("Elements", _laws(robot)) if robot.elements else ()),
        *(line for text in element_lines(robot) for line in wrap_text(text, "    ", " " * 12)),
        *(line for text in channel_lines(robot) for line in line_of("Channel", text)),
        *(
            line
            for text in loop_lines(robot, spec.derivation.closure)
            for line in line_of("Loop", text)
        ),
        *(line_of("Values", text) if (text := frames_text(robot)) else ()),
        *(line_of("Not read", "; ".join(robot.not_read)) if robot.not_read else ()),
        "",
        f"Base parameters, {len(regrouping)} of {len(robot.parameters)}; Gautier and Khalil (1990)",
        *wrap_text(regrouping.method, "    "),
    ]
    if formulas:
        for name, formula in grouped(regrouping).items():
            lines += wrap_text(f"{name} = {formula}", "    ")
    else:
        lines.append(
            "    FORMULAS has those that combine several; the others are standard parameters"
        )
    without = [name for name in regrouping.no_effect if name not in robot.assume]
    lines += wrap_text("No effect: " + (" ".join(without) or "none"), "    ")
    if robot.assume:
        zero = [name for name in robot.parameters if name in robot.assume]
        lines += wrap_text("Assumed zero: " + " ".join(zero), "    ")
    absorbing = one_sided_friction_that_absorbs(regrouping)
    if absorbing:
        lines += wrap_text(
            f"In motion only: {' '.join(absorbing)} contain a constant force, since no offset separates it "
            "from friction; at rest, in `gravity` and in `bias` at qd = 0, that force is missing.",
            "    ",
        )
    lines += [
        "",
        *line_of(
            "Names",
            "family, then component digits, then link: W12 is component 1 of link 2, U312 row 3 "
            "column 1, Z132 component 1 in frame 3 of the axis of joint 2; what several share is named "
            "by its factors, C4DV134, by its function, signQP1, or by a letter, N16a in N16",
        ),
    ]
    given = {name for text in texts.values() for name in text.given}
    given |= {"GAM1"} | {e.comment for e in spec.functions["regressor"].computed}
    lines += [f"    {family:<4} {FAMILIES[family]}" for family in families_of(given)]
    for name, of in sorted(next(iter(texts.values())).names.renamed.items()):
        lines += wrap_text(f"{name} stands for {of}, which is another name of this text", "    ")
    return [
        *lines,
        "",
        "Cost per sample",
        *(f"    {name:<18} {f.cost}" for name, f in spec.functions.items() if not f.model.case_of),
    ]


def _base_text(robot: Robot) -> str:
    """Explain in the header how a moving base is described."""
    text = "moves; gravity is a part of its measured acceleration a0"
    if not robot.base_is_free:
        return text
    rows = ", ".join(robot.rows[k] for k in BASE_ROWS)
    return f"{text}. It is free: before the joints, rows {rows} of the force that moves frame 0 and of the moment about its origin, in its axes"


def line_of(title: str, text: str) -> list[str]:
    """Write a header line: a title in the first column, then a text, wrapped if it is long."""
    return wrap_text(f"{title:<11} {text}", "", " " * 12)


def grouped(regrouping: Regrouping) -> dict[str, str]:
    """Return the formulas of the base parameters that combine several standard parameters."""
    return {b.name: str(b.formula) for b in regrouping.base if b.name != b.own}


def one_sided_friction_that_absorbs(regrouping: Regrouping) -> list[str]:
    """List the base parameters that contain a friction in one direction and a constant force.

    D_FSP - D_FSN = 1 in motion, as for a constant force, but 0 at rest.
    """
    elements = element_names(regrouping.robot)
    return [
        b.name
        for b in regrouping.base
        if b.name != b.own and b.own in elements and elements[b.own][0].when
    ]


def frame_table(robot: Robot) -> list[str]:
    """Write the table of frames, with Khalil's geometric parameters, as aligned lines of text.

    The columns mu, gamma and b are left out if they contain no information.
    """
    kept = informative_columns(robot)
    table = [list(kept), *([str(getattr(f, c)) for c in kept] for f in robot.frames)]
    if robot.labels:
        table = [
            [*row, label]
            for row, label in zip(
                table, ["label", *(robot.labels.get(f.j, "") for f in robot.frames)], strict=True
            )
        ]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return [
        "  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)).rstrip()
        for row in table
    ]


def informative_columns(robot: Robot) -> tuple[str, ...]:
    """Select the columns of the frame table that contain information and are printed.

    j, ant, sigma, alpha, d, theta and r are always printed, gamma and b if an entry is not zero, mu
    if a joint is passive.
    """
    said = {
        "mu": any(not f.mu for f in robot.frames if f.sigma != FIXED),
        "gamma": any(f.gamma for f in robot.frames),
        "b": any(f.b for f in robot.frames),
    }
    return tuple(c for c in COLUMNS if said.get(c, True))


def element_lines(robot: Robot) -> list[str]:
    """Describe the elements (friction, springs, actuator inertia) and the joints they act on.

    An element acts along a linear combination of joint motions, or in a quadratic form of them.
    """
    lines = []
    for e in robot.elements:
        rows = {
            j: " + ".join(_times(c, f"q{i}") for i, c in row.items()) for j, row in e.along.items()
        }
        own = [j for j in rows if rows[j] == f"q{j}"]
        parts = []
        if own:
            parts.append(f"along q{', q'.join(map(str, own))}")
        parts += [f"{e.family}{j} along {rows[j]}" for j in rows if j not in own]
        parts += [f"{e.family}{j} in the form {_form_text(form)}" for j, form in e.form.items()]
        when = f", {e.when} motion only" if e.when else ""
        when += _law_text(e)
        lines.append(f"{e.family:<7} {e.kind}{when}: {'; '.join(parts)}")
    return lines


def _laws(robot: Robot) -> str:
    """Say how the elements of a robot enter the torques, along a row G or in a form B."""
    form = "; in a form q'Bq: B times qdd (inertia), qd (viscous) or q (stiffness)"
    return "along s = G q: Gamma gets G' times the force along s" + form * any(
        e.form for e in robot.elements
    )


def channel_lines(robot: Robot) -> list[str]:
    """Describe, in header lines, which constants of the robot may be functions of time.

    Such a constant may be a torque at a joint that the caller computes from the other parameters.
    """
    own = [c for c in robot.channels if not c.startswith(TRANSMITTED)]
    torques = [c for c in robot.channels if c not in own]
    array = "an array (N,), one value a sample; one value a call in C"
    return [
        *([f"{', '.join(own)} may be {array}"] if own else []),
        *([f"{', '.join(torques)}: torque that the other parameters give at that joint, which the "
           f"caller computes; {array}"] if torques else []),
    ]  # fmt: skip


def _law_text(e: Element) -> str:
    """Write the torque law or energy law of an element, such as a nonlinear friction.

    The text is empty for the standard laws: inertia, linear friction, offset and spring.
    """
    if not e.is_own:
        return ""
    law = e.energy if e.energy is not None else e.torque or KINDS[e.kind].torque
    fixed = [f"{name} = {x.value:g}" for name, x in e.scalars.items() if x.fixed]
    free = [name for name, x in e.scalars.items() if not x.fixed]
    free = [f"{', '.join(free)} of each parameter"] if free else []
    said = f" ({'; '.join([*fixed, *free])})" if fixed or free else ""
    return f", {'energy' if e.energy is not None else 'torque'} {law}{said}"


def loop_lines(robot: Robot, closure: Closure) -> list[str]:
    """Describe the loops of the robot, and each passive joint as a function of the other joints."""
    lines = [f"frame {loop.twin} coincides with cut frame {loop.cut}" for loop in robot.loops]
    for j in robot.passive:
        if j in closure.tied:
            continue
        lines.append(
            f"q{j} = {closure.formula(j)}" + (" (declared)" if j in robot.constraints else "")
        )
    if closure.tied:
        start = ", ".join(f"q{j} = {closure.start[j]:.4g}" for j in closure.independent)
        lines.append(
            f"q{', q'.join(map(str, closure.tied))} from the closure equations by Newton; assembly "
            f"mode of {start}"
        )
    return lines


def _times(c: Any, name: str) -> str:
    return name if str(c) == "1" else f"{c}*{name}"


def _form_text(form: Mapping[tuple[int, int], Any]) -> str:
    parts = [
        _times(c * (1 if i == j else 2), f"q{i}**2" if i == j else f"q{i}*q{j}")
        for (i, j), c in sorted(form.items(), reverse=True)
        if i <= j
    ]
    return " + ".join(parts)


def tables(spec: ModuleSpec) -> list[str]:
    """Write the tables of the Python module: joints, constants, parameters, formulas and units."""
    robot, regrouping = spec.robot, spec.regrouping
    units = names("UNITS", [unit(robot, b.own) for b in regrouping.base])
    units[0] = units[0].replace("= ", "= dict(zip(BASE_PARAMETERS, ", 1)
    units[-1] += "))"
    return [
        f"SCHEMA = {1!r}",
        f"NAME = {robot.name!r}",
        f"SOURCE_SHA256 = {robot.sha256!r}",
        f"JOINTS = {robot.joints!r}",
        *_base(robot),
        *([f"PASSIVE = {robot.passive!r}"] if robot.passive else []),
        *(literal("LABELS", dict(robot.labels)) if robot.labels else []),
        *literal("CONSTANTS", dict(regrouping.constants)),
        *(f"{c} = {x!r}" for c, x in robot.constants.items() if c not in regrouping.constants),
        *names("BASE_PARAMETERS", regrouping.names),
        *names("STANDARD_PARAMETERS", robot.parameters),
        *names("NO_EFFECT", regrouping.no_effect),
        *by_line("FORMULAS", grouped(regrouping)),
        *units,
        *_structure(spec),
    ]


def _base(robot: Robot) -> list[str]:
    """Write the kind of a base that moves, and gravity in the axes of the world, m/s**2."""
    if not robot.base_moves:
        return []
    gravity = tuple(e.value(robot.constants) for e in robot.gravity)
    return [f"BASE = {robot.base!r}", f"GRAVITY = {gravity!r}"]


def data(spec: ModuleSpec) -> list[str]:
    """Write, as Python source, the drives, limits and parameter values from the robot file."""
    robot = spec.robot
    return [
        *_drives(robot),
        *literal("LIMITS", dict(robot.limits)),
        *literal("VALUES", dict(robot.values)),
        *(literal("FIT", fit) if (fit := scalars(robot)) else ()),
        *(literal("CHANNELS", read) if (read := channels(spec.regrouping)) else ()),
        *(
            literal("ANTECEDENTS", {f.j: f.ant for f in robot.frames})
            if "base_wrench_regressor" in spec.functions
            else ()
        ),
    ]


def scalars(robot: Robot) -> dict[str, tuple[tuple[float, float], int, str]]:
    """Collect the constants in torque laws that a fit may change, such as a Stribeck velocity.

    Return {constant: (bounds, number of starts of the fit, parameter)}.
    """
    return {
        f"{name}{j}": (x.bounds, x.grid, f"{e.family}{j}")
        for e in robot.elements
        for j in e.keys
        for name, x in e.scalars.items()
        if not x.fixed
    }


def channels(regrouping: Regrouping) -> dict[str, tuple[str, ...]]:
    """List, for each constant that varies with time, the base parameters that depend on it."""
    return {
        c: tuple(b.name for b in regrouping.base if b.own in read)
        for c, read in regrouping.robot.channels.items()
    }


def _drives(robot: Robot) -> list[str]:
    d = robot.drives
    if d is None:
        return ["DRIVES = None"]
    rows = [f"        {row!r}," for row in d.ratio]
    return [
        "DRIVES = {  # qm = ratio (q - offset), tau = ratio' (torque_constant * u)",
        "    'ratio': (",
        *rows,
        "    ),",
        f"    'offset': {d.offset!r},",
        *([] if d.torque_constant is None else [f"    'torque_constant': {d.torque_constant!r},"]),
        "}",
    ]


def _structure(spec: ModuleSpec) -> list[str]:
    rows = ['"' + "".join("x" if mark else "." for mark in row) + '",' for row in spec.structure]
    return [
        "# STRUCTURE[k, j]: whether base parameter k acts on "
        + ("row j" if spec.robot.base_is_free else "joint j"),
        'STRUCTURE = np.array([[mark == "x" for mark in row] for row in (',
        *(f"    {line}" for line in wrap(" ".join(rows), WIDTH - 4, break_long_words=False)),
        ")])",
    ]


def names(name: str, values: Sequence[str]) -> list[str]:
    """Write Python source that assigns a tuple of words to a name: `name = (...)`.

    A long tuple is written as one text that `split` divides, because this is shorter.
    """
    flat = f"{name} = {tuple(values)!r}"
    if len(flat) <= WIDTH:
        return [flat]
    return [f'{name} = tuple("""', *wrap(" ".join(values), WIDTH), '""".split())']


def by_line(name: str, values: Mapping[str, str]) -> list[str]:
    """Write Python source that assigns a dict of texts to a name, one entry per line."""
    lines = []
    for key, value in values.items():
        first, *more = wrap(value, WIDTH - 20, break_long_words=False) or [""]
        parts = [first, *(f" {part}" for part in more)]
        lines.append(f"    {key!r}: {parts[0]!r}" + ("," if not more else ""))
        lines += [f"        {part!r}" + ("," if part is parts[-1] else "") for part in parts[1:]]
    return [f"{name} = {{", *lines, "}"] if lines else [f"{name} = {{}}"]


def literal(name: str, value: Any) -> list[str]:
    """Write Python source that assigns a value to a name; a long value is broken between its
    entries.
    """
    return _literal(f"{name} = ", value, "")


def _literal(start: str, value: Any, end: str) -> list[str]:
    flat = f"{start}{value!r}{end}"
    if len(flat) <= WIDTH - 4 or not value:
        return [flat]
    if not isinstance(value, Mapping):
        return [f"{start}(", *packed([repr(v) for v in value]), f"){end}"]
    if any(isinstance(v, tuple) for v in value.values()):
        rows = [line for k, v in value.items() for line in _literal(f"{k!r}: ", v, ",")]
        return [f"{start}{{", *(f"    {row}" for row in rows), f"}}{end}"]
    return [f"{start}{{", *packed([f"{k!r}: {v!r}" for k, v in value.items()]), f"}}{end}"]


def plain(text: str) -> str:
    """Make a text safe within a docstring: replace line breaks, backslashes, triple quotes."""
    return (
        " ".join(text.replace("\\", "/").replace('"""', "'''").split(" "))
        .replace("\r", " ")
        .replace("\n", " ")
    )


def packed(entries: Sequence[str]) -> list[str]:
    """Write entries separated by commas, as many on each line as fit."""
    indent = "    "
    lines, line = [], indent
    for entry in entries:
        if len(line) + len(entry) + 1 > WIDTH - 4 and line.strip():
            lines.append(line.rstrip())
            line = indent
        line += entry + ", "
    return [*lines, line.rstrip()]


def wrap_text(text: str, indent: str, hanging: str | None = None) -> list[str]:
    """Break a text at spaces into lines of at most 100 columns.

    `indent` starts the first line, `hanging` the others (default: four spaces more).
    """
    more = indent + "    " if hanging is None else hanging
    return wrap(
        text,
        WIDTH,
        initial_indent=indent,
        subsequent_indent=more,
        break_long_words=False,
        break_on_hyphens=False,
    )
