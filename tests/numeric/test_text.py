"""Text files: numbers are parsed once, pieces of any size give the same bits, and errors name the
line.
"""

from pathlib import Path

import numpy as np
import pytest

from runtime import InputError, read_record
from runtime.records.formats import text
from runtime.records.formats.columns import Source

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


def test_comments_and_pieces_give_the_same_bits(tmp_path, monkeypatch):
    lines = sampled_lines()
    plain = read_record(written(tmp_path / "plain.csv", lines))
    by_lines = read_record(
        written(tmp_path / "commented.csv", [*lines[:7], "# a comment", "", *lines[7:]])
    )
    monkeypatch.setattr(text, "PIECE", 1000)
    long = read_record(tmp_path / "plain.csv")
    for other in (by_lines, long):
        assert other.q.tobytes() == plain.q.tobytes() and other.tau.tobytes() == plain.tau.tobytes()


@pytest.mark.parametrize("end", ["\r\n", "\r"])
def test_ends_of_lines(tmp_path, monkeypatch, end):
    lines = sampled_lines()
    plain, other = read_record(written(tmp_path / "plain.csv", lines)), tmp_path / "other.csv"
    other.write_bytes(b"\xef\xbb\xbf" + (end.join(lines) + end).encode())
    for piece in (text.PIECE, 1000, 7):
        monkeypatch.setattr(text, "PIECE", piece)
        record = read_record(other)
        assert (
            record.q.tobytes() == plain.q.tobytes() and record.tau.tobytes() == plain.tau.tobytes()
        )


@pytest.mark.parametrize("comment", [None, 3, 300, 401])
def test_files_are_read_in_pieces(tmp_path, monkeypatch, comment):
    """No sample is lost or read twice, wherever reading begins."""
    lines = sampled_lines()
    expected = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    if comment:
        lines.insert(comment, "# a comment")
    monkeypatch.setattr(text, "PIECE", 500)
    table = text.open_text(Source(written(tmp_path / "run.csv", lines)))
    assert table.samples([["t"]]) == len(expected)
    blocks = [np.stack(block) for block in table.parts(["tau1", "t"], 64)]
    assert [block.shape[1] for block in blocks] == [64] * 6 + [16]
    assert np.array_equal(np.concatenate(blocks, axis=1).T, expected[:, [2, 0]])
    assert table.in_any_order()
    for start, stop in ((0, 1), (63, 64), (1, 400), (250, 350), (399, 400)):
        part = np.concatenate(
            [np.stack(block) for block in table.parts(["tau1", "t"], 64, start, stop)], axis=1
        )
        assert np.array_equal(part.T, expected[start:stop, [2, 0]])


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda line: line + ",7", "line 5: 4 fields; expected 3"),
        (lambda line: line.rsplit(",", 1)[0] + ",x", "line 5: 'x'; expected a number"),
        (lambda line: line.rsplit(",", 1)[0] + ",", "line 5: an empty field"),
    ],
)
def test_what_is_wrong_is_told_by_line(tmp_path, damage, words):
    lines = sampled_lines()
    lines[4] = damage(lines[4])
    with pytest.raises(InputError) as e:
        read_record(written(tmp_path / "run.csv", lines))
    assert all(word in str(e.value) for word in words.split(": "))
