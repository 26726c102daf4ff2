"""The header of an emitted module, and its tables: what a reader needs before the first line of code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Any

from symgen.derive.columns import element_names
from symgen.derive.loops import close
from symgen.derive.names import FAMILIES
from symgen.description.robot import FIXED, Robot
from symgen.emit.spec import WIDTH, ModuleSpec, unit
from symgen.regroup.regrouping import Regrouping

COLUMNS = ("j", "ant", "mu", "sigma", "gamma", "b", "alpha", "d", "theta", "r")


def header(spec: ModuleSpec) -> list[str]:
    """Lines of the module docstring below the command."""
    robot, regrouping = spec.robot, spec.regrouping
    gravity = ", ".join(str(e) for e in robot.gravity)
    lines = [
        "",
        "Modified Denavit-Hartenberg, Khalil and Kleinfinger (1986); q in the order of JOINTS",
        *(f"    {line}" for line in frame_table(robot)),
        f"Gravity     acceleration ({gravity}) in frame 0, m/s**2",
        "Torques     delivered by the actuators, so friction enters with a plus: Gamma = A*qdd + H + FV*qd + FS*sign(qd) + OFFSET",
        "Parameters  XX..ZZ inertia tensor about the origin of the link frame (XY = -integral x*y dm), MX MY MZ first moments",
        *(f"Element     {line}" for line in element_lines(robot)),
        *(f"Loop        {line}" for line in loop_lines(robot)),
        "",
        f"Base parameters, {len(regrouping)} of {len(robot.parameters)}; Gautier and Khalil (1990), {regrouping.method}",
    ]
    alone = [b.name for b in regrouping.base if b.name == b.own]
    for b in regrouping.base:
        if b.name != b.own:
            lines += wrapped(f"{b.name} = {b.formula}", "    ")
    if alone:
        lines += wrapped("as they are: " + " ".join(alone), "    ")
    lines += wrapped("No effect: " + (" ".join(regrouping.no_effect) or "none"), "")
    absorbing = one_sided_friction_that_absorbs(regrouping)
    if absorbing:
        lines += wrapped(
            f"In motion only: {' '.join(absorbing)} take in a constant force that no offset tells from friction; at rest, "
            "in `gravity` and in `bias` at qd = 0, that force is missing.",
            "",
        )
    lines += [
        "",
        "Names       family, then component digits, then link: W12 is component 1 of link 2, U312 row 3 column 1; p plus, m minus in sums",
    ]
    lines += [f"    {family:<4} {FAMILIES[family]}" for family in families(spec)]
    return [*lines, "", "Cost per sample", *(f"    {name:<17} {f.cost}" for name, f in spec.functions.items())]


def families(spec: ModuleSpec) -> list[str]:
    """Families of the names in any block, in the order of FAMILIES."""
    occurring = {family for f in spec.functions.values() for family in f.families} | {"GAM", "DG"}
    return [family for family in FAMILIES if family in occurring]


def one_sided_friction_that_absorbs(regrouping: Regrouping) -> list[str]:
    """Base parameters of one-sided Coulomb friction that stand for a weight too: D_FSP - D_FSN = 1 in motion, 0 at rest."""
    elements = element_names(regrouping.robot)
    return [b.name for b in regrouping.base if b.name != b.own and b.own in elements and elements[b.own][0].when]


def frame_table(robot: Robot) -> list[str]:
    """The rows of the frame table, aligned; columns that are zero everywhere are left out, except the classical six."""
    kept = informative_columns(robot)
    table = [list(kept), *([str(getattr(f, c)) for c in kept] for f in robot.frames)]
    if robot.labels:
        table = [[*row, label] for row, label in zip(table, ["label", *(robot.labels.get(f.j, "") for f in robot.frames)], strict=True)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in table]


def informative_columns(robot: Robot) -> tuple[str, ...]:
    """The classical six with j and ant, and of the others those that say something."""
    said = {
        "mu": any(not f.mu for f in robot.frames if f.sigma != FIXED),
        "gamma": any(f.gamma for f in robot.frames),
        "b": any(f.b for f in robot.frames),
    }
    return tuple(c for c in COLUMNS if said.get(c, True))


def element_lines(robot: Robot) -> list[str]:
    """One line per element family: which rows or forms its parameters act along."""
    lines = []
    for e in robot.elements:
        rows = {j: " + ".join(_times(c, f"q{i}") for i, c in row.items()) for j, row in e.along.items()}
        own = [j for j in rows if rows[j] == f"q{j}"]
        parts = []
        if own:
            parts.append(f"along q{', q'.join(map(str, own))}")
        parts += [f"{e.family}{j} along {rows[j]}" for j in rows if j not in own]
        parts += [f"{e.family}{j} in the form {_form_text(form)}" for j, form in e.form.items()]
        when = f", {e.when} motion only" if e.when else ""
        lines += wrapped(f"{e.family:<7} {e.kind}{when}: {'; '.join(parts)}", "", "            ")
    return lines


def loop_lines(robot: Robot) -> list[str]:
    """The loops, and every passive joint as a function of others."""
    closure = close(robot)
    lines = [f"frame {loop.twin} coincides with cut frame {loop.cut}" for loop in robot.loops]
    for j in robot.passive:
        if j in closure.tied:
            continue
        lines.append(f"q{j} = {closure.formula(j)}" + (" (declared)" if j in robot.constraints else ""))
    if closure.tied:
        start = ", ".join(f"q{j} = {closure.start[j]:.4g}" for j in closure.independent)
        lines.append(f"q{', q'.join(map(str, closure.tied))} from the closure equations by Newton; assembly mode of {start}")
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


def tables(spec: ModuleSpec, *, numpy: bool = True) -> list[str]:
    """The constants of the module, as Python source; STRUCTURE as an array where the module has `numpy`, else as a tuple of rows."""
    robot, regrouping = spec.robot, spec.regrouping
    return [
        f"SCHEMA = {1!r}",
        f"NAME = {robot.name!r}",
        f"SOURCE_SHA256 = {robot.sha256!r}",
        f"JOINTS = {robot.joints!r}",
        *([f"PASSIVE = {robot.passive!r}"] if robot.passive else []),
        *(literal("LABELS", dict(robot.labels)) if robot.labels else []),
        *literal("CONSTANTS", dict(robot.constants)),
        *literal("BASE_PARAMETERS", regrouping.names),
        *literal("STANDARD_PARAMETERS", robot.parameters),
        *literal("UNITS", {b.name: unit(robot, b.own) for b in regrouping.base}),
        *literal("FORMULAS", {b.name: str(b.formula) for b in regrouping.base}),
        *literal("NO_EFFECT", regrouping.no_effect),
        *_structure(spec, numpy),
        *_drives(robot),
        *literal("LIMITS", dict(robot.limits)),
        *literal("VALUES", dict(robot.values)),
    ]


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
        f"    'torque_constant': {d.torque_constant!r},",
        "}",
    ]


def _structure(spec: ModuleSpec, numpy: bool) -> list[str]:
    marks = 'mark == "x" for mark in row'
    first, last = (f"np.array([[{marks}] for row in (", ")])") if numpy else (f"tuple(tuple({marks}) for row in (", "))")
    rows = ['"' + "".join("x" if mark else "." for mark in row) + '",' for row in spec.structure]
    return [
        f"STRUCTURE = {first}  # [k, j]: whether base parameter k acts on joint j",
        *(f"    {line}" for line in wrap(" ".join(rows), WIDTH - 4, break_long_words=False)),
        last,
    ]


def literal(name: str, value: Any) -> list[str]:
    """`name = value` as Python source, wrapped entry by entry."""
    flat = f"{name} = {value!r}"
    if len(flat) <= WIDTH or not value:
        return [flat]
    if isinstance(value, Mapping):
        entries, opening, closing = [f"{k!r}: {v!r}" for k, v in value.items()], "{", "}"
    else:
        entries, opening, closing = [repr(v) for v in value], "(", ")"
    return [f"{name} = {opening}", *packed(entries), closing]


def plain(text: str) -> str:
    """Text that cannot end a docstring."""
    return " ".join(text.replace("\\", "/").replace('"""', "'''").split(" ")).replace("\r", " ").replace("\n", " ")


def packed(entries: Sequence[str], indent: str = "    ") -> list[str]:
    """Entries separated by commas, as many on a line as fit."""
    lines, line = [], indent
    for entry in entries:
        if len(line) + len(entry) + 1 > WIDTH and line.strip():
            lines.append(line.rstrip())
            line = indent
        line += entry + ", "
    return [*lines, line.rstrip()]


def wrapped(text: str, indent: str, hanging: str | None = None) -> list[str]:
    """Text broken at spaces."""
    more = indent + "    " if hanging is None else hanging
    return wrap(text, WIDTH, initial_indent=indent, subsequent_indent=more, break_long_words=False, break_on_hyphens=False)
