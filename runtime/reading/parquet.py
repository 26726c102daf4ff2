"""Reading of Parquet files, by polars (pip install symgen[tables]).

A column of lists of k numbers is an array (N, k). In a LeRobot dataset, meta/info.json names these
numbers, and each is a column too: observation.state.elbow.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from runtime.ground.errors import InputError
from runtime.reading.files import require_size, unpacked
from runtime.reading.table import WIDEST, Array, Options, Table, damage_named

TITLE = "a Parquet file"
INFO = Path("meta", "info.json")  # of a LeRobot dataset, beside its folder data
ABOVE = 4  # folders above the file in which INFO is sought


def read_parquet(path: Path, options: Options) -> Table:
    """Read a Parquet file as a Table; missing values become nan."""
    import polars

    refused: dict[str, InputError] = {}
    columns: dict[str, Array] = {}
    with damage_named(TITLE, path.name):
        file = polars.scan_parquet(unpacked(path))
        kinds = file.collect_schema()
        widths: dict[str, int] = {}
        for name, kind in kinds.items():
            inner = getattr(kind, "inner", kind)
            if isinstance(kind, polars.List | polars.Array) and inner.is_numeric():
                length = polars.col(name).cast(polars.List(polars.Float64)).list.len().fill_null(0)
                ends = file.select(low=length.min(), high=length.max()).collect()
                shortest, longest = ends.row(0)
                if shortest == longest and longest and longest <= WIDEST:
                    widths[name] = int(longest)
                else:
                    refused[name] = InputError(
                        f"the lists of the column have {shortest} to {longest} numbers; expected as many in each row, one per joint",
                        file=path.name,
                        column=name,
                    )
            elif kind.is_numeric() or kind == polars.Boolean:
                widths[name] = 1
            else:
                refused[name] = InputError(
                    f"the column contains {kind}; expected numbers, and a time in seconds (or record.rate without columns.t)",
                    file=path.name,
                    column=name,
                )
        rows = int(file.select(polars.len()).collect().item())
        require_size(8 * rows * sum(widths.values()), path.stat().st_size, path.name)
        frame = file.select(polars.col(list(widths))).collect()
        for name, width in widths.items():
            own = frame[name]
            listed = isinstance(own.dtype, polars.List | polars.Array)
            values = (own.explode() if listed else own).cast(polars.Float64).to_numpy()
            columns[name] = np.asarray(values.reshape(-1, width) if listed else values)
    named = {
        f"{name}.{label}": columns[name][:, k]
        for name, labels in _labels(path).items()
        if name in columns and columns[name].ndim == 2 and columns[name].shape[1] == len(labels)
        for k, label in enumerate(labels)
    }
    return Table(file=path.name, columns=columns | named, refused=refused)


def _labels(path: Path) -> dict[str, list[str]]:
    """Names of the numbers in each list of a LeRobot dataset, by column; {} if the dataset has no
    meta/info.json.

    The names are a list, or a mapping with one list: {motors: [...]}.
    """
    found: dict[str, list[str]] = {}
    for folder in [*path.resolve().parents][:ABOVE]:
        if not (folder / INFO).is_file():
            continue
        with suppress(OSError, ValueError, RecursionError):
            info: Any = json.loads((folder / INFO).read_text(encoding="utf-8"))
            features = info.get("features") if isinstance(info, Mapping) else None
            for name, feature in (features if isinstance(features, Mapping) else {}).items():
                labels = feature.get("names") if isinstance(feature, Mapping) else None
                if isinstance(labels, Mapping) and len(labels) == 1:
                    labels = next(iter(labels.values()))
                if isinstance(labels, list) and all(isinstance(x, str) for x in labels):
                    found[name] = labels if len({*labels}) == len(labels) else []
        break
    return found
