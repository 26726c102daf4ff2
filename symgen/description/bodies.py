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
CLEARLY = 0.01  # of the largest moment: more than a file rounds
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
    wrong = f"no body has this inertia about its centre of mass: {_excess(tensor, names)}"
    others = _other_products(tensor)
    return f"{wrong}; a body has it {others}" if others else wrong


def _excess(tensor: Array, names: Sequence[str]) -> str:
    """Write the inequality of moments that a tensor violates."""
    moments = dict(zip(names, np.diag(tensor), strict=True))
    for name, moment in moments.items():
        if moment < 0:
            return f"{name} {moment:.4g} below zero"
    for name, moment in moments.items():
        others = [other for other in names if other != name]
        rest = sum(moments[other] for other in others)
        if moment > (1 + ROUNDING) * rest:
            return f"{name} {moment:g} > {' + '.join(others)} {rest:g}"
    small, middle, large = np.linalg.eigvalsh(tensor)
    return f"principal moments {small:.3g}, {middle:.3g}, {large:.3g}"


def _other_products(tensor: Array) -> str:
    """Say which change of the products of inertia would make an impossible tensor possible; "" if
    no change clearly does.

    CAD programs write products with the other sign (SolidWorks: positive), or the six numbers in
    another order.
    """
    xx, yy, zz = np.diag(tensor)
    xy, xz, yz = tensor[0, 1], tensor[0, 2], tensor[1, 2]
    if _violation(tensor) < CLEARLY:
        return ""
    others = {
        "with products of the other sign": (xx, yy, zz, -xy, -xz, -yz),
        "with the six numbers in the order xx, yy, zz, xy, xz, yz": (xx, xy, xz, yy, yz, zz),
        "with the six numbers in the order xx, yy, zz, xy, yz, xz": (xx, xy, xz, yy, zz, yz),
    } | {
        f"with {a} and {b} exchanged": (xx, yy, zz, *products)
        for a, b, products in (
            ("xy", "xz", (xz, xy, yz)),
            ("xy", "yz", (yz, xz, xy)),
            ("xz", "yz", (xy, yz, xz)),
        )
    }
    for words, (a, b, c, d, e, f) in others.items():
        if _violation(np.array([[a, d, e], [d, b, f], [e, f, c]])) <= 0:
            return words
    return ""


def _violation(tensor: Array) -> float:
    """Compute by how much a tensor violates the conditions of a body, relative to its largest
    moment; 0 or less means that a body has it.
    """
    small, middle, large = np.linalg.eigvalsh(tensor)
    return float(max(-small, large - small - middle) / max(abs(large), abs(small), 1e-300))


def impossible_links(robot: Robot) -> tuple[tuple[int, str], ...]:
    """Find the links whose inertia no body can have, and return the frame and a sentence for each.

    The inertias are those of the links of a URDF, or else the given `values` of each link.
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

    If parameters are missing, a moment about an axis is judged with the first moments that are
    given: I_zz = ZZ - (MX^2 + MY^2) / M >= 0.
    """
    ten = np.array([0.0 if x is None else x for x in given])
    J, MS, M = ten[[0, 3, 5]], ten[6:9], ten[9]
    if given[9] is not None and M == 0 and MS.any():
        return "mass 0 with first moments"
    if None not in given:
        wrong, tensor = no_body(M, centred(ten)), _tensor(ten[:6])
        about_centre = bool(wrong and MS.any() and tensor.any() and not no_body(M, tensor))
        return wrong + "; about the centre of mass, a body has these moments" * about_centre
    if M < 0:
        return no_body(M, np.zeros((3, 3)))
    squares = MS**2 / M if M else np.zeros(3)
    for name, own, moment, rest in zip(
        MOMENTS, (given[0], given[3], given[5]), J, squares.sum() - squares, strict=True
    ):
        if own is not None and moment - rest < -ROUNDING * max(abs(moment), ROUNDED):
            return f"no body has this inertia about its centre of mass: {name} {moment - rest:.4g} below zero"
    return ""


def _tensor(J: Array) -> Array:
    """Arrange XX XY XZ YY YZ ZZ as a tensor, shape (3, 3)."""
    I = np.zeros((3, 3))
    I[np.triu_indices(3)] = J
    return I + np.triu(I, 1).T


def centred(ten: Array) -> Array:
    """Compute the tensor about the centre of mass; differences of rounded moments are zero."""
    I = inertial_of(ten).I
    return np.where(np.abs(I) > ROUNDING * np.abs(ten[:6]).max(), I, 0.0)
