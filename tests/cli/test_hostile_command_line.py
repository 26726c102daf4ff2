"""Hostile files and arguments: no verb prints a traceback. Exit code 2, one line that names the
thing, nothing written.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from campaign import sampled, some
from hang import HANG
from typer.testing import CliRunner

from fuzz.seeds import csv_file, model_files
from symgen.cli.main import app

CORPUS = Path(__file__).parents[1] / "fuzz" / "corpus"
ENDINGS = (
    "",
    ".yaml",
    ".par",
    ".urdf",
    ".xml",
    ".py",
    ".csv",
    ".txt",
    ".npz",
    ".npy",
    ".mat",
    ".parquet",
    ".bag",
    ".db3",
    ".mcap",
    ".csv.gz",
    ".json",
)
ROBOT_ENDINGS, RECORD_ENDINGS = (
    ("", ".yaml", ".par", ".urdf", ".xml"),
    ("", ".yaml", ".csv", ".npz", ".mat", ".bag", ".mcap", ".json"),
)
STRANGE = (
    "\x1b[2Jarm",
    "two\nlines",
    "\u202egnp",
    "caf\udce9",
    "a" * 300,
    "%s%n",
    "-",
    "*",
    "~",
    "{{7*7}}",
    "__import__('os')",
    "/",
    "..",
    "nothing/at/all",
)
STUDY = (
    "symgen: 1\ncontroller:\n  law: {kind: pid, kp: [1, 1]}\n  rate: 100\n  reference: "
    "{points: {duration: 1}}\n"
)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder of things that are no robots, records or studies, a sound model and record, and what
    results may not replace.
    """
    folder = tmp_path_factory.mktemp("hostile")
    for ending in ENDINGS:
        os.mkfifo(folder / f"pipe{ending}")
        (folder / f"folder{ending}").mkdir()
        (folder / f"empty{ending}").write_bytes(b"")
        (folder / f"binary{ending}").write_bytes(bytes(range(256)) * 8)
        (folder / f"loop{ending}").symlink_to(f"loop{ending}")
    (folder / "model.py").write_bytes(model_files()[0])
    (folder / "record.csv").write_bytes(csv_file())
    (folder / "study.yaml").write_text(STUDY)
    (folder / "taken").write_text("mine")
    return folder


@pytest.fixture(autouse=True)
def here(place, monkeypatch):
    monkeypatch.chdir(place)


def content(folder):
    """Names, kinds and times of everything in the folder."""
    return {path: (path.lstat().st_mode, path.lstat().st_mtime_ns) for path in folder.rglob("*")}


def answered(*arguments):
    """Exit code and error stream of a command that changes nothing on disk, whatever it was given."""
    before = content(Path())
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), (
        arguments,
        result.exception,
    )
    assert content(Path()) == before, arguments
    assert "Traceback" not in result.output
    return result.exit_code, result.stderr


def refused(*arguments, named=""):
    code, said = answered(*arguments)
    assert code == 2, (arguments, said)
    said = said.removeprefix("\n")  # where a bar of progress was
    assert said.startswith("error: ") and said.endswith("\n") and said[:-1].isprintable(), (
        arguments,
        said,
    )
    assert named in said, (arguments, said)


def spelled(name):
    """As an error names it."""
    return "".join(
        c if c.isprintable() else "\\n" if c == "\n" else f"\\x{ord(c):02x}" for c in name
    )


@pytest.mark.parametrize("kind", ["pipe", "folder", "empty", "binary", "loop", "missing"])
@some(3)
def test_what_is_no_robot(kind):
    for ending in ROBOT_ENDINGS:
        for verb in (("show",), ("generate", "-o", "out"), ("check",)):
            refused(*verb, kind + ending, named=kind + ending)
        refused("convert", kind + ending, "out.yaml", named=kind + ending)
    for ending in (".yaml", ".py"):
        for verb in ("identify", "cestac", "report", "simulate"):
            refused(verb, kind + ending, "study.yaml", "-o", "out", named=kind)
        refused("excite", kind + ending, "-o", "out", named=kind)


@pytest.mark.parametrize("kind", ["pipe", "folder", "empty", "binary", "loop", "missing"])
@some(3)
def test_what_is_no_record(kind):
    for ending in RECORD_ENDINGS:
        refused("identify", "model.py", kind + ending, "-o", "out", named=kind + ending)
    for verb in ("cestac", "report", "simulate"):
        refused(verb, "model.py", kind + ".yaml", "-o", "out", named=kind + ".yaml")
    refused("identify", "model.py", "record.csv", kind + ".csv", named=kind + ".csv")
    refused("excite", "model.py", kind + ".csv", "-o", "out", named=kind + ".csv")
    for ending in ("", ".csv", ".json"):
        refused("convert", "emps", "out.urdf", "--values", kind + ending, named=kind + ending)
        refused("convert", "emps", "out.urdf", "--estimate", kind + ending, named=kind + ending)


@pytest.mark.parametrize("name", STRANGE, ids=ascii)
@some(5)
def test_names(name):
    """A name may hold what a terminal obeys: it is spelled out, on one line."""
    named = (
        "" if len(name) > 200 or "\udce9" in name else spelled(name).rpartition("\\x202e")[2]
    )  # which is also spelled \u202e
    for verb in ("show", "generate", "check"):
        refused(verb, "--", name, named=named)
    refused("convert", "--", name, "out.yaml", named=named)
    refused("identify", "--", name, "record.csv", named=named)
    refused("identify", "--", "model.py", name, named=named)
    refused("report", "-o", "out", "--", "model.py", name, named=named)


@pytest.mark.parametrize("target", ["taken", "pipe", "taken/below"])
def test_results_replace_no_file_by_a_folder(target):
    for command in (
        ("generate", "emps"), ("identify", "model.py", "record.csv"), ("cestac", "model.py", "record.csv", "--delta", "0.001"),
        ("report", "model.py", "record.csv"), ("excite", "model.py"), ("simulate", "model.py", "study.yaml"), ("demo", "--quick"),
    ):  # fmt: skip
        refused(*command, "-o", target, named=target)


@pytest.mark.parametrize("target", ["pipe", "folder", "folder.yaml", "pipe.yaml"])
def test_results_replace_no_pipe_and_no_folder(target):
    """Nor a device: a command run by root would put a file in place of /dev/null."""
    refused("show", "emps", "--html", "-o", target, named=target)
    refused("new", target, named=target)
    refused("convert", "emps", target, "--force", named=target)


@pytest.mark.parametrize(
    "arguments",
    [
        ("cestac", "--delta", "9**9**9**9"), ("cestac", "--delta", "__import__('os')"), ("cestac", "--delta", "1/0"), ("cestac", "--delta", "nan"),
        ("cestac", "--delta", "-1"), ("cestac", "--delta", "(" * 3000), ("cestac", "--torque", "1e999"), ("cestac", "--rounding", "\x1b[2J"),
        ("cestac", "--columns", "XX1,\x1b[2J"), ("cestac", "--delta", "0.001", "--runs", "-5"), ("cestac", "--delta", "0.001", "--seed", "-1"),
        ("report", "--encoder", "\x1b[2J"), ("excite", "--criterion", "\x1b[2J"), ("excite", "--rate", "nan"),
        ("excite", "--columns", "\x1b[2J"), ("cestac", "--delta", "1e-400"), ("cestac", "--side", "\n"),
    ],
    ids=ascii,
)  # fmt: skip
def test_values_of_options(arguments):
    verb, *options = arguments
    refused(
        verb, "model.py", "record.csv", *options, *(("-o", "out") if verb != "identify" else ())
    )


@pytest.mark.parametrize(
    "arguments",
    [("identify", "model.py", "record.csv", "--block", "\x1b[2J"), ("convert", "emps", "a.yaml", "--constant", "1e999"), ("\x1b[2J",), ("show", "--\x1b[2J"), ("demo", "\x1b[2J")],
    ids=ascii,
)  # fmt: skip
def test_usage(arguments):
    code, said = answered(*arguments)
    assert code == 2 and said.replace("\n", "").isprintable()


ELSEWHERE = (
    "checkpoint",
    "settings",
    "parquet",
)  # folders of runs, processes of their own: tests/fuzz reads them


@pytest.mark.parametrize(
    "path",
    sampled(sorted(p for p in CORPUS.glob("*/*") if p.parent.name not in ELSEWHERE), 12),
    ids=lambda path: f"{path.parent.name}/{path.name}",
)
@some(5)
def test_corpus(path, tmp_path):
    """What once failed when it was read, by the verb that reads it; some of it is sound and only
    strange.
    """
    from fuzz.formats import FORMATS

    file = tmp_path / f"case.{FORMATS[path.parent.name].ending}"
    file.write_bytes(path.read_bytes())
    match path.parent.name:
        case "robot" | "expression" | "derived" | "par" | "urdf" | "mjcf":
            command = ("show", file)
        case "model":
            command = ("identify", file, "record.csv")
        case "study" | "motion":
            command = ("simulate", "model.py", file)
        case "estimate":
            command = ("convert", "emps", "out.urdf", "--estimate", file)
        case _:
            command = ("identify", "model.py", file)
    if FORMATS[path.parent.name].foreign:  # a library may end the process: docs/many_runs.md
        ended = symgen(*map(str, command))
        code, said = ended.returncode, ended.stderr.decode()
        if code < 0:
            return
    else:
        code, said = answered(*command)
    refuted = (
        code == 1 and "use --at-values" in said
    )  # a valid file, at whose constants the generic formulas do not hold
    assert code == 0 or refuted or (code == 2 and said[:-1].isprintable()), said


def symgen(*arguments, **settings):
    """A process of its own, as a shell starts it."""
    return subprocess.run(
        [sys.executable, "-c", "from symgen.cli.main import main; main()", *arguments],
        capture_output=True,
        timeout=HANG,
        check=False,
        **settings,
    )


def test_names_that_are_no_text():
    """Bytes that are no UTF-8 in an argument, and characters that the output cannot show."""
    ended = symgen("show", b"caf\xe9.yaml")
    assert (
        ended.returncode == 2
        and ended.stderr.startswith(b"error: no file caf\\")
        and ended.stderr.count(b"\n") == 1
    )
    ended = symgen(
        "convert", "emps", b"caf\xe9.yaml", env={**os.environ, "PYTHONIOENCODING": "ascii"}
    )
    assert (ended.returncode, ended.stderr) == (0, b"") and b"caf" in ended.stdout
    Path("caf\udce9.yaml").unlink()


def test_pipes_are_not_waited_for():
    ended = symgen("identify", "model.py", "pipe.csv")
    assert (ended.returncode, ended.stderr.count(b"\n")) == (2, 1) and b"pipe.csv" in ended.stderr
