"""The command `symgen simulate ROBOT STUDY`: simulate a closed loop and write its record."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options, session
from symgen.update.models import corrected, model_of


def simulate(
    robot: options.RobotOrModule,
    study: Annotated[
        str,
        typer.Argument(
            help="Study file with a section `controller`, or a dataset whose study has this section."
        ),
    ],
    output: Annotated[
        Path | None, options.folder("simulated.csv, study.yaml, simulation.json and the figure")
    ] = None,
    ideal: Annotated[
        bool,
        typer.Option(
            "--ideal",
            help="Simulate without noise and without the quantisation of encoder and analogue-digital converter.",
        ),
    ] = False,
    trust: options.Trust = False,
    exact: options.Exact = False,
    json: options.Json = False,
) -> None:
    """Simulate ROBOT under the controller of STUDY. Parameters are the values of the robot file, or
    those of `controller.values`.

    The simulated record is written in a form that `identify` reads, with the reference in the columns
    qr1 ..., and study.yaml names this record.
    """
    with session.results_in(output) as results:
        import runtime
        from runtime.ground.documents import json_text

        described = session.robot_of(robot, trust=trust, exact=exact)
        settings = session.study_of_arguments([study], recorded=False)
        model = model_of(corrected(described, settings))
        if settings.controller is None:
            session.fail(
                f"{study} has no section `controller`; add this section, with law, rate and reference "
                "of the closed loop"
            )
        result = runtime.simulate(model, settings, ideal=ideal)
        if results is not None:
            runtime.report(result, results, study=settings)
        session.show(json_text(result.summary()) if json else result.to_table(), json=json)
