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


def numbers(count: int = 5) -> list[str]:
    return [f"{k / 100},{np.sin(k):.9f},{np.cos(k):.9f}" for k in range(count)]


@pytest.mark.parametrize(
    "head",
    [
        ["# t,q1,tau1"],  # as numpy.savetxt writes it
        ["# a remark, of two parts", "#t, q1, tau1"],
        ["% t,q1,tau1"],
        ["% a remark", "t,q1,tau1"],
        ["sep=,", "t,q1,tau1"],
        ["sep=,", "% a remark", '"t","q1","tau1"'],
    ],
)
def test_names_of_columns_above_the_numbers(tmp_path, head):
    table = read_table(written(tmp_path / "run.csv", [*head, *numbers()]))
    assert table.names == ("t", "q1", "tau1") and len(table.columns["q1"]) == 5


@pytest.mark.parametrize("remark", ["# a remark", "# t,q1", "# t,q1,q1", "# 1,2,3", "#", "%"])
def test_a_remark_is_no_header(tmp_path, remark):
    table = read_table(written(tmp_path / "run.csv", [remark, *numbers()]))
    assert table.names == ("1", "2", "3") and len(table.columns["3"]) == 5


def test_a_column_has_its_number_beside_its_name(tmp_path):
    """Numbers in a study mean the same columns, whether or not the file has names for them."""
    bare = written(tmp_path / "bare.csv", numbers())
    for head in (["t,q1,tau1"], ["# t,q1,tau1"]):
        table = read_table(written(tmp_path / "named.csv", [*head, *numbers()]))
        names = ["3", "1"]
        assert table.read(names).tobytes() == read_table(bare).read(names).tobytes()
        with pytest.raises(InputError, match="no column 4"):
            table.read(["4"])
    named_two = written(tmp_path / "two.csv", ["2,q1,tau1", *numbers()])
    two = read_table(named_two)
    assert (two.read(["2"]) == two.columns["2"][:, None]).all()  # a name goes before a number


def test_a_field_in_quotation_marks_may_contain_the_separator(tmp_path):
    lines = ['t,"q, measured",tau1,note', *(f'{line},"arm {k}, run"' for k, line in enumerate(numbers()))]  # fmt: skip
    table = read_table(written(tmp_path / "run.csv", lines))
    assert table.names == ("t", "q, measured", "tau1", "note")
    plain = read_table(written(tmp_path / "plain.csv", ["t,q,tau1", *numbers()]))
    for name, other in (("q, measured", "q"), ("tau1", "tau1")):
        assert table.columns[name].tobytes() == plain.columns[other].tobytes()
    with pytest.raises(InputError, match=r"column 'note', line 2: 'arm 0, run'; expected a number"):
        table.read(["note"])


def test_a_file_of_zeros_is_told_in_one_sentence(tmp_path):
    path = tmp_path / "run.csv"
    path.write_bytes(bytes(100_000))
    with pytest.raises(InputError, match=r"not a text file.*zeros") as e:
        read_table(path)
    assert len(str(e.value)) < 200
