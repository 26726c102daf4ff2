"""Tasks on several machines, by a Dask cluster (extra `scale`).

Its workers must have the versions of this process and run what this process sends; trust the
scheduler you name. Numbers are those of one process in
every bit on one kind of machine.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from importlib.metadata import version
from multiprocessing.reduction import ForkingPickler
from typing import Any

from runtime.blas import single_threaded
from runtime.errors import InputError

TIMEOUT = 10.0  # s that a scheduler has to answer
RESTART = 60.0  # s that its workers may take to come back after all of them died
PACKAGES = ("symgen", "numpy", "scipy")  # whose versions decide the bits


def packed(task: Callable[..., Any], context: Any) -> bytes:
    """Task and context as they travel, once."""
    return bytes(ForkingPickler.dumps((task, context)))


@lru_cache(maxsize=1)
def unpacked(job: bytes) -> tuple[Callable[..., Any], Any]:
    """Task and context, of one job at a time."""
    sent: tuple[Callable[..., Any], Any] = ForkingPickler.loads(job)
    return sent


class Cluster:
    """The workers of a scheduler; a worker of `runtime.parallel`."""

    most = sys.maxsize

    def __init__(self, client: Any) -> None:
        from distributed import KilledWorker

        self.client, self.lost = client, (KilledWorker, CancelledError)
        self.who = f"workers of {client.scheduler.address}"
        self.executor = client.get_executor(pure=False)

    def prepare(self, task: Callable[..., Any], context: Any) -> None:
        """Send the context to every worker; those that died have some time to come back."""
        with _answering(self.client.scheduler.address):
            self.client.wait_for_workers(1, timeout=RESTART)
            job = packed(task, context)
            self.job = self.client.scatter(job, broadcast=True, hash=False, timeout=RESTART)

    def submit(self, key: Any) -> Future[Any]:
        """The task of a key."""
        future: Future[Any] = self.executor.submit(_run_there, self.job, key)
        return future

    def end(self) -> None:
        """The workers are the scheduler's: what they do is given up when the connection closes."""


@contextmanager
def connected(scheduler: str, timeout: float) -> Iterator[Cluster]:
    """A connection to a scheduler that has workers with our versions."""
    import asyncio

    try:
        from distributed import Client
    except ImportError as e:
        raise InputError(
            "a Dask cluster needs an optional library: pip install symgen[scale]"
        ) from e
    with _answering(scheduler):
        with ThreadPoolExecutor(
            1
        ) as thread:  # an event loop of its own, wherever we are called from
            thread.submit(asyncio.run, _shake_hands(scheduler, timeout)).result()
        client = Client(scheduler, timeout=timeout, set_as_default=False)
    try:
        with _answering(scheduler):
            client.wait_for_workers(1, timeout=timeout)
        _check_versions(client)
        yield Cluster(client)
    finally:
        client.close()


async def _shake_hands(scheduler: str, timeout: float) -> None:
    """Connect once: something that listens and never answers would keep a Client waiting for
    ever.
    """
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
    except (
        OSError,
        ValueError,
        RuntimeError,
        CancelledError,
    ) as e:  # TimeoutError and errors of communication are OSErrors
        raise InputError(
            f"no answer from the scheduler {scheduler} or its workers: "
            f"{str(e).partition(chr(10))[0] or 'no reply in time'}"
        ) from e


def _check_versions(client: Any) -> None:
    """Refuse workers whose bits could differ, or that cannot run our tasks."""
    own = _versions()
    try:
        of_workers = client.run(_versions)
    except ImportError as e:
        raise InputError(
            f"the workers cannot run tasks of symgen ({e}): install the same symgen there"
        ) from e
    other = {address: versions for address, versions in of_workers.items() if versions != own}
    if other:
        address, versions = next(iter(other.items()))
        raise InputError(
            f"{len(other)} of {len(of_workers)} workers have other versions, such as {address}: "
            f"{versions}; this process {own}. Install the same"
        )


def _versions() -> dict[str, str]:
    return {package: version(package) for package in PACKAGES}


def _run_there(job: bytes, key: Any) -> Any:
    task, context = unpacked(job)
    return single_threaded(task)(context, key)
