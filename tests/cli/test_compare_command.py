"""`symgen compare`: studies of the same records by what they predict, in one call; what cannot
be compared is told in one sentence.
"""

import json

import kr300
import numpy as np
import pytest
from campaign import campaign
from typer.testing import CliRunner

import symgen
from runtime.reading.records import read_records
from runtime.study import study_from_mapping
from symgen.cli.main import app

RATE = 100
KNOWN = ["balance", 0]


def run(*arguments):
    return CliRunner().invoke(app, ["compare", *map(str, arguments)])


def study(folder, name, record="a", validate="b", known=KNOWN, **sections):
    """A study file of the planar arm; the torque of a spring on joint 1 stands in the column
    `balance`.
    """
    own = {
        "columns": {
            "t": "t",
            "q": ["q1", "q2"],
            "tau": ["tau1", "tau2"],
            **({"tau_known": known} if known else {}),
        }
    }
    mapping = {
        "record": {"files": [f"{record}.csv"], **own},
        "signals": {"lowpass": {"cutoff": 20}, "median": 1},
        **sections,
    }
    mapping |= {"validate": {"record": {"files": [f"{validate}.csv"], **own}}} if validate else {}
    (folder / f"{name}.yaml").write_text(json.dumps(mapping))
    return folder / f"{name}.yaml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two records of the planar arm, both standing for a third of the time, with dry friction and a
    spring that no model knows.
    """
    folder, model = tmp_path_factory.mktemp("records"), symgen.model("planar_2r")
    X = model.base_parameters(model.VALUES)
    rng = np.random.default_rng(0)
    for name, w in (("a", [2.1, 5.3, 9.7]), ("b", [1.7, 4.1, 8.3])):
        t = np.arange(0, 8, 1 / RATE)
        s = np.interp(
            t, [0, 2, 3, 5, 6, 8], [0, 2, 2, 4, 4, 6]
        )  # stands from 2 to 3 s and from 5 to 6 s
        s = np.convolve(
            np.pad(s, 20, mode="edge"), np.hanning(41) / np.hanning(41).sum(), mode="valid"
        )
        q = 0.5 * np.stack(
            [np.sin(np.outer(s, w) + phase).sum(axis=1) for phase in ([0.1, 1, 2], [0.7, 2, 0.4])],
            axis=1,
        )
        qd = np.gradient(q, t, axis=0)
        tau = model.inverse_dynamics(q, qd, np.gradient(qd, t, axis=0), X)
        standing = np.abs(qd) < 0.01
        tau += np.where(standing, rng.uniform(-3, 3, q.shape), 0) + rng.normal(
            0, 0.02, q.shape
        )  # friction holds anything there
        spring = 20 * np.tanh(2 * q[:, 0])
        table = np.column_stack([t, q, tau[:, 0] + spring, tau[:, 1], spring])
        np.savetxt(
            folder / f"{name}.csv",
            table,
            delimiter=",",
            header="t,q1,q2,tau1,tau2,balance",
            comments="",
            fmt="%.9g",
        )
    np.savetxt(
        folder / "zero.csv",
        table * [1, 1, 1, 0, 0, 0],
        delimiter=",",
        header="t,q1,q2,tau1,tau2,balance",
        comments="",
        fmt="%.9g",
    )
    np.savetxt(
        folder / "other.csv",
        table[:, :4],
        delimiter=",",
        header="t,q1,q2,tau1",
        comments="",
        fmt="%.9g",
    )
    np.savetxt(
        folder / "still.csv",
        table * [1, 1e-4, 1e-4, 1, 1, 1],
        delimiter=",",
        header="t,q1,q2,tau1,tau2,balance",
        comments="",
        fmt="%.9g",
    )
    return folder


def test_one_study_is_nothing_to_compare(folder):
    result = run("planar_2r", study(folder, "plain"))
    assert result.exit_code == 2 and "name two or more study files" in result.stderr


def test_several_studies_are_treatments_by_their_names(folder, tmp_path):
    """One whose rows are empty is named with its reason; the others are ordered, and the report is
    that of the best one.
    """
    known, ignored = (
        study(folder, "known", rows={"low_speed": 0.02}),
        study(folder, "ignored", known=None),
    )
    empty = study(folder, "empty", rows={"low_speed": 500})
    result = run("planar_2r", ignored, known, empty, "-o", tmp_path)
    assert result.stdout.splitlines()[1].startswith("known ") and result.stdout.splitlines()[
        2
    ].startswith("ignored ")
    assert (
        "\nempty: a.csv: none of the" in result.stdout
        and "rows.low_speed leaves out" in result.stdout
    )
    saved = json.loads((tmp_path / "comparison.json").read_text())
    assert [one["name"] for one in saved["treatments"]] == ["known", "ignored"]
    assert saved["verdict"].startswith("Predicts b best: known")
    assert "Treatments compared" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("validate", "message"),
    [
        (None, "plain has no validation record"),
        ("zero", "zero.csv: all torques are zero"),
        ("other", "other.csv"),
        ("still", "still.csv: none of the"),
    ],
)
def test_what_cannot_be_compared_is_one_sentence(folder, validate, message):
    files = [
        study(folder, name, validate=validate, rows={"low_speed": 0.02})
        for name in ("plain", "second")
    ]
    result = run("planar_2r", *files)
    assert result.exit_code == 2 and message in result.stderr and "Traceback" not in result.output
    assert len([line for line in result.stderr.splitlines() if line.startswith("error:")]) == 1


@campaign
@pytest.mark.skipif(not (kr300.DATA / "A.mat").is_file(), reason=f"no record in {kr300.DATA}")
def test_one_call_finds_the_best_of_the_measured_arm(tmp_path):
    """Careless, careful, with the counterbalance: the last, by its physical parameters, at most 7.4
    % of B by the README of the record.
    """
    (tmp_path / "kr300.yaml").write_text(kr300.robot_text())
    model = symgen.model(tmp_path / "kr300.yaml")
    files = []
    for name, careful, balanced in (
        ("careless", False, False),
        ("careful", True, False),
        ("balanced", True, True),
    ):
        mapping = kr300.study(careful=careful, validate="B")
        for record, own in zip(
            "AB", (mapping["record"], mapping["validate"]["record"]), strict=True
        ):
            if balanced:
                (whole,) = read_records(study_from_mapping({"record": own}).record, model)
                np.savetxt(
                    tmp_path / f"{record}.csv",
                    kr300.counterbalance(whole.q)[:, 1:2],
                    header="balance",
                    comments="",
                )
                own["files"] = [*own["files"], str(tmp_path / f"{record}.csv")]
                own["columns"] = {**own["columns"], "tau_known": [0, "balance", 0, 0, 0, 0]}
        files.append(tmp_path / f"{name}.yaml")
        files[-1].write_text(json.dumps(mapping))
    result = run(tmp_path / "kr300.yaml", *files, "--json")
    assert result.exit_code == 0, result.output
    first, second, third = json.loads(result.stdout)["treatments"]
    assert (first["name"], second["name"], third["name"]) == ("balanced", "careful", "careless")
    assert (
        first["columns"] == "feasible"
        and first["unseen_by_set"]["feasible"] <= 7.4
        and second["unseen_by_set"]["feasible"] <= 10.8
    )
    assert (second["state"], third["state"]) == (
        "no",
        "no",
    )  # without the counterbalance, a law lacks


def test_studies_of_a_base_that_moves(tmp_path):
    """--base as in identify: the file says fixed, the studies name the motion of the base."""
    model = symgen.model("planar_2r", base="moving")
    t = np.arange(0, 12, 1 / RATE)
    w, lines = np.array([1.7, 1.1, 2.3]), []
    for name, phase in (("a", 0.0), ("b", 2.0)):
        angle = w * t[:, None] + phase + np.array([0, 1, 2])
        heave = [np.sin(1.3 * t), np.cos(2.9 * t), 9.81 + np.sin(2.1 * t)]
        base = np.hstack([0.5 * np.sin(angle), 0.5 * w * np.cos(angle), np.column_stack(heave)])
        v = np.array([2.1, 3.7])
        q, qd, qdd = (f(v * t[:, None] + phase) for f in (np.sin, np.cos, np.sin))
        tau = model.inverse_dynamics(
            base, q, v * qd, -(v**2) * qdd, model.base_parameters(model.VALUES)
        )
        tau = tau + np.random.default_rng(1).normal(0, 0.05, tau.shape)
        head = "t,q1,q2,tau1,tau2," + ",".join(f"b{k}" for k in range(9))
        np.savetxt(
            tmp_path / f"{name}.csv",
            np.column_stack([t, q, tau, base]),
            delimiter=",",
            header=head,
            comments="",
        )
    own = {"base": {"motion": [f"b{k}" for k in range(9)]}}
    for cutoff in (5, 15):
        mapping = {
            "record": {"files": ["a.csv"], **own},
            "signals": {"lowpass": {"cutoff": cutoff}},
            "validate": {"record": {"files": ["b.csv"], **own}},
        }
        (tmp_path / f"c{cutoff}.yaml").write_text(json.dumps(mapping))
        lines.append(tmp_path / f"c{cutoff}.yaml")
    result = run("planar_2r", *lines, "--base", "moving")
    assert result.exit_code == 0, result.output
    assert "c15" in result.stdout and "c5" in result.stdout
    assert run("planar_2r", *lines).exit_code == 2
