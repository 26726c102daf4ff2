"""`symgen new FILE`: a skeleton robot file to fill in."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import typer

from runtime.result_files import write_all
from symgen.cli.session import fail, reported_errors


def schema_address(file: Path) -> str:
    """The installed JSON Schema as seen from the folder of `file`, percent-encoded: editors resolve it without network."""
    from symgen.description.schema import schema_file

    try:
        return quote(Path(os.path.relpath(schema_file(), file.resolve().parent)).as_posix())
    except ValueError:  # on another drive
        return schema_file().as_uri()


def new(file: Annotated[Path, typer.Argument(help="Robot file to create, e.g. my_arm.yaml.")]) -> None:
    """Write a robot file with every section explained. Never overwrites."""
    with reported_errors():
        from symgen.description import skeleton

        if file.suffix not in (".yaml", ".yml"):
            fail(f"{file}: a robot file ends in .yaml")
        text = skeleton(file.stem, schema_address(file))
        if file.exists():
            fail(f"{file} exists already; choose another name or edit it")
        write_all(file.parent, {file.name: text})
        typer.echo(
            f"{file}: edit it, then\n  symgen show {file} --html     # look at it\n  symgen check {file}\n  symgen generate {file} -o models"
        )
