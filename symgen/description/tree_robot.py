"""Conversion of a URDF or MJCF file, read as a tree of links and joints, into a Robot.

Links joined by fixed joints are one body. Body j turns about or moves along z_j, the axis of its
joint. x_i lies on the common normal of z_i and of the axis of the first joint on body i, so that
this joint has gamma = b = 0; further joints on the body have other values. For parallel axes, the
normal through the origin is used. For nearly parallel axes, the common normal is too far away; a
fixed frame without link turns z in between. Joint positions are those of the file, including sign
and zero; frame 0 is the frame of the root link. If fixed joints are kept, each link on a fixed
joint gets a fixed frame too, equal to its link frame in the file; these frames come after all
moving frames. Its inertia stays with the body, so that formulas and joint numbers are the same in
both cases.

Lengths become constants. Lengths that are equal up to the sign become the same constant, so that
the formulas use the special geometry of the robot.

Joints become Khalil frames, elements and limits; inertials become standard parameters. With the
pose jX of a link in frame j, the centre of mass c, and the rotation R = jR of the axes in which the
file gives the inertia I,

    M,    MS = M c,    J = R I R' + M (c'c 1 - c c')

where J has the tensor elements about the origin of frame j. The links of a body are summed.
"""

from __future__ import annotations

import hashlib
import keyword
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, Literal

import numpy as np

from symgen.description.expression import ONE, PI, ZERO, Expression, twelfths
from symgen.description.fields import located
from symgen.description.loops_file import LoopsText, with_loops
from symgen.description.mjcf import parse_mjcf
from symgen.description.mounts import rows_of
from symgen.description.naming import is_label
from symgen.description.robot import (
    FIXED,
    INERTIAL,
    PRISMATIC,
    REVOLUTE,
    Element,
    Frame,
    Loop,
    Robot,
    parameter,
)
from symgen.description.tree import (
    FIXED_TYPE,
    FREE_TYPE,
    WHOLE_TREE,
    Array,
    Inertial,
    Joint,
    Tree,
    TreePart,
    part_of,
    ten_of,
    transform,
)
from symgen.description.tree_loops import Cut, cut_open, passive_names, start_of
from symgen.description.urdf import parse_urdf
from symgen.errors import DescriptionError

DIGITS = 13  # decimals kept of lengths (m) and angles (rad)
SAME = 1e-12  # m, rad: closer is equal
START_DIGITS = 9  # decimals of the positions near which a loop is closed
# sine of the angle of two axes below which their common normal is too far away to compute with
STEEP = 0.02


@dataclass
class Body:
    """A rigid body (links on fixed joints): its links with their poses in frame j, and its joints.

    Attributes
    ----------
    links : mapping
        Pose (4, 4) of each link of the body in frame j.
    joints : list
        Joints on the body, each with the pose of its parent link in frame j.
    """

    links: dict[str, Array]
    joints: list[tuple[Joint, Array]]


@dataclass
class Table:
    """The frame table of a robot under construction.

    Attributes
    ----------
    tree : Tree
        The tree that is converted to the table.
    frames : list of Frame
        Rows so far.
    constants : mapping, m
        Lengths by name.
    joint, bodies, fixed_links : mapping
        Joint, body, and link on a fixed joint, by frame number.
    notes : list of str
        Remarks on the table for the user.
    cuts, loops : list
        Closed loops, in the tree, and by the numbers of their frames.
    passive : frozenset of str
        Names of the joints around loops that no motor drives.
    """

    tree: Tree
    frames: list[Frame] = field(default_factory=list)
    constants: dict[str, float] = field(default_factory=dict)
    joint: dict[int, Joint] = field(default_factory=dict)
    bodies: dict[int, Body] = field(default_factory=dict)
    fixed_links: dict[int, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    cuts: tuple[Cut, ...] = ()
    loops: list[Loop] = field(default_factory=list)
    passive: frozenset[str] = frozenset()


def placed(tree: Tree, *, keep_fixed: bool = False) -> Table:
    """Choose the frames of all bodies of a tree, from the root outward, and return the frame table.

    A body comes before the bodies that are mounted on it, branch by branch; loops are cut. The
    twins of cut joints come last, and before them, if `keep_fixed`, the frames of links on fixed
    joints. Raises DescriptionError, with the line, if loops or a base that moves make no robot.
    """
    tree, cuts = cut_open(tree)
    tree = on_its_base(tree)
    table = Table(tree, cuts=cuts, passive=passive_names(tree, cuts))
    table.bodies[0] = _body(tree, tree.root, np.eye(4))
    waiting = [(0, joint, parent) for joint, parent in reversed(table.bodies[0].joints)]
    while waiting:
        ant, joint, parent = waiting.pop()
        j = _add(table, ant, joint, parent)
        waiting += [(j, child, link) for child, link in reversed(table.bodies[j].joints)]
    if keep_fixed:
        for j, body in table.bodies.items():
            for name, pose in list(body.links.items())[1:]:
                if name not in tree.bare:
                    table.fixed_links[_keep(table, j, pose)[0]] = name
    for cut in cuts:
        _close(table, cut)
    return table


def _close(table: Table, cut: Cut) -> None:
    """Append the twin of a cut joint to the frame table, and the loop to its loops.

    A cut joint that the file does not have is at 0 where the x axes of both frames agree.
    """
    number = {joint.name: j for j, joint in table.joint.items()}
    holder = next((j for j, body in table.bodies.items() if cut.link in body.links), None)
    if holder is None or cut.joint not in number:
        raise DescriptionError(
            f"loop {cut.loop.name!a:.60} is closed by link {cut.link!a:.60}, which the free base does "
            "not carry; leave out the loop",
            line=cut.loop.line or None,
        )
    j = number[cut.joint]
    to_cut = np.linalg.inv(table.bodies[j].links[cut.child])
    pose = table.bodies[holder].links[cut.link] @ cut.pose @ to_cut
    free = cut.added == (cut.joint,) and table.frames[j - 1].sigma == REVOLUTE
    twin, theta = _keep(table, holder, pose, free=free)
    positions = start_of(table.tree, cut)
    if free and cut.joint in positions:
        positions[cut.joint] -= theta
    if table.tree.floats and not _below(table, j) & _below(table, twin):
        raise DescriptionError(
            f"loop {cut.loop.name!a:.60} closes on the free base, which is read only for loops inside "
            "one of its limbs; hold the base by symgen convert --lock JOINT=0, with the name of its joint",
            line=cut.loop.line or None,
        )
    start = {number[name]: round(x, START_DIGITS) + 0.0 for name, x in positions.items()}
    table.loops.append(Loop(j, twin, start))


def _below(table: Table, j: int) -> set[int]:
    """Return the numbers of the frames from frame j down to the base, which is not included."""
    frames = set()
    while j:
        frames.add(j)
        j = table.frames[j - 1].ant
    return frames


def _keep(table: Table, ant: int, pose: Array, *, free: bool = False) -> tuple[int, float]:
    """Append a fixed frame on frame `ant`, which has `pose` in frame `ant`; return its number.

    If its x axis is `free`, theta is 0, and the angle that it would have is returned too.
    """
    if _nearly_parallel(pose[:3, 2]):
        to_aside, ant = _row(table, ant, FIXED, _normal(np.array([1.0, 0.0, 0.0]), pose[:3, 3]))
        pose = np.linalg.inv(to_aside) @ pose
    before = _numbered(_normal(pose[:3, 2], pose[:3, 3]))
    rest = np.linalg.inv(transform((*before, 0.0, 0.0))) @ pose
    theta, r = _numbered((math.atan2(rest[1, 0], rest[0, 0]), rest[2, 3]))
    _, j = _row(table, ant, FIXED, before, 0.0 if free else theta, r)
    return j, theta


def _body(tree: Tree, link: str, pose: Array) -> Body:
    """Collect the links fixed to `link`, and the moving joints mounted on these links.

    `pose` is the pose of `link`; the result has all poses in that frame.
    """
    body, waiting = Body({link: pose}, []), [link]
    while waiting:
        link = waiting.pop(0)
        for joint in (joint for joint in tree.joints if joint.parent == link):
            if joint.kind == FIXED_TYPE:
                body.links[joint.child] = body.links[link] @ joint.pose
                waiting.append(joint.child)
            else:
                body.joints.append((joint, body.links[link]))
    order = {joint.name: k for k, joint in enumerate(tree.joints)}
    body.joints.sort(key=lambda held: order[held[0].name])
    return body


def _add(table: Table, ant: int, joint: Joint, parent: Array) -> int:
    """Append the frame of `joint`, mounted on body `ant`, to the frame table; return its number.

    `parent` is the pose of the parent link of the joint in frame `ant`.
    """
    pose = parent @ joint.pose
    axis, point = pose[:3, :3] @ joint.axis, pose[:3, 3]
    if _nearly_parallel(axis):
        angle = math.hypot(axis[0], axis[1])
        table.notes.append(
            f"axis of {joint.name!a:.60} is parallel to its antecedent's within {angle:.2g} rad; "
            "where parallel is meant, correct the file, or leave out --exact"
        )
        to_aside, aside = _row(table, ant, FIXED, _normal(np.array([1.0, 0.0, 0.0]), point))
        pose = np.linalg.inv(to_aside) @ pose
        axis, point, ant = pose[:3, :3] @ joint.axis, pose[:3, 3], aside
    before = _numbered(_normal(axis, point))
    body = _body(table.tree, joint.child, np.linalg.inv(transform((*before, 0.0, 0.0))) @ pose)
    theta = r = 0.0
    ends = [(link @ held.pose, held.axis) for held, link in body.joints] + [
        (body.links[cut.link] @ cut.pose, np.array([0.0, 0.0, 1.0]))
        for cut in table.cuts
        if cut.link in body.links
    ]
    if ends:
        placed_joint, own_axis = ends[0]
        along = placed_joint[:3, :3] @ own_axis
        if not _nearly_parallel(along):
            theta, r, _, _ = _normal(along, placed_joint[:3, 3])
            theta, r = _numbered((theta, r))
    sigma = PRISMATIC if joint.kind == "prismatic" else REVOLUTE
    _, j = _row(table, ant, sigma, before, theta, r)
    own = np.linalg.inv(transform((0.0, 0.0, 0.0, 0.0, theta, r)))
    table.bodies[j] = Body(
        {name: own @ X for name, X in body.links.items()},
        [(held, own @ X) for held, X in body.joints],
    )
    table.joint[j] = joint
    return j


def _nearly_parallel(axis: Array) -> bool:
    """Whether `axis` is almost, but not exactly, parallel to the z axis of the frame.

    The common normal of both axes is then too far away.
    """
    return SAME < math.hypot(axis[0], axis[1]) < STEEP


def _normal(axis: Array, point: Array) -> tuple[float, float, float, float]:
    """Compute gamma, b, alpha, d that lead from a frame to the line through `point` along `axis`.

    `point` and `axis` are given in this frame; |gamma| <= pi/2.
    """
    x, y, z = axis
    s = math.hypot(x, y)
    if s <= SAME:  # parallel
        d = math.hypot(point[0], point[1])
        gamma, b, alpha = (
            (math.atan2(point[1], point[0]) if d > SAME else 0.0),
            0.0,
            (0.0 if z > 0 else math.pi),
        )
    else:  # normal z_i x z_j
        gamma, alpha = math.atan2(x, -y), math.atan2(s, z)
        d = (-y * point[0] + x * point[1]) / s
        b = point[2] - z * (x * point[0] + y * point[1]) / s**2
    if abs(gamma) > math.pi / 2 + SAME:  # the same normal, x the other way
        gamma, alpha, d = gamma - math.copysign(math.pi, gamma), -alpha, -d
    return gamma, b, alpha, d


def _numbered(row: Sequence[float]) -> tuple[float, ...]:
    """Round a row of alternating angles and lengths as the frame table stores them.

    Angles that are multiples of pi/12 are exact; other numbers get 13 decimals.
    """
    return tuple(_angle(x)[0] if k % 2 == 0 else round(x, DIGITS) + 0.0 for k, x in enumerate(row))


def _angle(x: float) -> tuple[float, Expression]:
    k = twelfths(x, SAME)
    return (
        (round(x, DIGITS), Expression.number(repr(round(x, DIGITS))))
        if k is None
        else (k * math.pi / 12, PI * Fraction(k, 12))
    )


def _row(
    table: Table, ant: int, sigma: int, before: Sequence[float], theta: float = 0.0, r: float = 0.0
) -> tuple[Array, int]:
    """Append a frame to the table; return its pose in the antecedent frame at q = 0, and its
    number.

    The pose has the shape (4, 4).
    """
    j = len(table.frames) + 1
    gamma, b, alpha, d = before = _numbered(before)
    q = Expression.symbol(f"q{j}")
    turned, moved = _angle(theta)[1], _length(table, f"RL{j}", r)
    table.frames.append(
        Frame(
            j,
            ant,
            sigma,
            int(sigma != FIXED),
            gamma=_angle(gamma)[1],
            b=_length(table, f"B{j}", b),
            alpha=_angle(alpha)[1],
            d=_length(table, f"D{j}", d),
            theta=turned + q if sigma == REVOLUTE else turned,
            r=moved + q if sigma == PRISMATIC else moved,
        )
    )
    return transform((*before, theta, r)), j


def _length(table: Table, name: str, x: float) -> Expression:
    """Express length x as 0 or as a named constant with a sign; equal lengths share a constant."""
    if abs(x) <= SAME:
        return ZERO
    equal = next(
        (k for k, value in table.constants.items() if abs(abs(value) - abs(x)) <= SAME), None
    )
    if equal is None:
        table.constants[name] = abs(float(x))
        equal = name
    return Expression.symbol(equal) * (1 if x > 0 else -1)


# --- from the frame table to a Robot ---

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
    loops: LoopsText | None = None,
) -> tuple[Robot, tuple[str, ...]]:
    """Return the Robot of a URDF or MJCF file, and notes for the user.

    The notes list which joint is which q, which link, body or site is which kept frame, which angle
    was changed, and which parts were not read.

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
        bodies are only a part of the body that holds them, and sites are left out. In both cases,
        the inertia belongs to that body.
    part : TreePart
        Joints held at a position, and the chain whose joints move.
    loops : LoopsText, optional
        A file with the loops of the robot.

    Raises
    ------
    DescriptionError
        The file is no URDF or MJCF, or describes no tree of revolute and prismatic joints on a
        fixed base; the message names file and line.
    """
    with located(file):
        tree = parse_tree(content, file, exact=exact, sites=keep_fixed, loops=loops)
        text = content + (loops.content if loops and tree.loops else b"")
        sha256 = hashlib.sha256(text).hexdigest()
        return robot_of_tree(part_of(tree, part), file, sha256, keep_fixed=keep_fixed)


def parse_tree(
    content: bytes,
    file: str,
    *,
    exact: bool = False,
    sites: bool = False,
    loops: LoopsText | None = None,
) -> Tree:
    """Read the links and joints of a URDF or MJCF file; the suffix of `file` selects the format.

    If `sites` is true, the sites of an MJCF become links too. `loops` has loops from a second file.
    """
    if file.lower().endswith(".urdf"):
        tree = parse_urdf(content, file, exact=exact)
    else:
        tree = parse_mjcf(content, file, exact=exact, sites=sites)
    return with_loops(tree, loops)


def robot_of_tree(
    tree: Tree, file: str, sha256: str, *, keep_fixed: bool = False
) -> tuple[Robot, tuple[str, ...]]:
    """Build the Robot of a tree of links and joints, and notes for the user.

    The notes list which joint is which q, which link is which kept frame, and which parts were not
    read. Raises DescriptionError, with the line of the wrong joint, if the tree describes no robot.
    """
    table = placed(tree, keep_fixed=keep_fixed)
    tree = table.tree
    try:
        robot = _robot(table, file, sha256, base="free" if tree.floats else "fixed")
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


def on_its_base(tree: Tree) -> Tree:
    """Return the tree that stands on the link of its free joint: frame 0 of a free base.

    A tree without a free joint is not changed.

    Raises DescriptionError unless the one free joint carries all other joints that move.
    """
    free = [joint for joint in tree.joints if joint.kind == FREE_TYPE]
    if not free:
        return tree
    base = free[0]
    inside = {base.child}
    for _ in tree.joints:
        inside |= {joint.child for joint in tree.joints if joint.parent in inside}
    outside = [j for j in tree.joints if j.child not in inside and j.kind != FIXED_TYPE]
    if others := [*free[1:], *(j for j in outside if j is not base)]:
        raise DescriptionError(
            f"free joint {base.name!r} does not carry joint {others[0].name!r}, but only the joint "
            "below all others may be free; to fix a free joint at its pose in the file: symgen "
            f"convert --lock {base.name}=0",
            line=base.line,
        )
    note = (
        f"free joint {base.name!a:.60}: read as base: free, with six rows of the wrench on it; "
        f"--base moving leaves the joints alone, symgen convert --lock {base.name}=0 fixes it"
    )
    return replace(
        tree,
        links={name: x for name, x in tree.links.items() if name in inside},
        joints=tuple(joint for joint in tree.joints if joint.parent in inside),
        root=base.child,
        notes=(*tree.notes, note),
        floats=True,
    )


def _legend(what: str, names: dict[str, str]) -> str:
    return f"{what}: " + ", ".join(f"{name} = {of_file!a:.60}" for name, of_file in names.items())


def _robot(table: Table, file: str, sha256: str, base: Literal["fixed", "free"]) -> Robot:
    constraints = _constraints(table)
    actuated = [
        j
        for j, joint in table.joint.items()
        if j not in constraints and joint.name not in table.passive
    ]
    if not actuated:
        raise DescriptionError(
            "the file has no joint that moves; a robot needs at least one moving joint"
        )
    frames = tuple(Frame(**{**vars(f), "mu": int(f.j in actuated)}) for f in table.frames)
    values, massless = _values(table, actuated)
    links = [(j, table.tree.links[name]) for j, body in table.bodies.items() for name in body.links]
    bodies = [(j, own) for j, own in links if own is not None]
    of_base = _of_base(table) if values else {}
    gravity, constants = _gravity(table.tree.gravity)
    return Robot(
        name=_identifier(table.tree.name or file.rpartition(".")[0]),
        frames=frames,
        gravity=gravity,
        constants={**table.constants, **constants},
        elements=tuple(
            Element(family, kind, {j: {j: ONE} for j in keys}, {})
            for family, kind, value in JOINT_TERMS
            if (keys := _keys(table, family, value, actuated))
        ),
        loops=tuple(table.loops),
        constraints=constraints,
        massless=massless,
        limits=_limits(table, actuated),
        values=(of_base if base == "free" else {}) | values,
        of_base=of_base,
        labels=_labels(table),
        base=base,
        angles=table.tree.angles,
        impossible=tuple((j, f"{own.name}: {own.wrong}") for j, own in bodies if own.wrong),
        bodies=tuple((j, *_about_centre(own)) for j, own in bodies),
        not_read=table.tree.not_read,
        mounts=_mounts(table),
        file=file,
        sha256=sha256,
    )


def _about_centre(own: Inertial) -> tuple[str, float, tuple[float, ...], Any]:
    """Return name, mass, centre of mass from the origin of the link, and tensor about this centre.

    Centre and tensor have the axes of the inertial frame of the link.
    """
    c = own.pose[:3, :3].T @ own.pose[:3, 3]
    return own.name, own.M, tuple(map(float, c)), rows_of(own.I)


def _mounts(table: Table) -> tuple[tuple[str, int, Any], ...]:
    """List the links and sites of the base and of the moving bodies, with their poses in the frames."""
    tree, found = table.tree, []
    for j in (*table.joint, 0):
        body = table.bodies[j]
        for name, X in body.links.items():
            if name not in tree.bare:
                found.append((name, j, rows_of(X @ tree.places.get(name, np.eye(4)))))
        for name, (link, pose) in tree.sites.items():
            if link in body.links and name not in body.links:
                found.append((name, j, rows_of(body.links[link] @ pose)))
    return tuple(found)


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


def _keys(
    table: Table, family: str, value: Callable[[Joint], float], actuated: list[int]
) -> list[int]:
    """Find the joints that have a parameter of the family `family`, for instance FV.

    All actuated joints have it, and joints that follow others if the file gives a value. A spring
    (family K) always needs a value in the file. `value` returns the value of a joint.
    """
    return [
        j for j, joint in table.joint.items() if value(joint) or (j in actuated and family != "K")
    ]


def _limits(
    table: Table, actuated: list[int]
) -> dict[str, tuple[float, ...] | tuple[tuple[float, float], ...]]:
    """Collect limits of position, speed and torque, but each kind of limit only if all actuated
    joints have it.

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
            parameter(family, j): value(table.joint[j])
            for j in _keys(table, family, value, actuated)
        }
    return values, massless


def _of_base(table: Table) -> dict[str, float]:
    """Return the inertial parameters of link 0 by name."""
    standard = _standard(table, table.bodies[0])
    return {parameter(p, 0): x for p, x in zip(INERTIAL, standard, strict=True)}


def _standard(table: Table, body: Body) -> Array:
    """Compute XX XY XZ YY YZ ZZ MX MY MZ M of a body in its frame, shape (10,)."""
    links = [(table.tree.links[name], X) for name, X in body.links.items()]
    return sum((ten_of(own, X) for own, X in links if own is not None), start=np.zeros(10))
