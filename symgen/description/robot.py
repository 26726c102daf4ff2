"""What a robot is: frames of Khalil and Kleinfinger, elements on its joints, loops, and nothing about how it is derived.

Modified Denavit-Hartenberg [KK86]: frame j, antecedent i = ant(j), sigma_j = 0 revolute, 1 prismatic, 2 fixed,

    iTj = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r) .

Signs, stated once. `gravity` is the acceleration of gravity in frame 0 (m/s^2); a body at rest with z0 up has
gravity (0, 0, -g). Joint torque Gamma is what the actuator delivers, so friction enters with a plus:
Gamma = A qdd + H + FV qd + FS sign(qd) + OFFSET. Inertia XX..ZZ are the tensor elements (XY = -integral x y dm) about the origin
of the link frame, MX MY MZ = M (centre of mass). SI and rad.

[KK86] W. Khalil, J.-F. Kleinfinger, A new geometric notation for open and closed-loop robots, ICRA 1986.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

from symgen.description import checks
from symgen.description.checks import check_identifier
from symgen.description.expression import ONE, Expression
from symgen.description.parts import (
    DIRECTIONS,
    FIXED,
    INERTIAL,
    JOINT_FAMILIES,
    KINDS,
    PRISMATIC,
    REVOLUTE,
    USUAL_KINDS,
    Drives,
    Element,
    Form,
    Frame,
    Limits,
    Loop,
    Path,
    Row,
    parameter,
)

__all__ = [
    "DIRECTIONS",
    "FIXED",
    "INERTIAL",
    "JOINT_FAMILIES",
    "KINDS",
    "PRISMATIC",
    "REVOLUTE",
    "Drives",
    "Element",
    "Form",
    "Frame",
    "Loop",
    "Path",
    "Robot",
    "Row",
    "check_identifier",
    "one_joint_parameters",
    "parameter",
]


@dataclass(frozen=True)
class Robot:
    """A mechanism, complete and checked; raises DescriptionError, with the path of the field, if it is none.

    Attributes
    ----------
    name : str
        Identifier; names the emitted module.
    frames : tuple of Frame
        Numbered 1, 2, 3 ... from the base outward.
    gravity : tuple of Expression, m/s^2
        Acceleration of gravity in frame 0.
    title, source : str
        One line each: what the robot is, where its table comes from.
    constants : mapping, SI and rad
        Numbers of the symbols of frames, gravity and elements.
    elements : tuple of Element
        What acts on the joints besides the links.
    loops : tuple of Loop
        Closed loops.
    constraints : mapping
        Positions of passive joints, by number, as expressions of other joints.
    massless : frozenset of int
        Links without inertial parameters.
    drives : Drives or None
        Motors to joints, for measured records.
    limits : mapping, SI and rad
        One entry per actuated joint: q as (lower, upper), qd, qdd and tau as largest absolute values.
    values : mapping, SI
        Known standard parameters; never used in the derivation.
    labels : mapping
        Names of joints and fixed frames elsewhere (URDF, messages, columns of records), by number; shown, never used in formulas.
    file : str
        Name of the robot file, without its folder.
    sha256 : str
        Hash of its bytes.
    """

    name: str
    frames: tuple[Frame, ...]
    gravity: tuple[Expression, Expression, Expression]
    title: str = ""
    source: str = ""
    constants: Mapping[str, float] = field(default_factory=dict)
    elements: tuple[Element, ...] = ()
    loops: tuple[Loop, ...] = ()
    constraints: Mapping[int, Expression] = field(default_factory=dict)
    massless: frozenset[int] = frozenset()
    drives: Drives | None = None
    limits: Limits = field(default_factory=dict)
    values: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[int, str] = field(default_factory=dict)
    file: str = ""
    sha256: str = ""

    def __post_init__(self) -> None:
        for name in ("constants", "constraints", "limits", "values", "labels"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        checks.check_texts(self.name, {"title": self.title, "source": self.source, "file": self.file})
        checks.check_tree(self.frames)
        checks.check_names(self.elements, self.constants, self.parameters)
        checks.check_geometry(self.frames, self.gravity, self.constants)
        for e in self.elements:
            checks.check_element(e, self._by_number, self.moving, self.constants)
        symbols = [*self.constants, *(f"q{i}" for i in self.moving)]
        checks.check_loops(self._by_number, self.loops, self.constraints, self.passive, symbols)
        if self.drives is not None:
            checks.check_drives(self.drives, len(self.joints))
        checks.check_limits(self.limits, self.joints)
        checks.check_labels(self.labels, self._by_number)
        checks.check_values(self.name, self.values, self.parameters, self._by_number, self.links)

    def __hash__(self) -> int:
        return hash((self.name, self.frames, self.gravity, self.sha256))

    def frame(self, j: int) -> Frame:
        """Frame number j."""
        return self._by_number[j]

    @cached_property
    def _by_number(self) -> dict[int, Frame]:
        return {f.j: f for f in self.frames}

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Numbers of the joints that move (sigma 0 or 1), the cut ones included."""
        return tuple(f.j for f in self.frames if f.sigma != FIXED)

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """Numbers of the actuated joints: the order of q, qd, qdd, Gamma."""
        return tuple(f.j for f in self.frames if f.mu)

    @cached_property
    def passive(self) -> tuple[int, ...]:
        """Numbers of the joints that move and are not actuated."""
        return tuple(j for j in self.moving if not self.frame(j).mu)

    @cached_property
    def cut(self) -> frozenset[int]:
        """Frames without a link: the cut joint of each loop and its twin."""
        return frozenset(k for loop in self.loops for k in (loop.cut, loop.twin))

    @cached_property
    def links(self) -> tuple[int, ...]:
        """Numbers of the links that carry inertial parameters."""
        return tuple(f.j for f in self.frames if f.j not in self.cut and f.j not in self.massless)

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of the standard parameters in the order of eq. (4), link by link, then further families in file order."""
        by_family = {e.family: e for e in self.elements}
        names: list[str] = []
        for f in self.frames:
            if f.j in self.links:
                names += [parameter(p, f.j) for p in INERTIAL]
            names += [parameter(p, f.j) for p in JOINT_FAMILIES if p in by_family and f.j in by_family[p].keys]
        for e in self.elements:
            if e.family not in JOINT_FAMILIES:
                names += [parameter(e.family, j) for j in e.keys]
        return tuple(names)

    def path(self, j: int) -> tuple[int, ...]:
        """Frames from the base to j, j included."""
        frames: list[int] = []
        while j:
            frames.insert(0, j)
            j = self.frame(j).ant
        return tuple(frames)


def one_joint_parameters(robot: Robot, families: Collection[str]) -> set[str]:
    """Names of the parameters of `families`, such as FV, that act on one joint alone, in both directions, as other formats mean them."""
    return {
        parameter(e.family, j)
        for e in robot.elements
        if e.family in families and e.kind == USUAL_KINDS.get(e.family) and e.when is None
        for j, row in e.along.items()
        if row == {j: ONE}
    }
