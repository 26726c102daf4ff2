"""Runs of a long study on disk, so that it can be killed and go on.

    FOLDER/runs/study.json
            what makes the runs: settings, hashes of record and model, versions
    FOLDER/runs/000000.npz ...
            the runs, some thousand in each: level, run, X, residual_norm

Every file is written whole under another name and then renamed; an archive once written is not
touched again. A study goes on only where study.json
says the same, number of runs aside. Runs depend on their key alone, so a resumed study has the bits
of an uninterrupted one.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from runtime.errors import InputError
from runtime.limits import LIMIT
from runtime.reading.numpy_files import archive_of
from runtime.resolution.runs import Runs

FOLDER = "runs"
STUDY, UNFINISHED = "study.json", ".unfinished"


class Checkpoint:
    """The runs of one study in FOLDER/runs; nothing is written before the first `every` seconds, or
    `flush`.

    Parameters
    ----------
    folder : str or Path
    every : float, s
        Between two archives.
    clock : callable
        Time, s.
    """

    def __init__(
        self,
        folder: str | Path,
        *,
        every: float = LIMIT.ARCHIVE_PERIOD,
        clock: Callable[[], float] = monotonic,
    ) -> None:
        self.folder, self.every, self.clock = Path(folder) / FOLDER, every, clock
        self.written = 0  # runs on disk
        self._identity: Mapping[str, Any] = {}
        self._new: list[Runs] = []
        self._last = clock()

    def resume(self, identity: Mapping[str, Any], b: int) -> Runs:
        """The runs that an earlier, interrupted study left.

        Parameters
        ----------
        identity : mapping
            JSON values that tell studies apart.
        b : int
            Parameters of a run.

        Raises
        ------
        InputError
            The runs are those of another study, or a file is damaged.
        """
        self._identity, self._last = json.loads(json.dumps(identity)), self.clock()
        for left in self.folder.glob(f"*{UNFINISHED}"):
            left.unlink()
        if not (self.folder / STUDY).is_file():
            return Runs.of((), b)
        self._compare(_json(self.folder / STUDY))
        runs = Runs.joined([_read(path, b) for path in self._archives()], b)
        self.written = len(runs)
        return runs

    def add(self, runs: Runs) -> None:
        """Take new runs; write them when it is time."""
        self._new.append(runs)
        if self.clock() - self._last > self.every or sum(map(len, self._new)) >= LIMIT.ARCHIVE_RUNS:
            self.flush()

    def flush(self) -> None:
        """Write what was taken since the last archive."""
        count = sum(map(len, self._new))
        if count:
            try:
                self._write(Runs.joined(self._new, self._new[0].X.shape[1]))
            except OSError as e:
                self._leave_no_empty_folder()
                raise InputError(
                    (
                        f"cannot be written: {e.strerror or e}; {self.written} runs are safe, make "
                        "room and repeat the command to go on"
                    ),
                    file=str(self.folder),
                ) from e
            self.written += count
        self._new, self._last = [], self.clock()

    def remove(self) -> None:
        """Delete the archives, once other files hold their runs."""
        for path in [*self._archives(), self.folder / STUDY]:
            path.unlink(missing_ok=True)
        self._leave_no_empty_folder()

    def _leave_no_empty_folder(self) -> None:
        with suppress(OSError):  # not empty, or missing
            self.folder.rmdir()

    def _archives(self) -> list[Path]:
        return sorted(self.folder.glob("[0-9]*.npz"))

    def _write(self, runs: Runs) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        if not (self.folder / STUDY).is_file():
            _write_whole(
                self.folder / STUDY, (json.dumps(self._identity, indent=2) + "\n").encode("utf-8")
            )
        data = BytesIO()
        np.savez(data, **{name: getattr(runs, name) for name in Runs.__dataclass_fields__})
        archives = self._archives()
        number = int(archives[-1].stem) + 1 if archives else 0
        _write_whole(self.folder / f"{number:06d}.npz", data.getvalue())

    def _compare(self, earlier: Mapping[str, Any]) -> None:
        other = sorted(
            key
            for key in {*earlier, *self._identity}
            if earlier.get(key) != self._identity.get(key)
        )
        if other:
            raise InputError(
                (
                    f"holds runs of another study, {', '.join(other)} differ; use another folder, "
                    "or "
                    "delete this one"
                ),
                file=str(self.folder),
            )


def _write_whole(path: Path, data: bytes) -> None:
    """The file appears complete or not at all; the unfinished one is removed, whatever happens
    short of a kill.
    """
    unfinished = path.with_name(path.name + UNFINISHED)
    try:
        with unfinished.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        unfinished.replace(path)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise


def _json(path: Path) -> Mapping[str, Any]:
    try:
        study = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as e:
        raise InputError(
            f"cannot be read ({e}); delete {path.parent} to start again", file=str(path)
        ) from e
    if not isinstance(study, dict):
        raise InputError(
            f"not the settings of a study; delete {path.parent} to start again", file=str(path)
        )
    return study


def _read(path: Path, b: int) -> Runs:
    """The runs of one archive; pickled objects are refused."""
    try:
        archive = archive_of(path)
        runs = Runs(**{name: archive[name] for name in Runs.__dataclass_fields__})
    except (InputError, KeyError) as e:
        reason = e.message if isinstance(e, InputError) else f"no array {e}"
        raise InputError(
            f"damaged ({reason}); delete this file, its runs are computed again", file=str(path)
        ) from e
    R = len(runs)
    shapes = {
        name: (getattr(runs, name).shape, getattr(runs, name).dtype.kind)
        for name in Runs.__dataclass_fields__
    }
    wanted = {
        "level": ((R,), "i"),
        "run": ((R,), "i"),
        "X": ((R, b), "f"),
        "residual_norm": ((R,), "f"),
    }
    if shapes != wanted:
        raise InputError(
            f"holds {shapes}; expected {wanted}; delete this file, its runs are computed again",
            file=str(path),
        )
    return runs
