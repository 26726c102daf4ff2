"""URDF to a Robot: a tree of joints with any axes becomes a table of Khalil and Kleinfinger, inertials become standard parameters.

Links joined by fixed joints are one body. Body j moves about or along z_j, the axis of its joint; x_i lies on the common normal of z_i and of the
axis of the first joint that body i carries, so that this joint has gamma = b = 0; further branches have them. Parallel axes: the
normal through the origin. Axes that are nearly parallel have no usable normal: a fixed frame without link turns in between. A joint position
is that of the URDF, sign and zero included; frame 0 is the root link's.

Lengths become constants, equal ones (but for the sign) the same constant, so that the formulas know what is special about the robot. With pose
jX of a URDF link in frame j, centre of mass c and rotation R = jR of the inertia I of the file:

    M,    MS = M c,    J = R I R' + M (c'c 1 - c c')        tensor elements about the origin of frame j, summed over the links of a body
"""

from __future__ import annotations

import hashlib
import keyword
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from symgen.description.expression import ONE, PI, ZERO, Expression
from symgen.description.robot import FIXED, INERTIAL, PRISMATIC, REVOLUTE, Element, Frame, Robot, parameter
from symgen.description.urdf_text import FIXED_TYPE, Array, Joint, Urdf, parse_urdf, turn
from symgen.errors import DescriptionError

DIGITS = 13  # decimals kept of lengths (m) and angles (rad)
SAME = 1e-12  # m, rad: closer is equal
STEEP = 0.02  # sine of the angle of two axes below which their common normal is too far away to compute with
GRAVITY = 9.81  # m/s^2, along -z of the root link


@dataclass
class _Body:
    """Body j while its frame is placed: URDF links with their poses in it, joints it carries with the poses of their parent links."""

    links: dict[str, Array]
    joints: list[tuple[Joint, Array]]


@dataclass
class _Table:
    """The table as it grows."""

    urdf: Urdf
    frames: list[Frame] = field(default_factory=list)
    constants: dict[str, float] = field(default_factory=dict)
    joint: dict[int, Joint] = field(default_factory=dict)
    bodies: dict[int, _Body] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def read_urdf(content: bytes, file: str, *, nearly: float = 0.0) -> tuple[Robot, tuple[str, ...]]:
    """The robot of a URDF, and notes: which joint is which q, and what was not read.

    Parameters
    ----------
    content, file : bytes and name of the file.
    nearly : rad; angles of the file this close to a multiple of pi/12 are taken as that, 1e-4 for files that say 1.5708.

    Raises
    ------
    DescriptionError : no URDF, or no tree of revolute, prismatic and fixed joints; names file and line.
    """
    try:
        urdf = parse_urdf(content, nearly)
        table = _Table(urdf)
        _place(table)
        robot = _robot(table, file, hashlib.sha256(content).hexdigest())
    except DescriptionError as error:
        joint = table.joint.get(int(str(error.path[1]))) if len(error.path) > 1 and error.line is None else None
        line = error.line or (joint.line if joint else 1)
        raise DescriptionError(error.message, path=error.path, file=file, line=line) from error.__cause__
    return robot, (_legend(table), *urdf.notes, *table.notes)


def _legend(table: _Table) -> str:
    return "joints: " + ", ".join(f"q{j} = {joint.name!a:.60}" for j, joint in table.joint.items())


# --- frames -----------------------------------------------------------------------------------------------------------


def _place(table: _Table) -> None:
    """Frames of all bodies, a body before what it carries, branch by branch."""
    table.bodies[0] = _body(table.urdf, table.urdf.root, np.eye(4))
    waiting = [(0, *carried) for carried in reversed(table.bodies[0].joints)]
    while waiting:
        ant, joint, parent = waiting.pop()
        j = _add(table, ant, joint, parent)
        waiting += [(j, *carried) for carried in reversed(table.bodies[j].joints)]


def _body(urdf: Urdf, link: str, pose: Array) -> _Body:
    """The links that fixed joints hold on `link`, whose pose is given, and the joints they carry."""
    body, waiting = _Body({link: pose}, []), [link]
    while waiting:
        link = waiting.pop(0)
        for joint in (joint for joint in urdf.joints if joint.parent == link):
            if joint.kind == FIXED_TYPE:
                body.links[joint.child] = body.links[link] @ joint.pose
                waiting.append(joint.child)
            else:
                body.joints.append((joint, body.links[link]))
    order = {joint.name: k for k, joint in enumerate(urdf.joints)}
    body.joints.sort(key=lambda carried: order[carried[0].name])
    return body


def _add(table: _Table, ant: int, joint: Joint, parent: Array) -> int:
    """Frame of `joint` on body `ant`, where its parent link has pose `parent`; returns its number."""
    pose = parent @ joint.pose
    axis, point = pose[:3, :3] @ joint.axis, pose[:3, 3]
    if _nearly_parallel(axis):
        angle = math.hypot(axis[0], axis[1])
        table.notes.append(
            f"axis of {joint.name!a:.60} is parallel to its antecedent's within {angle:.2g} rad; where parallel is meant, --snap 1e-4 rounds angles"
        )
        to_aside, aside = _row(table, ant, FIXED, _normal(np.array([1.0, 0.0, 0.0]), point))
        pose = np.linalg.inv(to_aside) @ pose
        axis, point, ant = pose[:3, :3] @ joint.axis, pose[:3, 3], aside
    before = _numbered(_normal(axis, point))
    body = _body(table.urdf, joint.child, np.linalg.inv(_transform((*before, 0.0, 0.0))) @ pose)
    theta = r = 0.0
    if body.joints:
        first, link = body.joints[0]
        carried = link @ first.pose
        along = carried[:3, :3] @ first.axis
        if not _nearly_parallel(along):
            theta, r, _, _ = _normal(along, carried[:3, 3])
            theta, r = _numbered((theta, r))
    sigma = PRISMATIC if joint.kind == "prismatic" else REVOLUTE
    _, j = _row(table, ant, sigma, before, theta, r)
    own = np.linalg.inv(_transform((0.0, 0.0, 0.0, 0.0, theta, r)))
    table.bodies[j] = _Body({name: own @ X for name, X in body.links.items()}, [(held, own @ X) for held, X in body.joints])
    table.joint[j] = joint
    return j


def _nearly_parallel(axis: Array) -> bool:
    """Whether the common normal of z and `axis` is too far away to compute with."""
    return SAME < math.hypot(axis[0], axis[1]) < STEEP


def _normal(axis: Array, point: Array) -> tuple[float, float, float, float]:
    """gamma, b, alpha, d to the line through `point` along `axis`, both in the frame before it; |gamma| <= pi/2."""
    x, y, z = axis
    s = math.hypot(x, y)
    if s <= SAME:  # parallel
        d = math.hypot(point[0], point[1])
        gamma, b, alpha = (math.atan2(point[1], point[0]) if d > SAME else 0.0), 0.0, (0.0 if z > 0 else math.pi)
    else:  # normal z_i x z_j
        gamma, alpha = math.atan2(x, -y), math.atan2(s, z)
        d = (-y * point[0] + x * point[1]) / s
        b = point[2] - z * (x * point[0] + y * point[1]) / s**2
    if abs(gamma) > math.pi / 2 + SAME:  # the same normal, x the other way
        gamma, alpha, d = gamma - math.copysign(math.pi, gamma), -alpha, -d
    return gamma, b, alpha, d


def _transform(row: Sequence[float]) -> Array:
    """Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r), (4, 4)."""
    gamma, b, alpha, d, theta, r = row
    T = np.eye(4)
    for axis, angle, shift in ((2, gamma, b), (0, alpha, d), (2, theta, r)):
        step = np.eye(4)
        step[:3, :3], step[axis, 3] = turn(axis, angle), shift
        T = T @ step
    return T


def _numbered(row: Sequence[float]) -> tuple[float, ...]:
    """The numbers as the table holds them: multiples of pi/12 exact, DIGITS decimals. Angles first, lengths second, in turn."""
    return tuple(_angle(x)[0] if k % 2 == 0 else round(x, DIGITS) + 0.0 for k, x in enumerate(row))


def _angle(x: float) -> tuple[float, Expression]:
    turns = round(x * 12 / math.pi)
    if abs(x - turns * math.pi / 12) <= SAME:
        return turns * math.pi / 12, PI * Fraction(turns, 12)
    return round(x, DIGITS), _exact(round(x, DIGITS))


def _exact(x: float) -> Expression:
    return Expression.number(Fraction(repr(x)))


def _row(table: _Table, ant: int, sigma: int, before: Sequence[float], theta: float = 0.0, r: float = 0.0) -> tuple[Array, int]:
    """Append a frame; returns its pose at q = 0 in its antecedent and its number."""
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
    return _transform((*before, theta, r)), j


def _length(table: _Table, name: str, x: float) -> Expression:
    """0, or a constant of this value, the one that is there already if it is equal."""
    if abs(x) <= SAME:
        return ZERO
    known = next((k for k, value in table.constants.items() if abs(abs(value) - abs(x)) <= SAME), None)
    if known is None:
        table.constants[name] = abs(x)
        known = name
    return Expression.symbol(known) * (1 if x > 0 else -1)


# --- the robot --------------------------------------------------------------------------------------------------------


def _robot(table: _Table, file: str, sha256: str) -> Robot:
    constraints = _mimics(table)
    actuated = [j for j in table.joint if j not in constraints]
    if not actuated:
        raise DescriptionError("no joint that moves; a robot has at least one")
    frames = tuple(Frame(**{**vars(f), "mu": int(f.j in actuated)}) for f in table.frames)
    along = {j: {j: ONE} for j in actuated}
    return Robot(
        name=_identifier(table.urdf.name or file.rpartition(".")[0]),
        frames=frames,
        gravity=(ZERO, ZERO, -Expression.symbol("g")),
        constants={**table.constants, "g": GRAVITY},
        elements=tuple(
            Element(family, kind, along, {})
            for family, kind in (("Ia", "inertia"), ("FV", "viscous"), ("FS", "coulomb"), ("OFFSET", "offset"))
        ),
        constraints=constraints,
        massless=frozenset(f.j for f in frames if f.sigma == FIXED),
        limits=_limits(table, actuated),
        values=_values(table, actuated),
        file=file,
        sha256=sha256,
    )


def _identifier(name: str) -> str:
    name = re.sub(r"\W", "_", name, flags=re.ASCII)[:34] or "robot"
    return f"robot_{name}" if not name[0].isalpha() or keyword.iskeyword(name) else name


def _mimics(table: _Table) -> dict[int, Expression]:
    """q_j = multiplier q_k + offset of the joints that follow an actuated one, through any that follow each other."""
    number = {joint.name: j for j, joint in table.joint.items()}
    found: dict[int, Expression] = {}
    for j, joint in table.joint.items():
        if joint.mimic is None:
            continue
        leader, multiplier, offset, seen = joint, Fraction(1), Fraction(0), {joint.name}
        while leader.mimic is not None:
            name, factor, shift = leader.mimic
            if name in seen or name not in number:
                what = "joints follow each other in a circle" if name in seen else f"there is no moving joint {name[:60]!r} to follow"
                raise DescriptionError(f"joint {joint.name!r}: {what}", line=joint.line)
            seen.add(name)
            offset += multiplier * Fraction(repr(shift))
            multiplier *= Fraction(repr(factor))
            leader = table.joint[number[name]]
        found[j] = Expression.symbol(f"q{number[leader.name]}") * multiplier + offset
    return found


def _limits(table: _Table, actuated: list[int]) -> dict[str, tuple[float, ...] | tuple[tuple[float, float], ...]]:
    """Limits that every actuated joint has; a kind that one joint lacks is left out and noted."""
    rows = [table.joint[j] for j in actuated]
    found: dict[str, tuple[float, ...] | tuple[tuple[float, float], ...]] = {}
    bounds = tuple((joint.limits.get("lower", 0.0), joint.limits.get("upper", 0.0)) for joint in rows)
    if all(low < high for low, high in bounds) and all(joint.kind != "continuous" for joint in rows):
        found["q"] = bounds
    for here, there in (("qd", "velocity"), ("tau", "effort")):
        largest = tuple(joint.limits.get(there, 0.0) for joint in rows)
        if all(x > 0 for x in largest):
            found[here] = largest
    if missing := [key for key in ("q", "qd", "tau") if key not in found]:
        table.notes.append(f"limits of {', '.join(missing)} left out: not every actuated joint has them")
    return found


def _values(table: _Table, actuated: list[int]) -> dict[str, float]:
    """Standard parameters by name; empty where no link has an <inertial>."""
    links = table.urdf.links
    if not any(links[name] is not None for j, body in table.bodies.items() if j for name in body.links):
        table.notes.append("no link has an <inertial>: the robot has no values")
        return {}
    values: dict[str, float] = {}
    for j, body in table.bodies.items():
        if not j:
            continue
        if all(links[name] is None for name in body.links):
            table.notes.append(f"no <inertial> on {', '.join(f'{name!a:.60}' for name in body.links)}: values of link {j} are 0")
        values |= {parameter(p, j): x for p, x in zip(INERTIAL, _standard(table, body), strict=True)}
        if j in actuated:
            values |= {parameter("Ia", j): 0.0, parameter("FV", j): table.joint[j].damping, parameter("FS", j): table.joint[j].friction}
            values[parameter("OFFSET", j)] = 0.0
        elif table.joint[j].damping or table.joint[j].friction:
            table.notes.append(f"friction of {table.joint[j].name!a:.60}, which follows another joint, is not read")
    return values


def _standard(table: _Table, body: _Body) -> tuple[float, ...]:
    """XX XY XZ YY YZ ZZ MX MY MZ M of a body in its frame."""
    M, MS, J = 0.0, np.zeros(3), np.zeros((3, 3))
    for name, X in body.links.items():
        inertial = table.urdf.links[name]
        if inertial is not None:
            own = X @ inertial.pose
            R, c = own[:3, :3], own[:3, 3]
            M, MS = M + inertial.M, MS + inertial.M * c
            J = J + R @ inertial.I @ R.T + inertial.M * (c @ c * np.eye(3) - np.outer(c, c))
    return (*(float(x) for x in J[np.triu_indices(3)]), *(float(x) for x in MS), M)
