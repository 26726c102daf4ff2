"""The command `symgen show ROBOT`: print base parameters or symbolic models, or write a page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from runtime.reporting.result_files import write_all
from symgen.cli import options
from symgen.cli.session import described_robot, fail, reported_errors

if TYPE_CHECKING:
    from symgen.description import Robot
    from symgen.regroup.regrouping import Regrouping

FORMATS = ("text", "latex", "latex-fragment", "json", "sympy")
OF_MODELS = ("latex-fragment", "sympy")


def _packaged(wanted: bool) -> None:
    if wanted:
        from symgen.description import load_robot, packaged_robots

        names = packaged_robots()
        for name in names:
            typer.echo(f"{name:{max(map(len, names))}}  {load_robot(name).title}")
        raise typer.Exit


def show(
    robot: options.RobotFile,
    model: Annotated[
        str | None,
        typer.Option(
            help="A model in symbols: pose, jacobian, inertia_matrix, inverse_dynamics, gravity, "
            "...; a wrong name prints the list."
        ),
    ] = None,
    frame: Annotated[
        int | None,
        typer.Option(help="Frame in which a pose, Jacobian or twist is expressed. Default: 0."),
    ] = None,
    of: Annotated[
        int | None,
        typer.Option(help="Frame whose pose, Jacobian or twist is shown. Default: the last frame."),
    ] = None,
    rows: Annotated[
        str | None,
        typer.Option(
            help="With --model determinant: rows of the Jacobian that form the square matrix, e.g. 1,2."
        ),
    ] = None,
    form: Annotated[
        str | None,
        typer.Option(
            help="closed: each entry of the model as one formula, factored by parameter. recursive: "
            "the equations link by link, with intermediate variables, as SYMORO prints. Default: "
            "closed."
        ),
    ] = None,
    parameters: Annotated[
        str | None, typer.Option(help="base or standard parameters. Default: base.")
    ] = None,
    value: Annotated[
        list[str] | None,
        typer.Option(help="Value of a symbol, e.g. q3=pi/2 or D3=0.225; may be repeated."),
    ] = None,
    passive: Annotated[
        str | None,
        typer.Option(
            help="Print the positions of passive joints of loops as `functions` of the actuated joints, or as `symbols`."
        ),
    ] = None,
    format: Annotated[
        str,
        typer.Option(
            help="text, latex or json. With --model also sympy, or latex-fragment (LaTeX without a document around it)."
        ),
    ] = "text",
    at_values: options.AtValues = False,
    exact: options.Exact = False,
    base: options.Base = None,
    only: Annotated[
        str | None, typer.Option(help="Print only the formula of this base parameter, e.g. XX2R.")
    ] = None,
    recursive: Annotated[
        bool,
        typer.Option(
            "--recursive",
            help="Print the formulas link by link, each in terms of the next link, as SYMORO does. Without it, each formula is written in full.",
        ),
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="Same as --format json.")] = False,
    html: Annotated[
        bool,
        typer.Option(
            "--html",
            help="Write one HTML page with the robot in 3D, its frames and formulas; it needs no network.",
        ),
    ] = False,
    output: Annotated[
        Path | None,
        options.output("File of the page. Default: <name>.html."),
    ] = None,
    packaged: Annotated[
        bool,
        typer.Option(
            "--packaged",
            callback=_packaged,
            is_eager=True,
            help="List the packaged robots, whose names every command accepts as ROBOT.",
        ),
    ] = False,
) -> None:
    """Print the base parameters of ROBOT with their regrouping formulas, and the parameters without effect.

    --json adds the operations of every model. With --model, print a model in symbols.
    """
    kind = "json" if json else format
    of_model = {
        "of": of,
        "frame": frame,
        "rows": rows,
        "form": form,
        "parameters": parameters,
        "value": value,
        "passive": passive,
    }
    asked = {name: x for name, x in of_model.items() if x is not None}
    formulas = only or recursive
    conflicts = {
        "--html shows everything; leave out --format, --only, --recursive, --json and --model": (
            html and (formulas or model or kind != "text")
        ),
        "-o is only for --html; the other formats are printed, so leave out -o": output
        and not html,
        f"format {kind!r}; expected one of {', '.join(FORMATS)}"
        f"{'; for a page use --html' * (kind == 'html')}": kind not in FORMATS,
        "--recursive prints every step as text; leave out --format and --only": (
            recursive and not model and (kind != "text" or only)
        ),
        "--only and --recursive are for base parameters; for a model use --form recursive": (
            model and formulas
        ),
        "--frame, --of, --rows, --form, --parameters, --value, --passive and --format sympy or "
        "latex-fragment need --model": not model and (asked or kind in OF_MODELS),
    }
    for message, given in conflicts.items():
        if given:
            fail(message)
    with reported_errors():
        described = described_robot(robot, at_values, exact, base)
        if model is not None:
            typer.echo(model_text(described, model, kind, asked, at_values))
        else:
            regrouping = regrouping_of(described, decimals=at_values)
            if html:
                typer.echo(page_file(regrouping, output))
            else:
                from symgen.pages.formulas import printed

                typer.echo(printed(regrouping, "recursive" if recursive else kind, only))


def regrouping_of(robot: Robot, *, decimals: bool) -> Regrouping:
    """Compute the base parameters of a robot.

    decimals : whether to write coefficients without symbols as decimal numbers.
    """
    from symgen.regroup.regrouping import regroup

    regrouping = regroup(robot)
    if decimals:
        from symgen.symbols.expressions import in_decimals

        regrouping = in_decimals(regrouping)
    return regrouping


def page_file(regrouping: Regrouping, output: Path | None) -> Path:
    """Write the page of a robot to `output`, by default <name>.html; return its path."""
    from symgen.pages.page import robot_page

    path = output or Path(f"{regrouping.robot.name}.html")
    return write_all(path.parent, {path.name: robot_page(regrouping)})[0]


def model_text(
    robot: Robot, model: str, kind: str, asked: Mapping[str, Any], decimals: bool = False
) -> str:
    """Return a symbolic model of a robot, such as its inertia matrix, as text in one of the formats
    of `symgen show`.

    asked : options of --model that the user gave.
    decimals : whether to write coefficients without symbols as decimal numbers.
    """
    from symgen.symbols.symbolic import symbolic

    given = dict(asked)
    of_robot = {name: given.pop(name) for name in ("parameters", "passive") if name in given}
    models = symbolic(robot, values=_values(given.pop("value", ())), decimals=decimals, **of_robot)
    if "rows" in given:
        given["rows"] = _numbers(given["rows"])
    return models.show(model, format=kind, **given)


def _values(given: list[str]) -> dict[str, str]:
    """Convert texts such as q3=pi/2 to a mapping of symbol to value."""
    values = {}
    for text in given:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            fail(f"--value {text!r}; expected NAME=VALUE, e.g. --value q3=pi/2")
        values[name] = value
    return values


def _numbers(rows: str) -> tuple[int, ...]:
    """Convert a text of row numbers, such as 1,2, to a tuple of integers."""
    parts = [part.strip() for part in rows.split(",")]
    if not all(part.isascii() and part.isdigit() and len(part) < 3 for part in parts):
        fail(f"--rows {rows!r}; expected numbers of rows, 1 to 6, e.g. --rows 1,2")
    return tuple(map(int, parts))
