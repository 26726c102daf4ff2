"""URDF to a Robot: the text (`urdf_text`) becomes a tree, the tree a table of Khalil frames (`tree_frames`) with values (`tree_robot`)."""

from __future__ import annotations

import hashlib

from symgen.description.robot import Robot
from symgen.description.tree_robot import robot_of_tree
from symgen.description.urdf_text import parse_urdf
from symgen.errors import DescriptionError


def read_urdf(content: bytes, file: str, *, nearly: float = 0.0, keep_fixed: bool = False) -> tuple[Robot, tuple[str, ...]]:
    """The robot of a URDF, and notes: which joint is which q, which link is which kept frame, and what was not read.

    Parameters
    ----------
    content, file : bytes and name of the file.
    nearly : rad; angles of the file this close to a multiple of pi/12 are taken as that, 1e-4 for files that say 1.5708.
    keep_fixed : links held by fixed joints (tool0, flange) are fixed frames (sigma 2) without parameters, for frame_poses and jacobian; else they
        are only part of the body that holds them, to which their inertia belongs either way.

    Raises
    ------
    DescriptionError : no URDF, or no tree of revolute, prismatic and fixed joints; names file and line.
    """
    try:
        return robot_of_tree(parse_urdf(content, nearly), file, hashlib.sha256(content).hexdigest(), keep_fixed=keep_fixed)
    except DescriptionError as error:
        raise DescriptionError(error.message, path=error.path, file=file, line=error.line or 1) from error.__cause__
