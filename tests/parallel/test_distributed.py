"""A Dask cluster of two worker processes as `map=`: the bits of one process, a worker that dies, and
the example of many robots.
"""

import os
import runpy
import signal
from pathlib import Path

import planar_2r_model as planar
import pytest
from campaign import campaign
from distributed import Client, LocalCluster
from planar_data import record

from runtime.compose import cestac
from runtime.core.study import Lowpass
from runtime.study import CestacSettings, Signals, Study

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "dask_many_robots.py"
RECORD = record(N=3000)
STUDY = Study(
    signals=Signals(median=1, lowpass=Lowpass(cutoff=20)),
    cestac=CestacSettings(delta=(1e-3, 2e-3), runs=12, columns="all"),
)


@pytest.fixture
def client():
    """Two processes on this machine, nothing on the network."""
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local,
        Client(local) as client,
    ):
        yield client


def on(client):
    return lambda function, keys: (future.result() for future in client.map(function, keys))


def test_the_example_of_many_robots(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    *rows, failed, runs = capsys.readouterr().out.splitlines()
    assert [row.partition(":")[0] for row in rows] == ["arm0", "arm1", "arm2"]
    assert all("%, Yes" in row for row in rows)
    assert failed.startswith("arm3: failed. ") and "there is no such file" in failed
    assert runs.startswith("Least squares is practically unbiased at 0.0001")


@campaign
def test_same_bits_as_one_process_also_if_a_worker_is_killed(client):
    killed = []

    def kill_one(done, total):
        if done >= total // 2 and not killed:
            killed.append(next(iter(client.cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    here = cestac(planar, RECORD, STUDY)
    assert cestac(planar, RECORD, STUDY, map=on(client)).to_json() == here.to_json()
    there = cestac(planar, RECORD, STUDY, map=on(client), progress=kill_one)
    assert killed and there.to_json() == here.to_json()
