"""The command `symgen compare ROBOT STUDY ...`: rank studies by their prediction error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options, session
from symgen.update.models import corrected, model_of, variants_of


def compare(
    robot: options.RobotOrModule,
    study: Annotated[
        list[str],
        typer.Argument(
            help="Two or more study files to compare, all with the same validate.record."
        ),
    ],
    output: Annotated[
        Path | None, options.folder("comparison.json and the report of the best treatment")
    ] = None,
    trust: options.Trust = False,
    exact: options.Exact = False,
    base: options.Base = None,
    json: options.Json = False,
) -> None:
    """Identify ROBOT with the settings of each STUDY, and rank the studies by how well they predict
    the validation record.

    Each study uses the set of parameters that predicts best. The exit code is 1 if the best study cannot
    be used.
    """
    with session.progress_lines(), session.results_in(output) as results:
        import runtime
        from runtime.ground.documents import json_text
        from runtime.ground.errors import InputError

        described = session.robot_of(robot, trust=trust, exact=exact, base=base)
        if len(study) < 2:
            raise InputError(
                f"{study[0]}: only one study is given; name two or more study files to compare"
            )
        short = len({Path(one).stem for one in study}) == len(study)
        candidates = {
            Path(one).stem if short else one: session.study_of_arguments([one]) for one in study
        }
        first = next(iter(candidates.values()))
        described = corrected(described, first)
        model = model_of(described, study=first)
        ranking = runtime.compare(model, candidates, variants=variants_of(described))
        if results is not None:
            runtime.report(ranking, results)
        checklist = ranking.best.checklist
        text = json_text(ranking.summary()) if json else f"{ranking}\n\n{checklist.to_text()}"
        session.show(text, results, json=json)
    session.end(good=checklist.state != "no")
