"""Puts tests/ on the import path (`from oracles... import ...`), makes hypothesis reproducible,
finds the measured records.

Records: SYMGEN_DATA, the cache, then ../shared/data beside the repository; else the test is
skipped, or fails where they are required.
"""

import gc
import os
import random
from hashlib import sha256

os.environ.setdefault(
    "OPENBLAS_NUM_THREADS", "1"
)  # before numpy loads: test processes would fight for the cores

from pathlib import Path

import pytest
from campaign import campaign
from hypothesis import settings

from runtime.core.loading import KEY, cache_folder
from runtime.ground.errors import DataUnavailableError
from runtime.reading.datasets import DATASETS, fetch, locate

# Expressions and syntax trees stay alive by the hundred thousand: looking at them again and again
# costs a tenth of the time.
gc.set_threshold(200_000, 50, 100)
settings.register_profile("symgen", derandomize=True, deadline=None)
settings.load_profile("symgen")

ROOT = Path(__file__).resolve().parents[1]
for emitted in (ROOT / "generated").glob("*.*"):  # as `symgen generate all` leaves them
    key = sha256(emitted.read_bytes()).hexdigest()[:KEY]
    (cache_folder("modules") / key).mkdir(parents=True, exist_ok=True, mode=0o700)

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"


def _provide(name, patch):
    files = DATASETS[name].files
    if any(locate(name, file) is None for file in files) and BESIDE.is_dir():
        patch.setenv("SYMGEN_DATA", str(BESIDE))
    required = os.environ.get("SYMGEN_REQUIRE_DATA") == "1"
    if required:
        try:
            return {file: fetch(name, file) for file in files}
        except DataUnavailableError as e:
            pytest.fail(f"SYMGEN_REQUIRE_DATA=1 but {e}")
    paths = {file: locate(name, file) for file in files}
    if None in paths.values():
        pytest.skip(
            f"the {name} record is not on this machine: set SYMGEN_DATA to a folder that holds "
            f"{name}/{', '.join(files)}"
        )
    return paths


@pytest.fixture(scope="session")
def emps_data():
    """Paths of the EMPS files by name; `fetch` finds them too."""
    with pytest.MonkeyPatch.context() as patch:
        yield _provide("emps", patch)


@pytest.fixture(scope="session")
def tx40_data():
    """Paths of the TX40 files by name; `fetch` finds them too."""
    with pytest.MonkeyPatch.context() as patch:
        yield _provide("tx40", patch)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Of tests marked `some(count)` the other cases are a campaign."""
    cases = {}
    for item in items:
        if item.get_closest_marker("some") and not item.get_closest_marker("campaign"):
            cases.setdefault((item.path, item.originalname), []).append(item)
    for listed in cases.values():
        (count,) = listed[0].get_closest_marker("some").args
        rest = len(listed) - count
        for item in random.Random(0).sample(sorted(listed, key=lambda i: i.nodeid), max(rest, 0)):
            item.add_marker(campaign)


def pytest_terminal_summary(terminalreporter, config):
    """What the random robots of the campaigns are made of: a mix that changes should be seen."""
    if "not campaign" in config.option.markexpr:
        return
    from oracles.random_robots import describe_mix, random_robot

    shares = {
        name: share
        for name, share in describe_mix(random_robot(seed) for seed in range(250)).items()
        if name != "robots"
    }
    terminalreporter.write_line(
        "250 random robots: "
        + ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares.items())
    )
