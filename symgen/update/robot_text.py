"""A URDF or MJCF file as it is read for `apply`: its tree, its Khalil frames, and the elements that hold its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from symgen.description.robot import FIXED, Frame, Robot
from symgen.description.tree import Array, Tree
from symgen.description.tree_frames import Table, placed
from symgen.description.tree_parts import Part, part_of
from symgen.description.tree_robot import FAMILIES, robot_of_tree, ten_of
from symgen.description.urdf import parse_urdf
from symgen.errors import DescriptionError
from symgen.update.mjcf import MjcfBody, MjcfFile
from symgen.update.nearest import FileLink
from symgen.update.urdf import UrdfFile, UrdfLink
from symgen.update.xml_edits import Source

POSE = 1e-6  # m, rad: frames of two descriptions of one robot differ by no more


@dataclass(frozen=True, eq=False)
class RobotText:
    """A file of links and joints, and what it says.

    Attributes
    ----------
    file : str
        Its name.
    content : bytes
        Its text.
    whole, tree : Tree
        Links and joints, all of them and those of the part that is kept.
    table : Table
        Khalil frames of `tree`.
    robot : Robot
        The robot of `tree`.
    elements : UrdfFile or MjcfFile
        Where the numbers stand.
    """

    file: str
    content: bytes
    whole: Tree
    tree: Tree
    table: Table
    robot: Robot
    elements: UrdfFile | MjcfFile

    @property
    def links(self) -> list[FileLink]:
        """The links with inertia of the bodies that move, body by body, the one that the joint carries first."""
        return [
            FileLink(name, j, ten_of(inertial, X))
            for j in self.robot.links
            for name, X in self.table.bodies[j].links.items()
            if (inertial := self.tree.links[name]) is not None and np.any(ten_of(inertial, X))
        ]

    def link(self, link: FileLink) -> UrdfLink | MjcfBody:
        """Where the numbers of a link stand."""
        X = self.table.bodies[link.j].links[link.name]
        if isinstance(self.elements, MjcfFile):
            return self.elements.link(link.name, self.tree, X, link.ten)
        return self.elements.link(link.name, self.tree, X)

    def write_links(self, source: Source, links: Sequence[tuple[UrdfLink | MjcfBody, Array]]) -> None:
        """The edits that make the file state the ten parameters of these links."""
        for place, ten in links:
            place.write(source, ten)
        if links and isinstance(self.elements, MjcfFile):
            self.elements.heed_inertials(source)

    def joint_values(self, j: int) -> dict[str, float]:
        """What the file says of the elements along joint j, by family."""
        return {family: value(self.table.joint[j]) for family, _, value in FAMILIES}

    def attribute(self, family: str, j: int) -> str | None:
        """Where joint j holds a parameter; None: the format has no place for it."""
        return self.elements.attribute(family, self.table.joint[j])

    def set_joint(self, source: Source, j: int, values: Mapping[str, float]) -> None:
        """The edits that make the file state `values` of joint j, by family."""
        self.elements.set_joint(source, self.table.joint[j], values, self.joint_values(j))


def read_text(content: bytes, path: Path, nearly: float, part: Part) -> RobotText:
    """The file as `symgen.description.read_robot` reads it.

    Raises
    ------
    DescriptionError
        No URDF or MJCF; the message names file and line.
    """
    try:
        if path.suffix.lower() == ".urdf":
            whole, file = parse_urdf(content, nearly), None
        elif path.suffix.lower() in (".xml", ".mjcf"):
            from symgen.description.mjcf import parse_mjcf  # mujoco, an extra

            whole = parse_mjcf(content)
            file = MjcfFile(content, whole)
        else:
            raise DescriptionError(
                "values go back into a URDF (.urdf) or an MJCF (.xml, .mjcf); a robot file takes them by `symgen convert --estimate`"
            )
        tree = part_of(whole, part)
        robot = robot_of_tree(tree, path.name, "")[0]
        return RobotText(path.name, content, whole, tree, placed(tree), robot, file or UrdfFile(content))
    except DescriptionError as error:
        raise DescriptionError(error.message, path=error.path, file=path.name, line=error.line or 1) from error.__cause__


def require_same_frames(text: RobotText, robot: Robot, file: str) -> None:
    """Raise DescriptionError unless the frames of `robot` are those of the text: parameters of a link mean nothing in another frame."""
    ours, theirs = ({f.j: f for f in one.frames} for one in (text.robot, robot))
    different = [j for j in ours.keys() ^ theirs.keys() if j in ours or theirs[j].sigma != FIXED]  # kept frames come last
    for j in ours.keys() & theirs.keys():
        rows = [_row(f, one.constants) for f, one in ((ours[j], text.robot), (theirs[j], robot))]
        if (ours[j].ant, ours[j].sigma) != (theirs[j].ant, theirs[j].sigma) or np.abs(rows[0] - rows[1]).max() > POSE:
            different.append(j)
    if different:
        raise DescriptionError(
            f"{file} and {text.file} have other frames {', '.join(map(str, sorted(different)))}: say --chain, --lock and --snap as when the one was "
            "converted from the other"
        )


def _row(f: Frame, constants: Mapping[str, float]) -> Array:
    return np.array([getattr(f, name).value(constants) for name in ("gamma", "b", "alpha", "d", "theta0", "r0")])
