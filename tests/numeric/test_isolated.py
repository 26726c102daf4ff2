"""The process that reads a file: it ends alone, is ended where it takes too long or too much, and
answers one request at a time.
"""

import gc
import os
import signal
from itertools import pairwise

import numpy as np
import polars
import pytest
from campaign import some

from runtime.errors import InputError
from runtime.records.formats import isolated
from runtime.records.formats.columns import Source
from runtime.records.formats.isolated import IsolatedTable, memory_of, seconds_of
from runtime.records.formats.parquet import open_parquet
from runtime.records.formats.table import open_table

N = 1000
COLUMNS = {name: np.arange(N) * factor for name, factor in (("a", 1.0), ("b", 2.0))}


@pytest.fixture
def path(tmp_path):
    polars.DataFrame(COLUMNS).write_parquet(tmp_path / "x.parquet")
    return tmp_path / "x.parquet"


@pytest.fixture
def table(path):
    found = open_table(path)
    yield found
    found.close()


def alive(table):
    return table.idle is not None and table.idle.popen.poll() is None


def test_it_gives_what_the_format_gives(path, table):
    plain = open_parquet(Source(path))
    groups = [["a"], [], ["b", "a"]]
    assert (
        isinstance(table, IsolatedTable)
        and table.names == plain.names
        and table.samples(groups) == N
    )
    assert table.widths(groups) == plain.widths(groups) == [1, 0, 2] and table.row(3) == plain.row(
        3
    )
    for x, y in zip(table.read(groups), plain.read(groups), strict=True):
        np.testing.assert_array_equal(x, y)
    for block, other in zip(table.blocks(groups, 7), plain.blocks(groups, 7), strict=True):
        assert all(np.array_equal(x, y) for x, y in zip(block, other, strict=True))


def test_one_process_serves_all_requests_in_turn(table):
    first = table.idle.popen.pid
    table.read([["a"]])
    assert table.samples([["b"]]) == N and alive(table) and table.idle.popen.pid == first


def test_requests_between_blocks(table):
    """Blocks of two passes at once, and the place of a sample while blocks come."""
    for (x,), (y,) in zip(table.blocks([["a"]], 100), table.blocks([["b"]], 100), strict=True):
        np.testing.assert_array_equal(2 * x, y)
        assert table.row(1) == "sample 2"


def test_blocks_left_unread_end_their_process(table):
    blocks = table.blocks([["a"]], 10)
    next(blocks)
    blocks.close()
    assert table.idle is None and table.samples([["a"]]) == N


def test_it_ends_with_the_table(path):
    table = open_table(path)
    pid = table.idle.popen.pid
    del table
    gc.collect()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_a_column_that_is_missing_leaves_it_alive(table):
    with pytest.raises(InputError, match=r"^x\.parquet: no column c; the file has a, b"):
        table.samples([["c"]])
    assert alive(table)


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (signal.SIGSEGV, "ends with SIGSEGV"),
        (signal.SIGABRT, "ends with SIGABRT"),
        (signal.SIGXCPU, "processor time"),
    ],
)
@some(1)
def test_a_library_that_ends_its_process(table, number, said):
    table.idle.popen.send_signal(number)
    table.idle.popen.wait()
    with pytest.raises(InputError, match=rf"^x\.parquet: .*{said}"):
        table.samples([["a"]])
    assert table.samples([["a"]]) == N  # by another process


def test_too_much_memory_or_time(path, monkeypatch):
    monkeypatch.setattr(isolated, "MEMORY", 2**20)
    with pytest.raises(
        InputError,
        match=r"^x\.parquet: (needs more than 1 MiB of memory|damaged, or not a Parquet file)",
    ):
        open_table(path).read([["a", "b"]])
    monkeypatch.undo()
    monkeypatch.setattr(isolated, "SECONDS", -1)
    with pytest.raises(InputError, match=r"^x\.parquet: takes more than -1 s of processor time"):
        for _ in range(200):
            open_table(path).read([["a", "b"]])


def test_limits_grow_with_the_file():
    sizes = [0, 10**6, 10**8, 10**10]
    for limit in (memory_of, seconds_of):
        assert all(limit(one) < limit(other) for one, other in pairwise(sizes))
    assert memory_of(51 * 10**6) < 750e6
