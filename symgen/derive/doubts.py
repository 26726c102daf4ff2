"""What is valid in a robot but probably not meant: angles a hair off a round one, equal sides of a loop under two names."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import combinations

from symgen.derive.loops import close
from symgen.description.expression import PI, twelfths
from symgen.description.robot import Robot

CLOSE = 1e-3  # rad: nearer to a round angle than a drawing shows, and not on it


def doubts(robot: Robot) -> list[str]:
    """A sentence for each. Raises DescriptionError where a loop does not close."""
    return [*nearly_round(robot), *equal_sides(robot)]


def nearly_round(robot: Robot) -> list[str]:
    """Angles written as decimals, such as 1.5708: exact arithmetic takes them for oblique ones, with formulas and base parameters of their own."""
    notes = []
    for f in robot.frames:
        for name, angle in (("gamma", f.gamma), ("alpha", f.alpha), ("theta", f.theta0)):
            if not (value := angle.constant):
                continue
            k = twelfths(float(value), CLOSE)
            if k is not None:
                meant = PI * Fraction(k, 12)
                notes.append(
                    f"frame {f.j}: {name} has {angle}, not {meant}: "
                    f"another robot, with other formulas; write {meant} (of a URDF: symgen convert --snap 1e-4)"
                )
    return notes


def equal_sides(robot: Robot) -> list[str]:
    """Lengths of equal value and different names in a loop without linear relations: with one name it may be a parallelogram."""
    if not robot.loops:
        return []
    tied = set(close(robot).tied)
    notes = []
    for loop in robot.loops:
        frames = [robot.frame(j) for j in sorted({*robot.path(loop.cut)} ^ {*robot.path(loop.twin)})]
        if not tied & {f.j for f in frames}:
            continue
        lengths = sorted({name for f in frames for e in (f.b, f.d, f.r) for name in e.symbols if robot.constants.get(name)})
        pairs = [f"{a} and {b}" for a, b in combinations(lengths, 2) if math.isclose(robot.constants[a], robot.constants[b], rel_tol=1e-9)]
        if pairs:
            notes.append(
                f"the loop of frames {loop.cut} and {loop.twin} is taken for a general one, which is slow and has the NumPy target only; "
                f"{', '.join(pairs)} are equal: if by construction, write one name for both, and a parallelogram is seen as one"
            )
    return notes
