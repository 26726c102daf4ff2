"""The tasks of a study on a Dask cluster (extra `scale`): the same call as `runtime.parallel`, on more than one machine.

The context travels once to every worker, keys are small, results too. Tasks are pure functions of their key: when a worker dies, the scheduler gives
its tasks to others, and what was lost altogether is sent again. Numbers are those of one process in every bit on one kind of machine: BLAS runs on one
thread in every task, and workers must have the versions of this process. Workers run what this process sends; trust the scheduler you name.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any, TypeVar

from runtime.errors import InputError

K = TypeVar("K")
C = TypeVar("C")
R = TypeVar("R")

TIMEOUT = 10.0  # s that a scheduler has to answer
PATIENCE = 3  # times in a row that everything may be lost before any task is done
PACKAGES = ("symgen", "numpy", "scipy")  # whose versions decide the bits


def results(task: Callable[[C, K], R], context: C, keys: Iterable[K], scheduler: str, *, timeout: float = TIMEOUT) -> Iterator[R]:
    """task(context, key) for every key, as they finish.

    task : a function of a module that the workers have.   context, keys : anything that pickles.   scheduler : address, such as tcp://10.0.0.1:8786.
    """
    missing, fruitless = list(keys), 0
    if not missing:
        return
    with _client(scheduler, timeout) as client:
        while missing:
            lost: list[K] = []
            for result in _submitted(client, task, context, missing, lost):
                fruitless = 0
                yield result
            fruitless += 1
            if lost and fruitless == PATIENCE:
                raise InputError(
                    f"workers of {scheduler} died {PATIENCE} times before any of {len(lost)} tasks was done; see their logs (no memory left?)"
                )
            missing = lost


@contextmanager
def _client(scheduler: str, timeout: float) -> Iterator[Any]:
    """A connection to a scheduler that has workers with our versions."""
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
    from distributed.comm import connect

    comm = await asyncio.wait_for(connect(scheduler, timeout=timeout), timeout)
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
    here = _versions()
    try:
        found = client.run(_versions)
    except ImportError as e:
        raise InputError(f"the workers cannot run tasks of symgen ({e}): install the same symgen there") from e
    other = {address: versions for address, versions in found.items() if versions != here}
    if other:
        address, versions = next(iter(other.items()))
        raise InputError(
            f"{len(other)} of {len(found)} workers have other versions, such as {address}: {versions}; here {here}. Install the same"
        )


def _versions() -> dict[str, str]:
    return {package: version(package) for package in PACKAGES}


def _submitted(client: Any, task: Callable[[C, K], R], context: C, keys: list[K], lost: list[K]) -> Iterator[R]:
    """Results of tasks submitted once; keys whose worker took them along, or the context, go to `lost`."""
    from distributed import KilledWorker, as_completed

    with _answering(client.scheduler.address):
        shared = client.scatter(context, broadcast=True, hash=False)
        futures = {client.submit(_run, task, shared, key, pure=False): key for key in keys}
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


def _run(task: Callable[[C, K], R], context: C, key: K) -> R:
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        return task(context, key)
