"""Many independent tasks, in this process, in several, or on several machines, with the same
results.

A task is a pure function of its key and of one context. The engine is `concurrent.futures`: an
executor for each further process, or that of a Dask cluster (`runtime.cluster`). Of several
processes
this one is the first; each takes the next key when it is free. The context travels once to each of
the others. These are spawned, never forked (a fork after BLAS has started its threads may hang).
BLAS has one thread in all of them: several would fight for the cores, and their number could change
the last bit of a sum. A process that dies takes nothing with it: its keys are given to a new one.
"""

from __future__ import annotations

import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Future,
    ProcessPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from runtime.blas import inherited_single_thread, single_thread
from runtime.cluster import TIMEOUT, Cluster, connected, packed, unpacked
from runtime.errors import InputError

K = TypeVar("K")
C = TypeVar("C")
R = TypeVar("R")

PATIENCE = 3  # times in a row that workers may die before any task is done
AHEAD = 2  # tasks of another process, the next one waiting where many are left

_worker: dict[str, bytes] = {}  # of a spawned process: the task and its context


class OtherProcess:
    """A spawned process; a new one where it has ended.

    Attributes
    ----------
    who : str
        In messages.
    most : int
        Tasks that it may hold.
    lost : tuple of type
        Errors that say that it died.
    """

    who, most, lost = "processes", AHEAD, (BrokenProcessPool,)

    def __init__(self) -> None:
        self.pool: ProcessPoolExecutor | None = None

    def start(self, *modules: str) -> ProcessPoolExecutor:
        """Spawn it, unless it is there; it loads these modules first."""
        if self.pool is None:
            spawn = get_context("spawn")
            watched, self.held = spawn.Pipe(duplex=False)
            self.pool = ProcessPoolExecutor(
                1, mp_context=spawn, initializer=_start, initargs=(watched,)
            )
            with inherited_single_thread():
                self.pool.submit(_load, modules)
            watched.close()
        return self.pool

    def prepare(self, task: Callable[..., Any], context: Any) -> None:
        """Send what every key needs."""
        self._submitted(_prepare, packed(task, context))

    def submit(self, key: Any) -> Future[Any]:
        """The task of a key."""
        return self._submitted(_run, key)

    def _submitted(self, function: Callable[..., Any], given: Any) -> Future[Any]:
        """A task of the process; one that has failed where the process has died."""
        try:
            return self.start().submit(function, given)
        except BrokenProcessPool as e:
            future: Future[Any] = Future()
            future.set_exception(e)
            return future

    def end(self) -> None:
        """End it at once, whatever it does."""
        if self.pool is not None:
            self.held.close()
            self.pool.shutdown()
            self.pool = None


class Workers:
    """So many processes, this one among them.

    The others are spawned when they are first needed, or by `start`; they serve all tasks until the
    context ends, and end with this process.

        with Workers(2) as workers:
            workers.start("numpy")
            ...
            for result in results(task, context, keys, workers):

    Parameters
    ----------
    count : int
        0 and 1: this one alone.
    """

    def __init__(self, count: int) -> None:
        if count < 0:
            raise InputError(f"{count} workers; expected 0 (this process) or more")
        self.others = [OtherProcess() for _ in range(count - 1)]

    def start(self, *modules: str) -> None:
        """Spawn the others, which load these modules while this process goes on."""
        for other in self.others:
            other.start(*modules)

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        for other in self.others:
            other.end()


def results(
    task: Callable[[C, K], R],
    context: C,
    keys: Iterable[K],
    workers: int | Workers = 0,
    *,
    scheduler: str | None = None,
    timeout: float = TIMEOUT,
) -> Iterator[R]:
    """task(context, key) for every key, as they finish.

    Parameters
    ----------
    task : callable
        A function of a module, which other processes and machines have as well.
    context : object
        Pickled for other processes; so are the keys.
    workers : int or Workers
        Processes, this one among them; 0 and 1: this one alone. The results agree in every bit.
    scheduler : str, optional
        Address of a Dask cluster that works instead, such as tcp://10.0.0.1:8786.
    timeout : float, s
        That the scheduler has to answer.

    Raises
    ------
    InputError
        Processes that always die; no answer from the scheduler; workers of other versions.
    """
    keys = list(keys)
    if scheduler is None:
        with started(workers) as processes:
            yield from (result for _, result in _shared(task, context, keys, processes.others))
    elif keys:
        with connected(scheduler, timeout) as cluster:
            shared = _shared(task, context, keys, [cluster], here=False)
            yield from (result for _, result in shared)


@contextmanager
def started(workers: int | Workers) -> Iterator[Workers]:
    """Workers as they are, or so many of them while the context lasts."""
    if isinstance(workers, Workers):
        yield workers
    else:
        with Workers(workers) as own:
            yield own


def _shared(
    task: Callable[[C, K], R],
    context: C,
    keys: Iterable[K],
    workers: Sequence[OtherProcess | Cluster],
    *,
    here: bool = True,
) -> Iterator[tuple[int, R]]:
    """Number and result of every key as they finish.

    A key whose worker died is left to the others: it might end this process too.
    here : whether this process works as well.
    """
    left, lost = deque(enumerate(keys)), deque[tuple[int, K]]()
    workers, busy = (
        workers[: max(len(left) - here, 0)],
        dict[Future[R], tuple[OtherProcess | Cluster, int, K]](),
    )
    single, deaths = single_thread(), 0
    try:
        for worker in workers:
            worker.prepare(task, context)
        while left or lost or busy:
            own = here and left and not any(future.done() for future in busy) and left.popleft()
            for worker in workers:
                held = sum(other is worker for other, *_ in busy.values())
                while (lost or left) and held < (worker.most if len(left) > len(workers) else 1):
                    number, key = (lost or left).popleft()
                    busy[worker.submit(key)] = worker, number, key
                    held += 1
            if own:
                with single():
                    result = task(context, own[1])
                yield own[0], result
                continue
            for future in wait(busy, return_when=FIRST_COMPLETED).done:
                worker, number, key = busy.pop(future)
                try:
                    result = future.result()
                except Exception as e:
                    if not isinstance(e, worker.lost):
                        raise
                    lost.append((number, key))
                    continue
                deaths = 0
                yield number, result
            if lost:
                deaths += 1
                if deaths == PATIENCE:
                    raise InputError(
                        f"{workers[0].who} died {PATIENCE} times before any of "
                        f"{len(left) + len(lost) + len(busy)} tasks was done: no memory left, or a "
                        'script without `if __name__ == "__main__":`'
                    )
                for worker in workers:
                    if not any(other is worker for other, *_ in busy.values()):
                        worker.end()
                        worker.prepare(task, context)
    finally:  # also when the caller stops early or a task fails: what still runs is of no use then
        if left or lost or busy:
            for worker in workers:
                worker.end()


def _start(watched: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    threading.Thread(target=_end_with, args=(watched,), daemon=True).start()


def _end_with(watched: Connection) -> None:
    """End this process when the other end of the pipe is closed: by the process that asked, or
    because that one ended.
    """
    with suppress(OSError):
        watched.poll(None)
    os._exit(1)


def _load(modules: Iterable[str]) -> None:
    for module in modules:
        import_module(module)


def _prepare(job: bytes) -> None:
    _worker["job"] = job


def _run(key: Any) -> Any:
    task, context = unpacked(_worker["job"])
    return task(context, key)
