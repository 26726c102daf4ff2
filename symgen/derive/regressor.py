"""Columns D_k of the standard regressor, by parameter name: Gamma_a = sum_k D_k chi_k.

Gamma_a are the torques of the actuated joints. The columns of inertial parameters are computed from
the joint axes, without propagating a wrench. A parameter of link j, set to 1, needs a wrench (F, N)
on link j. Joint i feels this wrench through its own axis, expressed in frame j:

    D_ik = z_ij . N_k + v_ij . F_k

z_ij is the axis of joint i in frame j, v_ij the velocity of O_j per unit rate of joint i. Both are
propagated from the base to the tips: z <- jRi' z, v <- jRi' (v + z x P). A prismatic joint has
z = 0, and v is its direction. The six rows of a free base feel the force and the moment about O_0,

    0Rj F_k ,   0Rj N_k + P_0j x 0Rj F_k .

An element (friction, spring, actuator inertia, torque law of the user) with parameter c adds one of
these torques:

    along G, s = G q:    Gamma += c G' x,    x the law of the element over s, sd, sdd
    form B:              Gamma += c B x,     x = qdd | qd | q
    energy U:            Gamma_i += c dU/dq_i

A law is a polynomial in states, constants and function calls. Cosines and sines of whole multiples
of joint angles and signs of velocities are functions of the robot's geometry and motion, hence
exact over F_p. Every other call that varies with the state is a node of its own, which exact
arithmetic identifies only by its operands.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from symgen.derive.algebra import E3, IDENTITY, ZERO3, Scalar, Vector, cross, dot
from symgen.derive.geometry import frame_poses
from symgen.derive.graph import Turn
from symgen.derive.newton_euler import LinkMotion, Motion, force, moment
from symgen.description.element import CHANNEL, STATE, varies
from symgen.description.expression import FUNCTIONS, ONE, ZERO, Atom, Call, Expression
from symgen.description.robot import (
    BASE_ROWS,
    FIXED,
    INERTIAL,
    KINDS,
    PRISMATIC,
    REVOLUTE,
    Element,
    Form,
    Robot,
    Row,
    parameter,
)
from symgen.time_limit import require_time

UNITS_OF_LINKS = {"M": "kg", "MX": "kg*m", "MY": "kg*m", "MZ": "kg*m"}


@lru_cache(maxsize=16)
def inertial_names(robot: Robot) -> dict[str, tuple[str, int]]:
    """Return {name: (inertial parameter, link)}, for instance {ZZ1: (ZZ, 1)}."""
    return {parameter(p, j): (p, j) for j in robot.links for p in INERTIAL}


def element_names(robot: Robot) -> dict[str, tuple[Element, int]]:
    """Return {parameter name: (element, number)}, for instance {FV2: (element FV, 2)}."""
    return {parameter(e.family, j): (e, j) for e in robot.elements for j in e.keys}


def acting(e: Element, j: int) -> dict[Any, Expression]:
    """Return the coefficients with which an element parameter, such as FV2, acts on the joints.

    The coefficients are the row {joint: G} of the element, or its form {(i, k): B} with i <= k.
    """
    form = {place: b for place, b in sorted(e.form.get(j, {}).items()) if place[0] <= place[1]}
    return form or dict(e.along[j])


def unit(robot: Robot, name: str) -> str:
    """Return the SI unit of a standard parameter; for friction it depends on the type of joint."""
    inertial = inertial_names(robot)
    if name in inertial:
        return UNITS_OF_LINKS.get(inertial[name][0], "kg*m**2")
    e, j = element_names(robot)[name]
    return e.unit or KINDS[e.kind].units[robot.frame(j).sigma == PRISMATIC]


def columns(motion: Motion, names: Iterable[str]) -> dict[str, dict[int, Scalar]]:
    """Return the regressor columns {parameter: {actuated joint: D}} of the given parameters."""
    robot, closure, algebra = motion.robot, motion.geometry.closure, motion.algebra
    inertial, elements = inertial_names(robot), element_names(robot)
    axes = Axes(motion)
    algebra.section("Contributions that several joints share")
    result: dict[str, dict[int, Scalar]] = {}
    for name in names:
        require_time()
        tree = (
            axes.column(*inertial[name])
            if name in inertial
            else element_column(motion, *elements[name])
        )
        result[name] = closure.project(algebra, tree)
    return result


def unit_wrench(m: LinkMotion, parameter: str) -> tuple[Vector, Vector]:
    """Return the force F and moment N that move a link whose inertial parameter `parameter` is 1
    and all others 0.
    """
    K = dict.fromkeys(INERTIAL, 0) | {parameter: 1}
    return force(m, K), moment(m, K)


class Axes:
    """Axes of joints i in frames j, and velocities of the origins O_j per unit rate of joint i.

    z_ij is the axis of joint i in frame j, v_ij the velocity of origin O_j per unit rate of joint
    i.
    """

    def __init__(self, motion: Motion) -> None:
        self.motion = motion
        self.z: dict[tuple[int, int], Vector] = {}
        self.v: dict[tuple[int, int], Vector] = {}
        for f in motion.robot.frames:
            self._carry(f.j)
        self.poses = {0: (IDENTITY, ZERO3)}
        if motion.robot.base_is_free:
            self.poses |= frame_poses(motion.geometry)

    def _carry(self, j: int) -> None:
        motion, geometry, robot = self.motion, self.motion.geometry, self.motion.robot
        frame = robot.frame(j)
        m = geometry.carrier[j].m
        motion.algebra.section(f"Joint axes Z and velocities V seen from link {j}")
        for i in robot.path(j)[:-1]:
            sigma = robot.frame(i).sigma
            if sigma == FIXED:
                continue
            inside = i in robot.path(m)  # it turns the carrier, or else about z_j itself
            if sigma == REVOLUTE:
                z = geometry.from_carrier(j, self.z[i, m]) if inside else E3
                lever = self.v[i, frame.ant] + cross(self.z[i, frame.ant], geometry.P[j])
                for k, x in enumerate(lever, start=1):
                    motion.algebra.hint(x, motion.algebra.named("VS", k, j, i))
                v = geometry.rotation[j].down(lever)
            else:
                z = ZERO3
                v = geometry.from_carrier(j, self.v[i, m]) if inside else E3
            self.z[i, j] = motion.vector("Z", z, j, i)
            self.v[i, j] = motion.vector("V", v, j, i)
        if frame.sigma != FIXED:
            self.z[j, j], self.v[j, j] = (E3, ZERO3) if frame.sigma == REVOLUTE else (ZERO3, E3)

    def column(self, parameter: str, j: int) -> dict[int, Scalar]:
        """Return the joint torques {i: D_ik} of link j if its `parameter` is 1 and all others 0.

        The joints i are the moving joints between the base and link j, after the rows of a free
        base.
        """
        F, N = unit_wrench(self.motion.link[j], parameter)
        motion = self.motion
        entries: dict[int, Scalar] = {}
        if motion.robot.base_is_free:
            R, P = self.poses[j]
            force = R @ F
            entries |= dict(zip(BASE_ROWS, (*force, *(R @ N + cross(P, force))), strict=True))
        for i in motion.robot.path(j):
            if motion.robot.frame(i).sigma != FIXED:
                turning = motion.algebra.hint(
                    dot(self.z[i, j], N), f"{motion.algebra.named('DN', i)}{parameter}{j}"
                )
                pushing = motion.algebra.hint(
                    dot(self.v[i, j], F), f"{motion.algebra.named('DF', i)}{parameter}{j}"
                )
                entries[i] = motion.algebra.hint(
                    turning + pushing, f"{motion.algebra.named('DG', i)}{parameter}{j}"
                )
        return entries


def element_column(motion: Motion, e: Element, j: int) -> dict[int, Scalar]:
    """Return the regressor column {joint i: D_i} of an element parameter, such as FV2.

    The joints i are the moving joints that this parameter acts on.
    """
    if j in e.form:
        return _form(motion, str(e.law(j)), e.form[j])
    row = e.along[j]
    law, others = e.laws(j)
    values = Law(motion, e, j)
    x = values.one_sided(law) if e.when is not None else values.of(law)
    if x == 0 and not others:
        return dict.fromkeys(row, 0)
    column = {i: motion.algebra.constant(g) * x for i, g in row.items()} if law else {}
    for i, slope in others.items():
        column[i] = column.get(i, 0) + values.of(slope)
    return column


class Law:
    """The torque law of one element parameter, such as FV2, and its conversion to graph nodes.

    A velocity along several joints is named after the element, since rows of other elements may
    have the same joints.
    """

    def __init__(self, motion: Motion, e: Element, j: int) -> None:
        self.motion, self.element, self.row = motion, e, e.along[j]
        self.name = f"{motion.algebra.named('QP')}{parameter(e.family, j)}"

    def of(self, e: Expression) -> Scalar:
        """Convert an expression in the torque law to a node of the expression graph."""
        total: Scalar = 0
        for m, c in e.ordered:
            varying = [(a, n) for a, n in m if varies(a)]
            fixed = Expression({tuple(an for an in m if an not in varying): c})
            term = self.motion.algebra.constant(fixed)
            for a, n in varying:
                x = self._atom(a)
                x = self.motion.algebra.function("inv", x) if n < 0 else x
                for _ in range(abs(n)):
                    term = term * x
            total = total + term
        return total

    def one_sided(self, law: Expression) -> Scalar:
        """Return the velocity on which friction in one direction depends, or its sign; zero in the
        other direction.
        """
        rate, key = self._atom("qd"), self.motion.geometry.closure.in_independent(self.row)
        if type(rate) is int or not key:
            return 0  # at rest, or the closure holds s still
        direction, speed = self.motion.algebra.one_sided(rate, key, str(self.element.when))
        return speed if law == Expression.symbol("qd") else direction

    def _atom(self, a: Atom) -> Scalar:
        if isinstance(a, Call):
            return self._call(a)
        if str(a).startswith(CHANNEL):
            return self.motion.algebra.channel(str(a).removeprefix(CHANNEL))
        state, joint = STATE.match(str(a)).groups()  # type: ignore[union-attr]
        coordinate = getattr(self.motion, state)
        if joint:
            return coordinate(int(joint))
        rate = self.motion.algebra.linear(self.row, {i: coordinate(i) for i in self.row})
        if state == "qd" and len(self.row) > 1:
            rate = self.motion.algebra.name(rate, self.name)
        return rate

    def _call(self, a: Call) -> Scalar:
        motion, algebra = self.motion, self.motion.algebra
        if a.function == "sign" and (part := linear_in(a.argument, "qd", self.row)):
            row, rest = part
            key = motion.geometry.closure.in_independent(row)
            if not rest:
                rate = self.of(a.argument)
                return 0 if type(rate) is int or not key else algebra.sign(rate, key)
        if a.function in ("cos", "sin") and (turn := self._turn(a.argument)):
            return algebra.cos_sin(*turn)[a.function == "sin"]
        operands = [self.of(e) for e in a.operands]
        at_zero = FUNCTIONS[a.function].at_zero
        if operands[0] == 0 and at_zero is not None:
            return at_zero
        return algebra.function(a.function, *operands)

    def _turn(self, angle: Expression) -> tuple[Turn, Expression] | None:
        """Write an angle in a torque law as whole multiples of independent joint angles plus a
        constant.

        Return the multiples and the constant, or None if the angle has another form.
        """
        if not (part := linear_in(angle, "q", self.row)):
            return None
        row, rest = self.motion.geometry.closure.relation(*part)
        whole = {i: c.constant for i, c in row.items()}
        if any(c is None or c.denominator != 1 for c in whole.values()):
            return None
        return tuple((i, int(c)) for i, c in whole.items() if c), rest


def is_opaque(e: Element, j: int) -> bool:
    """Whether a torque law has a function that exact arithmetic cannot represent, such as tanh."""
    pending = [e.law(j), e.potential(j)]
    for law in pending:
        for a in law.atoms:
            if isinstance(a, Call) and varies(a):
                state = {"sign": "qd", "cos": "q", "sin": "q"}.get(a.function, "")
                part = linear_in(a.argument, state, e.along[j])
                rest = a.function == "sign" and part and part[1]
                if a.function != "inv" and (not state or not part or rest):
                    return True
                pending += a.operands
    return False


def linear_in(
    e: Expression, state: str, along: Row
) -> tuple[dict[int, Expression], Expression] | None:
    """Split an expression that is linear in joint positions or velocities into coefficients and a
    constant.

    Return the row {joint: coefficient} and the constant rest, or None if e is not linear. x are the
    positions if `state` is q, the velocities if it is qd. The name q (or qd) without a joint number
    means the sum over the row `along`.
    """
    row: dict[int, Expression] = {}
    rest = ZERO
    for m, c in e.terms.items():
        varying = [(a, n) for a, n in m if varies(a)]
        fixed = Expression({tuple(an for an in m if an not in varying): c})
        if not varying:
            rest = rest + fixed
            continue
        match = STATE.match(str(varying[0][0]))
        if len(varying) > 1 or varying[0][1] != 1 or not match or match[1] != state:
            return None
        joints = {int(match[2]): ONE} if match[2] else along
        for i, g in joints.items():
            row[i] = row.get(i, ZERO) + fixed * g
    return row, rest


def _form(motion: Motion, coordinate: str, form: Form) -> dict[int, Scalar]:
    column: dict[int, Scalar] = {}
    for (i, m), b in form.items():
        x = motion.algebra.constant(b) * getattr(motion, coordinate)(m)
        column[i] = column.get(i, 0) + x
    return column
