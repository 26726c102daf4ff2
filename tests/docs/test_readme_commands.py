"""Every command line of README that is no block of commands runs: its lines for a URDF and a log, the
rows of its tables, and the commands in its sentences.

Robot, log and study are those of `docs/examples/01_urdf_and_csv.py` and of README's study file. What
does not run here stands in LEFT, with the reason; `test_blocks` runs the blocks of commands.
"""

from __future__ import annotations

import re
import runpy
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaign import campaign
from typer.testing import CliRunner

import symgen
from runtime.study import study_from_text
from symgen.cli.main import app

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLE = (ROOT / "docs" / "examples" / "01_urdf_and_csv.py").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```(?P<kind>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
LEFT = {
    "symgen demo": "needs the record tx40 of `symgen datasets`, or none; `.ci/run` runs both",
    "symgen studio": "a server; tests/studio runs it",
    "symgen identify": "names the verb",
    "symgen check": "names the verb",
    "symgen generate": "names the verb",
    "python docs/examples/chapter/haptic.py": "test_haptic_interface runs its quick form",
}
ENCODERS = "symgen cestac tx40 tx40 --delta 2*pi/20000"
SLOW = (
    ENCODERS,
    "symgen cestac arm.urdf run.csv --advise",
    "symgen excite arm.urdf run.csv -o motion",
)
WRITTEN = {  # what the lines say that they write
    "symgen show arm.urdf --html": ("arm.html",),
    "symgen excite arm.urdf run.csv -o motion": (
        "motion/trajectory.csv",
        "motion/joint_trajectory.yaml",
    ),
}


def block(kind: str, word: str) -> str:
    """The one block of this kind with this word."""
    (found,) = (
        m["text"] for m in BLOCK.finditer(README) if m["kind"] == kind and word in m["text"]
    )
    return found


FIRST = [
    line.partition("#")[0].strip() for line in block("text", "symgen identify arm").splitlines()
]
INLINE = list(dict.fromkeys(re.findall(r"`((?:symgen|python) [^`]+)`", BLOCK.sub("", README))))


def run(line: str, code: int = 0) -> str:
    done = CliRunner().invoke(app, shlex.split(line)[1:])
    assert done.exit_code == code, f"{line}\n{done.output}"
    return done.output


def python(text: str, **names: object) -> dict[str, Any]:
    """The names that a text leaves."""
    Path("text.py").write_text(text, encoding="utf-8")
    return runpy.run_path("text.py", init_globals=names)


def table(name: str, columns: str, *values: np.ndarray) -> None:
    np.savetxt(name, np.column_stack(values), delimiter=",", header=columns, comments="")


@pytest.fixture
def arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """arm.urdf and run.csv of the example, and its arrays."""
    monkeypatch.chdir(tmp_path)
    return python(EXAMPLE.partition("result = ")[0])


def study_of_readme(arm: dict[str, Any]) -> str:
    """README's study file, and log.csv in the columns and units that it names."""
    text = block("yaml", "# study.yaml")
    (record,) = study_from_text(text, file="README.md").record
    assert record.torque_constant is not None
    current = 1e3 * arm["tau"] / np.array(record.torque_constant)
    table(
        "log.csv", "time_ms,pos_1,pos_2,cur_1,cur_2", 1e3 * arm["t"], np.degrees(arm["q"]), current
    )
    return text


def study_on_a_ship(arm: dict[str, Any]) -> str:
    """The same arm on a deck that turns about three axes and heaves."""
    q, qd, qdd, t = (arm[name] for name in ("q", "qd", "qdd", "t"))
    w, phase = np.array([1.7, 1.1, 2.3]), np.array([0, 1, 2])
    angle = w * t[:, None] + phase
    heave = np.column_stack([np.sin(1.3 * t), np.cos(2.9 * t), 9.81 + np.sin(2.1 * t)])
    base = np.hstack([0.5 * np.sin(angle), 0.5 * w * np.cos(angle), heave])
    model = symgen.model("arm.urdf", base="moving")
    X = model.base_parameters(dict(model.VALUES) | arm["friction"])
    tau = model.inverse_dynamics(base, q, qd, qdd, X)
    noise = np.random.default_rng(0).normal(0, 0.2, tau.shape)
    motion = [f"b{k}" for k in range(9)]
    table("ship.csv", "t,q1,q2,tau1,tau2," + ",".join(motion), t, q, tau + noise, base)
    return (
        "symgen: 1\nrecord:\n  files: [ship.csv]\n"
        "  columns: {t: t, q: [q1, q2], tau: [tau1, tau2]}\n"
        f"  base: {{motion: [{', '.join(motion)}]}}\n"
    )


def one_joint(arm: dict[str, Any]) -> None:
    """The elbow is fixed, 10 s: an exciting motion of one joint takes a quarter of the time."""
    path = Path("arm.urdf")
    path.write_text(path.read_text().replace("'elbow' type='revolute'", "'elbow' type='fixed'"))
    model, rows = symgen.model("arm.urdf"), slice(2500)
    q, qd, qdd = (arm[name][rows, :1] for name in ("q", "qd", "qdd"))
    X = model.base_parameters(dict(model.VALUES) | {"FV1": 2.0, "FS1": 1.5})
    noise = np.random.default_rng(0).normal(0, 0.2, q.shape)
    table("run.csv", "t,q1,tau1", arm["t"][rows], q, model.inverse_dynamics(q, qd, qdd, X) + noise)


def test_lines_of_a_urdf_and_a_log(arm: dict[str, Any]) -> None:
    """In their order; between the suggested study and the next line the reader corrects it."""
    study = study_of_readme(arm)
    for line in FIRST:
        told = run(line)
        if "--suggest" in line:
            suggested = Path("study.yaml").read_text(encoding="utf-8")
            assert "# ?" in suggested and "# ?" in told
            columns = study_from_text(study, file="README.md").record[0].columns
            for name in (columns.t, *columns.q, *columns.tau):
                assert name in suggested
            Path("study.yaml").write_text(study, encoding="utf-8")
    assert len(FIRST) >= 5 and all(line.startswith("symgen ") for line in FIRST)
    assert all(Path(name).exists() for name in ("results", "identified.urdf"))
    M, MX = (symgen.model("identified.urdf").VALUES[name] for name in ("M2", "MX2"))
    assert symgen.model("arm.urdf").VALUES["MX2"] == pytest.approx(0.3) and M > 0
    assert abs(MX - 0.42) < 0.01  # the simulated arm


def test_the_same_in_python(arm: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    text = block("text", "import runtime, symgen")
    names = python(text, **{name: arm[name] for name in ("t", "q", "tau")})
    (name,) = re.findall(r'model\.FORMULAS\["(\w+)"\]', text)
    assert "ZZ1" in names["model"].FORMULAS[name]
    assert capsys.readouterr().out.startswith("The model of arm with 13 of 13 parameters")
    estimate, k = names["result"].estimate, names["model"].BASE_PARAMETERS.index("MX2")
    assert abs(estimate.X[k] - 0.42) < 4 * estimate.sigma_corrected[k] < 0.02


@pytest.mark.parametrize(
    "line",
    [pytest.param(x, marks=campaign) if x in SLOW else x for x in INLINE if x not in LEFT],
)
def test_line_of_a_table_or_sentence_runs(
    line: str, arm: dict[str, Any], request: pytest.FixtureRequest
) -> None:
    if line == ENCODERS:
        request.getfixturevalue("tx40_data")
    if "study.yaml" in line:
        study = study_on_a_ship(arm) if "--base moving" in line else study_of_readme(arm)
        Path("study.yaml").write_text(study, encoding="utf-8")
    if line.startswith("symgen excite"):
        one_joint(arm)
    told = run(line, code=1 if line == ENCODERS else 0)  # 1: a bias
    assert told
    assert not told.startswith("No")
    if line == ENCODERS:  # README quotes its answers, for all parameters and for some
        (quoted,) = re.findall(r"`(Least squares is biased [^`]+)`", README)
        (columns,) = re.findall(r"`(--columns [^`]+)`", README)
        assert quoted in told
        assert "Least squares is practically unbiased" in run(f"{line} {columns}")
    for name in WRITTEN.get(line, ()):
        assert Path(name).is_file(), name


def test_no_line_is_left_out_silently() -> None:
    """LEFT, SLOW and WRITTEN name lines that README has; each row of the table of commands has one."""
    assert {*LEFT, *SLOW, *WRITTEN} <= {*INLINE}
    rows = README.partition("| I want to |")[2].partition("\n\n")[0].splitlines()[2:]
    assert len(rows) >= 6
    for row in rows:
        assert re.search(r"`(symgen [^`]+)`", row.split("|")[2])
