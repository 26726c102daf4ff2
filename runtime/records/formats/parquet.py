"""Parquet files, by polars (pip install symgen[tables])."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from runtime.records.formats.columns import Array, Source, Table

READ = 2**18  # rows read at a time: about one row group of the usual writers


@dataclass(eq=False, kw_only=True)
class ParquetTable(Table):
    """Numeric columns of a Parquet file; missing values become nan."""

    lazy: Any

    def parts(
        self, names: Sequence[str], size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[Sequence[Array]]:
        import polars

        wanted = self.lazy.select(polars.col(list(names)).cast(polars.Float64))
        step, end = max(READ // size, 1) * size, self.rows if stop is None else min(stop, self.rows)
        for a in range(start, end, step):
            read = wanted.slice(a, min(step, end - a)).collect().to_numpy()
            for b in range(0, len(read), size):
                yield list(read[b : b + size].T)


def open_parquet(source: Source) -> ParquetTable:
    """Table of a Parquet file."""
    import polars

    lazy = polars.scan_parquet(source.content())
    kinds = lazy.collect_schema()
    names = tuple(
        name for name, kind in kinds.items() if kind.is_numeric() or kind == polars.Boolean
    )
    others = {name: f"it holds {kind}" for name, kind in kinds.items() if name not in names}
    rows = int(lazy.select(polars.len()).collect().item())
    return ParquetTable(
        file=source.file, size=source.size, names=names, lazy=lazy, rows=rows, others=others
    )
