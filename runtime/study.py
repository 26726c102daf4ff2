"""The study file: all settings of an experiment except the robot itself.

    study = load_study("study.yaml")
    study = study_from_mapping({"signals": {"lowpass": {"cutoff": 100}}})
    study.signals.lowpass.order        # 4, the default

A Study has the sections of the chapter (`runtime.core.study`), to which features add settings, and
a section for each further feature, such as `payload` or `excitation`. Sections and settings of a
feature are in its folder: `settings.py`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, model_validator
from pydantic_core import ArgsKwargs

from runtime.core import study as chapter
from runtime.core.model import GeneratedModel
from runtime.counts.settings import Signals
from runtime.documents.files import settings_from_text, text_of
from runtime.documents.yaml_text import yaml_text
from runtime.excitation.settings import ExcitationSettings
from runtime.ground.arrays import require_kind
from runtime.ground.errors import InputError
from runtime.ground.settings import Settings, structure, to_mapping
from runtime.loop.settings import CestacSettings, Controller
from runtime.mending.settings import Corrections
from runtime.payload.settings import PayloadSettings
from runtime.reading.datasets import DATASETS, dataset_study
from runtime.reading.formats import endings, is_measured, read_table
from runtime.reading.likely_columns import candidates, known_columns
from runtime.reading.records import read_records
from runtime.reading.settings import (
    Records,
    RecordSettings,
    Rows,
    ValidateSettings,
    inherited,
    with_law,
)

RARE_WRAPS = 0.05
"""Share of the steps between two samples that may be jumps of an angle by a full turn."""


class Recorded(Settings):
    """First part of a study file: its version and its records.

    Attributes
    ----------
    symgen : int
        Version of the study file.
    record : tuple of RecordSettings
        One or several records of one robot.
    """

    symgen: chapter.Version = chapter.SCHEMA
    record: Records = ()


class Study(chapter.Study, Recorded):
    """All settings of an experiment.

    Attributes
    ----------
    payload : PayloadSettings or None
        Records with a load; columns, units, side and rate that they leave out are those of the
        first record.
    controller : Controller or None
        Closed loop for simulation, IV and DIDIM.
    excitation : ExcitationSettings or None
        Search for an exciting motion.
    robot : Corrections or None
        Entries that replace those of the robot file.
    """

    signals: Signals = field(default_factory=Signals)
    rows: Rows = field(default_factory=Rows)
    validate: ValidateSettings = field(default_factory=ValidateSettings)
    cestac: CestacSettings = field(default_factory=CestacSettings)
    payload: PayloadSettings | None = None
    controller: Controller | None = None
    excitation: ExcitationSettings | None = None
    robot: Corrections | None = None

    @model_validator(mode="before")
    @classmethod
    def _loaded_alike(cls, value: Any) -> Any:
        """Give payload.record the columns, units and side of `record`, if it leaves them out."""
        given = value.kwargs or {} if isinstance(value, ArgsKwargs) else value
        load = given.get("payload") if isinstance(given, Mapping) else None
        if not (isinstance(load, Mapping) and load.get("record")):
            return value
        several = isinstance(load["record"], list | tuple)
        own = [
            inherited(record, given.get("record"))
            for record in (load["record"] if several else [load["record"]])
        ]
        whole = {**given, "payload": {**load, "record": own if several else own[0]}}
        return ArgsKwargs(value.args, whole) if isinstance(value, ArgsKwargs) else whole

    def __post_init__(self) -> None:
        object.__setattr__(self, "record", with_law(self.record, self.controller))
        for section in ("validate", "payload"):
            given = getattr(self, section)
            if given is not None and any(record.by_law for record in given.record):
                own = replace(given, record=with_law(given.record, self.controller))
                object.__setattr__(self, section, own)


def study_from_mapping(mapping: Mapping[str, Any]) -> Study:
    """Build a Study from a mapping of settings, as read from a study file.

    Numbers may be texts such as "2*pi/10000"; a single value means a list of one value (files,
    delta, record).

    Raises SettingsError with the path of the wrong key.
    """
    require_kind(mapping, Mapping, "study", "a mapping, as read from a study file")
    return structure(Study, mapping)


def study_schema() -> dict[str, Any]:
    """Return the JSON Schema of study files.

    Methods and readers are plain texts in it; `runtime.compose.json_schema` adds the lists of
    names.
    """
    return TypeAdapter(Study).json_schema()


def load_study(path: str | Path) -> Study:
    """Read a study file and return its settings as a Study.

    An invalid file raises SettingsError with file, line and key.
    """
    require_kind(path, (str, Path), "study", "the name of a study file")
    return study_from_text(text_of(path), file=Path(path).name)


def study_from_text(text: str, *, file: str = "study") -> Study:
    """Build a Study from the text of a study file."""
    return settings_from_text(Study, text, file=file)


def study_of(record: str | Path) -> tuple[Study, Path]:
    """Make a Study from a study file, from the name of a dataset, or from a measured file.

    Return the Study, and the folder to which its file names are relative.

    Parameters
    ----------
    record : str or Path
        A dataset, a study file (.yaml, .yml), or a measured file whose columns are called t, q1
        ..., tau1 ... (SI, joint side).
    """
    require_kind(
        record, (str, Path), "record", "the name of a dataset, a study file or a measured file"
    )
    path = Path(record)
    if str(record) in DATASETS:
        return study_from_mapping(dataset_study(str(record))), Path()
    if path.suffix.lower() in (".yaml", ".yml"):
        return load_study(path), path.parent
    if is_measured(path):
        return Study(record=(RecordSettings(files=(path.name,)),)), path.parent
    raise InputError(
        f"there is no record {str(record)!r}; expected a dataset ({', '.join(DATASETS)}), a study "
        f"file (.yaml) or a measured file ({', '.join(endings())}, the folder of a ROS 2 bag)"
    )


def suggested(
    study: Study, model: GeneratedModel, *, missing: bool = False
) -> tuple[Study, list[str]]:
    """Correct the settings of a study until all its records can be read.

    An error in reading may name a remedy, which is then applied; angles that wrap at full turns are
    unwrapped. Return the new study, and a sentence on each change. Remedies are guesses from names
    and time stamps, so a person should check them.

    missing : whether positions may be missing, as for a reader of counts.

    Raises
    ------
    InputError
        An error that names no remedy, or whose remedy does not help.
    """
    sentences: list[str] = []
    while True:
        try:
            read_records(study.record, model, missing=missing)
        except InputError as e:
            text = f"{e}; suggested: record: {' '.join(yaml_text(e.remedy or {}).split())}"
            if not e.remedy or text in sentences:
                raise
            sentences.append(text)
            mapping = to_mapping(study)
            for record in mapping["record"]:
                for key, value in e.remedy.items():
                    if isinstance(value, Mapping):
                        value = {**(record[key] or {}), **value}
                    record[key] = value
            study = study_from_mapping(mapping)
        else:
            break
    turns = [_starts_anew(one, model, missing) for one in study.record]
    if any(turns):
        sentences.append("positions start anew at full turns; suggested: record: {unwrap: true}")
        pairs = zip(study.record, turns, strict=True)
        study = replace(study, record=tuple(replace(r, unwrap=r.unwrap or t) for r, t in pairs))
    return study, sentences


def _starts_anew(settings: RecordSettings, model: GeneratedModel, missing: bool) -> bool:
    """Whether the recorded angles wrap around at full turns.

    They do if unwrapping makes the largest step between two samples more than five times smaller,
    and steps of that size are rare. In a wrong unit, such as degrees read as rad, they are not.
    """
    as_read, unwrapped = (
        np.concatenate(
            [np.abs(np.diff(r.q, axis=0)) for r in read_records((s,), model, missing=missing)]
        )
        for s in (settings, replace(settings, unwrap=True))
    )
    jumps = as_read.max(axis=0)
    rare = (as_read > jumps / 2).mean(axis=0) < RARE_WRAPS
    return bool(np.any(rare & (jumps > 5 * unwrapped.max(axis=0))))


def draft(study: Study, model: GeneratedModel) -> str:
    """Write a study file with gaps for the user to fill, from the column names of the first record.

    `# ?` marks settings that the user must fill; candidates for a column follow the mark. The text
    is "" if the file cannot be read.
    """
    settings = study.record[0]
    if not settings.files:
        return ""
    try:
        names = read_table(Path(settings.files[0]), settings.topic, settings.decimal).names
    except InputError:
        return ""
    joints = tuple(getattr(model, "LABELS", {}).values())
    known, open_ = known_columns(names, joints), candidates(names, joints)
    columns = known.get("columns", {})
    record = {"files": list(settings.files), **known}
    if settings.decimal != ".":
        record["decimal"] = settings.decimal
    lines = [yaml_text({"symgen": 1, "record": record}).rstrip()]
    for key, listed in open_.items():
        if key not in columns:
            lines.append(f"# ? record.columns.{key}: {', '.join(listed or names[:8])}")
    return "\n".join([*lines, "# ? record: units, side (joint, motor), torque_constant"]) + "\n"


def located(study: Study, folder: Path) -> Study:
    """Return a study whose file names are relative to the current folder instead of to `folder`."""
    return _with_files(study, lambda file: str(folder / file))


def study_text(
    study: Study,
    destination: Path,
    *,
    defaults: bool = True,
    comments: Mapping[tuple[str | int, ...], str] | None = None,
) -> str:
    """Write the text of study.yaml for the folder `destination`.

    File names are relative to that folder.

    defaults : True: every setting; False: only settings that differ from their default, and the
        units of each record.
    comments : comments at the ends of lines, by the keys that lead to the line.
    """
    mapping = to_mapping(
        _with_files(study, lambda file: Path(os.path.relpath(file, destination)).as_posix())
    )
    if not defaults:
        usual = to_mapping(Study(robot=study.robot and Corrections()))
        mapping = {"symgen": mapping["symgen"], **_differing(mapping, usual)}
        usual = to_mapping(RecordSettings())
        mapping["record"] = [
            _differing(record, usual) | {"units": record["units"]} for record in mapping["record"]
        ]
    return yaml_text(mapping, comments)


def _differing(mapping: Mapping[str, Any], usual: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings in `mapping` that differ from the defaults `usual`, nested ones too."""
    return {
        key: _differing(value, usual[key])
        if isinstance(value, Mapping) and isinstance(usual.get(key), Mapping)
        else value
        for key, value in mapping.items()
        if value != usual.get(key)
    }


def _with_files(study: Study, change: Callable[[str], str]) -> Study:
    """Apply `change` to every file name of a study, except to the files of datasets."""

    def changed(records: tuple[RecordSettings, ...]) -> tuple[RecordSettings, ...]:
        return tuple(
            record
            if record.dataset is not None
            else replace(record, files=tuple(map(change, record.files)))
            for record in records
        )

    study = replace(
        study,
        record=changed(study.record),
        validate=replace(study.validate, record=changed(study.validate.record)),
    )
    if study.payload is not None:
        study = replace(study, payload=replace(study.payload, record=changed(study.payload.record)))
    if study.controller is not None and study.controller.reference.file is not None:
        reference = replace(
            study.controller.reference, file=change(study.controller.reference.file)
        )
        study = replace(study, controller=replace(study.controller, reference=reference))
    return study
