"""A Dask cluster of two worker processes as `map=`: the bits of one process, a worker that dies, many
records, and the example of many robots.
"""

import json
import os
import runpy
import signal
from pathlib import Path

import dask
import numpy as np
import planar_2r_model as planar
import pytest
from campaign import campaign
from distributed import Client, KilledWorker, LocalCluster
from planar_data import record

import runtime
import symgen
from runtime.compose import cestac
from runtime.core.model import load_model
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


@pytest.fixture
def many(tmp_path, monkeypatch):
    """A study of six records; the fourth file is damaged."""
    monkeypatch.chdir(tmp_path)
    for k in range(6):
        run = record(N=3000, seed=k)
        np.savetxt(
            f"run{k}.csv",
            np.column_stack([run.t, run.q, run.tau]),
            delimiter=",",
            header="t,q1,q2,tau1,tau2",
            comments="",
        )
    Path("run3.csv").write_text("t,q1\n0,0\n")
    files = {"files": ["run0.csv"], "also": [[f"run{k}.csv"] for k in range(1, 6)]}
    return runtime.Study(record=files, signals={"lowpass": {"cutoff": 20}})


def without_hash(folder):
    return {f.parent.name: json.loads(f.read_text())["X"] for f in folder.glob("*/estimate.json")}


def test_many_records_on_a_cluster_are_those_of_one_process(client, many, tmp_path):
    """The same rows in the same order; the machines know the files by their whole names."""
    model = load_model(symgen.model("planar_2r"))
    here = runtime.identify_each(model, many, "here")
    client.run(os.chdir, "/")
    counts = []
    there = runtime.identify_each(
        model, many, "there", map=on(client), progress=lambda *count: counts.append(count)
    )
    assert there == here and counts == [(k, 6) for k in range(7)]
    assert [row["record"] for row in here] == [f"run{k}" for k in range(6)]
    assert [row["state"] == "failed" for row in here] == [k == 3 for k in range(6)]
    assert "run3.csv" in here[3]["text"] and not any(row["kept"] for row in here)
    assert len(without_hash(tmp_path / "here")) == 5
    assert without_hash(tmp_path / "there") == without_hash(tmp_path / "here")


@campaign
def test_a_worker_that_dies_with_a_record_is_told_and_the_call_is_continued(many, tmp_path):
    """One worker, and no second try: the record is named, and a repeated call keeps the others."""
    model = load_model(symgen.model("planar_2r"))

    def deadly(function, keys):
        """Like the built-in map, record after record; the worker dies of run2."""

        def work(key):
            return os.kill(os.getpid(), signal.SIGKILL) if key[0] == "run2" else function(key)

        return (client.submit(work, key).result() for key in keys)

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as local,
        Client(local) as client,
    ):
        with pytest.raises(KilledWorker) as told:
            runtime.identify_each(model, many, "results", map=deadly)
        (note,) = told.value.__notes__
        assert note == (
            "2 of 6 records are finished, and their results are in results; the next one was run2"
        )
        rows = runtime.identify_each(model, many, "results", map=on(client))
    assert [row["kept"] for row in rows] == [True, True, False, False, False, False]
    assert len(without_hash(tmp_path / "results")) == 5
