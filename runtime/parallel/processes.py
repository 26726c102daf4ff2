"""Function like `map` that computes in several processes, for the argument `map=` of functions.

    with processes(4) as several:
        result = cestac(model, record, study, map=several)

A client of a Dask cluster gives such a function too: docs/examples/dask_many_robots.py.
The processes are spawned, never forked (a fork after BLAS has started its threads may hang).
Results are in the order of the arguments and agree in every bit with those of one process.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import lru_cache, partial
from multiprocessing.reduction import ForkingPickler
from typing import Any

from runtime.ground.errors import InputError

Map = Callable[..., Iterator[Any]]


@contextmanager
def processes(count: int) -> Iterator[Map]:
    """Yield a function like `map` that computes in `count` processes.

    For 0 and 1 it is the built-in map.

    Raises
    ------
    InputError
        A negative number; a process that dies.
    """
    if count < 0:
        raise InputError(f"{count} workers; expected 0 (this process) or more")
    if count < 2:
        yield map
        return
    spawn = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count, mp_context=spawn, initializer=_begin)
    try:
        yield lambda function, keys: pool.map(
            partial(_there, bytes(ForkingPickler.dumps(function))), keys
        )
    except BrokenProcessPool as e:
        died = 'a process died: the memory is full, or the script has no `if __name__ == "__main__":`; use fewer workers'
        raise InputError("; ".join([died, *getattr(e, "__notes__", ())])) from e
    finally:
        pool.shutdown(cancel_futures=True)


def _there(sent: bytes, key: Any) -> Any:
    """Unpickle a function in a worker process, and return the result of the function for `key`."""
    return _unpacked(sent)(key)


@lru_cache(maxsize=1)
def _unpacked(sent: bytes) -> Callable[[Any], Any]:
    function: Callable[[Any], Any] = ForkingPickler.loads(sent)
    return function


def _begin() -> None:
    """Prepare a worker process: it ignores Ctrl-C, and ends when its parent process ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
