"""Tasks in this process and in others."""

import os

import pytest

from runtime.processes import BLAS_THREADS, results


def threads(context, key):
    return key, context["offset"] + key, os.getpid(), [os.environ.get(name) for name in BLAS_THREADS]


def failing(context, key):
    if key == context:
        raise ValueError(f"key {key}")
    return key


def test_here_in_order():
    assert [r[:2] for r in results(threads, {"offset": 10}, range(4))] == [(k, 10 + k) for k in range(4)]


def test_elsewhere_with_one_blas_thread():
    before = {name: os.environ.get(name) for name in BLAS_THREADS}
    found = sorted(results(threads, {"offset": 10}, range(6), 2))
    assert [r[:2] for r in found] == [(k, 10 + k) for k in range(6)]
    assert os.getpid() not in {r[2] for r in found}
    assert all(r[3] == ["1"] * len(BLAS_THREADS) for r in found)
    assert {name: os.environ.get(name) for name in BLAS_THREADS} == before


@pytest.mark.parametrize("workers", [0, 1])
def test_a_failing_task_is_the_callers_error(workers):
    with pytest.raises(ValueError, match="key 2"):
        list(results(failing, 2, range(5), workers))


def test_negative_workers():
    with pytest.raises(ValueError, match="-1 workers"):
        list(results(failing, 2, range(5), -1))
