"""`symgen demo haptic`: section 4.2 of the chapter, from Table 5 to Tables 6 and 7 and to what the user feels, on a simulated record."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from symgen.cli.session import opened_model, origin, study_text

if TYPE_CHECKING:
    import numpy as np

    from runtime.identification.identification import Identification
    from runtime.identification.operational_space import OperationalSpace
    from runtime.model.generated import GeneratedModel
    from runtime.records.record import Record
    from runtime.resolution.result import Cestac, LevelResult
    from runtime.resolution.rounding import Mode
    from runtime.result_files import Results
    from runtime.settings.study import Study

ROBOT = "haptic"
HANDLE = 4  # frame of the support of the handle
SHEET = (25, 31)  # configurations of joints 2 and 5 at q1 = 0
ONSET = 2 * pi / 200  # rad: a further step, where section 4.2.3 sees variations begin for the Gaussian distribution
ROUNDINGS: tuple[Mode, ...] = ("two-point", "uniform", "gaussian")
RATIOS = (5.0, 20.0)  # other transmission ratios


@dataclass(frozen=True, eq=False)
class HapticDemonstration:
    """truth : the base parameters put in.   roundings : studies by distribution, two-point first.   ratios : two-point studies by transmission ratio."""

    found: Identification
    truth: Mapping[str, float]
    roundings: Mapping[str, Cestac]
    ratios: Mapping[float, Cestac]
    felt: OperationalSpace

    @property
    def resolution(self) -> Cestac:
        """The study of Table 7."""
        return self.roundings["two-point"]


def demo_haptic(results: Results, quick: bool) -> None:
    """The demo of the haptic interface; errors and threads are those of the verb."""
    with opened_model(ROBOT) as model:
        typer.echo("No record of this interface is public: this one is SIMULATED, nothing below was measured.\n", err=True)
        study, record, files = simulated_record(model, quick)
        shown = demonstrate(model, study, record, quick=quick, step=lambda text: typer.echo(f"  {text}", err=True))
        results.write_all({**demo_files(shown, study_text(study, results.folder, results.folder)), **files})
        typer.echo(verdict(shown))
        typer.echo(f"report: {results.folder / 'report.html'}")


def simulated_record(model: GeneratedModel, quick: bool) -> tuple[Study, Record, dict[str, bytes]]:
    """Study, record and its file; the record takes the way through the file like any other. quick: a quarter of the duration, two runs."""
    from tempfile import TemporaryDirectory

    from runtime.records.reading import read_records
    from symgen.demo.haptic_record import DURATION, haptic_record, haptic_study
    from symgen.demo.simulated_record import FILE

    content, settings = haptic_record(model, DURATION / 4 if quick else DURATION)
    study = replace(haptic_study(runs=2 if quick else 5), record=(settings,))
    with TemporaryDirectory(prefix="symgen-") as folder:
        (Path(folder) / FILE).write_bytes(content)
        record = read_records(study.record, model, folder=Path(folder))[0]
    return study, record, {FILE: content}


def demonstrate(model: GeneratedModel, study: Study, record: Record, *, quick: bool, step: Callable[[str], None]) -> HapticDemonstration:
    """Everything the report shows. step : told what begins."""
    import numpy as np

    from runtime.identification.identification import identification
    from runtime.identification.operational_space import operational_space
    from runtime.model.drives import Drives
    from runtime.resolution.cestac import cestac

    provenance = origin([record])
    step("identification")
    found = identification(model, study, [record], provenance=provenance)
    roundings: dict[str, Cestac] = {}
    ratios: dict[float, Cestac] = {}
    deltas = (study.cestac.delta[0], ONSET, *study.cestac.delta[1:])
    for rounding in ROUNDINGS[:1] if quick else ROUNDINGS:
        step(f"encoder resolution, {rounding}")
        changed = replace(study, cestac=replace(study.cestac, rounding=rounding, delta=deltas))
        roundings[rounding] = cestac(model, record, changed, columns=found.found.names, provenance=provenance)
    for ratio in () if quick else RATIOS:
        step(f"encoder resolution, transmission ratio {ratio:g}")
        drives = Drives.from_mapping({"ratio": ratio * np.eye(len(model.JOINTS))})
        ratios[ratio] = cestac(model, record, study, columns=found.found.names, drives=drives, provenance=provenance)
    step("operational space")
    felt = operational_space(model, found.found.estimate, sheet(), frame=HANDLE)
    X = model.base_parameters(model.VALUES)  # type: ignore[attr-defined]
    truth = dict(zip(model.BASE_PARAMETERS, (float(x) for x in X), strict=True))
    return HapticDemonstration(found, truth, roundings, ratios, felt)


def sheet() -> np.ndarray:
    """Configurations at q1 = 0, shape (SHEET[0]*SHEET[1], 3): the arm about upright, the elbow q3 from folded to stretched, both singular."""
    import numpy as np

    q2, q3 = np.meshgrid(np.linspace(-1.0, 0.3, SHEET[0]), np.linspace(0.0, np.pi, SHEET[1]), indexing="ij")
    return np.stack([np.zeros(q2.size), q2.ravel(), (q2 + q3 - np.pi).ravel()], axis=1)


def main_error(level: LevelResult, names: tuple[str, ...]) -> tuple[str, float]:
    """Name and %e of the main parameter, inertia or gravity, that changes most."""
    from symgen.demo.haptic_tables import GRAVITY, INERTIA

    return max(((n, float(level.e[names.index(n)])) for n in (*INERTIA, *GRAVITY) if n in names), key=lambda item: item[1])


def judged(level: LevelResult, names: tuple[str, ...]) -> str:
    """Verdict as section 4.2.2 gives it: by the main inertia and gravity parameters."""
    from runtime.resolution.result import BIASED, NEGLIGIBLE

    _, error = main_error(level, names)
    return "practically unbiased" if error < NEGLIGIBLE else "biased" if error > BIASED else "small variations"


def verdict(shown: HapticDemonstration) -> str:
    """What the demo found, in one sentence."""
    found, result = shown.found, shown.resolution
    off = [abs(found.found.estimate[n] - shown.truth[n]) / s for n, s in zip(found.found.names, found.found.estimate.sigma, strict=True)]
    levels = []
    for level in result.levels:
        name, error = main_error(level, result.names)
        levels.append(f"{judged(level, result.names)} at {level.level.label} ({name} {error:.2g} %)")
    return (
        f"SIMULATED record: {len(found.found.names)} of {len(found.every.names)} parameters leave {found.found.estimate.relative_error:.1f} % of the "
        f"torques of {found.model.NAME} unexplained, the worst {max(off):.1f} standard deviations from what was put in; by the main inertia and gravity "
        f"parameters least squares is {'; '.join(levels)}."
    )


def demo_files(shown: HapticDemonstration, study: str) -> dict[str, str | bytes]:
    """Contents of the output folder, by file name."""
    from runtime.reporting import figures as plots
    from runtime.reporting.operational_space import workspace_figure
    from runtime.reporting.page import render
    from symgen.cli.identify import identification_files
    from symgen.cli.pages import identification_page
    from symgen.cli.resolution_files import cestac_files
    from symgen.demo.haptic_sections import FACES, LABELS, MAIN, haptic_sections

    page = identification_page(
        shown.found,
        study,
        title=f"{shown.found.model.NAME}: identification and encoder resolution, SIMULATED record, nothing measured",
        verdict=verdict(shown),
        warning="No record of this interface is public.",
        shown=haptic_sections(shown),
    )
    maps = workspace_figure(shown.felt, SHEET, FACES, LABELS)
    return {
        **identification_files(shown.found, study),
        "report.html": render(page),
        **cestac_files(shown.resolution, names=MAIN),
        "handle.png": plots.png(maps),
        "handle.svg": plots.svg(maps),
    }
