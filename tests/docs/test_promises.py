"""The table of promises in benchmarks/truth.md quotes sentences that stand where it says, and names
tests, benchmarks and questions that there are."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TABLE = (ROOT / "benchmarks/truth.md").read_text().split("## Every promise")[1]
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in TABLE.splitlines()
    if line.startswith("|") and not line.startswith(("| **", "|---", "| place"))
]


def plain(text: str) -> str:
    """Words alone: no marks of Markdown, no seams of adjacent string literals."""
    return " ".join(re.sub(r'"\s*f?"|[*`\[\]]|\([^()]*\.md[^()]*\)', "", text).split()).lower()


def texts(place: str) -> str:
    """What stands on the pages, in the modules and in README that a cell names."""
    paths = [ROOT / "benchmarks" / link for link in re.findall(r"\]\(([^)#]+)", place)]
    for name in re.findall(r"`([\w/]+\.py)`", place):
        paths += [path for room in ("runtime", "symgen") for path in (ROOT / room).rglob(name)]
    paths += [ROOT / "README.md"] if "README" in place else []
    if "page of `report`" in place:
        paths += [
            ROOT / "runtime/reporting/parameters.py",
            ROOT / "runtime/physical/consistency.py",
        ]
    return " ".join(plain(path.read_text()) for path in paths)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0][:40])
def test_quoted_sentences_stand_there(row: list[str]) -> None:
    text = texts(row[0])
    assert text
    for quoted in re.findall(r'"([^"]+)"', row[1]):
        for piece in plain(quoted).split("..."):
            assert piece.strip() in text, piece


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0][:40])
def test_measurements_exist(row: list[str]) -> None:
    questions = (ROOT / "benchmarks/truth.py").read_text()
    for name in re.findall(r"`([^`]+)`", row[2]):
        word = name.split()[0]
        if "/" in word:
            assert (ROOT / word).exists(), word
        elif word.endswith(".py"):
            assert list((ROOT / "tests").rglob(word)), word
        elif word != "runtime":
            assert re.search(rf"\b{word}\b", questions), word
