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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, model_validator
from pydantic_core import ArgsKwargs

from runtime.core import study as chapter
from runtime.core.model import GeneratedModel
from runtime.core.record import Record
from runtime.counts.settings import Signals
from runtime.documents.files import settings_from_text, text_of
from runtime.documents.yaml_text import yaml_text
from runtime.excitation.settings import ExcitationSettings
from runtime.ground.arrays import require_kind
from runtime.ground.errors import InputError, first_line
from runtime.ground.settings import Settings, structure, to_mapping
from runtime.loop.settings import CestacSettings, Controller
from runtime.mending.settings import Corrections
from runtime.payload.settings import PayloadSettings
from runtime.reading.datasets import DATASETS, dataset_study
from runtime.reading.formats import file_extensions, is_measured, read_table
from runtime.reading.likely_columns import (
    QUANTITIES,
    candidates,
    known_columns,
    missing_joints,
)
from runtime.reading.records import read_records
from runtime.reading.settings import (
    Records,
    RecordSettings,
    Rows,
    ValidateSettings,
    inherited,
    with_law,
)
from runtime.reading.units import likely_time_unit

BEYOND = 2.0  # times the limits of the robot file: positions so large are no rad
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

    Examples
    --------
    >>> import runtime
    >>> study = runtime.Study(estimate={"method": "wls"}, signals={"lowpass": {"cutoff": 8}})
    >>> study.signals.lowpass.cutoff
    8.0
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

    Examples
    --------
    >>> from pathlib import Path
    >>> import runtime
    >>> _ = Path("study.yaml").write_text("symgen: 1\\nestimate: {method: wls}\\n")
    >>> runtime.load_study("study.yaml").estimate.method
    'wls'
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
        f"file (.yaml) or a measured file ({', '.join(file_extensions())}, the folder of a ROS 2 bag)"
    )


@dataclass(frozen=True)
class Suggestion:
    """A study with the settings that its records need, as far as names and values show them.

    Attributes
    ----------
    study : Study
    sentences : tuple of str
        A sentence on each change, for a person to check.
    unrecognised : mapping of str to str
        Settings that a person must fill in: a key of the study, and the data that were not
        recognised, such as "positions of joints 4 to 6". If it is empty, all records can be read.
    candidates : mapping of str to tuple of str
        Columns that may have these data, by key.
    """

    study: Study
    sentences: tuple[str, ...] = ()
    unrecognised: Mapping[str, str] = field(default_factory=dict)
    candidates: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def text(self, destination: Path) -> str:
        """Write study.yaml for a folder, with a line `# ?` for each setting to be filled in."""
        text = study_text(self.study, destination, defaults=False)
        for key, what in self.unrecognised.items():
            listed = self.candidates.get(key, ())
            text += f"# ? {key}: {what}{'; perhaps ' if listed else ''}{', '.join(listed)}\n"
        return text


def suggested(study: Study, model: GeneratedModel, *, missing: bool = False) -> Suggestion:
    """Correct the settings of a study until all its records can be read.

    An error in reading may name a remedy, which is then applied; angles that wrap at full turns are
    unwrapped; time steps beyond `SLOWEST` are read in a smaller unit. Remedies are guesses from
    names and time stamps, so a person should check them.

    missing : whether positions may be missing, as for a reader of counts.

    Raises
    ------
    InputError
        A file cannot be read at all.
    """
    sentences: list[str] = []
    while True:
        try:
            records = read_records(study.record, model, missing=missing)
        except InputError as e:
            text = _set(e.remedy or {}, e)
            if not e.remedy or text in sentences:
                rest = _unfinished(study, model, sentences, e)
                if rest.study == study or rest.unrecognised.keys() != {"record"}:
                    return rest
                sentences.append("record: the columns and units that their names show")
                study = rest.study  # all is recognised: try again
                continue
            sentences.append(text)
            study = _with_settings(study, e.remedy)
            continue
        unit = likely_time_unit(records[0].t)
        own = study.record[0]
        if unit == "s" or own.units.t != "s" or own.rate is not None:
            break
        sentences.append(
            f"record: units: {{t: {unit}}}, because time steps of {1 / records[0].rate:g} s are "
            "too long"
        )
        study = _with_settings(study, {"units": {"t": unit}})
    open_: dict[str, str] = {}
    if beyond := _beyond_limits(study.record, records, model):
        open_["record.units.q"] = beyond
    if any(r.resample is not None and r.resample.method != "count" for r in study.record):
        sentences.append(
            f"the stamps are not uniform: positions and torques are interpolated at {records[0].rate:g} Hz; "
            "if the samples are uniform and only their stamps are not, set record.resample.method: count"
        )
    turns = [_starts_anew(one, model, missing) for one in study.record]
    if any(turns):
        sentences.append("record: unwrap: true, because positions start anew at full turns")
        pairs = zip(study.record, turns, strict=True)
        study = replace(study, record=tuple(replace(r, unwrap=r.unwrap or t) for r, t in pairs))
    return Suggestion(study, tuple(sentences), open_)


def _set(settings: Mapping[str, Any], error: InputError) -> str:
    """Tell which settings of the section `record` were set, and why."""
    why = "as the names of the columns show" if "columns" in settings else f"because {error}"
    return f"record: {' '.join(yaml_text(settings).split())}, {why}"


def _beyond_limits(
    settings: Sequence[RecordSettings], records: Sequence[Record], model: GeneratedModel
) -> str:
    """Report positions that are impossible in rad, because they are in degrees or on the motor
    side.

    The report is made if the positions of every joint exceed twice the limits of the robot file;
    otherwise, the text is "".
    """
    limits = getattr(model, "LIMITS", {}).get("q", ())
    if not limits or not all(limits) or any(one.units.q != "rad" for one in settings):
        return ""
    bounds = np.array([max(map(abs, limit)) for limit in limits])
    reached = np.max([np.abs(record.q).max(axis=0) for record in records], axis=0)
    if not np.all((bounds > 0) & (reached > BEYOND * bounds)):
        return ""
    return (
        f"unit of the positions, which reach {reached.max():.3g} where the limits of the robot file "
        f"are {bounds.max():.3g} rad (deg, or record.side: motor)"
    )


def _with_settings(study: Study, settings: Mapping[str, Any]) -> Study:
    """Set keys of the section `record` in every record of a study."""
    mapping = to_mapping(study)
    for record in mapping["record"]:
        for key, value in settings.items():
            if isinstance(value, Mapping):
                value = {**(record[key] or {}), **value}
            record[key] = value
    return study_from_mapping(mapping)


def _unfinished(
    study: Study, model: GeneratedModel, sentences: Sequence[str], error: InputError
) -> Suggestion:
    """Make the settings that the column names of the first record show, and list the missing
    settings.

    Raise `error` if the file has no columns that can be read.
    """
    own = study.record[0]
    if not own.files:
        raise error
    try:
        table = read_table(Path(own.files[0]), own.topic, own.decimal)
    except InputError:
        raise error from None
    n = len(model.JOINTS)
    labels = tuple(getattr(model, "LABELS", {}).values())
    joints = labels if len(labels) == n else ("",) * n
    open_: dict[str, str] = {}
    if not own.columns.q or not own.columns.tau:
        known = known_columns(table.columns, joints)
        columns = {
            key: names
            for key, names in known.get("columns", {}).items()
            if not getattr(own.columns, key)
        }
        if own.rate is not None:
            columns.pop("t", None)
        units = {key: unit for key, unit in known.get("units", {}).items() if key in columns}
        study = _with_settings(study, {"columns": columns, "units": units})
        for key, numbers in missing_joints(table.columns, joints, n).items():
            if numbers and not getattr(own.columns, key):
                of = "" if len(numbers) == n else f" of {_joints_text(numbers)}"
                open_[f"record.columns.{key}"] = f"{QUANTITIES[key]}{of}"
    timed = study.record[0].columns.t or {"t", "time"} & {*table.names}
    if not timed and study.record[0].rate is None and table.joints is None:
        open_["record.columns.t"] = "time, or the sampling rate in record.rate"
    listed = candidates(table.columns, joints)
    own = study.record[0]
    taken = {own.columns.t, *own.columns.q, *own.columns.tau}
    perhaps = {
        f"record.columns.{key}": tuple(
            [name for name in names or table.names if name not in taken][:8]
        )
        for key, names in listed.items()
    }
    if not open_:
        open_["record"] = first_line(error)
    return Suggestion(study, tuple(sentences), open_, perhaps)


def _joints_text(numbers: Sequence[int]) -> str:
    """Write joint numbers: "joint 2", "joints 4 to 6", "joints 1, 4"."""
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"joints {numbers[0]} to {numbers[-1]}"
    return f"joint{'s' if len(numbers) > 1 else ''} {', '.join(map(str, numbers))}"


def _starts_anew(settings: RecordSettings, model: GeneratedModel, missing: bool) -> bool:
    """Whether the recorded angles wrap around at full turns.

    The angles wrap around if unwrapping makes the largest step between two samples more than five
    times smaller, and steps of this size are rare. In a wrong unit, such as degrees read as rad,
    such steps are frequent.
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

    defaults : whether to write every setting; otherwise only settings that differ from their
      default, and the units of each record.
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
    """Return the settings in `mapping` that differ from the defaults `usual`, including nested
    settings.
    """
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
