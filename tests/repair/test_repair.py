"""Repair of a study: what is wrong is found, what is right stays, broken records are refused."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arms import RATE, arm, lines, recorded, written
from typer.testing import CliRunner

import runtime
import symgen
from runtime.compose import problem, records_of
from runtime.ground.settings import to_mapping
from runtime.mending import repair as mending
from runtime.mending.reading import Reading
from runtime.mending.search import Search, further
from runtime.plausible.plausibility import case_of
from runtime.study import load_study, located, study_from_mapping
from symgen.cli.main import app
from symgen.description.yaml import parse_robot

PENDULUM = """
symgen: 1
name: pendulum
gravity: [0, -9.81, 0]
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
elements: {FV: {kind: viscous, along: all}, FS: {kind: coulomb, along: all}}
"""
DATA = os.environ.get("SYMGEN_DATA") or Path(__file__).resolve().parents[3] / "shared" / "data"
CASES = Path(DATA).parent / "cases5"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any]:
    """Model and variants of the arm."""
    file = arm(tmp_path_factory.mktemp("arm"))
    return symgen.model(file), symgen.variants(file)


def repaired(made: tuple[Any, Any], t: Any, q: Any, tau: Any, **sections: Any) -> Any:
    model, variants = made
    record = runtime.Record(t, q, tau)
    return runtime.repair(model, record, study_from_mapping(sections), variants=variants)


def test_a_right_study_stays(made: Any) -> None:
    repair = repaired(made, *recorded(1))
    assert not repair.kept and not repair.changes and repair.before < 2


def test_two_errors_at_once(made: Any) -> None:
    """A reversed torque and a position in degrees: neither alone explains the record."""
    t, q, tau = recorded(2)
    repair = repaired(made, t, q * (1, 1, 180 / np.pi), tau * (1, -1, 1))
    assert repair.kept and repair.before > 20 and repair.after < 1
    assert lines(repair) == ["record.units.q: [rad, rad, deg]", "record.scale.tau: [1, -1, 1]"]
    np.testing.assert_allclose(repair.records[0].q, q, atol=1e-9)
    np.testing.assert_allclose(repair.records[0].tau, tau, atol=1e-9)
    comments = list(repair.comments.values())
    assert all("was " in text and "not used" in text for text in comments)


def test_three_reversed_torques(made: Any) -> None:
    t, q, tau = recorded(3)
    repair = repaired(made, t, q, -tau)
    assert lines(repair) == ["record.scale.tau: -1"]


def test_exchanged_columns_carry_their_settings(made: Any) -> None:
    """Units and factors go with their columns."""
    t, q, tau = recorded(4)
    sections = {"record": [{"scale": {"tau": [1, 10, 0.1]}}]}
    repair = repaired(made, t, q, tau[:, [0, 2, 1]], **sections)
    assert lines(repair) == [
        "record.columns.tau: [tau1, tau3, tau2]",
        "record.scale.tau: [1, 0.1, 10]",
    ]


def test_delay_and_rate(made: Any) -> None:
    t, q, tau = recorded(5)
    k = 6
    repair = repaired(made, t[k:] / 2, q[k:], tau[:-k])
    assert repair.kept
    keys = {change.path[-1]: change.after for change in repair.changes}
    assert keys["rate"] == pytest.approx(RATE, rel=0.02)
    assert keys["delay"] == pytest.approx(k / RATE, abs=2e-3)


def test_nothing_is_kept_where_much_remains(made: Any) -> None:
    """Torques of another robot: a repair that halves the error is none."""
    t, q, tau = recorded(6)
    rng = np.random.default_rng(0)
    wrong = tau + 0.3 * tau.std(axis=0) * np.sin(q * rng.uniform(3, 6, 3)) * (1, -1, 1)
    repair = repaired(made, t, q, wrong * (1, -1, 1))
    assert not repair.kept and "certain enough" in repair.reason
    errors = [one.error for one in repair.candidates]
    assert errors and min(errors) > 5 and repair.records[0].tau is not None
    assert any("scale.tau: [1, -1, 1]" in line for one in repair.candidates for line in one.lines)


def test_what_a_record_cannot_tell_is_listed() -> None:
    """A pendulum with its torque reversed: its position may be reversed in place of the torque."""
    robot = parse_robot(PENDULUM.encode(), "pendulum.yaml")
    t = np.arange(1600) / RATE
    q = np.sin(1.3 * t) + 0.5 * np.sin(2.9 * t)
    qd = 1.3 * np.cos(1.3 * t) + 1.45 * np.cos(2.9 * t)
    qdd = -1.69 * np.sin(1.3 * t) - 4.205 * np.sin(2.9 * t)
    rng = np.random.default_rng(1)
    tau = 0.4 * qdd + 9.81 * 1.2 * np.cos(q) + 0.3 * qd + 0.5 * np.sign(qd)
    record = runtime.Record(t, q, -tau + 0.02 * rng.standard_normal(len(t)))
    model, variants = symgen.model(robot), symgen.variants(robot)
    repair = runtime.repair(model, record, variants=variants)
    assert lines(repair) == ["record.scale.tau: -1"]
    assert ("record.scale.q: -1",) in [one.lines for one in repair.equivalent]
    assert "by hand" in repair.apart and "the zero of joint 1" in repair.hidden


def test_gravity_of_a_tilted_base(tmp_path: Path) -> None:
    """The shared record: ten degrees about y0, by the command, and the written study goes in again."""
    log, robot = CASES / "tilted_base" / "log.csv.gz", CASES / "tilted_base" / "six.urdf"
    study, mended = tmp_path / "st.yaml", tmp_path / "repaired.yaml"
    run = CliRunner().invoke
    run(app, ["identify", str(robot), str(log), "--suggest", str(study)])
    before = study.read_text(encoding="utf-8")
    first = run(app, ["identify", str(robot), str(study), "--repair", str(mended)])
    assert first.exit_code == 0 and "Yes" in first.output, first.output
    assert study.read_text(encoding="utf-8") == before
    new = load_study(mended)
    np.testing.assert_allclose(new.robot.gravity, (1.70, 0, -9.66), atol=0.03)
    (line,) = [x for x in mended.read_text(encoding="utf-8").splitlines() if "gravity:" in x]
    assert "# was [0, 0, -9.81]" in line and "not used" in line
    again = run(app, ["identify", str(robot), str(mended)])
    assert again.exit_code == 0 and "leaves 0.5 %" in again.output
    corrected = symgen.corrected(robot, new)
    model = symgen.model(corrected)
    records = records_of(located(new, tmp_path).record, model, new)
    assert runtime.identify(model, records, new).estimate.relative_error < 1
    with pytest.raises(symgen.SymgenError, match="corrected the robot"):
        symgen.apply(runtime.identify(model, records, new), robot)
    with pytest.raises(runtime.InputError, match="corrects the robot"):
        runtime.identify(symgen.model(robot), records, new)


def test_the_command_offers_a_repair(tmp_path: Path) -> None:
    """Without the option, the verdict ends with the cause, its gain and the command."""
    t, q, tau = recorded(8)
    log = written(tmp_path, t, q, tau * (1, 1, -1))
    robot = arm(tmp_path)
    text = CliRunner().invoke(app, ["identify", str(robot), str(log)]).output
    head = text.split("\n\n")[0].splitlines()[-1]
    assert head.startswith("Repair: the torque of joint 3 has the wrong sign (computed gain ")
    assert head.endswith(f"symgen identify {robot} {log} --repair repaired.yaml")
    assert not (tmp_path / "repaired.yaml").exists()


def test_no_file_is_written_where_nothing_changes(tmp_path: Path) -> None:
    log, mended = written(tmp_path, *recorded(9)), tmp_path / "repaired.yaml"
    run = CliRunner().invoke(
        app, ["identify", str(arm(tmp_path)), str(log), "--repair", str(mended)]
    )
    assert run.exit_code == 0 and "Nothing changes" in run.output and not mended.exists()
    mended.write_text("mine", encoding="utf-8")
    run = CliRunner().invoke(
        app, ["identify", str(arm(tmp_path)), str(log), "--repair", str(mended)]
    )
    assert run.exit_code == 2 and mended.read_text(encoding="utf-8") == "mine"


def test_broken_records_are_refused(made: Any) -> None:
    t, q, tau = recorded(10)
    jumped = q.copy()
    jumped[700:, 1] += 0.7
    with pytest.raises(runtime.InputError, match="jump"):
        repaired(made, t, jumped, tau)
    silent = tau.copy()
    silent[::6] = 0.0
    with pytest.raises(runtime.InputError, match="publisher"):
        repaired(made, t, q, silent)


def test_pieces_between_gaps_are_refused(made: Any, tmp_path: Path) -> None:
    t, q, tau = recorded(11)
    kept = np.r_[0:700, 800:1600]
    log = written(tmp_path, t[kept], q[kept], tau[kept])
    study = study_from_mapping({"record": {"files": [str(log)], "resample": {"gaps": "split"}}})
    records = records_of(study.record, made[0], study)
    assert len(records) == 2
    with pytest.raises(runtime.InputError, match="gaps"):
        runtime.repair(made[0], records, study, variants=made[1])


def given(made: tuple[Any, Any], t: Any, q: Any, tau: Any) -> Any:
    """The reading of a record by a study without settings."""
    model, variants = made
    study = study_from_mapping({"record": [{}]})
    whole = problem(model, runtime.Record(t, q, tau), study)
    case = case_of(whole, variants)
    data = mending.data_of(case, whole, to_mapping(study), lambda record: ((), ()), RATE)
    return Reading.given(data, to_mapping(study))


def test_blocks_set_aside_do_not_matter_to_the_search(made: Any) -> None:
    """Another torque in the blocks set aside changes what is judged, and nothing that is found."""
    t, q, tau = recorded(12)
    numbers = []
    for factor in (1.0, 3.0):
        start = given(made, t, q, tau * (1, -1, 1))
        data = start.data
        other = np.where(data.aside[:, None], factor, 1.0) * data.samples.tau
        data = replace(data, samples=replace(data.samples, tau=other))
        found = Search(replace(start, data=data), lambda: 0.0)
        found.from_start()
        best = found.settled(found.best)
        numbers.append((best.key, best.error, best.unseen_error))
    assert numbers[0][:2] == numbers[1][:2]
    assert numbers[1][2] > 20 * numbers[0][2]


def test_a_rate_is_named_beside_reversed_torques(made: Any) -> None:
    """Reversed gravity torques are no reason against another rate once they are mended."""
    t, q, tau = recorded(22)
    start = given(made, t / 2, q, tau * (1, -1, -1))
    signs = [one for one in further(start)[0] if one.steps[0].kind == "sign"]
    mended = next(one for one in signs if list(np.diag(one.T)) == [1, -1, -1])
    assert {one.rate for one in further(mended)[0] if one.steps[-1].named} >= {0.5}


def test_numbers_are_searched_again_beside_the_other_changes(made: Any) -> None:
    """The zero that fits a late record best is another one: it is found again with the delay."""
    t, q, tau = recorded(22)
    k = 7
    repair = repaired(made, t[k:], q[k:] - np.array([0, 0.5, 0]), tau[:-k])
    changed = {change.path[-1]: change.after for change in repair.changes}
    assert repair.kept and changed.keys() == {"delay", "theta"}
    assert changed["delay"] == pytest.approx(k / RATE, abs=1e-3)
    assert float(changed["theta"].removeprefix("q2 +")) == pytest.approx(0.5, abs=0.03)
