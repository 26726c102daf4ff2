"""Reading of Parquet files, by polars (pip install symgen[tables])."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from runtime.ground.errors import InputError
from runtime.reading.files import require_size, unpacked
from runtime.reading.table import Options, Table, damage_named

TITLE = "a Parquet file"


def read_parquet(path: Path, options: Options) -> Table:
    """Read a Parquet file as a Table; missing values become nan."""
    import polars

    refused: dict[str, InputError] = {}
    with damage_named(TITLE, path.name):
        file = polars.scan_parquet(unpacked(path))
        kinds = file.collect_schema()
        for name, kind in kinds.items():
            if not (kind.is_numeric() or kind == polars.Boolean):
                refused[name] = InputError(
                    f"the column contains {kind}; expected numbers, and a time in seconds (or record.rate without columns.t)",
                    file=path.name,
                    column=name,
                )
        names = [name for name in kinds if name not in refused]
        rows = int(file.select(polars.len()).collect().item())
        require_size(8 * rows * len(names), path.stat().st_size, path.name)
        frame = file.select(polars.col(names).cast(polars.Float64)).collect()
        columns = {name: np.asarray(frame[name].to_numpy()) for name in names}
    return Table(file=path.name, columns=columns, refused=refused)
