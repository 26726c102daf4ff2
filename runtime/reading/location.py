"""Files that a study names: relative to the study file, to the current folder, or to the folder
where the study is written.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from runtime.core.study import Study, to_mapping
from runtime.reading.settings import RecordSettings
from runtime.yaml_text import yaml_text


def located(study: Study, folder: Path) -> Study:
    """The study with every file, until now relative to `folder`, relative to the current folder."""
    return _with_files(study, lambda file: str(folder / file))


def study_text(study: Study, destination: Path, *, defaults: bool = True) -> str:
    """The text of study.yaml in the folder `destination`; files relative to that folder. defaults :
    every setting; else those that differ from their default, and the units of each record.
    """
    mapping = to_mapping(
        _with_files(study, lambda file: Path(os.path.relpath(file, destination)).as_posix())
    )
    if not defaults:
        mapping = {"symgen": mapping["symgen"], **_differing(mapping, to_mapping(Study()))}
        usual = to_mapping(RecordSettings())
        mapping["record"] = [
            _differing(record, usual) | {"units": record["units"]} for record in mapping["record"]
        ]
    return yaml_text(mapping)


def _differing(mapping: Mapping[str, Any], usual: Mapping[str, Any]) -> dict[str, Any]:
    """Entries that are not the usual ones, sections by entry."""
    return {
        key: _differing(value, usual[key])
        if isinstance(value, Mapping) and isinstance(usual.get(key), Mapping)
        else value
        for key, value in mapping.items()
        if value != usual.get(key)
    }


def _with_files(study: Study, change: Callable[[str], str]) -> Study:
    """The study with `change` of every file name; those of datasets stay."""

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
