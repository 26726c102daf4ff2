"""The targets: what is emitted, under which file name, and for which robots. Light: nothing is
derived or printed here.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Target:
    """One use of an emitted file.

    Attributes
    ----------
    file : str
        Name of the file, {} for the robot.
    language : str
        What it is written for.
    use : str
        How the file {} of a robot is used.
    iterates : bool
        Whether it serves joints that only the closure equations tie, by iteration.
    """

    file: str
    language: str
    use: str = ""
    iterates: bool = False


TARGETS = {
    "numpy": Target("{}.py", "NumPy", iterates=True),
    "casadi": Target(
        "{}.py", "CasADi", 'in CasADi {}.casadi("inverse_dynamics") is a casadi.Function of columns'
    ),
    "c": Target("{}.c", "C", iterates=True),
    "h": Target("{}.h", "C", "{}.h declares what {}.c has; --target c writes both", iterates=True),
    "xp": Target(
        "{}.py",
        "arrays of any package",
        "functions of {} take arrays of CuPy, JAX, PyTorch too (pip install symgen[gpu])",
    ),
}
