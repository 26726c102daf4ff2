"""`symgen check ROBOT`: the certificate of the formulas and of the emitted module."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli.described import AT_VALUES, described_robot
from symgen.cli.session import NEGATIVE, reported_errors, single_thread


def check(
    robot: Annotated[str, typer.Argument(help="Packaged robot or robot file (.yaml, .par, .urdf).")],
    at_values: Annotated[bool, typer.Option("--at-values", help=AT_VALUES)] = False,
    json: Annotated[bool, typer.Option("--json", help="Print the certificate as JSON.")] = False,
) -> None:
    """Verify ROBOT: exact rank, identities at fresh geometry, numeric rank and torques by CasADi energies, the emitted module."""
    single_thread()
    with reported_errors():
        from json import dumps

        from symgen.emit.certified import certify
        from symgen.regroup.regrouping import regroup

        described = described_robot(robot, at_values)
        certificate = certify(regroup(described))
        typer.echo(dumps(certificate.mapping(), indent=2) if json else str(certificate))
    if not certificate.valid:
        raise typer.Exit(NEGATIVE)
