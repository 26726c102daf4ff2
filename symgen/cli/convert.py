"""The command `symgen convert IN OUT`: convert a robot file to another format.

A report lists what the new format cannot represent.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from runtime.reporting.result_files import write_all
from symgen.cli import options
from symgen.cli.session import fail, reported_errors


def convert(
    source: Annotated[
        str,
        typer.Argument(
            metavar="IN",
            help="Packaged robot, or a file: .yaml, .par, .urdf, .xml or .mjcf (MJCF).",
        ),
    ],
    output: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", help="File to write; its suffix names the format: .yaml, .urdf."
        ),
    ],
    constant: Annotated[
        list[str] | None,
        typer.Option(
            help="Value of a symbol of a .par file, such as D3=0.45 (SI units, rad); may be repeated."
        ),
    ] = None,
    exact: options.Exact = False,
    lock: options.Lock = None,
    chain: options.Chain = None,
    keep_fixed: Annotated[
        bool,
        typer.Option(
            "--keep-fixed",
            help=(
                "URDF or MJCF only: keep links on fixed joints (tool0, flange) as frames of their own."
            ),
        ),
    ] = False,
    values: Annotated[
        Path | None,
        typer.Option(
            help=(
                "Standard parameters to write into OUT: a CSV file with the columns name,value, such as "
                "the standard_parameters.csv of `symgen identify`."
            )
        ),
    ] = None,
    estimate: Annotated[
        Path | None,
        typer.Option(
            help=(
                "File estimate.json of `symgen identify` with physical parameters; these parameters are written into OUT."
            )
        ),
    ] = None,
    force: options.Force = False,
) -> None:
    """Convert the robot IN to the format of OUT. Report values that were read
    differently from the text of IN, and data that OUT cannot store.

    OUT is written whole or not at all. If it would describe another mechanism, nothing is written
    and the exit code is 2.
    """
    with reported_errors():
        from symgen.description.angles import SNAPPED
        from symgen.description.bodies import impossible_links
        from symgen.description.files import not_read_text, read_robot, write_robot
        from symgen.description.tree import DROPPED
        from symgen.description.values import assignment, values_of_csv, with_estimate, with_values
        from symgen.regroup.regrouping import regroup

        if output.exists() and not force:
            fail(f"{output} exists already; choose another name or add --force")
        robot, read = read_robot(
            source,
            constants=dict(map(assignment, constant or ())),
            exact=exact,
            keep_fixed=keep_fixed,
            lock=dict(assignment(text, "--lock") for text in lock or ()),
            chain=chain,
        )
        if impossible_links(robot):
            regroup(robot)  # whose note names the base parameters
        if values is not None:
            from runtime.reading.files import read_bytes

            robot = with_values(robot, values_of_csv(read_bytes(values), str(values)))
        if estimate is not None:
            from runtime.commands import require_torques
            from runtime.documents.estimates import load_whole_estimate

            fit = load_whole_estimate(estimate)
            require_torques(fit)
            robot = with_estimate(robot, fit.details.get("standard"), str(estimate))
        angles = [robot.angles] if exact else []
        comments = [f"Converted from {robot.file}.", *angles, not_read_text(robot), *read]
        text, written = write_robot(robot, output.name, comments=list(filter(None, comments)))
        write_all(output.parent, {output.name: text})
        typer.echo(
            f"{output}: {robot.name}, {len(robot.joints)} joints, {len(robot.parameters)} standard "
            "parameters"
        )
        remarks = [note for note in read if note.startswith(DROPPED)]
        others = [note for note in read if not note.startswith((DROPPED, SNAPPED))]
        for head, notes in (
            (f"read from {source}", others),
            (f"not carried by {output.name}", written),
            (f"of {source}", remarks),
        ):
            if notes:
                typer.echo(
                    "\n".join([f"{head}:", *(f"  - {note}" for note in notes)]),
                    err=notes is remarks,
                )
