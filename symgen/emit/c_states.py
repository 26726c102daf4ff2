"""How C functions take their states: a pointer for each, or one struct of a closed mechanism."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from symgen.emit.spec import STATES, ModuleSpec


@dataclass(frozen=True)
class CStates:
    """The states of C functions.

    Attributes
    ----------
    robot : str
        Its name, which the name of the struct begins with.
    widths : mapping of str to int
        How many numbers each state of one sample has, in the order of the struct.
    closed : bool
        Whether loops tie joints, so that q, qd, qdd, G and qdd0 stand in one struct s.
    """

    robot: str
    widths: Mapping[str, int]
    closed: bool

    @classmethod
    def of(cls, spec: ModuleSpec) -> CStates:
        """The states of the functions of `spec`."""
        size = spec.sizes
        if not spec.tied:
            return cls(spec.robot.name, dict.fromkeys(STATES, size["n"]), closed=False)
        joints = dict.fromkeys(("q", "qd", "qdd"), size["k"])
        tied = {"G": size["m"] * size["n"], "qdd0": size["m"]}
        return cls(spec.robot.name, joints | tied, closed=True)

    def arguments(self, *states: str) -> list[str]:
        """Names by which a function takes these states."""
        return ["s"] if self.closed else [*states]

    def parameters(self, *states: str) -> list[str]:
        """Declarations of `arguments`."""
        kind = f"{self.robot}_state" if self.closed else "real"
        return [f"const {kind} *{x}" for x in self.arguments(*states)]

    def read(self, state: str) -> str:
        """Pointer to the numbers of a state of one sample."""
        return f"s->{state}" if self.closed else state

    def load(self, state: str) -> str:
        """Numbers between a state of one sample and the next, and a pointer to the first of a tile."""
        if self.closed:
            return f"sizeof *s/sizeof(real), s[start].{state}"
        n = self.widths[state]
        return f"{n}, {state} + {n}*start"
