"""Inertias that no body can have, in a URDF and in `values` of a robot file.

The principal moments about the centre of mass are not negative, and none exceeds the sum of the
other two. The mass is not negative, and a body without mass has neither first moments nor inertia.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.description.robot import INERTIAL, Robot, parameter
from symgen.description.tree import Array, inertial_of

MOMENTS = ("xx", "yy", "zz")
ROUNDING = 1e-6  # of moments that a file rounds
ROUNDED = 1e-15  # kg m^2: smaller moments are zero


def no_body(M: float, tensor: Array, names: Sequence[str] = MOMENTS) -> str:
    """Explain why no body has mass M and this tensor about its centre of mass; "" if a body can.

    `names` are the names of the three moments in the explanation.
    """
    if M < 0:
        return f"mass {M:g} below zero"
    tensor = np.where(np.abs(tensor) > ROUNDED, tensor, 0.0)
    if not M and tensor.any():
        return "mass 0 with an inertia"
    small, middle, large = np.linalg.eigvalsh(tensor)
    if small >= -ROUNDING * abs(large) and large <= (1 + ROUNDING) * (small + middle):
        return ""
    wrong = "no body has this inertia about its centre of mass: "
    moments = dict(zip(names, np.diag(tensor), strict=True))
    for name, moment in moments.items():
        if moment < 0:
            return f"{wrong}{name} {moment:.4g} below zero"
    for name, moment in moments.items():
        others = [other for other in names if other != name]
        rest = sum(moments[other] for other in others)
        if moment > (1 + ROUNDING) * rest:
            return f"{wrong}{name} {moment:g} > {' + '.join(others)} {rest:g}"
    return f"{wrong}principal moments {small:.3g}, {middle:.3g}, {large:.3g}"


def impossible_links(robot: Robot) -> tuple[tuple[int, str], ...]:
    """Find the links whose inertia no body can have: the frame, and a sentence.

    The inertias are those of the links of a URDF; otherwise `values`, of each link as far as given.
    """
    if robot.impossible:
        return robot.impossible
    found = (
        (j, _impossible([robot.values.get(parameter(p, j)) for p in INERTIAL])) for j in robot.links
    )
    return tuple(
        (j, f"link {j} ({robot.file or robot.name}): {wrong}") for j, wrong in found if wrong
    )


def _impossible(given: Sequence[float | None]) -> str:
    """Explain why no body has the ten parameters of a link; None is a parameter that is not given.

    With parameters missing, a moment about an axis is judged by those of its first moments that are
    given: I_zz = ZZ - (MX^2 + MY^2) / M >= 0.
    """
    ten = np.array([0.0 if x is None else x for x in given])
    J, MS, M = ten[[0, 3, 5]], ten[6:9], ten[9]
    if given[9] is not None and M == 0 and MS.any():
        return "mass 0 with first moments"
    if None not in given:
        return no_body(M, centred(ten))
    if M < 0:
        return no_body(M, np.zeros((3, 3)))
    squares = MS**2 / M if M else np.zeros(3)
    for name, own, moment, rest in zip(
        MOMENTS, (given[0], given[3], given[5]), J, squares.sum() - squares, strict=True
    ):
        if own is not None and moment - rest < -ROUNDING * max(abs(moment), ROUNDED):
            return f"no body has this inertia about its centre of mass: {name} {moment - rest:.4g} below zero"
    return ""


def centred(ten: Array) -> Array:
    """Compute the tensor about the centre of mass; differences of rounded moments are zero."""
    I = inertial_of(ten).I
    return np.where(np.abs(I) > ROUNDING * np.abs(ten[:6]).max(), I, 0.0)
