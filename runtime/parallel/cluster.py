"""Function like `map` that computes on the workers of a Dask cluster; needs symgen[scale].

It is an argument `map=` of other functions. The workers must have the versions of this process and
run the code that this process sends; use only a scheduler that you trust. Results are those of one
process in every bit on one kind of machine.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any

from runtime.core.errors import InputError
from runtime.parallel.processes import packed, there

TIMEOUT = 10.0  # s that a scheduler has to answer
PACKAGES = ("symgen", "numpy", "scipy")  # whose versions decide the bits


@contextmanager
def cluster(scheduler: str, timeout: float = TIMEOUT) -> Iterator[Callable[..., Iterator[Any]]]:
    """Yield a function like `map` that computes on the workers of a Dask scheduler.

    scheduler : its address, such as tcp://10.0.0.1:8786.

    Raises
    ------
    InputError
        No answer from the scheduler or its workers; workers of other versions, or that die.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError as e:
        raise InputError(
            "a Dask cluster needs an optional library: pip install symgen[scale]"
        ) from e
    silence = (OSError, ValueError, RuntimeError, CancelledError, KilledWorker)
    try:
        with ThreadPoolExecutor(1) as thread:  # an event loop of its own, wherever we are called
            thread.submit(asyncio.run, _shake_hands(scheduler, timeout)).result()
        with Client(scheduler, timeout=timeout, set_as_default=False) as client:
            client.wait_for_workers(1, timeout=timeout)
            _check_versions(client)
            yield lambda function, keys: _mapped(client, function, keys)
    except InputError:
        raise
    except silence as e:
        reason = str(e).partition("\n")[0] or "no reply in time"
        raise InputError(
            f"no answer from the scheduler {scheduler} or its workers: {reason}; check the address, and whether workers run"
        ) from e


def _mapped(client: Any, function: Callable[..., Any], keys: Any) -> Iterator[Any]:
    """Call a function on the workers with each of `keys`; yield the results in the same order."""
    sent = client.scatter(packed(function), broadcast=True, hash=False)
    for future in [client.submit(there, sent, key, pure=False) for key in keys]:
        yield future.result()


async def _shake_hands(scheduler: str, timeout: float) -> None:
    """Connect once to the scheduler, to test that it answers.

    A Client would wait for ever for a program that listens and never answers.
    """
    from distributed.comm import connect

    comm = await asyncio.wait_for(connect(scheduler, timeout=timeout), timeout)
    await comm.close()


def _check_versions(client: Any) -> None:
    """Raise InputError if a worker has another version of symgen, NumPy or SciPy than this process.

    Their results could differ in some bits. Workers that cannot run the tasks are refused too.
    """
    here = _versions()
    try:
        of_workers = client.run(_versions)
    except ImportError as e:
        raise InputError(
            f"the workers cannot run tasks of symgen ({e}): install the same symgen there"
        ) from e
    for address, versions in of_workers.items():
        if versions != here:
            raise InputError(
                f"the worker {address} has the versions {versions}, but this process has {here}; install the same versions"
            )


def _versions() -> dict[str, str]:
    return {package: version(package) for package in PACKAGES}
