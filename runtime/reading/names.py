"""Names of records and of their files in results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from runtime.reading.formats import endings
from runtime.reading.settings import RecordSettings


@dataclass(frozen=True)
class Label:
    """Name of a record, and the names of its files, as they appear in results."""

    name: str
    files: tuple[str, ...]


def labels(settings: Sequence[RecordSettings]) -> list[Label]:
    """Give each record, and each file of the records, a unique name for results.

    A record has the name in its settings, else that of its dataset, else that of its first file
    without ending. Equal names are preceded by the folder (day1/run, day2/run), by more folders if
    needed, and finally followed by a number. A file has its own name, or its path if another file
    has the same name.
    """
    paths = [Path(s.dataset or "") / (s.files[0] if s.files else "") for s in settings]
    parts = [[*path.parts[:-1], stem(path.name)] for path in paths]
    names = [s.name or s.dataset or part[-1] for s, part in zip(settings, parts, strict=True)]
    for depth in range(2, max(map(len, parts), default=0) + 1):
        count = Counter(names)
        names = [
            "/".join(part[-depth:]) if count[name] > 1 and s.name is None else name
            for s, part, name in zip(settings, parts, names, strict=True)
        ]
    names = [
        f"{name} ({names[:k].count(name) + 1})" if name in names[:k] else name
        for k, name in enumerate(names)
    ]
    same = Counter(Path(file).name for file in {file for s in settings for file in s.files})
    files = [
        tuple(Path(file).name if same[Path(file).name] == 1 else file for file in s.files)
        for s in settings
    ]
    return [Label(name, of) for name, of in zip(names, files, strict=True)]


def stem(file: str) -> str:
    """Return the name of a measured file without its ending: log.1 of log.1.csv.gz."""
    name = file[:-3] if file.lower().endswith(".gz") else file
    ending = next((ending for ending in endings() if name.lower().endswith(ending)), "")
    return name[: len(name) - len(ending)] or file
