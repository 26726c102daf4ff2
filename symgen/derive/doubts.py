"""Warnings about values of a robot that are valid but probably wrong, such as lengths in mm.

Further examples: inertias in g mm^2, angles very near to a round one, equal sides of a loop with two names, a start at
which a loop does not close, angles in degrees.
"""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import combinations

from symgen.derive.loops import close
from symgen.description.cad import from_cad
from symgen.description.expression import PI, twelfths
from symgen.description.robot import REVOLUTE, Robot

FAR = 0.3  # rad, or of the longest length
CLOSE = 1e-3  # rad: nearer to a round angle than a drawing shows, and not on it
LONGEST = 100.0  # m; of gravity in m/s^2
LOPSIDED = 50.0  # a length over the sum of the others
DEGREES = 30.0  # rad: a zero or a limit beyond is one in degrees ...
UNLIMITED = 1000.0  # ... unless it stands for none at all


def doubts(robot: Robot) -> list[str]:
    """Return a warning sentence for each value of a robot that is valid but probably wrong.

    Raises DescriptionError if a loop does not close.
    """
    return [
        *nearly_round(robot),
        *other_units(robot),
        *from_cad(robot),
        *equal_sides(robot),
        *far_starts(robot),
    ]


def nearly_round(robot: Robot, within: float = CLOSE) -> list[str]:
    """Warn of angles written as decimals near a multiple of pi/12, such as 1.5708 for pi/2.

    Exact arithmetic treats such a decimal as an oblique angle, with formulas and base parameters of
    its own.
    """
    notes = []
    for f in robot.frames:
        for name, angle in (("gamma", f.gamma), ("alpha", f.alpha), ("theta", f.theta0)):
            if not (value := angle.constant):
                continue
            k = twelfths(float(value), within)
            if k is not None:
                meant = PI * Fraction(k, 12)
                notes.append(
                    f"frame {robot.row(f.j, name)}: {name} has {angle}, not {meant}: "
                    f"another robot, with other formulas; if {meant} is meant, write it (in a URDF "
                    "or MJCF the angles or offsets that give it)"
                )
    return notes


def other_units(robot: Robot) -> list[str]:
    """Warn of gravity, lengths, drive offsets and limits that are too large for m and rad."""
    notes = []
    g = math.hypot(*(e.value(robot.constants) for e in robot.gravity))
    if g > LONGEST:
        notes.append(f"gravity is {g:g} m/s^2; lengths are in m, not mm")
    lengths = {
        (f.j, name): abs(getattr(f, name).value(robot.constants))
        for f in robot.frames
        for name in ("b", "d", "r0")
    }
    total = sum(lengths.values())
    for (j, name), length in lengths.items():
        if length > LONGEST or (length > 1 and length > LOPSIDED * (total - length) > 0):
            notes.append(
                f"frame {robot.row(j, name)}: {name.removesuffix('0')} holds a length of {length:g} m; "
                "lengths are in m, not mm"
            )
    turning = [k for k, j in enumerate(robot.joints) if robot.frame(j).sigma == REVOLUTE]
    zeros = robot.drives.offset if robot.drives else ()
    bounds = [max(map(abs, x)) for x in robot.limits.get("q", ())]  # type: ignore[arg-type]
    for what, values in (("drives.offset", zeros), ("limits.q", bounds)):
        for k in turning:
            if k < len(values) and DEGREES < abs(values[k]) < UNLIMITED:
                notes.append(
                    f"{what} of joint {robot.joints[k]}: {values[k]:g} rad are "
                    f"{abs(values[k]) / (2 * math.pi):.3g} turns; angles are in rad, not degrees"
                )
    return notes


def equal_sides(robot: Robot) -> list[str]:
    """Warn of equal lengths with different names in a loop that may be meant as a parallelogram.

    Only with one name for both lengths can symgen treat the loop as a parallelogram.
    """
    if not robot.loops:
        return []
    tied = set(close(robot).tied)
    notes = []
    for loop in robot.loops:
        frames = [
            robot.frame(j) for j in sorted({*robot.path(loop.cut)} ^ {*robot.path(loop.twin)})
        ]
        if not tied & {f.j for f in frames}:
            continue
        lengths = sorted(
            {
                name
                for f in frames
                for e in (f.b, f.d, f.r)
                for name in e.symbols
                if robot.constants.get(name)
            }
        )
        pairs = [
            f"{a} and {b}"
            for a, b in combinations(lengths, 2)
            if math.isclose(robot.constants[a], robot.constants[b], rel_tol=1e-9)
        ]
        if pairs:
            notes.append(
                f"symgen treats the loop of frames {loop.cut} and {loop.twin} as a general loop, "
                f"which is slow and has fewer targets; {', '.join(pairs)} are equal: if they are "
                "equal by construction, write one name for both, so that symgen can "
                "recognise a parallelogram"
            )
    return notes


def far_starts(robot: Robot) -> list[str]:
    """Warn of joints whose start position is far from the nearest position that closes the loops."""
    closed, longest = close(robot).start, robot.longest
    units = {j: 1.0 if robot.frame(j).sigma == REVOLUTE else longest for j in robot.start}
    far = [j for j, x in robot.start.items() if abs(closed[j] - x) > FAR * units[j]]
    wanted, found = (
        ", ".join(f"q{j} = {values[j]:.4g}" for j in far) for values in (robot.start, closed)
    )
    text = f"start: the loops close nowhere near {wanted}; nearest, and derived, is {found}"
    return [text] if far else []
