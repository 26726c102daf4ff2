"""The CasADi module: the same lines on SX scalars, gathered into matrices.

The blocks receive lists of scalars, so that `q1, q2 = q` reads as in the NumPy module; a sparse
matrix takes the results, so that structural zeros stay structural in the functions and in their
derivatives. Joints that only the closure equations tie have no CasADi module: they are found by a
Newton iteration along the record, in the assembly mode of its start, which no single expression of
q says.
"""

from __future__ import annotations

from collections.abc import Sequence

from symgen.derive.models import MODELS
from symgen.emit.header import data, tables
from symgen.emit.printers import CASADI, Section
from symgen.emit.python_target import Block, blocks_of, broken, constants_of, context, listed
from symgen.emit.render import laid_out
from symgen.emit.spec import ModuleSpec
from symgen.regroup.regrouping import sign_conditions


def render(spec: ModuleSpec, *, command: str | None = None) -> str:
    """The CasADi module of a robot. Same robot file, same version: same bytes."""
    robot, regrouping, free = spec.robot, spec.regrouping, spec.regrouping.constants
    blocks = blocks_of(spec, CASADI)
    what = "base parameters, regressor, dynamics as CasADi functions"
    values = context(spec, command, CASADI, "ca.SX", blocks, what=what)
    coefficients = [c.symbols for b in regrouping.base for c in b.combination.values()]
    coefficients += [ratio.symbols for _, ratio, _ in sign_conditions(regrouping)]
    dynamics = {*blocks["inertia_matrix"].arguments, *blocks["bias"].arguments, "tau"}
    reads = MODELS["forward_dynamics"].arguments
    takes = {
        **values["takes"],
        "base_parameters": ["standard", *constants_of(regrouping, *coefficients)],
        "forward_dynamics": [a for a in (*reads, *free) if a in dynamics],
        "passive_joints": ["q", "qd", "qdd", *values["passive_constants"]],
        "jacobian": [
            "q",
            *constants_of(regrouping, blocks["frame_poses"].constants, values["path_constants"]),
        ],
    }
    example = "".join(f", {name}={value!r}" for name, value in list(free.items())[:1])
    names = spec.names()
    poses = [names.own(f"T{f.j}") for f in robot.frames]
    models = values["models"]
    own = {result: names.own(result) for result in {m.result: None for m in models.values()}}
    labels = {name: [own[m.result]] for name, m in models.items()}
    return laid_out(
        "casadi.py",
        {
            **values,
            "takes": takes,
            "calls": {name: ", ".join(taken) for name, taken in takes.items()},
            "tables": tables(spec, numpy=False),
            "data": data(spec),
            "example": example,
            "labels": labels | {"frame_poses": poses},
            "blocks": [_laid_out(spec, block) for block in blocks.values()],
            "of_frame": listed(takes["jacobian"]),
            "passive_constants": listed(takes["passive_joints"][3:]),
        },
    )


def _laid_out(spec: ModuleSpec, block: Block) -> dict[str, object]:
    f, result = block.function, block.result
    *stack, rows, columns = shape = (*f.shape, 1) if len(f.shape) == 1 else f.shape

    def target(place: Sequence[int]) -> str:
        *outer, row, column = place if len(place) > 1 else (*place, 0)
        return f"{result}{''.join(f'[{k}]' for k in outer)}[{row}, {column}]"

    matrix = f"ca.SX({rows}, {columns})"
    transposed = f.model.by_columns
    return {
        "name": f"_{f.model.name}",
        "arguments": ", ".join(block.arguments),
        "summary": f.model.summary,
        "shape": shape[::-1] if transposed else shape,
        "room": f"{result} = " + (f"[{matrix} for _ in range({stack[0]})]" if stack else matrix),
        "preset": [f"{target(place)} = {value}" for place, value in f.preset],
        "sections": [
            Section(s.title, tuple(broken(s.lines))) for s in block.sections(block.results(target))
        ],
        "returned": result + (".T" if transposed else ""),
    }
