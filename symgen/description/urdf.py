"""Reader of URDF files: the XML text becomes a tree of links and joints.

`tree_robot` converts the tree to Khalil frames and adds the values. Numbers are read as they are;
meshes, textures and packages are never opened. A URDF library would load such files, and its XML
parser would expand entities, which `xml_text` refuses. Every error names its line.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator

import numpy as np

from symgen.description.angles import Angles
from symgen.description.expression import Expression, ratio
from symgen.description.tree import (
    DROPPED,
    FIXED_TYPE,
    FREE_TYPE,
    MAX_JOINTS,
    MOVING,
    Inertial,
    Joint,
    Tree,
    rotation,
)
from symgen.description.xml_text import LARGEST, Array, XmlElement, read_elements
from symgen.errors import DescriptionError

Mimic = tuple[str, Expression]  # joint that is followed, and the position by its own
FREE = ("floating", "planar")  # joints that have to be held
MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
# children of an element that are read, and <material>, which says nothing that is left out
READ = {
    "robot": {"link", "joint", "material"},
    "link": {"inertial"},
    "joint": {"parent", "child", "origin", "axis", "limit", "dynamics", "mimic"},
}


ROUNDING = 1e-6  # of moments that a file rounds


def parse_urdf(content: bytes, file: str, *, exact: bool = False) -> Tree:
    """Read the links and joints of a URDF file as a Tree.

    `exact` is used as in `read_tree`.
    """
    angles = Angles(exact)
    root = read_elements(content)
    if root.tag != "robot":
        raise DescriptionError(f"found <{root.tag[:40]}>; expected <robot>", line=root.line)
    links: dict[str, Inertial | None] = {}
    joints: list[Joint] = []
    mimics: dict[str, Mimic] = {}
    for e in root:
        if e.tag == "link":
            if (name := e.word("name")) in links:
                raise DescriptionError(f"link {name!r} is given twice; keep one", line=e.line)
            links[name] = _inertial(e, angles)
        elif e.tag == "joint":
            joints.append(_joint(e, angles))
            if joints[-1].kind != FIXED_TYPE and (mimic := e.find("mimic")) is not None:
                leader = mimic.word("joint")
                factor, offset = (
                    Expression.number(ratio(mimic.number(key, default)))
                    for key, default in (("multiplier", "1"), ("offset", "0"))
                )
                mimics[joints[-1].name] = leader, factor * Expression.symbol(leader) + offset
    if len(joints) > MAX_JOINTS:
        raise DescriptionError(
            f"the file has {len(joints)} joints; the limit is {MAX_JOINTS}", line=root.line
        )
    base = _root(links, joints, root.line)
    other = Counter(_left_out(root))
    notes: tuple[str, ...] = (
        (f"{DROPPED} {', '.join(f'{other[tag]} <{tag:.40}>' for tag in sorted(other))}",)
        if other
        else ()
    )
    carried = {base}
    while further := {j.child for j in joints if j.parent in carried} - carried:
        carried |= further
    if lost := sorted(links.keys() - carried):
        raise DescriptionError(
            f"links {', '.join(lost[:5])} are not connected to {base!r}; their joints form a cycle",
            line=root.line,
        )
    angles_text, snapped = angles.report(file)
    notes += snapped
    points = [
        e.word("name")
        for e in root
        if e.tag == "link"
        and (own := e.find("inertial")) is not None
        and own.find("inertia") is None
    ]
    notes += (
        (f"no <inertia>, taken as point masses: {', '.join(f'{name!a:.60}' for name in points)}",)
        if points
        else ()
    )
    return Tree(
        root.attrib.get("name", ""),
        links,
        tuple(joints),
        base,
        _relations(joints, mimics),
        notes=notes,
        angles=angles_text,
    )


def _left_out(root: XmlElement) -> Iterator[str]:
    """Yield the tags of XML elements in the robot, its links and joints that are not read."""
    for e in (root, *root):
        yield from (child.tag for child in e if e.tag in READ and child.tag not in READ[e.tag])


def _relations(joints: list[Joint], mimics: dict[str, Mimic]) -> dict[str, Expression]:
    """Express the position of each mimic joint by that of the joint at the end of its mimic chain.

        q = multiplier q_leader + offset

    If the leader is a mimic joint too, its own leader is used, and so on.
    """
    moving = {joint.name for joint in joints if joint.kind != FIXED_TYPE}
    relations: dict[str, Expression] = {}
    for joint in (joint for joint in joints if joint.name in mimics):
        leader, position, followed = joint.name, Expression.symbol(joint.name), {joint.name}
        while leader in mimics:
            follower, (leader, own) = leader, mimics[leader]
            if leader in followed or leader not in moving:
                what = (
                    "joints follow each other in a circle"
                    if leader in followed
                    else f"there is no moving joint {leader[:60]!r} to follow"
                )
                raise DescriptionError(f"joint {joint.name!r}: {what}", line=joint.line)
            followed.add(leader)
            position = position.substitute({follower: own})
        relations[joint.name] = position
    return relations


def _pose(holder: XmlElement, what: str, angles: Angles) -> Array:
    """Read the <origin> of a link or joint as a pose, shape (4, 4).

    Its rotation is R = Rz(yaw) Ry(pitch) Rx(roll).
    """
    T, e = np.eye(4), holder.find("origin")
    if e is None:
        return T
    rpy = e.numbers("rpy", 3, "0 0 0").tolist()
    T[:3, :3] = rotation(rpy, f"{what} (line {e.line})", angles)
    T[:3, 3] = e.numbers("xyz", 3, "0 0 0")
    return T


def _inertial(link: XmlElement, angles: Angles) -> Inertial | None:
    e = link.find("inertial")
    if e is None:
        return None
    mass, inertia = e.find("mass"), e.find("inertia")
    if mass is None:
        raise DescriptionError("<inertial> needs <mass>", line=e.line)
    M = mass.number("value")
    if M < 0:
        raise DescriptionError(f"mass {M}; expected 0 or more", line=mass.line)
    pose = _pose(e, f"link {link.word('name')!a:.60}", angles)
    if inertia is None:  # a point mass: programs that read URDF say so and go on
        return Inertial(M, pose, np.zeros((3, 3)))
    xx, xy, xz, yy, yz, zz = (inertia.number(name) for name in MOMENTS)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    wrong = no_body(M, tensor)
    name = f"link {link.word('name')!a:.60} (line {inertia.line})"
    return Inertial(M, pose, tensor, f"{name}: {wrong}" if wrong else "")


def no_body(M: float, tensor: Array) -> str:
    """Explain why no body has mass M and this tensor about its centre of mass; "" if a body can."""
    if not M and tensor.any():
        return "mass 0 with an inertia"
    small, middle, large = np.linalg.eigvalsh(tensor)
    if small >= -ROUNDING * abs(large) and large <= (1 + ROUNDING) * (small + middle):
        return ""
    names = ("ixx", "iyy", "izz")
    for k, name in enumerate(names):
        others = [other for other in names if other != name]
        rest = np.trace(tensor) - tensor[k, k]
        if tensor[k, k] > (1 + ROUNDING) * rest:
            return (
                f"no body has this inertia about its centre of mass: {name} {tensor[k, k]:g} > "
                f"{' + '.join(others)} {rest:g}"
            )
    return (
        "no body has this inertia about its centre of mass: principal moments "
        f"{small:.3g}, {middle:.3g}, {large:.3g}"
    )


def _joint(e: XmlElement, angles: Angles) -> Joint:
    kind, name = e.word("type"), e.word("name")
    if kind not in (*MOVING, FIXED_TYPE, *FREE):
        raise DescriptionError(
            f"joint {name!r} has the type {kind[:30]!r}; expected {', '.join(MOVING)} "
            f"or {FIXED_TYPE}",
            line=e.line,
        )
    kind = FREE_TYPE if kind in FREE else kind
    ends = {tag: child for tag in ("parent", "child") if (child := e.find(tag)) is not None}
    if len(ends) < 2:
        raise DescriptionError(
            f"joint {name!r} needs <parent link=...> and <child link=...>", line=e.line
        )
    given = e.find("axis")
    axis = np.array([1.0, 0.0, 0.0]) if given is None else given.numbers("xyz", 3, "1 0 0")
    length = float(np.linalg.norm(axis))
    if kind in (FIXED_TYPE, FREE_TYPE):
        axis, length = np.array([0.0, 0.0, 1.0]), 1.0  # of no meaning; some files say 0 0 0
    if length < 1e-6:
        raise DescriptionError(
            f"joint {name!r}: axis {axis.tolist()} has no direction; expected an axis such as 0 0 1",
            line=(e if given is None else given).line,
        )
    limit, dynamics = e.find("limit"), e.find("dynamics")
    keys = ("lower", "upper", "velocity", "effort")
    bounds = (
        {key: limit.number(key, largest=sys.float_info.max) for key in keys if key in limit.attrib}
        if limit is not None
        else {}
    )
    limits = {
        key: x for key, x in bounds.items() if abs(x) <= LARGEST
    }  # some files say 1e16 for none
    damping, friction = (
        0.0 if dynamics is None else dynamics.number(key, "0") for key in ("damping", "friction")
    )
    axis = axis if abs(length - 1) < 1e-15 else axis / length
    links = (ends["parent"].word("link"), ends["child"].word("link"))
    pose = _pose(e, f"joint {name!a:.60}", angles)
    return Joint(name, kind, *links, pose, axis, e.line, limits, damping, friction)


def _root(links: dict[str, Inertial | None], joints: list[Joint], line: int) -> str:
    """Find the base, the only link without a parent, and check the joints.

    Raises DescriptionError if a joint names a link that does not exist, or if a link has two
    parents.
    """
    parent: dict[str, str] = {}
    names: set[str] = set()
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise DescriptionError(
                    f"joint {joint.name!r}: there is no link {link[:60]!r}", line=joint.line
                )
        if joint.child in parent:
            raise DescriptionError(
                (
                    f"joint {joint.name!r}: link {joint.child!r} has a parent already; in a URDF a "
                    "link has only one parent joint"
                ),
                line=joint.line,
            )
        if joint.name in names:
            raise DescriptionError(
                f"joint {joint.name!r} is given twice; keep one", line=joint.line
            )
        names.add(joint.name)
        parent[joint.child] = joint.parent
    roots = [link for link in links if link not in parent]
    if len(roots) != 1:
        none = "none: the joints form a cycle" if links else "none: there is no <link>"
        roots_text = ", ".join(map(repr, roots[:5])) or none
        raise DescriptionError(
            f"links without parent: {roots_text}; expected one such link, the base", line=line
        )
    return roots[0]
