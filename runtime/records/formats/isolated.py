"""A table whose file is read by a process of its own: damage that ends a library, or makes it take
all time or memory, ends that process only.

Requests go out as lines of JSON, one at a time: a method of `Table` and its arguments. Answers come
back as a line of JSON, {"value": ...},
{"error": {...}}, or {"arrays": [shapes]} ahead of the float64 numbers of so many arrays in C order,
one line for every block; nothing is pickled.

The limits, all of them here: MEMORY for every file and GROWTH times its size; SECONDS of processor
time and one more for every
BYTES_PER_SECOND, by request. `runtime.records.formats.child` sets them: the memory on Linux, the
time and the size of files wherever POSIX is.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import weakref
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from io import BufferedReader
from tempfile import TemporaryDirectory
from typing import IO, Any, cast

import numpy as np

from runtime.blas import BLAS_THREADS
from runtime.errors import InputError
from runtime.records.formats.columns import BLOCK, Array, Groups, Source, Table

MEMORY = 400 * 2**20  # bytes beyond what the libraries take
GROWTH = 6  # times the size of the file
SECONDS = 3
BYTES_PER_SECOND = 10**6

START = (
    "import sys; sys.path[:] = sys.argv[1:]; from runtime.records.formats.child import serve; "
    "serve()"
)
ONE_THREAD = dict.fromkeys((*BLAS_THREADS, "POLARS_MAX_THREADS", "MALLOC_ARENA_MAX"), "1")


def memory_of(size: int) -> int:
    """Bytes that reading a file of `size` bytes may take."""
    return MEMORY + GROWTH * size


def seconds_of(size: int) -> int:
    """Processor time, s, of one request to a file of `size` bytes."""
    return SECONDS + size // BYTES_PER_SECOND


class Process:
    """The other process: started, asked and ended. It ends with this object, and with the one that
    started it.
    """

    def __init__(self, source: Source) -> None:
        folder = TemporaryDirectory(
            prefix="symgen-record-"
        )  # of the other process, which may be ended before it can tidy up
        self.popen = subprocess.Popen(
            [sys.executable, "-P", "-c", START, *sys.path],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **ONE_THREAD, "TMPDIR": folder.name},
        )
        self.end = weakref.finalize(self, _ended, self.popen, folder)
        place = [str(source.path.absolute()), source.topic, source.decimal]
        self.send([*place, memory_of(source.size), seconds_of(source.size)])

    def send(self, request: Any) -> None:
        """One line of JSON; where the process has ended, the answer that does not come tells."""
        with suppress(BrokenPipeError):
            cast(IO[bytes], self.popen.stdin).write(json.dumps(request).encode() + b"\n")
            cast(IO[bytes], self.popen.stdin).flush()

    def answer(self) -> Any:
        """A value as {"value": ...}, a tuple of arrays, an error as {"error": ...}; None where the
        process has ended.
        """
        pipe = cast(BufferedReader, self.popen.stdout)
        line = pipe.readline()
        answer = json.loads(line) if line.endswith(b"\n") else None
        if answer is None or "arrays" not in answer:
            return answer
        arrays = tuple(np.empty(shape) for shape in answer["arrays"])
        whole = all(pipe.readinto(x.data.cast("B")) == x.nbytes for x in arrays if x.size)
        return arrays if whole else None


@dataclass(eq=False, kw_only=True)
class IsolatedTable(Table):
    """Asks a process for everything. Blocks that are left unread end theirs; a request that comes
    between blocks has another.

    Attributes
    ----------
    source : Source
        The file.
    title : str
        What it should be.
    idle : Process or None
        One that waits for a request.
    """

    source: Source
    title: str
    idle: Process | None = field(default=None, init=False)

    @classmethod
    def of(cls, source: Source, title: str, process: Process) -> IsolatedTable:
        """The table of a file and of a process that waits for requests; InputError where the file
        cannot be opened.
        """
        table = cls(file=source.file, size=source.size, source=source, title=title)
        table.idle = process
        names, joints, table.topic = table._value("describe")
        table.names, table.joints = tuple(names), None if joints is None else tuple(joints)
        return table

    def samples(self, groups: Groups) -> int:
        return int(self._value("samples", groups))

    def note(self, groups: Groups) -> str:
        return "" if self.joints is None else str(self._value("note", groups))

    def blocks(
        self, groups: Groups, size: int = BLOCK, start: int = 0, stop: int | None = None
    ) -> Iterator[tuple[Array, ...]]:
        return self._answers("blocks", groups, size, start, stop)

    def parts(
        self, names: Sequence[str], size: int, start: int = 0, stop: int | None = None
    ) -> Iterator[Sequence[Array]]:
        return self.blocks([[name] for name in names], size, start, stop)

    def widths(self, groups: Groups) -> list[int]:
        return cast(list[int], self._value("widths", groups))

    def scalar(self, name: str) -> float:
        return float(self._value("scalar", name))

    def row(self, i: int) -> str:
        return str(self._value("row", i))

    def __getstate__(self) -> dict[str, Any]:
        """Another process that is sent the table starts one of its own."""
        return {**vars(self), "idle": None}

    def close(self) -> None:
        """End the process."""
        if self.idle is not None:
            self.idle.end()
        self.idle = None

    def _value(self, call: str, *arguments: Any) -> Any:
        (value,) = self._answers(call, *arguments)
        return value

    def _answers(self, call: str, *arguments: Any) -> Iterator[Any]:
        """The value, or the blocks, of a request."""
        process, self.idle = self.idle or Process(self.source), None
        try:
            process.send([call, *arguments])
            while isinstance(answer := process.answer(), tuple):
                yield answer
            if answer is None:
                raise self._death(process.popen.wait())
            self.idle = process
            if "error" in answer:
                raise InputError(**{"file": self.file, **answer["error"]})
            if call != "blocks":
                yield answer["value"]
        finally:
            if self.idle is not process:
                process.end()

    def _death(self, code: int) -> InputError:
        if -code in (signal.SIGXCPU, signal.SIGKILL):
            return InputError(
                f"takes more than {seconds_of(self.size)} s of processor time to read; expected "
                f"{self.title}",
                file=self.file,
            )
        end = signal.Signals(-code).name if code < 0 else f"code {code}"
        return InputError(
            (
                f"damaged, or not {self.title} (the library that reads it ends with {end}); write "
                "it "
                "again"
            ),
            file=self.file,
        )


def _ended(process: subprocess.Popen[bytes], folder: TemporaryDirectory[str]) -> None:
    process.kill()
    process.communicate()
    folder.cleanup()
