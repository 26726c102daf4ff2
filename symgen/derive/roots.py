"""Square roots that other roots, cosines or constants of a robot make up: over every prime they
take either sign, so that a proof may fail of what is right.
"""

from __future__ import annotations

from itertools import islice

import numpy as np

from symgen.derive.angles import Variable, roots_of
from symgen.derive.exact import FEW, Array, Draw, candidates, power
from symgen.description.expression import Call
from symgen.description.parts import GEOMETRY
from symgen.description.robot import Robot
from symgen.errors import DescriptionError

PRIMES, CERTAIN = 40, 40  # primes at which roots are looked at, and draws of which all are squares


def require_simple_roots(robot: Robot) -> None:
    """Raise DescriptionError, which names it, where a root depends on others."""
    if (root := dependent_root(robot)) is None:
        return
    entries = (
        f"frames.{f.j}.{name}"
        for f in robot.frames
        for name in GEOMETRY
        if root.text in str(getattr(f, name))
    )
    raise DescriptionError(
        f"{next(entries, 'elements')}: {root} is, but for its sign, made of other roots, cosines "
        "or constants of this robot, and exact arithmetic does not tell which sign; write it by "
        "them, without this root",
        file=robot.file or None,
    )


def dependent_root(robot: Robot) -> Call | None:
    """A square root that is a sum of other roots and cosines of the robot up to its sign, which
    every prime takes as it likes: over each in which they exist, its argument is a square.

    Roots are looked at from the inside out, at many values of the constants.
    """
    nested = [r for r in roots_of(robot) if r.argument.constant is None]
    roots = sorted(nested, key=lambda r: len(r.text))
    seen, other = dict.fromkeys(roots, 0), set[Call]()
    for p in islice(candidates(robot), PRIMES if roots else 0):
        rng = np.random.default_rng(p)
        values: dict[Variable, Array] = {c: rng.integers(1, p, (FEW, 1)) for c in robot.constants}
        exist = np.ones((FEW, 1), dtype=bool)
        for root in roots:
            draw = Draw(robot, 5, 1, p=p, geometry=values, count=FEW, attempts=1)
            x = np.broadcast_to(draw.residues(draw.constant(root.argument)), exist.shape)
            square = power(x, (p - 1) // 2, p) == 1
            seen[root] += int(exist.sum())
            other |= {root} if (exist & ~square).any() else set()
            exist &= square
            values[root] = power(x, (p + 1) // 4, p)
    return next((r for r in roots if r not in other and seen[r] > CERTAIN), None)
