"""The parts of a robot: rows of the frame table, elements on the joints, loops, drives; `robot` says what they mean together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from symgen.description.expression import Expression

REVOLUTE, PRISMATIC, FIXED = 0, 1, 2
INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
JOINT_FAMILIES = ("Ia", "FV", "FS", "OFFSET")  # the rest of eq. (4), link by link
USUAL_KINDS = dict(zip((*JOINT_FAMILIES, "K"), ("inertia", "viscous", "coulomb", "offset", "stiffness"), strict=True))
KINDS = ("inertia", "viscous", "coulomb", "offset", "stiffness")
DIRECTIONS = ("positive", "negative")
GEOMETRY = ("gamma", "b", "alpha", "d", "theta", "r")  # of a row, in the order in which they are applied
ANGLES = ("gamma", "alpha", "theta")

Path = tuple[str | int, ...]  # keys that lead to a field of a robot file
Row = Mapping[int, Expression]  # {j: G_j}: s = sum_j G_j q_j, the G_j constant
Form = Mapping[tuple[int, int], Expression]  # {(i, j): B_ij}, symmetric, the B_ij constant
Limits = Mapping[str, tuple[float, ...] | tuple[tuple[float, float], ...]]


@dataclass(frozen=True)
class Frame:
    """One row of the table: frame j on link j, moved by joint j against its antecedent.

    Attributes
    ----------
    j, ant : int
        Number of the frame, and of its antecedent (0: the base).
    sigma : int
        REVOLUTE, PRISMATIC or FIXED.
    mu : int
        1 actuated, 0 passive or fixed.
    gamma, alpha, theta : Expression, rad
        Angles; theta holds q_j where sigma is REVOLUTE.
    b, d, r : Expression, m
        Lengths; r holds q_j where sigma is PRISMATIC.
    """

    j: int
    ant: int
    sigma: int
    mu: int
    gamma: Expression
    b: Expression
    alpha: Expression
    d: Expression
    theta: Expression
    r: Expression

    @property
    def q(self) -> str:
        """Name of the joint variable."""
        return f"q{self.j}"

    @property
    def theta0(self) -> Expression:
        """theta_j without q_j."""
        return self.theta - Expression.symbol(self.q) if self.sigma == REVOLUTE else self.theta

    @property
    def r0(self) -> Expression:
        """r_j without q_j."""
        return self.r - Expression.symbol(self.q) if self.sigma == PRISMATIC else self.r


@dataclass(frozen=True)
class Element:
    """Inertia, friction, offset or spring on the joint coordinates; one parameter per key, called family + key.

    along {j: G}:  s = G q,  Gamma += G' (c sdd | c sd | c sign(sd) | c | c s)   for inertia, viscous, coulomb, offset, stiffness
    form  {j: B}:  Gamma += c B qdd | c B qd | c B q                             for inertia, viscous, stiffness

    Attributes
    ----------
    family : str
        Name of the parameters without their key.
    kind : str
        One of KINDS.
    along, form : mapping
        Row G or form B by key.
    when : str or None
        One of DIRECTIONS: viscous and coulomb elements act in motion along s in this direction only.
    """

    family: str
    kind: str
    along: Mapping[int, Row]
    form: Mapping[int, Form]
    when: str | None = None

    @property
    def keys(self) -> tuple[int, ...]:
        """Keys of both tables in order."""
        return tuple(sorted({*self.along, *self.form}))


@dataclass(frozen=True)
class Loop:
    """Frame `twin` (FIXED) coincides with the frame of the joint `cut`; `start` (rad, m) picks the assembly mode of a general loop."""

    cut: int
    twin: int
    start: Mapping[int, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Drives:
    """qm = ratio (q - offset), tau = ratio' (torque_constant * u); for the runtime only. Offsets in rad or m."""

    ratio: tuple[tuple[float, ...], ...]
    offset: tuple[float, ...]
    torque_constant: tuple[float, ...]


def parameter(family: str, j: int) -> str:
    """Name of a standard parameter: family + link, e.g. XX2."""
    return f"{family}{j}"
