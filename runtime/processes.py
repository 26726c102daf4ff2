"""Many independent tasks, in this process or in several, with the same results.

A task is a pure function of its key and of one context. The context travels once, when a process starts. Processes are spawned, never forked
(a fork after BLAS has started its threads may hang), with one BLAS thread each: several would fight for the cores, and their number could
change the last bit of a sum.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any, TypeVar

K = TypeVar("K")
C = TypeVar("C")
R = TypeVar("R")

BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "BLIS_NUM_THREADS")

_worker: dict[str, Any] = {}  # of a spawned process: the task and its context


def results(task: Callable[[C, K], R], context: C, keys: Iterable[K], workers: int = 0) -> Iterator[R]:
    """task(context, key) for every key, as they finish.

    task : a function of a module.   context : anything that pickles, when workers > 0.
    workers : processes; 0 runs the tasks here, one after the other. Results of 1, 2 ... processes agree in every bit; those of workers=0 do so
    when BLAS runs on one thread here too.
    """
    if workers < 0:
        raise ValueError(f"{workers} workers; expected 0 (this process) or more")
    if workers == 0:
        for key in keys:
            yield task(context, key)
        return
    with _environment(dict.fromkeys(BLAS_THREADS, "1")):
        pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_start, initargs=(task, context))
        try:
            pending: set[Future[R]] = {pool.submit(_run, key) for key in keys}
            while pending:
                done, pending = wait(pending, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
        finally:  # also when the caller stops early or a task fails
            pool.shutdown(cancel_futures=True)


def _start(task: Callable[..., Any], context: Any) -> None:
    _worker.update(task=task, context=context)


def _run(key: Any) -> Any:
    return _worker["task"](_worker["context"], key)


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """The environment that spawned processes inherit; restored afterwards."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
