"""Explain the effect of each standard parameter on the base parameters and joint torques.

A parameter acts through its energy, which is E + U of its link if this parameter is 1 and all
others are 0 (Gautier and Khalil, IEEE T-RA 6(3), 1990):

    XX w1**2/2   XY w1 w2   XZ w1 w3   YY w2**2/2   YZ w2 w3   ZZ w3**2/2
    MX w3 v2 - w2 v3 - g1   MY w1 v3 - w3 v1 - g2   MZ w2 v1 - w1 v2 - g3   M v.v/2 - g.P

w and v are the angular velocity and the velocity of the origin, g the acceleration of gravity, all
in the link frame, and P is the position of the origin. A parameter whose energy never changes has
no effect; the reason names the factors that are zero in every motion.
"""

from __future__ import annotations

from dataclasses import dataclass

from symgen.derive.algebra import Scalar, dot
from symgen.derive.derivation import derive
from symgen.derive.energies import origin_velocities
from symgen.derive.graph import Scalar as Node
from symgen.derive.regressor import element_names, inertial_names, unit
from symgen.description.robot import KINDS, Robot
from symgen.emit.spec import ModuleSpec

AXES = "xyz"


@dataclass(frozen=True)
class Effect:
    """Meaning of one standard parameter, and the base parameters and joints that it acts on.

    Attributes
    ----------
    name, meaning, unit : str
        The parameter, its meaning in words, and its unit.
    place : str
        Such as "link 2" or "joint 2".
    link : int
        Number of that link or joint.
    base : tuple of str
        Base parameters whose formulas contain the parameter.
    joints : tuple of int or str
        Joints whose torques depend on these base parameters; rows of a free base by name.
    why : str
        Reason why the parameter has no effect; "" if it has an effect.
    """

    name: str
    meaning: str
    unit: str
    place: str
    link: int
    base: tuple[str, ...]
    joints: tuple[int | str, ...]
    why: str = ""


def effects(spec: ModuleSpec) -> tuple[Effect, ...]:
    """Find the base parameters and joints that each standard parameter affects.

    The order is that of eq. (4).
    """
    robot = spec.robot
    into: dict[str, list[int]] = {name: [] for name in robot.parameters}
    for k, b in enumerate(spec.regrouping.base):
        for name in b.combination:
            into[name].append(k)
    reasons = Reasons(robot)
    inertial, elements = inertial_names(robot), element_names(robot)
    result = []
    for name, rows in into.items():
        joints = tuple(
            j for row, j in enumerate(rows_of(robot)) if any(spec.structure[k][row] for k in rows)
        )
        base = tuple(spec.regrouping.names[k] for k in rows)
        if name in inertial:
            family, j = inertial[name]
            meaning, place, why = (
                inertial_meaning(family, j),
                f"link {j}",
                reasons.inertial(family, j),
            )
        else:
            e, j = elements[name]
            meaning, place, why = (
                KINDS[e.kind].meaning,
                f"joint {j}",
                "it acts along a coordinate that does not move or has no torque",
            )
        said = "the robot file assumes that it is zero" if name in robot.assume else why
        result.append(
            Effect(name, meaning, unit(robot, name), place, j, base, joints, "" if rows else said)
        )
    return tuple(result)


def rows_of(robot: Robot) -> tuple[int | str, ...]:
    """Return the numbers of the joints, after the names of the rows of a free base."""
    return tuple(j if j in robot.joints else name for j, name in robot.rows.items())


def inertial_meaning(family: str, j: int) -> str:
    """Describe in words one of the parameters XX .. M of link j.

    family : name of the parameter without its number.
    """
    if family == "M":
        return f"mass of link {j}"
    a, b = family[0].lower(), family[1].lower()
    if a == "m":
        return f"first moment of link {j}, mass times centre of mass along {b}{j}"
    kind = (
        f"moment of inertia of link {j} about {a}{j}"
        if a == b
        else f"product of inertia of link {j}, -∫{a}{b} dm"
    )
    return f"{kind}, at the origin of frame {j}"


class Reasons:
    """Reasons why standard parameters of one robot have no effect on the joint torques.

    The reasons are components of motion and gravity that are zero in every motion of a link.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot, self.base_moves = robot, robot.base_moves
        d = derive(robot)
        self.w = {j: link.w for j, link in d.motion.link.items()}
        self.v = origin_velocities(d.motion)
        g = tuple(d.algebra.constant(e) for e in robot.gravity)
        self.level = {
            j: [_constant(dot(g, [A[k][m] for k in range(3)])) for m in range(3)]
            for j, (A, _) in d.poses.items()
        }
        self.gravity = any(robot.gravity)

    def inertial(self, family: str, j: int) -> str:
        """Explain why an inertial parameter of link j has no effect on the joint torques.

        family : name of the parameter without its number, such as XX.
        """
        if self.base_moves:
            return "no joint feels it, whatever the motion of the base"
        if family == "M":
            return (
                f"the energy of a mass at the origin of frame {j} is the same in every motion"
                if not all(map(_zero, self.v[j]))
                else f"the origin of frame {j} does not move, so mass there has neither kinetic "
                "energy nor work against gravity"
            )
        k, m = (AXES.index(c) if c in AXES else -1 for c in family.lower())
        if family.startswith("M"):
            return self._first_moment(j, m)
        for axis in (k, m):
            if _zero(self.w[j][axis]):
                return (
                    f"link {j} never turns about {AXES[axis]}{j}, and the energy has its rate as a "
                    "factor"
                )
        return (
            f"the energy, the product of the rates about {AXES[k]}{j} and {AXES[m]}{j}, is the "
            "same in every motion"
        )

    def _first_moment(self, j: int, m: int) -> str:
        a, b = (m + 1) % 3, (m + 2) % 3
        w, v = self.w[j], self.v[j]
        still = all(map(_zero, v))
        if not all(_zero(w[x]) or _zero(v[y]) for x, y in ((a, b), (b, a))) or not self.level[j][m]:
            return (
                f"mass moved along {AXES[m]}{j} changes the energy by the same amount in every "
                "motion"
            )
        kinetic = (
            f"the origin of frame {j} does not move"
            if still
            else f"the coupling of turning and moving along {AXES[m]}{j} is zero"
        )
        if not self.gravity:
            return f"{kinetic}, and there is no gravity"
        return (
            f"{kinetic}, and {AXES[m]}{j} keeps its angle to gravity, so nothing changes with "
            "mass moved along it"
        )


def _zero(x: Scalar) -> bool:
    return isinstance(x, int) and x == 0


def _constant(x: Scalar) -> bool:
    """Whether a quantity of the derivation, such as a velocity, is the same in every motion."""
    return not isinstance(x, Node) or bool(x.node.fixed)
