"""Tables of the distal (classic, Denavit-Hartenberg 1955) convention, turned into those of Khalil and Kleinfinger.

Distal: frame j lies at the far end of link j, joint j turns about or moves along z of its antecedent,

    iTj = Rot(z, theta_j) Trans(z, r_j) Trans(x, d_j) Rot(x, alpha_j)       (textbooks call d_j a_j and r_j d_j)

Grouped anew, [Rot(x, alpha_i) Trans(x, d_i)] Rot(z, theta_j) Trans(z, r_j) is Khalil's transformation: theta_j and r_j stay, alpha_j and d_j
are those of the antecedent, 0 for joints on the base. What is left at the end of a branch becomes a fixed frame without link, the textbook's
last frame. Link frames, hence standard parameters, are Khalil's.
"""

from __future__ import annotations

from dataclasses import replace

from symgen.description.expression import ZERO
from symgen.description.robot import FIXED, Frame
from symgen.errors import DescriptionError


def khalil_frames(frames: tuple[Frame, ...]) -> tuple[Frame, ...]:
    """Khalil's table of a distal one, fixed frames of the branch ends last; raises DescriptionError where gamma or b is given."""
    for f in frames:
        for key in ("gamma", "b"):
            if getattr(f, key):
                raise DescriptionError(f"frame {f.j}: {key} is not part of the distal convention; leave it out", path=("frames", f.j, key))
    distal = {f.j: (f.alpha, f.d) for f in frames}
    turned = []
    for f in frames:
        alpha, d = distal.get(f.ant, (ZERO, ZERO))
        turned.append(replace(f, alpha=alpha, d=d))
    ends = [f for f in frames if any(distal[f.j]) and not any(k.ant == f.j for k in frames)]
    tips = [
        Frame(len(frames) + k, f.j, FIXED, 0, gamma=ZERO, b=ZERO, alpha=f.alpha, d=f.d, theta=ZERO, r=ZERO)
        for k, f in enumerate(ends, start=1)
    ]
    return (*turned, *tips)
