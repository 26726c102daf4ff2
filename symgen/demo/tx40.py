"""`symgen demo`: the main job end to end, from the robot file of the TX40 to a report, on the measured record or, without it, on a simulated one."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from runtime.result_files import reserved
from symgen.cli.session import opened_model, reported_errors, single_thread, study_text

if TYPE_CHECKING:
    from runtime.model.generated import GeneratedModel
    from runtime.records.record import Record
    from runtime.result_files import Results
    from runtime.settings.study import Study
    from symgen.demo.demonstration import Demonstration

ROBOT, DATASET = "tx40", "tx40"
SEED = 1
DURATION, SHORT = 9.0, 4.0  # s of the simulated record, and of that of the quick form


class Demo(StrEnum):
    """Robots of the chapter."""

    tx40 = "tx40"
    haptic = "haptic"


def demo(
    robot: Annotated[Demo, typer.Argument(help="The robot of the chapter that is shown.")] = Demo.tx40,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.")] = Path("symgen-demo"),
    quick: Annotated[bool, typer.Option("--quick", help="Two runs per step and no further studies.")] = False,
) -> None:
    """Identify the Stäubli TX40 (or the haptic interface, simulated) and judge its encoder resolution, beside the published tables."""
    single_thread()
    with reported_errors(), reserved(output) as results:
        if robot is Demo.haptic:
            from symgen.demo.haptic import demo_haptic

            demo_haptic(results, quick)
        else:
            demo_tx40(results, quick)


def demo_tx40(results: Results, quick: bool) -> None:
    """The demo of the TX40."""
    with opened_model(ROBOT) as model:
        from symgen.demo.demonstration import demonstrate

        study, record, extra, missing = measured_or_simulated(model, results.folder, quick)
        if missing:
            typer.echo(
                f"No measured record: {missing}\nContinuing on a SIMULATED record made on the spot; nothing below was measured.\n", err=True
            )
        shown = demonstrate(model, study, record, quick=quick, step=lambda text: typer.echo(f"  {text}", err=True))
        results.write_all({**demo_files(shown, study_text(shown.found.study, results.folder, results.folder)), **extra})
        typer.echo(verdict(shown))
        typer.echo(f"report: {results.folder / 'report.html'}")


def measured_or_simulated(model: GeneratedModel, output: Path, quick: bool) -> tuple[Study, Record, dict[str, bytes], str]:
    """Study and record; where the measured one cannot be had: a simulated one, its file, and why."""
    from runtime.errors import DataUnavailableError
    from runtime.records.datasets import dataset_study
    from runtime.records.reading import read_records
    from runtime.settings.study import study_from_mapping

    study = study_from_mapping(dataset_study(DATASET))
    try:
        return study, read_records(study.record, model)[0], {}, ""
    except DataUnavailableError as e:
        study, record, file = simulated_study(model, study, SHORT if quick else DURATION)
        return study, record, file, str(e)


def simulated_study(model: GeneratedModel, study: Study, duration: float) -> tuple[Study, Record, dict[str, bytes]]:
    """The same settings on a simulated record, which takes the way through its file like any other."""
    from dataclasses import replace
    from tempfile import TemporaryDirectory

    from runtime.records.reading import read_records
    from runtime.settings.study import ValidateSettings
    from symgen.demo.simulated_record import FILE, motor_record

    content, settings = motor_record(model, duration, SEED)
    study = replace(study, record=(settings,), rows=replace(study.rows, window=(0.0, duration)), validate=ValidateSettings())
    with TemporaryDirectory(prefix="symgen-") as folder:
        (Path(folder) / FILE).write_bytes(content)
        record = read_records(study.record, model, folder=Path(folder))[0]
    return study, record, {FILE: content}


def verdict(shown: Demonstration) -> str:
    """What the demo found, in one sentence."""
    found, levels = shown.found, shown.resolution.levels
    order: dict[str, list[str]] = {"unbiased": [], "doubtful": [], "biased": []}
    for level in levels:
        order[level.residual_verdict].append(level.level.label)
    words = {"unbiased": "keep it practically unbiased", "doubtful": "make it doubtful", "biased": "bias it"}
    steps = ", ".join(f"encoder steps of {' and '.join(labels)} {words[key]}" for key, labels in order.items() if labels)
    label = "SIMULATED record: " if shown.simulated else ""
    return (
        f"{label}{len(found.found.names)} of {len(found.every.names)} parameters leave {found.found.estimate.relative_error:.1f} % of the torques of "
        f"{found.model.NAME} unexplained, {found.predicted_error:.1f} % on a half of the record that the fit has not seen; by the residual of least squares, "
        f"{steps}."
    )


def demo_files(shown: Demonstration, study: str) -> dict[str, str | bytes]:
    """Contents of the output folder, by file name."""
    from runtime.reporting.page import render
    from symgen.cli.identify import identification_files
    from symgen.cli.pages import identification_page
    from symgen.cli.resolution_files import cestac_files
    from symgen.demo.sections import demo_sections

    kind = "SIMULATED record, nothing measured" if shown.simulated else "public measured record"
    page = identification_page(
        shown.found,
        study,
        title=f"{shown.found.model.NAME}: identification and encoder resolution, {kind}",
        verdict=verdict(shown),
        warning="The measured record was not available." if shown.simulated else "",
        shown=demo_sections(shown),
    )
    return {
        **identification_files(shown.found, study),
        "report.html": render(page),
        **cestac_files(shown.resolution, curve=shown.curve, names=("ZZ1R", "MX2R", "FV1", "FS1", "Ia3", "FS5")),
    }
