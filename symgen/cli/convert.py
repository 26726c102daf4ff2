"""`symgen convert IN OUT`: a robot from one format into another, with a report of what the target cannot carry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.result_files import write_all
from symgen.cli.session import fail, reported_errors
from symgen.cli.snippet import with_estimate

if TYPE_CHECKING:
    from symgen.description import Robot

SUFFIXES = (".yaml", ".yml", ".par", ".urdf")


def convert(
    source: Annotated[str, typer.Argument(metavar="IN", help="Packaged robot, or a file: .yaml, .par, .urdf, .xml or .mjcf (MJCF).")],
    output: Annotated[Path, typer.Argument(metavar="OUT", help="File to write; its suffix names the format: .yaml, .par, .urdf.")],
    constant: Annotated[list[str] | None, typer.Option(help="Value of a symbol of a .par file, D3=0.45 (SI, rad); repeat.")] = None,
    snap: Annotated[
        float,
        typer.Option(
            min=0, max=0.1, help="Angles of a URDF this close (rad) to a multiple of pi/12 become that: 1e-4 reads 1.5708 as pi/2."
        ),
    ] = 0.0,
    keep_fixed: Annotated[
        bool, typer.Option("--keep-fixed", help="Of a URDF or MJCF: links that fixed joints hold (tool0, flange) are frames of their own.")
    ] = False,
    values: Annotated[
        Path | None,
        typer.Option(help="Standard parameters for OUT: a CSV of name,value, as standard_parameters.csv of a feasible estimate."),
    ] = None,
    estimate: Annotated[
        Path | None, typer.Option(help="The same from estimate.json of a feasible estimate (study: estimate: {method: feasible}).")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace OUT if it exists.")] = False,
) -> None:
    """Write the robot IN in the format of OUT, and say what was read otherwise than written and what OUT does not carry.

    OUT is written whole or not at all; where the target would hold another mechanism nothing is written, exit code 2.
    """
    with reported_errors():
        if output.suffix.lower() not in SUFFIXES:
            fail(f"{output}: expected a file name that ends in {', '.join(SUFFIXES)}")
        if output.exists() and not force:
            fail(f"{output} exists already; choose another name or add --force")
        from symgen.description import read_robot

        robot, read = read_robot(source, constants=dict(map(_constant, constant or ())), nearly=snap, keep_fixed=keep_fixed)
        if values is not None:
            robot = replace(robot, values={**robot.values, **_values(values)})
        if estimate is not None:
            robot = with_estimate(robot, estimate)
        text, written = _text(robot, output, read)
        write_all(output.parent, {output.name: text})
        typer.echo(f"{output}: {robot.name}, {len(robot.joints)} joints, {len(robot.parameters)} standard parameters")
        for head, notes in ((f"read from {source}", read), (f"not carried by {output.name}", written)):
            if notes:
                typer.echo("\n".join([f"{head}:", *(f"  - {note}" for note in notes)]))


def _constant(text: str) -> tuple[str, float]:
    from symgen.description import parse

    name, equals, value = text.partition("=")
    if not (name.strip() and equals):
        fail(f"--constant {text}; expected NAME=NUMBER")
    try:
        return name.strip(), float(parse(value, ()))
    except (ValueError, ZeroDivisionError, OverflowError):
        fail(f"--constant {text}; expected NAME=NUMBER")


def _values(file: Path) -> dict[str, float]:
    """name,value rows of a CSV; the header may be there."""
    import csv
    from math import isfinite

    from runtime.files import read_bytes

    found: dict[str, float] = {}
    try:
        rows = list(csv.reader(read_bytes(file).decode("utf-8-sig").splitlines()))
    except (UnicodeDecodeError, csv.Error) as e:
        fail(f"{file}: {e}; expected lines of name,value")
    for line, row in enumerate(rows, start=1):
        if row in ([], ["name", "value"]):
            continue
        try:
            name, value = row
            found[name] = float(value)
        except ValueError:
            fail(f"{file}, line {line}: found {','.join(row)[:60]!r}; expected name,value")
        if not isfinite(found[name]):
            fail(f"{file}, line {line}: {name[:60]} is {value[:60]}; expected a finite number")
    if not found:
        fail(f"{file}: no values; expected lines of name,value")
    return found


def _text(robot: Robot, output: Path, read: tuple[str, ...]) -> tuple[str, tuple[str, ...]]:
    """Text of the file and what it does not carry."""
    from symgen.description import write_par, write_yaml
    from symgen.description.urdf_write import write_urdf

    if output.suffix.lower() == ".urdf":
        return write_urdf(robot)
    if output.suffix.lower() == ".par":
        return write_par(robot)
    return write_yaml(robot, comments=[f"Converted from {robot.file}.", *read]), ()
