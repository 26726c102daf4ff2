"""The NumPy module: blocks that fill arrays of samples, public functions that feed them block by block."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.derive.loop_equations import loop_system
from symgen.derive.loops import close
from symgen.description.robot import PRISMATIC, Robot
from symgen.emit.header import literal, tables
from symgen.emit.python_target import arguments, context, element_lines
from symgen.emit.render import python_module
from symgen.emit.spec import WIDTH, Function, ModuleSpec
from symgen.regroup.formula import Python

BLOCK = 4096  # samples
LANGUAGE = Python("np")


def render(spec: ModuleSpec, *, command: str | None = None) -> str:
    """The NumPy module of `spec`. Same robot file, same version: same bytes."""
    robot = spec.robot
    start = [close(robot).start[j] for j in close(robot).independent] if spec.tied else []
    units = units_of_joints(robot) if spec.tied else ()
    mode = f"_MODE = {loop_system(robot).mode()}  # sign of det J_u in the assembly mode of _START" if spec.tied else ""
    return python_module(
        "module.py",
        {
            **context(spec, command, LANGUAGE, "np.ndarray"),
            "size": BLOCK,
            "turn": loop_system(robot).turn() if spec.tied else None,
            "joint": robot.joints[0],
            "tables": [*tables(spec), *literal("LINKS", robot.links), *([f"_START = {tuple(start)!r}", mode] if start else []), *units],
            "slides": bool(units),
            "store_constants": list(constant_entries(spec.functions["regressor"], "S")),
            "elements": element_lines(robot, LANGUAGE),
            "evaluated": {name: list(_evaluation(spec, f)) for name, f in spec.functions.items()},
            "blocks": [_block(spec, f) for f in spec.functions.values() if f.sections],
        },
        robot.constants,
        {f.model.result for f in spec.functions.values()},
    )


def units_of_joints(robot: Robot) -> tuple[str, ...]:
    """Source of a unit of motion for each independent joint where some slide: 1 rad, and the longest length of the robot file."""
    kinds = [robot.frame(j).sigma for j in close(robot).independent]
    longest = max(abs(e.value(robot.constants)) for f in robot.frames for e in (f.b, f.d, f.r0))
    units = ", ".join(repr(longest) if sigma == PRISMATIC else "1.0" for sigma in kinds)
    return (f"_UNITS = ({units},)  # rad; of slides the longest length, m",) if PRISMATIC in kinds else ()


def _evaluation(spec: ModuleSpec, f: Function) -> Iterator[str]:
    """Lines that make room for a result, write its constants and fill the rest from `states`."""
    shape = ", ".join(map(str, f.model.shape(spec.robot, len(spec.regrouping))))
    yield f"{f.model.result} = np.zeros(({shape}, len(states[0])))"
    yield from constant_entries(f)
    if not f.sections:
        return  # nothing acts
    available = (
        (*f.model.states, "G") if f.model.name in ("closure", "curvature") else ("q", "qd", "qdd", "G") if spec.tied else f.model.states
    )
    read = ", ".join(f"states[{available.index(s)}]" for s in f.states) + "," * (len(f.states) == 1)
    states = "states" if f.states == available else f"({read})"
    rest = "".join(f", {a}" for a in arguments(f)[len(f.states) :])
    yield f"_fill(_{f.model.name}_block, {f.model.result}, {states}{rest})"


def constant_entries(f: Function, result: str = "") -> Iterator[str]:
    """Assignments of the entries that are numbers other than zero, equal ones together."""
    by_value: dict[float, list[str]] = {}
    for place, value in f.preset:
        by_value.setdefault(value, []).append(f"{result or f.model.result}[{', '.join(map(str, place))}]")
    for value, targets in by_value.items():
        line = ""
        for target in targets:
            if len(line) + len(target) > WIDTH - 12:
                yield f"{line}{value}"
                line = ""
            line += f"{target} = "
        yield f"{line}{value}"


def _block(spec: ModuleSpec, f: Function) -> dict[str, object]:
    shape = ", ".join(map(str, f.model.shape(spec.robot, len(spec.regrouping))))
    rows = {"G": spec.sizes["m"] * spec.sizes["n"]}
    read = "; ".join(f"{s} ({rows.get(s, spec.sizes['k'])}, N)" for s in f.states)
    return {
        "name": f"_{f.model.name}_block",
        "arguments": ", ".join([*f.states, f.model.result, *arguments(f)[len(f.states) :]]),
        "summary": f"Fill {f.model.result}, shape ({shape}, N), where it is not constant{f', from {read}' if read else ''}.",
        "sections": f.sections,
    }
