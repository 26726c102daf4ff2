"""Many independent tasks, in this process or in several, with the same results.

A task is a pure function of its key and of one context. The context travels once, when a process starts. Processes are spawned, never forked
(a fork after BLAS has started its threads may hang), with one BLAS thread each: several would fight for the cores, and their number could
change the last bit of a sum. A process that dies takes nothing with it: its keys are given to new ones. More than one machine:
`runtime.distributed`.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from typing import Any, TypeVar

from runtime.errors import InputError

K = TypeVar("K")
C = TypeVar("C")
R = TypeVar("R")

BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "BLIS_NUM_THREADS")
PATIENCE = 3  # times in a row that processes may die before any task is done

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
    missing, died = list(keys), 0
    with _environment(dict.fromkeys(BLAS_THREADS, "1")):
        while missing:
            lost: list[K] = []
            for result in _pooled(task, context, missing, workers, lost):
                died = 0
                yield result
            died += 1
            if lost and died == PATIENCE:
                raise InputError(
                    f"processes died {PATIENCE} times before any of {len(lost)} tasks was done (no memory left?); use fewer workers"
                )
            missing = lost


def _pooled(task: Callable[[C, K], R], context: C, keys: list[K], workers: int, lost: list[K]) -> Iterator[R]:
    """Results of one pool of processes; keys whose process died go to `lost`."""
    pool = ProcessPoolExecutor(min(workers, len(keys)), mp_context=get_context("spawn"), initializer=_start, initargs=(task, context))
    try:
        futures: dict[Future[R], K] = {}
        for key in keys:
            try:
                futures[pool.submit(_run, key)] = key
            except BrokenProcessPool:
                lost.append(key)
        for future in as_completed(futures):
            key = futures.pop(future)
            if isinstance(future.exception(), BrokenProcessPool):
                lost.append(key)
            else:
                yield future.result()
    finally:  # also when the caller stops early or a task fails
        pool.shutdown(cancel_futures=True)


def _start(task: Callable[..., Any], context: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _worker.update(task=task, context=context)


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


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
