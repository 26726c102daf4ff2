"""Angles that a file writes as decimals and means as multiples of pi/12: what taking them as that
changes.

A frame that is turned by delta moves what it carries by at most delta times the distance to the
farthest of it, at any joint positions: the sum of the lengths between.
"""

from __future__ import annotations

import math
import warnings
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from symgen.description.expression import PI, twelfths

SNAP = 1e-4  # rad: angles of a file this close to a multiple of pi/12 are taken as that
LISTED = 1e-8  # rad: changes of less are nine digits of pi, and are not listed in the warning
SHOWN = 20  # angles, or names, in a message

ALL_DIGITS = 1e-12  # rad: closer to a multiple of pi/12 is that multiple in every digit


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


@dataclass
class Angles:
    """Angles of one file as they are read.

    Attributes
    ----------
    exact : bool
        Whether all stay as they are written.
    near : list of tuple
        Of each that differs from a multiple of pi/12 by less than SNAP and more than ALL_DIGITS:
        joint, angle and line; rad in the file; k of the multiple k pi/12; frame that it turns.
    """

    exact: bool
    near: list[tuple[str, float, int, str]] = field(default_factory=list)

    def twelfths(self, angle: float, name: str, frame: str) -> int | None:
        """k of the multiple k pi/12 that `angle` is taken as; None where it stays."""
        k = twelfths(angle, SNAP)
        if k is None or abs(k * (math.pi / 12) - angle) <= ALL_DIGITS:
            return k
        self.near.append((name, angle, k, frame))
        return None if self.exact else k

    def report(self, file: str, reach: Mapping[str, float]) -> tuple[str, tuple[str, ...]]:
        """How the angles were read, for headers, and a note for each that is changed; an
        AngleWarning tells them too. An angle that turns no frame turns an inertia alone.
        """
        near = f"{len(self.near)} angle{'s' * (len(self.near) > 1)} near multiples of pi/12"
        if self.exact or not self.near:
            return f"{near} are those of {file}" if self.near else "", ()
        notes, moved = [], 0.0
        for name, angle, k, frame in self.near:
            change = k * (math.pi / 12) - angle
            shift = abs(change) * reach.get(frame, 0.0)
            tool = f", the tool by up to {shift:.1e} m" if shift else ""
            notes.append(
                f"{name} from {angle:.12g} to {PI * Fraction(k, 12)}, by {change:.1e} rad{tool}"
            )
            moved += shift
        way = f", which moves the tool by up to {moved:.1e} m" if moved else ""
        text = f"{near} taken as these{way}"
        shown = [*notes[:SHOWN], *[f"and {len(notes) - SHOWN} more"] * (len(notes) > SHOWN)]
        most = max(abs(k * (math.pi / 12) - angle) for _, angle, k, _ in self.near)
        each = f": {'; '.join(shown)}" if most > LISTED else ""
        warnings.warn(
            f"{file}: {text}; exact=True or --exact keeps them{each}",
            AngleWarning,
            stacklevel=7,
        )
        return text, tuple(notes)
