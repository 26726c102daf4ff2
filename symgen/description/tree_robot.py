"""Conversion of a URDF or MJCF file, read as a tree of links and joints, into a Robot.

Joints become Khalil frames, elements and limits; inertials become standard parameters. With the
pose jX of a link in frame j, the centre of mass c, and the rotation R = jR of the axes in which the
file gives the inertia I,

    M,    MS = M c,    J = R I R' + M (c'c 1 - c c')

where J has the tensor elements about the origin of frame j. The links of a body are summed.
"""

from __future__ import annotations

import hashlib
import keyword
import re
from collections.abc import Callable, Sequence

import numpy as np

from symgen.description.expression import ONE, ZERO, Expression
from symgen.description.fields import located
from symgen.description.mjcf import parse_mjcf
from symgen.description.naming import is_label
from symgen.description.robot import FIXED, INERTIAL, Element, Frame, Robot, parameter
from symgen.description.tree import (
    FREE_TYPE,
    WHOLE_TREE,
    Array,
    Inertial,
    Joint,
    Tree,
    TreePart,
    part_of,
)
from symgen.description.tree_frames import Body, Table, placed
from symgen.description.urdf import parse_urdf
from symgen.errors import DescriptionError

JOINT_TERMS: tuple[
    tuple[str, str, Callable[[Joint], float]], ...
] = (  # family, kind, value of a joint
    ("Ia", "inertia", lambda joint: joint.armature),
    ("FV", "viscous", lambda joint: joint.damping),
    ("FS", "coulomb", lambda joint: joint.friction),
    ("OFFSET", "offset", lambda joint: -joint.stiffness * joint.rest + 0.0),
    ("K", "stiffness", lambda joint: joint.stiffness),
)


def read_tree(
    content: bytes,
    file: str,
    *,
    exact: bool = False,
    keep_fixed: bool = False,
    part: TreePart = WHOLE_TREE,
) -> tuple[Robot, tuple[str, ...]]:
    """Return the Robot of a URDF or MJCF file, and notes for the user.

    The notes list which joint is which q, which link, body or site is which kept frame, which angle
    was changed, and what was not read.

    Parameters
    ----------
    content : bytes
        Content of the file.
    file : str
        Name of the file; its suffix selects the format.
    exact : bool
        Whether angles stay as written. Otherwise, a roll, pitch or yaw within SNAP of a multiple of
        pi/12 becomes this multiple, because files contain 1.5708 for pi/2, and an AngleWarning
        names the largest change. In an MJCF, these are the angles of bodies and sites, in any
        notation.
    keep_fixed : bool
        Whether links on fixed joints (tool0, flange), bodies without joints, and sites become fixed
        frames (sigma 2) without parameters, for frame_poses and jacobian. Otherwise, such links and
        bodies are only part of the body that holds them, and sites are left out. Their inertia
        belongs to that body in both cases.
    part : TreePart
        Joints held at a position, and the chain whose joints move.

    Raises
    ------
    DescriptionError
        The file is no URDF or MJCF, or describes no tree of revolute and prismatic joints on a
        fixed base; the message names file and line.
    """
    with located(file):
        tree = part_of(parse_tree(content, file, exact=exact, sites=keep_fixed), part)
        return robot_of_tree(tree, file, hashlib.sha256(content).hexdigest(), keep_fixed=keep_fixed)


def parse_tree(content: bytes, file: str, *, exact: bool = False, sites: bool = False) -> Tree:
    """Read the links and joints of a URDF or MJCF file; the suffix of `file` selects the format.

    If `sites` is true, the sites of an MJCF become links too.
    """
    if file.lower().endswith(".urdf"):
        return parse_urdf(content, file, exact=exact)
    return parse_mjcf(content, file, exact=exact, sites=sites)


def robot_of_tree(
    tree: Tree, file: str, sha256: str, *, keep_fixed: bool = False
) -> tuple[Robot, tuple[str, ...]]:
    """Build the Robot of a tree of links and joints, and notes for the user.

    The notes list which joint is which q, which link is which kept frame, and what was not read.
    Raises DescriptionError, with the line of the wrong joint, if the tree describes no robot.
    """
    if free := [joint for joint in tree.joints if joint.kind == FREE_TYPE]:
        raise DescriptionError(
            f"free joint {free[0].name!r}: the base of a robot must be fixed; to fix this joint "
            f"at its pose in the file: symgen convert --lock {free[0].name}=0",
            line=free[0].line,
        )
    table = placed(tree, keep_fixed=keep_fixed)
    try:
        robot = _robot(table, file, sha256)
    except DescriptionError as error:
        key = str((*error.path, "", "")[1]).removeprefix("q")
        joint = table.joint.get(int(key)) if key.isdigit() and error.line is None else None
        raise DescriptionError(
            error.message, path=error.path, line=error.line or (joint.line if joint else 1)
        ) from error.__cause__
    legends = [_legend("joints", {f"q{j}": joint.name for j, joint in table.joint.items()})]
    if table.fixed_links:
        legends.append(
            _legend("fixed frames", {f"frame {j}": name for j, name in table.fixed_links.items()})
        )
    return robot, (*legends, *tree.notes, *table.notes)


def _legend(what: str, names: dict[str, str]) -> str:
    return f"{what}: " + ", ".join(f"{name} = {of_file!a:.60}" for name, of_file in names.items())


def _robot(table: Table, file: str, sha256: str) -> Robot:
    constraints = _constraints(table)
    actuated = [j for j in table.joint if j not in constraints]
    if not actuated:
        raise DescriptionError(
            "the file has no joint that moves; a robot needs at least one moving joint"
        )
    frames = tuple(Frame(**{**vars(f), "mu": int(f.j in actuated)}) for f in table.frames)
    values, massless = _values(table, actuated)
    gravity, constants = _gravity(table.tree.gravity)
    return Robot(
        name=_identifier(table.tree.name or file.rpartition(".")[0]),
        frames=frames,
        gravity=gravity,
        constants={**table.constants, **constants},
        elements=tuple(
            Element(family, kind, {j: {j: ONE} for j in keys}, {})
            for family, kind, _ in JOINT_TERMS
            if (keys := _keys(table, family, actuated))
        ),
        constraints=constraints,
        massless=massless,
        limits=_limits(table, actuated),
        values=values,
        labels=_labels(table),
        angles=table.tree.angles,
        impossible=tuple(
            (j, own.wrong)
            for j, body in table.bodies.items()
            for own in map(table.tree.links.__getitem__, body.links)
            if own is not None and own.wrong
        ),
        file=file,
        sha256=sha256,
    )


def _labels(table: Table) -> dict[int, str]:
    """Return labels of the frames: the names of joints and of links kept as fixed frames.

    A name is left out if it is not allowed as a label or is already used.
    """
    names = {j: joint.name for j, joint in table.joint.items()} | table.fixed_links
    strange = sorted(name for name in names.values() if not is_label(name))
    if strange:
        table.notes.append(
            f"no label of a robot file, left out: {', '.join(f'{name!a:.60}' for name in strange)}"
        )
    labels: dict[int, str] = {}
    for j, name in sorted(names.items()):
        if is_label(name) and name not in labels.values():
            labels[j] = name
    return labels


def _identifier(name: str) -> str:
    name = re.sub(r"\W", "_", name, flags=re.ASCII)[:34] or "robot"
    return f"robot_{name}" if not name[0].isalpha() or keyword.iskeyword(name) else name


def _gravity(
    g: tuple[float, float, float],
) -> tuple[tuple[Expression, Expression, Expression], dict[str, float]]:
    """Express gravity by constants: g if it points along -z, else one for each nonzero component.

    Return the three components as expressions, and the values of the constants by name.
    """
    if g[:2] == (0.0, 0.0) and g[2] < 0:
        return (ZERO, ZERO, -Expression.symbol("g")), {"g": -g[2]}
    names = [f"g{axis}" if x else "" for axis, x in zip("xyz", g, strict=True)]
    gx, gy, gz = (Expression.symbol(name) if name else ZERO for name in names)
    return (gx, gy, gz), {name: x for name, x in zip(names, g, strict=True) if name}


def _constraints(table: Table) -> dict[int, Expression]:
    """Express the position q_j of each follower joint by the positions of the joints it follows."""
    positions = {joint.name: Expression.symbol(f"q{j}") for j, joint in table.joint.items()}
    relations = table.tree.relations
    return {
        j: relations[joint.name].substitute(positions)
        for j, joint in sorted(table.joint.items())
        if joint.name in relations
    }


def _keys(table: Table, family: str, actuated: list[int]) -> list[int]:
    """Find the joints that have a parameter of the family `family`, for instance FV.

    These are all actuated joints, and the joints that follow others if the file gives a value. A
    spring (family K) needs a value of the file in any case.
    """
    value = next(value for name, _, value in JOINT_TERMS if name == family)
    return [
        j for j, joint in table.joint.items() if value(joint) or (j in actuated and family != "K")
    ]


def _limits(
    table: Table, actuated: list[int]
) -> dict[str, tuple[float, ...] | tuple[tuple[float, float], ...]]:
    """Collect limits of position, speed and torque, each kind only if all actuated joints have it.

    A note lists the kinds that are left out.
    """
    rows = [table.joint[j] for j in actuated]
    limits: dict[str, tuple[float, ...] | tuple[tuple[float, float], ...]] = {}
    bounds = tuple(
        (joint.limits.get("lower", 0.0), joint.limits.get("upper", 0.0)) for joint in rows
    )
    if all(low < high for low, high in bounds) and all(
        joint.kind != "continuous" for joint in rows
    ):
        limits["q"] = bounds
    for key, of_file in (("qd", "velocity"), ("tau", "effort")):
        largest = tuple(joint.limits.get(of_file, 0.0) for joint in rows)
        if all(x > 0 for x in largest):
            limits[key] = largest
    if missing := [key for key in ("q", "qd", "tau") if key not in limits]:
        table.notes.append(
            f"limits of {', '.join(missing)} left out: not every actuated joint has them"
        )
    return limits


def _values(table: Table, actuated: list[int]) -> tuple[dict[str, float], frozenset[int]]:
    """Return the standard parameters by name, and the frames without inertial parameters.

    There are no standard parameters if no link of the file has an inertia.
    """
    links = table.tree.links
    bodies = {j: body for j, body in table.bodies.items() if j in table.joint}
    bare = {j for j, body in bodies.items() if set(body.links) <= table.tree.bare}
    massless = frozenset(f.j for f in table.frames if f.sigma == FIXED or f.j in bare)
    if not any(links[name] is not None for body in bodies.values() for name in body.links):
        table.notes.append("no link has an <inertial>: the robot has no values")
        return {}, massless
    values: dict[str, float] = {}
    for j, body in bodies.items():
        if j in bare:
            continue
        if all(links[name] is None for name in body.links):
            table.notes.append(
                f"no <inertial> on {', '.join(f'{name!a:.60}' for name in body.links)}: values of "
                f"link {j} are 0"
            )
        values |= {
            parameter(p, j): x for p, x in zip(INERTIAL, _standard(table, body), strict=True)
        }
    for family, _, value in JOINT_TERMS:
        values |= {
            parameter(family, j): value(table.joint[j]) for j in _keys(table, family, actuated)
        }
    return values, massless


def _standard(table: Table, body: Body) -> Array:
    """Compute XX XY XZ YY YZ ZZ MX MY MZ M of a body in its frame, shape (10,)."""
    links = [(table.tree.links[name], X) for name, X in body.links.items()]
    return sum((ten_of(own, X) for own, X in links if own is not None), start=np.zeros(10))


def inertial_of(ten: Sequence[float] | Array) -> Inertial:
    """Convert XX XY XZ YY YZ ZZ MX MY MZ M to mass, centre of mass, and tensor about this centre.

    The tensor has the axes of the frame in which the ten parameters are given.
    """
    *J, mx, my, mz, M = (float(x) for x in ten)
    c, I, pose = np.array([mx, my, mz]) / M if M else np.zeros(3), np.zeros((3, 3)), np.eye(4)
    I[np.triu_indices(3)] = J
    I = I + I.T - np.diag(np.diag(I)) - M * (c @ c * np.eye(3) - np.outer(c, c))
    pose[:3, 3] = c
    return Inertial(M, pose, I)


def ten_of(inertial: Inertial, X: Array) -> Array:
    """Convert mass, centre of mass and inertia tensor to XX XY .. ZZ MX MY MZ M, shape (10,).

    The result is given in the frame of the body, in which the link has the pose X, shape (4, 4).
    """
    own = X @ inertial.pose
    R, c, M = own[:3, :3], own[:3, 3], inertial.M
    J = R @ inertial.I @ R.T + M * (c @ c * np.eye(3) - np.outer(c, c))
    return np.array([*J[np.triu_indices(3)], *(M * c), M])
