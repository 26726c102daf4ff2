"""A robot as a tree of links and joints with axes in any direction, read from a URDF or MJCF file.

The tree is later converted to a table of Khalil frames. A part of the tree can be selected: some
joints are held at given positions, and for a chain from `base` to `tip` all joints that are not
between these two links are held at zero.

A held joint becomes a fixed joint with the pose of that position. A joint that follows held joints
has the position that its relation gives. The inertia of a link that no longer moves belongs to the
body that holds the link, as with any fixed joint.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from symgen.description.angles import Angles
from symgen.description.expression import Expression
from symgen.errors import DescriptionError

Array = np.ndarray
MAX_JOINTS, SHOWN = 200, 20  # that move, of a file; names in a message
DROPPED = "not read:"  # how the note on elements that are left out starts
EARTH = 9.81  # m/s^2, along -z of the root link
HINGE = "hinge"  # kind of a loop: revolute, about the direction of all other hinges around it
MOVING, FIXED_TYPE, FREE_TYPE = ("revolute", "continuous", "prismatic"), "fixed", "free"


@dataclass(frozen=True)
class Inertial:
    """Mass, centre of mass and inertia tensor of a link.

    Attributes
    ----------
    M : float, kg
        Mass.
    pose : ndarray, shape (4, 4)
        Frame at the centre of mass, in the link frame.
    I : ndarray, shape (3, 3), kg m^2
        Tensor elements about the centre of mass, in that frame.
    name : str
        Name of the link in the file, with its line.
    wrong : str
        The reason why no body has this inertia; "" if a body can have it.
    """

    M: float
    pose: Array
    I: Array
    name: str = ""
    wrong: str = ""


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


@dataclass(frozen=True)
class Joint:
    """A joint between two links of a tree, with its axis, limits, friction, armature and spring.

    Along the joint, the torque or force is

        Gamma += armature qdd + damping qd + friction sign(qd) + stiffness (q - rest)

    Attributes
    ----------
    name : str
        Name in the file.
    kind : str
        A kind of moving joint, `FIXED_TYPE`, or `FREE_TYPE`; a free joint must be held.
    parent, child : str
        Names of the links; the frame of `child` is the joint frame at q = 0.
    pose : ndarray, shape (4, 4)
        Joint frame in the frame of `parent`.
    axis : ndarray, shape (3,)
        Unit vector in the joint frame.
    line : int
        Line of the file.
    limits : mapping, SI and rad
        The limits lower, upper, velocity and effort, as far as the file gives them.
    damping, friction, armature, stiffness, rest : float, SI and rad
        Coefficients of the equation above.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Array
    axis: Array
    line: int
    limits: Mapping[str, float] = field(default_factory=dict)
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0


@dataclass(frozen=True)
class TreeLoop:
    """A closed loop: a frame of one link coincides with a frame of another link.

    Attributes
    ----------
    name : str
        Name in the file.
    kind : str
        The motion that the loop leaves free: revolute (about z), hinge (about the direction of all
        other hinges around the loop), prismatic (along z), spherical (any rotation), or fixed
        (none).
    links : two str
        Names of both links.
    poses : two ndarrays, shape (4, 4)
        The frame in each link.
    line : int
        Line of the file, 0 if it is in no line.
    joint : Joint or None
        A joint of the file that is cut here; None if the file has only the loop.
    """

    name: str
    kind: str
    links: tuple[str, str]
    poses: tuple[Array, Array]
    line: int = 0
    joint: Joint | None = None


@dataclass(frozen=True)
class Tree:
    """The links and joints of a robot, in the order of the file.

    Attributes
    ----------
    name : str
        Name of the robot.
    links : mapping
        Inertial of each link by name; None if the file gives no inertia.
    joints : tuple of Joint
        One for each link but the root.
    root : str
        The link that has no parent.
    relations : mapping
        Positions of the joints that follow others, by name. Each is a linear expression in the
        positions of independent joints, whose names are the symbols.
    bare : frozenset of str
        Links between the joints of one body, which have no mass.
    gravity : tuple of float, m/s^2
        Acceleration of gravity in the root link.
    notes : tuple of str
        Parts of the file that were left out, without effect on the torques.
    not_read : tuple of str
        Parts of the file that were left out although they change the torques.
    places : mapping
        For an MJCF, in the order of its bodies: pose (4, 4) of the frame of each body in the frame
        of its link. A URDF has one frame for both.
    angles : str
        How angles near multiples of pi/12 were read.
    sites : mapping
        For an MJCF: the link of each site, and the pose (4, 4) of the site in the frame of this link.
    loops : tuple of TreeLoop
        Closed loops. Joints around them are passive unless they are in `driven`.
    driven : frozenset of str
        Names of the joints that a motor drives, as far as the file says so.
    start : mapping, rad or m
        Joint positions, by name, near which the loops are closed; 0 for others.
    motor_line : str
        Line that the user should write for a motor at joint {}, if the file has no such line.
    floats : bool
        Whether the root is a base that moves.
    """

    name: str
    links: Mapping[str, Inertial | None]
    joints: tuple[Joint, ...]
    root: str
    relations: Mapping[str, Expression] = field(default_factory=dict)
    bare: frozenset[str] = frozenset()
    gravity: tuple[float, float, float] = (0.0, 0.0, -EARTH)
    notes: tuple[str, ...] = ()
    places: Mapping[str, Array] = field(default_factory=dict)
    angles: str = ""
    not_read: tuple[str, ...] = ()
    sites: Mapping[str, tuple[str, Array]] = field(default_factory=dict)
    loops: tuple[TreeLoop, ...] = ()
    driven: frozenset[str] = frozenset()
    start: Mapping[str, float] = field(default_factory=dict)
    motor_line: str = ""
    floats: bool = False


def turn(axis: int, angle: float) -> Array:
    """Compute the rotation matrix about x, y or z (axis 0, 1 or 2), exact for quarter turns."""
    c, s = math.cos(angle), math.sin(angle)
    c, s = (float(round(x)) if abs(x - round(x)) < 1e-15 else x for x in (c, s))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[j, j], R[j, k], R[k, j], R[k, k] = c, -s, s, c
    return R


def rotation(rpy: Sequence[float], what: str, angles: Angles) -> Array:
    """Compute R = Rz(yaw) Ry(pitch) Rx(roll), after rounding the angles by the rule in `angles`.

    `what` names the link or joint in the report on rounded angles.
    """
    roll, pitch, yaw = (
        x if (k := angles.twelfths(x, f"{name} of {what}")) is None else k * (math.pi / 12)
        for name, x in zip(("roll", "pitch", "yaw"), rpy, strict=True)
    )
    return np.asarray(turn(2, yaw) @ turn(1, pitch) @ turn(0, roll))


def transform(row: Sequence[float]) -> Array:
    """Compute the pose iTj, shape (4, 4), from a row gamma, b, alpha, d, theta, r of a frame table.

    The pose is

        iTj = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r)
    """
    gamma, b, alpha, d, theta, r = row
    T = np.eye(4)
    for axis, angle, shift in ((2, gamma, b), (0, alpha, d), (2, theta, r)):
        step = np.eye(4)
        step[:3, :3], step[axis, 3] = turn(axis, angle), shift
        T = T @ step
    return T


# --- part of a tree ---


@dataclass(frozen=True)
class TreePart:
    """Selection of a part of a tree: joints held at given positions, and a chain whose joints move.

    Attributes
    ----------
    lock : mapping, rad or m
        Positions at which joints are held, by joint name.
    chain : tuple of str or None
        Names of the base link and the tip link; None for the whole tree.
    """

    lock: Mapping[str, float] = field(default_factory=dict)
    chain: tuple[str, str] | None = None


WHOLE_TREE = TreePart()


def part_of(tree: Tree, part: TreePart) -> Tree:
    """Return the tree with the joints in `part.lock`, and all joints outside `part.chain`, held fixed.

    Notes of the tree name the held joints.

    Raises
    ------
    DescriptionError
        A joint or link does not exist, a joint to be held does not move or follows another joint,
        or no moving joint lies between base and tip.
    """
    for name in part.lock:
        _require_independent(tree, name)
    notes = list(tree.notes)
    if part.lock:
        notes.append(f"held: {_names([f'{name} at {x:.6g}' for name, x in part.lock.items()])}")
        tree = _hold(tree, part.lock)
    if part.chain:
        base, tip = part.chain
        others = _beside(tree, base, tip)
        tree = _hold(tree, others)
        moving = [joint.name for joint in tree.joints if joint.kind != FIXED_TYPE]
        notes.append(f"chain from {base!a:.60} to {tip!a:.60}: {_names(moving)} move")
        notes += [f"held at zero: {_names(others)}"] if others else []
    return replace(tree, notes=tuple(notes))


def _beside(tree: Tree, base: str, tip: str) -> dict[str, float]:
    """Find the moving joints outside the chain from link `base` to link `tip`, and the positions at
    which they are held.

    The position is zero; for a joint that follows other joints, it is the position when these are
    at zero.
    """
    for link in (base, tip):
        if link not in tree.links:
            raise DescriptionError(
                f"the file has no link {link!a:.60} for the chain; its "
                f"links are {_names(list(tree.links))}"
            )
    holding = {joint.child: joint for joint in tree.joints}
    between: list[Joint] = []
    link = tip
    while link != base and link in holding:
        between.append(holding[link])
        link = holding[link].parent
    if link != base or all(joint.kind == FIXED_TYPE for joint in between):
        raise DescriptionError(
            f"link {tip!a:.60} is not connected to {base!a:.60} by a moving joint; give the base "
            "link of the chain first, then the tip link"
        )
    kept = {joint.name for joint in between}
    others = [j.name for j in tree.joints if j.kind != FIXED_TYPE and j.name not in kept]
    at_zero = {name: e.terms.get((), 0.0) for name, e in tree.relations.items()}
    return {name: float(at_zero.get(name, 0.0)) for name in others}


def _require_independent(tree: Tree, name: str) -> None:
    kinds = {joint.name: joint.kind for joint in tree.joints}
    if kinds.get(name, FIXED_TYPE) == FIXED_TYPE:
        moving = [joint for joint, kind in kinds.items() if kind != FIXED_TYPE]
        raise DescriptionError(
            f"the file has no moving joint {name!a:.60} to lock; its moving "
            f"joints are {_names(moving)}"
        )
    if name in tree.relations:
        leaders = [leader for leader in kinds if leader in tree.relations[name].atoms]
        raise DescriptionError(
            f"joint {name!a:.60} cannot be locked, because it follows other joints; lock {_names(leaders)} instead"
        )


def _hold(tree: Tree, positions: Mapping[str, float]) -> Tree:
    """Fix the joints in `positions` at these values, and each joint that mimics fixed joints only."""
    exact = {name: Expression.number(repr(x)) for name, x in positions.items()}
    relations = {
        name: e.substitute(exact) for name, e in tree.relations.items() if name not in positions
    }
    fixed = {**positions, **{name: float(e) for name, e in relations.items() if not e.atoms}}
    joints = tuple(
        replace(j, kind=FIXED_TYPE, pose=j.pose @ motion(j, fixed[j.name]), limits={})
        if j.name in fixed
        else j
        for j in tree.joints
    )
    following = {name: e for name, e in relations.items() if e.atoms}
    return replace(tree, joints=joints, relations=following)


def motion(joint: Joint, q: float) -> Array:
    """Compute the displacement, shape (4, 4), of a joint at position q, along or about its axis.

    About an axis a, the rotation is

        R = 1 + sin q [a] + (1 - cos q) [a]^2
    """
    T = np.eye(4)
    if joint.kind == FREE_TYPE and q:
        raise DescriptionError(
            f"free joint {joint.name!a:.60} can only be locked at its pose in the file, which is position 0: lock this joint at 0",
            line=joint.line,
        )
    if joint.kind == "prismatic":
        T[:3, 3] = q * joint.axis
        return T
    c, s = turn(2, q)[:2, 0]  # exact at quarter turns
    x, y, z = joint.axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    T[:3, :3] += s * cross + (1 - c) * cross @ cross
    return T


def _names(names: Collection[str]) -> str:
    shown = ", ".join(ascii(name)[1:-1][:60] for name in list(names)[:SHOWN])
    return shown + (f" and {len(names) - SHOWN} more" if len(names) > SHOWN else "")
