"""Evaluation of the expression graph in floating point, by NumPy or a package such as CasADi."""

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
    """Values of the constants and states of a robot, at which its formulas are evaluated.

    Parameters
    ----------
    robot : Robot
        The robot.
    states : mapping, optional
        {input: value} for the inputs that vary, such as q1; rad or m and seconds.
    constants : mapping, optional
        Values that replace constants of the robot file.
    functions : mapping, optional
        Functions, such as cos, of the package whose symbols the states are. Default: NumPy.
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
        """Return the value of an input, such as q1 or a constant of the robot."""
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
        """Return a rational number, rounded to a float."""
        return float(c)

    def function(self, node: Node, x: list[Any]) -> Any:
        """Apply the function of a node, such as cos or 1/x, to the values x of its operands."""
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
    """Return {graph input: value} from mappings {joint number: value} of q, qd and qdd."""
    return {
        Symbol(kind, f"{LETTERS[kind]}{j}"): x
        for kind, by_joint in states.items()
        for j, x in by_joint.items()
    }
