"""From the files of a measurement to a Record: columns, scale, units, then the drives.

    record = read_record("run.csv")
    records = read_records(study.record, model, folder="measurements")

Units and side are explicit in the settings, never guessed. A file whose columns are called t, q1
... qn, tau1 ... taun needs no column names.
Bad input raises InputError, which names file, column and line or sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from runtime.errors import InputError
from runtime.model.generated import GeneratedModel
from runtime.records.clock import rate_of
from runtime.records.measured import Samples
from runtime.records.missing import Missing
from runtime.records.named import study_of
from runtime.records.opening import RecordFiles, open_records
from runtime.records.record import Record
from runtime.records.resampling import Stretch, resampled
from runtime.records.time_stamps import time_stamps
from runtime.settings.record import RecordSettings

IRREGULAR = (
    0.05  # between the rate of the settings and the median step of stamps that are resampled
)


def read_record(
    path: str | Path | RecordSettings,
    model: GeneratedModel | None = None,
    *,
    folder: str | Path = ".",
    missing: bool = False,
) -> Record:
    """One measured record, joint side, SI.

    Parameters
    ----------
    path : str, Path or RecordSettings
        A measured file whose columns are called t, q1 ..., tau1 ... (SI, joint side), a study file,
        a dataset, or settings.
    model : module, optional
        Emitted model of the robot; needed where a side is "motor", which its drives convert, and
        checked for its number of joints.
    folder : str or Path
        Where relative file names start; of a study file, those in it start where it is.
    missing : bool
        Whether positions may be missing, nan or an empty field, as `signals.reader: counts` admits;
        a study file that names this reader says so itself.

    Raises
    ------
    InputError
        Files that cannot be read or hold something else, and several records, or one that
        `resample` splits.
    """
    if isinstance(path, RecordSettings):
        settings: tuple[RecordSettings, ...] = (path,)
    else:
        named = Path(folder) / path
        study, folder = study_of(named if named.exists() else path)
        settings, missing = study.record, missing or study.signals.admits_missing
    records = read_records(settings, model, folder=folder, missing=missing)
    if len(records) != 1:
        names = ", ".join(record.name for record in records)
        raise InputError(
            f"{len(records)} records or pieces between gaps; read_records gives them all: {names}"
        )
    return records[0]


def read_records(
    settings: Sequence[RecordSettings],
    model: GeneratedModel | None = None,
    *,
    folder: str | Path | None = None,
    missing: bool = False,
) -> list[Record]:
    """Several records of one robot, no name twice; a record that `resample` splits at gaps is one
    record by piece.

    Parameters
    ----------
    model : module, optional
        Emitted model of the robot, for its drives and its number of joints.
    folder : str or Path, optional
        Where relative file names start; default: the current folder.
    missing : bool
        Whether positions may be missing, as `signals.reader: counts` admits.
    """
    opened = open_records(settings, model, folder, missing=missing)
    return [record for files in opened for record in read_pieces(files)]


def read_pieces(opened: RecordFiles) -> list[Record]:
    """The record, or those into which `resample` splits it at gaps and where time goes back."""
    try:
        samples = opened.read()
        stretches, rate, text = _uniform(opened, samples)
        text = "; ".join(part for part in (text, opened.note) if part)
    finally:
        opened.close()
    K = len(stretches)
    signals = [dict(zip(samples.signals, stretch.signals, strict=True)) for stretch in stretches]
    if opened.law is not None:
        signals = [
            opened.law.signals(stretch.t, own, rate)
            for stretch, own in zip(stretches, signals, strict=True)
        ]
    return [
        Record(
            stretch.t,
            own["q"],
            own.get("tau", np.zeros_like(own["q"])),
            tau_known=own.get("tau_known"),
            channels={key: own[key] for key in (*samples.channels, "law_v") if key in own},
            rate=rate,
            name=opened.name if K == 1 else f"{opened.name} ({k} of {K})",
            missing=Missing(own["missing"], opened.side.follows) if "missing" in own else None,
            origin=replace(opened.origin(text), whole="" if K == 1 else opened.name),
        )
        for k, (stretch, own) in enumerate(zip(stretches, signals, strict=True), start=1)
    ]


def _uniform(opened: RecordFiles, samples: Samples) -> tuple[list[Stretch], float, str]:
    """The samples at a uniform rate, Hz, and what their time stamps are like: as they are, or
    resampled where the settings ask for it.
    """
    settings, stamps, file = opened.settings, opened.stamps, opened.first.file
    t, signals = samples.t, tuple(samples.signals.values())
    if t is None:
        rate = opened.stated_rate
        return [Stretch(np.arange(opened.samples) / rate, signals)], rate, ""
    if settings.resample is None:
        rate = rate_of(stamps, t)
        return [Stretch(t, signals)], rate, time_stamps(t, file=file).to_text(stamps.row)
    regularity = time_stamps(t, gap=settings.resample.longest, file=file)
    if settings.rate is not None and abs(1 / regularity.period / settings.rate - 1) > IRREGULAR:
        raise InputError(
            (
                f"time runs at {1 / regularity.period:g} Hz, record.rate is {settings.rate:g} Hz; "
                "correct one, or the unit of time"
            ),
            file=file,
        )
    try:
        stretches, rate, done = resampled(
            t, signals, regularity, settings.resample, settings.rate, file=file
        )
    except InputError as e:
        raise InputError(
            f"{e.message}. The stamps: {regularity.to_text(stamps.row)}",
            file=file,
            column=opened.columns.t,
        ) from None
    return stretches, rate, f"{regularity.to_text(stamps.row)}; {done}"
