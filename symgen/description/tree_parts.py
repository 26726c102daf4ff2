"""Part of a tree: joints held at positions, and the chain between two links alone.

A joint that is held is a fixed joint with the pose of that position; what follows it stands where
its relation says. The inertia of a link that no
longer moves belongs to the body that holds it, as with any fixed joint.

Of a chain from `base` to `tip`, the joints between these two links move. The others outward of
`base` are held at zero, so that a gripper and the
branches stay as masses; `base` is the ground, the acceleration of gravity that of the tree with the
joints before `base` at zero, and
what stands before `base` is left out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from symgen.description.angles import SHOWN
from symgen.description.expression import Expression
from symgen.description.tree import FIXED_TYPE, FREE_TYPE, Array, Joint, Tree, turn
from symgen.errors import DescriptionError


@dataclass(frozen=True)
class TreePart:
    """What of a tree is kept.

    Attributes
    ----------
    lock : mapping, rad or m
        Positions at which joints are held, by name.
    chain : tuple of str or None
        Base and tip, names of links.
    """

    lock: Mapping[str, float] = field(default_factory=dict)
    chain: tuple[str, str] | None = None


WHOLE_TREE = TreePart()


def part_of(tree: Tree, part: TreePart) -> Tree:
    """The tree with the joints of `part.lock` held, cut down to `part.chain`; notes tell what was
    held and left out.

    Raises
    ------
    DescriptionError
        No such joint or link, a joint that does not move or follows another, a tip that does not
        hang on the base by a joint that moves.
    """
    for name in part.lock:
        _require_independent(tree, name)
    if part.lock:
        note = f"held: {_names([f'{name} at {x:.6g}' for name, x in part.lock.items()])}"
        tree = replace(_held(tree, part.lock), notes=(*tree.notes, note))
    return tree if part.chain is None else _chain(tree, *part.chain)


def _require_independent(tree: Tree, name: str) -> None:
    kinds = {joint.name: joint.kind for joint in tree.joints}
    if kinds.get(name, FIXED_TYPE) == FIXED_TYPE:
        moving = [joint for joint, kind in kinds.items() if kind != FIXED_TYPE]
        raise DescriptionError(
            f"joint {name!a:.60} to lock: no moving joint of that name; the file has "
            f"{_names(moving)}"
        )
    if name in tree.relations:
        leaders = [leader for leader in kinds if leader in tree.relations[name].atoms]
        raise DescriptionError(f"joint {name!a:.60} to lock follows others; lock {_names(leaders)}")


def _held(tree: Tree, positions: Mapping[str, float]) -> Tree:
    """The tree with joints held at `positions`, and with them the joints that follow no other."""
    exact = {name: Expression.number(repr(x)) for name, x in positions.items()}
    relations = {
        name: e.substitute(exact) for name, e in tree.relations.items() if name not in positions
    }
    fixed = {**positions, **{name: float(e) for name, e in relations.items() if not e.atoms}}
    joints = tuple(
        replace(j, kind=FIXED_TYPE, pose=j.pose @ _motion(j, fixed[j.name]), limits={})
        if j.name in fixed
        else j
        for j in tree.joints
    )
    following = {name: e for name, e in relations.items() if e.atoms}
    return replace(tree, joints=joints, relations=following)


def _motion(joint: Joint, q: float) -> Array:
    """(4, 4) of a joint at position q: along its axis, or about it, R = 1 + sin q [a] + (1 - cos q)
    [a]^2.
    """
    T = np.eye(4)
    if joint.kind == FREE_TYPE and q:
        raise DescriptionError(
            f"free joint {joint.name!a:.60} is held where the file has it, at 0", line=joint.line
        )
    if joint.kind == "prismatic":
        T[:3, 3] = q * joint.axis
        return T
    c, s = turn(2, q)[:2, 0]  # exact at quarter turns
    x, y, z = joint.axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    T[:3, :3] += s * cross + (1 - c) * cross @ cross
    return T


def _chain(tree: Tree, base: str, tip: str) -> Tree:
    for link in (base, tip):
        if link not in tree.links:
            raise DescriptionError(
                f"no link {link!a:.60} for the chain; the file has {_names(list(tree.links))}"
            )
    holding = {joint.child: joint for joint in tree.joints}
    between = _path(holding, tip, base)
    before = _path(holding, base, tree.root)
    if between is None or all(joint.kind == FIXED_TYPE for joint in between):
        raise DescriptionError(
            f"link {tip!a:.60} does not hang on {base!a:.60} by a joint that moves; a chain goes "
            "from base to tip, outward"
        )
    outward = {base}
    while new := {joint.child for joint in tree.joints if joint.parent in outward} - outward:
        outward |= new
    between_names = {joint.name for joint in between}
    held = {
        joint.name: _zero(tree, joint.name)
        for joint in tree.joints
        if joint.kind != FIXED_TYPE and joint.name not in between_names
    }
    hanging = [
        joint.name for joint in tree.joints if joint.name in held and joint.parent in outward
    ]
    dropped = [link for link in tree.links if link not in outward]
    tree = _held(tree, held)
    moving = [joint.name for joint in tree.joints if joint.kind != FIXED_TYPE]
    notes = [f"chain from {base!a:.60} to {tip!a:.60}: {_names(moving)} move"]
    notes += (
        [f"held at zero, their links parts of the bodies that carry them: {_names(hanging)}"]
        if hanging
        else []
    )
    notes += (
        [f"links left out, since the base of the chain is the ground: {_names(dropped)}"]
        if dropped
        else []
    )
    R = np.eye(3)
    standing = {joint.name: joint for joint in tree.joints}
    for joint in before or ():
        R = R @ standing[joint.name].pose[:3, :3]
    gx, gy, gz = (round(float(x), 12) + 0.0 for x in R.T @ tree.gravity)
    return replace(
        tree,
        links={name: inertial for name, inertial in tree.links.items() if name in outward},
        joints=tuple(joint for joint in tree.joints if joint.parent in outward),
        root=base,
        bare=tree.bare & outward,
        gravity=(gx, gy, gz),
        notes=(*tree.notes, *notes),
    )


def _zero(tree: Tree, name: str) -> float:
    """Position of a joint that is held at zero, or of one that follows where its leaders are at
    zero.
    """
    return float(tree.relations[name].terms.get((), 0.0)) if name in tree.relations else 0.0


def _path(holding: Mapping[str, Joint], link: str, root: str) -> list[Joint] | None:
    """Joints from `root` outward to `link`; None where it does not hang on it."""
    path: list[Joint] = []
    while link != root:
        if link not in holding:
            return None
        path.insert(0, holding[link])
        link = holding[link].parent
    return path


def _names(names: Collection[str]) -> str:
    shown = ", ".join(ascii(name)[1:-1][:60] for name in list(names)[:SHOWN])
    return shown + (f" and {len(names) - SHOWN} more" if len(names) > SHOWN else "")
