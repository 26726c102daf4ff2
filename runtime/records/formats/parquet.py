"""Parquet files, read whole or by row groups; the only place where polars is used (extra `tables`)."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from threading import Lock
from typing import Any

from runtime.errors import InputError, first_line
from runtime.files import require_file
from runtime.limits import allowed, require_size
from runtime.records.formats.arrays import ArrayBlock, ArrayTable
from runtime.records.formats.naming import check_names

TRIAL = """
import sys
from io import BytesIO
import polars
path, step, most = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
source = path if path else BytesIO(sys.stdin.buffer.read())
lazy = polars.scan_parquet(source)
names = [name for name, kind in lazy.collect_schema().items() if kind.is_numeric() or kind == polars.Boolean]
rows = lazy.select(polars.len()).collect().item()
if rows * len(names) <= most:
    if path:
        for a in range(0, rows, step):
            lazy.select(polars.col(names).cast(polars.Float64)).slice(a, step).collect()
    else:
        polars.read_parquet(source, columns=names)
"""  # what is read below, by a process of its own
READ = 2**18  # rows read at a time: about one row group of the usual writers
_SILENT = Lock()


def read_parquet(data: bytes, file: str) -> ArrayTable:
    """Table of the numeric columns of the bytes of a Parquet file; missing values become nan."""
    polars = _polars(file)
    _try(file, len(data), data=data)
    with _refused(polars, file):
        lazy = polars.scan_parquet(BytesIO(data))
        names = _numeric(polars, lazy.collect_schema())
        rows = int(lazy.select(polars.len()).collect().item())
        require_size(8 * rows * len(names), len(data), file)  # a constant column of any length takes no space in the file
        frame = polars.read_parquet(BytesIO(data), columns=names)
        return ArrayTable(file, {name: frame[name].cast(polars.Float64).to_numpy() for name in names})


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
        for a in range(0, self.rows, step):
            with _refused(polars, self.file):
                read = lazy.slice(a, step).collect().to_numpy()
            for b in range(0, len(read), size):
                yield ArrayBlock(self.file, {name: read[b : b + size, i] for i, name in enumerate(wanted)}, first=a + b)


def parquet_blocks(path: Path, file: str) -> ParquetBlocks:
    """A Parquet file to be read by blocks."""
    polars = _polars(file)
    size = require_file(path)
    _try(file, size, path=path)
    with _refused(polars, file):
        names = _numeric(polars, polars.read_parquet_schema(path))
        rows = int(polars.scan_parquet(path).select(polars.len()).collect().item())
    require_size(8 * rows * len(names), size, file)
    return ParquetBlocks(path, file, tuple(names), rows)


def _polars(file: str) -> Any:
    try:
        import polars
    except ImportError as e:
        raise InputError("Parquet needs an optional library: pip install symgen[tables]", file=file) from e
    return polars


def _numeric(polars: Any, schema: Any) -> list[str]:
    return [name for name, kind in schema.items() if kind.is_numeric() or kind == polars.Boolean]


def _try(file: str, size: int, *, path: Path | str = "", data: bytes = b"") -> None:
    """Read a file of `size` bytes, or the bytes themselves, in a process of its own; InputError where that ends it.

    Some damage makes polars ask for more memory than there is, and its library then ends the process: no exception, every result lost.
    """
    command = [sys.executable, "-P", "-c", TRIAL, str(path), str(READ), str(allowed(size) // 8)]
    done = subprocess.run(command, input=data, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
    if done.returncode not in (0, 1):  # 1: an exception, which will come here as well
        raise InputError("damaged: the library that reads Parquet ends on it; write it again", file=file)


@contextmanager
def _refused(polars: Any, file: str) -> Iterator[None]:
    """Damage as one InputError. Polars panics on some of it, and its threads then write their stacks to the error stream: not here."""
    with _SILENT, open(os.devnull, "w") as nowhere:  # noqa: PTH123
        kept = os.dup(2)
        os.dup2(nowhere.fileno(), 2)
        try:
            yield
        except (polars.exceptions.PolarsError, polars.exceptions.PanicException, OSError, MemoryError) as e:
            raise InputError(f"damaged, or not a Parquet file ({first_line(e)}); write it again", file=file) from e
        finally:
            os.dup2(kept, 2)
            os.close(kept)
