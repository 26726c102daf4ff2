"""Runs cases in another process that may hang, run out of memory or die, and tells faults from
clear errors.

Outcomes: "ok"; "refused", an error of this project's own that names the file in a short printable
text; else a fault: any other exception, an unclear message, more than SECONDS of processor time,
more than MEMORY, the death of the process.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import resource
import shutil
import tempfile
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from time import monotonic

from hang import HANG

SECONDS = 5.0  # of processor time
START = 10.0  # s of processor time that a new process takes to import what it needs, at most
WAIT = HANG  # for a reader that waits for something
MEMORY = 1_000_000_000  # bytes, the interpreter and its libraries included
LIFE = 5000  # cases of one process: caches of expressions grow by design
LONGEST = 2500  # characters of a message
ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Outcome:
    """kind : ok, refused or a fault's name.   where : what tells faults apart.   seconds :
    processor time.   peak : bytes, the most so far, with the largest process started.
    """

    kind: str
    where: str = ""
    text: str = ""
    seconds: float = 0.0
    peak: int = 0

    @property
    def fault(self) -> bool:
        return self.kind not in ("ok", "refused")


def judged(
    read: Callable[[Path], object], path: Path, named: tuple[str, ...] = ("case",)
) -> Outcome:
    """What reading the file gives, in this process; an error holds one of the texts `named`."""
    from runtime.ground.errors import InputError
    from symgen.errors import SymgenError

    start = processor_time()
    try:
        read(path)
    except (InputError, SymgenError) as e:
        text, problem = str(e), ""
        if not any(name in text for name in named):
            problem = "names no file"
        elif not text.replace("\n", "").isprintable():
            problem = "holds characters that a terminal obeys"
        elif len(text) > LONGEST:
            problem = f"has more than {LONGEST} characters"
        return Outcome(
            "unclear" if problem else "refused",
            f"{problem} {place(e)}".strip(),
            text[:600],
            processor_time() - start,
        )
    except BaseException as e:
        return Outcome(
            type(e).__name__,
            place(e),
            "".join(traceback.format_exception(e))[-3000:],
            processor_time() - start,
        )
    return Outcome("ok", seconds=processor_time() - start)


def processor_time() -> float:
    """Seconds of this process and of those that it has started and ended."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def place(e: BaseException) -> str:
    """The innermost line of this repository that the exception passed."""
    frames = [
        f
        for f in traceback.extract_tb(e.__traceback__)
        if f.filename.startswith(str(ROOT)) and "/tests/" not in f.filename
    ]
    return f"{Path(frames[-1].filename).name}:{frames[-1].name}" if frames else "outside"


def serve(pipe, folder: Path) -> None:
    """The other process: a format and a case come in, an outcome goes out; cases are files in
    `folder`.
    """
    os.environ.update(OPENBLAS_NUM_THREADS="1", POLARS_MAX_THREADS="1")
    from fuzz.formats import FAULTY, FORMATS

    known = {**FORMATS, "faulty": FAULTY}
    for module in (
        "numpy",
        "scipy.io",
        "polars",
        "h5py",
        "mujoco",
        "symgen.emit",
        "runtime.reading.records",
        "runtime.core.least_squares.estimate",
        "runtime.core.model",
    ):
        __import__(module)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    limited = False
    while True:
        name, content = pipe.recv()
        if not limited:  # after the first case, whose libraries map much that they never touch
            path = written(folder, known[name].ending, b"")
            judged(known[name].read, path)
            resource.setrlimit(
                resource.RLIMIT_DATA, (memory("VmData") - memory("VmRSS") + MEMORY,) * 2
            )
            limited = True
        path = written(folder, known[name].ending, content)
        outcome = judged(known[name].read, path, known[name].named)
        pipe.send(
            replace(
                outcome,
                peak=memory("VmHWM")
                + 1024 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss,
            )
        )


def memory(key: str) -> int:
    """Bytes of this process that the system calls so."""
    status = dict(
        line.split(":", 1)
        for line in Path("/proc/self/status").read_text().splitlines()
        if ":" in line
    )
    return 1024 * int(status[key].split()[0])


def written(folder: Path, ending: str, content: bytes) -> Path:
    """The case as a file in an empty folder."""
    for entry in folder.iterdir():
        shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
    path = folder / f"case.{ending}"
    path.write_bytes(content)
    return path


class Reader:
    """A process that reads cases; a new one where it dies."""

    def __init__(self, seconds: float = SECONDS) -> None:
        self.seconds = seconds
        self.process, self.pipe, self.folder, self.served = None, None, None, 0

    def __call__(self, name: str, content: bytes) -> Outcome:
        if self.process is None or self.served >= LIFE:
            self.close()
            self._start()
        self.served += 1
        with suppress(BrokenPipeError):  # then its end is met below
            self.pipe.send((name, content))
        begun, used = monotonic(), self._used()
        while not self.pipe.poll(0.2):
            if (
                self._used() - used > self.seconds + START * (self.served == 1)
                or monotonic() - begun > WAIT
            ):
                self.close()
                return Outcome(
                    "hang",
                    "waits" if monotonic() - begun > WAIT else "computes",
                    f"more than {self.seconds} s",
                )
        try:
            outcome = self.pipe.recv()
        except (EOFError, ConnectionError):
            self.process.join()
            code = self.process.exitcode
            self.close()
            return Outcome("death", f"exit code {code}", "the interpreter ended")
        if outcome.seconds > self.seconds:
            return Outcome("hang", "computes", f"{outcome.seconds:.1f} s")
        return outcome

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.folder = tempfile.TemporaryDirectory(
            prefix="fuzz-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None
        )
        self.process = context.Process(
            target=serve, args=(other, Path(self.folder.name)), daemon=True
        )
        self.process.start()
        other.close()
        self.served = 0

    def _used(self) -> float:
        """Processor seconds of the process so far."""
        try:
            fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return 0.0
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def close(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.join()
            self.pipe.close()
            self.folder.cleanup()
        self.process = None


def case(name: str, seed: int, number: int) -> bytes:
    """The bytes of a case."""
    from fuzz.formats import FORMATS

    return FORMATS[name].make(random.Random(f"{name} {seed} {number}"))


def run(
    reader: Reader, name: str, seed: int, numbers: range
) -> Iterator[tuple[int, bytes, Outcome]]:
    """Outcomes of cases."""
    for number in numbers:
        content = case(name, seed, number)
        yield number, content, reader(name, content)


def smaller(reader: Reader, name: str, content: bytes, like: Outcome, tries: int) -> bytes:
    """A smaller case of the same fault: parts are left out while it stays."""
    size = len(content) // 2
    while size and tries > 0:
        at = 0
        while at < len(content) and tries > 0:
            shorter = content[:at] + content[at + size :]
            tries -= 1
            found = reader(name, shorter)
            if (found.kind, found.where) == (like.kind, like.where):
                content = shorter
            else:
                at += size
        size //= 2
    return content


def report(counts: dict[str, dict[str, float]]) -> str:
    """Counts as JSON text."""
    return json.dumps(counts, indent=2) + "\n"
