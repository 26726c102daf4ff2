"""The command `symgen apply RESULTS MODEL`: write identified values into a URDF or MJCF file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options
from symgen.cli.session import fail, reported_errors


def apply(
    results: Annotated[
        Path, typer.Argument(help="Folder of `symgen identify -o`, or its estimate.json.")
    ],
    model: Annotated[
        Path,
        typer.Argument(
            help="File into which the values are written: .urdf, or MJCF as .xml or .mjcf."
        ),
    ],
    output: Annotated[Path | None, options.output("File to write; MODEL stays as it is.")] = None,
    in_place: Annotated[
        bool, typer.Option("--in-place", help="Overwrite MODEL instead of writing another file.")
    ] = False,
    robot: Annotated[
        str | None,
        typer.Option(
            help="Robot file that you converted from MODEL and identified; not needed if you identified MODEL itself. Give the same --exact, --lock and --chain as for the conversion."
        ),
    ] = None,
    exact: options.Exact = False,
    base: options.Base = None,
    lock: options.Lock = None,
    chain: options.Chain = None,
    diff: Annotated[
        bool,
        typer.Option(
            "--diff",
            help="Print the changed lines of the file (a diff) instead of the table of values.",
        ),
    ] = False,
    json: options.Json = False,
    force: options.Force = False,
) -> None:
    """Write masses, centres, inertias, friction and motor inertia of RESULTS into MODEL. Only
    numbers change; every other byte stays. Without -o or --in-place, print what would change.

    The file is written whole or not at all, and only with values that a physical robot can have.
    Otherwise the command ends with exit code 2 and the reason.
    """
    with reported_errors():
        from symgen.description.values import assignment
        from symgen.update.apply import apply as applied_to

        if output is not None and in_place:
            fail(
                "-o FILE writes a new file and --in-place changes MODEL; give only one of the two options"
            )
        if output is not None and output.exists() and not force:
            fail(f"{output} exists already; choose another name or add --force")
        beside = copied_loops(model, output, force)
        locked = dict(assignment(text, "--lock") for text in lock or ())
        applied = applied_to(
            results, model, robot=robot, lock=locked, chain=chain, exact=exact, base=base
        )
        typer.echo(
            applied.to_json() if json else applied.diff() if diff else str(applied), nl=not json
        )
        if output is None and not in_place:
            ways = f"-o FILE writes another file, --in-place writes {model.name}"
            typer.echo(f"nothing is written; {ways}", err=True)
            return
        path = applied.write(output or model)
        typer.echo(f"written: {path.name if output is None else output}", err=True)
        for place, content in beside.items():
            place.write_bytes(content)
            typer.echo(f"written: {place}, the loops of {model.name}", err=True)
        if path.parent != model.resolve().parent and applied.names_files:
            typer.echo(
                f"note: {output} lies in another folder than {model.name}; mesh paths in it "
                "did not change",
                err=True,
            )


def copied_loops(model: Path, output: Path | None, force: bool) -> dict[Path, bytes]:
    """Return the file with the loops of `model`, at the place where `output` needs this file, if it
    is missing there.
    """
    from symgen.description.files import loops_beside

    text = loops_beside(model) if output is not None else None
    if text is None or output is None:
        return {}
    own = output.with_suffix(".loops.yaml")
    place = own if text.file.endswith(".loops.yaml") else output.parent / text.file
    if not place.exists():
        return {place: text.content}
    if place.read_bytes() != text.content and not force:
        fail(f"{place} has other loops than {model.name}; choose another name or add --force")
    return {} if place.read_bytes() == text.content else {place: text.content}
