"""The NumPy module: blocks that fill arrays of samples, public functions that feed them block by
block.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from symgen.derive.loop_equations import loop_system
from symgen.description.robot import PRISMATIC
from symgen.emit.header import data, literal, tables
from symgen.emit.printers import NUMPY, Section
from symgen.emit.python_target import Block, blocks_of, broken, context, element_lines
from symgen.emit.render import WIDTH, laid_out
from symgen.emit.spec import Function, ModuleSpec

BLOCK = 4096  # samples
IN_METRES = 0.01  # m: mechanisms in which no length is above are closed to 1e-16 m


def render(spec: ModuleSpec, *, command: str | None = None) -> str:
    """The NumPy module of `spec`. Same robot file, same version: same bytes."""
    blocks = blocks_of(spec, NUMPY)
    slides = bool(spec.tied) and any(
        spec.robot.frame(j).sigma == PRISMATIC for j in spec.derivation.closure.independent
    )
    return laid_out(
        "module.py",
        {
            **context(spec, command, NUMPY, "np.ndarray", blocks),
            "size": BLOCK,
            "turn": loop_system(spec.robot).turn() if spec.tied else None,
            "pace": f"{loop_system(spec.robot).pace():.2g}" if spec.tied else "",
            "joint": spec.robot.joints[0],
            "tables": [*tables(spec), *_loop_tables(spec, slides)],
            "data": [*literal("LINKS", spec.robot.links), *data(spec)],
            "slides": slides,
            "channels": spec.robot.channels,
            "closed": 1e-13 if spec.robot.longest > IN_METRES else 1e-16,
            "store_constants": list(constant_entries(spec.functions["regressor"], "zeros")),
            "elements": element_lines(spec.robot, NUMPY),
            "evaluated": {name: list(_evaluation(spec, b)) for name, b in blocks.items()},
            "blocks": [_laid_out(spec, b) for b in blocks.values() if b.function.computed],
        },
    )


def _loop_tables(spec: ModuleSpec, slides: bool) -> Iterator[str]:
    """The start of the loops and its assembly mode; a unit of motion for each independent joint
    where some slide: 1 rad, and the longest length of the robot file.
    """
    robot, closure = spec.robot, spec.derivation.closure
    if not spec.tied:
        return
    yield f"_START = {tuple(closure.start[j] for j in closure.independent)!r}"
    mode = loop_system(robot).mode()
    yield f"_MODE = {mode}  # sign of det J_u in the assembly mode of _START"
    if slides:
        kinds = [robot.frame(j).sigma for j in closure.independent]
        units = ", ".join(repr(robot.longest) if sigma == PRISMATIC else "1.0" for sigma in kinds)
        yield f"_UNITS = ({units},)  # rad; of slides the longest length, m"


def _evaluation(spec: ModuleSpec, block: Block) -> Iterator[str]:
    """Lines that make room for a result, write its constants and fill the rest from `states`."""
    f = block.function
    yield f"result = np.zeros(({', '.join(map(str, f.shape))}, len(states[0])))"
    yield from constant_entries(f, "result")
    if not f.computed:
        return  # nothing acts
    available = f.model.states
    if spec.tied:
        available = (*available, "G") if f.model.of_loops else ("q", "qd", "qdd", "G")
    read = ", ".join(f"states[{available.index(s)}]" for s in f.states)
    states = "states" if f.states == available else f"({read}{',' * (len(f.states) == 1)})"
    every = block.arguments[len(f.states) :]
    rest = "".join(f", {a}" for a in every if a not in spec.robot.channels)
    timed = [a for a in every if a in spec.robot.channels]
    channels = f", channels=({', '.join(timed)}{',' * (len(timed) == 1)})" if timed else ""
    yield f"_fill(_{f.model.name}_block, result, {states}{rest}{channels})"


def constant_entries(f: Function, result: str) -> Iterator[str]:
    """Assignments of the entries that are numbers other than zero, equal ones together."""
    by_value: dict[float, list[str]] = {}
    for place, value in f.preset:
        by_value.setdefault(value, []).append(f"{result}[{', '.join(map(str, place))}]")
    for value, targets in by_value.items():
        line = ""
        for target in targets:
            if len(line) + len(target) > WIDTH - 12:
                yield f"{line}{value}"
                line = ""
            line += f"{target} = "
        yield f"{line}{value}"


def _laid_out(spec: ModuleSpec, block: Block) -> dict[str, object]:
    f, sizes = block.function, spec.sizes

    def target(place: Sequence[int]) -> str:
        return f"{block.result}[{', '.join(map(str, place))}]"

    rows = {"G": sizes["m"] * sizes["n"]}
    read = "; ".join(f"{s} ({rows.get(s, sizes['k'])}, N)" for s in f.states)
    states, rest = block.arguments[: len(f.states)], block.arguments[len(f.states) :]
    shape = f"({', '.join(map(str, f.shape))}, N)"
    return {
        "name": f"_{f.model.name}_block",
        "arguments": ", ".join([*states, block.result, *rest]),
        "summary": f"Fill {block.result}, shape {shape}, where it is not constant"
        + (f", from {read}." if read else "."),
        "sections": [
            Section(s.title, tuple(broken(s.lines))) for s in block.sections(block.results(target))
        ],
    }
