"""`symgen show ROBOT`: base parameters with their regrouping formulas, any model in symbols, or a page to look at."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from runtime.result_files import write_all
from symgen.cli.described import AT_VALUES, described_robot
from symgen.cli.session import NEGATIVE, fail, reported_errors, single_thread

FORMATS = ("text", "latex", "json", "sympy")


def show(
    robot: Annotated[str, typer.Argument(help="Packaged robot or robot file (.yaml, .par, .urdf).")],
    model: Annotated[
        str | None,
        typer.Option(help="A model in symbols: pose, jacobian, inertia_matrix, inverse_dynamics, gravity, ... (a wrong name lists them)."),
    ] = None,
    frame: Annotated[
        int | None, typer.Option(help="Of a pose, Jacobian or twist: the frame in whose components it is; 0 where left out.")
    ] = None,
    of: Annotated[int | None, typer.Option(help="Of a pose, Jacobian or twist: the frame whose it is; the last where left out.")] = None,
    rows: Annotated[str | None, typer.Option(help="Of a determinant: rows of the Jacobian, e.g. 1,2.")] = None,
    form: Annotated[str, typer.Option(help="closed (factored by parameter) or recursive (every step, as SYMORO prints).")] = "closed",
    parameters: Annotated[str, typer.Option(help="base or standard parameters.")] = "base",
    value: Annotated[list[str] | None, typer.Option(help="Value of a symbol, e.g. q3=pi/2 or D3=0.225; may be repeated.")] = None,
    passive: Annotated[str | None, typer.Option(help="Passive joints of loops as functions or as symbols.")] = None,
    format: Annotated[str, typer.Option(help="text, latex or json; sympy with --model.")] = "text",
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
    """Print the base parameters of ROBOT, what they are made of, what has no effect, and what the models cost; or, with --model, a model in symbols.

    On a terminal in colour and with subscripts; plain text where it is piped, or with NO_COLOR set. What is printed is certified: where the
    certificate does not hold, it follows on the error stream, and the exit code is 1.
    """
    single_thread()
    kind = "json" if json else format
    of_model = [frame, of, rows, value, passive, form if form != "closed" else None, parameters if parameters != "base" else None]
    conflicts = {
        "--html shows everything; leave out --format, --only, --recursive, --json and --model": html
        and (only or recursive or json or model or format != "text"),
        "-o names the file of --html; the other formats are printed": output is not None and not html,
        f"format {kind!r}; expected one of {', '.join(FORMATS)}{'; the page is --html' * (kind == 'html')}": kind not in FORMATS,
        "--recursive prints every step as text; leave out --format and --only": recursive and not model and (kind != "text" or only),
        "--only and --recursive are for base parameters; a model has --form recursive": model is not None and (only or recursive),
        "--frame, --of, --rows, --form, --parameters, --value, --passive and --format sympy need --model": model is None
        and (kind == "sympy" or any(x is not None for x in of_model)),
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
        if model is not None:
            from symgen.symbols.symbolic import symbolic

            models = symbolic(described, parameters=parameters, values=_values(value or []), passive=passive)
            typer.echo(models.show(model, form=form, format=kind, of=of, frame=frame or 0, rows=_numbers(rows)))
            if parameters == "standard":
                return
        regrouping = regroup(described)
        certificate = certify(regrouping)
        if html:
            path = output or Path(f"{described.name}.html")
            typer.echo(f"{write_all(path.parent, {path.name: robot_page(regrouping, certificate)})[0]}")
        elif model is None and (kind != "text" or not print_coloured(regrouping, only, recursive, ascii)):
            typer.echo(printed(regrouping, certificate, "recursive" if recursive else kind, only))
    if not certificate.valid:
        typer.echo(str(certificate), err=True)
        raise typer.Exit(NEGATIVE)


def _values(given: list[str]) -> dict[str, str]:
    """{symbol: value} of texts such as q3=pi/2."""
    values = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not (name.strip() and equals and value.strip()):
            fail(f"--value {text!r}; expected NAME=VALUE, e.g. --value q3=pi/2")
        values[name.strip()] = value
    return values


def _numbers(rows: str | None) -> tuple[int, ...] | None:
    """Rows such as 1,2."""
    if rows is None:
        return None
    parts = rows.split(",")
    if not all(part.strip().isascii() and part.strip().isdigit() and len(part.strip()) < 3 for part in parts):
        fail(f"--rows {rows!r}; expected numbers of rows, 1 to 6, e.g. --rows 1,2")
    return tuple(int(part) for part in parts)
