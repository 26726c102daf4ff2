"""`symgen compare ROBOT STUDY ...`: which treatment of the records, and which set of parameters,
predicts a validation record best.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options, session


def compare(
    robot: options.RobotOrModule,
    study: Annotated[
        list[str],
        typer.Argument(
            help="Study files that name the same validate.record, one for each treatment; of one "
            "alone the treatments that suggest themselves."
        ),
    ],
    output: Annotated[
        Path | None, options.folder("comparison.json and the report of the best treatment")
    ] = None,
    trust: options.Trust = False,
    exact: options.Exact = False,
    json: options.Json = False,
) -> None:
    """Identify ROBOT with each treatment, and order them by what they predict of the validation
    record.

    Of one study: as stated, without the rows of joints that stand, with known torques left out. In
    each, the set of parameters that predicts best is taken. Exit code 1 where the best cannot be
    used.
    """
    with session.progress_lines(), session.results_in(output) as results:
        import runtime
        from runtime.core.documents import json_text

        model = session.model_of(robot, trust=trust, exact=exact)
        short = len({Path(one).stem for one in study}) == len(study)
        candidates = {
            Path(one).stem if short else one: session.study_of_arguments([one]) for one in study
        }
        alone = next(iter(candidates.values()))
        ranking = runtime.compare(
            model,
            candidates if len(candidates) > 1 else alone,
            variants=session.variants_of(robot, exact=exact),
        )
        if results is not None:
            runtime.report(ranking, results)
        checklist = ranking.best.checklist
        text = json_text(ranking.summary()) if json else f"{ranking}\n\n{checklist.to_text()}"
        session.show(text, results, json=json)
    session.end(good=checklist.state != "no")
