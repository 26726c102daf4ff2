"""Parquet files, read whole or by row groups; the only place where polars is used (extra `tables`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

from runtime.errors import InputError
from runtime.io.arrays import ArrayBlock, ArrayTable
from runtime.io.naming import check_names

READ = 2**18  # rows read at a time: about one row group of the usual writers


def read_parquet(data: bytes, file: str) -> ArrayTable:
    """Table of the numeric columns of the bytes of a Parquet file; missing values become nan."""
    polars = _polars(file)
    try:
        frame = polars.read_parquet(BytesIO(data))
        names = _numeric(polars, frame.schema)
        return ArrayTable(file, {name: frame[name].cast(polars.Float64).to_numpy() for name in names})
    except (polars.exceptions.PolarsError, OSError) as e:
        raise InputError(f"not a Parquet file ({_first_line(e)})", file=file) from e


@dataclass(frozen=True, eq=False)
class ParquetBlocks:
    """A Parquet file that is read by blocks of rows."""

    path: Path
    file: str
    names: tuple[str, ...]
    rows: int

    def samples(self, names: Sequence[str]) -> int:
        """Length of the columns."""
        check_names(names, self.names, self.file)
        return self.rows

    def blocks(self, names: Sequence[str], size: int) -> Iterator[ArrayBlock]:
        """Tables of `size` rows of the named columns, in order."""
        polars = _polars(self.file)
        wanted = list(dict.fromkeys(check_names(names, self.names, self.file)))
        lazy = polars.scan_parquet(self.path).select(polars.col(wanted).cast(polars.Float64))
        step = max(READ // size, 1) * size
        try:
            for a in range(0, self.rows, step):
                read = lazy.slice(a, step).collect().to_numpy()
                for b in range(0, len(read), size):
                    yield ArrayBlock(self.file, {name: read[b : b + size, i] for i, name in enumerate(wanted)}, first=a + b)
        except (polars.exceptions.PolarsError, OSError) as e:
            raise InputError(f"damaged Parquet file ({_first_line(e)}); copy it again", file=self.file) from e


def parquet_blocks(path: Path, file: str) -> ParquetBlocks:
    """A Parquet file to be read by blocks."""
    polars = _polars(file)
    try:
        schema = polars.read_parquet_schema(path)
        rows = int(polars.scan_parquet(path).select(polars.len()).collect().item())
    except (polars.exceptions.PolarsError, OSError) as e:
        raise InputError(f"not a Parquet file ({_first_line(e)})", file=file) from e
    return ParquetBlocks(path, file, tuple(_numeric(polars, schema)), rows)


def _polars(file: str) -> Any:
    try:
        import polars
    except ImportError as e:
        raise InputError("Parquet needs an optional library: pip install symgen[tables]", file=file) from e
    return polars


def _numeric(polars: Any, schema: Any) -> list[str]:
    return [name for name, kind in schema.items() if kind.is_numeric() or kind == polars.Boolean]


def _first_line(e: Exception) -> str:
    return str(e).splitlines()[0] if str(e) else type(e).__name__
