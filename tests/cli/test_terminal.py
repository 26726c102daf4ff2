"""What a terminal shows: lines as wide as it is, the answer in colour; nothing of it in a pipe."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from runtime.ground.progress import Work
from runtime.ground.table import aligned, interval, with_intervals
from symgen.cli import session, told

TEXT = "With care. " + "The model leaves a part unexplained. " * 4 + "\nZZ1R 1.79 +- 0.02"


def test_lines_end_between_words_where_the_terminal_does() -> None:
    verdict = SimpleNamespace(answer="With care", state="doubtful")
    lines = session.on_terminal(TEXT, 60, verdict).splitlines()
    assert lines[0].startswith("\x1b[33m\x1b[1mWith care\x1b[0m. The model")
    assert lines[-1] == "ZZ1R 1.79 +- 0.02"
    plain = session.on_terminal(TEXT, 60).splitlines()
    assert all(len(line) <= 60 for line in plain) and len(plain) == 4
    words = " ".join(line.strip() for line in plain).split()
    assert words == TEXT.split()


def test_a_wide_table_is_printed_in_parts_with_its_first_column() -> None:
    header = ["encoder", *(f"change of parameter {k}, %" for k in range(5))]
    rows = [[f"joint {j}", *(f"{j}.{k}" for k in range(5))] for j in range(3)]
    text = session.on_terminal("A caption\n" + aligned([header, *rows]), 80)
    lines = text.splitlines()
    assert max(map(len, lines)) <= 80 and lines[0] == "A caption"
    assert sum(line.startswith("joint 2") for line in lines) == 3
    cells = [cell for line in lines if line.startswith("joint 2") for cell in line.split()[2:]]
    assert cells == rows[2][1:]


def test_a_pipe_gets_the_lines_as_they_are(capsys: pytest.CaptureFixture) -> None:
    session.show(TEXT, verdict=SimpleNamespace(answer="With care", state="doubtful"))
    assert capsys.readouterr().out == TEXT + "\n"


@pytest.mark.parametrize(
    ("value", "half", "text"),
    [
        (0.165215, 0.000519, "0.16522 +- 0.00052"),
        (8.0, 0.4, "8.00 +- 0.40"),
        (-1e-9, 0.02, "0.000 +- 0.020"),
        (1234.56, 17.0, "1235 +- 17"),
        (7.693e8, 9.3e8, "7.7e+08 +- 9.3e+08"),
        (1.5, 0.0, "1.5 +- 0"),
        (1.5, float("nan"), "1.5 +- nan"),
        (1e-12, 3e-13, "1e-12 +- 3e-13"),
    ],
)
def test_digits_end_with_the_second_one_of_the_interval(value, half, text) -> None:
    assert " +- ".join(interval(value, half)) == text


def test_cells_stand_below_each_other() -> None:
    first, second = with_intervals(
        ["ZZ1R", "OFFSET1"], [1.79, -0.5], [0.01, 0.1], ["kg*m**2", "N*m"]
    )
    assert first.index("+-") == second.index("+-")
    assert first.index("kg") == second.index("N*m")


def test_long_work_tells_the_time_left_where_no_terminal_shows_a_bar(monkeypatch, capsys) -> None:
    """A line every ten seconds, none at the end; what is expected may change on the way."""
    clock = iter([0.0, 4.0, 11.0, 12.0, 30.0, 31.0])
    monkeypatch.setattr(told, "monotonic", lambda: next(clock))
    count = told.lines_of("steps")
    for done, total in ((1, 10), (2, 12), (3, 12), (10, 15), (15, 15)):
        count(done, total)
    assert capsys.readouterr().err.splitlines() == [
        "  steps: 2 of 12, about 55 s left",
        "  steps: 10 of 15, about 15 s left",
    ]


def test_work_counts_what_it_expects() -> None:
    seen: list[tuple[int, int]] = []
    work = Work(lambda done, total: seen.append((done, total)), later=10)
    work.begin(4)
    work.advance(3)
    work.left = 5  # more than was guessed
    work.advance()
    work.end()
    work.begin(6)
    work.advance(6)
    work.end()
    assert seen == [(0, 10), (3, 10), (4, 14), (4, 10), (4, 10), (10, 10), (10, 10)]
