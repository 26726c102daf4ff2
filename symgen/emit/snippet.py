"""The folder that uses a robot in another program: a script, a URDF, and the generated module that the script compares with."""

from __future__ import annotations

from symgen.description.robot import Robot
from symgen.description.urdf_write import write_urdf
from symgen.emit.certified import certified_files
from symgen.emit.use import PROGRAMS, use_script
from symgen.errors import SymgenError


def snippet_files(robot: Robot, program: str) -> dict[str, str]:
    """{file name: text} of use_PROGRAM.py, ROBOT.urdf and ROBOT.py.

    Raises SymgenError where `program` is none of PROGRAMS, `robot` lacks values or does not fit a URDF, or its certificate does not hold.
    """
    if program not in PROGRAMS:
        raise SymgenError(f"--for {program}; expected one of {', '.join(PROGRAMS)}")
    text, _ = write_urdf(robot)
    script = use_script(robot, program, robot.values)
    return {f"use_{program}.py": script, f"{robot.name}.urdf": text, **certified_files(robot)}
