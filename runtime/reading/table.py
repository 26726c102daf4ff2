"""A measured file in memory: named columns of numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from runtime.core.clock import sample
from runtime.core.errors import InputError, first_line

Array = np.ndarray

WIDEST = 10_000  # columns of a file; a wider one is no table of samples


@dataclass(frozen=True)
class Options:
    """Settings of a record about its files.

    Attributes
    ----------
    topic : str or None
        Of a bag; None: the only one that holds sensor_msgs/JointState.
    decimal : str
        "." or ",", within the numbers of a text file.
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
        Numbers by name: a vector of N samples, or a matrix (N, k) or (k, N) that has k columns. Samples run along the longer side: a record has more samples than joints.
    refused : mapping of str to InputError
        What else the file holds under a name.
    empty : mapping of str to str
        Row of the first empty field of a column, which is nan.
    row : callable
        How the file counts sample i, from 0: "line 12", "sample 12".
    joints : tuple of str or None
        Joints that the messages of a bag name; None for other files.
    topic : str
        Of a bag.
    note : str
        What a reader of these columns should know, a sentence.
    has_header : bool
        Whether the names are the first line of a text.
    what : str
        What the file is, in messages.
    digest : str
        SHA-256 of the uncompressed bytes.
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
    what: str = "the file"
    digest: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, or of matrices with several columns."""
        return tuple(self.columns)

    def chosen(self, names: Sequence[str]) -> Table:
        """The table of the samples that hold these columns; for most files, all samples.

        Rows whose columns are all empty but the time come from another source, and are left out.
        """
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
        """These columns side by side, shape (N, k); InputError for names that the file has not, and for what is no number.

        Parameters
        ----------
        empty : bool
            Whether fields may be empty; they are nan.
        hint : str
            What to do about an empty field.
        """
        for name in names:
            if name in self.refused:
                raise self.refused[name]
            if name in self.empty and not empty:
                raise InputError(
                    f"an empty field; expected a number{hint}",
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
            raise InputError(f"columns of different lengths: {listed}", file=self.file)
        return columns[0] if len(columns) == 1 else np.hstack(columns)

    def scalar(self, name: str) -> float:
        """The single number called `name`."""
        if name in self.refused:
            raise self.refused[name]
        if name not in self.columns:
            raise InputError(
                f"no single number {name!r} in {self.what}; write the number itself in the settings",
                file=self.file,
            )
        x = self.columns[name]
        if x.size != 1:
            raise InputError(
                f"{x.shape} values; expected a single number", file=self.file, column=name
            )
        return float(x.reshape(()))

    def _by_samples(self, name: str) -> Array:
        """The array of that name, shape (N, k), if it is one of samples."""
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
    """Whether these are real numbers; booleans are."""
    return x.dtype.kind in "biuf"


@contextmanager
def damage_named(title: str, file: str) -> Iterator[None]:
    """Turn any error of a library on damaged bytes into one InputError with `title`."""
    try:
        yield
    except (InputError, ImportError, KeyboardInterrupt, SystemExit):
        raise
    except MemoryError as e:
        message = f"needs more memory than there is; store it without compression, or cut it, if it is {title}"
        raise InputError(message, file=file) from e
    except BaseException as e:  # panics of Rust are no Exceptions
        message = f"damaged, or not {title} ({first_line(e)[:200]}); write it again"
        raise InputError(message, file=file) from None
