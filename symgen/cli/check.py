"""The command `symgen check ROBOT`: verify the formulas of a robot and its generated module."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from runtime.reporting.result_files import write_all
from symgen.cli import options
from symgen.cli.session import described_robot, end, reported_errors


def check(
    robot: options.RobotFile,
    at_values: options.AtValues = False,
    exact: options.Exact = False,
    base: options.Base = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Print every check with its numbers.")
    ] = False,
    json: options.Json = False,
    claim: Annotated[
        Path | None,
        typer.Option(
            "--certificate",
            help="Write what the certificate states (rank, formulas, hashes of the files) as JSON, so that others can verify it.",
        ),
    ] = None,
) -> None:
    """Verify the base parameters of ROBOT by exact rank, by numeric rank and by identities at
    random lengths. Verify every function of the NumPy module by an independent computation.
    """
    with reported_errors():
        from json import dumps

        from symgen.certify.claim import claim as claimed
        from symgen.certify.modules import certify
        from symgen.regroup.regrouping import regroup

        regrouping = regroup(described_robot(robot, at_values, exact, base))
        certificate = certify(regrouping)
        if claim is not None:
            text = dumps(claimed(regrouping, certificate), indent=1)
            write_all(claim.parent, {claim.name: text + "\n"})
        text = str(certificate) if verbose else certificate.brief()
        typer.echo(dumps(certificate.mapping(), indent=2) if json else text)
    end(good=certificate.valid)
