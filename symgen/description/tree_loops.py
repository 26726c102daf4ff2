"""Closed loops of a URDF or MJCF file: each is cut, so that links and joints stay a tree.

A loop joins two links of the tree: a frame of one link coincides with a frame of the other,

    T_first P_first M(q) = T_second P_second

with the poses T of the links, P of the frames in the links, and the motion M that is left free:
about z (revolute), along z (prismatic), any rotation (spherical) or none (fixed).

- A revolute or prismatic loop becomes a passive cut joint on the first link, and a twin frame on
  the second.
- A spherical loop is a point that both links share. If all hinges around the loop are parallel, the
  two links turn about this direction only: the loop has the missing hinge. Otherwise, it becomes
  three hinges without mass, M = Rot(z, a) Rot(x, pi/2) Rot(z, b) Rot(x, pi/2) Rot(z, c), and the
  last is cut. The three hinges are singular if the first and the last axis are parallel. So these
  axes are the hinges of the two links, if their directions differ.
- Two points that the same links share are a hinge, three a fixed loop.
- A fixed loop (weld) makes one body of both links. The passive joint nearest to one of them is cut
instead, and the links between are turned over: a joint from parent to child, with the pose T
  and the axis a, leads from child to parent with the axis -a, followed by T^-1.

Joints around a loop are passive, unless the file says that a motor drives them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from symgen.description.tree import (
    FIXED_TYPE,
    FREE_TYPE,
    HINGE,
    SHOWN,
    Array,
    Joint,
    Tree,
    TreeLoop,
    motion,
    transform,
)
from symgen.errors import DescriptionError

PARALLEL = 1e-12  # sine of the angle between the axes of parallel hinges
OBLIQUE = 0.5  # sine of the angle from which two directions are different
CLOSED = 1e-3  # m, or an entry of a rotation: ends that are closer coincide
ROUNDED = 1e-3  # sine of the angle to which the direction of a planar loop may be rounded
APART = 1e-6  # m: points that are closer are one
FLAT = 1e-4  # m: distance along the hinges to which two ends of a planar loop may be rounded
TOLD = 1e-9  # m: a smaller one is not told
QUARTER = transform((0, 0, math.pi / 2, 0, 0, 0))  # Rot(x, pi/2)
Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Cut:
    """A loop of a tree, cut at a joint: the joint, and its place on the other branch.

    Attributes
    ----------
    joint, child : str
        Name of the cut joint, and of the link without mass that it moves.
    link : str
        The link that holds the twin.
    pose : ndarray, shape (4, 4)
        The frame of `child` in the frame of `link`, where the loop closes, at position 0 of the
        joint.
    added : tuple of str
        Names of the joints that the file does not have: the cut joint, and turns before it.
    loop : TreeLoop
        The loop.
    """

    joint: str
    child: str
    link: str
    pose: Array
    added: tuple[str, ...]
    loop: TreeLoop


def cut_open(tree: Tree) -> tuple[Tree, tuple[Cut, ...]]:
    """Return the tree with a cut joint for each of its loops, and the cuts.

    Raises DescriptionError, with the line of the loop, if the loop joins a link to itself, if a
    link does not exist, or if no passive joint is left to be cut.
    """
    tree = _merged(_of_several_points(tree))
    cuts: list[Cut] = []
    for loop in tree.loops:
        _require_links(tree, loop)
        joints = _around(tree, *loop.links)
        if not any(joint.kind != FIXED_TYPE for joint in joints):
            note = f"loop {loop.name!a:.60}: its links do not move relative to each other: left out"
            if loop.joint:
                note = f"loop {loop.name!a:.60} holds joint {loop.joint.name!a:.60}"
            tree = replace(tree, notes=(*tree.notes, note))
            continue
        tree, cut = _cut(tree, loop, joints)
        cuts.append(cut)
    return tree, tuple(cuts)


def _require_links(tree: Tree, loop: TreeLoop) -> None:
    for link in loop.links:
        if link not in tree.links:
            raise DescriptionError(
                f"loop {loop.name!a:.60}: there is no link {link!a:.60} on the base of this robot",
                line=loop.line,
            )


def passive_names(tree: Tree, cuts: tuple[Cut, ...]) -> frozenset[str]:
    """Return the names of the moving joints around the loops that no motor drives.

    Raises DescriptionError if the file names no joint with a motor around a loop, or around the
    loops that share joints with it.
    """
    around = [{joint.name for joint in _around(tree, cut.child, cut.link)} for cut in cuts]
    for cut, own in zip(cuts, around, strict=True):
        group = {*own}
        for _ in cuts:  # loops that share joints with loops that share joints ...
            group |= {name for other in around if other & group for name in other}
        if group & tree.driven:
            continue
        names = [
            joint.name
            for joint in tree.joints
            if joint.name in group - tree.relations.keys()
            and joint.kind != FIXED_TYPE
            and not any(joint.name in other.added for other in cuts)
        ]
        shown = ", ".join(f"{name!a:.60}" for name in names[:SHOWN])
        raise DescriptionError(
            f"loop {cut.loop.name!a:.60}: the file does not say which of the joints {shown} have "
            f"motors; write {tree.motor_line.format(*names[:1] or ['JOINT'])}",
            line=cut.loop.line or None,
        )
    moving = {joint.name for joint in tree.joints if joint.kind != FIXED_TYPE}
    return frozenset({name for own in around for name in own} & moving - tree.driven)


def start_of(tree: Tree, cut: Cut) -> dict[str, float]:
    """Return positions of the joints around a loop, by name, near which it is closed.

    The positions are those of `tree.start`, by default 0. The positions of the cut joint, and of
    turns before it, follow from these, if the loop is then closed.
    """
    around = [j for j in _around(tree, cut.child, cut.link) if j.kind != FIXED_TYPE]
    names = [j.name for j in around if j.name not in cut.added]
    positions = {name: tree.start.get(name, 0.0) for name in names}
    joint = next(joint for joint in around if joint.name == cut.joint)
    pose = link_poses(tree, positions)
    M = np.linalg.inv(pose[joint.parent] @ joint.pose) @ pose[cut.link] @ cut.pose
    turns = {**positions, cut.joint: math.atan2(M[1, 0], M[0, 0])}
    if joint.kind == "prismatic":
        turns[cut.joint] = float(M[2, 3])
    if len(cut.added) == 3:
        first = next(joint for joint in around if joint.name == cut.added[0])
        M = np.linalg.inv(pose[first.parent] @ first.pose) @ pose[cut.link] @ cut.pose
        b = math.atan2(math.hypot(M[0, 2], M[1, 2]), -M[2, 2])
        angles = math.atan2(M[1, 2], M[0, 2]), b, math.atan2(-M[2, 1], M[2, 0])
        turns |= dict(zip(cut.added, angles, strict=True))
    pose = link_poses(tree, turns)
    apart = np.abs(pose[cut.child] - pose[cut.link] @ cut.pose).max()
    return turns if apart < CLOSED else positions


# --- links and joints ---


def _path(tree: Tree, link: str) -> list[Joint]:
    """List the joints from the root of the tree to `link`."""
    holding = {joint.child: joint for joint in tree.joints}
    joints: list[Joint] = []
    while link in holding:
        joints.insert(0, holding[link])
        link = holding[link].parent
    return joints


def _around(tree: Tree, first: str, second: str) -> list[Joint]:
    """List the joints of the tree between two links, from either to the root of the loop."""
    one, other = _path(tree, first), _path(tree, second)
    common = {joint.child for joint in one} & {joint.child for joint in other}
    return [joint for joint in (*one, *other) if joint.child not in common]


def link_poses(tree: Tree, positions: Mapping[str, float]) -> dict[str, Array]:
    """Compute the pose (4, 4) of each link in the root link, at joint positions by name; 0 is the
    default.
    """
    pose = {tree.root: np.eye(4)}
    waiting = [tree.root]
    of: dict[str, list[Joint]] = {}
    for joint in tree.joints:
        of.setdefault(joint.parent, []).append(joint)
    while waiting:
        for joint in of.get(parent := waiting.pop(), ()):
            moved = joint.pose @ motion(joint, positions.get(joint.name, 0.0))
            pose[joint.child] = pose[parent] @ moved
            waiting.append(joint.child)
    return pose


def _new(names: Mapping[str, object] | set[str], name: str) -> str:
    while name in names:
        name += "_"
    return name


# --- loops that leave a motion: a cut joint ---


def _cut(tree: Tree, loop: TreeLoop, around: list[Joint]) -> tuple[Tree, Cut]:
    (first, second), (P, Q) = loop.links, loop.poses
    kind, own = loop.kind, loop.joint
    notes: tuple[str, ...] = ()
    turns: list[Joint] = []
    names = {joint.name for joint in tree.joints}
    name = own.name if own else _new(names, loop.name)
    child = _new(tree.links, f"{name} (cut)")
    pose = link_poses(tree, tree.start)
    axis = _common(_directions(around, pose))
    if axis is not None and _turns_about(loop, pose, axis):
        P, Q, notes = _in_the_plane(loop, pose, axis)
        kind = "revolute"
    elif kind == HINGE:
        raise DescriptionError(
            f"loop {loop.name!a:.60}: the hinges around it are not parallel, so that the direction of "
            "its own hinge must be given; write its axis",
            line=loop.line or None,
        )
    elif kind == "spherical":
        P, Q = _three_turns(tree, loop, pose)
        parent, at = first, P
        for k in (1, 2):
            link = _new(tree.links, f"{name}_turn{k}")
            turn = _new(names, f"{name}_turn{k}")
            turns.append(Joint(turn, "revolute", parent, link, at, Z, loop.line))
            parent, at = link, QUARTER
        first, P = parent, QUARTER
    cut = Joint(name, kind, first, child, P, Z, loop.line)
    if own:
        cut = replace(own, parent=first, child=child, pose=P, axis=Z)
    new = [*turns, cut]
    tree = replace(
        tree,
        joints=(*tree.joints, *new),
        links={**tree.links, **dict.fromkeys(joint.child for joint in new)},
        bare=tree.bare | {joint.child for joint in new},
        notes=(*tree.notes, *notes),
    )
    added = () if own else tuple(joint.name for joint in new)
    return tree, Cut(name, child, second, Q, added, loop)


def _directions(around: list[Joint], pose: Mapping[str, Array]) -> list[Array]:
    """List the axes of the hinges of a loop in the root link."""
    return [
        pose[joint.child][:3, :3] @ joint.axis
        for joint in around
        if joint.kind in ("revolute", "continuous")
    ]


def _common(axes: list[Array]) -> Array | None:
    """Return the direction of all axes, if they are parallel; z if there are none."""
    if not axes:
        return Z
    apart = max(float(np.linalg.norm(np.cross(axes[0], axis))) for axis in axes)
    return axes[0] if apart < PARALLEL else None


def _turns_about(loop: TreeLoop, pose: Mapping[str, Array], axis: Array) -> bool:
    """Whether a loop among hinges parallel to `axis` leaves a rotation about this direction only.

    The direction of a revolute loop may be rounded, by a sine of at most 0.001 (`ROUNDED`).
    """
    if loop.kind in ("spherical", HINGE):
        return True
    if loop.kind != "revolute" or loop.joint is not None:
        return False
    ends = zip(loop.links, loop.poses, strict=True)
    return all(
        float(np.linalg.norm(np.cross(pose[link][:3, :3] @ P[:3, 2], axis))) < ROUNDED
        for link, P in ends
    )


def _in_the_plane(
    loop: TreeLoop, pose: Mapping[str, Array], axis: Array
) -> tuple[Array, Array, tuple[str, ...]]:
    """Turn z of both frames into the axis of the hinges; remove their distance along this axis."""
    ends = []
    for link, P in zip(loop.links, loop.poses, strict=True):
        T = pose[link]
        F = np.eye(4)
        F[:3, :3], F[:3, 3] = _along(T[:3, :3].T @ axis), P[:3, 3]
        ends.append(F)
    points = [(pose[link] @ F)[:3, 3] for link, F in zip(loop.links, ends, strict=True)]
    apart = float((points[1] - points[0]) @ axis)
    if abs(apart) > FLAT:
        raise DescriptionError(
            f"loop {loop.name!a:.60}: its two ends are {abs(apart):.3g} m apart along the hinges, which "
            "are all parallel, so that it never closes; correct the point on one of the links",
            line=loop.line or None,
        )
    ends[1][:3, 3] -= pose[loop.links[1]][:3, :3].T @ axis * apart
    told = f"loop {loop.name!a:.60}: its ends are {abs(apart):.2g} m apart along the hinges, taken as 0"
    return ends[0], ends[1], (told,) if abs(apart) > TOLD else ()


def frame_along(axis: Array) -> Array:
    """Return a pose, shape (4, 4), without translation, whose z axis is the unit vector `axis`."""
    T = np.eye(4)
    T[:3, :3] = _along(axis)
    return T


def _along(axis: Array) -> Array:
    """Return a rotation whose third column is `axis`."""
    k = int(np.abs(axis).argmin())
    x = np.cross(np.eye(3)[k], axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def _three_turns(tree: Tree, loop: TreeLoop, pose: Mapping[str, Array]) -> tuple[Array, Array]:
    """Choose the directions of the first and the last of three hinges; return both frames.

    The directions are the axes of the hinges that hold the two links, or perpendicular directions,
    if these axes are nearly parallel.
    """
    directions = []
    for link, P in zip(loop.links, loop.poses, strict=True):
        hinges = [j for j in _path(tree, link) if j.kind in ("revolute", "continuous")]
        own = pose[hinges[-1].child][:3, :3] @ hinges[-1].axis if hinges else None
        directions.append(pose[link][:3, :3] @ P[:3, 2] if own is None else own)
    first, last = directions
    if np.linalg.norm(np.cross(first, last)) < OBLIQUE:
        last = _along(first)[:, 0]
    ends = []
    for link, P, axis in zip(loop.links, loop.poses, (first, last), strict=True):
        F = np.eye(4)
        F[:3, :3], F[:3, 3] = _along(pose[link][:3, :3].T @ axis), P[:3, 3]
        ends.append(F)
    return ends[0], ends[1]


# --- loops of several points ---


def _of_several_points(tree: Tree) -> Tree:
    """Make one loop of the points that the same two links share: a hinge of two points, a weld of
    three.

    Among parallel hinges, two points on one line along the hinges count as one point, and any other
    two points are a weld.
    """
    pairs: dict[frozenset[str], list[TreeLoop]] = {}
    for loop in tree.loops:
        if loop.kind == "spherical":
            pairs.setdefault(frozenset(loop.links), []).append(loop)
    loops = list(tree.loops)
    for shared in pairs.values():
        if len(shared) < 2:
            continue
        for loop in shared:
            _require_links(tree, loop)
        joined = _joined(tree, shared)
        loops = [
            joined if x is shared[0] else x for x in loops if not any(x is y for y in shared[1:])
        ]
    return replace(tree, loops=tuple(loops))


def _joined(tree: Tree, shared: list[TreeLoop]) -> TreeLoop:
    first, pose = shared[0], link_poses(tree, tree.start)
    points = [
        [
            (loop.poses if loop.links == first.links else loop.poses[::-1])[side][:3, 3]
            for loop in shared
        ]
        for side in (0, 1)
    ]
    p = np.array(points[0])
    far = p[int(np.linalg.norm(p - p[0], axis=1).argmax())] - p[0]
    if not np.linalg.norm(far) > APART:
        return first
    beside = np.linalg.norm(np.cross(p - p[0], far), axis=1) / np.linalg.norm(far)
    third = int(beside.argmax())
    second = int(np.linalg.norm(p - p[0], axis=1).argmax())
    line = pose[first.links[0]][:3, :3] @ far / np.linalg.norm(far)
    axis = _common(_directions(_around(tree, *first.links), pose))
    hinge = axis is None or float(np.linalg.norm(np.cross(line, axis))) < ROUNDED
    frames = []
    for link, own in zip(first.links, points, strict=True):
        x = own[second] - own[0]
        if beside[third] > APART:
            y = own[third] - own[0]
        elif hinge:
            y = _along(x / np.linalg.norm(x))[:, 0]
        else:
            y = np.cross(pose[link][:3, :3].T @ axis, x)
        x = x / np.linalg.norm(x)
        z = np.cross(x, y) / np.linalg.norm(np.cross(x, y))
        F = np.eye(4)
        F[:3, :3] = np.column_stack([x, np.cross(z, x), z])
        F[:3, 3] = own[0]
        frames.append(F)
    if hinge and not beside[third] > APART:
        turned = transform((0, 0, 0, 0, 0, 0))
        turned[:3, :3] = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])  # z along the line
        frames = [F @ turned for F in frames]
        return replace(first, kind="revolute", poses=(frames[0], frames[1]))
    return replace(first, kind=FIXED_TYPE, poses=(frames[0], frames[1]))


# --- loops that leave no motion: two links become one body ---


def _merged(tree: Tree) -> Tree:
    """Return the tree in which the two links of each fixed loop are one body."""
    for loop in tree.loops:
        if loop.kind == FIXED_TYPE:
            _require_links(tree, loop)
            tree = _weld(replace(tree, loops=tuple(x for x in tree.loops if x is not loop)), loop)
    return tree


def _weld(tree: Tree, loop: TreeLoop) -> Tree:
    around = _around(tree, *loop.links)
    if not any(joint.kind != FIXED_TYPE for joint in around):
        note = f"loop {loop.name!a:.60} ties two links of one body: left out"
        return replace(tree, notes=(*tree.notes, note))
    related = tree.relations.keys() | {a for e in tree.relations.values() for a in e.atoms}
    places: list[tuple[bool, int, int, Joint]] = []
    for side in (1, 0):  # the second link is tied to the first, rather than the first to the second
        own = [joint for joint in reversed(_path(tree, loop.links[side])) if joint in around]
        for k, joint in enumerate(own):
            if joint.kind != FIXED_TYPE and joint.name not in tree.driven | related:
                places.append((joint.kind != FREE_TYPE, k, 1 - side, joint))
    if not places:
        names = ", ".join(f"{j.name!a:.60}" for j in around if j.kind != FIXED_TYPE)
        raise DescriptionError(
            f"loop {loop.name!a:.60} ties two links between which only joints with motors or relations "
            f"move ({names}), so that no joint can be cut; leave out the motor of a joint that follows",
            line=loop.line or None,
        )
    _, _, other, cut = min(places, key=lambda place: place[:3])
    side = 1 - other
    tree = _turned_over(tree, cut, loop.links[side])
    P, Q = loop.poses if side == 1 else loop.poses[::-1]
    name = _new({joint.name for joint in tree.joints}, f"{loop.name} (fixed)")
    pose = P @ np.linalg.inv(Q)
    tie = Joint(name, FIXED_TYPE, loop.links[other], loop.links[side], pose, Z, loop.line)
    tree = replace(tree, joints=(*tree.joints, tie))
    if cut.kind == FREE_TYPE:
        return tree
    S = frame_along(cut.axis)
    kind = "prismatic" if cut.kind == "prismatic" else "revolute"
    opened = TreeLoop(
        loop.name, kind, (cut.parent, cut.child), (cut.pose @ S, S), loop.line, joint=cut
    )
    return replace(tree, loops=(*tree.loops, opened))


def _turned_over(tree: Tree, cut: Joint, link: str) -> Tree:
    """Remove the joint `cut` from the tree; `link` becomes the root of the part that it moved."""
    joints, links, bare = [j for j in tree.joints if j is not cut], dict(tree.links), {*tree.bare}
    path = _path(tree, link)
    for joint in path[path.index(cut) + 1 :]:
        back = np.linalg.inv(joint.pose)
        k = joints.index(joint)
        if joint.kind == FIXED_TYPE:
            joints[k] = replace(joint, parent=joint.child, child=joint.parent, pose=back)
            continue
        end = _new(links, f"{joint.parent} ({joint.name})")
        links[end] = None
        bare.add(end)
        joints[k] = replace(
            joint, parent=joint.child, child=end, pose=np.eye(4), axis=-1.0 * joint.axis
        )
        joints.append(Joint(f"{end} (fixed)", FIXED_TYPE, end, joint.parent, back, Z, joint.line))
    return replace(tree, joints=tuple(joints), links=links, bare=frozenset(bare))
