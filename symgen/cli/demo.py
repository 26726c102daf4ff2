"""`symgen demo`: the main job end to end, from a robot file of the chapter to a report."""

from __future__ import annotations

from enum import StrEnum
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from runtime.result_files import reserved
from symgen.cli.session import reported_errors, say, single_thread


class Demo(StrEnum):
    """Robots of the chapter, and coarse encoders."""

    tx40 = "tx40"
    haptic = "haptic"
    counts = "counts"


def demo(
    robot: Annotated[Demo, typer.Argument(help="The robot of the chapter that is shown; counts: coarse encoders of the TX40.")] = Demo.tx40,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")] = Path("symgen-demo"),
    quick: Annotated[bool, typer.Option("--quick", help="Two runs per step and no further studies.")] = False,
) -> None:
    """Identify the Stäubli TX40 (or the haptic interface, simulated) and judge its encoder resolution, beside the published tables.

    counts: the same TX40 record with encoders of 5000 to 100 counts a turn, read as positions and read as counts.
    """
    single_thread()
    with reported_errors(), reserved(output) as results:
        module = import_module(f"symgen.demo.{robot}")
        prepared = module.prepare(quick=quick)
        if prepared.note:
            typer.echo(prepared.note, err=True)
        shown = module.demonstrate(prepared, quick=quick, progress=say)
        results.write_all(shown.files(output))
        typer.echo(shown.verdict)
        typer.echo(f"report: {output / 'report.html'}")
