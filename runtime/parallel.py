"""Many independent tasks, in this process, in several, or on several machines, with the same results.

A task is a pure function of its key and of one context. Of several processes this one is the first; each takes the next key when it is free. The
context travels once to each of the others. These are spawned, never forked (a fork after BLAS has started its threads may hang). BLAS has one thread
in all of them: several would fight for the cores, and their number could change the last bit of a sum. A process that dies takes nothing with it:
its key is given to a new one.

Several machines are a Dask cluster (`runtime.cluster`).
"""

from __future__ import annotations

import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import Any, TypeVar

from runtime.blas import inherited_single_thread, single_thread
from runtime.cluster import PATIENCE, TIMEOUT, died, on_cluster
from runtime.errors import InputError

K = TypeVar("K")
C = TypeVar("C")
R = TypeVar("R")
Item = tuple[int, Any]  # number of a key, and the key

_worker: dict[str, Any] = {}  # of a spawned process: the task and its context


class Workers:
    """So many processes, this one among them.

    The others are spawned when they are first needed, or by `start`; they serve all tasks until the context ends, and end with this process.

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

    def meanwhile(self, function: Callable[[], R]) -> Callable[[], R]:
        """What gives the value of a function, which is pickled: another process, if one has been started, computes it before the tasks that come later;
        where there is none, or it dies, this process does when it is asked."""
        running = [other.pool for other in self.others if other.pool is not None]
        try:
            future = running[-1].submit(function)
        except (IndexError, BrokenProcessPool):
            return function

        def value() -> R:
            try:
                return future.result()
            except BrokenProcessPool:
                return function()

        return value

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        for other in self.others:
            other.end()


class OtherProcess:
    """A spawned process; a new one where it has ended."""

    def __init__(self) -> None:
        self.pool: ProcessPoolExecutor | None = None
        self.deaths = 0  # in a row

    def start(self, *modules: str) -> ProcessPoolExecutor:
        """Spawn it, unless it is there; it loads these modules first."""
        if self.pool is None:
            spawn = get_context("spawn")
            watched, self.held = spawn.Pipe(duplex=False)
            self.pool = ProcessPoolExecutor(1, mp_context=spawn, initializer=_start, initargs=(watched,))
            with inherited_single_thread():
                self.pool.submit(_load, modules)
            watched.close()
        return self.pool

    def end(self) -> None:
        """End it at once, whatever it does."""
        if self.pool is not None:
            self.held.close()
            self.pool.shutdown()
            self.pool = None

    def work(self, task: Callable[[C, K], R], context: C, waiting: Sequence[deque[Item]], done: SimpleQueue[Any]) -> None:
        """Ask it for one task after the other until none waits, in a thread; `done` gets this process, the item, and the result or what went wrong."""
        pool = self.start()

        def ask() -> None:
            item = None
            try:
                pool.submit(_prepare, task, context).result()
                while (item := _next(*waiting)) is not None:
                    done.put((self, item, pool.submit(_run, item[1]).result(), None))
            except BaseException as e:
                done.put((self, item, None, e))

        threading.Thread(target=ask, daemon=True).start()


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
    if scheduler is not None:
        yield from on_cluster(task, context, list(keys), scheduler, timeout)
        return
    with started(workers) as processes:
        for _, result in _shared(task, context, keys, processes):
            yield result


def in_order(task: Callable[[C, K], R], context: C, keys: Iterable[K], workers: int | Workers = 0) -> Iterator[R]:
    """task(context, key) in the order of the keys, by so many processes; results that come early wait."""
    waiting: dict[int, R] = {}
    following = 0
    with started(workers) as processes:
        for number, result in _shared(task, context, keys, processes):
            waiting[number] = result
            while following in waiting:
                yield waiting.pop(following)
                following += 1


@contextmanager
def started(workers: int | Workers) -> Iterator[Workers]:
    """Workers as they are, or so many of them while the context lasts."""
    if isinstance(workers, Workers):
        yield workers
    else:
        with Workers(workers) as own:
            yield own


def _shared(task: Callable[[C, K], R], context: C, keys: Iterable[K], workers: Workers) -> Iterator[tuple[int, R]]:
    """Number and result of every key as they finish. A key whose process died is left to the other ones: it might end this one too."""
    left: deque[Item] = deque(enumerate(keys))
    lost: deque[Item] = deque()
    done: SimpleQueue[tuple[OtherProcess, Item | None, Any, BaseException | None]] = SimpleQueue()
    others, unfinished = workers.others[: max(len(left) - 1, 0)], len(left)
    single = single_thread()
    try:
        for other in others:
            other.work(task, context, (lost, left), done)
        while unfinished:
            if done.empty() and (item := _next(left)) is not None:
                with single():
                    result = task(context, item[1])
            else:
                other, item, result, error = done.get()
                if isinstance(error, BrokenProcessPool):
                    lost.extend([item] if item else [])
                    other.deaths += 1
                    if other.deaths == PATIENCE:
                        raise died("processes", len(left) + len(lost), 'use fewer workers; a script needs `if __name__ == "__main__":`')
                    other.end()
                    if left or lost:
                        other.work(task, context, (lost, left), done)
                    continue
                if error is not None:
                    raise error
                assert item is not None
                other.deaths = 0
            unfinished -= 1
            yield item[0], result
    finally:  # also when the caller stops early or a task fails: what still runs is of no use then
        left.clear()
        lost.clear()
        if unfinished:
            for other in others:
                other.end()


def _next(*waiting: deque[Item]) -> Item | None:
    """The next item of the first queue that has one."""
    for queue in waiting:
        with suppress(IndexError):
            return queue.popleft()
    return None


def _start(watched: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    threading.Thread(target=_end_with, args=(watched,), daemon=True).start()


def _end_with(watched: Connection) -> None:
    """End this process when the other end of the pipe is closed: by the process that asked, or because that one ended."""
    with suppress(OSError):
        watched.poll(None)
    os._exit(1)


def _load(modules: Iterable[str]) -> None:
    for module in modules:
        import_module(module)


def _prepare(task: Callable[..., Any], context: Any) -> None:
    _worker.update(task=task, context=context)


def _run(key: Any) -> Any:
    return _worker["task"](_worker["context"], key)
