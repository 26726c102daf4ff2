"""The identification of the Staubli TX40 and the resolution of its encoders, beside the published
tables: measured, or else simulated.

    prepared = prepare(quick=False)             # model, study, record
    demo = demonstrate(prepared, quick=False)   # identification and resolution
    demo.verdict, demo.files(folder)

Settings are those of the dataset and of design defaults, chosen before the published tables were
looked at; nothing is tuned to them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import pi
from typing import Any

import numpy as np

import runtime
import symgen
from runtime import Cestac, Record, Study
from runtime.errors import DataUnavailableError
from runtime.loop.reference import point_to_point
from runtime.reading.datasets import dataset_study
from runtime.settings.controller import Points
from runtime.settings.study import CestacSettings, study_from_mapping
from symgen.demo import tx40_tables as chapter
from symgen.demo.simulated_record import Prepared, simulated_record
from symgen.demo.tx40_page import Demonstration

DATASET = "tx40"
SEED = 1
DURATION, SHORT = 9.0, 4.0  # s of the simulated record, and of that of the quick form
FURTHER = tuple(2 * pi / counts for counts in (50000, 20000, 500))  # rad: the curve beside Table 3
ROUNDING = 1e-9  # rad, of the conversion to joint positions


def prepare(*, quick: bool) -> Prepared:
    """Model, study and measured record; where the record cannot be had, a simulated one."""
    model, study = symgen.model(DATASET), study_from_mapping(dataset_study(DATASET))
    try:
        return Prepared(model, study, runtime.read_record(study.record[0], model))
    except DataUnavailableError as e:
        duration = SHORT if quick else DURATION
        rows = replace(study.rows, window=(0.0, duration))
        study = replace(study, rows=rows, validate=Study().validate)
        note = (
            f"No measured record: {e}\nContinuing on a SIMULATED record made on the spot; nothing "
            "below was measured.\n"
        )
        path = point_to_point(model, Points(duration, SEED), 5000.0)  # Hz, as the public record
        return simulated_record(model, study, path, note, seed=SEED)


def demonstrate(
    prepared: Prepared, *, quick: bool, progress: Callable[[str], None] = lambda step: None
) -> Demonstration:
    """The computations. progress : called with the name of each before it begins."""
    model, record, runs = prepared.model, prepared.record, 2 if quick else CestacSettings().runs
    study = replace(prepared.study, cestac=CestacSettings(delta=chapter.DELTA, runs=runs))
    progress("identification")
    result = runtime.identify(model, record, study, physical=True)
    names = result.essential.names
    progress("encoder of the record")
    asked = (recorded_step(record),)
    advice = runtime.advise(model, record, study, columns=names, asked=asked)
    result = replace(result, advice=advice)

    def resolution(**settings: Any) -> Cestac:
        other = changed(study, "cestac", **settings)
        return runtime.cestac(model, record, other, columns=names)

    progress("encoder resolution")
    main = resolution()
    if quick:
        return Demonstration(prepared, result, main, None, None)
    progress("curve of %e against resolution")
    curve = replace(main, levels=(*main.levels, *resolution(delta=FURTHER).levels))
    progress("torque resolution")
    torque = resolution(delta=chapter.DELTA[:1], torque=chapter.PHI)
    return Demonstration(prepared, result, main, curve, torque)


def recorded_step(record: Record) -> float:
    """The coarsest step of the recorded positions, rad: of every joint the smallest change between
    two samples that is none of rounding.
    """
    changes = np.abs(np.diff(record.q, axis=0))
    return float(max(column[column > ROUNDING].min() for column in changes.T))


def changed(study: Study, section: str, **settings: Any) -> Study:
    """The study with some settings of a section replaced."""
    return replace(study, **{section: replace(getattr(study, section), **settings)})
