"""Storage of the runs of a long study on disk, so that an interrupted study can continue.

    FOLDER/runs.npz     level, run, X, residual_norm of the runs; `study`, JSON of what makes them:
                        settings, hashes of record and model, versions

The file is written whole under another name and then renamed. A study continues only if `study` is
the same, except for the number of runs. Each run depends on its key alone, so the result has the
same bits as that of an uninterrupted study.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from time import monotonic
from typing import Any
from zipfile import BadZipFile

import numpy as np

from runtime.core.cestac.runs import Runs
from runtime.ground.errors import InputError

ARCHIVE_PERIOD = 30.0
"""Time after which the runs of a study are written again, s."""

FILE = "runs.npz"
UNFINISHED = ".unfinished"


class Checkpoint:
    """The file that stores the finished runs of a study, so that the study can continue later.

    The file is written every `every` seconds and by `flush`.
    """

    def __init__(self, folder: str | Path, *, every: float = ARCHIVE_PERIOD) -> None:
        self.file = Path(folder) / FILE
        self.every = every
        self.written = 0  # runs on disk
        self._study = ""
        self._runs: list[Runs] = []
        self._last = monotonic()

    @property
    def kept(self) -> str:
        """What is on disk: the number of runs and their file; "" if there are none."""
        return f"{self.written} runs are in {self.file}" if self.written else ""

    def resume(self, identity: Mapping[str, Any], b: int) -> Runs:
        """Return the runs that were stored before an interruption, with b parameters each.

        identity : JSON values that differ between different studies.

        Raises
        ------
        InputError
            The runs are those of another study, or the file is damaged.
        """
        for path in (self.file, self.file.with_name(FILE + UNFINISHED)):
            if path.is_symlink() or (path.exists() and not path.is_file()):
                raise InputError(
                    "the runs are saved in a file of this name, but a link, a folder, a pipe or a device has this name; "
                    "rename that entry, or choose another folder",
                    file=str(path),
                )
        self._study = json.dumps(identity, sort_keys=True)
        self._last = monotonic()
        self._runs = [self._read(b)] if self.file.exists() else [Runs.of((), b)]
        self.written = len(self._runs[0])
        return self._runs[0]

    def add(self, runs: Runs) -> None:
        """Add new runs; write all runs if the last write is more than `every` seconds ago."""
        self._runs.append(runs)
        if monotonic() - self._last > self.every:
            self.flush()

    def flush(self) -> None:
        """Write all runs to disk, if there are new ones."""
        runs = Runs.joined(self._runs, self._runs[0].X.shape[1])
        if len(runs) > self.written:
            unfinished = self.file.with_name(FILE + UNFINISHED)
            try:
                self.file.parent.mkdir(parents=True, exist_ok=True)
                with unfinished.open("wb") as file:
                    np.savez(file, study=self._study, **vars(runs))
                    file.flush()
                    os.fsync(file.fileno())
                unfinished.replace(self.file)
            except OSError as e:
                unfinished.unlink(missing_ok=True)
                raise InputError(
                    f"the file cannot be written: {e.strerror or e}; {self.written} runs are "
                    "saved: free space on the disk, and repeat the command to continue",
                    file=str(self.file),
                ) from e
            self.written = len(runs)
        self._runs = [runs]
        self._last = monotonic()

    def remove(self) -> None:
        """Delete the file of runs; call this when the results are saved in other files."""
        self.file.unlink(missing_ok=True)
        self.file.with_name(FILE + UNFINISHED).unlink(missing_ok=True)

    def _read(self, b: int) -> Runs:
        """Read the runs from the file; raise InputError if it is damaged or belongs to another
        study.

        Pickled objects are refused.
        """
        try:
            with np.load(self.file, allow_pickle=False) as archive:
                study = str(archive["study"])
                runs = Runs(**{name: archive[name] for name in Runs.__dataclass_fields__})
            earlier = dict(json.loads(study))
        except (
            OSError,
            ValueError,
            KeyError,
            TypeError,
            EOFError,
            RecursionError,
            BadZipFile,
        ) as e:
            raise InputError(
                f"the file is damaged ({e}); delete this file, and the runs are computed again",
                file=str(self.file),
            ) from e
        identity = json.loads(self._study)
        keys = sorted({*earlier, *identity})
        other = [key for key in keys if earlier.get(key) != identity.get(key)]
        if other:
            raise InputError(
                f"the file contains runs of another study (different: {', '.join(other)}); use "
                "another folder, or delete this file",
                file=str(self.file),
            )
        R = len(runs.run)
        if [x.shape for x in vars(runs).values()] != [(R,), (R,), (R, b), (R,)]:
            raise InputError(
                f"the file contains arrays that do not fit {R} runs of {b} parameters; delete this "
                "file, and the runs are computed again",
                file=str(self.file),
            )
        return runs
