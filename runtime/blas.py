"""BLAS with one thread: several would fight for the cores, and their number could change the last
bit of a sum.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial, wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

BLAS_THREADS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "BLIS_NUM_THREADS",
)


def single_threaded(function: Callable[P, R]) -> Callable[P, R]:
    """The function with one BLAS thread while it runs: its matrices are small, and several threads
    wait for each other ten times as long as they compute.
    """

    @wraps(function)
    def alone(*args: P.args, **kwargs: P.kwargs) -> R:
        with single_thread()():
            return function(*args, **kwargs)

    return alone


def single_thread() -> Callable[[], AbstractContextManager[Any]]:
    """What gives a context with one BLAS thread; the libraries are sought here, once, which takes a
    sixth of the time of a short run.
    """
    from threadpoolctl import ThreadpoolController

    return partial(ThreadpoolController().limit, limits=1, user_api="blas")


@contextmanager
def inherited_single_thread() -> Iterator[None]:
    """The environment of processes that are started meanwhile, whose BLAS then has one thread; as
    before afterwards.
    """
    before = {name: os.environ.get(name) for name in BLAS_THREADS}
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
