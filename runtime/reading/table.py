"""A measured file in memory: named columns of numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from runtime.ground.clock import sample
from runtime.ground.errors import InputError, first_line

Array = np.ndarray

WIDEST = 10_000  # columns of a file; a wider one is no table of samples


@dataclass(frozen=True)
class Options:
    """Settings for reading the files of a record: topic of a bag, decimal sign of a text file.

    Attributes
    ----------
    topic : str or None
        Topic of a bag; None: the only topic of the type sensor_msgs/JointState.
    decimal : str
        Decimal sign of a text file, "." or ",".
    """

    topic: str | None = None
    decimal: str = "."


@dataclass(frozen=True, eq=False, kw_only=True)
class Table:
    """Named columns of one measured file.

    Attributes
    ----------
    file : str
        Name of the file in messages.
    columns : mapping of str to ndarray
        Numbers by name: a vector of N samples, or a matrix (N, k) or (k, N) that has k columns. Samples
        are along the longer side: a record has more samples than joints.
    refused : mapping of str to InputError
        Error for each name in the file whose values are not numbers.
    empty : mapping of str to str
        Row of the first empty field of a column, which is nan.
    row : callable
        Function that names sample i, from 0, by its place in the file: "line 12", "sample 12".
    joints : tuple of str or None
        Joints in the messages of a bag; None for other files.
    topic : str
        Topic of a bag.
    note : str
        Sentence that a user of these columns should read.
    has_header : bool
        Whether the names are the first line of a text.
    numbered : bool
        Whether a column may also be called by its number, from 1, if no column has this name.
    what : str
        Kind of the file, in messages.
    digest : str
        SHA-256 of the uncompressed bytes.
    starts : tuple of int
        First samples of the episodes of the file, after the first episode.
    """

    file: str
    columns: Mapping[str, Array]
    refused: Mapping[str, InputError] = field(default_factory=dict)
    empty: Mapping[str, str] = field(default_factory=dict)
    row: Callable[[int], str] = sample
    joints: tuple[str, ...] | None = None
    topic: str = ""
    note: str = ""
    has_header: bool = False
    numbered: bool = False
    what: str = "the file"
    digest: str = ""
    starts: tuple[int, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns; a matrix with several columns has one name."""
        return tuple(self.columns)

    def chosen(self, names: Sequence[str]) -> Table:
        """Return the table without the rows in which all the columns `names` are empty.

        The time may be filled in such rows, which come from another source. For most files, the
        table is returned unchanged.
        """
        names = self._called(names)
        gaps = [name for name in dict.fromkeys(names) if name in self.empty]
        if not gaps or len({*names}) - len(gaps) > 1:
            return self
        lost = np.isnan([self.columns[name] for name in gaps]).all(axis=0)
        kept = np.flatnonzero(~lost)
        columns = {
            name: x[kept] if x.shape == lost.shape else x for name, x in self.columns.items()
        }
        still = {name: row for name, row in self.empty.items() if np.isnan(columns[name]).any()}
        note = f"{lost.sum()} rows without any of these columns are left out"
        return replace(
            self,
            columns=columns,
            empty=still,
            row=lambda k: self.row(int(kept[k])),
            note=". ".join(filter(None, (self.note, note))),
        )

    def read(self, names: Sequence[str], *, empty: bool = False, hint: str = "") -> Array:
        """Return the columns called `names` as one array, shape (N, k), in the order of `names`.

        Raise InputError for a name that the file does not have, and for values that are not
        numbers.

        Parameters
        ----------
        empty : bool
            Whether fields may be empty; they are nan.
        hint : str
            Remedy for an empty field, in the message.
        """
        names = self._called(names)
        for name in names:
            if name in self.refused:
                raise self.refused[name]
            if name in self.empty and not empty:
                raise InputError(
                    f"the field is empty; expected a number{hint}",
                    file=self.file,
                    column=name,
                    row=self.empty[name],
                )
        missing = [name for name in names if name not in self.columns]
        if missing:
            present = ", ".join(self.names) or "none"
            where = f"the file has {present}"
            if self.has_header and len(missing) == len(names):
                where = f"the first line has {present}; put # before lines above the names"
            raise InputError(f"no column {', '.join(missing)}; {where}", file=self.file)
        columns = [self._by_samples(name) for name in names]
        lengths = {name: len(x) for name, x in zip(names, columns, strict=True)}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{name} {N}" for name, N in lengths.items())
            raise InputError(
                f"columns of different lengths: {listed}; expected the same number of samples",
                file=self.file,
            )
        return columns[0] if len(columns) == 1 else np.hstack(columns)

    def _called(self, names: Sequence[str]) -> list[str]:
        """Replace the numbers of columns among `names` by the names of these columns."""
        numbers = {str(k): name for k, name in enumerate(self.names, 1)} if self.numbered else {}
        return [name if name in self.columns else numbers.get(name, name) for name in names]

    def scalar(self, name: str) -> float:
        """Return the single number called `name`; raise InputError if there is none."""
        if name in self.refused:
            raise self.refused[name]
        if name not in self.columns:
            raise InputError(
                f"{self.what} contains no variable {name!r}, to which a setting refers; write a number in this setting",
                file=self.file,
            )
        x = self.columns[name]
        if x.size != 1:
            raise InputError(
                f"the array has shape {x.shape}; expected a single number",
                file=self.file,
                column=name,
            )
        return float(x.reshape(()))

    def _by_samples(self, name: str) -> Array:
        """Return the array `name`, shape (N, k); raise InputError if it does not have N samples."""
        x = self.columns[name]
        problem = ""
        if x.ndim > 2:
            problem = f"shape {x.shape}; expected (N,), (N, k) or (k, N), k columns of N samples"
        elif not x.size:
            problem = "no samples"
        elif x.ndim == 2 and min(x.shape) > WIDEST:
            problem = f"shape {x.shape}; at most {WIDEST} columns are read"
        if problem:
            raise InputError(problem, file=self.file, column=name)
        if x.ndim < 2:
            x = x.reshape(-1, 1)
        return np.asarray(x if x.shape[0] >= x.shape[1] else x.T, dtype=float)


def is_numeric(x: Array) -> bool:
    """Whether an array holds real numbers or booleans."""
    return x.dtype.kind in "biuf"


@contextmanager
def damage_named(title: str, file: str) -> Iterator[None]:
    """Turn errors of a file-reading library into InputError, for the duration of the block.

    title : kind of file that is expected, for the message.
    """
    try:
        yield
    except (InputError, ImportError, KeyboardInterrupt, SystemExit):
        raise
    except MemoryError as e:
        message = f"needs more memory than available; if the file is {title}, store the file without compression, or cut the record"
        raise InputError(message, file=file) from e
    except BaseException as e:  # panics of Rust are no Exceptions
        message = f"damaged, or not {title} ({first_line(e)[:200]}); write the file again"
        raise InputError(message, file=file) from None
