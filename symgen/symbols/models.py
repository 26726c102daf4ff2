"""The models that can be had as symbols: one table, and how each is derived as entries of a graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from symgen.derive.columns import columns
from symgen.derive.elements import element_column
from symgen.derive.kinematics import frame_poses
from symgen.derive.loop_equations import LoopSystem, loop_system
from symgen.derive.newton_euler import Motion, joint_torques
from symgen.derive.regressor import Axes
from symgen.derive.scalar import Scalar, Vector, add, mul
from symgen.errors import SymgenError
from symgen.symbols.derivation import Derivation
from symgen.symbols.frames import Frames
from symgen.symbols.mechanics import coriolis, kinetic_energy, origin_velocities, potential_energy

Place = tuple[int, ...]
Entries = dict[Place, Scalar]
TWIST = ("vx", "vy", "vz", "wx", "wy", "wz")
LARGEST_DIRECT = 3  # joints of a direct model in closed form


@dataclass(frozen=True)
class Request:
    """Which frame's model, and in which frame its components are."""

    of: int
    frame: int


@dataclass(frozen=True)
class Model:
    """A model that can be had as symbols.

    Attributes
    ----------
    name : str
        As it is asked for.
    letter : str
        What its entries are called.
    axes : tuple of str
        What its rows and columns are: joints, parameters, twist, pose; () for a scalar.
    summary : str
        What it is.
    entries : callable or None
        Its entries that may differ from zero, from a derivation; None for what is composed of others.
    of_frames : bool
        Whether it is that of a frame, in components of a frame.
    symmetric : bool
        Whether entries below the diagonal are those above it.
    """

    name: str
    letter: str
    axes: tuple[str, ...]
    summary: str
    entries: Callable[[Derivation, Request], Entries] | None
    of_frames: bool = False
    symmetric: bool = False


def _pose(d: Derivation, r: Request) -> Entries:
    A, P = frame_poses(d.geometry)[r.of] if r.of and not r.frame else Frames(d.geometry).pose(r.of, r.frame)
    rows = (*((*A[k], P[k]) for k in range(3)), (0, 0, 0, 1))
    return {(k, m): x for k, row in enumerate(rows) for m, x in enumerate(row)}


def _by_actuated_joint(d: Derivation, columns_of: Mapping[int, tuple[Vector, Vector]]) -> Entries:
    entries: Entries = {}
    for k in range(6):
        row = d.actuated({j: (*v, *w)[k] for j, (v, w) in columns_of.items()})
        entries |= {(k, column): x for column, x in enumerate(row.values())}
    return entries


def _jacobian(d: Derivation, r: Request) -> Entries:
    return _by_actuated_joint(d, Frames(d.geometry).columns(r.of, r.frame))


def _jacobian_steps(d: Derivation, r: Request) -> Entries:
    """The same by recursion: axes Z and velocities V carried outward to frame `of`, then turned into `frame`."""
    frames, axes = Frames(d.geometry), Axes(Motion(d.geometry, gravity=False, velocity=False, acceleration=False))
    return _by_actuated_joint(
        d,
        {k: (frames.rotated(axes.v[k, j], j, r.frame), frames.rotated(axes.z[k, j], j, r.frame)) for k, j in axes.z if j == r.of},
    )


def _twist(d: Derivation, r: Request, linear: Vector, angular: Vector) -> Entries:
    frames = Frames(d.geometry)
    both = (*frames.rotated(linear, r.of, r.frame), *frames.rotated(angular, r.of, r.frame))
    return {(k,): x for k, x in enumerate(both)}


def _velocity(d: Derivation, r: Request) -> Entries:
    motion = Motion(d.geometry, gravity=False, acceleration=False)
    return _twist(d, r, origin_velocities(motion)[r.of], motion.link[r.of].w)


def _acceleration(d: Derivation, r: Request, *, joints: bool = True) -> Entries:
    link = Motion(d.geometry, gravity=False, acceleration=joints).link[r.of]
    return _twist(d, r, link.a, link.wd)


def _torques(d: Derivation, r: Request, *, velocity: bool = True, acceleration: bool = True) -> Entries:
    motion = Motion(d.geometry, velocity=velocity, acceleration=acceleration)
    torque = joint_torques(motion, d.K)
    d.algebra.section("Friction, actuators")
    return _with_elements(d, motion, torque, lambda kind: velocity or kind not in ("viscous", "coulomb"))


def _friction(d: Derivation, r: Request) -> Entries:
    motion = Motion(d.geometry, gravity=False, acceleration=False)
    return _with_elements(d, motion, dict.fromkeys(d.robot.moving, 0), lambda kind: kind in ("viscous", "coulomb"))


def _with_elements(d: Derivation, motion: Motion, torque: dict[int, Scalar], kinds: Callable[[str], bool]) -> Entries:
    for name, (e, key) in d.elements.items():
        if kinds(e.kind):
            for i, value in element_column(motion, e, key).items():
                torque[i] = add(torque[i], mul(d.K[name], value))
    return {(row,): x for row, x in enumerate(d.actuated(torque).values())}


def _inertia_matrix(d: Derivation, r: Request) -> Entries:
    entries: Entries = {}
    for column, i in enumerate(d.robot.joints):
        motion = Motion(d.geometry, unit=i)
        torque = _with_elements(d, motion, joint_torques(motion, d.K), lambda kind: kind == "inertia")
        entries |= {(row, column): x for (row,), x in torque.items()}
    return entries


def _coriolis(d: Derivation, r: Request) -> Entries:
    number = {j: row for row, j in enumerate(d.robot.joints)}
    return {(number[i], number[k]): x for (i, k), x in coriolis(d).items()}


def _regressor(d: Derivation, r: Request) -> Entries:
    D = columns(Motion(d.geometry), d.source.own)
    return {(row, column): D[own].get(j, 0) for column, own in enumerate(d.source.own) for row, j in enumerate(d.robot.joints)}


def _closure(d: Derivation, r: Request) -> Entries:
    """Residuals of the loops in all moving joints, those of `loop_system` where joints are tied."""
    if not d.closure.tied:
        raise SymgenError(
            f"{d.robot.name} has no closure equations to solve: {'its passive joints are functions of the others; passive=symbols keeps them' if d.robot.passive else 'it has no passive joints'}"
        )
    system = loop_system(d.robot)
    if d.closure is not d.source.relations:
        system = LoopSystem(d.robot, d.closure, tuple(range(6 * len(d.robot.loops))))
    return {(k,): x for k, x in enumerate(system.residual(d.algebra))}


MODELS = {
    model.name: model
    for model in (
        Model("pose", "T", ("pose", "pose"), "homogeneous transform: axes and origin of frame `of` in frame `frame`", _pose, True),
        Model("jacobian", "J", ("twist", "joints"), "velocity of the origin of frame `of`, then its angular velocity, per joint rate, in frame `frame`", _jacobian, True),
        Model("determinant", "det J", (), "determinant of the Jacobian, where it is square", None, True),
        Model("jacobian_rate", "JPQP", ("twist",), "Jd qd: acceleration of the origin of frame `of` and its angular acceleration at qdd = 0, in frame `frame`", lambda d, r: _acceleration(d, r, joints=False), True),
        Model("velocity", "V", ("twist",), "velocity of the origin of frame `of`, then its angular velocity, in frame `frame`", _velocity, True),
        Model("acceleration", "VP", ("twist",), "acceleration of the origin of frame `of`, then its angular acceleration, in frame `frame`", _acceleration, True),
        Model("inverse_dynamics", "GAM", ("joints",), "Gamma = A qdd + C qd + Q + friction: joint torques", _torques),
        Model("inertia_matrix", "A", ("joints", "joints"), "A(q), actuators included", _inertia_matrix, symmetric=True),
        Model("coriolis", "C", ("joints", "joints"), "C(q, qd) of Coriolis and centrifugal torques C qd, with Christoffel symbols: Ad - 2C is skew symmetric", _coriolis),
        Model("bias", "H", ("joints",), "H(q, qd) = C qd + Q + friction: Gamma at qdd = 0", lambda d, r: _torques(d, r, acceleration=False)),
        Model("gravity", "Q", ("joints",), "Q(q): Gamma at rest without friction: gravity, springs, offset", lambda d, r: _torques(d, r, velocity=False, acceleration=False)),
        Model("friction", "F", ("joints",), "viscous and Coulomb friction", _friction),
        Model("kinetic_energy", "E", (), "kinetic energy, actuators included", lambda d, r: {(): kinetic_energy(d)}),
        Model("potential_energy", "U", (), "potential energy of gravity, springs and offset: dU/dq = Q", lambda d, r: {(): potential_energy(d)}),
        Model("forward_dynamics", "QDP", ("joints",), "qdd = A**-1 (Gamma - H), up to three joints", None),
        Model("regressor", "D", ("joints", "parameters"), "D of Gamma = D chi", _regressor),
        Model("base_parameters", "X", ("parameters",), "what each parameter is made of", None),
        Model("closure", "r", ("equations",), "residuals of the loops, zero where they close", _closure),
    )
}  # fmt: skip
STEPS = {"jacobian": _jacobian_steps}  # models whose recursion is another way than their closed form
