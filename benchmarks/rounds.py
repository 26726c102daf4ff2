"""Interleaved rounds: contenders run once in every round, in rotated order, each for about the same
CPU time; ratios are taken per round.
"""

from __future__ import annotations

import platform
import resource
import statistics
import time
from collections.abc import Callable
from pathlib import Path

SPENT = 0.1  # s of CPU that one contender uses in a round
Times = dict[str, list[float]]


Clock = Callable[[], float]


def user_time() -> float:
    """CPU seconds of this process outside the kernel."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


def cpu(action: Callable[[], object], repeats: int, clock: Clock = time.process_time) -> float:
    """CPU seconds of one call. An action in another process has its own clock, `cpu`."""
    if own := getattr(action, "cpu", None):
        return float(own(repeats))
    start = clock()
    for _ in range(repeats):
        action()
    return (clock() - start) / repeats


def interleave(
    contenders: dict[str, Callable[[], object]],
    rounds: int,
    spent: float = SPENT,
    clock: Clock = time.process_time,
) -> Times:
    """CPU seconds of every contender in every round, order rotated from round to round."""
    repeats = {
        name: max(1, round(spent / max(cpu(action, 1), 1e-6)))
        for name, action in contenders.items()
    }
    times: Times = {name: [] for name in contenders}
    names = list(contenders)
    for k in range(rounds):
        for name in names[k % len(names) :] + names[: k % len(names)]:
            times[name].append(cpu(contenders[name], repeats[name], clock))
    return times


def ratio(times: Times, above: str, below: str) -> str:
    per_round = [a / b for a, b in zip(times[above], times[below], strict=True)]
    return f"{statistics.median(per_round):6.2f}  [{min(per_round):.2f}, {max(per_round):.2f}]"


def processor() -> str:
    text = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    return next(
        (line.split(":")[1].strip() for line in text.splitlines() if line.startswith("model name")),
        platform.processor(),
    )
