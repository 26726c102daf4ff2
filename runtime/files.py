"""Write results into a folder: HTML page, figures, tables, and data files for other programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import singledispatch
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from runtime.advisor.advice import Advice
from runtime.core.cestac.result import Cestac
from runtime.core.model import joint_labels
from runtime.core.result import Identification
from runtime.documents.yaml_text import yaml_text
from runtime.excitation.poses import StaticPoses
from runtime.excitation.result import Excitation
from runtime.ground.arrays import require_kind
from runtime.ground.documents import json_text
from runtime.ground.errors import InputError
from runtime.ground.part import Part
from runtime.loop.result import Simulation, csv_text
from runtime.reading.settings import RecordSettings
from runtime.reporting import figures as plots
from runtime.reporting.arrays import array_files, estimate_arrays
from runtime.reporting.motions import excitation_page, simulation_figure
from runtime.reporting.page import Page, Section, render
from runtime.reporting.pages import identification_page, part_page, resolution_page
from runtime.reporting.parameters import parameters_csv
from runtime.reporting.result_files import Results, write_all
from runtime.study import Study, study_text
from runtime.treatments import Ranking

TABLE_LINES = 40
"""Lines of parameters.tex that one page holds; more stand in two blocks, lines."""

Files: TypeAlias = dict[str, str | bytes]

RECORD = "simulated.csv"


def report(
    result: Identification | Ranking | Cestac | Advice | Simulation | Excitation | StaticPoses,
    folder: str | Path | Results,
    *,
    study: Study | None = None,
) -> list[Path]:
    """Write the report and all files of a result into a folder; if a file fails, write none.

    Parameters
    ----------
    result : Identification, Ranking, Cestac, Advice, Simulation, Excitation or StaticPoses
    folder : str, Path or Results
        Made if it is missing; or a Results object of `runtime.reporting.result_files.results_in`.
    study : Study, optional
        Settings of a Cestac, an Advice or a Simulation, for study.yaml; default: Study(). An
        Identification has its own study.

    Returns
    -------
    list of Path
        Paths of the written files.

    Raises
    ------
    OutputError
        The folder cannot be written.

    Examples
    --------
    >>> import numpy as np, runtime, symgen
    >>> model = symgen.model("emps")  # one prismatic joint
    >>> t = np.arange(0, 10, 0.001)
    >>> q, qd, qdd = np.sin(t), np.cos(t), -np.sin(t)
    >>> record = runtime.Record(t, q, tau=95 * qdd + 200 * qd + 20 * np.sign(qd))
    >>> files = runtime.report(runtime.identify(model, record), "results")
    >>> [file.name for file in files if file.suffix in (".html", ".json")]
    ['report.html', 'estimate.json']
    """
    require_kind(folder, (str, Path, Results), "folder", "the name of a folder")
    require_kind(study, (Study, type(None)), "study", "a Study, or None")
    place = folder.folder if isinstance(folder, Results) else Path(folder)
    files = files_of(result, place, study if study is not None else Study())
    return folder.write_all(files) if isinstance(folder, Results) else write_all(place, files)


@singledispatch
def files_of(result: object, folder: Path, study: Study) -> Files:
    """Make the contents of all files of a result, as a mapping from file name to content.

    Raise InputError for a result that has no files.
    """
    raise InputError(
        f"{type(result).__name__} cannot be written to files; expected an Identification, "
        "Ranking, Cestac, Advice, Simulation, Excitation or StaticPoses"
    )


def identification_files(
    result: Identification,
    folder: Path,
    *,
    title: str = "",
    warning: str = "",
    verdict: str = "",
    sections: Sequence[Section] = (),
) -> Files:
    """Make the files of an identification: page, estimate, parameters, arrays, study and figures.

    title, warning, verdict, sections : as for `identification_page`.
    """
    unit = result.torque_unit
    fit = result.model_estimate
    settings: Any = result.study
    study = study_text(settings, folder)
    page = identification_page(
        result, study, title=title, warning=warning, verdict=verdict, sections=sections
    )
    torques = plots.torque_overlay(result.comparison, unit, result.source)
    files: Files = {
        **page_files(page),
        "estimate.json": result.to_json(),
        "parameters.csv": parameters_csv(result),
        "parameters.tex": fit.to_latex(blocks=1 if len(fit.names) <= TABLE_LINES else 2),
        **array_files("estimate", estimate_arrays(result.estimate)),
        "study.yaml": study,
        "torques.png": plots.png(torques),
        "torques.svg": plots.svg(torques),
    }
    for part in result.parts:
        files |= part_files(part)
    return files


@files_of.register
def _(result: Identification, folder: Path, study: Study) -> Files:
    return identification_files(result, folder)


@files_of.register
def _(result: Ranking, folder: Path, study: Study) -> Files:
    """Make the result files of a comparison of studies, and the result files of its best
    identification.
    """
    section = Section(
        "Treatments compared", (result.verdict, *result.missing), tables=(result.table(),)
    )
    return {
        "comparison.json": json_text(result.summary()),
        **identification_files(result.best, folder, sections=(section,)),
    }


@files_of.register
def _(result: Cestac, folder: Path, study: Study) -> Files:
    text = study_text(study, folder)
    return page_files(resolution_page(result, text)) | {
        "study.yaml": text,
        **part_files(result),
    }


@files_of.register
def _(result: Advice, folder: Path, study: Study) -> Files:
    text = study_text(study, folder)
    subject = "encoder resolution advised on"
    page = part_page(result, subject, result.verdict, result.provenance, text)
    return page_files(page) | {
        "study.yaml": text,
        **part_files(result),
    }


@files_of.register
def _(result: Simulation, folder: Path, study: Study) -> Files:
    """Make the files of a simulation: simulated record, its study file, key numbers, and figure."""
    figure = simulation_figure(joint_labels(result.model), result, result.units)
    record = RecordSettings(
        files=(str(folder / RECORD),), rate=result.rate, name=result.name, simulated=True
    )
    return {
        RECORD: result.to_csv(),
        "study.yaml": study_text(replace(study, record=(record,)), folder),
        "simulation.json": result.to_json(),
        "simulation.svg": plots.svg(figure),
        "simulation.png": plots.png(figure),
    }


@files_of.register
def _(result: Excitation, folder: Path, study: Study) -> Files:
    """Make the files of an exciting motion: samples, coefficients, figures of merit and page."""
    return page_files(excitation_page(result)) | {
        "excitation.json": result.to_json(),
        "trajectory.csv": result.to_csv(),
        "joint_trajectory.yaml": result.to_joint_trajectory(),
        "motion.yaml": yaml_text({"motion": result.motion.to_mapping()}),
    }


@files_of.register
def _(result: StaticPoses, folder: Path, study: Study) -> Files:
    """Make the files of static poses: table (column t: number of the pose), JSON data and page.

    If a user adds columns of measured torques, the table is a record.
    """
    page = Page("Poses at rest", "", [Section(result.model.NAME, listing=result.to_table())])
    t = np.arange(1.0, len(result.poses) + 1)
    texts = {"excitation.json": result.to_json(), "poses.csv": csv_text(t, q=result.poses)}
    return page_files(page) | texts


def page_files(page: Page) -> Files:
    """Make the HTML text of a page and the files of its figures."""
    return {"report.html": render(page), **page.files}


def part_files(part: Part) -> Files:
    """Make the text and array files of one analysis, which are written next to the report page."""
    files: Files = dict(part.files())
    for stem, arrays in part.arrays().items():
        files |= array_files(stem, arrays)
    return files
