"""Where an MJCF file holds the numbers of its bodies and joints.

With pose X of the body in frame j:  <inertial mass= pos=> and the tensor about the centre as fullinertia in axes of the body, or as diaginertia with the
orientation of its principal axes. A body whose inertia comes from its geoms gets an <inertial>; inertiafromgeom="true" becomes "auto", by which the others
stay as they are. A joint has damping, frictionloss, armature and the spring
stiffness, springref; what a class of defaults says for many joints is not changed: a joint that differs gets an attribute of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from symgen.description.mjcf_text import MAX_DEPTH
from symgen.description.tree import FIXED_TYPE, Array, Joint, Tree
from symgen.description.xml_text import Element, read_elements
from symgen.errors import DescriptionError
from symgen.update.inertial import Quantity, about_centre
from symgen.update.xml_edits import Source, numbers, same

ATTRIBUTES = {"FV": "damping", "FS": "frictionloss", "Ia": "armature"}
SPRING = {"K": "stiffness", "OFFSET": "springref"}  # of a joint that has one: OFFSET = -stiffness springref
TURNED = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
FULL = ("xx", "yy", "zz", "xy", "xz", "yz")
DIAGONAL = 1e-12  # of the largest moment: smaller products are none


@dataclass(frozen=True, eq=False)
class MjcfBody:
    """A body and its <inertial>, if it has one.

    Attributes
    ----------
    body : Element
        <body>.
    e : Element or None
        <inertial>.
    ten : ndarray, shape (10,)
        Of the compiled model, in frame j.
    X : ndarray, shape (4, 4)
        Pose of the body in frame j.
    axes : ndarray, shape (3, 3)
        Orientation of the principal axes of the compiled model in the body.
    """

    body: Element
    e: Element | None
    ten: Array
    X: Array
    axes: Array

    @property
    def principal(self) -> bool:
        """Whether the file states principal moments."""
        return self.e is not None and "fullinertia" not in self.e.attributes

    def quantities(self, ten: Array) -> list[Quantity]:
        """Mass, centre, and the tensor in the axes in which the file has it, from ten parameters in the frame of the body."""
        M, c, I = about_centre(ten, self.X, self.axes if self.principal else np.eye(3))
        tensor = (I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])
        return [
            Quantity("mass", "kg", ("mass",), (M,)),
            Quantity("centre", "m", ("x", "y", "z"), tuple(c)),
            Quantity("inertia", "kg*m**2", FULL, tensor),
        ]

    def stated(self) -> tuple[float, ...]:
        """The same numbers of the file as MuJoCo compiles it."""
        return tuple(x for q in self.quantities(self.ten) for x in q.values)

    def write(self, source: Source, ten: Array) -> None:
        """The edits that make the file state `ten`."""
        (mass,), centre, tensor = (q.values for q in self.quantities(ten))
        if self.e is None:
            source.insert_child(self.body, f'<inertial pos="{numbers(centre)}" mass="{numbers((mass,))}" fullinertia="{numbers(tensor)}"/>')
            return
        source.set_numbers(self.e, "mass", (mass,))
        source.set_numbers(self.e, "pos", centre)
        if not self.principal:
            source.set_numbers(self.e, "fullinertia", tensor)
            return
        xx, yy, zz, xy, xz, yz = tensor
        moments, V = principal(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        source.set_numbers(self.e, "diaginertia", tuple(moments))
        quat = quaternion(self.axes @ V).tolist()
        if all(same(x, y) for x, y in zip(quat, quaternion(self.axes), strict=True)):
            return
        written = next((name for name in TURNED if name in self.e.attributes), None)
        if written in (None, "quat"):
            source.set_numbers(self.e, "quat", quat, (1.0, 0.0, 0.0, 0.0))
        else:
            source.replace_attribute(self.e, str(written), "quat", quat)


class MjcfFile:
    """Elements of an MJCF file by the names of the links and joints of its tree."""

    format = "MJCF"

    def __init__(self, content: bytes, tree: Tree) -> None:
        root = read_elements(content, MAX_DEPTH)
        compilers = [e for e in root.children if e.tag == "compiler"]
        self.from_geoms = [e for e in compilers if e.attributes.get("inertiafromgeom") == "true"]
        self.degrees = not any(e.attributes.get("angle") == "radian" for e in compilers)
        bodies = [e for world in root.children if world.tag == "worldbody" for e in _bodies(world)]
        joints = [x for e in bodies for x in _own(e, "joint", "freejoint")]
        moving = [joint.name for joint in tree.joints if joint.kind != FIXED_TYPE or not joint.name.endswith(" (fixed)")]
        self.places_of = tree.places
        self.bodies = dict(zip(tree.places, bodies, strict=True))
        self.joints = dict(zip(moving, joints, strict=True))
        for name, e in self.joints.items():
            if e.attributes.get("name", name) != name:
                raise DescriptionError(f"joint {name!a:.60} is not found where MuJoCo has it; sort joints before bodies", line=e.line)

    def link(self, name: str, tree: Tree, X: Array, ten: Array) -> MjcfBody:
        """The body of link `name`, which has inertia and pose X in frame j."""
        body, inertial = self.bodies[name], tree.links[name]
        e = next(_own(body, "inertial"), None)
        if e is not None and e not in body.children:
            raise DescriptionError("<inertial> inside a <frame>; write it into its body", line=e.line)
        place = self.places_of[name]
        assert inertial is not None
        return MjcfBody(body, e, ten, X @ place, place[:3, :3].T @ inertial.pose[:3, :3])

    def attribute(self, family: str, joint: Joint) -> str | None:
        """Where a joint holds a parameter; None: nowhere."""
        return ATTRIBUTES.get(family) or (SPRING.get(family) if joint.stiffness else None)

    def heed_inertials(self, source: Source) -> None:
        """The edit by which MuJoCo heeds an <inertial> that was inserted."""
        ignored = next((e for body in self.bodies.values() for e in _own(body, "inertial")), None)
        if self.from_geoms and ignored is not None:
            raise DescriptionError(
                "inertiafromgeom is true and this <inertial> without effect; remove the one or the other", line=ignored.line
            )
        for e in self.from_geoms:
            source.set_word(e, "inertiafromgeom", "auto")

    def set_joint(self, source: Source, joint: Joint, values: Mapping[str, float], before: Mapping[str, float]) -> None:
        """The edits that make the file state `values` of a joint, by family, where it says `before`."""
        e = self.joints[joint.name]
        new = {family: x for family, x in values.items() if not same(x, before[family])}
        if new and "springdamper" in e.attributes:
            raise DescriptionError(
                f"joint {joint.name!a:.60}: springdamper sets its damping; write stiffness and damping instead", line=e.line
            )
        for family, x in new.items():
            if family in ATTRIBUTES:
                source.set_numbers(e, ATTRIBUTES[family], (x,))
        if new.keys() & SPRING.keys():
            K, offset = (values.get(family, before[family]) for family in SPRING)
            if K <= 0:
                raise DescriptionError(
                    f"joint {joint.name!a:.60}: a stiffness of {K:.4g} comes out; MuJoCo takes positive ones", line=e.line
                )
            rest = -offset / K
            source.set_numbers(e, "stiffness", (K,))
            source.set_numbers(e, "springref", (np.degrees(rest) if self.degrees and joint.kind != "prismatic" else rest,))


def principal(I: Array) -> tuple[Array, Array]:
    """Moments (3,) and axes V (3, 3) with I = V diag(moments) V', V as near to the identity as it may be."""
    if np.abs(I - np.diag(np.diag(I))).max() <= DIAGONAL * np.abs(I).max():
        return np.diag(I).copy(), np.eye(3)
    moments, V = np.linalg.eigh((I + I.T) / 2)
    order = list(max(permutations((0, 1, 2)), key=lambda p: float(np.abs(V[[0, 1, 2], list(p)]).sum())))
    V = V[:, order] * np.where(np.diag(V[:, order]) < 0, -1.0, 1.0)
    if np.linalg.det(V) < 0:
        V[:, int(np.argmin(np.abs(np.diag(V))))] *= -1
    return moments[order], V


def quaternion(R: Array) -> Array:
    """Unit quaternion w, x, y, z of a rotation matrix, w not negative."""
    xx, yy, zz = np.diag(R)
    squares = np.array([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz]) / 4
    k = int(np.argmax(squares))
    products = {
        (0, 1): R[2, 1] - R[1, 2], (0, 2): R[0, 2] - R[2, 0], (0, 3): R[1, 0] - R[0, 1],
        (1, 2): R[1, 0] + R[0, 1], (1, 3): R[0, 2] + R[2, 0], (2, 3): R[2, 1] + R[1, 2],
    }  # fmt: skip
    q = np.array([squares[k] if i == k else products[min(i, k), max(i, k)] / 4 for i in range(4)]) / np.sqrt(squares[k])
    return np.asarray(q / np.linalg.norm(q) * (-1.0 if q[0] < 0 else 1.0))


def _bodies(e: Element) -> Iterator[Element]:
    """Bodies in the order of MuJoCo: a body before those inside it."""
    for child in e.children:
        if child.tag == "body":
            yield child
        if child.tag in ("body", "frame"):
            yield from _bodies(child)


def _own(e: Element, *tags: str) -> Iterator[Element]:
    """Children of a body, those inside its frames too."""
    for child in e.children:
        if child.tag in tags:
            yield child
        elif child.tag == "frame":
            yield from _own(child, *tags)
