"""Tasks in this process and in others."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from campaign import campaign

from runtime.blas import BLAS_THREADS
from runtime.errors import InputError
from runtime.parallel import Workers, results


def threads(context, key):
    """Where there is a `mark`, this process waits until another one has set it."""
    mark = context.get("mark")
    if mark and os.getpid() != context["own"]:
        mark.touch()
    while mark and not mark.exists():
        time.sleep(0.01)
    return (
        key,
        context["offset"] + key,
        os.getpid(),
        [os.environ.get(name) for name in BLAS_THREADS],
    )


def failing(context, key):
    if key == context:
        raise ValueError(f"key {key}")
    return key


def dying_once(context, key):
    """The first other process dies in its first task; this one waits until another has begun."""
    own, folder = context
    mark = folder / "died"
    if os.getpid() == own:
        while not mark.exists():
            time.sleep(0.01)
    elif not mark.exists():
        mark.write_text(str(key))
        os.kill(os.getpid(), signal.SIGKILL)
    return key, os.getpid()


def late(context, key):
    """The first key takes longest."""
    time.sleep(0 if key else context)
    return key**2


def dying_elsewhere(own, key=0, mark=None):
    if os.getpid() != own:
        if mark:
            mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    while mark and not mark.exists():
        time.sleep(0.01)
    return key


def always_dying(context, key):
    """Every other process dies; this one waits until one has begun."""
    return dying_elsewhere(context[0], key, context[1])


def test_a_dead_process_loses_nothing(tmp_path):
    """Its task goes to another one, never to this one, which it might end as well."""
    found = dict(results(dying_once, (os.getpid(), tmp_path), range(4), 2))
    assert sorted(found) == [0, 1, 2, 3]
    assert found[int((tmp_path / "died").read_text())] != os.getpid()


@pytest.mark.campaign
def test_processes_that_always_die(tmp_path):
    with pytest.raises(InputError, match="processes died 3 times before any of"):
        list(results(always_dying, (os.getpid(), tmp_path / "mark"), range(4), 2))


@campaign
def test_processes_end_with_the_one_that_started_them(tmp_path):
    """Killed, it cannot tell them to."""
    code = "from runtime.parallel import results\nimport os, test_processes\nif __name__ == '__main__':\n" \
           "    list(results(test_processes.telling, os.getpid(), [60.0, 60.0], 2))\n"  # fmt: skip
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
    limit = time.monotonic() + 20
    while Path(f"/proc/{worker}").exists() and time.monotonic() < limit:
        time.sleep(0.05)
    assert not Path(f"/proc/{worker}").exists()


def telling(own, seconds):
    if os.getpid() != own:
        print(os.getpid(), flush=True)
    time.sleep(seconds)


def waiting(context, seconds):
    time.sleep(seconds)


@campaign
def test_what_still_runs_ends_when_the_caller_stops():
    """As Ctrl-C does."""
    finished, start = results(waiting, None, [0.0, 60.0], 2), time.monotonic()
    next(finished)
    finished.close()
    assert time.monotonic() - start < 30


def test_here_in_order():
    own = {"offset": 10, "own": os.getpid()}
    for workers in (0, 1):
        assert [r[:3] for r in results(threads, own, range(4), workers)] == [
            (k, 10 + k, os.getpid()) for k in range(4)
        ]


def test_here_and_elsewhere_with_one_blas_thread(tmp_path):
    """The same processes serve one list of tasks after the other."""
    before, others = {name: os.environ.get(name) for name in BLAS_THREADS}, []
    with Workers(2) as workers:
        workers.start("runtime.parallel")
        for offset in (10, 20):
            context = {"offset": offset, "own": os.getpid(), "mark": tmp_path / str(offset)}
            found = sorted(results(threads, context, range(6), workers))
            assert [r[:2] for r in found] == [(k, offset + k) for k in range(6)]
            (other,) = {r[2] for r in found} - {os.getpid()}
            assert all(r[3] == ["1"] * len(BLAS_THREADS) for r in found if r[2] == other)
            others.append(other)
    assert others[0] == others[1] and not Path(f"/proc/{other}").exists()
    assert {name: os.environ.get(name) for name in BLAS_THREADS} == before


@pytest.mark.parametrize("workers", [0, 2])
def test_a_failing_task_is_the_callers_error(workers):
    with pytest.raises(ValueError, match="key 2"):
        list(results(failing, 2, range(5), workers))


def test_negative_workers():
    with pytest.raises(ValueError, match="-1 workers"):
        list(results(failing, 2, range(5), -1))
