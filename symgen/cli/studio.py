"""The command `symgen studio [ROBOT] [RECORD]`: serve a local page for the whole work."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options
from symgen.cli.session import fail, reported_errors

WATCHED = "from symgen.studio.child import watched; watched(); "
PROGRAMS = {
    "symgen": "from symgen.cli.main import main; main()",
    "check": "from symgen.studio.views import check; check()",
    "repair": "from symgen.studio.views import mend; mend()",
}


def studio(
    robot: Annotated[
        str | None, typer.Argument(help="Packaged robot or robot file to begin with.")
    ] = None,
    record: Annotated[
        str | None, typer.Argument(help="Dataset, study file or measured file to begin with.")
    ] = None,
    output: Annotated[
        Path,
        options.output(
            "Folder in which the studio saves robot files, study files and results, and opens them again."
        ),
    ] = Path("symgen-studio"),
    port: Annotated[
        int,
        typer.Option(min=0, max=65535, help="Port of the server. Default: that of the last time."),
    ] = 0,
    renew: Annotated[
        bool,
        typer.Option(
            "--new-address", help="Use a new address; bookmarks of the old address no longer work."
        ),
    ] = False,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")
    ] = True,
) -> None:
    """Serve a local page to edit a robot, read a record, check it, identify and see the results.
    Other machines cannot reach it.

    The server ends with Ctrl-C, with its terminal, or ten minutes after its last page was closed and
    its last run has ended.
    """
    with reported_errors():
        try:
            from symgen.studio.serving import serve
        except ImportError as e:
            fail(f"the studio needs {e.name}: pip install symgen[studio]")
        programs = {
            name: [sys.executable, "-P", "-c", WATCHED + text] for name, text in PROGRAMS.items()
        }
        say = partial(typer.echo, err=True)
        serve(
            output,
            programs,
            say,
            robot=robot,
            record=record,
            port=port,
            browser=browser,
            renew=renew,
        )
