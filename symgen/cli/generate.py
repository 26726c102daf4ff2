"""The command `symgen generate ROBOT...`: derive the models of robots and write modules.

With `--check`, compare with the existing files instead.
"""

from __future__ import annotations

import difflib
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.reporting.result_files import write_all
from symgen.cli import options
from symgen.cli.session import NEGATIVE, described_robot, fail, reported_errors
from symgen.emit.targets import TARGETS

if TYPE_CHECKING:
    from symgen.description import Robot


def generate(
    robots: Annotated[
        list[str],
        typer.Argument(
            metavar="ROBOT...",
            help=(
                "Packaged robots or robot files (.yaml, .par, .urdf, .xml, .mjcf); `all` means every packaged robot."
            ),
        ),
    ],
    output: Annotated[Path, options.output("Folder into which the files are written.")] = Path(
        "generated"
    ),
    target: Annotated[
        str,
        typer.Option(
            help="What to generate; separate several by commas, as in numpy,c. Choices: "
            + ", ".join(
                f"{name} ({t.language}, {t.file.format('NAME', '*')})"
                for name, t in TARGETS.items()
            )
            + "."
        ),
    ] = "numpy",
    with_: Annotated[
        str,
        typer.Option(
            "--with",
            help=(
                "Further functions to generate: coriolis, slotine_li, momentum, energy, "
                "base_wrench_regressor, or several as coriolis,energy."
            ),
        ),
    ] = "",
    at_values: options.AtValues = False,
    exact: options.Exact = False,
    base: options.Base = None,
    check: Annotated[
        bool,
        typer.Option("--check", help="Write nothing; fail with a diff if a module is not current."),
    ] = False,
) -> None:
    """Derive the models of each ROBOT and write them to OUTPUT. Either all files are written or
    none.
    """
    with reported_errors():
        from symgen.derive.models import OPTIONS

        targets = _among(TARGETS, "target", target)
        requested = _among(OPTIONS, "--with", with_) if with_ else ()
        modules = emitted(robots, targets, requested, at_values=at_values, exact=exact, base=base)
        if check:
            report_differences(output, modules)
        else:
            typer.echo("\n".join(map(str, write_all(output, modules))))


def _among(known: Collection[str], what: str, text: str) -> tuple[str, ...]:
    """Split the value of an option at commas; end the program if a word is unknown.

    The error message lists the known words.
    """
    words = tuple(dict.fromkeys(map(str.strip, text.split(","))))
    if unknown := [word for word in words if word not in known]:
        fail(f"{what} {', '.join(map(repr, unknown))}; expected one of {', '.join(known)}")
    return words


def emitted(
    robots: list[str],
    targets: Sequence[str] = ("numpy",),
    requested: Sequence[str] = (),
    *,
    at_values: bool = False,
    exact: bool = False,
    base: str | None = None,
) -> dict[str, str]:
    """Generate the modules of every robot and target; return their texts by file name.

    Raises SymgenError before any file is written.
    """
    from runtime.ground.check import first_names
    from symgen.certify.modules import certified_files
    from symgen.derive.loops import close
    from symgen.description import packaged_robots

    modules: dict[str, str] = {}
    for source in packaged_robots() if robots == ["all"] else robots:
        robot = described_robot(source, at_values, exact, base)
        command = source if source in packaged_robots() else robot.file
        command += " --at-values" * at_values + " --exact" * exact
        command += f" --base {base}" * bool(base)
        command += f" --with {','.join(requested)}" * bool(requested)
        files = certified_files(robot, targets=targets, command=command, options=requested)
        if modules.keys() & files.keys():
            fail(
                f"two robots have the name {robot.name}, so their modules would overwrite each other; rename one robot"
            )
        tied = bool(close(robot).tied)
        for name in targets:
            target = TARGETS[name]
            if tied and not target.iterates:
                said = (
                    f"the target {name} is not possible, because the loops of this robot are "
                    "closed by iteration; use numpy or c"
                )
                typer.echo(f"{robot.name}: {said}", err=True)
            elif target.use:
                file = target.file.format(robot.name, "*")
                typer.echo(f"{file}: {target.use.format(robot.name)}", err=True)
        for name in targets:
            if TARGETS[name].values and (missing := missing_values(robot)):
                typer.echo(
                    f"{TARGETS[name].file.format(robot.name)}: no {TARGETS[name].values.format(robot.name)}, "
                    f"because the robot file has no value of {first_names(missing)}; pass your own X, in "
                    f"the order of {robot.name}_parameters",
                    err=True,
                )
        if robot.loaded:
            typer.echo(
                f"{robot.name}: no forward_dynamics: laws of {', '.join(robot.loaded)} use "
                "tau_model, which depends on the acceleration that forward_dynamics computes",
                err=True,
            )
        modules |= files
    return modules


def missing_values(robot: Robot) -> list[str]:
    """List the standard parameters that the base parameters contain and the robot file does not give."""
    from symgen.regroup.regrouping import regroup

    used = {name for b in regroup(robot).base for name in b.combination}
    return [name for name in robot.parameters if name in used and name not in robot.values]


def report_differences(output: Path, modules: dict[str, str]) -> None:
    """Print the differences between the existing modules and those that would be written.

    The lines of the certificates are compared as well, because a file may be imported or compiled
    with any text in them. Only the ends of lines may be those of Windows. Exit code 1 if a module
    differs or is missing.
    """
    stale = []
    for path, text in ((output / name, text) for name, text in modules.items()):
        present = path.read_bytes().replace(b"\r\n", b"\n") if path.is_file() else None
        if present == text.encode("utf-8"):
            continue
        stale.append(path)
        if present is None:
            typer.echo(f"{path} is missing")
        else:
            now = present.decode("utf-8", "backslashreplace").splitlines(True)
            then = text.splitlines(True)
            lines = difflib.unified_diff(now, then, f"{path} (found)", f"{path} (current)", n=1)
            typer.echo("".join(list(lines)[:200]))
    if stale:
        typer.echo(f"not current: {', '.join(map(str, stale))}; run symgen generate", err=True)
        raise typer.Exit(NEGATIVE)
    typer.echo(f"{len(modules)} modules are current")
