"""The process that reads one file for `runtime.records.formats.isolated`, within its limits."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from time import process_time
from typing import Any, BinaryIO

import numpy as np

from runtime.errors import InputError, first_line
from runtime.files import allowed
from runtime.records.formats.columns import Source, Table
from runtime.records.formats.table import Format, format_of, needed


def serve() -> None:
    """Answer requests until there are no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what libraries print is no answer
    path, topic, decimal, memory, seconds = json.loads(sys.stdin.buffer.readline())
    source = Source(Path(path), topic, decimal)
    format_ = format_of(source.path)
    with suppress(BaseException):  # told where the file is asked for
        load(format_)
    try:
        answer_requests(source, format_, answers, memory, seconds)
    finally:
        with suppress(OSError, KeyError):  # the process that asked may have ended before it can
            Path(os.environ["TMPDIR"]).rmdir()


def answer_requests(
    source: Source, format_: Format, answers: BinaryIO, memory: int, seconds: int
) -> None:
    """Until the pipe of requests is closed."""
    table: Table | None = None
    for request in sys.stdin.buffer:
        try:
            if table is None:
                load(format_)
                limit_memory(memory, allowed(source.size))
            limit_time(seconds)
            table = table or format_.open(source)
            for answer in results(table, *json.loads(request)):
                send(answers, answer)
        except BrokenPipeError:
            return
        except BaseException as e:  # panics of Rust are no Exceptions
            send(answers, {"error": described(e, format_, memory)})


def load(format_: Format) -> None:
    """The libraries that read the file."""
    for library in format_.libraries:
        import_module(library)


def results(table: Table, call: str, *arguments: Any) -> Iterator[Any]:
    """What a method of the table gives: its value, or its blocks, which are tuples of arrays, and
    then None.
    """
    if call == "describe":
        yield {"value": [table.names, table.joints, table.topic]}
    elif call == "blocks":
        yield from table.blocks(*arguments)
        yield {"value": None}
    else:
        yield {"value": getattr(table, call)(*arguments)}


def send(answers: BinaryIO, answer: Any) -> None:
    """One line of JSON, and the arrays of a block."""
    arrays = answer if isinstance(answer, tuple) else ()
    head = {"arrays": [x.shape for x in arrays]} if arrays else answer
    answers.write(json.dumps(head).encode() + b"\n")
    for x in arrays:
        answers.write(np.ascontiguousarray(x, dtype=float).data)
    answers.flush()


def described(e: BaseException, format_: Format, memory: int) -> dict[str, str | None]:
    """Arguments of the InputError that tells what went wrong."""
    if isinstance(e, InputError):
        given = {"message": e.message, "file": e.file, "column": e.column, "row": e.row}
        return {key: value for key, value in given.items() if value is not None}
    if isinstance(e, ImportError):
        return {"message": needed(format_)}
    if isinstance(e, MemoryError):
        return {
            "message": (
                f"needs more than {memory // 2**20} MiB of memory to be read; store it "
                f"without compression, or cut it, if it is {format_.title}"
            )
        }
    return {"message": f"damaged, or not {format_.title} ({first_line(e)[:200]}); write it again"}


def limit_memory(memory: int, largest_file: int) -> None:
    """At most `memory` bytes more (Linux), no file larger than `largest_file`, no core."""
    with suppress(ImportError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))
        with suppress(OSError):
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            limit = pages * resource.getpagesize() + memory
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def limit_time(seconds: int) -> None:
    """From now on at most `seconds` of processor time."""
    with suppress(ImportError):
        import resource

        _, hard = resource.getrlimit(resource.RLIMIT_CPU)
        resource.setrlimit(resource.RLIMIT_CPU, (int(process_time()) + 1 + seconds, hard))
