"""Run `symgen` commands in separate processes, one at a time; the other commands wait in a queue.

A command that is cancelled, or whose server ends, leaves no process and no file: its process group
is interrupted, then killed. Its folder of results is deleted unless it is complete.
"""

from __future__ import annotations

import asyncio
import json
import os
import shlex
import shutil
import signal
import time
from asyncio.subprocess import PIPE
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.reporting.result_files import write_all
from runtime.threads import BLAS_THREADS

GRACE = 3.0  # s, between the interrupt and the kill
OUTPUT_KEPT = 500_000  # characters of what a command says that are kept
MOST_COMMANDS = 40  # commands in the queue
TIMES = "times.json"  # how long the last command of each task took, s
LINES = "SYMGEN_LINES"  # as symgen.cli.told reads it
WAITING, RUNNING, DONE, FAILED, CANCELLED = "waiting", "running", "done", "failed", "cancelled"


@dataclass
class Job:
    """One `symgen` command in the queue of the studio.

    Attributes
    ----------
    number : int
    title : str
        Name of its task on the page; among commands with the same title only the last counts.
    words : tuple of str
        The command line.
    terminal : str
        Command that does the same in a terminal, if the studio uses a command of its own.
    result : str
        Name of the file that it writes in the work folder; the command failed if the file is
        missing.
    run : str
        Name of its folder of results; "" if it has none.
    state : str
        waiting, running, done, failed or cancelled.
    code : int or None
        Its exit code.
    progress, output : str
        Text of its error stream and of its standard output.
    started : float
        Time of its start, on the monotonic clock, s.
    dismissed : bool
        Whether the user has taken note of its failure.
    """

    number: int
    title: str
    words: tuple[str, ...]
    result: str
    run: str = ""
    terminal: str = ""
    state: str = WAITING
    code: int | None = None
    progress: str = ""
    output: str = ""
    started: float = 0.0
    dismissed: bool = False
    process: Any = None

    @property
    def command(self) -> str:
        """The command line that does the same in a terminal."""
        return self.terminal or shlex.join(self.words)

    @property
    def task(self) -> str:
        """Its title without the number of its run, such as ols for 03-ols."""
        return self.title.partition("-")[2] if self.run else self.title

    @property
    def open(self) -> bool:
        """Whether the command is unfinished: it waits in the queue, or it runs."""
        return self.state in (WAITING, RUNNING)

    def told(self, key: str) -> list[Any]:
        """Values of a key in the JSON lines of the error stream (`symgen.cli.told`), in order."""
        return [line[key] for line in lines_of(self.progress) if key in line]

    @property
    def said(self) -> list[str]:
        """Parts of the work and notes, and lines that are no JSON, in order."""
        lines = lines_of(self.progress)
        return [str(line[k]) for line in lines for k in ("stage", "note", "text") if k in line]

    @property
    def counted(self) -> tuple[int, int] | None:
        """Numbers of finished steps and of all steps; None before the first number is known."""
        pairs = zip(self.told("done")[-1:], self.told("total")[-1:], strict=False)
        return next(((done, total) for done, total in pairs if total), None)

    @property
    def last(self) -> str:
        """Error of the command, or else its last line of text or its exit code."""
        words = self.told("error") or self.said or [f"exit code {self.code}"]
        return str(words[-1])

    def signal(self, number: signal.Signals) -> None:
        """Send a signal to the process of the command and to its child processes."""
        if self.process is not None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self.process.pid, number)


class Jobs:
    """A queue of commands that run one after the other, each in a process of its own.

    Parameters
    ----------
    folder : Path
        Folder in which commands run.
    programs : mapping of str to list of str
        Program and arguments that replace the first word of a command.
    changed : callable
        Called without arguments after every change.
    """

    def __init__(
        self, folder: Path, programs: Mapping[str, list[str]], changed: Callable[[], None]
    ) -> None:
        self.folder, self.programs, self.changed = folder, programs, changed
        self.all: list[Job] = []
        self.wake = asyncio.Event()
        self.times = _times(folder)

    def add(
        self, title: str, words: Sequence[str], result: str, *, run: str = "", terminal: str = ""
    ) -> None:
        """Queue a command; a waiting or running command with the same title is cancelled."""
        for job in self.all:
            if job.title == title:
                self.cancel(job)
        if sum(job.open for job in self.all) >= MOST_COMMANDS:
            raise ValueError(
                f"{MOST_COMMANDS} commands are waiting already; cancel some commands, or wait"
            )
        number = self.all[-1].number + 1 if self.all else 1
        self.all.append(Job(number, title, tuple(words), result, run, terminal))
        self.wake.set()
        self.changed()

    @property
    def shown(self) -> list[Job]:
        """List the commands that are open, and the failed commands that were neither dismissed nor
        followed by a successful command of the same task.
        """
        done = {job.task: job.number for job in self.all if job.state == DONE}
        return [
            job
            for job in self.all
            if job.open
            or (not job.dismissed and job.state != DONE and job.number > done.get(job.task, 0))
        ]

    def left(self, job: Job) -> float | None:
        """Expected time until a running command ends, s; None if it is unknown.

        The time follows from the finished steps, or from the last command of the same task.
        """
        passed = time.monotonic() - job.started
        if job.state != RUNNING:
            return None
        if job.counted and job.counted[0]:
            done, total = job.counted
            return passed * (total - done) / done
        return max(self.times[job.task] - passed, 0.0) if job.task in self.times else None

    def last(self, title: str) -> Job | None:
        """Return the last command with the given title; None if there is none."""
        return next((job for job in reversed(self.all) if job.title == title), None)

    def cancel(self, job: Job) -> None:
        """Remove a command from the queue, or end its process."""
        if job.open:
            waited, job.state = job.state == WAITING, CANCELLED
            if waited:
                self._tidy(job)
            job.signal(signal.SIGINT)
            asyncio.get_running_loop().call_later(GRACE, job.signal, signal.SIGKILL)
            self.changed()

    async def work(self) -> None:
        """Run the queued commands one after the other, until this task is cancelled.

        If this task is cancelled, the running process is ended.
        """
        while True:
            job = next((j for j in self.all if j.state == WAITING), None)
            if job is None:
                self.wake.clear()
                await self.wake.wait()
                continue
            try:
                await self._run(job)
            finally:
                job.signal(signal.SIGKILL)
                if job.process is not None:
                    await job.process.communicate()  # to the end of its pipes: asyncio closes them
                job.process = None
                self._tidy(job)

    async def _run(self, job: Job) -> None:
        temporary = self.folder / ".tmp"
        temporary.mkdir(exist_ok=True)
        job.started, job.state = time.monotonic(), RUNNING
        before = self._written(job)
        self.changed()
        job.process = process = await asyncio.create_subprocess_exec(
            *self.programs[job.words[0]],
            *job.words[1:],
            cwd=self.folder,
            stdin=PIPE,
            stdout=PIPE,
            stderr=PIPE,
            env=os.environ
            | dict.fromkeys(BLAS_THREADS, "1")
            | {"TMPDIR": str(temporary), LINES: "json", "NO_COLOR": "1"},
            start_new_session=True,
        )
        if job.state == CANCELLED:  # while it was started
            job.signal(signal.SIGKILL)
        streams = {"output": process.stdout, "progress": process.stderr}
        await asyncio.gather(*(self._listen(job, *stream) for stream in streams.items()))
        job.code = await process.wait()
        if job.state == RUNNING:
            told = job.code in (0, 1) and self._written(job) not in (
                0,
                before,
            )  # 1: a verdict of no
            job.state = DONE if told else FAILED
            if told:
                self.times[job.task] = time.monotonic() - job.started
                write_all(self.folder, {TIMES: json.dumps(self.times)})

    def _written(self, job: Job) -> int:
        """Return the time, ns, at which the result file of a command was last written.

        The time is 0 if the file does not exist.
        """
        path = self.folder / job.result
        return path.stat().st_mtime_ns if path.is_file() else 0

    async def _listen(self, job: Job, name: str, stream: Any) -> None:
        """Read a stream of a process to its end, and store the last part of its text."""
        while part := await stream.read(2**16):
            setattr(
                job, name, (getattr(job, name) + part.decode("utf-8", "replace"))[-OUTPUT_KEPT:]
            )
            self.changed()

    def _tidy(self, job: Job) -> None:
        """Delete the temporary files of a command that has ended.

        Its results are deleted too unless the command is done.
        """
        if job.process is None and not any(j.state == RUNNING for j in self.all):
            shutil.rmtree(self.folder / ".tmp", ignore_errors=True)
        if job.run and job.state != DONE:
            shutil.rmtree(self.folder / "runs" / job.run, ignore_errors=True)
            for own in ("study", "robot"):
                for path in self.folder.glob(f"{own}-{job.run}.*"):
                    path.unlink()
        self.changed()


def _times(folder: Path) -> dict[str, float]:
    """Read how long the last command of each task took, s."""
    try:
        times = json.loads((folder / TIMES).read_text(encoding="utf-8"))
        return {str(task): float(seconds) for task, seconds in times.items()}
    except (OSError, ValueError, TypeError, AttributeError):
        return {}


def lines_of(text: str) -> list[dict[str, Any]]:
    """Read the lines of an error stream: mappings in JSON, or {"text": line} for any other line."""
    found: list[dict[str, Any]] = []
    for line in filter(str.strip, text.splitlines()):
        try:
            value = json.loads(line)
        except ValueError:
            value = None
        found.append(value if isinstance(value, dict) else {"text": line})
    return found
