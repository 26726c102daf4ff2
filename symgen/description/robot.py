"""The description of a robot: Khalil's frames, elements on the joints (friction, ...), and loops.

Modified Denavit-Hartenberg [KK86]: frame j, antecedent i = ant(j), sigma_j = 0 revolute, 1
prismatic, 2 fixed,

    iTj = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r) .

Signs: `gravity` is the acceleration of gravity in frame 0 (m/s^2); on a robot with z0 up, gravity
is (0, 0, -g). The joint torque Gamma is the torque that the actuator delivers, so friction has a
plus sign:

    Gamma = A qdd + H + FV qd + FS sign(qd) + OFFSET

Inertia parameters XX .. ZZ are the tensor elements about the origin of the link frame (XY =
-integral x y dm). First moments are MX MY MZ = M (centre of mass). Units are SI and rad.

[KK86] W. Khalil, J.-F. Kleinfinger, A new geometric notation for open and closed-loop robots, ICRA
1986.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import fields
from functools import cached_property, partial
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic.dataclasses import dataclass

from symgen.description.checks import check_robot
from symgen.description.distal import khalil_frames
from symgen.description.element import JOINT_FAMILIES, KINDS, TRANSMITTED, USUAL_KINDS, Element
from symgen.description.expression import ONE, Expression
from symgen.description.fields import (
    CONFIG,
    UNWRITTEN,
    Constant,
    Declared,
    Given,
    Numeric,
    Path,
    Position,
    Text,
    Whole,
    Written,
)
from symgen.description.parts import (
    DIRECTIONS,
    FIXED,
    INERTIAL,
    PRISMATIC,
    REVOLUTE,
    Drives,
    Form,
    Frame,
    Limits,
    LimitsTable,
    Loop,
    Row,
    assumed,
    by_joint,
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
    "one_joint_parameters",
    "parameter",
]


def _frames(rows: Mapping[int, Frame], declared: Declared) -> tuple[Frame, ...]:
    frames = tuple(rows[j] for j in sorted(rows))
    declared.frames = khalil_frames(frames) if declared.distal else frames
    return declared.frames


def _massless(links: list[int], declared: Declared) -> frozenset[int]:
    """Return the massless links: the links that the file lists, and the end frames added to a
    classic table.
    """
    return frozenset((*links, *(f.j for f in declared.frames[declared.rows :])))


def _rows_by_name(name: str) -> BeforeValidator:
    """Make a validator that stores the key of each row of a table in the row, as the field `name`.

    For instance, the row with the key 1 in `frames` gets the field j = 1.
    """

    def row_of(key: Any, row: Any) -> Any:
        return {name: Given(key), **row} if isinstance(row, dict) else row

    return BeforeValidator(
        lambda rows: (
            {key: row_of(key, row) for key, row in rows.items()} if isinstance(rows, dict) else rows
        )
    )


BASE_ROWS = dict(enumerate(("FX0", "FY0", "FZ0", "NX0", "NY0", "NZ0"), start=-5))
"""Rows of a free base, by key: force (N), then moment about O_0 (N m), in the axes of frame 0."""


@dataclass(frozen=True, config=CONFIG)
class Robot:
    """The complete, checked and immutable description of a robot, in SI units and rad.

    Raises DescriptionError, with the path of the wrong field, if the fields make no valid
    mechanism.
    """

    name: Annotated[str, Field(description="identifier; names the emitted module")]
    frames: Annotated[
        tuple[Frame, ...],
        Written(dict[Whole, Frame], _frames),
        _rows_by_name("j"),
        Field(description="1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}"),
    ]
    gravity: Annotated[
        tuple[Expression, Expression, Expression],
        Written(
            Annotated[list[Constant], Field(min_length=3, max_length=3)],
            lambda components, _: tuple(components),
        ),
        Field(description="acceleration of gravity in frame 0: [0, 0, -g]"),
    ]
    title: Annotated[str, Field(description="one line, printed above results")] = ""
    source: Annotated[str, Field(description="where the table comes from")] = ""
    constants: Annotated[
        Mapping[str, float],
        Written(dict[str, Numeric]),
        Field(
            description=(
                "lengths and angles by name, numbers only: {D2: 0.5, g: 9.81}; names stay in "
                "the formulas"
            )
        ),
    ] = Field(default={})
    elements: Annotated[
        tuple[Element, ...],
        Written(dict[str, Element], lambda rows, _: tuple(rows.values())),
        _rows_by_name("family"),
        Field(description="FV: {kind: viscous, along: all} makes FV1, FV2 ..."),
    ] = Field(default={})  # type: ignore[arg-type]  # of the form in a file
    loops: Annotated[
        tuple[Loop, ...],
        Written(list[Loop], lambda rows, _: tuple(rows)),
        Field(description="[{cut: 6, twin: 7}]"),
    ] = Field(default=[])  # type: ignore[arg-type]
    constraints: Annotated[
        Mapping[int, Expression],
        Written(dict[str, Position], by_joint),
        Field(description="passive joints: {q3: q5 - q2 + pi}"),
    ] = Field(default={})
    massless: Annotated[
        frozenset[int],
        Written(list[Whole], _massless),
        Field(description="links without inertial parameters"),
    ] = Field(default=[], validate_default=True)
    drives: Annotated[
        Drives | None, Field(description="motors to joints, for measured records")
    ] = None
    limits: Annotated[
        Limits,
        Written(
            LimitsTable,
            lambda table, _: {k: tuple(row) for k, row in vars(table).items() if row is not None},
        ),
        Field(description="for exciting trajectories; the sliders of the page take those of q"),
    ] = Field(default_factory=dict)
    values: Annotated[
        Mapping[str, float],
        Written(dict[str, Numeric]),
        Field(
            description=(
                "standard parameters you know, SI: {M1: 2.0, ZZ1: 0.17}; never used in the "
                "derivation"
            )
        ),
    ] = Field(default={})
    assume: Annotated[
        frozenset[str],
        Written(dict[str, Text], assumed),
        Field(
            description=(
                "standard parameters that are zero: {XY2: 0, link 3: symmetric xz}; taken into "
                "the regrouping"
            )
        ),
    ] = Field(default={})  # type: ignore[arg-type]
    labels: Annotated[
        Mapping[int, str],
        Written(dict[Whole, str]),
        Field(
            description=(
                "{1: shoulder_pan, 2: elbow}: names of joints in other programs, shown in "
                "tables; `q: names` of a study finds columns by them"
            )
        ),
    ] = Field(default={})
    base: Annotated[
        Literal["fixed", "moving", "free"],
        Field(
            description=(
                "fixed; or moving: frame 0 is a body whose motion is measured, and the rows are "
                "the joints alone; or free: the wrench on this body is measured too, six rows "
                "before the joints, and link 0 has parameters"
            )
        ),
    ] = "fixed"
    angles: Annotated[str, *UNWRITTEN] = ""  # how those of a foreign file were read
    # of links whose inertia no body can have: the frame, and what is wrong
    impossible: Annotated[tuple[tuple[int, str], ...], *UNWRITTEN] = ()
    # of the links of a foreign file: frame, name, M, centre from the origin of the link, tensor about it
    bodies: Annotated[tuple[tuple[int, str, float, Any, Any], ...], *UNWRITTEN] = ()
    # parts of a foreign file that change the torques and are not in the equations
    not_read: Annotated[tuple[str, ...], *UNWRITTEN] = ()
    # of a foreign file, on which a load is mounted: name, link, pose in its frame (`mounts`)
    mounts: Annotated[tuple[tuple[str, int, Any], ...], *UNWRITTEN] = ()
    # parameters of link 0 in a foreign file, which a free base has
    of_base: Annotated[Mapping[str, float], *UNWRITTEN] = Field(default={})
    distal: Annotated[int, *UNWRITTEN] = 0  # rows of a classic table in the file; 0: Khalil's
    file: Annotated[str, *UNWRITTEN] = ""
    sha256: Annotated[str, *UNWRITTEN] = ""

    def __post_init__(self) -> None:
        if "q" in self.limits:  # one number: to either side
            q = ((-x, x) if isinstance(x, int | float) else x for x in self.limits["q"])
            object.__setattr__(self, "limits", {**self.limits, "q": tuple(q)})
        for name in ("constants", "constraints", "limits", "values", "labels", "of_base"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        for name, kind in (
            ("elements", tuple),
            ("loops", tuple),
            ("massless", frozenset),
            ("assume", frozenset),
        ):
            object.__setattr__(self, name, kind(getattr(self, name)))
        scalars = {name: x for e in self.elements for name, x in e.constants.items()}
        if scalars:  # of laws: constants, whose values in the file go before
            constants = {
                **self.constants,
                **{n: self.constants.get(n, x) for n, x in scalars.items()},
            }
            object.__setattr__(self, "constants", MappingProxyType(constants))
        check_robot(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the fields as ordinary tables, because read-only tables cannot be pickled."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        plain: dict[str, Any] = {
            k: dict(x) if isinstance(x, MappingProxyType) else x for k, x in values.items()
        }
        return partial(Robot, **plain), ()

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """Hash of the robot, computed only once because caches look up robots by it."""
        return hash((self.name, self.frames, self.gravity, self.sha256))

    def frame(self, j: int) -> Frame:
        """Return the frame with the number j."""
        return self._by_number[j]

    def row(self, j: int, name: str) -> int:
        """Return the row of the file's table that has the entry `name` of frame j.

        In a classic (distal) table, alpha and d of a frame are in the row of its antecedent.
        """
        return self.frame(j).ant if self.distal and name in ("alpha", "d") else j

    @cached_property
    def _by_number(self) -> dict[int, Frame]:
        return {f.j: f for f in self.frames}

    @property
    def base_moves(self) -> bool:
        """Whether frame 0 is a body whose motion is an input of the models."""
        return self.base != "fixed"

    @property
    def base_is_free(self) -> bool:
        """Whether the wrench on frame 0 is known too: link 0 has parameters, and six rows."""
        return self.base == "free"

    @cached_property
    def rows(self) -> dict[int, str]:
        """Names of the rows of the torques, by key, in their order.

        The key of a joint is its number. A free base has six rows before the joints, with the keys
        -5 ... 0.
        """
        return (BASE_ROWS if self.base_is_free else {}) | {j: str(j) for j in self.joints}

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Numbers of the revolute and prismatic joints, including the cut joints of loops."""
        return tuple(f.j for f in self.frames if f.sigma != FIXED)

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """Numbers of the actuated joints, in the order of q, qd, qdd and Gamma."""
        return tuple(f.j for f in self.frames if f.mu)

    @cached_property
    def passive(self) -> tuple[int, ...]:
        """Numbers of the joints that move and are not actuated."""
        return tuple(j for j in self.moving if not self.frame(j).mu)

    @cached_property
    def start(self) -> dict[int, float]:
        """Joint positions, rad or m, by joint number, that select the assembly mode of loops."""
        return {j: x for loop in self.loops for j, x in loop.start.items()}

    @cached_property
    def longest(self) -> float:
        """Largest of the lengths b, d and r in the frame table, m; 1 if all are zero.

        For a robot with loops, only frames around the loops count, because the arm that holds the
        loops may be far larger.
        """
        around = {j for l in self.loops for j in {*self.path(l.cut)} ^ {*self.path(l.twin)}}
        frames = [f for f in self.frames if not around or f.j in around]
        lengths = (e.value(self.constants) for f in frames for e in (f.b, f.d, f.r0))
        return max(map(abs, lengths)) or 1.0

    @cached_property
    def cut(self) -> frozenset[int]:
        """Numbers of the frames without a link: the cut joint of each loop, and its twin frame."""
        return frozenset(k for loop in self.loops for k in (loop.cut, loop.twin))

    @cached_property
    def links(self) -> tuple[int, ...]:
        """Numbers of the links that have inertial parameters; link 0 is that of a free base."""
        base = (0,) if self.base_is_free else ()
        return base + tuple(
            f.j for f in self.frames if f.j not in self.cut and f.j not in self.massless
        )

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of the standard parameters, link by link, then of springs and other elements.

        For each link, the order is that of eq. (4): XX .. ZZ, MX, MY, MZ, M, then Ia, FV, FS and
        OFFSET, as far as the robot has them. Further elements are in the order of the file.
        """
        by_family = {e.family: e for e in self.elements}
        names = [parameter(p, 0) for p in INERTIAL] if self.base_is_free else []
        for f in self.frames:
            if f.j in self.links:
                names += [parameter(p, f.j) for p in INERTIAL]
            names += [
                parameter(p, f.j)
                for p in JOINT_FAMILIES
                if p in by_family and f.j in by_family[p].keys
            ]
        for e in self.elements:
            if e.family not in JOINT_FAMILIES:
                names += [parameter(e.family, j) for j in e.keys]
        return tuple(names)

    @cached_property
    def channels(self) -> dict[str, tuple[str, ...]]:
        """Names of the parameters whose laws contain a channel (a function of time, such as
        temperature), by channel.
        """
        read = [(c, parameter(e.family, j)) for e in self.elements if e.is_own for j in e.keys
                for c in e.channels(j)]  # fmt: skip
        return {c: tuple(name for own, name in read if own == c) for c, _ in read}

    @property
    def loaded(self) -> tuple[str, ...]:
        """Names of the parameters whose law contains the torque that the joint transmits.

        An example of such a law is load-dependent friction. A robot with such parameters has no
        forward dynamics.
        """
        read = (own for c, own in self.channels.items() if c.startswith(TRANSMITTED))
        return tuple(name for own in read for name in own)

    def root(self, loop: Loop) -> int:
        """Find the last frame that both branches of a loop have in common.

        The joints up to this frame move the whole loop. The result is 0 for the base.
        """
        twin = self.path(loop.twin)
        return max((j for j in self.path(loop.cut) if j in twin), key=twin.index, default=0)

    def path(self, j: int) -> tuple[int, ...]:
        """List the frames from the base (not included) to frame j (included)."""
        frames: list[int] = []
        while j:
            frames.insert(0, j)
            j = self.frame(j).ant
        return tuple(frames)


def one_joint_parameters(robot: Robot, families: Collection[str]) -> set[str]:
    """Find the parameters of the element families `families` that act on one joint alone.

    Such parameters can be stored as one number per joint. Parameters of one direction of motion are
    left out.
    """
    return {
        parameter(e.family, j)
        for e in robot.elements
        if e.family in families and e.kind == USUAL_KINDS.get(e.family) and e.when is None
        for j, row in e.along.items()
        if row == {j: ONE}
    }
