"""The command `symgen new FILE`: write a skeleton of a robot file for the user to fill in."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from runtime.reporting.result_files import write_all
from symgen.cli.session import fail, reported_errors


def new(
    file: Annotated[Path, typer.Argument(help="Robot file to create, e.g. my_arm.yaml.")],
) -> None:
    """Write a robot file with an explanation of every section; never overwrite an existing file."""
    with reported_errors():
        from symgen.description.yaml import skeleton_for

        text = skeleton_for(file)
        if file.exists():
            fail(f"{file} exists already; choose another name or edit it")
        write_all(file.parent, {file.name: text})
        typer.echo(
            f"{file}: edit it, then\n  symgen show {file} --html     # look at it\n  symgen check "
            f"{file}\n  symgen generate {file} -o models"
        )
