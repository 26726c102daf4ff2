"""Reader of MJCF files by MuJoCo's own compiler (extra `mjcf`): bodies and joints become a tree.

The tree is then converted to a table of Khalil frames. A body with joints 1 .. k, applied one after
the other about the points p_i, is a chain of k links, all but the last without mass. Its pose iTb
is Trans, Rot of the body, times for each joint

    hinge:    Trans(p) Rot(axis, q - ref) Trans(-p)
    slide:    Trans(axis (q - ref))

Along each joint,

    Gamma = ... + armature qdd + damping qd + frictionloss sign(qd) + stiffness (q - springref)

Linear relations of joints and of fixed tendons are solved exactly, for joints that no actuator
drives.

MuJoCo opens no other file. Assets, sensors, contacts, cameras and similar elements are left out. A
geom that is a mesh becomes a geom without mass if its body has an <inertial> or never moves; a
model in which only a mesh would give the mass is refused. Elements that stand for many others
(replicate, composite, flexcomp, attach, plugins) are refused too. Of actuators, only the names of
the driven joints are read.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import Any
from xml.etree import ElementTree

import numpy as np

from symgen.description.angles import SNAP, Angles
from symgen.description.expression import ZERO, Expression, ratio, twelfths
from symgen.description.fields import located
from symgen.description.tree import (
    DROPPED,
    FIXED_TYPE,
    FREE_TYPE,
    MAX_JOINTS,
    SHOWN,
    Array,
    Inertial,
    Joint,
    Tree,
    TreeLoop,
    rotation,
)
from symgen.description.tree_loops import link_poses
from symgen.description.xml_text import LARGEST, XmlElement, read_elements
from symgen.errors import DescriptionError

DEEPEST, MAX_BODIES = 150, 400
ORIENTATION = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
INCLUDE = re.compile(rb"""<include\s(?:[^<>"']|"[^"<]*"|'[^'<]*')*?(?:/>|>\s*</include\s*>)""")
MULTIPLIED = (
    "replicate", "composite", "flexcomp", "flex", "attach", "include", "plugin", "extension",
)  # fmt: skip
SECTIONS = ("compiler", "option", "default", "worldbody", "equality", "tendon", "actuator")
IGNORED = (
    "asset", "contact", "custom", "deformable", "keyframe", "sensor", "size",
    "statistic", "visual",
)  # fmt: skip
DRAWN = ("light", "camera")  # of bodies, without effect on the mechanism
RELATIONS = ("joint", "tendon", "connect", "weld")
FLUID = ("density", "viscosity", "wind")
FORCES = ("constraint", "equality", "frictionloss", "passive", "spring", "damper")  # flags
TEXTS = re.compile(r"\w*(name|class|joint\d?|tendon\d?|body\d?|model|mesh|material|file)\w*")


@dataclass(frozen=True)
class Mjcf:
    """The mechanism of an MJCF file: the compiled model, and the line numbers of bodies and joints.

    Attributes
    ----------
    name : str
        Name of the model.
    model : MjModel
        The model that MuJoCo compiled.
    weightless : bool
        Whether gravity is switched off.
    bodies, joints, relations : list of int
        Line in the file of each body, joint, and relation of joints or tendons, in the order of
        `model`.
    driven : frozenset of str
        Names of the joints that an actuator drives.
    notes, not_read : tuple of str
        Parts of the file that were left out, without effect on the torques, and with effect.
    """

    name: str
    model: Any
    weightless: bool
    bodies: list[int]
    joints: list[int]
    relations: list[int]
    driven: frozenset[str]
    notes: tuple[str, ...]
    not_read: tuple[str, ...]


def with_includes(content: bytes, read: Callable[[str, int], bytes]) -> bytes:
    """Replace each <include> in an MJCF file by the content of the included file.

    The content is written on one line, so that the line numbers of the file stay. `read` returns
    the bytes of an included file, from its name and the line that includes it, or raises
    DescriptionError.
    """
    parts, end = [], 0
    for e in read_elements(content, DEEPEST).iter("include"):
        name, tag = e.word("file"), INCLUDE.match(content, e.byte)
        if tag is None:
            raise DescriptionError(
                "<include> must have no content, in a file saved as UTF-8; write <include file=.../>",
                line=e.line,
            )
        included = read(name, e.line)
        with located(name):
            inner = with_includes(included, read)
            first = next(iter(read_elements(inner, DEEPEST)), None)
        body = b"" if first is None else inner[first.byte : inner.rindex(b"</")]
        inside = b" ".join(body.split(b"\n")) + b"\n" * tag[0].count(b"\n")
        parts += [content[end : e.byte], inside]
        end = tag.end()
    return b"".join([*parts, content[end:]])


def compiled(content: bytes) -> Mjcf:
    """Compile the content of an MJCF file with MuJoCo, and return its mechanism.

    Raises DescriptionError, with the line, if the file is invalid or has elements that are not
    supported.
    """
    root = read_elements(content, DEEPEST)
    _refuse(root)
    notes = [f"<{tag}>" for tag in sorted({e.tag for e in root} & {*IGNORED})]
    actuators = [e for section in root.own("actuator") for e in section]
    driven = {e.attrib.get(key) for e in actuators for key in ("joint", "jointinparent")}
    tendons = {e.tag for section in root.own("tendon") for e in section}
    flags = {
        key: value
        for option in root.own("option")
        for flag in option.own("flag")
        for key, value in flag.attrib.items()
    }
    weightless = flags.pop("gravity", "enable") == "disable"
    bodies = [e for world in root.own("worldbody") for e in world.iter("body")]
    _take_out(root)
    from_geoms = any(e.attrib.get("inertiafromgeom") == "true" for e in root.own("compiler"))
    weighed = any(e.number("settotalmass", "-1") > 0 for e in root.own("compiler"))
    spec, lines = _spec(root)
    for body in spec.worldbody.bodies:
        _take_out_meshes(body, lines, moves=False, from_geoms=from_geoms, all_weighed=weighed)
    for geom in spec.worldbody.geoms:
        _no_mesh(geom)
    for drawn in (*spec.geoms, *spec.sites):
        drawn.material = ""
    model = _errors_with_lines(spec.compile, lines)
    off = [key[:30] for key, value in sorted(flags.items()) if value != "enable"]
    notes += [f"flag {key}" for key in off if key not in FORCES]
    fluid = [key for key in FLUID if np.any(getattr(model.opt, key))]
    not_read = [
        *([f"forces of a fluid ({', '.join(fluid)})"] if fluid else []),
        *(f"<{tag[:30]}> in <tendon>" for tag in sorted(tendons - {"fixed"})),
        *(f"flag {key}" for key in off if key in FORCES),
        *_forces(model),
    ]
    return Mjcf(
        root.attrib.get("model", ""),
        model,
        weightless,
        [e.line for e in bodies],
        [x.line for e in bodies for x in e.own("joint", "freejoint")],
        [x.line for section in root.own("equality") for x in section],
        frozenset(filter(None, driven)),
        (f"{DROPPED} {', '.join(notes)}",) if notes else (),
        tuple(not_read),
    )


def _refuse(root: XmlElement) -> None:
    """Raise DescriptionError if the file is no MJCF, or has elements that are not supported."""
    if root.tag != "mujoco":
        hint = "; the name of a URDF file must end in .urdf" if root.tag == "robot" else ""
        raise DescriptionError(f"found <{root.tag[:40]}>; expected <mujoco>{hint}", line=root.line)
    for e in root.iter():
        if e.tag in MULTIPLIED:
            raise DescriptionError(
                f"<{e.tag}> is not read; write out the elements that it generates, as MuJoCo does when it saves the XML",
                line=e.line,
            )
        for key, value in e.attrib.items():
            if not TEXTS.fullmatch(key) and not all(map(_is_finite, value.split())):
                raise DescriptionError(
                    f"<{e.tag} {key}={value[:60]!r}>: expected finite numbers", line=e.line
                )
    if unknown := sorted({e.tag for e in root} - {*SECTIONS, *IGNORED}):
        raise DescriptionError(
            f"<{unknown[0][:40]}> is no element of MJCF; remove this element or correct its name",
            line=root.line,
        )
    for k, e in enumerate(e for world in root.own("worldbody") for e in world.iter("body")):
        if k >= MAX_BODIES:
            raise DescriptionError(f"the file has more than {MAX_BODIES} bodies", line=e.line)
    for e in (e for section in root.own("equality") for e in section):
        if e.tag not in RELATIONS and e.attrib.get("active") != "false":
            name = e.attrib.get("name", "")
            raise DescriptionError(
                f"<{e.tag[:30]}> {name[:40]!r} in <equality>: only {', '.join(RELATIONS)} are read",
                line=e.line,
            )


def _is_finite(word: str) -> bool:
    """Whether a word in an MJCF file is a finite number, or no number at all."""
    try:
        return isfinite(float(word))
    except ValueError:
        return True


def _take_out(holder: XmlElement) -> None:
    """Remove all elements inside an XML element that the mechanism does not need (cameras ...)."""
    for e in list(holder):
        if _is_left_out(holder, e):
            holder.remove(e)
        else:
            _take_out(e)


def _is_left_out(holder: XmlElement, e: XmlElement) -> bool:
    match holder.tag:
        case "mujoco":
            return e.tag in IGNORED or e.tag == "actuator"
        case "equality":
            return e.attrib.get("active") == "false"
        case "tendon":
            return e.tag != "fixed"
        case "worldbody" | "body" | "frame":
            return e.tag in DRAWN
    return False


def _spec(root: XmlElement) -> tuple[Any, list[int]]:
    """Build MuJoCo's MjSpec from XML elements; return the MjSpec, and a list of line numbers of the
    file.

    The list has, for each line of the text that MuJoCo reads, the number of the line in the
    original file.
    """
    try:
        import mujoco
    except ImportError as error:
        raise DescriptionError(
            "MuJoCo is needed to read MJCF files; install it: pip install symgen[mjcf]"
        ) from error
    ElementTree.indent(root, "")  # each tag on a line of its own
    text = ElementTree.tostring(root, "unicode")
    elements = root.iter()
    lines: list[int] = []
    for line in text.splitlines():
        lines.append(lines[-1] if line.startswith("</") else next(elements).line)
    return _errors_with_lines(lambda: mujoco.MjSpec.from_string(text), lines), lines


def _errors_with_lines(act: Callable[[], Any], lines: Sequence[int]) -> Any:
    """Call the MuJoCo function `act`; convert its errors to errors with the line of the file.

    MuJoCo's warnings on the simulation are dropped.
    """
    import mujoco

    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return act()
    except ValueError as error:
        message = " ".join(str(error).split())
        number = re.search(r",? line (\d+)\Z", message)
        message = message[: number.start()] if number else message
        raise DescriptionError(
            "MuJoCo refuses the file: "
            f"{message.removeprefix('XML Error: ').removeprefix('Error: ')[:300]}",
            line=lines[int(number[1]) - 1] if number else None,
        ) from error
    finally:
        mujoco.set_mju_user_warning(before)


def _take_out_meshes(
    body: Any, lines: Sequence[int], *, moves: bool, from_geoms: bool, all_weighed: bool
) -> None:
    """Replace the meshes of a body and of its child bodies by geoms without mass.

    Raises DescriptionError if the mass of a moving body depends on a mesh.
    """
    moves = moves or bool(body.joints)
    weighed = (moves or all_weighed) and (from_geoms or not body.explicitinertial)
    for geom in body.geoms:
        if _no_mesh(geom) and weighed:
            number = re.search(r"line (\d+)", geom.info)
            raise DescriptionError(
                "the mass of this body would come from a mesh, and meshes are not read; add <inertial> to the body",
                line=lines[int(number[1]) - 1] if number else None,
            )
    for child in body.bodies:
        _take_out_meshes(child, lines, moves=moves, from_geoms=from_geoms, all_weighed=all_weighed)


def _no_mesh(geom: Any) -> bool:
    """Replace a geom that is a mesh by a massless sphere; return whether it was a mesh."""
    import mujoco

    is_mesh = bool(geom.meshname or geom.hfieldname)
    if is_mesh:
        geom.meshname = geom.hfieldname = ""
        geom.type, geom.size, geom.mass = mujoco.mjtGeom.mjGEOM_SPHERE, (1.0, 1.0, 1.0), 0.0
    return is_mesh


# --- from the compiled model to a tree ---

FREE_JOINT, BALL, SLIDE_JOINT, HINGE = range(4)  # mjtJoint
CONNECT, WELD, JOINT_RELATION, _ = range(4)  # mjtEq; the last are relations of tendons
SITE = 6  # mjtObj


def parse_mjcf(content: bytes, file: str, *, exact: bool = False, sites: bool = False) -> Tree:
    """Read the links and joints of an MJCF file as a Tree.

    `exact` is used as in `read_tree`. If `sites` is true, each site becomes a link on a fixed
    joint.
    """
    mjcf, angles = compiled(content), Angles(exact)
    model = mjcf.model
    if model.njnt > MAX_JOINTS:
        raise DescriptionError(
            f"the file has {model.njnt} joints that move; the limit is {MAX_JOINTS}"
        )
    for what, values in (
        ("pos of a body", model.body_pos),
        ("mass of a body", model.body_mass),
        ("inertia of a body", model.body_inertia),
        ("pos of a joint", model.jnt_pos),
        ("ref of a joint", model.qpos0),
        ("damping of a joint", model.dof_damping),
        ("armature of a joint", model.dof_armature),
    ):
        if not np.all(np.abs(values) <= LARGEST):
            raise DescriptionError(
                f"{what}: a number is infinite, nan or larger than {LARGEST:g} in magnitude; expected a number in SI units"
            )
    growing = _Growing(mjcf, angles, _joint_names(model))
    for b in range(1, model.nbody):
        _body(growing, b)
    places = dict(list(growing.place.values())[1:])
    of_links: dict[str, tuple[str, Array]] = {}
    for s in range(model.nsite):
        link, pose = growing.place[int(model.site_bodyid[s])]
        name = _new(growing, model.site(s).name or f"site{s}")
        rule = angles if sites else Angles(exact=True)
        own = _turned(model.site_pos[s], model.site_quat[s], f"site {name!a:.60}", rule)
        of_links[name] = link, pose @ own
        if sites:
            growing.links[name] = None
            growing.joints.append(_fixed(name, link, pose @ own))
    gx, gy, gz = (0.0 if mjcf.weightless else float(x) + 0.0 for x in model.opt.gravity)
    relations, joints = _relations(growing), tuple(growing.joints)
    start = {
        name: float(model.qpos0[int(model.jnt_qposadr[k])])
        for k, name in enumerate(growing.names)
        if int(model.jnt_type[k]) in (SLIDE_JOINT, HINGE)
    }
    rounded = bool(angles.near) and not exact
    text, snapped = angles.report(file)
    tree = Tree(
        mjcf.name,
        growing.links,
        joints,
        "world",
        relations,
        frozenset(growing.bare),
        (gx, gy, gz),
        (*mjcf.notes, *snapped),
        places,
        text,
        mjcf.not_read,
        of_links,
        driven=mjcf.driven,
        start=start,
        motor_line='<actuator><motor joint="{}"/></actuator>',
    )
    return replace(tree, loops=_loops(growing, tree, rounded))


@dataclass
class _Growing:
    """A tree of links and joints under construction, made from a compiled MJCF model.

    Attributes
    ----------
    mjcf : Mjcf
        The model that MuJoCo compiled, and the lines of its parts in the file.
    angles : Angles
        Rounding of the rotations of bodies and sites.
    names : list of str
        Names of the joints, in the order of the model.
    links, bare, joints
        As in `Tree`.
    place : mapping
        For each body: its link, and the pose (4, 4) of the body in the frame of this link.
    """

    mjcf: Mjcf
    angles: Angles
    names: list[str]
    links: dict[str, Inertial | None] = field(default_factory=lambda: {"world": None})
    bare: set[str] = field(default_factory=set)
    joints: list[Joint] = field(default_factory=list)
    place: dict[int, tuple[str, Array]] = field(default_factory=lambda: {0: ("world", np.eye(4))})


def _joint_names(model: Any) -> list[str]:
    """List the names of the joints, all different; an unnamed joint is named by its number."""
    given = {model.joint(k).name for k in range(model.njnt)}
    names = []
    for k in range(model.njnt):
        name = model.joint(k).name or f"joint{k}"
        while not model.joint(k).name and name in given:
            name += "_"
        names.append(name)
    return names


def _new(growing: _Growing, name: str) -> str:
    """Make a link name that is not used yet, from `name` and underscores at its end."""
    while name in growing.links:
        name += "_"
    return name


def _fixed(name: str, parent: str, pose: Array) -> Joint:
    return Joint(f"{name} (fixed)", FIXED_TYPE, parent, name, pose, np.array([0.0, 0.0, 1.0]), 1)


def _pose(position: Array, quaternion: Array) -> Array:
    """Compute the pose, shape (4, 4), for a position and a quaternion w, x, y, z."""
    w, x, y, z = (float(c) for c in quaternion / np.linalg.norm(quaternion))
    T = np.eye(4)
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    T[:3, 3] = position
    return T


def _turned(position: Array, quaternion: Array, what: str, angles: Angles) -> Array:
    """Compute the pose of a body or site, with roll, pitch and yaw rounded by the rule in `angles`.

    Roll is 0 if pitch is a quarter turn, because roll and yaw are then one angle.
    """
    T = _pose(position, quaternion)
    R = T[:3, :3]
    pitch = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))
    quarter = twelfths(pitch, SNAP) in (-6, 6)
    roll = 0.0 if quarter else math.atan2(R[2, 1], R[2, 2])
    yaw = math.atan2(-R[0, 1], R[1, 1]) if quarter else math.atan2(R[1, 0], R[0, 0])
    taken = rotation((roll, pitch, yaw), what, angles)
    T[:3, :3] = R if angles.exact else taken
    return T


def _body(growing: _Growing, b: int) -> None:
    """Add the links of body b to the tree: one link per joint of the body, or one fixed link."""
    model = growing.mjcf.model
    name = _new(growing, model.body(b).name or f"body{b}")
    link, pose = growing.place[int(model.body_parentid[b])]
    what = f"body {name!a:.60} (line {growing.mjcf.bodies[b - 1]})"
    pose = pose @ _turned(model.body_pos[b], model.body_quat[b], what, growing.angles)
    first, count = int(model.body_jntadr[b]), int(model.body_jntnum[b])
    if not count:
        growing.joints.append(_fixed(name, link, pose))
        pose, link = np.eye(4), name
    for k in range(first, first + count):
        child = (
            name
            if k == first + count - 1
            else _new(growing, f"{name} before {growing.names[k + 1]}")
        )
        joint, pose = _joint(growing, k, link, child, pose)
        growing.joints.append(joint)
        growing.links[child] = None
        growing.bare |= {child} if child != name else set()
        link = child
    M, inertia = float(model.body_mass[b]), np.diag(model.body_inertia[b])
    if M > 0 or inertia.any():
        own = pose @ _pose(model.body_ipos[b], model.body_iquat[b])
        growing.links[name] = Inertial(M, own, inertia, what)
    else:
        growing.links[name] = None
    growing.place[b] = (link, pose)


def _joint(growing: _Growing, k: int, parent: str, child: str, pose: Array) -> tuple[Joint, Array]:
    """Convert joint k of an MJCF model; return the Joint, and the pose of the body in the joint
    frame.

    The joint leads from the link `parent` to the link `child`. `pose` is the pose of the body in
    the frame of `parent` at q = ref.
    """
    model, line = growing.mjcf.model, growing.mjcf.joints[k]
    name, kind = growing.names[k], int(model.jnt_type[k])
    if kind == BALL:
        raise DescriptionError(
            f"ball joint {name!r} is not supported; write three hinge joints instead", line=line
        )
    if kind == FREE_JOINT:
        z = np.array([0.0, 0.0, 1.0])
        return Joint(name, FREE_TYPE, parent, child, pose, z, line), np.eye(4)
    dof, axis = int(model.jnt_dofadr[k]), np.array(model.jnt_axis[k])
    if not 0 < np.linalg.norm(axis) < np.inf:
        raise DescriptionError(
            f"joint {name!r}: its axis is zero, or its components differ too much in size; expected a direction such as 0 0 1",
            line=line,
        )
    axis /= np.linalg.norm(axis)
    anchor = _pose(model.jnt_pos[k], np.array([1.0, 0.0, 0.0, 0.0]))
    ref = float(model.qpos0[int(model.jnt_qposadr[k])])
    back = np.eye(4)  # from q = ref to q = 0
    if kind == SLIDE_JOINT:
        back[:3, 3] = -ref * axis
    else:
        back = _pose(np.zeros(3), np.array([np.cos(ref / 2), *(-np.sin(ref / 2) * axis)]))
    limits: dict[str, float] = {}
    if model.jnt_limited[k]:
        limits |= {"lower": float(model.jnt_range[k][0]), "upper": float(model.jnt_range[k][1])}
    if model.jnt_actfrclimited[k]:
        limits["effort"] = float(np.abs(model.jnt_actfrcrange[k]).min())
    joint = Joint(
        name,
        "prismatic" if kind == SLIDE_JOINT else "revolute",
        parent,
        child,
        pose @ anchor @ back,
        axis,
        line,
        limits,
        damping=float(model.dof_damping[dof]),
        friction=float(model.dof_frictionloss[dof]),
        armature=float(model.dof_armature[dof]),
        stiffness=float(model.jnt_stiffness[k]),
        rest=float(model.qpos_spring[int(model.jnt_qposadr[k])]),
    )
    return joint, np.linalg.inv(anchor)


def _forces(model: Any) -> list[str]:
    """Name the forces in the model that a Robot cannot store, such as forces of tendons."""
    forces = []
    if names := [model.body(b).name for b in range(model.nbody) if model.body_gravcomp[b]]:
        forces.append(f"gravcomp of {_quoted(names)}")
    for what, polynomial in (
        ("damping that grows with speed", "dof_dampingpoly"),
        ("stiffness that grows with deflection", "jnt_stiffnesspoly"),
    ):
        rows = getattr(model, polynomial, ())  # since MuJoCo 4
        joints = model.dof_jntid if polynomial.startswith("dof") else range(model.njnt)
        acting = (k for k, row in zip(joints, rows, strict=False) if np.any(row))
        if names := [model.joint(k).name for k in acting]:
            forces.append(f"{what} of {_quoted(names)}")
    of_tendons = [
        model.tendon_stiffness,
        model.tendon_damping,
        model.tendon_frictionloss,
        *(getattr(model, "tendon_armature", ()),),
    ]
    tendons = sorted({int(t) for force in of_tendons for t in np.flatnonzero(force)})
    if tendons:
        forces.append(f"forces of the tendons {_quoted([model.tendon(t).name for t in tendons])}")
    return forces


def _quoted(names: Sequence[str]) -> str:
    """List the first few names in quotes."""
    return ", ".join(f"{name!a:.60}" for name in names[:SHOWN])


# --- relations ---


def _relations(growing: _Growing) -> dict[str, Expression]:
    """Solve the linear relations between joints for the positions of joints without actuator.

    The arithmetic is exact. The result has, for each solved joint, its position as an expression in
    the other joints.
    """
    model, names = growing.mjcf.model, growing.names
    relations: dict[str, Expression] = {}
    for e in range(model.neq):
        if int(model.eq_type[e]) in (CONNECT, WELD):
            continue
        line = growing.mjcf.relations[e]
        equation = _equation(model, names, e, line).substitute(relations)
        free = [name for name in names if name in equation.atoms - growing.mjcf.driven]
        if not free:
            raise DescriptionError(
                f"equality {model.equality(e).name!r}: this relation contains only actuated "
                "joints, or follows from the other relations; remove the equality",
                line=line,
            )
        of_joint = int(model.eq_type[e]) == JOINT_RELATION
        first = names[int(model.eq_obj1id[e])] if of_joint else ""
        pivot = first if first in free else free[-1]
        solved = Expression.symbol(pivot) - equation * equation.coefficient(pivot).inverse()
        relations = {name: x.substitute({pivot: solved}) for name, x in relations.items()}
        relations[pivot] = solved
    return {name: relations[name] for name in names if name in relations}


def _equation(model: Any, names: list[str], e: int, line: int) -> Expression:
    """Return the expression in joint positions that relation e of the MJCF file sets to zero.

    The expression is y1 - y1_0 - a0 - a1 (y2 - y2_0), where y is a joint position or the length of
    a fixed tendon, and y_0 is its value at ref.
    """
    kind, name = int(model.eq_type[e]), model.equality(e).name
    a0, a1, *higher = (ratio(float(x)) for x in model.eq_data[e][:5])
    if any(higher):
        raise DescriptionError(
            f"equality {name!r}: polycoef {[float(x) for x in model.eq_data[e][:5]]} is not "
            "linear; only a0 + a1*y is supported, where y is the position of the other joint or "
            "the length of the other tendon",
            line=line,
        )
    first, second = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
    other = _deflection(model, names, kind, second) if second >= 0 else ZERO
    return _deflection(model, names, kind, first) - a0 - other * a1


def _deflection(model: Any, names: list[str], kind: int, k: int) -> Expression:
    """Return a joint position, or the length of a fixed tendon, minus its reference value."""
    if kind == JOINT_RELATION:
        reference = Expression.number(repr(float(model.qpos0[int(model.jnt_qposadr[k])])))
        return Expression.symbol(names[k]) - reference
    first, count = int(model.tendon_adr[k]), int(model.tendon_num[k])
    coefficients = {
        int(model.wrap_objid[w]): ratio(float(model.wrap_prm[w]))
        for w in range(first, first + count)
    }
    deflections = (
        _deflection(model, names, JOINT_RELATION, i) * c for i, c in coefficients.items()
    )
    return sum(deflections, start=ZERO)


# --- loops ---

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
ROUNDED = 1e-3, 1e-9  # m, rad: poses differ by no more if angles were rounded, and otherwise


def _loops(growing: _Growing, tree: Tree, rounded: bool) -> tuple[TreeLoop, ...]:
    """Convert each <connect> and <weld> of an MJCF model to a loop of the tree.

    If the file leaves out the point of a <connect> in its second body, or the pose of a <weld>,
    MuJoCo takes them from the pose at ref. Here, this pose is computed from the tree, whose angles
    may be rounded.
    """
    model, pose = growing.mjcf.model, link_poses(tree, tree.start)
    names = {model.equality(e).name for e in range(model.neq)}
    loops: list[TreeLoop] = []
    for e in range(model.neq):
        kind, data = int(model.eq_type[e]), np.array(model.eq_data[e])
        if kind not in (CONNECT, WELD):
            continue
        name = model.equality(e).name or f"loop{e}"
        while not model.equality(e).name and name in names:
            name += "_"
        ends = [int(model.eq_obj1id[e]), int(model.eq_obj2id[e])]
        if int(model.eq_objtype[e]) == SITE:
            links, frames = [], []
            for site in ends:
                link, X = growing.place[int(model.site_bodyid[site])]
                turned = model.site_quat[site] if kind == WELD else UPRIGHT
                links.append(link)
                frames.append(X @ _pose(model.site_pos[site], turned))
            (first, second), (P, Q) = links, frames
        else:
            (first, X), (second, Y) = (growing.place[b] for b in ends)
            if kind == CONNECT:
                P = X @ _pose(data[:3], UPRIGHT)
                Q = np.linalg.inv(pose[second]) @ pose[first] @ P
            else:
                P, Q = X @ _pose(data[3:6], data[6:10]), Y @ _pose(data[:3], UPRIGHT)
                at_ref = np.linalg.inv(pose[first]) @ pose[second] @ Q
                P = at_ref if np.abs(P - at_ref).max() < ROUNDED[not rounded] else P
        kinds = {CONNECT: "spherical", WELD: FIXED_TYPE}
        line = growing.mjcf.relations[e]
        loops.append(TreeLoop(name, kinds[kind], (first, second), (P, Q), line))
    return tuple(loops)
