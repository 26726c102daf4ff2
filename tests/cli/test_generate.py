"""`symgen generate`: modules are current, deterministic, and written whole or not at all."""

import os
import re
import subprocess
import sys
from fnmatch import fnmatch
from importlib.resources import files
from itertools import combinations
from pathlib import Path

import pytest
from campaign import campaign, some
from typer.testing import CliRunner

from runtime.reporting.result_files import write_all
from symgen.certify.importing import without_certificate
from symgen.cli.generate import emitted
from symgen.cli.main import app
from symgen.description import packaged_robots, skeleton
from symgen.emit.targets import TARGETS
from symgen.version import VERSION

GENERATED = Path(__file__).resolve().parents[2] / "generated"


def run(*arguments):
    return CliRunner().invoke(app, ["generate", *map(str, arguments)])


@pytest.mark.parametrize("name", packaged_robots())
@some(4)
def test_checked_in_modules_are_current(name):
    """Golden text: the bytes of generated/."""
    result = run(name, "--check", "-o", GENERATED)
    assert result.exit_code == 0, result.output


def test_nothing_else_is_checked_in():
    assert {p.stem for p in GENERATED.glob("*.py")} == {*packaged_robots()}


@campaign
def test_same_bytes_whatever_the_hash_seed():
    code = "import hashlib, sys\nfrom symgen.cli.generate import emitted\n"
    code += "for name, text in emitted(['haptic', 'two_branch'], ('numpy', 'c')).items():\n"
    code += "    print(name, hashlib.sha256(text.encode()).hexdigest())"
    seen = {
        subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            check=True,
            env={**os.environ, "PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "77")
    }
    # a module, C and its header, each of two robots
    assert len(seen) == 1 and seen.pop().count(b"\n") == 6


def test_own_robot_from_any_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.yaml").write_text(skeleton("arm"))
    result = run("arm.yaml", "-o", "deep/models")
    assert result.exit_code == 0 and result.stdout.strip() == str(Path("deep/models/arm.py"))
    code = (
        "import sys, numpy as np\nsys.path.insert(0, 'deep/models')\nimport arm\nx = "
        "np.zeros((5, 2))\nprint(arm.regressor(x, x, x).shape)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "(5, 2, 13)"
    assert [p.name for p in (tmp_path / "deep" / "models").iterdir() if p.suffix == ".py"] == [
        "arm.py"
    ]
    assert str(tmp_path) not in (tmp_path / "deep" / "models" / "arm.py").read_text()


MJCF = """<mujoco model="arm"><worldbody><body name="link"><joint name="hinge" axis="0 0 1"/>
<inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("file", ["arm.YAML", "arm.Yml", "arm.xml", "arm.MJCF"])
@some(2)
def test_no_folder_of_this_machine_in_emitted_files(tmp_path, file):
    """Suffixes in capitals and MJCF: the command of the header once held the whole path."""
    (tmp_path / file).write_text(
        MJCF if file.lower().endswith(("xml", "mjcf")) else skeleton("arm")
    )
    result = run(tmp_path / file, "-o", tmp_path / "out", "--target", "numpy,casadi,c,xp")
    assert result.exit_code == 0, result.output
    for path in (tmp_path / "out").iterdir():
        assert (
            str(tmp_path) not in path.read_text() and f"symgen generate {file}" in path.read_text()
        )


@pytest.mark.parametrize(
    "targets",
    [(name,) for name in TARGETS] + [*combinations(TARGETS, 2)],
    ids=",".join,
)
def test_each_target_alone_and_each_pair(targets, tmp_path):
    result = run("emps", "--target", ",".join(targets), "-o", tmp_path)
    assert result.exit_code == 0, result.output
    kinds = {*targets, *["h"] * ("c" in targets)}
    patterns = [TARGETS[name].file.format("emps", "*") for name in kinds]
    found = [path.name for path in tmp_path.iterdir()]
    assert len(found) == sum(10 if pattern == "emps_*.m" else 1 for pattern in {*patterns})
    assert all(any(fnmatch(file, pattern) for pattern in patterns) for file in found)
    said = result.stderr.splitlines()
    assert len(said) == sum(bool(TARGETS[name].use) for name in targets)
    assert all("emps" in line and "{" not in line for line in said)


def test_default_folder_is_generated(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("emps").exit_code == 0
    new, kept = ((folder / "emps.py").read_text() for folder in (tmp_path / "generated", GENERATED))
    assert without_certificate(new) == without_certificate(kept)


def test_check_shows_what_changed_and_writes_nothing(tmp_path):
    (tmp_path / "emps.py").write_text(
        (GENERATED / "emps.py").read_text().replace("NAME = 'emps'", "NAME = 'old'")
    )
    before = (tmp_path / "emps.py").read_bytes()
    result = run("emps", "planar_2r", "--check", "-o", tmp_path)
    assert result.exit_code == 1
    assert "-NAME = 'old'" in result.stdout and "+NAME = 'emps'" in result.stdout
    assert "not current" in result.stderr and "planar_2r.py" in result.stderr
    assert (tmp_path / "emps.py").read_bytes() == before and len(list(tmp_path.iterdir())) == 1


END = "sha256 of all but these lines: " + 64 * "0"
FOREIGN = {
    "coding cookie": lambda text: (
        f"# Certificate by symgen {VERSION} coding: raw_unicode_escape \\u000aprint('foreign')\\u000a#\n"
        f"# {END}\n{without_certificate(text)}"
    ),
    "comment that closes": lambda text: (
        f"/* Certificate by symgen {VERSION} */ int foreign = 1;\n/* {END}\n{without_certificate(text)}"
    ),
    "word in a certificate": lambda text: text.replace(
        f"{VERSION}: formulas", f"{VERSION}: foreign", 1
    ),
    "one more line": lambda text: text.replace("sha256 of all", "foreign\nsha256 of all", 1),
    "another digest": lambda text: re.sub(r"(these lines: )\w{64}", rf"\g<1>{64 * '0'}", text),
    "no certificate": without_certificate,
    "carriage return": lambda text: text.replace("formulas exact", "\rformulas exact", 1),
    "byte order mark": lambda text: "\ufeff" + text,
    "no UTF-8": lambda text: text.replace("formulas exact", "formulas \udcff exact", 1),
}


@pytest.mark.parametrize("name", FOREIGN)
@pytest.mark.parametrize("target", ["numpy", "c", "matlab"])
@some(8)
def test_foreign_text_in_a_certificate_is_not_current(target, name, tmp_path):
    """A coding cookie and a comment that closes make code of a comment."""
    path = tmp_path / TARGETS[target].file.format("emps", "regressor")
    assert run("emps", "--target", target, "-o", tmp_path).exit_code == 0
    text = path.read_bytes().decode("utf-8")
    foreign = FOREIGN[name](text)
    assert foreign != text
    path.write_bytes(foreign.encode("utf-8", "surrogateescape"))
    result = run("emps", "--target", target, "--check", "-o", tmp_path)
    assert result.exit_code == 1, result.output
    assert f"not current: {path};" in result.stderr


def test_ends_of_lines_of_windows_are_current(tmp_path):
    assert run("emps", "-o", tmp_path).exit_code == 0
    path = tmp_path / "emps.py"
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert run("emps", "--check", "-o", tmp_path).exit_code == 0


def test_one_bad_robot_and_nothing_is_written(tmp_path):
    bad = tmp_path / "bad.yaml"
    bad.write_text(
        skeleton("bad").replace("sigma: 0, alpha: 0, d: D2", "sigma: 3, alpha: 0, d: D2")
    )
    out = tmp_path / "out"
    result = run("emps", bad, "-o", out)
    assert result.exit_code == 2 and not out.exists()
    assert (
        "sigma = 3" in result.stderr
        and "line" in result.stderr
        and "Traceback" not in result.output
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["no_such_robot"], "no_such_robot"),
        (["missing.yaml"], "missing.yaml"),
        (["emps", "--target", "fortran"], "fortran"),
        (["emps", "emps"], "two robots have the name emps"),
        ([], "ROBOT"),
    ],
)
def test_bad_input_is_exit_2(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(*arguments)
    assert result.exit_code == 2 and words in result.output and "Traceback" not in result.output
    assert list(tmp_path.iterdir()) == []


def test_output_that_is_a_file(tmp_path):
    (tmp_path / "taken").write_text("mine")
    result = run("emps", "-o", tmp_path / "taken")
    assert (
        result.exit_code == 2
        and "taken" in result.stderr
        and (tmp_path / "taken").read_text() == "mine"
    )


@pytest.mark.parametrize(
    "failure", [OSError(28, "No space left on device", "emps.py"), KeyboardInterrupt()]
)
def test_interrupted_writing_leaves_the_folder_as_it_was(failure, tmp_path, monkeypatch):
    (tmp_path / "emps.py").write_text("old")
    written = []

    def full(descriptor):
        written.append(descriptor)
        if len(written) == 2:
            raise failure

    monkeypatch.setattr(os, "fsync", full)
    result = run("emps", "planar_2r", "-o", tmp_path)
    assert result.exit_code in (1, 2, 130) and "Traceback" not in result.output
    if isinstance(failure, OSError):
        assert result.exit_code == 2 and "No space left on device" in result.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["emps.py"] and (
        tmp_path / "emps.py"
    ).read_text() == "old"


def test_write_all_replaces_whole_files(tmp_path):
    write_all(tmp_path, {"a.txt": "old", "b.txt": b"old"})
    assert write_all(tmp_path, {"a.txt": "new"}) == [tmp_path / "a.txt"]
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a.txt": "new", "b.txt": "old"}


def test_command_in_the_header_names_no_folder(tmp_path):
    path = tmp_path / "arm.yaml"
    path.write_text(skeleton("arm"))
    text = emitted([str(path)])["arm.py"]
    assert "symgen generate arm.yaml" in text and str(tmp_path) not in text


def test_c_without_values_says_so(tmp_path):
    """A robot file without friction values has no X: the C file lacks the array, and says why."""
    text = (files("symgen") / "description/robots/planar_2r.yaml").read_text(encoding="utf-8")
    assert "FV2:" in text
    (tmp_path / "arm.yaml").write_text(re.sub(r", FV2: [-+.\de]+|FV2: [-+.\de]+, ", "", text))
    assert "FV2:" not in (tmp_path / "arm.yaml").read_text()
    for source, missing in ((tmp_path / "arm.yaml", True), ("planar_2r", False)):
        result = run(source, "--target", "c", "-o", tmp_path)
        assert result.exit_code == 0, result.output
        assert (
            "no planar_2r_values, because the robot file has no value of FV2;" in result.stderr
        ) == missing
        assert ("planar_2r_values[" in (tmp_path / "planar_2r.c").read_text()) != missing
