"""Long studies: killed, interrupted, on a full disk, and resumed with the bits of an uninterrupted
one.
"""

import errno
import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import planar_2r_model as planar
import pytest
from hang import HANG
from planar_data import record

from runtime.compose import cestac
from runtime.core.cestac.runs import Run, Runs
from runtime.core.study import Lowpass
from runtime.ground.errors import InputError
from runtime.parallel.checkpoint import Checkpoint
from runtime.study import CestacSettings, Signals, Study

RECORD = record(N=3000)
HERE = Path(__file__).parent


def study(**settings):
    settings = {"delta": (1e-3, 2e-3), "runs": 10, "columns": "all", **settings}
    return Study(
        signals=Signals(median=1, lowpass=Lowpass(cutoff=20)), cestac=CestacSettings(**settings)
    )


@pytest.fixture(scope="module")
def whole():
    return cestac(planar, RECORD, study())


def same_bits(found, expected):
    return all(
        np.array_equal(getattr(a.runs, name), getattr(b.runs, name))
        for a, b in zip(found.levels, expected.levels, strict=True)
        for name in ("run", "X", "residual_norm")
    )


def stopping_after(count, kind=KeyboardInterrupt):
    def progress(done, total):
        if done >= count:
            raise kind

    return progress


def files(folder):
    return sorted(p.name for p in folder.iterdir())


def test_interrupted_and_resumed(tmp_path, whole):
    first = Checkpoint(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        cestac(planar, RECORD, study(), checkpoint=first, progress=stopping_after(7))
    assert files(tmp_path) == ["runs.npz"] and first.written >= 7
    seen = []
    second = cestac(
        planar,
        RECORD,
        study(),
        checkpoint=Checkpoint(tmp_path),
        progress=lambda done, total: seen.append(done),
    )
    assert seen[0] == first.written + 2 and seen[-1] == 20  # tasks of two runs
    assert same_bits(second, whole) and second.to_json() == whole.to_json()
    cestac(
        planar,
        RECORD,
        study(),
        checkpoint=Checkpoint(tmp_path),
        progress=lambda *_: pytest.fail("nothing is left to do"),
    )


def test_longer_study_repeats_nothing(tmp_path, whole):
    cestac(planar, RECORD, study(runs=6), checkpoint=Checkpoint(tmp_path))
    seen = []
    found = cestac(
        planar,
        RECORD,
        study(),
        checkpoint=Checkpoint(tmp_path),
        progress=lambda done, total: seen.append(done),
    )
    assert same_bits(found, whole) and min(seen) > 12
    shorter = cestac(planar, RECORD, study(runs=4), checkpoint=Checkpoint(tmp_path))
    assert np.array_equal(shorter.levels[1].runs.X, whole.levels[1].runs.X[:4])


SCRIPT = """
import os, resource, sys, time
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[name] = "1"
sys.path[:0] = [sys.argv[1], *(os.path.join(sys.argv[1], "..", x) for x in ("", "support"))]
from pathlib import Path
from test_checkpoint import RECORD, Checkpoint, cestac, planar, study
if sys.argv[3] != "0":
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]), int(sys.argv[3])))
print("ready", flush=True)
def held(done, total):
    if (Path(sys.argv[2]) / "runs.npz").exists():
        print("saved", flush=True)
        time.sleep(3600)
progress = held if sys.argv[3] == "0" else None
cestac(planar, RECORD, study(), checkpoint=Checkpoint(Path(sys.argv[2]), every=0.0), progress=progress)
"""


def started(folder, limit=0):
    arguments = [sys.executable, "-c", SCRIPT, str(HERE), str(folder), str(limit)]
    return subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.campaign  # a process of its own imports this file
def test_killed_and_resumed(tmp_path, whole):
    process = started(tmp_path)
    assert [process.stdout.readline() for _ in range(2)] == ["ready\n", "saved\n"]
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    (tmp_path / "runs.npz.unfinished").write_bytes(
        b"PK half of an archi"
    )  # as a kill in the middle of writing leaves it
    checkpoint = Checkpoint(tmp_path)
    found = cestac(planar, RECORD, study(), checkpoint=checkpoint)
    assert same_bits(found, whole)
    assert not [name for name in files(tmp_path) if "unfinished" in name]


@pytest.mark.campaign  # a process of its own imports this file
def test_full_disk(tmp_path, whole):
    """A limit on the size of files, below that of the file."""
    process = started(tmp_path, limit=1000)
    _, errors = process.communicate(timeout=HANG)
    assert process.returncode == 1
    assert "InputError" in errors and "File too large; 0 runs are saved" in errors
    assert list(tmp_path.iterdir()) == []
    assert same_bits(cestac(planar, RECORD, study(), checkpoint=Checkpoint(tmp_path)), whole)


def test_disk_that_fills_up_leaves_earlier_runs(tmp_path, whole, monkeypatch):
    first = Checkpoint(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        cestac(planar, RECORD, study(), checkpoint=first, progress=stopping_after(8))

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = (tmp_path / "runs.npz").read_bytes()
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(
        InputError, match=f"No space left on device; {first.written} runs are saved"
    ):
        cestac(planar, RECORD, study(), checkpoint=Checkpoint(tmp_path))
    monkeypatch.undo()
    assert files(tmp_path) == ["runs.npz"] and (tmp_path / "runs.npz").read_bytes() == before
    assert same_bits(cestac(planar, RECORD, study(), checkpoint=Checkpoint(tmp_path)), whole)


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (lambda r, s: (r, study(seed=2)), "cestac.seed"),
        (lambda r, s: (r, study(delta=(1e-3,))), "cestac.delta"),
        (lambda r, s: (replace(r, tau=r.tau + 1e-12), s), "records"),
        (
            lambda r, s: (r, replace(s, signals=replace(s.signals, lowpass=Lowpass(cutoff=21)))),
            "factor, signals",
        ),
    ],
)
def test_another_study_is_refused(tmp_path, change, names):
    cestac(planar, RECORD, study(runs=2), checkpoint=Checkpoint(tmp_path))
    changed = change(RECORD, study(runs=2))
    with pytest.raises(
        InputError, match=rf"another study \(different: {names}\); use another folder"
    ):
        cestac(planar, *changed, checkpoint=Checkpoint(tmp_path))


def some_runs(first, count, b=3):
    return Runs.of(
        [
            Run(0, k, tuple(float(k + i) for i in range(b)), 1.0)
            for k in range(first, first + count)
        ],
        b,
    )


def test_runs_are_written_when_it_is_time(tmp_path, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("runtime.parallel.checkpoint.monotonic", lambda: now[0])
    checkpoint = Checkpoint(tmp_path, every=10)
    assert len(checkpoint.resume({"a": 1}, 3)) == 0
    checkpoint.add(some_runs(0, 5))
    assert files(tmp_path) == []
    now[0] = 11.0
    checkpoint.add(some_runs(5, 5))
    assert files(tmp_path) == ["runs.npz"] and checkpoint.written == 10
    checkpoint.add(some_runs(10, 1))
    checkpoint.flush()
    checkpoint.flush()
    found = Checkpoint(tmp_path).resume({"a": 1}, 3)
    assert found.run.tolist() == list(range(11)) and found[10] == Run(
        0, 10, (10.0, 11.0, 12.0), 1.0
    )
    checkpoint.remove()
    assert files(tmp_path) == []


def test_the_file_is_compact(tmp_path):
    """100,000 runs of 60 parameters must fit: no more than their numbers and 10 %."""
    b, R = 60, 20_000
    rng = np.random.default_rng(0)
    runs = Runs(
        np.zeros(R, dtype=np.int64),
        np.arange(R),
        rng.standard_normal((R, b)),
        np.ones(R),
    )
    checkpoint = Checkpoint(tmp_path)
    checkpoint.resume({}, b)
    checkpoint.add(runs)
    checkpoint.flush()
    assert (tmp_path / "runs.npz").stat().st_size < 1.1 * 8 * R * b


def damaged(path):
    path.write_bytes(path.read_bytes()[:300])


def pickled(path):
    np.savez(
        path,
        study="{}",
        X=np.array([{"a": 1}], dtype=object),
        **dict.fromkeys(("level", "run", "residual_norm"), np.zeros(1)),
    )


def other_shape(path):
    np.savez(
        path,
        study="{}",
        X=np.zeros((2, 4)),
        level=np.zeros(2, int),
        run=np.zeros(2, int),
        residual_norm=np.zeros(2),
    )


def other_text(path):
    np.savez(
        path,
        study="[1]",
        X=np.zeros((2, 3)),
        **dict.fromkeys(("level", "run"), np.zeros(2, int)),
        residual_norm=np.zeros(2),
    )


@pytest.mark.parametrize("spoil", [damaged, pickled, other_shape, other_text])
def test_bad_files(tmp_path, spoil):
    checkpoint = Checkpoint(tmp_path)
    checkpoint.resume({}, 3)
    checkpoint.add(some_runs(0, 5))
    checkpoint.flush()
    spoil(tmp_path / "runs.npz")
    with pytest.raises(InputError, match=r"runs\.npz: .*delete this file"):
        Checkpoint(tmp_path).resume({}, 3)


def test_the_file_says_what_was_studied(tmp_path):
    cestac(planar, RECORD, study(runs=2), checkpoint=Checkpoint(tmp_path))
    with np.load(tmp_path / "runs.npz") as archive:
        found = json.loads(str(archive["study"]))
    assert (
        found["cestac.seed"] == 1
        and found["robot"] == "planar_2r_test"
        and "cestac.runs" not in found
    )


@pytest.mark.parametrize("name", ["runs.npz", "runs.npz.unfinished"])
@pytest.mark.parametrize("kind", ["link", "pipe", "folder"])
def test_names_of_our_own_that_are_no_files_are_refused(tmp_path, name, kind):
    """A pipe would never answer; a link would write elsewhere."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_text("kept")
    folder = tmp_path / "results"
    folder.mkdir()
    {
        "link": lambda: (folder / name).symlink_to(elsewhere),
        "pipe": lambda: os.mkfifo(folder / name),
        "folder": (folder / name).mkdir,
    }[kind]()
    with pytest.raises(InputError, match="a link, a folder, a pipe or a device"):
        Checkpoint(folder).resume({}, 2)
    assert elsewhere.read_text() == "kept"
