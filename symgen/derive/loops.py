"""From the moving joints of the tree to the actuated ones: q = f(qa), G = dq/dqa.

Declared relations are linear, q_j = sum_i n_i q_i + c, with constant n_i; then qd = G qad and qdd = G qadd with the same constant G, and

    Gamma_a = G' Gamma_tree .

Khalil and Dombre 2002, section 10 (parallelogram robots).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

from symgen.derive.scalar import Algebra, Scalar, add, mul
from symgen.description.expression import ONE, Expression
from symgen.description.robot import Robot, row_of
from symgen.errors import DescriptionError

ActiveRow = tuple[tuple[int, Expression], ...]


class Closure:
    """Every moving joint as a linear function of the actuated ones."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.row: dict[int, dict[int, Expression]] = {j: {j: ONE} for j in robot.joints}
        self.offset: dict[int, Expression] = {j: Expression() for j in robot.joints}
        for j in robot.passive:
            self._passive(j)

    def _passive(self, j: int) -> None:
        if j not in self.robot.constraints:
            raise DescriptionError(
                f"passive joint {j} has no relation to the actuated joints; declare it under constraints", path=("frames", j)
            )
        e = self.robot.constraints[j]
        while unknown := [i for i in self.robot.passive if f"q{i}" in e.symbols]:
            if j in unknown or any(i not in self.robot.constraints for i in unknown):
                raise DescriptionError(f"constraint q{j} = {e} does not end at actuated joints", path=("constraints", f"q{j}"))
            e = e.substitute({f"q{i}": self.robot.constraints[i] for i in unknown})
        constant = e.substitute({f"q{i}": Expression() for i in self.robot.joints})
        try:
            self.row[j] = row_of(e - constant, self.robot.joints)
        except ValueError as error:
            raise DescriptionError(f"constraint q{j}: {error}", path=("constraints", f"q{j}")) from error
        self.offset[j] = constant

    @cached_property
    def is_trivial(self) -> bool:
        return not self.robot.passive

    def turn(self, j: int) -> tuple[tuple[tuple[int, int], ...], Expression]:
        """The angle of revolute joint j as integer multiples of actuated angles plus a constant."""
        turn = []
        for i, g in sorted(self.row[j].items()):
            c = g.constant
            if c is None or c.denominator != 1:
                raise DescriptionError(
                    f"constraint on q{j}: {g}*q{i}; a passive angle needs whole multiples of actuated angles", path=("constraints", f"q{j}")
                )
            turn.append((i, int(c)))
        return tuple(turn), self.offset[j]

    def linear(self, algebra: Algebra, j: int, value: Mapping[int, Scalar]) -> Scalar:
        """sum_i G_ji value_i."""
        total: Scalar = 0
        for i, g in self.row[j].items():
            total = add(total, mul(algebra.constant(g), value[i]))
        return total

    def active_row(self, row: Mapping[int, Expression]) -> ActiveRow:
        """The row of s = row q in the actuated joints."""
        total: dict[int, Expression] = {}
        for j, g in row.items():
            for i, h in self.row[j].items():
                total[i] = total.get(i, Expression()) + g * h
        return tuple(sorted(((i, g) for i, g in total.items() if g), key=lambda ig: ig[0]))

    def project(self, algebra: Algebra, torque: Mapping[int, Scalar]) -> dict[int, Scalar]:
        """G' Gamma_tree, by actuated joint."""
        active: dict[int, Scalar] = dict.fromkeys(self.robot.joints, 0)
        for j, value in torque.items():
            for i, g in self.row[j].items():
                active[i] = add(active[i], mul(algebra.constant(g), value))
        return active
