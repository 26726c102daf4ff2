"""What a CasADi module says beside the NumPy module: the same sections as statements on SX scalars, gathered into matrices.

The blocks receive lists of scalars, so that `q1, q2 = q` reads as in the NumPy module; a sparse matrix takes the results, so that structural
zeros stay structural in the functions and in their derivatives. Joints that only the closure equations tie have no CasADi module: they are
found by a Newton iteration along the record, in the assembly mode of its start, which no single expression of q says.
"""

from __future__ import annotations

from typing import ClassVar

from symgen.derive.graph import COS, SIGN, SIN, SQRT
from symgen.description.robot import Robot
from symgen.emit.printers import Section, Text
from symgen.emit.spec import ModuleSpec
from symgen.errors import SymgenError

BLOCKS = {  # columns read, room for the result, what is returned, summary
    "regressor": ("q, qd, qdd", "D = ca.SX({b}, {n})", "D.T", "D, shape ({n}, {b}), Gamma = D X."),
    "inverse_dynamics": ("q, qd, qdd, X", "GAM = ca.SX({n}, 1)", "GAM", "Joint torques Gamma."),
    "inertia_matrix": ("q, X", "A = ca.SX({n}, {n})", "A", "A(q): column i is Gamma for a unit acceleration of joint i from rest."),
    "bias": ("q, qd, X", "GAM = ca.SX({n}, 1)", "GAM", "Gamma at qdd = 0: Coriolis, centrifugal, gravity, friction and offset."),
    "gravity": ("q, X", "GAM = ca.SX({n}, 1)", "GAM", "Gamma at rest without friction: gravity, offset and springs."),
    "frame_poses": ("q", "T = {{}}", "_poses(T)", "Homogeneous transform of every frame j in frame 0."),
}


class CasadiText(Text):
    """The lines of one model on SX scalars."""

    calls: ClassVar[dict[str, str]] = {COS: "ca.cos", SIN: "ca.sin", SIGN: "ca.sign", SQRT: "ca.sqrt"}
    pi: ClassVar[str] = "ca.pi"

    def _clipped(self, x: str, bound: str) -> str:
        return f"ca.{'fmax' if bound == 'maximum' else 'fmin'}({x}, 0.0)"


def blocks(spec: ModuleSpec) -> list[dict[str, object]]:
    """The models, each with its signature, the matrix it fills and what it returns."""
    robot = spec.robot
    sizes = {"n": len(robot.joints), "b": len(spec.regrouping)}
    found: list[dict[str, object]] = []
    for name, (columns, room, returned, summary) in BLOCKS.items():
        preset = spec.constant_entries if name == "regressor" else ()
        found.append(
            {
                "name": f"_{name}",
                "arguments": ", ".join([columns, *robot.constants]),
                "summary": summary.format(**sizes),
                "room": room.format(**sizes),
                "preset": [f"D[{k}, {j}] = {value}" for k, j, value in preset],
                "sections": getattr(spec, name).sections or (Section("Nothing acts", ()),),
                "returned": returned,
            }
        )
    return found


def pose_labels(robot: Robot) -> list[str]:
    """Names of the results of `frame_poses`."""
    return [f"T{f.j}" for f in robot.frames]


def check_labels(robot: Robot) -> None:
    """SymgenError where a constant has the name of a result: CasADi calls inputs and results by name."""
    labels = {"GAM", "J", "ca", "q_passive", "qd_passive", "qdd_passive", *pose_labels(robot)}
    if clash := sorted(labels & robot.constants.keys()):
        raise SymgenError(f"constant {', '.join(clash)}: the CasADi module calls something else so; rename it in the robot file")
