"""Text files: numbers are parsed once, comments and ends of lines change no bit, and errors name the line."""

from pathlib import Path

import numpy as np
import pytest

from runtime import InputError, read_record
from runtime.reading.formats import read_table

rng = np.random.default_rng(3)


def written(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join(lines) + "\n")
    return path


def sampled_lines(N: int = 400) -> list[str]:
    t = np.arange(N) / 100
    rows = np.column_stack([t, np.sin(t), rng.normal(size=N) * 10.0 ** rng.integers(-12, 12, N)])
    return ["t,q1,tau1", *(",".join(map(repr, row)) for row in rows.tolist())]


def test_numbers_of_a_file_are_parsed_once(tmp_path, monkeypatch):
    path, calls = written(tmp_path / "run.csv", sampled_lines()), []
    parse = np.loadtxt
    monkeypatch.setattr(
        np, "loadtxt", lambda *args, **named: calls.append(1) or parse(*args, **named)
    )
    read_record(path)
    assert len(calls) == 1


def test_comments_give_the_same_bits(tmp_path):
    lines = sampled_lines()
    plain = read_record(written(tmp_path / "plain.csv", lines))
    by_lines = read_record(
        written(tmp_path / "commented.csv", [*lines[:7], "# a comment", "", *lines[7:]])
    )
    assert by_lines.q.tobytes() == plain.q.tobytes()
    assert by_lines.tau.tobytes() == plain.tau.tobytes()


@pytest.mark.parametrize("end", ["\r\n", "\r"])
def test_ends_of_lines(tmp_path, end):
    lines = sampled_lines()
    plain, other = read_record(written(tmp_path / "plain.csv", lines)), tmp_path / "other.csv"
    other.write_bytes(b"\xef\xbb\xbf" + (end.join(lines) + end).encode())
    record = read_record(other)
    assert record.q.tobytes() == plain.q.tobytes() and record.tau.tobytes() == plain.tau.tobytes()


def test_columns_that_nobody_asks_for_may_hold_anything(tmp_path):
    """A mode, a remark, fields that are empty: refused where they are asked for, with their first line."""
    lines = sampled_lines(40)
    plain = read_record(written(tmp_path / "plain.csv", lines))
    modes = ["mode", *(("", "auto", "7")[k % 3] for k in range(40))]
    mixed = [f"{line},{mode}" for line, mode in zip(lines, modes, strict=True)]
    record = read_record(written(tmp_path / "mixed.csv", mixed))
    assert record.q.tobytes() == plain.q.tobytes() and record.tau.tobytes() == plain.tau.tobytes()
    table = read_table(tmp_path / "mixed.csv")
    with pytest.raises(InputError, match=r"mixed\.csv, column 'mode', line 3: 'auto'; expected"):
        table.read(["t", "mode"])


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda line: line + ",7", "line 5: 4 fields; expected 3"),
        (lambda line: line.rsplit(",", 1)[0] + ",x", "line 5: 'x'; expected a number"),
        (lambda line: line.rsplit(",", 1)[0] + ",", "line 5: the field is empty"),
    ],
)
def test_what_is_wrong_is_told_by_line(tmp_path, damage, words):
    lines = sampled_lines()
    lines[4] = damage(lines[4])
    with pytest.raises(InputError) as e:
        read_record(written(tmp_path / "run.csv", lines))
    assert all(word in str(e.value) for word in words.split(": "))
