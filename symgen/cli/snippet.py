"""`symgen snippet ROBOT --for pinocchio`: a folder that uses the robot in another program, and checks itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from runtime.result_files import write_all
from symgen.cli.session import fail, reported_errors


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
        from symgen.description.values import with_estimate
        from symgen.emit.snippet import snippet_files

        described = load_robot(robot)
        if estimate is not None:
            from runtime.estimators.estimate import load_estimate

            described = with_estimate(described, load_estimate(estimate).details.get("standard"), str(estimate))
        files = snippet_files(described, program)
        if taken := [name for name in files if (output / name).exists() and not force]:
            fail(f"{output} holds {', '.join(taken)} already; choose another folder or add --force")
        write_all(output, files)
        typer.echo(f"{output / f'use_{program}.py'}: run it with python; it needs {' and '.join([*files][1:])} beside it")
