"""Results of one command in one folder: every file whole, the set of one run, never of two,
whatever interrupts.

    FOLDER/.symgen-unfinished-*/    files being written; what a killed run left is deleted by the
                                    next one
    FOLDER/.symgen-finished/        all of them written and on disk, being moved up; what a killed
                                    run left is moved by the next one

The set becomes valid by one act, the renaming of .symgen-unfinished-* to .symgen-finished: a run
killed before it has changed nothing, one killed after it is completed by the next command that
writes into FOLDER. Other files in FOLDER are never touched. Of two commands that write at once, one
may have to be repeated.
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from runtime.core.errors import InputError, encodable

UNFINISHED = ".symgen-unfinished-"
FINISHED = ".symgen-finished"
TRIES = 3  # where another command deletes what this one is writing
ADVICE = {
    errno.ENOSPC: "make room and repeat the command",
    errno.EDQUOT: "make room and repeat the command",
    errno.EFBIG: "raise the limit of file sizes (ulimit -f) and repeat the command",
    errno.EACCES: "choose a folder you may write to",
    errno.EPERM: "choose a folder you may write to",
    errno.EROFS: "choose a folder you may write to",
    errno.EEXIST: "a file is where a folder is expected; choose another name",
    errno.ENOTDIR: "a file is where a folder is expected; choose another name",
    errno.ENAMETOOLONG: "choose a shorter name",
}


class OutputError(InputError):
    """Results that cannot be written: where, why, what to do."""


class Results:
    """A folder for results; made by `results_in`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def write_all(self, contents: Mapping[str, str | bytes]) -> list[Path]:
        """Write every file, or none; raises OutputError where one cannot be written, FOLDER being
        as it was.
        """
        with _clear_errors(self.folder):
            self.recover()
            for name in contents:
                _require_plain(self.folder / name)
            for attempt in range(TRIES):
                try:
                    self._finish(contents)
                    break
                except FileNotFoundError:
                    if attempt == TRIES - 1:
                        raise
            self.recover()
        return [self.folder / name for name in contents]

    def recover(self) -> None:
        """Move up what is finished, delete what is not."""
        for unfinished in self.folder.glob(f"{UNFINISHED}*"):
            if unfinished.is_dir() and not unfinished.is_symlink():  # rmtree waits for a pipe
                shutil.rmtree(unfinished, ignore_errors=True)
        finished = self.folder / FINISHED
        if finished.is_symlink() or (finished.exists() and not finished.is_dir()):
            raise OutputError(f"{finished}: not a folder of this program; remove it")
        if finished.is_dir():
            with suppress(FileNotFoundError):  # moved by another command
                for path in sorted(finished.iterdir()):
                    path.replace(self.folder / path.name)
                _sync(self.folder)
                finished.rmdir()

    def _finish(self, contents: Mapping[str, str | bytes]) -> None:
        """All files in one folder, on disk, that is then called FINISHED."""
        unfinished = Path(mkdtemp(prefix=UNFINISHED, dir=self.folder))
        try:
            for name, content in contents.items():
                data = encodable(content).encode("utf-8") if isinstance(content, str) else content
                _write_durably(unfinished / name, data)
                _keep_rights(unfinished / name, self.folder / name)
            _sync(unfinished)
            unfinished.rename(self.folder / FINISHED)
        except BaseException:
            shutil.rmtree(unfinished, ignore_errors=True)
            raise


def write_all(folder: str | Path, contents: Mapping[str, str | bytes]) -> list[Path]:
    """Write every file into `folder`, or none; their paths."""
    with results_in(folder) as results:
        return results.write_all(contents)  # type: ignore[no-any-return]


@contextmanager
def results_in(folder: str | Path | None) -> Iterator[Any]:
    """The folder, made where it is missing, as `Results`; None, where nothing is to be written.

    Raises OutputError where nothing can be written there.
    """
    if folder is None:
        yield None
        return
    results = Results(Path(folder))
    with _new_folder(results.folder):
        with _clear_errors(results.folder):
            results.recover()
            Path(mkdtemp(prefix=UNFINISHED, dir=results.folder)).rmdir()  # it can be written
        yield results


def _require_plain(path: Path) -> None:
    """OutputError where something else than a file has the name of one that is to be written."""
    if path.is_symlink():
        what = "a link"
    elif path.is_dir():
        what = "a folder"
    elif path.exists() and not path.is_file():  # a device would be replaced for every program
        what = "a pipe or a device"
    else:
        return
    raise OutputError(
        f"{path}: {what} is where a file is to be written; rename it, or choose another place"
    )


@contextmanager
def _new_folder(folder: Path) -> Iterator[None]:
    """The folder is there; if it was not before and nothing was written, it is not afterwards."""
    with _clear_errors(folder):
        made = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        with suppress(OSError):  # not empty
            for path in made:
                path.rmdir()


def _write_durably(path: Path, data: bytes) -> None:
    with path.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _keep_rights(path: Path, replaced: Path) -> None:
    """Mode and owner of the file that `path` is going to replace, where there is one."""
    with suppress(OSError):
        found = replaced.stat()
        with suppress(OSError):  # an owner that this user cannot give
            os.chown(path, found.st_uid, found.st_gid)
        path.chmod(found.st_mode & 0o777)


def _sync(folder: Path) -> None:
    """The names in `folder` on disk, where the system can do that."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


@contextmanager
def _clear_errors(folder: Path) -> Iterator[None]:
    """Turn errors of the file system into messages with the folder and what to do."""
    try:
        yield
    except OSError as e:
        place, reason = "this folder" if folder == Path() else str(folder), e.strerror or e
        with suppress(OSError):
            if (folder / FINISHED).is_dir():
                left = (
                    f"the new files are whole in {folder / FINISHED} and the next command that "
                    "writes here moves them up"
                )
                raise OutputError(
                    f"{place}: not all files could be replaced: {reason} ({e.filename}); {left}"
                ) from e
        advice = ADVICE.get(e.errno or 0, "choose another place, or mend this one")
        raise OutputError(
            f"{place}: cannot be written: {reason}; nothing was changed; {advice}"
        ) from e
