"""A Dask cluster of two worker processes: the bits of one process, workers that die, schedulers
that do not answer.
"""

import os
import signal
import socket
import sys
from functools import partial
from pathlib import Path

import distributed as dask
import planar_2r_model as planar
import pytest
from hang import HANG
from planar_data import record

from runtime.compose import cestac
from runtime.core.errors import InputError
from runtime.core.study import CestacSettings, Lowpass, Signals
from runtime.parallel.cluster import cluster as mapped
from runtime.study import Study

RECORD = record(N=3000)
STUDY = Study(
    signals=Signals(median=1, lowpass=Lowpass(cutoff=20)),
    cestac=CestacSettings(delta=(1e-3, 2e-3), runs=12, columns="all"),
)


@pytest.fixture
def cluster(processes):
    """The cluster with both of its processes: what the test before has killed takes its time to
    come back on a busy machine.
    """
    with dask.Client(processes) as client:
        client.wait_for_workers(2, timeout=HANG)
    return processes


@pytest.fixture(scope="module")
def processes():
    """Two processes on this machine, nothing on the network."""
    with dask.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        dashboard_address="127.0.0.1:0",
        host="127.0.0.1",
    ) as local:
        with dask.Client(local) as client:
            here = Path(__file__).parent
            client.register_plugin(SearchPath([str(here), str(here.parent / "support")]))
        yield local


class SearchPath(dask.WorkerPlugin):
    """Workers find the tasks of this file, also those that replace dead ones."""

    name = "tests"

    def __init__(self, folders):
        self.folders = folders

    def setup(self, worker):
        sys.path[:0] = self.folders


def dying_once(folder, key):
    mark = folder / "died"
    if key == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return key, folder


def failing(key):
    if key == 2:
        raise ValueError(f"key {key}")
    return key


@pytest.mark.campaign
def test_same_bits_as_one_process(cluster):
    here = cestac(planar, RECORD, STUDY)
    calls = []
    with mapped(cluster.scheduler_address, timeout=HANG) as dask_map:
        there = cestac(
            planar,
            RECORD,
            STUDY,
            map=dask_map,
            progress=lambda done, total: calls.append((done, total)),
        )
    assert there.to_json() == here.to_json()
    assert calls[-1] == (24, 24) and len(calls) == 8


@pytest.mark.campaign
def test_a_worker_killed_halfway_changes_nothing(cluster):
    killed = []

    def kill_one(done, total):
        if done >= total // 2 and not killed:
            killed.append(next(iter(cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    with mapped(cluster.scheduler_address, timeout=HANG) as dask_map:
        there = cestac(planar, RECORD, STUDY, map=dask_map, progress=kill_one)
    assert killed and there.to_json() == cestac(planar, RECORD, STUDY).to_json()


@pytest.mark.campaign
def test_a_dead_worker_loses_nothing(cluster, tmp_path):
    with mapped(cluster.scheduler_address, timeout=HANG) as dask_map:
        found = list(dask_map(partial(dying_once, tmp_path), range(20)))
    assert found == [(key, tmp_path) for key in range(20)]
    assert (tmp_path / "died").exists()


@pytest.mark.campaign
def test_a_failing_task_is_the_callers_error(cluster):
    with (
        pytest.raises(ValueError, match="key 2"),
        mapped(cluster.scheduler_address, timeout=HANG) as dask_map,
    ):
        list(dask_map(failing, range(5)))


def test_no_scheduler():
    with socket.socket() as listening:  # takes connections and never answers
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        port = listening.getsockname()[1]
        address = f"tcp://127.0.0.1:{port}"
        with (
            pytest.raises(InputError, match=f"no answer from the scheduler {address}"),
            mapped(address, timeout=0.5),
        ):
            pass
    for address in (f"tcp://127.0.0.1:{port}", "127.0.0.1", "nonsense://1", " "):
        with (
            pytest.raises(InputError, match=f"no answer from the scheduler {address}"),
            mapped(address, timeout=0.5),
        ):
            pass


def test_no_workers():
    with (
        dask.LocalCluster(
            n_workers=0, processes=True, dashboard_address="127.0.0.1:0", host="127.0.0.1"
        ) as empty,
        pytest.raises(InputError, match=r"no answer from the scheduler .* or its workers"),
        mapped(empty.scheduler_address, timeout=0.5),
    ):
        pass


def test_without_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(InputError, match=r"pip install symgen\[scale\]"),
        mapped("tcp://127.0.0.1:1"),
    ):
        pass
