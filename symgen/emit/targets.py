"""The targets: what is emitted, under which file name, and for which robots. Light: nothing is
derived or printed here.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Target:
    """One kind of emitted file.

    Attributes
    ----------
    file : str
        Name of the file, {} for the robot.
    language : str
        What it is written for.
    iterates : bool
        Whether it serves joints that only the closure equations tie, by iteration.
    """

    file: str
    language: str
    iterates: bool = False


TARGETS = {
    "numpy": Target("{}.py", "NumPy", iterates=True),
    "casadi": Target("{}_casadi.py", "CasADi"),
    "c": Target("{}.c", "C11"),
    "xp": Target("{}_xp.py", "arrays of any package"),
}
