"""What a name on a command line means: a dataset, a study file, or a measured
file.
"""

from __future__ import annotations

from pathlib import Path

from runtime.errors import InputError
from runtime.records.datasets import DATASETS, dataset_study
from runtime.records.formats.table import KINDS, is_measured
from runtime.settings.files import load_study
from runtime.settings.study import RecordSettings, Study, study_from_mapping


def study_of(record: str | Path) -> tuple[Study, Path]:
    """The Study that a name means, and the folder its files are relative to.

    Parameters
    ----------
    record : str or Path
        A dataset, a study file (.yaml, .yml), or a measured file whose columns are called t, q1
        ..., tau1 ... (SI, joint side).
    """
    path = Path(record)
    if str(record) in DATASETS:
        return study_from_mapping(dataset_study(str(record))), Path()
    if path.suffix.lower() in (".yaml", ".yml"):
        return load_study(path), path.parent
    if is_measured(path):
        return Study(record=(RecordSettings(files=(path.name,)),)), path.parent
    raise InputError(
        f"no record {str(record)!r}; expected a dataset ({', '.join(DATASETS)}), a study file "
        f"(.yaml) or a measured file ({', '.join(KINDS)}, the folder of a ROS 2 bag)"
    )
