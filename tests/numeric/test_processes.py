"""Tasks in this process and in others."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from campaign import campaign

from runtime.errors import InputError
from runtime.parallel import BLAS_THREADS, in_order, results


def threads(context, key):
    return key, context["offset"] + key, os.getpid(), [os.environ.get(name) for name in BLAS_THREADS]


def failing(context, key):
    if key == context:
        raise ValueError(f"key {key}")
    return key


def dying_once(folder, key):
    """The process of key 1 dies the first time."""
    mark = folder / "died"
    if key == 1 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return key


def late(context, key):
    """The first key takes longest."""
    time.sleep(0 if key else context)
    return key**2


def always_dying(context, key):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_dead_process_loses_nothing(tmp_path):
    assert sorted(results(dying_once, tmp_path, range(4), 2)) == [0, 1, 2, 3]
    assert (tmp_path / "died").exists()


@pytest.mark.campaign
def test_processes_that_always_die():
    with pytest.raises(InputError, match="died 3 times before any of 2 tasks"):
        list(results(always_dying, None, range(2), 1))


@campaign
def test_processes_end_with_the_one_that_started_them(tmp_path):
    """Killed, it cannot tell them to."""
    code = "from runtime.parallel import results\nimport sys, time, test_processes\nif __name__ == '__main__':\n" \
           "    for pid in results(test_processes.waiting, None, [0.0, 60.0], 1):\n        print(pid, flush=True)\n"  # fmt: skip
    script = tmp_path / "script.py"
    script.write_text(code)
    here = os.pathsep.join(str(Path(__file__).parents[k]) for k in range(3))
    process = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": here})
    worker = int(process.stdout.readline())
    process.kill()
    process.communicate()
    limit = time.monotonic() + 20
    while Path(f"/proc/{worker}").exists() and time.monotonic() < limit:
        time.sleep(0.05)
    assert not Path(f"/proc/{worker}").exists()


def waiting(context, key):
    time.sleep(key)
    return os.getpid()


@campaign
def test_what_still_runs_ends_when_the_caller_stops():
    """As Ctrl-C does."""
    finished, start = results(waiting, None, [0.0, 60.0], 2), time.monotonic()
    next(finished)
    finished.close()
    assert time.monotonic() - start < 30


@campaign
def test_results_in_the_order_of_the_keys():
    assert list(in_order(late, 1.0, range(4), 2)) == [0, 1, 4, 9]


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
