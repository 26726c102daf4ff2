"""Results of one command in one folder: every file whole, the set of one run, never of two,
whatever interrupts.

    FOLDER/.symgen-lock
            the process that writes here: number, host, since when; locked as long as it lives
    FOLDER/.symgen-unfinished/  files being written; what a killed run left is deleted by the next
    one
    FOLDER/.symgen-finished/
            all of them written and on disk, being moved up; what a killed run left is moved by the
            next one

The set becomes valid by one act, the renaming of .symgen-unfinished to .symgen-finished: a run
killed before it has changed nothing, one killed
after it is completed by the next command that writes into FOLDER. Other files in FOLDER are never
touched. The lock is one of the system and
ends with its process, so what a killed process left of it is no obstacle; where a file system knows
no locks, and on Windows, there is none.
"""

from __future__ import annotations

import errno
import os
import shutil
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from runtime.errors import InputError, encodable

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

LOCK, UNFINISHED, FINISHED = ".symgen-lock", ".symgen-unfinished", ".symgen-finished"
PATIENCE = 30.0  # s, for another command that is just writing
NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)
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
    """A folder that only this process writes results into; made by `reserved`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def write_all(self, contents: Mapping[str, str | bytes]) -> list[Path]:
        """Write every file, or none; raises OutputError where one cannot be written, FOLDER being
        as it was.
        """
        unfinished = self.folder / UNFINISHED
        with _clear_errors(self.folder):
            self.recover()
            for name in contents:
                path = self.folder / name
                if (
                    path.exists() and not path.is_file()
                ):  # a device would be replaced by a file, for every program
                    what = "a folder" if path.is_dir() else "a pipe or a device"
                    raise OutputError(
                        f"{path}: {what} is where a file is to be written; rename it, or choose "
                        "another place"
                    )
            unfinished.mkdir()
            try:
                for name, content in contents.items():
                    _write_durably(
                        unfinished / name,
                        encodable(content).encode("utf-8") if isinstance(content, str) else content,
                    )
                _sync(unfinished)
                unfinished.rename(self.folder / FINISHED)
            except BaseException:
                shutil.rmtree(unfinished, ignore_errors=True)
                raise
            self.recover()
        return [self.folder / name for name in contents]

    def recover(self) -> None:
        """Move up what is finished, delete what is not."""
        finished, unfinished = self.folder / FINISHED, self.folder / UNFINISHED
        if finished.is_dir():
            for path in sorted(finished.iterdir()):
                path.replace(self.folder / path.name)
            _sync(self.folder)
            finished.rmdir()
        if unfinished.is_dir():
            shutil.rmtree(unfinished)


def write_all(folder: str | Path, contents: Mapping[str, str | bytes]) -> list[Path]:
    """Write every file into `folder`, or none, after whoever is just writing there; their paths."""
    with reserved(folder, PATIENCE) as results:
        return results.write_all(contents)  # type: ignore[no-any-return]


@contextmanager
def reserved(folder: str | Path | None, patience: float = 0.0) -> Iterator[Any]:
    """Keep other commands out of `folder`, made where it is missing, as long as the block lasts;
    the context gives it as `Results`, or None, where nothing is to be written.

    Raises OutputError where another command holds the folder for longer than `patience`, s, or
    nothing can be written there.
    """
    if folder is None:
        yield None
        return
    results = Results(Path(folder))
    with _made(results.folder), _locked(results.folder, patience):
        with _clear_errors(results.folder):
            results.recover()
        yield results


@contextmanager
def _made(folder: Path) -> Iterator[None]:
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


@contextmanager
def _locked(folder: Path, patience: float) -> Iterator[None]:
    """The lock file is ours and says so; OutputError where it is another's for longer than
    `patience`, s.

    A lock of `fcntl` belongs to a process, not to its children, and is known to network file
    systems.
    """
    path, end = folder / LOCK, time.monotonic() + patience
    while True:
        with _clear_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)  # its maker may have failed and removed it
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
        try:
            with _clear_errors(folder):
                ours = _taken(descriptor) and _is(path, descriptor)
                holder = os.read(descriptor, 300).decode(errors="replace")
            if ours:
                with suppress(OSError):  # on a full disk nobody learns who it is
                    os.ftruncate(descriptor, 0)
                    os.pwrite(descriptor, _holder().encode(), 0)
                try:
                    yield
                finally:
                    with suppress(OSError):  # before it is released: the next one makes its own
                        path.unlink()
                return
        finally:
            os.close(descriptor)
        if time.monotonic() >= end:
            who = (
                "".join(c if c.isprintable() else " " for c in holder)
                or "it does not say who it is"
            )
            raise OutputError(
                f"{folder}: another command is writing here ({who}); wait until it ends, or choose "
                "another folder"
            )
        time.sleep(0.02)


def _taken(descriptor: int) -> bool:
    """The lock is ours, or there are no locks here; False: it is another process's."""
    if fcntl is None:
        return True
    try:
        fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as e:
        if e.errno in NO_LOCKS:
            return True
        if e.errno in (errno.EACCES, errno.EAGAIN):
            return False
        raise
    return True


def _is(path: Path, descriptor: int) -> bool:
    """The file of that name is the one that is open, not one that its holder has deleted
    meanwhile.
    """
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _holder() -> str:
    return (
        f"process {os.getpid()} on {socket.gethostname()} since "
        f"{time.strftime('%Y-%m-%d %H:%M:%S UTC', time.gmtime())}"
    )


def _write_durably(path: Path, data: bytes) -> None:
    with path.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


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
    """What the system says, with the place and what to do."""
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
