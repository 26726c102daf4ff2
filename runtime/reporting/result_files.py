"""Write all result files of one command into a folder, or none of them.

Even an interrupted command leaves only whole files, all of the same run.

    FOLDER/.symgen-unfinished-*/    files being written; if a run was killed, the next run deletes
                                    this folder
    FOLDER/.symgen-finished/        all files, written to disk and being moved up; if a run was
                                    killed, the next run moves the rest

The files become valid by one act, the renaming of .symgen-unfinished-* to .symgen-finished: a run
that is killed before has changed nothing, and a run that is killed later is completed by the next
command that writes into FOLDER. Other files in FOLDER are never changed. If two commands write at
the same time, one of them may have to be repeated.
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

from runtime.ground.errors import InputError, encodable

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
    """Error raised if results cannot be written; the message names the file, reason and remedy."""


class Results:
    """A results folder: a command writes either all its files into this folder, or none."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def write_all(self, contents: Mapping[str, str | bytes]) -> list[Path]:
        """Write every file into the folder, or none; return their paths.

        If a file cannot be written, OutputError is raised. The folder is then as before, or the
        next command completes it.
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
        """Finish an interrupted write: move complete files to their place, delete the others."""
        for unfinished in self.folder.glob(f"{UNFINISHED}*"):
            if unfinished.is_dir() and not unfinished.is_symlink():  # rmtree waits for a pipe
                shutil.rmtree(unfinished, ignore_errors=True)
        finished = self.folder / FINISHED
        if finished.is_symlink() or (finished.exists() and not finished.is_dir()):
            raise OutputError(
                f"{finished}: symgen needs this name for a folder of its own; remove "
                "or rename this file"
            )
        if finished.is_dir():
            with suppress(FileNotFoundError):  # moved by another command
                for path in sorted(finished.iterdir()):
                    path.replace(self.folder / path.name)
                _sync(self.folder)
                finished.rmdir()

    def _finish(self, contents: Mapping[str, str | bytes]) -> None:
        """Write all files to disk in a new folder, then rename this folder to .symgen-finished."""
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
    """Write every file into `folder`, or none; return their paths."""
    with results_in(folder) as results:
        return results.write_all(contents)  # type: ignore[no-any-return]


@contextmanager
def results_in(folder: str | Path | None) -> Iterator[Any]:
    """Yield a Results object for a folder, which is made if missing; yield None if no folder is
    given.

    Raises OutputError if nothing can be written into the folder.
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
    """Raise OutputError if `path` exists but is a link, a folder, a pipe or a device."""
    if path.is_symlink():
        what = "a link"
    elif path.is_dir():
        what = "a folder"
    elif path.exists() and not path.is_file():  # a device would be replaced for every program
        what = "a pipe or a device"
    else:
        return
    raise OutputError(
        f"{path}: a file is to be written here, but {what} has this name; rename {what}, or choose another folder"
    )


@contextmanager
def _new_folder(folder: Path) -> Iterator[None]:
    """Make the folder if it is missing; after the block, delete it again if it is empty.

    A folder that existed before the block is never deleted.
    """
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
    """Give `path` the mode and the owner of the file that it will replace, if that file exists."""
    with suppress(OSError):
        found = replaced.stat()
        with suppress(OSError):  # an owner that this user cannot give
            os.chown(path, found.st_uid, found.st_gid)
        path.chmod(found.st_mode & 0o777)


def _sync(folder: Path) -> None:
    """Write the directory entries of `folder` to disk, if the system can do that."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


@contextmanager
def _clear_errors(folder: Path) -> Iterator[None]:
    """Turn file-system errors inside the block into an OutputError with the folder and a remedy."""
    try:
        yield
    except OSError as e:
        place, reason = "this folder" if folder == Path() else str(folder), e.strerror or e
        with suppress(OSError):
            if (folder / FINISHED).is_dir():
                left = (
                    f"the new files are complete in {folder / FINISHED}, and the next command that "
                    "writes to this folder moves the new files up"
                )
                raise OutputError(
                    f"{place}: not all files could be replaced: {reason} ({e.filename}); {left}"
                ) from e
        advice = ADVICE.get(e.errno or 0, "choose another folder, or repair this folder")
        raise OutputError(
            f"{place}: cannot be written: {reason}; nothing was changed; {advice}"
        ) from e
