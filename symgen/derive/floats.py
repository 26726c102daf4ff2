"""Floats, a domain of graph nodes: arrays of any one shape, or symbols of a package that has their functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from symgen.derive.graph import INV, POS, SQRT, Node, Symbol
from symgen.description.expression import FUNCTIONS
from symgen.description.robot import Robot

Array = np.ndarray[Any, Any]
NUMPY = {name: getattr(np, f.numpy) for name, f in FUNCTIONS.items() if f.numpy} | {POS: np.maximum}
LETTERS = {"q": "q", "qd": "QP", "qdd": "QDP"}


class Floats:
    """The constants of a robot, and states.

    Parameters
    ----------
    robot : Robot
        The robot.
    states : mapping, optional
        Value of each input that is no constant; rad or m and seconds.
    constants : mapping, optional
        In place of those of the robot file.
    functions : mapping, optional
        Functions of another package that states are of, such as CasADi.
    """

    def __init__(
        self,
        robot: Robot,
        states: Mapping[Symbol, Any] | None = None,
        constants: Mapping[str, Any] | None = None,
        functions: Mapping[str, Callable[..., Any]] = NUMPY,
    ) -> None:
        self.robot = robot
        self.states = states or {}
        self.functions = functions
        self.constants = {**robot.constants, **(constants or {})}

    def symbol(self, symbol: Symbol) -> Any:
        """The value of an input."""
        match symbol.kind:
            case "constant" | "channel":
                return self.constants[symbol.name]
            case "pi":
                return np.pi
            case "number":
                return float(Fraction(symbol.name))
            case "gravity":
                return -self.robot.gravity[int(symbol.name)].value(self.constants)
        return self.states[symbol]

    def number(self, c: Fraction) -> float:
        """A rational, rounded."""
        return float(c)

    def function(self, node: Node, x: list[Any]) -> Any:
        """A function of the package."""
        if node.op == INV:
            return 1.0 / x[0]
        if node.op == POS:
            return self.functions[POS](x[0], 0.0)
        function = self.functions[node.op]
        if node.op == SQRT and node.fixed:  # of constants, which may have none
            with np.errstate(invalid="raise"):
                return function(*x)
        return function(*x)


def states_of(**states: Mapping[int, Any]) -> dict[Symbol, Any]:
    """States by input, from q, qd and qdd of the joints by their numbers."""
    return {
        Symbol(kind, f"{LETTERS[kind]}{j}"): x
        for kind, by_joint in states.items()
        for j, x in by_joint.items()
    }
