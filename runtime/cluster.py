"""Tasks on several machines, by a Dask cluster (extra `scale`).

Its workers must have the versions of this process and run what this process sends; trust the scheduler you name. Numbers are those of one process in
every bit on one kind of machine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any, TypeVar

from runtime.blas import single_threaded
from runtime.errors import InputError

K = TypeVar("K")
C = TypeVar("C")
R = TypeVar("R")

PATIENCE = 3  # times in a row that all workers may die before any task is done
TIMEOUT = 10.0  # s that a scheduler has to answer
RESTART = 60.0  # s that its workers may take to come back after all of them died
PACKAGES = ("symgen", "numpy", "scipy")  # whose versions decide the bits


def on_cluster(task: Callable[[C, K], R], context: C, missing: list[K], scheduler: str, timeout: float) -> Iterator[R]:
    """Results of the workers of a scheduler; keys whose workers died are submitted again."""
    if not missing:
        return
    deaths = 0
    with _client(scheduler, timeout) as client:
        while missing:
            lost: list[K] = []
            for result in _submitted(client, task, context, missing, lost):
                deaths = 0
                yield result
            deaths += 1
            if lost and deaths == PATIENCE:
                raise died(f"workers of {scheduler}", len(lost), "see their logs")
            missing = lost


def died(who: str, tasks: int, advice: str) -> InputError:
    return InputError(f"{who} died {PATIENCE} times before any of {tasks} tasks was done (no memory left?); {advice}")


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
    except InputError:
        raise
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
    return single_threaded(task)(context, key)
