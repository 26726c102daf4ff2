"""URDF text to plain links and joints, refusing what a table of numbers does not need.

The file is read by expat alone: a document type (hence entities, internal or external) ends the reading where it stands, nesting and the
number of elements are bounded while reading, and nothing a file names is opened: meshes, textures and packages do not matter to dynamics. A URDF
library would load them, and its XML parser expands entities. Every error names its line.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np

from symgen.errors import DescriptionError

Array = np.ndarray
MAX_BYTES, MAX_DEPTH, MAX_ELEMENTS, MAX_JOINTS, LARGEST = 5_000_000, 30, 50_000, 200, 1e9
MOVING, FIXED_TYPE = ("revolute", "continuous", "prismatic"), "fixed"


@dataclass
class Element:
    """An XML element and the line where it starts."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)

    def first(self, tag: str) -> Element | None:
        return next((child for child in self.children if child.tag == tag), None)

    def text(self, name: str, default: str | None = None) -> str:
        value = self.attributes.get(name, default)
        if value is None:
            raise DescriptionError(f"<{self.tag}> has no {name}; add it", line=self.line)
        return value

    def numbers(self, name: str, n: int, default: str | None = None) -> Array:
        """n finite numbers of an attribute."""
        text = self.text(name, default)
        words = text.split()
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if len(words) != n or len(values) != n or not all(abs(x) <= LARGEST for x in values):
            raise DescriptionError(
                f"<{self.tag} {name}={text[:60]!r}>: expected {n} number{'s' * (n > 1)} of size at most {LARGEST:g}", line=self.line
            )
        return np.array(values)

    def number(self, name: str, default: str | None = None) -> float:
        """One finite number of an attribute."""
        return float(self.numbers(name, 1, default)[0])


@dataclass(frozen=True)
class Inertial:
    """M, kg; pose (4, 4) of the centre-of-mass frame in the link frame; I (3, 3) about that point, kg m^2, tensor elements."""

    M: float
    pose: Array
    I: Array


@dataclass(frozen=True)
class Joint:
    """A joint: `pose` (4, 4) of its frame in that of the parent link, unit `axis` in the joint frame; child link frame = joint frame at 0."""

    name: str
    kind: str
    parent: str
    child: str
    pose: Array
    axis: Array
    line: int
    limits: Mapping[str, float]
    damping: float
    friction: float
    mimic: tuple[str, float, float] | None  # joint, multiplier, offset


@dataclass(frozen=True)
class Urdf:
    """Links by name in the order of the file, joints in the order of the file, and the link that has no parent."""

    name: str
    links: dict[str, Inertial | None]
    joints: tuple[Joint, ...]
    root: str
    notes: tuple[str, ...]


def read_elements(content: bytes) -> Element:
    """The root element; DescriptionError with the line of whatever is no plain XML."""
    if len(content) > MAX_BYTES:
        raise DescriptionError(f"more than {MAX_BYTES} bytes; meshes belong into files of their own", line=1)
    parser = expat.ParserCreate()
    top = Element("", {}, 0)
    open_, count = [top], 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        line = parser.CurrentLineNumber
        if len(open_) > MAX_DEPTH or count > MAX_ELEMENTS:
            raise DescriptionError(f"nested more than {MAX_DEPTH} deep, or more than {MAX_ELEMENTS} elements", line=line)
        if tag.startswith("xacro:"):
            raise DescriptionError(f"<{tag}>: this file is a xacro macro; expand it first (xacro FILE > robot.urdf)", line=line)
        open_.append(Element(tag, attributes, line))
        open_[-2].children.append(open_[-1])

    def refuse(*_: object) -> int:
        raise DescriptionError("document types and entities are not read; remove <!DOCTYPE ...>", line=parser.CurrentLineNumber)

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_.pop()
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = parser.ExternalEntityRefHandler = refuse
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise DescriptionError(f"no XML: {expat.ErrorString(error.code)}", line=error.lineno) from error
    except (LookupError, ValueError) as error:  # of an encoding that is not one
        raise DescriptionError(f"no XML: {error}; save the file as UTF-8", line=1) from error
    return top.children[0]


def parse_urdf(content: bytes, nearly: float = 0.0) -> Urdf:
    """Links and joints of a URDF file; roll, pitch and yaw within `nearly` (rad) of a multiple of pi/12 are taken as that."""
    root = read_elements(content)
    if root.tag != "robot":
        raise DescriptionError(f"found <{root.tag[:40]}>; expected <robot>", line=root.line)
    links: dict[str, Inertial | None] = {}
    joints: list[Joint] = []
    for e in root.children:
        if e.tag == "link":
            if (name := e.text("name")) in links:
                raise DescriptionError(f"link {name!r} is given twice; keep one", line=e.line)
            links[name] = _inertial(e, nearly)
        elif e.tag == "joint":
            joints.append(_joint(e, nearly))
    if len(joints) > MAX_JOINTS:
        raise DescriptionError(f"{len(joints)} joints; at most {MAX_JOINTS} are read", line=root.line)
    other = sorted({e.tag for e in root.children} - {"link", "joint", "material"})
    notes = (f"not read: {', '.join(f'<{tag}>' for tag in other)}",) if other else ()
    return Urdf(root.attributes.get("name", ""), links, tuple(joints), _root(links, joints, root.line), notes)


def _pose(e: Element | None, nearly: float) -> Array:
    """(4, 4) of an <origin>: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    T = np.eye(4)
    if e is not None:
        roll, pitch, yaw = (snapped(x, nearly) for x in e.numbers("rpy", 3, "0 0 0"))
        T[:3, :3] = turn(2, yaw) @ turn(1, pitch) @ turn(0, roll)
        T[:3, 3] = e.numbers("xyz", 3, "0 0 0")
    return T


def turn(axis: int, angle: float) -> Array:
    """Rotation matrix about x, y or z (axis 0, 1, 2); quarter turns exact."""
    c, s = math.cos(angle), math.sin(angle)
    c, s = (float(round(x)) if abs(x - round(x)) < 1e-15 else x for x in (c, s))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[j, j], R[j, k], R[k, j], R[k, k] = c, -s, s, c
    return R


def snapped(angle: float, nearly: float) -> float:
    """`angle`, or the multiple of pi/12 within `nearly` of it."""
    step = math.pi / 12
    nearest = round(angle / step) * step
    return nearest if abs(angle - nearest) <= nearly else angle


def _inertial(link: Element, nearly: float) -> Inertial | None:
    e = link.first("inertial")
    if e is None:
        return None
    mass, inertia = e.first("mass"), e.first("inertia")
    if mass is None or inertia is None:
        raise DescriptionError("<inertial> needs <mass> and <inertia>", line=e.line)
    M = mass.number("value")
    if M < 0:
        raise DescriptionError(f"mass {M}; expected 0 or more", line=mass.line)
    xx, xy, xz, yy, yz, zz = (inertia.number(name) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    return Inertial(M, _pose(e.first("origin"), nearly), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def _joint(e: Element, nearly: float) -> Joint:
    kind, name = e.text("type"), e.text("name")
    if kind not in (*MOVING, FIXED_TYPE):
        raise DescriptionError(f"joint {name!r} is {kind[:30]!r}; expected {', '.join(MOVING)} or {FIXED_TYPE}", line=e.line)
    ends = {tag: child for tag in ("parent", "child") if (child := e.first(tag)) is not None}
    if len(ends) < 2:
        raise DescriptionError(f"joint {name!r} needs <parent link=...> and <child link=...>", line=e.line)
    given = e.first("axis")
    axis = np.array([1.0, 0.0, 0.0]) if given is None else given.numbers("xyz", 3, "1 0 0")
    length = float(np.linalg.norm(axis))
    if kind == FIXED_TYPE:
        axis, length = np.array([0.0, 0.0, 1.0]), 1.0  # of no meaning; some files say 0 0 0
    if length < 1e-6:
        raise DescriptionError(f"joint {name!r}: axis {axis.tolist()} has no direction", line=(given or e).line)
    limit, dynamics, mimic = (e.first(tag) for tag in ("limit", "dynamics", "mimic"))
    keys = ("lower", "upper", "velocity", "effort")
    limits: dict[str, float] = {str(key): limit.number(key) for key in keys if key in limit.attributes} if limit is not None else {}
    damping, friction = (0.0 if dynamics is None else dynamics.number(key, "0") for key in ("damping", "friction"))
    follows = None if mimic is None else (mimic.text("joint"), mimic.number("multiplier", "1"), mimic.number("offset", "0"))
    axis = axis if abs(length - 1) < 1e-15 else axis / length
    return Joint(name, kind, ends["parent"].text("link"), ends["child"].text("link"), _pose(e.first("origin"), nearly), axis, e.line,
                 limits, damping, friction, follows)  # fmt: skip


def _root(links: dict[str, Inertial | None], joints: list[Joint], line: int) -> str:
    """The one link without parent; every other must hang on it by one joint."""
    parent: dict[str, str] = {}
    names: set[str] = set()
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise DescriptionError(f"joint {joint.name!r}: there is no link {link[:60]!r}", line=joint.line)
        if joint.child in parent:
            raise DescriptionError(f"joint {joint.name!r}: link {joint.child!r} has a parent already; a URDF is a tree", line=joint.line)
        if joint.name in names:
            raise DescriptionError(f"joint {joint.name!r} is given twice; keep one", line=joint.line)
        names.add(joint.name)
        parent[joint.child] = joint.parent
    roots = [link for link in links if link not in parent]
    if len(roots) != 1:
        found = ", ".join(map(repr, roots[:5])) or "none: the joints form a cycle"
        raise DescriptionError(f"links without parent: {found}; expected one, the base", line=line)
    reached, new = set(roots), list(roots)
    while new:
        new = [joint.child for joint in joints if joint.parent in new and joint.child not in reached]
        reached |= set(new)
    if lost := sorted(set(links) - reached):
        raise DescriptionError(f"links {', '.join(lost[:5])} do not hang on {roots[0]!r}; their joints form a cycle", line=line)
    return roots[0]
