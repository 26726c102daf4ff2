"""Find and edit the numbers of links and joints in the text of a URDF or MJCF file.

With pose X of the link (URDF) or body (MJCF) in frame j, and the orientation R, in the link, of the
axes in which the file states the tensor, the numbers are

    mass M,    centre MS / M in the link frame,    I = R' (J - M (c'c 1 - c c')) R about the centre

A URDF uses the axes of its <inertial>, which stay, and <dynamics> of a joint; a URDF has no
attribute for motor inertia, offsets and springs. An MJCF has fullinertia in axes of the body, or
diaginertia with the orientation of its principal axes. A body whose inertia comes from its geoms
gets an <inertial>; inertiafromgeom="true" becomes "auto", so that other bodies stay as they are. A
class of defaults, which holds for many joints, is not changed: a joint that differs gets an
attribute of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np

from symgen.description.fields import located
from symgen.description.files import TREES, loops_beside, on_base
from symgen.description.mjcf import DEEPEST, ORIENTATION
from symgen.description.robot import FIXED, Robot
from symgen.description.tree import (
    FIXED_TYPE,
    Array,
    Inertial,
    Joint,
    Tree,
    TreePart,
    inertial_of,
    part_of,
    ten_of,
)
from symgen.description.tree_robot import (
    JOINT_TERMS,
    Table,
    parse_tree,
    placed,
    robot_of_tree,
)
from symgen.description.xml_text import XmlElement, read_elements
from symgen.errors import DescriptionError
from symgen.update.xml_edits import XmlEdits, numbers, same

NUMBERS = (  # of a link: what, label and unit, in the order of `LinkPlace.numbers`
    ("mass", "mass", "kg"),
    *(("centre", label, "m") for label in "xyz"),
    *(("inertia", label, "kg*m**2") for label in ("xx", "xy", "xz", "yy", "yz", "zz")),
)
SPRING = ("K", "OFFSET")  # of a joint that has one: OFFSET = -stiffness springref
DIAGONAL = 1e-12  # of the largest moment: smaller products are none
POSE = 1e-6  # m, rad: frames of two descriptions of one robot differ by no more


@dataclass(frozen=True)
class Attributes:
    """Names of the XML attributes for mass, inertia tensor, friction ... in URDF or in MJCF.

    Attributes
    ----------
    format : str
        URDF or MJCF.
    inertial : mapping
        For each child element of <inertial> ("" is <inertial> itself): its attributes, and the
        index of each number in them in the list `NUMBERS` (mass, centre, tensor).
    dynamics : str
        The child element of a joint that contains its parameters; "" if the joint itself has them.
    joint : mapping
        The attribute of each family of joint parameters, such as damping for FV.
    """

    format: str
    inertial: Mapping[str, Mapping[str, tuple[int, ...]]]
    dynamics: str
    joint: Mapping[str, str]

    @property
    def order(self) -> list[int]:
        """Order of mass, centre of mass and inertia in the file, as indices into the list
        `NUMBERS`.
        """
        return [k for row in self.inertial.values() for places in row.values() for k in places]


URDF = Attributes(
    "URDF",
    {
        "mass": {"value": (0,)},
        "origin": {"xyz": (1, 2, 3)},
        "inertia": {f"i{NUMBERS[k][1]}": (k,) for k in range(4, 10)},
    },
    "dynamics",
    {"FV": "damping", "FS": "friction"},
)
MJCF = Attributes(
    "MJCF",
    {"": {"mass": (0,), "pos": (1, 2, 3), "fullinertia": (4, 7, 9, 5, 6, 8)}},
    "",
    {
        "FV": "damping",
        "FS": "frictionloss",
        "Ia": "armature",
        "K": "stiffness",
        "OFFSET": "springref",
    },
)


@dataclass(frozen=True, eq=False)
class LinkPlace:
    """XML elements of a link, and the frames of its centre of mass and inertia tensor in the file.

    Attributes
    ----------
    attributes : Attributes
        Names of the attributes in this format.
    link : XmlElement
        <link> or <body>.
    inertial : XmlElement or None
        <inertial>, if the link has one.
    X : ndarray, shape (4, 4)
        Pose of the link (URDF) or body (MJCF) in frame j.
    axes : ndarray, shape (3, 3)
        Orientation of the axes of the tensor in the link, as in the file or as compiled by MuJoCo.
    stated : ndarray, shape (10,), or None
        Mass, centre and tensor as a URDF states them; None for an MJCF, whose numbers are compiled.
        A link without mass has these numbers even in an MJCF, because its ten parameters do not
        contain its centre.
    """

    attributes: Attributes
    link: XmlElement
    inertial: XmlElement | None
    X: Array
    axes: Array
    stated: Array | None

    @property
    def principal(self) -> bool:
        """Whether the file gives principal moments of inertia (diaginertia of an MJCF)."""
        full = self.inertial is None or "fullinertia" in self.inertial.attrib
        return self.attributes is MJCF and not full

    def numbers(self, ten: Array) -> Array:
        """Convert ten inertial parameters in frame j to mass, centre of mass and tensor of the
        file.

        The argument has the order XX .. ZZ, MX, MY, MZ, M, the result the order of the list
        `NUMBERS`.
        """
        if not np.any(ten):
            return np.zeros(10)
        if ten[-1] <= 0:
            raise DescriptionError(
                f"the mass of a link would be {ten[-1]:.4g} kg, but must be positive; identify "
                "with method feasible"
            )
        own, R = inertial_of(ten), self.X[:3, :3]
        turned = R @ (self.axes if self.principal or self.attributes is URDF else np.eye(3))
        tensor = (turned.T @ own.I @ turned)[np.triu_indices(3)]
        return np.array([own.M, *(R.T @ (own.pose[:3, 3] - self.X[:3, 3])), *tensor])

    def ten(self, x: Array) -> Array:
        """Convert mass, centre of mass and tensor of the file to ten inertial parameters in frame
        j.

        The argument and the result have the shape (10,).
        """
        pose, (xx, xy, xz, yy, yz, zz) = np.eye(4), x[4:]
        if self.principal or self.attributes is URDF:
            pose[:3, :3] = self.axes
        pose[:3, 3] = x[1:4]
        I = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return ten_of(Inertial(float(x[0]), pose, I), self.X)

    def write(self, edits: XmlEdits, x: Array) -> None:
        """Add to `edits` the changes that set mass, centre of mass and tensor to x, shape (10,)."""
        if self.inertial is None:
            row = self.attributes.inertial[""]
            words = _words({key: x[[*row[key]]] for key in ("pos", "mass", "fullinertia")})
            edits.insert_child(self.link, f"<inertial {words}/>")
            return
        for tag, row in self.attributes.inertial.items():
            e, own = (
                self.inertial.find(tag) if tag else self.inertial,
                {key: x[[*places]] for key, places in row.items()},
            )
            default = (0.0, 0.0, 0.0) if tag == "origin" else None
            if e is None and any(map(np.any, own.values())):
                words = _words(own) + ' rpy="0 0 0"' * (tag == "origin")
                edits.insert_child(self.inertial, f"<{tag} {words}/>")
            for key, values in own.items():
                if e is not None and (key != "fullinertia" or not self.principal):
                    edits.set_numbers(e, key, values.tolist(), default)
        if self.principal:
            xx, xy, xz, yy, yz, zz = x[4:]
            self._write_principal(edits, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))

    def _write_principal(self, edits: XmlEdits, I: Array) -> None:
        assert self.inertial is not None
        moments, V = principal(I)
        edits.set_numbers(self.inertial, "diaginertia", moments.tolist())
        quat = quaternion(self.axes @ V)
        if all(map(same, quat, quaternion(self.axes))):
            return
        written = next((name for name in ORIENTATION if name in self.inertial.attrib), "quat")
        if written == "quat":
            edits.set_numbers(self.inertial, "quat", quat.tolist(), (1.0, 0.0, 0.0, 0.0))
        else:
            edits.replace_attribute(self.inertial, written, "quat", quat.tolist())


class Places:
    """The XML elements of the links and joints of a file, found by name."""

    def __init__(self, content: bytes, tree: Tree, attributes: Attributes) -> None:
        root = read_elements(content, DEEPEST)
        self.attributes, self.tree = attributes, tree
        self.from_geoms: list[XmlElement] = []
        self.degrees = False
        if attributes is MJCF:
            self._find_bodies(root)
        else:
            self.links, self.joints = (
                {e.word("name"): e for e in root if e.tag == tag} for tag in ("link", "joint")
            )

    def _find_bodies(self, root: XmlElement) -> None:
        compilers = [e for e in root if e.tag == "compiler"]
        self.from_geoms = [e for e in compilers if e.attrib.get("inertiafromgeom") == "true"]
        self.degrees = not any(e.attrib.get("angle") == "radian" for e in compilers)
        bodies = [e for world in root if world.tag == "worldbody" for e in _bodies(world)]
        joints = [x for e in bodies for x in e.own("joint", "freejoint")]
        moving = [
            joint.name
            for joint in self.tree.joints
            if joint.kind != FIXED_TYPE or not joint.name.endswith(" (fixed)")
        ]
        self.links = dict(zip(self.tree.places, bodies, strict=True))
        self.joints = dict(zip(moving, joints, strict=True))
        for name, e in self.joints.items():
            if e.attrib.get("name", name) != name:
                raise DescriptionError(
                    f"joint {name!a:.60}: the order of joints in the file differs from that in the model of MuJoCo; write "
                    "the joints of a body before its child bodies",
                    line=e.line,
                )

    def link(self, name: str, tree: Tree, X: Array) -> LinkPlace:
        """Find the XML elements with the inertia of link `name`, whose pose in frame j is X."""
        link, inertial = self.links[name], tree.links[name]
        e = next(link.own("inertial"), None)
        if e is not None and e not in link:
            raise DescriptionError(
                "<inertial> is inside a <frame>; move <inertial> directly into the body",
                line=e.line,
            )
        if inertial is None or (e is None and self.attributes is URDF):
            raise DescriptionError(
                f"link {name!a:.60} has no <inertial>; add <inertial> to the link", line=link.line
            )
        place = self.tree.places.get(name, np.eye(4))  # a URDF has one frame for link and body
        axes = place[:3, :3].T @ inertial.pose[:3, :3]
        compiled = LinkPlace(self.attributes, link, e, X @ place, axes, None)
        if self.attributes is MJCF and inertial.M > 0:
            return compiled
        centre = np.linalg.solve(place, inertial.pose[:, 3])[:3]
        own = self.attributes is URDF or compiled.principal
        I = inertial.I if own else axes @ inertial.I @ axes.T
        stated = np.array([inertial.M, *centre, *I[np.triu_indices(3)]])
        return replace(compiled, stated=stated)

    def attribute(self, family: str, joint: Joint) -> str | None:
        """Return the name of the XML attribute for a parameter of a joint, such as damping.

        The result is None if the joint has no attribute for parameters of this family.
        """
        without = family in SPRING and not joint.stiffness
        return None if without else self.attributes.joint.get(family)

    def heed_inertials(self, edits: XmlEdits) -> None:
        """Set inertiafromgeom to "auto" in the file, so that MuJoCo uses the <inertial> that was
        inserted.
        """
        own = (e for body in self.links.values() for e in body.own("inertial"))
        ignored = next(own, None)
        if self.from_geoms and ignored is not None:
            raise DescriptionError(
                "inertiafromgeom is true, so this <inertial> has no effect; remove one of the two",
                line=ignored.line,
            )
        for e in self.from_geoms:
            edits.set_word(e, "inertiafromgeom", "auto")

    def set_joint(
        self,
        edits: XmlEdits,
        joint: Joint,
        values: Mapping[str, float],
        before: Mapping[str, float],
    ) -> None:
        """Add to `edits` the changes that set the parameters of a joint to `values`.

        `values` and `before` are given by family (FV, FS, Ia ...). `before` has the values in the
        file; equal values are not edited.
        """
        e, names = self.joints[joint.name], self.attributes.joint
        new = {family: x for family, x in values.items() if not same(x, before[family])}
        own = {names[family]: x for family, x in new.items() if family not in SPRING}
        if new and "springdamper" in e.attrib:
            raise DescriptionError(
                f"joint {joint.name!a:.60}: springdamper sets the damping; replace springdamper by "
                "stiffness and damping",
                line=e.line,
            )
        if new.keys() & set(SPRING):
            K, offset = (values.get(family, before[family]) for family in SPRING)
            if K <= 0:
                raise DescriptionError(
                    f"joint {joint.name!a:.60}: the identified stiffness is {K:.4g}, but MuJoCo needs a "
                    "positive stiffness; remove the spring of this joint, and identify again",
                    line=e.line,
                )
            turns = self.degrees and joint.kind != "prismatic"
            own |= {"stiffness": K, "springref": np.degrees(-offset / K) if turns else -offset / K}
        holder = e.find(self.attributes.dynamics) if self.attributes.dynamics else e
        if holder is not None:
            for key, x in own.items():
                edits.set_numbers(holder, key, (x,))
        elif any(own.values()):
            words = _words({key: (x,) for key, x in own.items()})
            edits.insert_child(e, f"<{self.attributes.dynamics} {words}/>")


def _words(attributes: Mapping[str, Any]) -> str:
    return " ".join(f'{key}="{numbers(values)}"' for key, values in attributes.items())


def principal(I: Array) -> tuple[Array, Array]:
    """Compute principal moments and axes V of an inertia tensor: I = V diag(moments) V'.

    Order and signs of the axes are chosen so that V is as near to the identity as possible.
    """
    if np.abs(I - np.diag(np.diag(I))).max() <= DIAGONAL * np.abs(I).max():
        return np.diag(I).copy(), np.eye(3)
    moments, V = np.linalg.eigh((I + I.T) / 2)
    order = list(
        max(permutations((0, 1, 2)), key=lambda p: float(np.abs(V[[0, 1, 2], list(p)]).sum()))
    )
    V = V[:, order] * np.where(np.diag(V[:, order]) < 0, -1.0, 1.0)
    if np.linalg.det(V) < 0:
        V[:, int(np.argmin(np.abs(np.diag(V))))] *= -1
    return moments[order], V


def quaternion(R: Array) -> Array:
    """Convert a rotation matrix to a unit quaternion w, x, y, z with w >= 0."""
    xx, yy, zz = np.diag(R)
    squares = np.array([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz]) / 4
    k = int(np.argmax(squares))
    products = {
        (0, 1): R[2, 1] - R[1, 2], (0, 2): R[0, 2] - R[2, 0], (0, 3): R[1, 0] - R[0, 1],
        (1, 2): R[1, 0] + R[0, 1], (1, 3): R[0, 2] + R[2, 0], (2, 3): R[2, 1] + R[1, 2],
    }  # fmt: skip
    q = np.array(
        [squares[k] if i == k else products[min(i, k), max(i, k)] / 4 for i in range(4)]
    ) / np.sqrt(squares[k])
    return np.asarray(q / np.linalg.norm(q) * (-1.0 if q[0] < 0 else 1.0))


def _bodies(e: XmlElement) -> Iterator[XmlElement]:
    """Yield the bodies in MuJoCo's order: each body before the bodies inside it."""
    for child in e:
        if child.tag == "body":
            yield child
        if child.tag in ("body", "frame"):
            yield from _bodies(child)


@dataclass(frozen=True, eq=False)
class FileLink:
    """A link of a URDF or MJCF file, with its inertial parameters and its XML elements.

    Attributes
    ----------
    name : str
        Name in the file.
    j : int
        Number of the body to which the link belongs.
    ten : ndarray, shape (10,)
        XX .. ZZ, MX, MY, MZ, M of the file in frame j.
    place : LinkPlace
        XML elements with its numbers.
    """

    name: str
    j: int
    ten: Array
    place: LinkPlace

    @property
    def numbers(self) -> Array:
        """Mass, centre of mass and inertia tensor in the file, shape (10,); order as in the list
        `NUMBERS`.
        """
        return self.place.numbers(self.ten) if self.place.stated is None else self.place.stated


@dataclass(frozen=True, eq=False)
class RobotText:
    """A parsed URDF or MJCF file: tree of links, frame table, and XML elements with the numbers.

    Attributes
    ----------
    file : str
        Name of the file.
    tree : Tree
        Links and joints that are used: the whole file, or a chain in it.
    table : Table
        Khalil frames of `tree`.
    robot : Robot
        The robot of `tree`.
    places : Places
        XML elements with the numbers.
    """

    file: str
    tree: Tree
    table: Table
    robot: Robot
    places: Places

    def on(self, base: str) -> RobotText:
        """Return the same text for a robot whose base is `base`, so that link 0 has parameters if
        the base is free.
        """
        return replace(self, robot=on_base(self.robot, base))

    @property
    def links(self) -> list[FileLink]:
        """Links with inertia on moving bodies; in a body, the link at the joint comes first."""
        return [
            FileLink(name, j, ten_of(inertial, X), self.places.link(name, self.tree, X))
            for j in self.robot.links
            for name, X in self.table.bodies[j].links.items()
            if (inertial := self.tree.links[name]) is not None and np.any(ten_of(inertial, X))
        ]

    def joint_values(self, j: int) -> dict[str, float]:
        """Return motor inertia, friction and spring of joint j in the file, by family (Ia ...)."""
        return {family: value(self.table.joint[j]) for family, _, value in JOINT_TERMS}

    def attribute(self, family: str, j: int) -> str | None:
        """Return the name of the XML attribute for a parameter of joint j, or None.

        The result is None if the format has no attribute for parameters of this family.
        """
        return self.places.attribute(family, self.table.joint[j])


def read_text(content: bytes, path: Path, exact: bool, part: TreePart) -> RobotText:
    """Read a URDF or MJCF file as `read_robot` does, and find its numbers in the text.

    Raises
    ------
    DescriptionError
        The file is no URDF or MJCF; the message names file and line.
    """
    with located(path.name):
        if (suffix := path.suffix.lower()) not in TREES:
            raise DescriptionError(
                "apply writes URDF (.urdf) and MJCF (.xml, .mjcf) files; for a robot file use "
                "`symgen convert --estimate`"
            )
        whole = parse_tree(content, path.name, exact=exact, loops=loops_beside(path))
        attributes = URDF if suffix == ".urdf" else MJCF
        tree = part_of(whole, part)
        robot, table = robot_of_tree(tree, path.name, "")[0], placed(tree)
        places = Places(content, whole, attributes)
        return RobotText(path.name, table.tree, table, robot, places)


def require_same_frames(text: RobotText, robot: Robot, file: str) -> None:
    """Check that `robot` has the same frames as the file, because link parameters depend on them.

    Raises DescriptionError if a frame differs.
    """
    ours, theirs = ({f.j: f for f in one.frames} for one in (text.robot, robot))
    different = [
        j for j in ours.keys() ^ theirs.keys() if j in ours or theirs[j].sigma != FIXED
    ]  # kept frames come last
    for j in ours.keys() & theirs.keys():
        pairs = zip(ours[j].at_zero, theirs[j].at_zero, strict=True)
        apart = max(abs(x.value(text.robot.constants) - y.value(robot.constants)) for x, y in pairs)
        if apart > POSE or (ours[j].ant, ours[j].sigma) != (theirs[j].ant, theirs[j].sigma):
            different.append(j)
    if different:
        raise DescriptionError(
            f"frames {', '.join(map(str, sorted(different)))} of {file} and {text.file} differ; if one file was converted from the other, give the same --chain, --lock and --exact again"
        )
