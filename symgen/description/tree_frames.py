"""Conversion of a tree of links and joints into a frame table of Khalil and Kleinfinger.

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
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from symgen.description.expression import PI, ZERO, Expression, twelfths
from symgen.description.robot import FIXED, PRISMATIC, REVOLUTE, Frame
from symgen.description.tree import FIXED_TYPE, Array, Joint, Tree, transform

DIGITS = 13  # decimals kept of lengths (m) and angles (rad)
SAME = 1e-12  # m, rad: closer is equal
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
    """

    tree: Tree
    frames: list[Frame] = field(default_factory=list)
    constants: dict[str, float] = field(default_factory=dict)
    joint: dict[int, Joint] = field(default_factory=dict)
    bodies: dict[int, Body] = field(default_factory=dict)
    fixed_links: dict[int, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def placed(tree: Tree, *, keep_fixed: bool = False) -> Table:
    """Choose the frames of all bodies of a tree, from the root outward, and return the frame table.

    A body comes before the bodies that are mounted on it, branch by branch. If `keep_fixed`, the
    frames of links on fixed joints come last.
    """
    table = Table(tree)
    table.bodies[0] = _body(tree, tree.root, np.eye(4))
    waiting = [(0, joint, parent) for joint, parent in reversed(table.bodies[0].joints)]
    while waiting:
        ant, joint, parent = waiting.pop()
        j = _add(table, ant, joint, parent)
        waiting += [(j, child, link) for child, link in reversed(table.bodies[j].joints)]
    if keep_fixed:
        for j, body in table.bodies.items():
            for name, pose in list(body.links.items())[1:]:
                _keep(table, j, name, pose)
    return table


def _keep(table: Table, ant: int, name: str, pose: Array) -> None:
    """Append a fixed frame on frame `ant` for the link `name`, which has `pose` in frame `ant`."""
    if _nearly_parallel(pose[:3, 2]):
        to_aside, ant = _row(table, ant, FIXED, _normal(np.array([1.0, 0.0, 0.0]), pose[:3, 3]))
        pose = np.linalg.inv(to_aside) @ pose
    before = _numbered(_normal(pose[:3, 2], pose[:3, 3]))
    rest = np.linalg.inv(transform((*before, 0.0, 0.0))) @ pose
    theta, r = _numbered((math.atan2(rest[1, 0], rest[0, 0]), rest[2, 3]))
    _, j = _row(table, ant, FIXED, before, theta, r)
    table.fixed_links[j] = name


def _body(tree: Tree, link: str, pose: Array) -> Body:
    """Collect the links fixed to `link`, and the moving joints mounted on these links.

    `pose` is the pose of `link`; the result has all poses in the same frame.
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
    if body.joints:
        first, link = body.joints[0]
        placed_joint = link @ first.pose
        along = placed_joint[:3, :3] @ first.axis
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

    Angles that are multiples of pi/12 are exact; other numbers get DIGITS decimals.
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
