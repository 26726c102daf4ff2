"""The CasADi module: the same sections as statements on SX scalars, gathered into matrices.

The blocks receive lists of scalars, so that `q1, q2 = q` reads as in the NumPy module; a sparse matrix takes the results, so that structural
zeros stay structural in the functions and in their derivatives. Joints that only the closure equations tie have no CasADi module: they are
found by a Newton iteration along the record, in the assembly mode of its start, which no single expression of q says.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from symgen.derive.graph import COS, SIGN, SIN, SQRT
from symgen.description.robot import Robot
from symgen.emit.header import tables
from symgen.emit.models import MODELS
from symgen.emit.printers import Text
from symgen.emit.python_target import arguments, constants_of, context, listed
from symgen.emit.render import python_module
from symgen.emit.spec import Function, ModuleSpec, module_spec
from symgen.errors import SymgenError
from symgen.regroup.formula import Python
from symgen.regroup.regrouping import Regrouping, sign_conditions

LANGUAGE = Python("ca")


class CasadiText(Text):
    """The lines of one model on SX scalars; a stack of matrices is a list of them."""

    calls: ClassVar[dict[str, str]] = {COS: "ca.cos", SIN: "ca.sin", SIGN: "ca.sign", SQRT: "ca.sqrt"}
    pi: ClassVar[str] = "ca.pi"

    def _clipped(self, x: str, bound: str) -> str:
        return f"ca.{'fmax' if bound == 'maximum' else 'fmin'}({x}, 0.0)"

    def place(self, result: str, indices: Sequence[int]) -> str:
        *stack, row, column = indices if len(indices) > 1 else (*indices, 0)
        return f"{result}{''.join(f'[{k}]' for k in stack)}[{row}, {column}]"


def render(regrouping: Regrouping, *, command: str | None = None) -> str:
    """The CasADi module of a robot. Same robot file, same version: same bytes."""
    robot, spec = regrouping.robot, module_spec(regrouping, CasadiText)
    check_labels(robot)
    values = context(spec, command, LANGUAGE, "ca.SX")
    functions = spec.functions
    coefficients = [c.symbols for b in regrouping.base for c in b.combination.values()]
    coefficients += [ratio.symbols for _, ratio, _ in sign_conditions(regrouping)]
    dynamics = {*arguments(functions["inertia_matrix"]), *arguments(functions["bias"]), "tau"}
    takes = {
        **{name: arguments(f) for name, f in functions.items()},
        "base_parameters": ["standard", *constants_of(robot, *coefficients)],
        "forward_dynamics": [a for a in (*MODELS["forward_dynamics"].arguments, *robot.constants) if a in dynamics],
        "passive_joints": ["q", "qd", "qdd", *values["passive_constants"]],
        "jacobian": ["q", *constants_of(robot, functions["frame_poses"].constants, values["path_constants"])],
    }
    return python_module(
        "casadi.py",
        {
            **values,
            "takes": takes,
            "calls": {name: ", ".join(names) for name, names in takes.items()},
            "tables": tables(spec, numpy=False),
            "example": "".join(f", {name}={value!r}" for name, value in list(robot.constants.items())[:1]),
            "labels": {name: [m.result] for name, m in MODELS.items()} | {"frame_poses": pose_labels(robot)},
            "blocks": [_block(spec, f) for f in functions.values()],
            "of_frame": listed(takes["jacobian"]),
            "passive_constants": listed(takes["passive_joints"][3:]),
        },
        robot.constants,
        {f.model.result for f in functions.values()},
    )


def _block(spec: ModuleSpec, f: Function) -> dict[str, object]:
    *stack, rows, columns = shape = (
        f.model.shape(spec.robot, len(spec.regrouping))[:3] if len(f.model.axes) > 1 else (len(spec.robot.joints), 1)
    )
    matrix = f"ca.SX({rows}, {columns})"
    text = CasadiText((), (), ())
    regressor = f.model.name == "regressor"
    return {
        "name": f"_{f.model.name}",
        "arguments": ", ".join(arguments(f)),
        "summary": f"{f.model.summary}. Shape {shape[::-1] if regressor else shape}.",
        "room": f"{f.model.result} = " + (f"[{matrix} for _ in range({stack[0]})]" if stack else matrix),
        "preset": [f"{text.place(f.model.result, place)} = {value}" for place, value in f.preset],
        "sections": f.sections,
        "returned": f.model.result + (".T" if regressor else ""),
    }


def pose_labels(robot: Robot) -> list[str]:
    """Names of the results of `frame_poses`."""
    return [f"T{f.j}" for f in robot.frames]


def check_labels(robot: Robot) -> None:
    """SymgenError where a constant has the name of a result: CasADi calls inputs and results by name."""
    labels = {"GAM", "J", "ca", "q_passive", "qd_passive", "qdd_passive", *pose_labels(robot)}
    if clash := sorted(labels & robot.constants.keys()):
        raise SymgenError(f"constant {', '.join(clash)}: the CasADi module calls something else so; rename it in the robot file")
