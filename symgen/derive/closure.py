"""Closure of the loops: the passive joints as functions of the independent joints.

The moving joints of the tree are linear functions of the *independent* joints,

    q_j = sum_i n_ji q_i + c_j ,     qd_j = sum_i n_ji qd_i ,     qdd_j = sum_i n_ji qdd_i

with constant n_ji and c_j. In serial robots and trees every joint is independent. In parallelograms
the actuated joints are independent, and G = (n_ji). In general loops, the passive joints that no
linear relation gives are independent too. These joints are called tied: the closure equations
relate them to the actuated joints, qd_u = G_u qd_a. Then

    Gamma_a = G' Gamma_tree

Khalil and Dombre 2002, chapter 7 and section 10.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import lcm, prod

from symgen.derive.algebra import GraphAlgebra, Scalar
from symgen.derive.graph import ActiveRow, Turn
from symgen.description.expression import ONE, ZERO, Expression
from symgen.description.robot import REVOLUTE, Robot
from symgen.errors import DescriptionError

Relation = tuple[Mapping[int, Expression], Expression]  # row and constant


@dataclass(frozen=True)
class Closure:
    """All moving joints of a robot as linear functions of its independent joints.

    Attributes
    ----------
    robot : Robot
        The mechanism.
    row : mapping
        {j: {i: n_ji}}, the coefficients.
    offset : mapping
        {j: c_j}, the constants, rad or m.
    tied : tuple of int
        Independent passive joints: joints of general loops that only closure equations give.
    start : mapping
        A configuration of all moving joints that closes the loops, rad or m; the configuration
        selects the assembly mode of a general loop.
    """

    robot: Robot
    row: Mapping[int, Mapping[int, Expression]]
    offset: Mapping[int, Expression]
    tied: tuple[int, ...] = ()
    start: Mapping[int, float] = field(default_factory=dict)

    @property
    def independent(self) -> tuple[int, ...]:
        return (*self.robot.joints, *self.tied)

    def formula(self, j: int) -> Expression:
        """Return the position q_j of a moving joint as an expression in independent joint
        positions.
        """
        return sum((g * Expression.symbol(f"q{i}") for i, g in self.row[j].items()), self.offset[j])

    def turn(self, j: int) -> tuple[Turn, Expression]:
        """Return, for revolute joint j, pairs (i, n_i) and the constant c of q_j = sum_i n_i q_i +
        c.

        The joints i are independent. Raises DescriptionError if a multiple is not a number.
        """
        turn = []
        for i, g in sorted(self.row[j].items()):
            c = g.constant
            if c is None:
                theirs, other = (
                    f"{label!a:.60} (q{k})" if (label := self.robot.labels.get(k)) else f"q{k}"
                    for k in (j, i)
                )
                raise DescriptionError(
                    f"constraints.q{j}: the ratio of {theirs} to {other} is {g}; the ratio of two "
                    "angles must be a number without symbols, "
                    f"so write {g.value(self.robot.constants):.12g}",
                    path=("constraints", f"q{j}"),
                    file=self.robot.file or None,
                )
            turn.append((i, int(c) if c.denominator == 1 else c))
        return tuple(turn), self.offset[j]

    def relation(self, row: Mapping[int, Expression], c: Expression = ZERO) -> Relation:
        """Replace all joints in sum_j row_j q_j + c by independent joints; return the new row and
        constant.

        The given row may contain any moving joints.
        """
        total: dict[int, Expression] = {}
        for j, g in row.items():
            for i, h in self.row[j].items():
                total[i] = total.get(i, ZERO) + g * h
            c = c + g * self.offset[j]
        return {i: g for i, g in sorted(total.items()) if g}, c

    def in_independent(self, row: Mapping[int, Expression]) -> ActiveRow:
        """Express a velocity sum_j row_j qd_j by independent joints; return pairs (joint,
        coefficient).
        """
        return tuple(self.relation(row)[0].items())

    def project(self, algebra: GraphAlgebra, torque: Mapping[int, Scalar]) -> dict[int, Scalar]:
        """Convert torques of all moving joints to torques of the actuated joints, by virtual work.

        Gamma_a = G' Gamma_tree, with G = dq/dq_a; `torque` is Gamma_tree by joint. Rows of a free
        base stay as they are.
        """
        if not self.robot.passive:
            return dict(torque)
        total: dict[int, Scalar] = dict.fromkeys(self.independent, 0)
        base = {j: x for j, x in torque.items() if j not in self.row}
        for j, value in torque.items():
            for i, g in self.row.get(j, {}).items():
                total[i] = total[i] + algebra.constant(g) * value
        for i in self.robot.joints:
            for u in self.tied:
                total[i] = total[i] + algebra.rate(u, i) * total[u]
        return base | {i: total[i] for i in self.robot.joints}

    def project_twice(
        self, algebra: GraphAlgebra, A: Mapping[tuple[int, int], Scalar]
    ) -> dict[tuple[int, int], Scalar]:
        """Return G' A G of the actuated joints from the matrix A of all moving joints; G = dq/dq_a.

        Rows and columns of a free base stay as they are.
        """
        rows, every = self.robot.rows, dict.fromkeys(j for j, _ in A)
        AG = {j: self.project(algebra, {k: A[j, k] for k in every}) for j in every}
        columns = {k: self.project(algebra, {j: AG[j][k] for j in every}) for k in rows}
        return {(i, k): columns[k][i] for k in rows for i in rows}


def parts(robot: Robot) -> int:
    """Return a common denominator D of the ratios between passive and independent joint angles.

    Every passive angle is a constant plus a sum of whole multiples of q_i/D. D is the least common
    denominator of the declared ratios between angles. If one relation is substituted into another,
    or if a loop may require this, D is the product of the denominators.
    """
    joints, relations = {f"q{j}" for j in robot.moving}, robot.constraints
    chained = robot.loops or {f"q{j}" for j in relations} & {
        a for e in relations.values() for a in e.atoms
    }
    denominators = [
        c.denominator
        for j, e in relations.items()
        for m, c in e.terms.items()
        if (chained or robot.frame(j).sigma == REVOLUTE) and joints & {a for a, _ in m}
    ]
    return prod(denominators) if chained else lcm(*denominators)


def open_tree(robot: Robot) -> Closure:
    """Return the `Closure` of a robot whose loops are cut: every moving joint is independent."""
    moving = robot.moving
    passive = tuple(j for j in moving if j not in robot.joints)
    return Closure(robot, {j: {j: ONE} for j in moving}, dict.fromkeys(moving, ZERO), passive)
