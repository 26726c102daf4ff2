"""Targets of the code generator: the kinds of files it can write, their names, and their limits.

Nothing is derived or printed here, so that the import of this module is fast.
"""

from __future__ import annotations

from pathlib import PurePath
from typing import NamedTuple


class Target(NamedTuple):
    """One kind of file that the code generator can write, such as a NumPy module or a C file.

    Attributes
    ----------
    file : str
        Name of the file; {} stands for the name of the robot. If each function has a file of its
        own, a second {} stands for the function.
    language : str
        Language of the file, or the arrays for which it is written.
    use : str
        Message that tells the user how to use the file; {} stands for the name of the robot.
    iterates : bool
        Whether the file can find the positions of tied joints by iteration. Tied joints are joints
        whose positions only the closure equations define.
    bases : tuple of str
        Kinds of base (`Robot.base`) whose models the file can have.
    values : str
        Name of the array of base parameters in the file; "" if the file computes them by a function.
        The array needs the values of the robot file. {} stands for the name of the robot.
    """

    file: str
    language: str
    use: str = ""
    iterates: bool = False
    bases: tuple[str, ...] = ("fixed", "moving", "free")
    values: str = ""


JOINT_ROWS = ("fixed", "moving")
TARGETS = {
    "numpy": Target("{}.py", "NumPy", iterates=True),
    "casadi": Target(
        "{}.py", "CasADi", 'in CasADi {}.casadi("inverse_dynamics") is a casadi.Function of columns'
    ),
    "c": Target("{}.c", "C", iterates=True, bases=JOINT_ROWS, values="{}_values"),
    "h": Target(
        "{}.h",
        "C",
        "{0}.h declares what {0}.c has; --target c writes both",
        iterates=True,
        bases=JOINT_ROWS,
    ),
    "matlab": Target("{}_{}.m", "MATLAB and Octave", bases=JOINT_ROWS),
    "xp": Target(
        "{}.py",
        "arrays of any package",
        "functions of {} take arrays of CuPy, JAX, PyTorch too (pip install symgen[gpu])",
    ),
}


def target_of(file: str) -> str:
    """Return the first target whose files end as the name `file` does, such as c for tx40.c."""
    suffix = PurePath(file).suffix
    return next(name for name, target in TARGETS.items() if target.file.endswith(suffix))
