"""`symgen compare ROBOT STUDY ...`: which treatment of the records, and which set of parameters, predicts a validation record best."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from runtime.result_files import reserved
from symgen.cli import session
from symgen.cli.session import NEGATIVE, ROBOT, reported_errors, single_thread

STUDIES = "Study files that name the same validate.record, one for each treatment; of one alone the treatments that suggest themselves."


def compare(
    robot: Annotated[str, typer.Argument(help=ROBOT)],
    study: Annotated[list[str], typer.Argument(help=STUDIES)],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for comparison.json and the report of the best treatment.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print comparison.json instead of the table.")] = False,
) -> None:
    """Identify ROBOT with each treatment, and order them by what they predict of the validation record.

    Of one study: as stated, without the rows of joints that stand, with known torques left out. In each, the essential, the physical or all
    parameters are taken, whichever predict best. Exit code 1 where the best cannot be used.
    """
    single_thread()
    with reported_errors(), session.progress_lines(), reserved(output) as results:
        import runtime
        from runtime.json_documents import json_text

        model = session.model_of(robot)
        short = len({Path(one).stem for one in study}) == len(study)
        candidates = {Path(one).stem if short else one: session.study_of_arguments([one]) for one in study}
        alone = next(iter(candidates.values()))
        ranking = runtime.compare(model, candidates if len(candidates) > 1 else alone, variants=session.variants_of(robot))
        if results is not None:
            runtime.report(ranking, results)
        best = ranking.best
        text = json_text(ranking.summary()) if json else f"{ranking}\n\n{best.checklist.to_text()}"
        session.show(text, output, json=json)
    if best.checklist.state == "no":
        raise typer.Exit(NEGATIVE)
