"""How C functions receive q, qd, qdd: one pointer for each, or one struct with all of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from symgen.emit.spec import STATES, ModuleSpec


class CStates(NamedTuple):
    """The arguments by which the C functions of one robot receive the joint states q, qd, ...

    Attributes
    ----------
    robot : str
        Name of the robot; the name of the struct starts with it.
    widths : mapping of str to int
        Number of values of each state per sample, in the order of the struct.
    closed : bool
        Whether loops tie joints, so that q, qd, qdd, G and qdd0 are members of one struct s.
    """

    robot: str
    widths: Mapping[str, int]
    closed: bool

    @classmethod
    def of(cls, spec: ModuleSpec) -> CStates:
        """Make the description of the state arguments that all C functions of a robot have."""
        size = spec.sizes
        if not spec.tied:
            return cls(spec.robot.name, dict.fromkeys(STATES, size["n"]), closed=False)
        joints = dict.fromkeys(("q", "qd", "qdd"), size["k"])
        tied = {"G": size["m"] * size["n"], "qdd0": size["m"]}
        return cls(spec.robot.name, joints | tied, closed=True)

    def arguments(self, *states: str) -> list[str]:
        """Return the argument names for the given states: s (the struct), or one per state."""
        return ["s"] if self.closed else [*states]

    def parameters(self, *states: str) -> list[str]:
        """Return the C declarations of the state arguments, such as `const real *q`."""
        kind = f"{self.robot}_state" if self.closed else "real"
        return [f"const {kind} *{x}" for x in self.arguments(*states)]

    def read(self, state: str) -> str:
        """Return the C expression that points to a state of one sample: `s->q`, or `q`."""
        return f"s->{state}" if self.closed else state

    def load(self, state: str) -> str:
        """Return the C arguments that locate a state: distance between samples, and start address.

        The distance, in numbers, is from one sample to the next. The address is the address of the
        first sample of a tile, a group of samples computed together.
        """
        if self.closed:
            return f"sizeof *s/sizeof(real), s[start].{state}"
        n = self.widths[state]
        return f"{n}, {state} + {n}*start"
