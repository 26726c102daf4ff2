"""Conversion of classic Denavit-Hartenberg tables (1955) into tables of Khalil and Kleinfinger.

In the classic convention, here called distal, frame j lies at the far end of link j, and joint j
turns about or moves along z of its antecedent:

    iTj = Rot(z, theta_j) Trans(z, r_j) Trans(x, d_j) Rot(x, alpha_j)

Textbooks write a_j for this d_j, and d_j for this r_j.

With the factors grouped as [Rot(x, alpha_i) Trans(x, d_i)] Rot(z, theta_j) Trans(z, r_j), this is
Khalil's transformation: theta_j and r_j stay; alpha and d are those of the antecedent i, or 0 for
joints on the base. The last alpha and d of a branch give a fixed frame without link, the last frame
of the textbook. Link frames, hence standard parameters, are Khalil's. `values` of such a file refer
to the textbook's frames and are converted.
"""

from __future__ import annotations

from dataclasses import replace

from symgen.description.expression import ZERO
from symgen.description.parts import FIXED, Frame
from symgen.errors import DescriptionError


def khalil_frames(frames: tuple[Frame, ...]) -> tuple[Frame, ...]:
    """Convert the rows of a classic (distal) table into rows of Khalil's table.

    Fixed frames for the ends of branches come last. Raises DescriptionError if gamma or b is given.
    """
    for f in frames:
        for key in ("gamma", "b"):
            if getattr(f, key):
                raise DescriptionError(
                    f"frame {f.j}: {key} is not part of the distal convention; leave {key} out",
                    path=(f.j, key),
                )
    distal = {f.j: {"alpha": f.alpha, "d": f.d} for f in frames}
    base = {"alpha": ZERO, "d": ZERO}
    turned = [replace(f, **distal.get(f.ant, base)) for f in frames]  # type: ignore[arg-type]
    ends = [f for f in frames if (f.alpha or f.d) and not any(other.ant == f.j for other in frames)]
    rest = dict.fromkeys(("gamma", "b", "theta", "r"), ZERO)
    tips = [
        Frame(j, f.j, FIXED, 0, **rest, **distal[f.j])
        for j, f in enumerate(ends, start=len(frames) + 1)
    ]
    return (*turned, *tips)
