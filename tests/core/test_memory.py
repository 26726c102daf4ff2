"""Rows that the memory cannot hold are refused before they are made; what systems tell of memory."""

from pathlib import Path

import numpy as np
import planar_2r_model as planar
import pytest
from planar_data import TRUE, motion

from runtime import Record, estimate, plausibility
from runtime.ground import memory
from runtime.ground.errors import InputError
from runtime.ground.limits import LIMIT
from runtime.study import study_from_mapping

N = 4000
EVERY = study_from_mapping({"signals": {"decimate": None}, "rows": {"low_speed": 0}})
PIECE = study_from_mapping(
    {"signals": {"decimate": None}, "rows": {"low_speed": 0, "window": [0, 2]}}
)
T = np.arange(N) / 1000.0
MEMINFO = "MemTotal:       100 kB\nMemAvailable:   60 kB\nSwapFree:       4 kB\n"


@pytest.fixture
def record() -> Record:
    q, qd, qdd = motion(T)
    return Record(t=T, q=q, tau=planar.inverse_dynamics(q, qd, qdd, TRUE), rate=1000.0)


def asked_for(monkeypatch: pytest.MonkeyPatch, available: float) -> None:
    """Everything is told, and `available` bytes can be taken."""
    monkeypatch.setattr(LIMIT, "MEMORY_TOLD", 0.0)
    monkeypatch.setattr(memory, "SMALL", 0.0)
    monkeypatch.setattr(memory, "available_memory", lambda: available)


def test_rows_that_do_not_fit_are_refused(record: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    """The bytes of W stand in the message: all of its rows and columns, twice."""
    W = 8 * estimate(planar, record, EVERY).rows * len(TRUE)
    asked_for(monkeypatch, 2 * W + 1)
    estimate(planar, record, EVERY)
    asked_for(monkeypatch, 2 * W - 1)
    with pytest.raises(
        InputError, match=r"^[\d,]+ rows of \d+ columns need about .* GB of memory, "
    ):
        estimate(planar, record, EVERY)
    estimate(planar, record)  # decimated, as the message says
    estimate(planar, record, PIECE)


def test_a_question_that_needs_more_memory_is_open(
    record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The check of record and study makes a second W, and says so where it has no room."""
    W = 8 * estimate(planar, record, EVERY).rows * len(TRUE)
    asked_for(monkeypatch, 2 * W - 1)
    checks = plausibility(planar, record, EVERY).checks()
    (excited,) = [c for c in checks if c.question == "Does the motion excite every parameter?"]
    assert excited.state == "open" and excited.finding.startswith("Not judged: ")
    assert " GB of memory, and " in excited.finding


def test_small_work_is_not_told(record: Record, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", "runtime.ground.progress"):
        estimate(planar, record, EVERY)
    assert "memory" not in caplog.text


def test_large_work_is_told(
    record: Record, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked_for(monkeypatch, 1e9)
    with caplog.at_level("INFO", "runtime.ground.progress"):
        estimate(planar, record, EVERY)
    assert "columns: about 0.00" in caplog.text


@pytest.mark.parametrize(
    ("limit", "found"), [("max\n", 64 * 1024), ("50000\n", 40000), ("200000\n", 64 * 1024)]
)
def test_memory_is_what_machine_and_container_leave(
    limit: str, found: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "meminfo").write_text(MEMINFO)
    (tmp_path / "memory.max").write_text(limit)
    (tmp_path / "memory.stat").write_text("anon 10000\nfile 7\n")
    monkeypatch.setattr(memory, "MEMINFO", tmp_path / "meminfo")
    monkeypatch.setattr(memory, "CONTAINER", tmp_path)
    assert memory.available_memory() == found


def test_a_system_that_tells_nothing_of_free_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All memory of the machine then, more than what is free."""
    free = memory.available_memory()
    monkeypatch.setattr(memory, "MEMINFO", tmp_path / "none")
    monkeypatch.setattr(memory, "CONTAINER", tmp_path)
    assert memory.available_memory() > free / 2
