"""Many independent tasks, in this process, in several, or on several machines, with the same results.

A task is a pure function of its key and of one context. The context travels once, when a process starts. Processes are spawned, never forked
(a fork after BLAS has started its threads may hang), with one BLAS thread each: several would fight for the cores, and their number could
change the last bit of a sum. A process that dies takes nothing with it: its keys are given to new ones.

Several machines are a Dask cluster (extra `scale`). Its workers must have the versions of this process and run what this process sends; trust the
scheduler you name. Numbers are those of one process in every bit on one kind of machine.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import wraps
from importlib.metadata import version
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, ParamSpec, TypeVar

from runtime.errors import InputError

K = TypeVar("K")
C = TypeVar("C")
R = TypeVar("R")
P = ParamSpec("P")

BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "BLIS_NUM_THREADS")
PATIENCE = 3  # times in a row that processes may die before any task is done
TIMEOUT = 10.0  # s that a scheduler has to answer
RESTART = 60.0  # s that its workers may take to come back after all of them died
PACKAGES = ("symgen", "numpy", "scipy")  # whose versions decide the bits

_worker: dict[str, Any] = {}  # of a spawned process: the task and its context


def results(
    task: Callable[[C, K], R],
    context: C,
    keys: Iterable[K],
    workers: int = 0,
    *,
    scheduler: str | None = None,
    timeout: float = TIMEOUT,
) -> Iterator[R]:
    """task(context, key) for every key, as they finish.

    Parameters
    ----------
    task : callable
        A function of a module, which other machines have as well.
    context : object
        Pickled where another process runs the tasks; so are the keys.
    workers : int
        Processes; 0 runs the tasks in this one, one after the other. Results of 1, 2 ... processes agree in every bit; those of workers=0 do so
        when BLAS runs on one thread in this process too.
    scheduler : str, optional
        Address of a Dask cluster that works instead, such as tcp://10.0.0.1:8786.
    timeout : float, s
        That the scheduler has to answer.

    Raises
    ------
    InputError
        Processes that always die; no answer from the scheduler; workers of other versions.
    """
    if workers < 0:
        raise ValueError(f"{workers} workers; expected 0 (this process) or more")
    if workers == 0 and scheduler is None:
        for key in keys:
            yield task(context, key)
        return
    missing, died = list(keys), 0
    if not missing:
        return
    with _environment(dict.fromkeys(BLAS_THREADS, "1")) if scheduler is None else _client(scheduler, timeout) as client:
        while missing:
            lost: list[K] = []
            attempt = _pooled(task, context, missing, workers, lost) if client is None else _submitted(client, task, context, missing, lost)
            for result in attempt:
                died = 0
                yield result
            died += 1
            if lost and died == PATIENCE:
                dead, advice = (
                    ("processes", 'use fewer workers; a script needs `if __name__ == "__main__":`')
                    if scheduler is None
                    else (f"workers of {scheduler}", "see their logs")
                )
                raise InputError(f"{dead} died {PATIENCE} times before any of {len(lost)} tasks was done (no memory left?); {advice}")
            missing = lost


def in_order(task: Callable[[C, K], R], context: C, keys: Iterable[K], workers: int) -> Iterator[R]:
    """task(context, key) in the order of the keys, by so many processes; results that come early wait."""
    waiting: dict[int, R] = {}
    following = 0
    for number, result in results(_numbered, (task, context), enumerate(keys), workers):
        waiting[number] = result
        while following in waiting:
            yield waiting.pop(following)
            following += 1


def _numbered(context: tuple[Callable[[C, K], R], C], key: tuple[int, K]) -> tuple[int, R]:
    task, own = context
    return key[0], task(own, key[1])


def _pooled(task: Callable[[C, K], R], context: C, keys: list[K], workers: int, lost: list[K]) -> Iterator[R]:
    """Results of one pool of processes; keys whose process died go to `lost`."""
    spawn = get_context("spawn")
    watched, held = spawn.Pipe(duplex=False)
    pool = ProcessPoolExecutor(min(workers, len(keys)), mp_context=spawn, initializer=_start, initargs=(task, context, watched))
    stopped = True
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
        stopped = False
    finally:  # also when the caller stops early or a task fails: what still runs is of no use then
        if stopped:
            held.close()
        pool.shutdown(cancel_futures=True)
        held.close()
        watched.close()


def _start(task: Callable[..., Any], context: Any, watched: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that asked
    threading.Thread(target=_end_with, args=(watched,), daemon=True).start()
    _worker.update(task=task, context=context)


def _end_with(watched: Connection) -> None:
    """End this process when the other end of the pipe is closed: by the process that asked, or because that one ended."""
    with suppress(OSError):
        watched.poll(None)
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


@contextmanager
def _client(scheduler: str, timeout: float) -> Iterator[Any]:
    """A connection to a scheduler that has workers with our versions."""
    import asyncio

    try:
        from distributed import Client
    except ImportError as e:
        raise InputError("a Dask cluster needs an optional library: pip install symgen[scale]") from e
    with _answering(scheduler):
        with ThreadPoolExecutor(1) as thread:  # an event loop of its own, wherever we are called from
            thread.submit(asyncio.run, _shake_hands(scheduler, timeout)).result()
        client = Client(scheduler, timeout=timeout, set_as_default=False)
    try:
        with _answering(scheduler):
            client.wait_for_workers(1, timeout=timeout)
        _check_versions(client)
        yield client
    finally:
        client.close()


async def _shake_hands(scheduler: str, timeout: float) -> None:
    """Connect once: something that listens and never answers would keep a Client waiting for ever."""
    from asyncio import wait_for

    from distributed.comm import connect

    comm = await wait_for(connect(scheduler, timeout=timeout), timeout)
    await comm.close()


@contextmanager
def _answering(scheduler: str) -> Iterator[None]:
    """Errors of a connection as one line."""
    try:
        yield
    except (OSError, ValueError, RuntimeError, CancelledError) as e:  # TimeoutError and errors of communication are OSErrors
        raise InputError(
            f"no answer from the scheduler {scheduler} or its workers: {str(e).partition(chr(10))[0] or 'no reply in time'}"
        ) from e


def _check_versions(client: Any) -> None:
    """Refuse workers whose bits could differ, or that cannot run our tasks."""
    own = _versions()
    try:
        of_workers = client.run(_versions)
    except ImportError as e:
        raise InputError(f"the workers cannot run tasks of symgen ({e}): install the same symgen there") from e
    other = {address: versions for address, versions in of_workers.items() if versions != own}
    if other:
        address, versions = next(iter(other.items()))
        raise InputError(
            f"{len(other)} of {len(of_workers)} workers have other versions, such as {address}: {versions}; this process {own}. Install the same"
        )


def _versions() -> dict[str, str]:
    return {package: version(package) for package in PACKAGES}


def _submitted(client: Any, task: Callable[[C, K], R], context: C, keys: list[K], lost: list[K]) -> Iterator[R]:
    """Results of tasks submitted once; keys whose worker took them along, or the context, go to `lost`."""
    from distributed import KilledWorker, as_completed

    with _answering(client.scheduler.address):
        client.wait_for_workers(1, timeout=RESTART)
        shared = client.scatter(context, broadcast=True, hash=False, timeout=RESTART)
        futures = {client.submit(_run_there, task, shared, key, pure=False): key for key in keys}
    for future, result in as_completed(list(futures), loop=client.loop, with_results=True, raise_errors=False):
        key = futures.pop(future)
        error = result[1] if future.status == "error" else None
        if future.status in ("cancelled", "lost") or isinstance(error, KilledWorker):
            lost.append(key)
        elif error is not None:
            raise error
        else:
            yield result
        future.release()


def _run_there(task: Callable[[C, K], R], context: C, key: K) -> R:
    """A task on one BLAS thread."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        return task(context, key)


def single_threaded(function: Callable[P, R]) -> Callable[P, R]:
    """The function with one BLAS thread while it runs: its matrices are small, and several threads wait for each other ten times as long as they compute."""

    @wraps(function)
    def alone(*args: P.args, **kwargs: P.kwargs) -> R:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(1, "blas"):
            return function(*args, **kwargs)

    return alone
