"""Results in a folder: killed before every act on the file system, two commands at once, full
disks.
"""

import os
import resource
import signal
import subprocess
import sys

import pytest
from hang import HANG

from runtime.reporting.result_files import FINISHED, UNFINISHED, OutputError, results_in, write_all

NAMES = ("a.txt", "b.txt", "c.txt")
OLD, NEW = dict.fromkeys(NAMES, "old"), dict.fromkeys(NAMES, "new")
ACTS = ("open", "os.mkdir", "os.rename", "os.remove", "os.rmdir")


def forked(work):
    """Exit status of a child process that does `work`."""
    child = os.fork()
    if child == 0:
        try:
            work()
        finally:
            os._exit(0)
    return os.waitpid(child, 0)[1]


def texts(folder):
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}


def killed_before(act, folder):
    """A run that is killed before its act number `act`; False where it ended before."""

    def work():
        left = [act]

        def count(event, arguments):
            if event in ACTS:
                left[0] -= 1
                if left[0] < 0:
                    os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(count)
        write_all(folder, NEW)
        left[0] = 10**9

    return os.WIFSIGNALED(forked(work))


def test_killed_before_every_act(tmp_path):
    """Old or new, never a mixture that nobody completes; the next command leaves nothing of it."""
    act, seen = 0, set()
    while True:
        folder = tmp_path / str(act)
        write_all(folder, OLD)
        (folder / "notes.txt").write_text("of the user")
        if not killed_before(act, folder):
            break
        found = texts(folder)
        assert found.pop("notes.txt") == "of the user" and set(found) == set(NAMES)
        if (folder / FINISHED).is_dir():
            assert {**found, **texts(folder / FINISHED)} == NEW
            seen.add("to complete")
        else:
            assert found in (OLD, NEW)
            seen.add(found["a.txt"])
        write_all(folder, {"d.txt": "another"})
        assert texts(folder) in (
            {**state, "d.txt": "another", "notes.txt": "of the user"} for state in (OLD, NEW)
        )
        assert not [
            path for path in folder.iterdir() if path.name.startswith((UNFINISHED, FINISHED))
        ]
        act += 1
    assert seen == {"old", "to complete"} and act > 8  # the last act empties FINISHED
    assert texts(folder) == {**NEW, "notes.txt": "of the user"}


def test_two_at_once_do_not_mix(tmp_path):
    """Each writes its set or says that it did not."""

    def work(name):
        for k in range(40):
            try:
                write_all(tmp_path, dict.fromkeys(NAMES, f"{name}{k}"))
            except OutputError as e:
                assert "\n" not in str(e)

    children = []
    for name in "xy":
        child = os.fork()
        if child == 0:
            try:
                work(name)
            except BaseException:
                os._exit(1)
            os._exit(0)
        children.append(child)
    assert [os.waitpid(child, 0)[1] for child in children] == [0, 0]
    write_all(tmp_path, {})
    assert len(set(texts(tmp_path).values())) == 1 and sorted(
        p.name for p in tmp_path.iterdir()
    ) == list(NAMES)


@pytest.mark.parametrize("name", ["a.txt", FINISHED])
def test_links_and_pipes_at_its_names_are_refused(name, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "mine.txt").write_text("mine")
    for make in (os.mkfifo, lambda path: path.symlink_to(tmp_path / "elsewhere")):
        make(tmp_path / name)
        with pytest.raises(OutputError, match=r"a link|a pipe|a folder of its own"):
            write_all(tmp_path, NEW)
        (tmp_path / name).unlink()
    assert [path.name for path in tmp_path.iterdir()] == ["elsewhere"]
    assert (tmp_path / "elsewhere" / "mine.txt").read_text() == "mine"


def test_a_limit_of_file_sizes_leaves_the_old_files(tmp_path):
    write_all(tmp_path, OLD)

    def work():
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
        try:
            write_all(tmp_path, {**NEW, "b.txt": "x" * 5000})
        except OutputError as e:
            os._exit(7 if "nothing was changed" in str(e) else 8)

    assert os.waitstatus_to_exitcode(forked(work)) == 7
    assert texts(tmp_path) == OLD and sorted(p.name for p in tmp_path.iterdir()) == list(NAMES)


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("file/out", "a file is where a folder"),
        ("file", "a file is where a folder"),
        ("x" * 300, "shorter name"),
    ],
)
def test_places_that_cannot_be_written(place, words, tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OutputError, match=words):
        write_all(tmp_path / place, NEW)
    assert (tmp_path / "file").read_text() == "mine" and len(list(tmp_path.iterdir())) == 1


def test_nothing_written_leaves_no_folder(tmp_path):
    with pytest.raises(KeyError), results_in(tmp_path / "new folder" / "größe"):
        raise KeyError
    assert list(tmp_path.iterdir()) == []


LONG = {  # whose results take long: arguments before the folder
    "identify": ["planar_2r", "run.csv"],
    "cestac": ["planar_2r", "run.csv"],
    "report": ["planar_2r", "run.csv"],
    "excite": ["planar_2r"],
    "simulate": ["emps", "loop.yaml"],
    "demo": [],
}


def test_long_commands_learn_at_once_that_they_cannot_write(tmp_path):
    """One line, exit code 2, before what computes is even loaded."""
    (tmp_path / "file").write_text("mine")
    code = f"""
import sys
from typer.testing import CliRunner
from symgen.cli.main import app
for verb, arguments in {LONG}.items():
    done = CliRunner().invoke(app, [verb, *arguments, "-o", "file"])
    assert done.exit_code == 2 and done.stderr.startswith("error: file: cannot be written: File exists") and done.stderr.count("\\n") == 1, done.output
print(*sys.modules)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert not {name.partition(".")[0] for name in done.stdout.split()} & {
        "numpy",
        "scipy",
        "casadi",
        "matplotlib",
    }
    assert [path.name for path in tmp_path.iterdir()] == ["file"] and (
        tmp_path / "file"
    ).read_text() == "mine"


@pytest.mark.parametrize("kind", ["link", "pipe"])
@pytest.mark.parametrize("name", [FINISHED, f"{UNFINISHED}x"])
def test_names_of_our_own_that_are_links_or_pipes(tmp_path, kind, name):
    """Nothing of another folder moves, and nothing hangs."""
    other = tmp_path / "other"
    other.mkdir()
    (other / "theirs.txt").write_text("theirs")
    folder = tmp_path / "results"
    folder.mkdir()
    place = folder / name
    place.symlink_to(other) if kind == "link" else os.mkfifo(place)
    if name == FINISHED:
        with pytest.raises(OutputError, match="a folder of its own; remove or rename this file"):
            write_all(folder, NEW)
    else:
        write_all(folder, NEW)
    assert texts(other) == {"theirs.txt": "theirs"}
    assert not (folder / "theirs.txt").exists()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_command_that_is_ended_leaves_nothing(tmp_path, number):
    """Also where the tests run in the background of a shell, whose children ignore SIGINT."""
    script = """
import signal, sys, time
from pathlib import Path
from symgen.cli import main as command, session

signal.signal(signal.SIGINT, signal.default_int_handler)

def wait():
    with session.results_in(Path(sys.argv[1])):
        print("ready", flush=True)
        time.sleep(3600)

command.app = wait
command.main()
"""
    folder = tmp_path / "results"
    child = subprocess.Popen(
        [sys.executable, "-c", script, str(folder)], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert child.stdout.readline() == b"ready\n" and folder.is_dir()
    child.send_signal(number)
    child.communicate(timeout=HANG)
    assert child.returncode != 0 and not folder.exists()


@pytest.mark.parametrize("mode", [0o600, 0o664, 0o755])
def test_a_file_that_is_replaced_keeps_its_mode_and_owner(tmp_path, mode):
    write_all(tmp_path, OLD)
    (tmp_path / "a.txt").chmod(mode)
    owner = (tmp_path / "a.txt").stat().st_uid
    write_all(tmp_path, NEW)
    found = (tmp_path / "a.txt").stat()
    assert (found.st_mode & 0o777, found.st_uid) == (mode, owner)
    assert (tmp_path / "a.txt").read_text() == "new"
