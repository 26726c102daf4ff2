"""From a module specification to text: the only place where jinja2 lays out an emitted module."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from textwrap import wrap

from jinja2 import Environment, PackageLoader, StrictUndefined

from symgen.derive.loop_equations import loop_system
from symgen.derive.loops import close
from symgen.description.robot import FIXED, Robot
from symgen.emit.c_target import ABI, c_spec, layout, signals_layout
from symgen.emit.casadi_target import blocks, check_labels, pose_labels
from symgen.emit.header import header, literal, packed, tables
from symgen.emit.physical import physical_tables
from symgen.emit.printers import Section
from symgen.emit.spec import WIDTH, ModuleSpec
from symgen.emit.xp_target import array_spec, passive_rows
from symgen.regroup.regrouping import formula
from symgen.version import VERSION

BLOCK = 4096
SUMMARIES = {
    "regressor": ("q, qd, qdd, D", "Fill D, shape ({b}, {n}, N): Gamma_j = sum_k D[k, j] X[k]. q, qd, qdd: ({k}, N)."),
    "inverse_dynamics": ("q, qd, qdd, GAM, X", "Fill GAM, shape ({n}, N). q, qd, qdd: ({k}, N)."),
    "inertia_matrix": (
        "q, A, X",
        "Fill A, shape ({n}, {n}, N): column i is Gamma for a unit acceleration of joint i from rest. q: ({k}, N).",
    ),
    "bias": ("q, qd, GAM, X", "Fill GAM, shape ({n}, N), for qdd = 0. q, qd: ({k}, N)."),
    "gravity": ("q, GAM, X", "Fill GAM, shape ({n}, N), at rest. q: ({k}, N)."),
    "frame_poses": ("q, T", "Fill T, shape ({frames}, 4, 4, N). q: ({k}, N)."),
}
LOOP_SUMMARIES = {
    "closure": ("q, R", "Fill R, shape ({m}, 1 + {k}, N): closure residuals, then their derivatives by the joints. q: ({k}, N)."),
    "curvature": (
        "q, qd, B",
        "Fill B, shape ({m} + {loops}, N): second derivatives of the residuals at constant rates, then traces of A_cut' A_twin. q, qd: ({k}, N).",
    ),
}


@lru_cache(maxsize=1)
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("symgen.emit"), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )


def render(spec: ModuleSpec, *, command: str | None = None) -> str:
    """The NumPy module of `spec`. Same robot file, same version: same bytes."""
    sizes, constants = _sizes(spec), list(spec.robot.constants)
    context = {
        **_context(spec, command),
        **_keywords(spec.robot),
        "size": BLOCK,
        "turn": loop_system(spec.robot).turn() if spec.tied else None,
        "joint": spec.robot.joints[0],
        "tables": [*tables(spec), *physical_tables(spec.robot), *_paths(spec.robot)],
        "constant_entries": spec.constant_entries,
        "blocks": [_block(name, spec, sizes, constants) for name in (*SUMMARIES, *(LOOP_SUMMARIES if spec.tied else ()))],
    }
    return _environment().get_template("module.py.jinja").render(context)


def render_casadi(spec: ModuleSpec, *, command: str | None = None) -> str:
    """The CasADi module of a `spec` printed by `CasadiText`. Same robot file, same version: same bytes."""
    robot = spec.robot
    check_labels(robot)
    context = {
        **_context(spec, command, package="ca"),
        "tables": [*tables(spec, numpy=False), *_paths(robot)],
        "example": "".join(f", {name}={value!r}" for name, value in list(robot.constants.items())[:1]),
        "pose_labels": ", ".join(f'"{label}"' for label in pose_labels(robot)),
        "blocks": blocks(spec),
    }
    return _environment().get_template("casadi.py.jinja").render(context)


def render_xp(spec: ModuleSpec, *, command: str | None = None) -> str:
    """The array-API module of `spec`. Same robot file, same version: same bytes."""
    context = {
        **_context(spec, command),
        **_keywords(spec.robot),
        **vars(array_spec(spec.regrouping)),
        "tables": [*tables(spec, numpy=False), *_paths(spec.robot)],
        "passive_rows": passive_rows(spec.robot),
    }
    return _environment().get_template("xp.py.jinja").render(context)


def render_use(program: str, context: Mapping[str, object]) -> str:
    """Text of the script that uses a robot in another program."""
    return _environment().get_template(f"use_{program}.py.jinja").render(context)


def _keywords(robot: Robot) -> dict[str, str]:
    """The constants of the robot in signatures and calls."""
    defaults = "".join(f", {name}={value!r}" for name, value in robot.constants.items())
    passed = "".join(f", {name}={name}" for name in robot.constants)
    return {"passed": passed, "defaults": defaults, "keywords": ", *" + defaults if defaults else ""}


def _sizes(spec: ModuleSpec) -> dict[str, int]:
    robot, closure = spec.robot, close(spec.robot)
    return {
        "n": len(robot.joints),
        "m": len(closure.tied),
        "k": len(closure.independent),
        "b": len(spec.regrouping),
        "frames": len(robot.frames),
        "loops": sum(loop.cut in closure.tied for loop in robot.loops),
        "p": len(robot.parameters),
    }


def _context(spec: ModuleSpec, command: str | None, *, package: str = "np") -> dict[str, object]:
    """What Python modules of every array package share."""
    robot = spec.robot
    return {
        **_sizes(spec),
        "title": plain(robot.title or robot.name),
        "file": plain(robot.file or robot.name),
        "sha256": robot.sha256,
        "version": VERSION,
        "command": plain(command or robot.file or robot.name),
        "header": [plain(line) for line in header(spec)],
        "general": bool(spec.tied),
        "passive": bool(robot.passive),
        "passive_rows": _passive_rows(robot, package),
        "constants": "".join(f", {name}" for name in robot.constants),
        "unpack": _unpack(robot),
        "formulas": [f"{b.name} = {_code(formula(b.combination), package)}" for b in spec.regrouping.base if b.name != b.own],
        "packed": packed(list(spec.regrouping.names)),
    }


def render_c(spec: ModuleSpec, *, command: str | None = None) -> str:
    """The C file of `spec`. Same robot file, same version: same bytes."""
    robot, c = spec.robot, c_spec(spec)
    lines = [line for kernel in c.kernels for section in (*kernel.sections, Section("", kernel.before)) for line in section.lines]
    context = {
        "title": _comment(robot.title or robot.name),
        "file": _comment(robot.file or robot.name),
        "sha256": robot.sha256,
        "version": VERSION,
        "command": _comment(command or robot.file or robot.name),
        "header": [_comment(line) for line in c.header],
        "name": robot.name,
        "abi": ABI,
        "n": c.joints,
        "tile": c.tile,
        "kernels": layout(c),
        "signals": signals_layout(c),
        "helpers": {name: any(f"{name}(" in line for line in lines) for name in ("sign", "above", "below")},
    }
    return _environment().get_template("kernels.c.jinja").render(context)


def _comment(text: str) -> str:
    """Text that cannot end a C comment, start another or continue a line."""
    shown = "".join(c if c.isprintable() else " " for c in plain(text))
    return re.sub(r"\*(?=/)|/(?=\*)|\?(?=\?)", r"\g<0> ", shown)


def plain(text: str) -> str:
    """Text that cannot end a docstring."""
    return " ".join(text.replace("\\", "/").replace('"""', "'''").split(" ")).replace("\r", " ").replace("\n", " ")


def _block(name: str, spec: ModuleSpec, sizes: dict[str, int], constants: list[str]) -> dict[str, object]:
    arguments, summary = (SUMMARIES | LOOP_SUMMARIES)[name]
    if spec.tied and name in SUMMARIES:  # every state of the closed mechanism
        arguments = "q, qd, qdd, G, " + arguments.replace("qdd, ", "").replace("qd, ", "").replace("q, ", "")
        summary = summary.split(" q: ")[0].split(" q, qd")[0] + " q, qd, qdd: ({k}, N); G: ({m}*{n}, N)."
    sections = getattr(spec, name).sections or (Section("Nothing acts", ("pass",)),)
    return {
        "name": f"_{name}_block",
        "arguments": ", ".join([arguments, *constants]),
        "summary": summary.format(**sizes),
        "sections": sections,
    }


def _passive_rows(robot: Robot, package: str) -> dict[str, list[str]]:
    """The passive joints as rows over the independent ones: rates and constants, as source."""
    closure = close(robot)
    rows, offsets = [], []
    for j in robot.passive:
        row = closure.row[j]
        rows.append("[" + ", ".join(_code(str(row[i]), package) if i in row else "0" for i in closure.independent) + "],")
        offsets.append(_code(str(closure.offset[j]), package))
    return {"rates": rows, "offsets": [f"[{', '.join(offsets)}]"]}


def _unpack(robot: Robot) -> list[str]:
    text = ", ".join(robot.parameters) + ("," if len(robot.parameters) == 1 else "")
    return ["(", *(f"    {line}" for line in wrap(text, WIDTH - 8)), ") = standard"]


def _code(text: str, package: str) -> str:
    """A formula of the common grammar as source of an array package."""
    return re.sub(r"\b(cos|sin|sqrt)\(|\bpi\b", lambda match: f"{package}.{match.group(0)}", text)


def _paths(robot: Robot) -> list[str]:
    """{frame: ((joint, sigma, ((column, rate), ...)), ...)}: the moving joints below each frame and how the actuated ones move them."""
    closure = close(robot)
    column = {j: k for k, j in enumerate(closure.independent)}
    paths = {}
    for f in robot.frames:
        moving = [robot.frame(i) for i in robot.path(f.j) if robot.frame(i).sigma != FIXED]
        paths[f.j] = tuple(
            (m.j, m.sigma, tuple((column[i], float(g.value(robot.constants))) for i, g in closure.row[m.j].items())) for m in moving
        )
    if not closure.tied:
        return literal("_PATHS", paths)
    start = [f"_START = {tuple(closure.start[j] for j in closure.independent)!r}"]
    return [*literal("_PATHS", paths), *start, f"_MODE = {loop_system(robot).mode()}  # sign of det J_u in the assembly mode of _START"]
