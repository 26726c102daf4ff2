"""The `symgen` command line.

Each command is imported only when it is called, so that `symgen --help` starts fast.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from difflib import get_close_matches
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

PANELS = {
    "Robot": {
        "show": "Print the base parameters with their regrouping formulas.",
        "generate": "Derive a robot's models and write them as a module.",
        "check": "Verify the certificate of a robot's base parameters.",
        "new": "Write a skeleton robot file.",
        "convert": "Write a robot in another format: .yaml, .urdf.",
    },
    "Record": {
        "identify": "Estimate the base parameters from a measured record.",
        "apply": "Write identified values into your own URDF or MJCF.",
        "report": "Identify a robot from a record and judge the result on one page.",
        "compare": "Find which of several studies predicts best.",
        "excite": "Search for a motion that excites the parameters within the limits.",
        "simulate": "Simulate the closed loop of a study file and write its record.",
    },
    "Encoder": {
        "cestac": "Judge whether the encoder resolves enough for an identification.",
    },
    "Files": {
        "demo": "Run the main job from end to end, with a report.",
        "studio": "Serve a local page where one works: robot, record, check, solve, results.",
        "datasets": "List the measured records that symgen can fetch.",
        "schema": "Print the JSON Schema of robot files or of results.",
    },
}
VERBS = {verb: does for panel in PANELS.values() for verb, does in panel.items()}
MAIN_PATH = (
    ("symgen identify arm.urdf log.csv --suggest study.yaml", "name its columns"),
    ("symgen identify arm.urdf study.yaml -o results", "values, verdict"),
    ("symgen apply results arm.urdf -o new.urdf", "into your URDF"),
)

WENT = {
    "fleet": "symgen fleet was removed; use docs/examples/dask_many_robots.py, which identifies "
    "many files on a cluster",
}
"""Verbs of earlier versions, with the sentence that names what to use instead."""


class Verbs(TyperGroup):
    """The `symgen` command group, which imports a command only when the command is called.

    A command VERB is the function of that name in the module symgen/cli/VERB.py. The list of
    commands in the help text is shown without importing these modules.
    """

    listing = False

    def list_commands(self, ctx: Any) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name in WENT:
            typer.echo(f"error: {WENT[cmd_name]}", err=True)
            raise typer.Exit(2)
        if cmd_name not in VERBS:
            if near := get_close_matches(cmd_name, VERBS, 1):
                ctx.fail(f"No such command {cmd_name!r}; did you mean {near[0]}?")
            return None
        if self.listing:
            return TyperCommand(cmd_name, help=VERBS[cmd_name])
        verb = typer.Typer(
            add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None
        )
        verb.command(cmd_name)(getattr(import_module(f"symgen.cli.{cmd_name}"), cmd_name))
        return get_command(verb)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        self.listing = True
        super().format_help(ctx, formatter)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        for title, panel in PANELS.items():
            with formatter.section(title):
                formatter.write_dl([*panel.items()], col_max=12)
        with formatter.section("From a log to values"):
            formatter.write_dl([*MAIN_PATH], col_max=60)


ALLOCATIONS = 500_000
"""New objects between two searches for unreachable ones. Most objects of modules and figures stay:
seeking among them takes a tenth of a report.
"""

app = typer.Typer(
    cls=Verbs,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)  # rich: 0.15 s


def _version(wanted: bool) -> None:
    if wanted:
        from symgen.version import VERSION

        typer.echo(f"symgen {VERSION}")
        raise typer.Exit


@app.callback()
def symgen(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Print the version."
    ),
) -> None:
    """Symbolic robot dynamics: from a robot file to formulas, from a record to parameters, and what the encoder allows."""


def main() -> None:
    """Run the `symgen` command line."""
    gc.set_threshold(ALLOCATIONS, 50, 100)
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = (
        "1"  # else pydantic reads the metadata of every package
    )
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # cleans up as Ctrl-C does
    _open_streams()
    try:
        app()
    except OSError as e:  # help or version to a full disk; the verbs report their own
        typer.echo(f"error: cannot print: {e.strerror or e}", err=True)
        sys.exit(2)
    finally:
        gc.freeze()  # what is left ends with the process: it need not be searched once more


def _open_streams() -> None:
    """Make sure that the file descriptors 0 to 2 are open, by os.devnull if needed.

    Otherwise a file that the program opens could get the number of a closed stream, and receive the
    text that a library prints.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8"))
        getattr(sys, name).reconfigure(
            errors="backslashreplace"
        )  # names of files, titles: whatever the terminal cannot show
