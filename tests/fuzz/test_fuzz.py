"""Every case that once failed, and new ones: each gives a result or a clear error, within the
limits of `harness`.
"""

import secrets
from pathlib import Path

import pytest
from campaign import FULL, campaign

from fuzz.formats import FORMATS
from fuzz.harness import Reader, case, run

CORPUS = Path(__file__).parent / "corpus"
CASES = 200  # of all formats in the default run
MORE = 40000 if FULL else 1000  # of a campaign, of a seed that was never tried


@pytest.mark.parametrize(
    "path", sorted(CORPUS.glob("*/*")), ids=lambda path: f"{path.parent.name}/{path.name}"
)
def test_corpus(reader, path):
    outcome = reader(path.parent.name, path.read_bytes())
    assert not is_ours(path.parent.name, outcome), outcome


def is_ours(name, outcome):
    """Whether it is a fault, and not that of a compiled library which hangs or dies."""
    return outcome.fault and not (FORMATS[name].foreign and outcome.kind in ("hang", "death"))


def faultless(reader, name, seed, cases):
    """So many cases of all formats, those of one; a fault is told by the number of its case."""
    count = -(-cases * FORMATS[name].share // sum(x.share for x in FORMATS.values()))
    for number, _, outcome in run(reader, name, seed, range(count)):
        assert not is_ours(name, outcome), (
            f"python -m fuzz {name} --seed {seed} --first {number} --cases 1: {outcome}"
        )


@pytest.mark.parametrize("name", FORMATS)
def test_cases(reader, name):
    faultless(reader, name, 1, CASES)


@campaign
@pytest.mark.parametrize("name", FORMATS)
def test_many_cases(reader, name):
    faultless(reader, name, secrets.randbits(32), MORE)


def test_a_case_is_told_by_its_number():
    for name in FORMATS:
        if name not in (
            "bag",
            "mcap",
            "db3",
            "ros2",
            "parquet",
            "mat73",
        ):  # their seeds hold what their writers like
            assert case(name, 7, 3) == case(name, 7, 3) != case(name, 7, 4)


@campaign
def test_the_harness_finds_faults():
    """A hang, an interpreter that ends, memory, a traceback and an unclear message are each seen."""
    reader = Reader(seconds=1.0)
    assert reader("faulty", b"ok").kind == "ok"
    kinds = {
        kind: reader("faulty", kind.encode()).kind
        for kind in ("memory", "traceback", "unclear", "control", "hang", "death")
    }
    reader.close()
    assert kinds == {
        "hang": "hang",
        "death": "death",
        "memory": "MemoryError",
        "traceback": "KeyError",
        "unclear": "unclear",
        "control": "unclear",
    }
