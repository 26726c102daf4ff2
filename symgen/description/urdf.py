"""URDF files: the XML text becomes a tree of links and joints; a Robot with values becomes a URDF.

Reading. `tree_robot` converts the tree to Khalil frames and adds the values. Numbers are read as
they are; meshes, textures and packages are never opened. A URDF library would load such files, and
its XML parser would expand entities, which `xml_text` refuses. Every error names its line.

Writing. Each frame becomes one link and one joint; notes list the data that a URDF cannot store.
Joint axes are z axes, and link frames are Khalil's. The joint frame is iTj at q_j = 0, as x y z and
roll, pitch, yaw. Inertials are about the centre of mass c = MS / M:

    I = J - M (c'c 1 - c c')
"""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from xml.sax.saxutils import quoteattr

import numpy as np

from symgen.description.angles import Angles
from symgen.description.bodies import no_body
from symgen.description.expression import Expression, ratio
from symgen.description.robot import (
    FIXED,
    INERTIAL,
    PRISMATIC,
    REVOLUTE,
    Frame,
    Robot,
    one_joint_parameters,
    parameter,
)
from symgen.description.tree import (
    DROPPED,
    FIXED_TYPE,
    FREE_TYPE,
    HINGE,
    MAX_JOINTS,
    MOVING,
    Inertial,
    Joint,
    Tree,
    TreeLoop,
    inertial_of,
    rotation,
    transform,
    turn,
)
from symgen.description.tree_loops import frame_along, link_poses
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
# children without effect on the torques; of others it is not known
HARMLESS = {
    "robot": {"gazebo", "mujoco", "ros2_control", "sensor", "transmission", "verbose"},
    "link": {"audio", "capsule", "collision", "contact", "material", "origin", "self_collision_checking", "sensor", "visual"},
    "joint": {"calibration", "hardwareInterface", "safety_controller", "sensor"},
}  # fmt: skip
# children of <gazebo> that change the torques, and the values that do not
FORCES = {
    "turnGravityOff": ("", "0", "false"),
    "gravity": ("", "1", "true"),
    "springStiffness": ("", "0", "0.0"),
    "inertial": (),
}


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
    if (moving := sum(joint.kind != FIXED_TYPE for joint in joints)) > MAX_JOINTS:
        raise DescriptionError(
            f"the file has {moving} joints that move; the limit is {MAX_JOINTS}", line=root.line
        )
    rotors, unread = _rotors(root)
    joints = [replace(joint, armature=rotors.get(joint.name, 0.0)) for joint in joints]
    driven = _driven(root)
    joints, second = _first_parents(joints, driven)
    base = _root(links, [*joints, *second], joints, root.line)
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
    tree = Tree(
        root.attrib.get("name", ""),
        links,
        tuple(joints),
        base,
        _relations(joints, mimics),
        notes=notes,
        angles=angles_text,
        not_read=(*_not_read(root), *unread),
        driven=driven,
        motor_line=f"`actuated: [{{}}]` into {loops_name(file)} beside the file",
    )
    return replace(tree, loops=(*map(_second_parent, second), *_loops(root, tree, angles)))


def loops_name(file: str) -> str:
    """Return the name of the file that has the loops of a URDF or MJCF: arm.loops.yaml of arm.urdf."""
    return f"{file.rpartition('.')[0]}.loops.yaml"


def _driven(root: XmlElement) -> frozenset[str]:
    """Return the names of the joints that a <transmission> or a command of <ros2_control> drives."""
    driven = {
        joint.attrib.get("name", "")
        for tag in ("transmission", "ros2_control")
        for e in root.own(tag)
        for joint in e.iter("joint")
        if tag == "transmission" or joint.find("command_interface") is not None
    }
    return frozenset(driven - {""})


def _first_parents(joints: list[Joint], driven: frozenset[str]) -> tuple[list[Joint], list[Joint]]:
    """Divide the joints into one for each child link, which make the tree, and those that close
    loops because their child has a parent already.

    If a link has two parents, the joint with a motor belongs to the tree.
    """
    first: dict[str, Joint] = {}
    for joint in joints:
        before = first.get(joint.child)
        if before is None or (joint.name in driven and before.name not in driven):
            first[joint.child] = joint
    tree = [joint for joint in joints if first[joint.child] is joint]
    return tree, [joint for joint in joints if first[joint.child] is not joint]


def _second_parent(joint: Joint) -> TreeLoop:
    """Return the loop that a joint closes, whose child link another joint holds."""
    if joint.kind == FREE_TYPE:
        raise DescriptionError(
            f"joint {joint.name!r}: link {joint.child!r} has a parent already, so that this free joint "
            "ties nothing; remove this joint",
            line=joint.line,
        )
    kind = "revolute" if joint.kind == "continuous" else joint.kind
    own = None if kind == FIXED_TYPE else joint
    S = frame_along(joint.axis)
    ends = (joint.parent, joint.child)
    return TreeLoop(joint.name, kind, ends, (joint.pose @ S, S), joint.line, own)


# the ends of a loop: tags of both links, of their frames (in <ROBOT>, or in the link), and of the axis
_LOOP_TAGS = {
    "loop_joint": (("link1", "link2"), None, "axis"),
    "loop": (("predecessor", "successor"), ("origin", "origin"), "axis"),
    "constraint": (("parent", "child"), ("parent_origin", "child_origin"), "parent_axis"),
}
_LOOP_KINDS = {
    "revolute": "revolute", "continuous": "revolute", "hinge": "revolute", "prismatic": "prismatic",
    "spherical": "spherical", "ball": "spherical", "fixed": FIXED_TYPE,
}  # fmt: skip


def _loop_tag(e: XmlElement) -> str:
    return e.tag.rpartition(":")[2]


def _is_loop(e: XmlElement) -> bool:
    """Whether an element of <robot> closes a loop, in a form that is read."""
    tags = _LOOP_TAGS.get(_loop_tag(e))
    if tags is None or e.attrib.get("type") not in _LOOP_KINDS:
        return False
    ends = [e.find(tag) for tag in tags[0]]
    frames = tags[1] if _loop_tag(e) == "constraint" else ()
    return all(end is not None and "link" in end.attrib for end in ends) and all(
        e.find(tag) is not None for tag in frames or ()
    )


def _is_sdf_loop(e: XmlElement) -> bool:
    """Whether an element of <gazebo> is a joint between two links, of a kind that is read."""
    ends = e.tag == "joint" and all(e.find(tag) is not None for tag in ("parent", "child"))
    return ends and e.attrib.get("type") in _LOOP_KINDS


def _loops(root: XmlElement, tree: Tree, angles: Angles) -> Iterator[TreeLoop]:
    """Yield the loops of the elements <loop_joint>, <loop> (URDF+), <constraint>, and of SDF joints
    in <gazebo>.
    """
    for e in root:
        if _is_loop(e):
            yield _loop(e, angles)
    for gazebo in root.own("gazebo"):
        for e in gazebo:
            if _is_sdf_loop(e):
                yield _sdf_loop(e, tree, angles)


def _loop(e: XmlElement, angles: Angles) -> TreeLoop:
    (first, second), frames, axis_tag = _LOOP_TAGS[_loop_tag(e)]
    name, links, poses = e.attrib.get("name", "loop"), [], []
    for k, tag in enumerate((first, second)):
        end = e.find(tag)
        assert end is not None
        links.append(end.word("link"))
        holder = end
        if frames is not None:
            found = (end if _loop_tag(e) == "loop" else e).find(frames[k])
            holder = XmlElement("origin", {}, e.line, e.byte) if found is None else found
        poses.append(_placed(holder, f"loop {name!a:.60} (line {holder.line})", angles))
    given = e.find(axis_tag)
    axis = None if given is None else given.numbers("xyz", 3, "1 0 0")
    return _loop_about(e, name, (links[0], links[1]), poses, axis)


def _sdf_loop(e: XmlElement, tree: Tree, angles: Angles) -> TreeLoop:
    """Read a joint of SDF: its <pose> is given in the child, and both links have their poses at
    zero.
    """
    name, ends = e.attrib.get("name", "loop"), []
    for tag in ("parent", "child"):
        end = e.find(tag)
        assert end is not None
        ends.append(end.attrib.get("link", end.content.strip()))
        if ends[-1] == "world" and "world" not in tree.links:
            ends[-1] = tree.root
        if ends[-1] not in tree.links:
            raise DescriptionError(
                f"joint {name!r} in <gazebo>: there is no link {ends[-1]!a:.60}", line=e.line
            )
    pose = e.find("pose")
    words = "0 0 0 0 0 0" if pose is None else " ".join(pose.content.split())
    six = XmlElement("pose", {"": words}, e.line, e.byte).numbers("", 6)
    Q = np.eye(4)
    Q[:3, :3] = rotation(six[3:].tolist(), f"joint {name!a:.60} (line {e.line})", angles)
    Q[:3, 3] = six[:3]
    at_zero = link_poses(tree, {})
    P = np.linalg.inv(at_zero[ends[0]]) @ at_zero[ends[1]] @ Q
    axis, given = e.find("axis"), None
    if axis is not None and (xyz := axis.find("xyz")) is not None:
        given = XmlElement("xyz", {"": xyz.content}, xyz.line, xyz.byte).numbers("", 3)
    return _loop_about(e, name, (ends[0], ends[1]), [P, Q], given)


def _placed(e: XmlElement, what: str, angles: Angles) -> Array:
    T = np.eye(4)
    T[:3, :3] = rotation(e.numbers("rpy", 3, "0 0 0").tolist(), what, angles)
    T[:3, 3] = e.numbers("xyz", 3, "0 0 0")
    return T


def _loop_about(
    e: XmlElement, name: str, links: tuple[str, str], poses: list[Array], axis: Array | None
) -> TreeLoop:
    """Make a loop whose free motion is about or along `axis`, in both frames; return None if no
    axis is given.
    """
    kind = _LOOP_KINDS[e.word("type")]
    if kind in ("revolute", "prismatic") and axis is None:
        kind = HINGE if kind == "revolute" else kind
        axis = np.array([1.0, 0.0, 0.0])
    if kind in ("revolute", "prismatic"):
        assert axis is not None
        if not np.linalg.norm(axis) > 1e-6:
            raise DescriptionError(f"loop {name!r}: its axis has no direction", line=e.line)
        poses = [pose @ frame_along(axis / np.linalg.norm(axis)) for pose in poses]
    return TreeLoop(name, kind, links, (poses[0], poses[1]), e.line)


def _rotors(root: XmlElement) -> tuple[dict[str, float], list[str]]:
    """Read the motor inertias of <transmission> elements, kg m^2, on the joint's side of the gear.

    With <motorInertia> J of the rotor and <mechanicalReduction> N, each in <transmission> or in its
    only <actuator> or <joint>, Ia = N^2 J. Return Ia by the name of the joint, and the elements
    that cannot be read, because they have several joints or motors.
    """
    rotors: dict[str, float] = {}
    unread: list[str] = []
    for e in root.own("transmission"):
        inertias, ratios = (list(e.iter(tag)) for tag in ("motorInertia", "mechanicalReduction"))
        if not inertias:
            continue
        joints = [child.word("name") for child in e if child.tag == "joint"]
        if len(joints) != 1 or len(inertias) > 1 or len(ratios) > 1 or joints[0] in rotors:
            unread.append(f"<motorInertia> of {_named(e)} of several joints or motors")
            continue
        N = _content(ratios[0]) if ratios else 1.0
        rotors[joints[0]] = N**2 * _content(inertias[0])
    return rotors, unread


def _content(e: XmlElement) -> float:
    """Read the number in an element, either its text or its attribute `value`."""
    text = e.attrib.get("value", e.content.strip())
    return XmlElement(e.tag, {"value": text}, e.line, e.byte).number("value")


def _left_out(root: XmlElement) -> Iterator[str]:
    """Yield the tags of XML elements, without effect on the torques, that are not read."""
    for e in (root, *root):
        yield from (child.tag for child in e if child.tag in HARMLESS.get(e.tag, ()))


def _not_read(root: XmlElement) -> Iterator[str]:
    """Yield the parts of the file that are not read although they change the torques, such as a
    constraint that closes a loop.

    In <gazebo>, such parts are a <joint> between two links, a switch of gravity, and a spring.
    """
    for e in (root, *root):
        known = READ.get(e.tag, set()) | HARMLESS.get(e.tag, set())
        for child in e if e.tag in READ else ():
            if child.tag not in known and not (e is root and _is_loop(child)):
                yield _named(child)
    for gazebo in root.own("gazebo"):
        of = f" in <gazebo reference={gazebo.word('reference', '')!a:.60}>"
        of = of if "reference" in gazebo.attrib else " in <gazebo>"
        for child in gazebo:
            closes = child.tag == "joint" and child.find("parent") is not None
            closes = closes and not _is_sdf_loop(child)
            acts = child.tag in FORCES and child.content.strip() not in FORCES[child.tag]
            if closes or acts:
                yield _named(child, of)


def _named(e: XmlElement, where: str = "") -> str:
    name = f" {e.attrib['name']!a:.60}" if "name" in e.attrib else ""
    return f"<{e.tag:.40}>{name}{where} (line {e.line})"


def _relations(joints: list[Joint], mimics: dict[str, Mimic]) -> dict[str, Expression]:
    """Express the position of each mimic joint by the position of the joint at the end of its mimic
    chain.

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
    wrong = no_body(M, tensor, ("ixx", "iyy", "izz"))
    name = f"link {link.word('name')!a:.60} (line {inertia.line})"
    return Inertial(M, pose, tensor, name, wrong)


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


def _root(
    links: dict[str, Inertial | None], every: list[Joint], joints: list[Joint], line: int
) -> str:
    """Find the base, the only link without a parent, and check the joints.

    `joints` are those of the tree. Raises DescriptionError if one of `every` joint names a link that
    does not exist.
    """
    parent = {joint.child: joint.parent for joint in joints}
    names: set[str] = set()
    for joint in every:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise DescriptionError(
                    f"joint {joint.name!r}: there is no link {link[:60]!r}", line=joint.line
                )
        if joint.name in names:
            raise DescriptionError(
                f"joint {joint.name!r} is given twice; keep one", line=joint.line
            )
        names.add(joint.name)
    roots = [link for link in links if link not in parent]
    second = next((j for j in every if not any(j is one for one in joints)), None)
    if len(roots) > 1 and second is not None:  # rather a slip than a loop
        raise DescriptionError(
            f"joint {second.name!r}: link {second.child!r} has a parent already, and "
            f"{', '.join(map(repr, roots[1:5]))} has none; correct the child",
            line=second.line,
        )
    if len(roots) != 1:
        none = "none: the joints form a cycle" if links else "none: there is no <link>"
        roots_text = ", ".join(map(repr, roots[:5])) or none
        raise DescriptionError(
            f"links without parent: {roots_text}; expected one such link, the base", line=line
        )
    return roots[0]


NO_LIMIT = 1e9  # where a URDF asks for a limit that the robot does not have
_TYPES = {REVOLUTE: "revolute", PRISMATIC: "prismatic", FIXED: "fixed"}
_DYNAMICS = {"FV": "damping", "FS": "friction"}


def write_urdf(
    robot: Robot, values: Mapping[str, float] | None = None
) -> tuple[str, tuple[str, ...]]:
    """Return the URDF text of `robot`, and notes on the data that a URDF cannot store.

    Parameters
    ----------
    robot : Robot
        A robot without loops; each passive joint follows one joint.
    values : mapping, SI, optional
        Standard parameters by name; by default, those of the robot file. A URDF holds masses, so
        that the values must be those of a physical robot, from a feasible estimate or from CAD.

    Raises
    ------
    DescriptionError
        The robot has loops, a relation of several joints, inertial parameters without value, or
        first moments without mass.
    """
    values = dict(robot.values if values is None else values)
    if robot.loops:
        raise DescriptionError(
            f"{robot.name}: a URDF is a tree; this robot has {len(robot.loops)} closed "
            f"loop{'s' * (len(robot.loops) > 1)}"
        )
    if missing := [
        name for j in robot.links for p in INERTIAL if (name := parameter(p, j)) not in values
    ]:
        raise DescriptionError(
            f"{robot.name}: no value of {', '.join(missing[:12])}{' ...' * (len(missing) > 12)}; "
            "add these parameters under values, with 0 for a parameter that is zero"
        )
    lines = [
        '<?xml version="1.0"?>',
        f"<robot name={quoteattr(robot.name)}>",
        *_link_lines(robot, 0, values),
    ]
    for f in robot.frames:
        lines += _link_lines(robot, f.j, values) + _joint_lines(robot, f, values)
    return "\n".join([*lines, "</robot>"]) + "\n", _losses(robot, values)


def _attributes(**numbers: float) -> str:
    return " ".join(f'{key}="{float(x) + 0.0!r}"' for key, x in numbers.items())


def _link_lines(robot: Robot, j: int, values: Mapping[str, float]) -> list[str]:
    standard = [values[parameter(p, j)] for p in INERTIAL] if j in robot.links else []
    if not any(standard):
        return [f'  <link name="link{j}"/>']
    *_, mx, my, mz, M = standard
    if M < 0 or (M == 0 and (mx, my, mz) != (0, 0, 0)):
        raise DescriptionError(
            f"{robot.name}: link {j} has the mass M{j} = {M} and first moments that are not zero, which no "
            "body can have; export a physically feasible estimate (--method feasible)"
        )
    own = inertial_of(standard)
    inertia = dict(zip(MOMENTS, own.I[np.triu_indices(3)], strict=True))
    return [
        f'  <link name="link{j}">',
        "    <inertial>",
        f'      <origin xyz="{_numbers(own.pose[:3, 3])}" rpy="0 0 0"/>',
        f"      <mass {_attributes(value=M)}/>",
        f"      <inertia {_attributes(**inertia)}/>",
        "    </inertial>",
        "  </link>",
    ]


def _numbers(row: Array) -> str:
    return " ".join(repr(float(x) + 0.0) for x in row)


def _joint_lines(robot: Robot, f: Frame, values: Mapping[str, float]) -> list[str]:
    T = transform([e.value(robot.constants) for e in f.at_zero])  # iTj at q_j = 0
    limit = _limit(robot, f)
    endless = f.sigma == REVOLUTE and "lower" not in limit
    lines = [
        f'  <joint name="q{f.j}" type="{"continuous" if endless else _TYPES[f.sigma]}">',
        f'    <parent link="link{f.ant}"/>',
        f'    <child link="link{f.j}"/>',
        f'    <origin xyz="{_numbers(T[:3, 3])}" rpy="{_numbers(_roll_pitch_yaw(T[:3, :3]))}"/>',
    ]
    if f.sigma == FIXED:
        return [*lines, "  </joint>"]
    lines += ['    <axis xyz="0 0 1"/>', f"    <limit {_attributes(**limit)}/>"]
    own = one_joint_parameters(robot, _DYNAMICS)
    dynamics = {
        key: values[name]
        for family, key in _DYNAMICS.items()
        if (name := parameter(family, f.j)) in own & set(values)
    }
    if dynamics:
        lines.append(f"    <dynamics {_attributes(**dynamics)}/>")
    if f.j in robot.constraints:
        leader, multiplier, offset = _follows(robot, f.j)
        lines.append(
            f'    <mimic joint="q{leader}" {_attributes(multiplier=multiplier, offset=offset)}/>'
        )
    return [*lines, "  </joint>"]


def _limit(robot: Robot, f: Frame) -> dict[str, float]:
    k = robot.joints.index(f.j) if f.mu else None
    row = {
        key: robot.limits[key][k]
        for key in ("q", "qd", "tau")
        if k is not None and key in robot.limits
    }
    bounds: dict[str, float] = {}
    if isinstance(ends := row.get("q"), tuple):
        bounds = {"lower": ends[0], "upper": ends[1]}
    elif f.sigma == PRISMATIC:
        bounds = {"lower": -NO_LIMIT, "upper": NO_LIMIT}
    largest = {
        written: row.get(key, NO_LIMIT) for key, written in (("qd", "velocity"), ("tau", "effort"))
    }
    return bounds | {key: x for key, x in largest.items() if not isinstance(x, tuple)}


def _follows(robot: Robot, j: int) -> tuple[int, float, float]:
    """Find the joint i that passive joint j follows, with q_j = multiplier q_i + offset.

    Return i, the multiplier and the offset. Raises DescriptionError if q_j depends on several
    joints.
    """
    e = robot.constraints[j]
    leaders = [i for i in robot.moving if f"q{i}" in e.symbols]
    factor = e.coefficient(f"q{leaders[0]}") if len(leaders) == 1 else None
    if factor is None or (e - factor * Expression.symbol(f"q{leaders[0]}")).symbols & {
        f"q{leaders[0]}"
    }:
        raise DescriptionError(
            f"{robot.name}: q{j} = {e} cannot be written in a URDF, where a joint follows one "
            "other joint with multiplier and offset"
        )
    rest = e - factor * Expression.symbol(f"q{leaders[0]}")
    return leaders[0], factor.value(robot.constants), rest.value(robot.constants)


def _roll_pitch_yaw(R: Array) -> Array:
    """Compute roll, pitch and yaw, rad, of a rotation matrix R = Rz(yaw) Ry(pitch) Rx(roll).

    Roll is computed last, from R without yaw and pitch, so that it is exact at pitch = +-pi/2 too.
    """
    c = math.hypot(R[0, 0], R[1, 0])
    yaw = math.atan2(R[1, 0], R[0, 0]) if c > 1e-12 else 0.0
    pitch = math.atan2(-R[2, 0], c)
    rest = turn(1, pitch).T @ turn(2, yaw).T @ R
    return np.array([math.atan2(rest[2, 1], rest[1, 1]), pitch, yaw])


def _losses(robot: Robot, values: Mapping[str, float]) -> tuple[str, ...]:
    inertial = {parameter(p, j) for j in robot.links for p in INERTIAL}
    lost = [
        name
        for name in robot.parameters
        if name not in inertial | one_joint_parameters(robot, _DYNAMICS)
    ]
    notes = []
    if dropped := [name for name in lost if values.get(name, 0.0)]:
        notes.append(f"values without a place in a URDF, left out: {', '.join(dropped)}")
    if unknown := [name for name in lost if name not in values]:
        notes.append(f"parameters without a place or value: {', '.join(unknown)}")
    if robot.base_moves:
        notes.append(f"base: {robot.base}, which --base {robot.base} gives when the file is read")
    notes.append("constants as numbers, frames as placements: formulas are not carried")
    gravity = tuple(e.value(robot.constants) for e in robot.gravity)
    if gravity[:2] != (0.0, 0.0) or gravity[2] >= 0:
        notes.append(
            f"gravity {gravity} m/s^2: a URDF has none, programs assume -z of the root link"
        )
    notes += [
        f"{what} not carried"
        for what in ("title", "source", "drives", "labels")
        if getattr(robot, what)
    ]
    if absent := [key for key in ("q", "qd", "tau") if key not in robot.limits]:
        notes.append(f"no limits of {', '.join(absent)}: written as continuous or {NO_LIMIT:g}")
    return tuple(notes)
