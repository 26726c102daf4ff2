"""A URDF or MJCF file as it is read for `apply`: its tree, its Khalil frames, and the elements that
hold its numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from symgen.description.fields import located
from symgen.description.files import TREES
from symgen.description.robot import FIXED, Robot
from symgen.description.tree import Tree
from symgen.description.tree_frames import Table, placed
from symgen.description.tree_parts import TreePart, part_of
from symgen.description.tree_robot import JOINT_TERMS, parse_tree, robot_of_tree, ten_of
from symgen.errors import DescriptionError
from symgen.update.nearest import FileLink
from symgen.update.places import MJCF, URDF, LinkPlace, Places

POSE = 1e-6  # m, rad: frames of two descriptions of one robot differ by no more


@dataclass(frozen=True, eq=False)
class RobotText:
    """A file of links and joints, and what it says.

    Attributes
    ----------
    file : str
        Its name.
    tree : Tree
        Links and joints of the part of it that is read.
    table : Table
        Khalil frames of `tree`.
    robot : Robot
        The robot of `tree`.
    places : Places
        Where the numbers stand.
    """

    file: str
    tree: Tree
    table: Table
    robot: Robot
    places: Places

    @property
    def links(self) -> list[FileLink]:
        """The links with inertia of the bodies that move, body by body, the one that the joint
        carries first.
        """
        return [
            FileLink(name, j, ten_of(inertial, X))
            for j in self.robot.links
            for name, X in self.table.bodies[j].links.items()
            if (inertial := self.tree.links[name]) is not None and np.any(ten_of(inertial, X))
        ]

    def link(self, link: FileLink) -> LinkPlace:
        """Where the numbers of a link stand."""
        return self.places.link(link.name, self.tree, self.table.bodies[link.j].links[link.name])

    def joint_values(self, j: int) -> dict[str, float]:
        """What the file says of the elements along joint j, by family."""
        return {family: value(self.table.joint[j]) for family, _, value in JOINT_TERMS}

    def attribute(self, family: str, j: int) -> str | None:
        """Where joint j holds a parameter; None: the format has no place for it."""
        return self.places.attribute(family, self.table.joint[j])


def read_text(content: bytes, path: Path, exact: bool, part: TreePart) -> RobotText:
    """The file as `symgen.description.read_robot` reads it.

    Raises
    ------
    DescriptionError
        No URDF or MJCF; the message names file and line.
    """
    with located(path.name):
        if (suffix := path.suffix.lower()) not in TREES:
            raise DescriptionError(
                "values go back into a URDF (.urdf) or an MJCF (.xml, .mjcf); a robot file takes "
                "them by `symgen convert --estimate`"
            )
        whole = parse_tree(content, path.name, exact=exact)
        attributes = URDF if suffix == ".urdf" else MJCF
        tree = part_of(whole, part)
        robot = robot_of_tree(tree, path.name, "")[0]
        places = Places(content, whole, attributes)
        return RobotText(path.name, tree, placed(tree), robot, places)


def require_same_frames(text: RobotText, robot: Robot, file: str) -> None:
    """Raise DescriptionError unless the frames of `robot` are those of the text: parameters of a
    link mean nothing in another frame.
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
            f"{file} and {text.file} have other frames {', '.join(map(str, sorted(different)))}: "
            "say --chain, --lock and --exact as when the one was "
            "converted from the other"
        )
