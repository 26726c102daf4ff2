"""Rounding of the angles in a file: a decimal near a multiple of pi/12 becomes this multiple."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from fractions import Fraction

from symgen.description.expression import PI, twelfths

SNAP = 1e-4  # rad: angles of a file this close to a multiple of pi/12 are taken as that
SNAPPED = "snapped:"  # how the note on them starts
ALL_DIGITS = 1e-12  # rad: closer to a multiple of pi/12 is that multiple in every digit
TOLD = 1e-9  # rad: a smaller change of an angle is not told


class RobotFileWarning(UserWarning):
    """Warning about a value in a URDF, MJCF or .par file that was probably not intended."""


class InertiaWarning(RobotFileWarning):
    """Warning about a link whose mass and inertia tensor no physical body can have."""


class NotReadWarning(RobotFileWarning):
    """Warning about parts of a robot file that change the torques and are not in the equations."""


class AngleWarning(RobotFileWarning):
    """Warning that angles of a file were rounded to multiples of pi/12.

    `exact=True` prevents the rounding.
    """


@dataclass
class Angles:
    """The rounding rule for the angles of one file, and the list of angles near multiples of pi/12.

    Attributes
    ----------
    exact : bool
        Whether all angles stay as written in the file.
    near : list of tuple
        Each angle that differs from a multiple k pi/12 by at most 1e-4 rad (`SNAP`), but by more
        than rounding (`ALL_DIGITS`): its name (joint, angle and line), its value in the file (rad),
        and k.
    """

    exact: bool
    near: list[tuple[str, float, int]] = field(default_factory=list)

    def twelfths(self, angle: float, name: str) -> int | None:
        """Return k if `angle` (rad) is to be replaced by k pi/12, or None if it stays as written.

        An angle that is only near k pi/12 is also stored in `near` under `name`.
        """
        k = twelfths(angle, SNAP)
        if k is None or abs(k * (math.pi / 12) - angle) <= ALL_DIGITS:
            return k
        self.near.append((name, angle, k))
        return None if self.exact else k

    def report(self, file: str) -> tuple[str, tuple[str, ...]]:
        """Write which angles near multiples of pi/12 were rounded: a text for file headers, and
        notes for the user.

        If angles were rounded by more than 1e-9 rad (`TOLD`), a note names the largest change, and
        an AngleWarning is issued. Both results are empty if the file has no such angle.
        """
        changes = [
            (k * (math.pi / 12) - angle, name, angle, k)
            for name, angle, k in self.near
            if self.exact or abs(k * (math.pi / 12) - angle) > TOLD
        ]
        if not changes:
            return "", ()
        count = f"{len(changes)} angle{'s' * (len(changes) > 1)}"
        if self.exact:
            return f"{count} near multiples of pi/12 are those of {file}", ()
        most, name, angle, k = max(changes, key=lambda change: abs(change[0]))
        farthest = f"{name} from {angle:.12g} to {PI * Fraction(k, 12)}, by {most:.1e} rad"
        if len(changes) > 1:
            farthest += f", and {len(changes) - 1} by less"
        text = f"{count} rounded to multiples of pi/12 (15 deg)"
        message = f"{file}: {text}; exact=True or --exact keeps them: {farthest}"
        warnings.warn(message, AngleWarning, stacklevel=7)
        return text, (f"{SNAPPED} {farthest}",)
