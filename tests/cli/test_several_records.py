"""Several records fitted together: by the command line, by `also`, by a list; the same numbers each
way, and the error of each.
"""

import json

import numpy as np
import pytest
from campaign import campaign
from problems import linear_system
from typer.testing import CliRunner

from runtime import load_model
from runtime.compose import observe
from runtime.core.essential import essential_of
from runtime.core.validation import record_errors
from runtime.ground.errors import SettingsError
from runtime.reading.records import read_records
from runtime.study import study_from_mapping
from symgen.cli.main import app

RATE = 500
PARTS = ((0, 4), (5, 9), (10, 14))  # s


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three records of the planar arm, in degrees, the torques of the second scaled by 1.1."""
    folder = tmp_path_factory.mktemp("records")
    result = CliRunner().invoke(app, ["generate", "planar_2r", "-o", str(folder)])
    assert result.exit_code == 0, result.output
    model = load_model(folder / "planar_2r.py", trust=True)
    X = 1 + np.arange(len(model.BASE_PARAMETERS)) / 10
    rng = np.random.default_rng(0)
    for name, (a, b), wrong in zip("abc", PARTS, (1, 1.1, 1), strict=True):
        t = np.arange(a, b, 1 / RATE)
        w = np.array([2.1, 5.3, 9.7])
        phase = np.multiply.outer(t, w)[:, None] + np.array([[0.1, 1, 2], [0.7, 2, 0.4]])
        q, qd, qdd = (
            f(phase) @ (0.5 * w**k) for k, f in enumerate((np.sin, np.cos, lambda x: -np.sin(x)))
        )
        tau = wrong * model.inverse_dynamics(q, qd, qdd, X) + rng.normal(0, 0.05, q.shape)
        table = np.column_stack([t - a, np.degrees(q), tau])
        np.savetxt(
            folder / f"{name}.csv",
            table,
            delimiter=",",
            header="t,q1,q2,tau1,tau2",
            comments="",
            fmt="%.17g",
        )
    record = {"files": ["a.csv"], "units": {"q": "deg"}}
    lists = [{**record, "files": [f"{name}.csv"]} for name in "abc"]
    for name, content in (
        ("one", record),
        ("also", {**record, "also": ["b.csv", "c.csv"]}),
        ("list", lists),
    ):
        (folder / f"{name}.yaml").write_text(
            json.dumps({"record": content, "signals": {"lowpass": {"cutoff": 20}}})
        )
    return folder


def identified(*arguments):
    result = CliRunner().invoke(app, ["identify", "planar_2r", *map(str, arguments), "--json"])
    assert result.exit_code in (0, 1), result.output
    return json.loads(result.stdout)


@campaign
def test_every_way_gives_the_same_numbers(folder):
    by_line = identified(folder / "one.yaml", folder / "b.csv", folder / "c.csv")
    for study in ("also", "list"):
        found = identified(folder / f"{study}.yaml")
        assert (found["X"], found["by_record"]) == (by_line["X"], by_line["by_record"])
    assert by_line["provenance"]["records"] == ["a", "b", "c"] and set(
        by_line["provenance"]["files"]
    ) == {"a.csv", "b.csv", "c.csv"}
    assert "2000 samples, median step 0.002 s" in by_line["provenance"]["time"]["a"]
    assert sum(record["rows"] for record in by_line["by_record"]) == by_line["rows"]


@campaign
def test_the_record_that_does_not_fit_is_seen(folder, tmp_path):
    result = CliRunner().invoke(
        app,
        [
            "identify",
            "planar_2r",
            *(str(folder / x) for x in ("one.yaml", "b.csv", "c.csv")),
            "--verbose",
            "-o",
            str(tmp_path),
        ],
    )
    assert result.exit_code == 1, result.output
    a, b, c = (
        record["relative_error"]
        for record in json.loads((tmp_path / "estimate.json").read_text())["by_record"]
    )
    assert b > 1.3 * max(a, c)
    assert "error in b: " in result.output and "Time stamps of c: 2000 samples" in result.output
    assert "Relative error by record and joint" in (tmp_path / "report.html").read_text(
        encoding="utf-8"
    )
    again = identified(tmp_path / "study.yaml")
    assert [record["name"] for record in again["by_record"]] == ["a", "b", "c"]


def test_errors_of_records_add_up(folder):
    """Squares of the residuals of the records are that of all."""
    model = load_model(folder / "planar_2r.py", trust=True)
    record = {"files": ["a.csv"], "also": ["b.csv", "c.csv"], "units": {"q": "deg"}}
    study = study_from_mapping({"record": record})
    records = read_records(study.record, model, folder=folder)
    observation = observe(model, records, study)
    fit = essential_of(
        linear_system(observation, study.estimate), study.essential, model=model
    ).all_parameters
    parts = record_errors(observation, fit, [record.name for record in records])
    sizes = [np.linalg.norm(observation.of_record(k).Y) for k in range(3)]
    total = np.sqrt(
        sum(
            (part.relative_error / 100 * size) ** 2 for part, size in zip(parts, sizes, strict=True)
        )
    )
    assert total == pytest.approx(fit.residual_norm, rel=1e-10)


def test_cestac_takes_several(folder):
    arguments = [
        "cestac",
        "planar_2r",
        str(folder / "one.yaml"),
        str(folder / "c.csv"),
        "--runs",
        "2",
        "--delta",
        "1e-6",
        "--json",
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["provenance"]["records"] == ["a", "c"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("one.yaml", "also.yaml"), "every record after the first must be a measured file"),
        (("one.yaml", "nothing.csv"), "no such file"),
        (("a.csv", "planar"), "every record after the first must be a measured file"),
    ],
)
def test_refused(folder, arguments, said):
    result = CliRunner().invoke(
        app, ["identify", "planar_2r", *(str(folder / x) for x in arguments)]
    )
    assert result.exit_code == 2 and said in " ".join(result.output.split()).lower()


def test_pairs_of_files():
    given = {
        "files": ["q1.csv", "tau1.csv"],
        "also": [["q2.csv", "tau2.csv"], ["q3.csv", "tau3.csv"]],
        "name": "first",
        "side": "motor",
    }
    records = study_from_mapping({"record": given}).record
    assert [(r.files, r.name, r.side, r.also) for r in records] == [
        (("q1.csv", "tau1.csv"), "first", "motor", ()),
        (("q2.csv", "tau2.csv"), None, "motor", ()),
        (("q3.csv", "tau3.csv"), None, "motor", ()),
    ]
    with pytest.raises(
        SettingsError,
        match=r"record\[0\]\.also\[1\]: 1 files; expected 2|record\.also\[1\]: 1 files; expected 2",
    ):
        study_from_mapping({"record": {**given, "also": [["q2.csv", "tau2.csv"], "q3.csv"]}})
    for section in ("validate", "payload"):
        found = getattr(
            study_from_mapping({section: {"record": {"files": "a.csv", "also": ["b.csv"]}}}),
            section,
        )
        assert [r.files for r in found.record] == [("a.csv",), ("b.csv",)]
