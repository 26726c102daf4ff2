"""`symgen generate ROBOT...`: derive, regroup, emit; `--check` compares with the files that are there."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from runtime.result_files import write_all
from symgen.cli.described import AT_VALUES, described_robot
from symgen.cli.session import NEGATIVE, fail, reported_errors
from symgen.emit.targets import TARGETS


def generate(
    robots: Annotated[
        list[str],
        typer.Argument(metavar="ROBOT...", help="Packaged robots or robot files (.yaml, .par, .urdf); `all` for every packaged one."),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the modules.")] = Path("generated"),
    target: Annotated[
        str, typer.Option(help="What to emit: numpy, casadi, c, xp (arrays of any package), or several as numpy,c.")
    ] = "numpy",
    at_values: Annotated[bool, typer.Option("--at-values", help=AT_VALUES)] = False,
    check: Annotated[bool, typer.Option("--check", help="Write nothing; fail with a diff where a module is not current.")] = False,
) -> None:
    """Derive the models of each ROBOT and write them as OUTPUT/<name>.py, _casadi.py, .c or _xp.py. All are written, or none."""
    with reported_errors():
        targets = tuple(dict.fromkeys(part.strip() for part in target.split(",")))
        if unknown := [part for part in targets if part not in TARGETS]:
            fail(f"target {', '.join(map(repr, unknown))}; there is {', '.join(TARGETS)}")
        modules = emitted(robots, targets, at_values)
        if check:
            report_differences(output, modules)
            return
        for path in write_all(output, modules):
            typer.echo(f"{path}")


def emitted(robots: list[str], targets: Sequence[str] = ("numpy",), at_values: bool = False) -> dict[str, str]:
    """{file name: text} of every robot and target. Raises SymgenError before anything is written."""
    from symgen.description import packaged_robots
    from symgen.emit.certified import certified_files

    modules: dict[str, str] = {}
    for source in packaged_robots() if robots == ["all"] else robots:
        robot = described_robot(source, at_values)
        command = (source if source in packaged_robots() else robot.file) + " --at-values" * at_values
        files = certified_files(robot, targets=targets, command=command)
        if modules.keys() & files.keys():
            fail(f"two robots are called {robot.name}; their modules would overwrite each other")
        for left_out in (t for t in targets if TARGETS[t].file.format(robot.name) not in files):
            typer.echo(f"{robot.name}: no {left_out} target, its loops are closed by iteration; the NumPy module serves", err=True)
        modules |= files
    return modules


def report_differences(output: Path, modules: dict[str, str]) -> None:
    """Print a unified diff of every module that is not what would be written; exit code 1 if there is one."""
    stale = []
    for name, text in modules.items():
        path = output / name
        if not path.is_file():
            stale.append(path)
            typer.echo(f"{path} is missing")
            continue
        found = path.read_text(encoding="utf-8")
        if found != text:
            stale.append(path)
            lines = difflib.unified_diff(found.splitlines(True), text.splitlines(True), f"{path} (found)", f"{path} (current)", n=1)
            typer.echo("".join(list(lines)[:200]))
    if stale:
        typer.echo(f"not current: {', '.join(map(str, stale))}; run symgen generate", err=True)
        raise typer.Exit(NEGATIVE)
    typer.echo(f"{len(modules)} modules are current")
