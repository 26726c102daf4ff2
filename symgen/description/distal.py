"""Tables of the distal (classic, Denavit-Hartenberg 1955) convention, turned into those of Khalil and Kleinfinger.

Distal: frame j lies at the far end of link j, joint j turns about or moves along z of its
antecedent,

    iTj = Rot(z, theta_j) Trans(z, r_j) Trans(x, d_j) Rot(x, alpha_j)

where textbooks call d_j a_j and r_j d_j.

Grouped anew, [Rot(x, alpha_i) Trans(x, d_i)] Rot(z, theta_j) Trans(z, r_j) is Khalil's
transformation: theta_j and r_j stay, alpha_j and d_j are those of the antecedent, 0 for joints on
the base. What is left at the end of a branch becomes a fixed frame without link, the textbook's
last frame. Link frames, hence standard parameters, are Khalil's; `values` of such a file are those
of the textbook's frames and are moved.
"""

from __future__ import annotations

from dataclasses import replace

from symgen.description.expression import ZERO
from symgen.description.parts import FIXED, Frame
from symgen.errors import DescriptionError


def khalil_frames(frames: tuple[Frame, ...]) -> tuple[Frame, ...]:
    """Khalil's table of a distal one, fixed frames of the branch ends last.

    Raises DescriptionError if gamma or b is given.
    """
    for f in frames:
        for key in ("gamma", "b"):
            if getattr(f, key):
                raise DescriptionError(
                    f"frame {f.j}: {key} is not part of the distal convention; leave it out",
                    path=("frames", f.j, key),
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
