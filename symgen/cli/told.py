"""Messages of a command on its error stream: lines for people, or JSON lines for programs.

SYMGEN_LINES=json symgen cestac arm.urdf study.yaml 2> lines.jsonl

{"stage": "identification"}                     a part of the work begins
{"done": 3, "total": 40, "left_s": 61.2}        runs, records or starts; time that the others need, or null
{"note": "..."}                                 a doubt about robot or record
{"report": "results/report.html"}               what was written
{"error": "...", "path": ["signals", "rate"]}   why the command ends; keys of the wrong setting
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from time import monotonic
from typing import Any

import typer

LINES = "SYMGEN_LINES"
PAUSE = 0.1  # s between two counts
LINE_PAUSE = 10.0  # s between two lines


def as_json() -> bool:
    """Whether the error stream is to have JSON lines."""
    return os.environ.get(LINES) == "json"


def tell(line: str, **data: Any) -> None:
    """Print a line for people, or its data as one line of JSON."""
    typer.echo(json.dumps(data) if as_json() else line, err=True)


def error_data(error: Exception) -> dict[str, Any]:
    """Return the message of an error, and the keys of the setting or cell that is wrong.

    The message of a setting names its keys, not the line of a file.
    """
    path = [*map(str, getattr(error, "path", ()))]
    text = getattr(error, "message", "") if path else ""
    return {"error": text or str(error) or type(error).__name__, "path": path}


def lines_of(what: str) -> Callable[[int, int], None]:
    """Return a function that prints, every ten seconds, the finished steps and the time left."""
    start = last = monotonic()

    def count(done: int, total: int) -> None:
        nonlocal last
        now = monotonic()
        if 0 < done < total and now - last > LINE_PAUSE:
            last = now
            left = (now - start) / done * (total - done)
            tell(f"  {what}: {done} of {total}, about {left:.0f} s left")

    return count


def counter() -> Callable[[int, int], None]:
    """Return a function that prints the number of finished steps and of all steps, at most ten
    times a second.
    """
    last, left = 0.0, time_left()

    def count(done: int, total: int) -> None:
        nonlocal last
        seconds = left(done, total)
        if done == total or monotonic() - last > PAUSE:
            last = monotonic()
            tell("", done=done, total=total, left_s=seconds)

    return count


def time_left() -> Callable[[int, int], float | None]:
    """Return a function of the numbers of finished steps and of all steps: time of the others, s.

    The time is (total - done) (t - t0)/(done - done0), with t0 and done0 of the first call, so that
    steps which were finished before do not count. It is None until another step is finished.
    """
    first: list[tuple[float, int]] = []

    def left(done: int, total: int) -> float | None:
        now = monotonic()
        if not first:
            first.append((now, done))
        start, before = first[0]
        return (total - done) * (now - start) / (done - before) if done > before else None

    return left
