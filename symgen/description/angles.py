"""Angles that a file writes as decimals and means as multiples of pi/12."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from fractions import Fraction

from symgen.description.expression import PI, twelfths

SNAP = 1e-4  # rad: angles of a file this close to a multiple of pi/12 are taken as that
SNAPPED = "snapped:"  # how the note on them starts
ALL_DIGITS = 1e-12  # rad: closer to a multiple of pi/12 is that multiple in every digit


class RobotFileWarning(UserWarning):
    """Statement of a foreign robot file that its author probably did not intend."""


class InertiaWarning(RobotFileWarning):
    """A link of a URDF has an inertia that no body can have."""


class AngleWarning(RobotFileWarning):
    """Angles of a file were taken as multiples of pi/12; `exact=True` takes them as written."""


@dataclass
class Angles:
    """Angles of one file as they are read.

    Attributes
    ----------
    exact : bool
        Whether all stay as they are written.
    near : list of tuple
        Of each that differs from a multiple of pi/12 by less than SNAP and more than ALL_DIGITS:
        joint, angle and line; rad in the file; k of the multiple k pi/12.
    """

    exact: bool
    near: list[tuple[str, float, int]] = field(default_factory=list)

    def twelfths(self, angle: float, name: str) -> int | None:
        """k of the multiple k pi/12 that `angle` is taken as; None if it stays."""
        k = twelfths(angle, SNAP)
        if k is None or abs(k * (math.pi / 12) - angle) <= ALL_DIGITS:
            return k
        self.near.append((name, angle, k))
        return None if self.exact else k

    def report(self, file: str) -> tuple[str, tuple[str, ...]]:
        """How angles were read, for headers and as a note, with an AngleWarning."""
        if not self.near:
            return "", ()
        near = f"{len(self.near)} angle{'s' * (len(self.near) > 1)} near multiples of pi/12"
        if self.exact:
            return f"{near} are those of {file}", ()
        changes = {k * (math.pi / 12) - angle: (name, angle, k) for name, angle, k in self.near}
        most = max(changes, key=abs)
        name, angle, k = changes[most]
        farthest = f"{name} from {angle:.12g} to {PI * Fraction(k, 12)}, by {most:.1e} rad"
        if len(self.near) > 1:
            farthest += f", and {len(self.near) - 1} by less"
        text = f"{near} taken as these"
        message = f"{file}: {text}; exact=True or --exact keeps them: {farthest}"
        warnings.warn(message, AngleWarning, stacklevel=7)
        return text, (f"{SNAPPED} {farthest}",)
