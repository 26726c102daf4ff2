"""Loops of a URDF or MJCF from a second file in its folder: NAME.loops.yaml, or loop_closures.yaml
of an exporter.

`arm.loops.yaml` belongs to `arm.urdf`:

    loops:
      - {links: [rod, rocker], points: [[0.3, 0, 0], [0.2, 0, 0]]}   # a point that both share
      - {links: [a, b], points: [[0, 0, 0.1], [0, 0, 0]], axis: [0, 1, 0]}   # a hinge
    actuated: [crank]
    start: {crank: 0.4}

`points` are in the frames of the links, m; [0, 0, 0] by default. `axis` is a direction in the first
link, `rpy` are the orientations of both frames, rad. `type` is spherical, revolute, prismatic or
fixed; by default revolute if an axis is given, else spherical. `start` has joint positions, rad or m,
near which the loops are closed.

Exporters write loop_closures.yaml, in one of two forms:

    closures: [{link_a: a, link_b: b, point: [x, y, z], axis: [x, y, z]}]    # in the root link
    independent: [crank]                                                     # joints with motors

    pin_loops:  [{name: knee, parent: a, child: b, parent_xyz: [...], child_xyz: [...]}]
    ball_loops: [...]
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symgen.description.angles import Angles
from symgen.description.fields import Path, located
from symgen.description.tree import FIXED_TYPE, HINGE, Array, Tree, TreeLoop, rotation
from symgen.description.tree_loops import frame_along, link_poses
from symgen.description.yaml import document
from symgen.errors import DescriptionError

EXPORTED = "loop_closures.yaml"
KINDS = ("spherical", "revolute", "prismatic", FIXED_TYPE)
KEYS = {
    "": ("loops", "actuated", "start"),
    "loops": ("name", "type", "links", "points", "axis", "rpy"),
}


@dataclass(frozen=True)
class LoopsText:
    """Name and content of a file with loops."""

    file: str
    content: bytes


def with_loops(tree: Tree, text: LoopsText | None) -> Tree:
    """Return the tree with the loops, motors and start positions of a second file.

    Raises DescriptionError, with file and line, if the file has other keys, or names links or
    joints that the tree does not have. A loop_closures.yaml that is about other links is ignored.
    """
    if text is None:
        return tree
    lines: dict[Path, int] = {}

    def line(path: Path) -> int:
        return next((lines[path[:k]] for k in range(len(path), -1, -1) if path[:k] in lines), 1)

    with located(text.file, line):
        data = document(text.content, lines)
        if not isinstance(data, dict):
            raise DescriptionError("expected a table with the keys loops, actuated and start")
        exported = text.file == EXPORTED
        reader = _Reader(tree)
        if exported and not reader.is_of_these_links(data):
            return tree
        loops = tuple(reader.exported(data) if exported else reader.loops(data))
        motors = data.get("independent" if exported else "actuated")
        start = {} if exported else data.get("start")
        driven = tree.driven if motors is None else frozenset(reader.joints(motors, exported))
        where = {} if start is None else start
        if not isinstance(where, dict):
            raise DescriptionError("start: expected joint positions, {crank: 0.4}", path=("start",))
        positions = {name: reader.number(x, ("start", name)) for name, x in where.items()}
        reader.require_joints(positions, ("start",))
    return replace(
        tree,
        loops=(*tree.loops, *loops),
        driven=driven,
        start={**tree.start, **positions},
        notes=(*tree.notes, f"loops of {text.file}"),
    )


@dataclass(frozen=True)
class _Reader:
    """Reads the data of a file with loops of the links and joints of a tree."""

    tree: Tree

    def is_of_these_links(self, data: Mapping[str, Any]) -> bool:
        rows = [
            row
            for key in ("closures", "pin_loops", "ball_loops")
            if isinstance(data.get(key), list)
            for row in data[key]
            if isinstance(row, dict)
        ]
        ends = ("link_a", "link_b", "parent", "child")
        return any(str(row[end]) in self.tree.links for row in rows for end in ends if end in row)

    def number(self, x: Any, path: Path) -> float:
        if isinstance(x, bool) or not isinstance(x, int | float) or not math.isfinite(x):
            raise DescriptionError(f"{x!r:.40}: expected a number", path=path)
        return float(x)

    def three(self, value: Any, path: Path) -> Array:
        if not isinstance(value, list) or len(value) != 3:
            raise DescriptionError(f"{value!r:.60}: expected three numbers", path=path)
        return np.array([self.number(x, (*path, k)) for k, x in enumerate(value)])

    def axis(self, value: Any, path: Path) -> Array:
        axis = self.three(value, path)
        if not np.linalg.norm(axis) > 1e-6:
            raise DescriptionError(f"{value!r:.60}: the axis has no direction", path=path)
        return np.asarray(axis / np.linalg.norm(axis))

    def link(self, value: Any, path: Path) -> str:
        if not isinstance(value, str) or value not in self.tree.links:
            shown = ", ".join(f"{name!a:.60}" for name in list(self.tree.links)[:20])
            raise DescriptionError(
                f"there is no link {value!r:.60}; the links are {shown}", path=path
            )
        return str(value)

    def require_joints(self, names: Any, path: Path) -> None:
        moving = [joint.name for joint in self.tree.joints if joint.kind != FIXED_TYPE]
        moving += [loop.joint.name for loop in self.tree.loops if loop.joint]
        for name in names:
            if name not in moving:
                shown = ", ".join(f"{joint!a:.60}" for joint in moving[:20])
                raise DescriptionError(
                    f"there is no moving joint {name!r:.60}; the joints are {shown}", path=path
                )

    def joints(self, value: Any, exported: bool) -> list[str]:
        path: Path = ("independent" if exported else "actuated",)
        if not isinstance(value, list):
            raise DescriptionError(
                f"{value!r:.60}: expected a list of joint names, [crank]", path=path
            )
        self.require_joints(value, path)
        return [str(name) for name in value]

    def rows(self, value: Any, path: Path) -> Iterator[tuple[dict[str, Any], Path]]:
        if value is None:
            return
        if not isinstance(value, list) or not all(isinstance(row, dict) for row in value):
            raise DescriptionError("expected a list of loops, each in { }", path=path)
        for k, row in enumerate(value):
            yield row, (*path, k)

    def loops(self, data: Mapping[str, Any]) -> Iterator[TreeLoop]:
        self.require_keys(data, "", ())
        for k, (row, path) in enumerate(self.rows(data.get("loops"), ("loops",))):
            self.require_keys(row, "loops", path)
            ends = row.get("links")
            if not isinstance(ends, list) or len(ends) != 2:
                raise DescriptionError("write links: [FIRST, SECOND]", path=(*path, "links"))
            links = [self.link(end, (*path, "links")) for end in ends]
            poses = []
            for side in (0, 1):
                T = np.eye(4)
                for key in ("points", "rpy"):
                    both = row.get(key, [[0, 0, 0], [0, 0, 0]])
                    if not isinstance(both, list) or len(both) != 2:
                        raise DescriptionError(
                            f"write {key}: [[x, y, z], [x, y, z]], one for each link",
                            path=(*path, key),
                        )
                    three = self.three(both[side], (*path, key))
                    if key == "points":
                        T[:3, 3] = three
                    else:
                        T[:3, :3] = rotation(three.tolist(), f"loop {k + 1}", Angles(exact=False))
                poses.append(T)
            kind = row.get("type", "revolute" if "axis" in row else "spherical")
            if kind not in KINDS:
                raise DescriptionError(
                    f"type {kind!r:.40}; expected {', '.join(KINDS)}", path=(*path, "type")
                )
            if kind in ("revolute", "prismatic"):
                if "axis" in row:
                    S = frame_along(self.axis(row["axis"], (*path, "axis")))
                    poses = self.about(poses, links, S, "rpy" in row)
                else:
                    kind = HINGE if kind == "revolute" else kind
            name = str(row.get("name", f"loop{k + 1}"))
            yield TreeLoop(name, kind, (links[0], links[1]), (poses[0], poses[1]))

    def about(self, poses: list[Array], links: list[str], S: Array, given: bool) -> list[Array]:
        """Turn both frames so that their z axes have the direction S of the first link.

        If no orientations are given, the loop closes in the orientation that the links have at
        zero.
        """
        P, Q = poses
        if given:
            return [P @ S, Q @ S]
        at_zero = link_poses(self.tree, {})
        turned = np.eye(4)
        turned[:3, :3] = (np.linalg.inv(at_zero[links[1]]) @ at_zero[links[0]])[:3, :3]
        return [P @ S, Q @ turned @ S]

    def exported(self, data: Mapping[str, Any]) -> Iterator[TreeLoop]:
        at_zero = link_poses(self.tree, {})
        for k, (row, path) in enumerate(self.rows(data.get("closures"), ("closures",))):
            first, second = (self.link(row.get(f"link_{x}"), (*path, f"link_{x}")) for x in "ab")
            T = np.eye(4)
            if "axis" in row:
                T = frame_along(self.axis(row["axis"], (*path, "axis")))
            T[:3, 3] = self.three(row.get("point"), (*path, "point"))
            P, Q = (np.linalg.inv(at_zero[link]) @ T for link in (first, second))
            kind = "revolute" if "axis" in row else HINGE
            yield TreeLoop(f"loop{k + 1}", kind, (first, second), (P, Q))
        for key, kind in (("pin_loops", HINGE), ("ball_loops", "spherical")):
            for k, (row, path) in enumerate(self.rows(data.get(key), (key,))):
                links, poses = [], []
                for side in ("parent", "child"):
                    links.append(self.link(row.get(side), (*path, side)))
                    T = np.eye(4)
                    T[:3, 3] = self.three(row.get(f"{side}_xyz"), (*path, f"{side}_xyz"))
                    poses.append(T)
                name = str(row.get("name", f"{key}{k + 1}"))
                yield TreeLoop(name, kind, (links[0], links[1]), (poses[0], poses[1]))

    def require_keys(self, row: Mapping[str, Any], table: str, path: Path) -> None:
        for key in row:
            if key not in KEYS[table]:
                raise DescriptionError(
                    f"unknown key {key!r:.40}; the keys are {', '.join(KEYS[table])}",
                    path=(*path, str(key)),
                )
