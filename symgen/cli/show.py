"""`symgen show ROBOT`: base parameters with their regrouping formulas, as text, LaTeX or JSON; or a page to look at."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from runtime.result_files import write_all
from symgen.cli.described import AT_VALUES, described_robot
from symgen.cli.session import NEGATIVE, fail, reported_errors, single_thread

FORMATS = ("text", "latex", "json")


def show(
    robot: Annotated[str, typer.Argument(help="Packaged robot or robot file (.yaml, .par, .urdf).")],
    format: Annotated[str, typer.Option(help="text, latex or json.")] = "text",
    at_values: Annotated[bool, typer.Option("--at-values", help=AT_VALUES)] = False,
    only: Annotated[str | None, typer.Option(help="One base parameter, e.g. XX2R.")] = None,
    recursive: Annotated[bool, typer.Option("--recursive", help="Link by link, as SYMORO prints, instead of flat as eq. (27).")] = False,
    json: Annotated[bool, typer.Option("--json", help="Same as --format json.")] = False,
    html: Annotated[
        bool, typer.Option("--html", help="One page to look at: the robot in 3D, its frames and formulas; no network.")
    ] = False,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="File of the page; <name>.html where left out.")] = None,
    ascii: Annotated[bool, typer.Option("--ascii", help="On a terminal too, names as robot files and modules write them: ZZ1R.")] = False,
) -> None:
    """Print the base parameters of ROBOT, what they are made of, what has no effect, and what the models cost.

    On a terminal in colour and with subscripts; plain text where it is piped, or with NO_COLOR set. What is printed is certified: where the
    certificate does not hold, it follows on the error stream, and the exit code is 1.
    """
    single_thread()
    kind = "json" if json else format
    conflicts = {
        "--html shows everything; leave out --format, --only, --recursive and --json": html
        and (only or recursive or json or format != "text"),
        "-o names the file of --html; the other formats are printed": output is not None and not html,
        f"format {kind!r}; expected one of {', '.join(FORMATS)}{'; the page is --html' * (kind == 'html')}": kind not in FORMATS,
        "--recursive prints every step as text; leave out --format and --only": recursive and (kind != "text" or only),
    }
    for message, given in conflicts.items():
        if given:
            fail(message)
    with reported_errors():
        from symgen.cli.formula_text import print_coloured
        from symgen.emit.certified import certify
        from symgen.regroup.regrouping import regroup
        from symgen.report.formulas import printed
        from symgen.report.page import robot_page

        described = described_robot(robot, at_values)
        regrouping = regroup(described)
        certificate = certify(regrouping)
        if html:
            path = output or Path(f"{described.name}.html")
            typer.echo(f"{write_all(path.parent, {path.name: robot_page(regrouping, certificate)})[0]}")
        elif kind != "text" or not print_coloured(regrouping, only, recursive, ascii):
            typer.echo(printed(regrouping, certificate, "recursive" if recursive else kind, only))
    if not certificate.valid:
        typer.echo(str(certificate), err=True)
        raise typer.Exit(NEGATIVE)
