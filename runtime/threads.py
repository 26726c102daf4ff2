"""Run numerical functions with one BLAS thread only.

Several threads would compete for the processor cores, and their number could change the last bit
of a sum.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial, wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

BLAS_THREADS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "BLIS_NUM_THREADS",
)
"""Variables of the environment that say so before numpy is loaded."""


def single_threaded(function: Callable[P, R]) -> Callable[P, R]:
    """Wrap a function so that it runs with one BLAS thread.

    The matrices of the function are small, so that several threads would wait for each other ten
    times as long as they compute. Without the package threadpoolctl the number of threads is not
    changed.
    """

    @wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            from threadpoolctl import threadpool_limits
        except ModuleNotFoundError:  # slower, and the last bits are those of so many threads
            return function(*args, **kwargs)
        with threadpool_limits(1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


def alone(function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """Call the function with one BLAS thread and return its result."""
    return single_threaded(function)(*args, **kwargs)


def alone_each(map: Callable[..., Iterable[R]]) -> Callable[..., Iterable[R]]:
    """Return a function like `map` that runs each call with one BLAS thread.

    map : the built-in map, or a function like it that uses several processes.
    """
    return lambda function, keys: map(partial(alone, function), keys)
