"""A map in this process and in others."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from campaign import campaign
from hang import HANG
from threadpoolctl import threadpool_info

from runtime.ground.errors import InputError
from runtime.parallel.processes import processes
from runtime.threads import alone_each


def told(key):
    """The key, the process, and the threads of BLAS in it."""
    import numpy as np

    np.ones((2, 2)) @ np.ones((2, 2))
    return (
        key,
        os.getpid(),
        [lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"],
    )


def failing(key):
    if key == 2:
        raise ValueError(f"key {key}")
    return key


def dying(key):
    os.kill(os.getpid(), signal.SIGKILL)


def late(key):
    """The first key takes longest."""
    time.sleep(0 if key else 1.0)
    return key**2


def telling(seconds):
    print(os.getpid(), flush=True)
    time.sleep(seconds)


def test_one_is_this_process():
    for count in (0, 1):
        with processes(count) as several:
            assert several is map


def test_several_have_one_thread_of_blas_each():
    with processes(2) as several:
        answers = list(alone_each(several)(told, range(4)))
    assert [key for key, *_ in answers] == [0, 1, 2, 3]
    assert os.getpid() not in {process for _, process, _ in answers}
    assert all(threads and set(threads) == {1} for *_, threads in answers)


@campaign
def test_results_in_the_order_of_the_keys():
    with processes(2) as several:
        assert list(several(late, range(4))) == [0, 1, 4, 9]


@pytest.mark.parametrize("count", [0, 2])
def test_a_failing_task_is_the_callers_error(count):
    with pytest.raises(ValueError, match="key 2"), processes(count) as several:
        list(several(failing, range(5)))


def test_a_process_that_dies_is_one_sentence():
    with (
        pytest.raises(InputError, match="a process died: the memory is full"),
        processes(2) as several,
    ):
        list(several(dying, range(2)))


def test_a_number_below_zero():
    with pytest.raises(InputError, match="-1 workers"), processes(-1):
        pass


@campaign
def test_processes_end_with_the_one_that_started_them(tmp_path):
    """Killed, it cannot tell them to."""
    code = (
        "from runtime.parallel.processes import processes\nimport test_processes\nif __name__ == '__main__':\n"
        "    with processes(2) as several:\n        list(several(test_processes.telling, [3600.0, 3600.0]))\n"
    )
    script = tmp_path / "script.py"
    script.write_text(code)
    here = os.pathsep.join(str(Path(__file__).parents[k]) for k in range(3))
    process = subprocess.Popen(
        [sys.executable, str(script)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": here},
    )
    worker = int(process.stdout.readline())
    process.kill()
    process.communicate()
    limit = time.monotonic() + HANG
    while Path(f"/proc/{worker}").exists() and time.monotonic() < limit:
        time.sleep(0.05)
    assert not Path(f"/proc/{worker}").exists()
