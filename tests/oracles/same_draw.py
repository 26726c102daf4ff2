"""A sampler that draws once for each prime: certificates of many mutations of one robot differ by
their formulas alone.
"""

from __future__ import annotations

from symgen.certify.certificate import Sampler
from symgen.derive.exact import Array, Draw
from symgen.regroup.states import sample


def same_draw() -> Sampler:
    """`symgen.regroup.states.sample` that gives the columns of its first draw for a prime ever
    after: sampling is most of the work.
    """
    drawn: dict[int, Array] = {}

    def once(draw: Draw, names: tuple[str, ...]) -> Array:
        if draw.p not in drawn:
            drawn[draw.p] = sample(draw, names)
        return drawn[draw.p]

    return once
