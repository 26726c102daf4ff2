"""One reading process for all tests of a worker: it takes seconds to import what it needs."""

import sys

import pytest

from fuzz.harness import Reader

if sys.platform != "linux":
    collect_ignore_glob = [
        "test_*.py"
    ]  # limits of memory and what a process has used are read as Linux tells them


@pytest.fixture(scope="session")
def reader():
    reader = Reader()
    yield reader
    reader.close()
