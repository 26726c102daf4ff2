"""Study files: YAML 1.2, read to plain values with the line of every key, so that an error names its line."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from runtime.errors import InputError, SettingsError
from runtime.files import require_file
from runtime.records.datasets import DATASETS, dataset_study
from runtime.records.formats.table import KINDS, is_measured
from runtime.settings.schema import structure
from runtime.settings.study import RecordSettings, Study, study_from_mapping
from runtime.settings.yaml import LONGEST, yaml_values

T = TypeVar("T")


def study_of(record: str) -> tuple[Study, Path]:
    """The Study that a name on a command line means, and the folder its files are relative to.

    record : a dataset, a study file (.yaml, .yml), or a measured file whose columns are called t, q1 ..., tau1 ... (SI, joint side).
    """
    path = Path(record)
    if record in DATASETS:
        return study_from_mapping(dataset_study(record)), Path()
    if path.suffix.lower() in (".yaml", ".yml"):
        return load_study(path), path.parent
    if is_measured(path):
        return Study(record=(RecordSettings(files=(path.name,)),)), path.parent
    raise InputError(
        f"no record {record!r}; expected a dataset ({', '.join(DATASETS)}), a study file (.yaml) or a measured file ({', '.join(KINDS)}, the folder of a ROS 2 bag)"
    )


def load_study(path: Path) -> Study:
    """The Study of a study file; raises SettingsError with file, line and key."""
    return study_from_text(text_of(path), file=path.name)


def text_of(path: Path) -> str:
    """The text of a file of settings."""
    if require_file(path) > 4 * LONGEST:  # bytes of so many characters
        raise InputError(f"more than {4 * LONGEST} bytes; a file of settings has a few thousand", file=str(path))
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as e:
        raise InputError(f"byte {e.start} is not UTF-8; save the file as UTF-8", file=str(path)) from e
    except OSError as e:
        raise InputError(f"cannot be read: {e.strerror or e}", file=str(path)) from e


def study_from_text(text: str, *, file: str = "study") -> Study:
    """The Study of the text of a study file."""
    return settings_from_text(Study, text, file=file)


def settings_from_text(kind: type[T], text: str, *, file: str) -> T:
    """The settings, a frozen dataclass, of a YAML text; raises SettingsError with file, line and key."""
    values, lines = yaml_values(text, file=file)
    try:
        return structure(kind, {} if values is None else values)
    except SettingsError as e:
        known = (tuple(e.path[:k]) for k in range(len(e.path), 0, -1) if tuple(e.path[:k]) in lines)
        raise SettingsError(e.reason, path=e.path, file=file, line=lines.get(next(known, ()))) from None
