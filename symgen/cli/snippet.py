"""`symgen snippet ROBOT --for pinocchio`: a folder that uses the robot in another program, and checks itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.result_files import write_all
from symgen.cli.session import fail, reported_errors

if TYPE_CHECKING:
    from symgen.description import Robot


def snippet(
    robot: Annotated[
        str, typer.Argument(help="Packaged robot or robot file (.yaml, .par, .urdf), with values of its standard parameters.")
    ],
    program: Annotated[str, typer.Option("--for", help="pinocchio or drake.")] = "pinocchio",
    estimate: Annotated[
        Path | None, typer.Option(help="estimate.json of a feasible estimate, whose standard parameters stand for the robot's.")
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the script, the URDF and the generated module.")] = Path(),
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist.")] = False,
) -> None:
    """Write use_PROGRAM.py, ROBOT.urdf and ROBOT.py, which run without symgen: gravity, motors, friction and offsets included.

    The script prints how well the program's torques agree with those of the module.
    """
    with reported_errors():
        from symgen.description import load_robot
        from symgen.description.urdf_write import write_urdf
        from symgen.emit import generate_module
        from symgen.emit.use import PROGRAMS, use_script

        if program not in PROGRAMS:
            fail(f"--for {program}; expected one of {', '.join(PROGRAMS)}")
        described = load_robot(robot)
        if estimate is not None:
            described = with_estimate(described, estimate)
        text, _ = write_urdf(described)
        files = {
            f"use_{program}.py": use_script(described, program, described.values),
            f"{described.name}.urdf": text,
            f"{described.name}.py": generate_module(described),
        }
        if taken := [name for name in files if (output / name).exists() and not force]:
            fail(f"{output} holds {', '.join(taken)} already; choose another folder or add --force")
        write_all(output, files)
        typer.echo(f"{output / f'use_{program}.py'}: run it with python; it needs {' and '.join([*files][1:])} beside it")


def with_estimate(robot: Robot, file: Path) -> Robot:
    """The robot with the standard parameters of a feasible estimate as its values; exit code 2 where the file has none or is of another robot."""
    from runtime.estimators.estimate import load_estimate
    from runtime.json_values import number

    standard = load_estimate(file).details.get("standard")
    if not isinstance(standard, dict):
        fail(
            f"{file}: holds base parameters alone; a program needs standard ones: set estimate: {{method: feasible}} in the study and identify again"
        )
    try:
        values = {name: number(x) for name, x in standard.items()}
    except ValueError as e:
        fail(f"{file}: details.standard: {e}; the file was changed")
    if unknown := sorted(set(standard) - set(robot.parameters)):
        fail(f"{file}: {', '.join(unknown[:12])} are no parameters of {robot.name}; is it the estimate of another robot?")
    return replace(robot, values={**robot.values, **values})
