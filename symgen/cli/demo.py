"""The command `symgen demo`: identify the robot TX40 of the book chapter, with a report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options, session


def demo(
    output: Annotated[Path, options.folder("the results")] = Path("symgen-demo"),
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help="Shorter demo: fewer encoder steps, two runs for each step, and no rounding of torques.",
        ),
    ] = False,
) -> None:
    """Identify the Stäubli TX40 from its public record, or from a simulated record if the
    public record cannot be fetched, judge the encoder resolution, and compare the results with the published tables.
    """
    with session.results_in(output) as results:
        from symgen.demo import demonstrate, prepare

        prepared = prepare(quick=quick)
        if prepared.note:
            typer.echo(prepared.note, err=True)
        shown = demonstrate(prepared, quick=quick, progress=session.say)
        results.write_all(shown.files(output))
        session.show(shown.verdict, results)
