"""Draft of a study file, made from the column names of a measured file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from runtime.core.errors import InputError
from runtime.documents.yaml_text import yaml_text
from runtime.reading.formats import read_table
from runtime.reading.likely_columns import candidates, known_columns
from runtime.reading.settings import RecordSettings


def draft(settings: RecordSettings, path: Path, joints: Sequence[str]) -> str:
    """Write a draft of a study file for one record; `# ?` marks settings that the user must fill.

    Candidates for a column follow the mark. The draft is "" if the file cannot be read.

    path : of the first file. joints : names of the joints in the robot file.
    """
    try:
        names = read_table(path, settings.topic, settings.decimal).names
    except InputError:
        return ""
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
