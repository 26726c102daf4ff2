"""Where a URDF holds the numbers of its links and joints.

With pose X of the link in frame j and orientation R of its <inertial> in frame j, which stays:

    mass M,    xyz = centre MS / M in the link frame,    ixx .. izz = R' (J - M (c'c 1 - c c')) R

A joint has <dynamics damping= friction=>; motor inertia, offsets and springs have no place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from symgen.description.tree import Array, Inertial, Joint, Tree
from symgen.description.xml_text import Element, read_elements
from symgen.errors import DescriptionError
from symgen.update.inertial import Quantity, about_centre
from symgen.update.xml_edits import Source, numbers, same

TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
DYNAMICS = {"FV": "damping", "FS": "friction"}


@dataclass(frozen=True, eq=False)
class UrdfLink:
    """A link and its <inertial>.

    Attributes
    ----------
    e : Element
        <inertial>.
    inertial : Inertial
        What it says.
    X : ndarray, shape (4, 4)
        Pose of the link in the frame of its body.
    """

    e: Element
    inertial: Inertial
    X: Array

    def quantities(self, ten: Array) -> list[Quantity]:
        """The numbers that the file states, from ten parameters in the frame of the body."""
        M, c, I = about_centre(ten, self.X, self.inertial.pose[:3, :3])
        tensor = (I[0, 0], I[0, 1], I[0, 2], I[1, 1], I[1, 2], I[2, 2])
        return [
            Quantity("mass", "kg", ("mass",), (M,)),
            Quantity("centre", "m", ("x", "y", "z"), tuple(c)),
            Quantity("inertia", "kg*m**2", tuple(name[1:] for name in TENSOR), tensor),
        ]

    def stated(self) -> tuple[float, ...]:
        """The same numbers as they stand in the file."""
        I, c = self.inertial.I, self.inertial.pose[:3, 3]
        return (self.inertial.M, *c, I[0, 0], I[0, 1], I[0, 2], I[1, 1], I[1, 2], I[2, 2])

    def write(self, source: Source, ten: Array) -> None:
        """The edits that make the file state `ten`."""
        (mass,), centre, tensor = (q.values for q in self.quantities(ten))
        e = {child.tag: child for child in reversed(self.e.children)}
        source.set_numbers(e["mass"], "value", (mass,))
        if "origin" in e:
            source.set_numbers(e["origin"], "xyz", centre, (0.0, 0.0, 0.0))
        elif any(centre):
            source.insert_child(self.e, f'<origin xyz="{numbers(centre)}" rpy="0 0 0"/>')
        if "inertia" in e:
            for name, x in zip(TENSOR, tensor, strict=True):
                source.set_numbers(e["inertia"], name, (x,))
        elif any(tensor):
            words = " ".join(f'{name}="{numbers((x,))}"' for name, x in zip(TENSOR, tensor, strict=True))
            source.insert_child(self.e, f"<inertia {words}/>")


class UrdfFile:
    """Elements of a URDF by the names of links and joints."""

    format = "URDF"

    def __init__(self, content: bytes) -> None:
        root = read_elements(content)
        self.links = {e.text("name"): e for e in root.children if e.tag == "link"}
        self.joints = {e.text("name"): e for e in root.children if e.tag == "joint"}

    def link(self, name: str, tree: Tree, X: Array) -> UrdfLink:
        """The link `name`, which has inertia and pose X in the frame of its body."""
        e, inertial = self.links[name].first("inertial"), tree.links[name]
        if e is None or inertial is None:
            raise DescriptionError(f"link {name!a:.60} has no <inertial>", line=self.links[name].line)
        return UrdfLink(e, inertial, X)

    def attribute(self, family: str, joint: Joint) -> str | None:
        """Where a joint holds a parameter; None: nowhere."""
        return DYNAMICS.get(family)

    def set_joint(self, source: Source, joint: Joint, values: Mapping[str, float], before: Mapping[str, float]) -> None:
        """The edits that make the file state `values` of a joint, by family, where it says `before`."""
        own = {DYNAMICS[family]: x for family, x in values.items() if not same(x, before[family])}
        e = self.joints[joint.name].first("dynamics")
        if e is not None:
            for key, x in own.items():
                source.set_numbers(e, key, (x,), (0.0,))
        elif any(own.values()):
            words = " ".join(f'{key}="{numbers((x,))}"' for key, x in own.items())
            source.insert_child(self.joints[joint.name], f"<dynamics {words}/>")
