"""Angles that a file writes as decimals and means as multiples of pi/12: what taking them as that
changes.

A frame that is turned by delta moves what it carries by at most delta times the distance to the
farthest of it, at any joint positions: the sum of the lengths between.
"""

from __future__ import annotations

import math
import warnings
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from symgen.description.expression import PI, twelfths

SNAP = 1e-4  # rad: angles of a URDF this close to a multiple of pi/12 are taken as that
SHOWN = 20  # angles, or names, in a message

Rounding = tuple[str, float, str]  # joint, angle and line; rad in the file; frame that it turns


class AngleWarning(UserWarning):
    """Angles of a file were taken as multiples of pi/12; `exact=True` takes them as written."""


def reaches(edges: Iterable[tuple[str, str, float]], root: str) -> dict[str, float]:
    """Largest sum of lengths, m, outward from each frame; edges (antecedent, frame, length)."""
    carried = defaultdict(list)
    for ant, frame, length in edges:
        carried[ant].append((frame, length))
    order, reach = [root], dict[str, float]()
    for ant in order:
        order += [frame for frame, _ in carried[ant]]
    for ant in reversed(order):
        reach[ant] = max((length + reach[frame] for frame, length in carried[ant]), default=0.0)
    return reach


def report_angles(
    file: str, roundings: Sequence[Rounding], reach: Mapping[str, float], *, exact: bool
) -> tuple[str, tuple[str, ...]]:
    """How the angles of a file were read, for headers, and a note for each that is changed; an
    AngleWarning tells them too. An angle that turns no frame turns an inertia alone.
    """
    near = f"{len(roundings)} angle{'s' * (len(roundings) > 1)} near multiples of pi/12"
    if exact or not roundings:
        return f"{near} are those of {file}" if roundings else "", ()
    notes, moved = [], 0.0
    for name, angle, frame in roundings:
        k = twelfths(angle, SNAP) or 0
        change = k * (math.pi / 12) - angle
        shift = abs(change) * reach.get(frame, 0.0)
        tool = f", the tool by up to {shift:.1e} m" if shift else ""
        notes.append(
            f"{name} from {angle:.12g} to {PI * Fraction(k, 12)}, by {change:.1e} rad{tool}"
        )
        moved += shift
    way = f", which moves the tool by up to {moved:.1e} m" if moved else ""
    text = f"{near} taken as these{way}"
    more = [f"and {len(notes) - SHOWN} more"] * (len(notes) > SHOWN)
    warnings.warn(
        f"{file}: {text}; exact=True or --exact keeps them: {'; '.join([*notes[:SHOWN], *more])}",
        AngleWarning,
        stacklevel=6,
    )
    return text, tuple(notes)
