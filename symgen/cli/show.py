"""`symgen show ROBOT`: base parameters with their regrouping formulas, as text, LaTeX or JSON; or a page to look at."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from runtime.result_files import write_all
from symgen.cli.doubts import tell_doubts
from symgen.cli.session import fail, reported_errors

if TYPE_CHECKING:
    from rich.text import Text

    from symgen.regroup.regrouping import BaseParameter, Regrouping

FORMATS = ("text", "latex", "json")


def show(
    robot: Annotated[str, typer.Argument(help="Packaged robot or robot file (.yaml, .par, .urdf).")],
    format: Annotated[str, typer.Option(help="text, latex or json.")] = "text",
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

    On a terminal in colour and with subscripts; plain text where it is piped, or with NO_COLOR set.
    """
    with reported_errors():
        if html and (only or recursive or json or format != "text"):
            fail("--html shows everything; leave out --format, --only, --recursive and --json")
        if html:
            typer.echo(f"{write_page(robot, output)}")
            return
        if output is not None:
            fail("-o names the file of --html; the other formats are printed")
        kind = "json" if json else format
        if kind not in FORMATS:
            fail(f"format {kind!r}; expected one of {', '.join(FORMATS)}{'; the page is --html' if kind == 'html' else ''}")
        if recursive and (kind != "text" or only):
            fail("--recursive prints every step as text; leave out --format and --only")
        from symgen.description import load_robot
        from symgen.regroup.regrouping import regroup

        described = load_robot(robot)
        tell_doubts(described)
        regrouping = regroup(described)
        if only is not None and only not in regrouping.names:
            same = [name for name in regrouping.names if name.lower() == only.lower()]
            close = same or difflib.get_close_matches(only, regrouping.names, n=5, cutoff=0.4)
            fail(
                f"{only!r} is no base parameter of {regrouping.robot.name}; close: {', '.join(close) or 'none'} (all: symgen show {robot})"
            )
        if kind == "text" and print_coloured(regrouping, only, recursive, ascii):
            return
        if recursive:
            typer.echo("\n".join(f"{name} = {text}" for name, text in recursive_formulas(regrouping)))
        else:
            typer.echo({"text": flat_text, "latex": latex_text, "json": json_text}[kind](regrouping, only))


def write_page(robot: str, output: Path | None) -> Path:
    """The page of ROBOT, whole or not at all; its path."""
    from symgen.description import load_robot
    from symgen.regroup.regrouping import regroup
    from symgen.report.page import robot_page

    described = load_robot(robot)
    tell_doubts(described)
    regrouping = regroup(described)
    path = output or Path(f"{regrouping.robot.name}.html")
    return write_all(path.parent, {path.name: robot_page(regrouping)})[0]


def chosen(regrouping: Regrouping, only: str | None) -> list[BaseParameter]:
    return [b for b in regrouping.base if only is None or b.name == only]


def flat_text(regrouping: Regrouping, only: str | None) -> str:
    """Aligned formulas as eq. (27); parameters that absorb nothing in one list; parameters without effect; counts and costs."""
    from symgen.emit.header import wrapped

    base = chosen(regrouping, only)
    width = max(len(b.name) for b in base)
    lines = []
    for b in base:
        if only or b.name != b.own:
            lines += wrapped(f"{b.name:<{width}} = {b.formula}", "", " " * (width + 3))
    if only:
        return "\n".join(lines)
    alone = " ".join(b.name for b in base if b.name == b.own)
    return "\n".join(
        [title(regrouping), "", *relation_lines(regrouping), *lines, "", *wrapped("as they are: " + alone, ""), "", *wrapped("no effect: " + (" ".join(regrouping.no_effect) or "none"), ""), "",
         "operations per sample", *operation_lines(regrouping)]
    )  # fmt: skip


def print_coloured(regrouping: Regrouping, only: str | None, recursive: bool, ascii: bool) -> bool:
    """Print for a reader at a terminal; False where there is none."""
    from symgen.cli.formula_text import FormulaText, terminal

    console = terminal()
    if console is None:
        return False
    robot = regrouping.robot
    plain = ascii or not console.encoding.startswith("utf")
    text = FormulaText(robot, console.width, ascii=plain)
    base = chosen(regrouping, only)
    formulas = recursive_formulas(regrouping) if recursive else [(b.name, b.formula) for b in base if only or b.name != b.own]
    column = max((len(name) for name, _ in formulas), default=0)
    lines: list[Text | str] = [text.definition(name, formula, column) for name, formula in formulas]
    if not only and not recursive:
        console.print(title(regrouping), style="bold", markup=False)
        alone = [b.name for b in base if b.name == b.own]
        lists = [text.listed(head, names) for head, names in (("as they are", alone), ("no effect", regrouping.no_effect)) if names]
        lines = [
            "",
            *relation_lines(regrouping),
            *lines,
            "",
            *lists,
            "",
            text.legend(),
            "",
            "operations per sample",
            *operation_lines(regrouping),
        ]
    for line in lines:
        console.print(line, soft_wrap=True, markup=False)
    return True


def title(regrouping: Regrouping) -> str:
    """What the robot is and how many of its parameters are base ones."""
    robot = regrouping.robot
    return f"{robot.title or robot.name}: {len(regrouping)} base parameters of {len(robot.parameters)}, {regrouping.method}"


def relation_lines(regrouping: Regrouping) -> list[str]:
    """The passive joints as functions of others, and an empty line; nothing where there are none."""
    from symgen.emit.header import loop_lines

    robot = regrouping.robot
    return [f"passive: {line}" for line in loop_lines(robot)[len(robot.loops) :]] + [""] if robot.passive else []


def operation_lines(regrouping: Regrouping) -> list[str]:
    """A line per model."""
    return [f"  {name:<26} {cost['mul']:>5} multiplications {cost['add']:>5} additions" for name, cost in costs(regrouping).items()]


def recursive_formulas(regrouping: Regrouping) -> list[tuple[str, str]]:
    """(name, formula) per parameter that receives others, in terms of what those had already received: XXR_i = XX_i + YYR_j + ..."""
    from symgen.description.expression import ONE
    from symgen.regroup.regrouping import formula

    received: dict[str, dict[str, Any]] = {}
    for source, target, coefficient in regrouping.steps:
        if target in regrouping.no_effect:
            continue
        received.setdefault(target, {})[source] = coefficient

    def name(p: str) -> str:
        return p + "R" if p in received else p

    lines = []
    for p in reversed(regrouping.robot.parameters):
        if p in received:
            terms = {p: ONE} | {name(source): c for source, c in received[p].items() if c}
            lines.append((name(p), formula(terms)))
    return lines


def latex_text(regrouping: Regrouping, only: str | None) -> str:
    r"""The formulas in an `aligned` environment with subscripts, ZZ_{1R} &= ZZ_{1} + I_{a1} + ..."""
    from symgen.report.latex import latex_formula, latex_name

    rows = [f"{latex_name(b.name)} &= {latex_formula(b.combination)} \\\\" for b in chosen(regrouping, only) if only or b.name != b.own]
    return "\n".join(["\\begin{aligned}", *rows, "\\end{aligned}"])


def costs(regrouping: Regrouping) -> dict[str, dict[str, int]]:
    """Operations of the emitted text: all base columns, inertial (and Ia) ones alone."""
    from symgen.emit.printers import Text
    from symgen.emit.spec import inverse_dynamics, is_inertial, is_inertial_or_actuator, regressor_program

    robot = regrouping.robot
    inertial = tuple(own for own in regrouping.own if is_inertial_or_actuator(robot)(own))
    result = {}
    for name, own in (("regressor", regrouping.own), ("regressor_inertial", inertial)):
        _, program = regressor_program(regrouping, own)
        result[name] = dict(zip(("mul", "add"), Text(program.outputs, program.sections, ()).operations, strict=True))
    for name, model in (
        ("inverse_dynamics", inverse_dynamics(regrouping)),
        ("inverse_dynamics_inertial", inverse_dynamics(regrouping, is_inertial(robot))),
    ):
        result[name] = {"mul": model.mul, "add": model.add}
    return result


def json_text(regrouping: Regrouping, only: str | None) -> str:
    """The contract of `show --format json`."""
    import json

    from symgen.regroup.certificate import certify

    document = {
        "name": regrouping.robot.name,
        "count": len(regrouping),
        "standard_count": len(regrouping.robot.parameters),
        "method": regrouping.method,
        "base_parameters": [
            {
                "name": b.name,
                "formula": b.formula,
                "terms": [{"parameter": name, "coefficient": str(c)} for name, c in b.combination.items()],
            }
            for b in chosen(regrouping, only)
        ],
        "no_effect": list(regrouping.no_effect),
        "operations": costs(regrouping),
        "certificate": certify(regrouping).mapping(),
    }
    return json.dumps(document, indent=2, ensure_ascii=False)
