"""Names of the intermediate variables in formulas, such as W12, sorted into families, such as W.

Order of the indices: components, link, then the joint if there is one. W12 is component 1 of the
angular velocity of link 2, U312 is row 3, column 1 of the matrix U of link 2, Z132 is component 1,
in frame 3, of the axis of joint 2. With more than nine frames, an underscore separates the indices:
W1_12.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

FAMILIES = {
    "th": "joint angle with its constant, rad",
    "C": "cosine of a joint angle or of a sum of angles",
    "S": "sine of a joint angle or of a sum of angles",
    "CA": "cosine of the fixed angle alpha",
    "SA": "sine of the fixed angle alpha",
    "CG": "cosine of the fixed angle gamma",
    "SG": "sine of the fixed angle gamma",
    "r": "position of a prismatic joint with its constant, m",
    "QP": "joint velocity; with the name of an element, QPFSM6, the velocity that it acts along",
    "QDP": "joint acceleration",
    "QPR": "reference velocity of a joint",
    "QDPR": "reference acceleration of a joint",
    "G": "rate of a passive joint per unit rate of an actuated one",
    "W": "angular velocity of a link, in its frame",
    "WP": "angular acceleration of a link, in its frame",
    "DV": "products of angular velocity components W_k W_l",
    "DW": "differences of their squares",
    "U": "skew(WP) + skew(W)**2",
    "VSP": "acceleration of the origin of a frame minus gravity, in the antecedent's frame",
    "VP": "the same, in the frame itself",
    "Z": "axis of a joint, in the frame of a later link",
    "ZP": "rate of change of such an axis",
    "VO": "velocity of a frame's origin, in that frame",
    "V": "velocity of a frame's origin per unit rate of a joint, in that frame",
    "VS": "the same, in the antecedent's frame",
    "F": "force that moves a link",
    "N": "moment that moves a link, about the origin of its frame",
    "E": "force transmitted to a link by its antecedent, in its frame",
    "NE": "moment transmitted to a link by its antecedent, about the origin of its frame",
    "FDI": "the transmitted force, in the antecedent's frame",
    "NDI": "the transmitted moment, in the antecedent's frame",
    "JP": "inertia tensor of a link and all links after it, about the origin of its frame",
    "MSP": "first moments of a link and all links after it, in its frame",
    "MP": "mass of a link and all links after it",
    "HP": "rate of change of the first moments MSP",
    "BP": "sum of m r rd' of a link and all links after it, r and rd relative to the origin of its frame",
    "PP": "velocity of a frame's origin relative to that of its antecedent, in the antecedent's frame",
    "AJA": "the inertia tensor JP by the axes of the antecedent's frame",
    "AS": "the first moments MSP in the antecedent's frame",
    "GAM": "joint torque or force",
    "DG": "contribution of a base parameter to a joint torque",
    "DN": "the part of DG that turns: axis times moment",
    "DF": "the part of DG that pushes: velocity times force",
    "R": "orientation of a frame in frame 0",
    "P": "origin of a frame in frame 0",
}


class Names:
    """The names of the intermediate variables of a robot with `n_frames` frames.

    A call with a family and indices returns the name, for instance W12 for family W and indices 1,
    2.
    """

    def __init__(self, n_frames: int) -> None:
        self.separator = "_" if n_frames > 9 else ""

    def __call__(self, family: str, *indices: int) -> str:
        if family not in FAMILIES:
            raise KeyError(
                f"unknown family of symbols {family!r}; expected one of {', '.join(FAMILIES)}"
            )
        return family + self.separator.join(str(i) for i in indices)


FAMILY = "|".join(sorted(FAMILIES, key=len, reverse=True))
MEMBER = re.compile(rf"(?:({FAMILY})\d[\d_moxb]*|(QP|DG|DN|DF)(?:\d[\d_]*)?[A-Za-z]+\d+)[a-z]*_*\Z")
"""W12, C23, Z132, QPFSM6, DG1ZZ2, a part N16a of N16, and C1_ where C1 is the user's."""


def families_of(names: Iterable[str]) -> tuple[str, ...]:
    """Return the families of the given names, such as W for W12, in the order of the table
    `FAMILIES`.

    A product or a sum of names belongs to no family.
    """
    matches = filter(None, map(MEMBER.match, names))
    occurring = {match[1] or match[2] for match in matches}
    return tuple(family for family in FAMILIES if family in occurring)
