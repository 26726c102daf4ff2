"""The server of the studio, asked without a browser: what it takes, what it refuses, what lies in its folder."""

from __future__ import annotations

import asyncio
import gc
import gzip
import io
import json
import re
import sys
import threading
import warnings
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest
from bag_files import joint_states, write_bag
from hang import HANG

import symgen
from symgen.studio import guard, server, serving, table, views
from symgen.studio.child import ViewProcess
from symgen.studio.folder import WorkFolder
from symgen.studio.jobs import Job, Jobs

EVIL = """<script>alert(1)</script>'"><img src=x onerror=alert(1)>&{{7*7}}"""
TEXT = """\
symgen: 1
name: arm   # a comment that stays
gravity: [0, -g, 0]
constants: {D2: 0.5, g: 9.81}
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: 0, d: D2, theta: q2, r: 0}
elements:
  FV: {kind: viscous, along: all}   # another one
limits: {q: [3, 3]}
"""


def csv(rows: int = 300) -> bytes:
    t = np.arange(rows) / 100
    table = np.column_stack([t, np.sin(t), np.cos(t), t, -t])
    text = io.StringIO()
    np.savetxt(text, table, delimiter=",", header="t,q1,q2,tau1,tau2", comments="")
    return text.getvalue().encode()


def edited(studio: Any, change: Any, **more: str) -> Any:
    cells = table.cells_of(WorkFolder(studio.path).read("robot.yaml"))
    change(cells)
    return studio.post(
        "edit", {"digest": studio.server.folder.digest, "cells": json.dumps(cells), **more}
    )


# --- who may ask ---


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:8123",
        "127.0.0.1",
        "127.0.0.1:80",
        "localhost:8123.evil.example",
        "",
    ],
)
def test_another_host_is_refused(studio: Any, host: str) -> None:
    assert studio.get("robot", headers={"host": host}).status_code == 421


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:80", "https://127.0.0.1:8123", ""]
)
def test_another_origin_is_refused(studio: Any, origin: str) -> None:
    """Whatever it asks for; and a change needs an origin."""
    assert studio.post("packaged", {"name": "tx40"}, headers={"origin": origin}).status_code == 403
    assert studio.get("robot", headers={"origin": origin}).status_code == 403
    assert (
        studio.client.post(f"/{studio.server.token}/do/packaged", data={"name": "tx40"}).status_code
        == 403
    )
    assert (
        studio.post(
            "packaged", {"name": "tx40"}, headers={"sec-fetch-site": "cross-site"}
        ).status_code
        == 403
    )
    assert not (studio.path / "robot.yaml").exists()


@pytest.mark.parametrize("path", ["/", "/robot", "/wrong/robot", "//robot", "/%2e%2e/robot"])
def test_nothing_without_the_token(studio: Any, path: str) -> None:
    assert studio.client.get(path).status_code == 404


def test_methods_that_no_page_uses_are_refused(studio: Any) -> None:
    for method in ("PUT", "DELETE", "OPTIONS", "PATCH"):
        assert studio.client.request(method, f"/{studio.server.token}/robot").status_code == 405
    assert studio.get("do/packaged").status_code in (404, 405, 422)
    assert studio.post("../robot", {}).status_code == 405


def test_every_answer_has_the_policy(studio: Any) -> None:
    for answer in (
        studio.get("robot"),
        studio.get("nothing"),
        studio.get("static/studio.js"),
        studio.client.get("/"),
    ):
        policy = answer.headers["content-security-policy"]
        assert policy.startswith("default-src 'none'") and "unsafe" not in policy
        assert answer.headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize(
    "name",
    [
        "../../../etc/passwd",
        "..%2f..%2fetc%2fpasswd",
        "%2e%2e/%2e%2e/pyproject.toml",
        "....//",
        "/etc/passwd",
        "robot.yaml%00",
    ],
)
def test_no_path_leads_out(studio: Any, name: str) -> None:
    (studio.path / "secret.txt").write_text("secret")
    for place in ("static", "report", "file", "runs/01-ols", "runs/..", "view", ""):
        answer = studio.get(f"{place}/{name}")
        assert answer.status_code in (307, 404, 405, 422), (place, answer.text)
    assert studio.get("file/secret.txt").status_code == 422
    assert studio.get("runs/../secret.txt").status_code in (404, 422)


# --- what is sent ---


def test_a_file_gets_a_name_of_ours(studio: Any) -> None:
    assert studio.upload("robot", "/etc/cron.d/arm.yaml", TEXT.encode()).status_code == 200
    assert [p.name for p in studio.path.iterdir() if p.is_file()] == ["robot.yaml"]


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("run 3.csv", "run_3.csv"),
        ("a b ä.csv", "a_b_ä.csv"),
        ("../x.csv", "x.csv"),
        ("C:\\logs\\x.csv", "x.csv"),
        ("../../../tmp/evil<script>.CSV", "evil_script_.CSV"),
        ("..csv.csv", "csv.csv"),
        ("-o.csv", "o.csv"),
        ("x\n\0y\u202e.csv.gz", "x_y_.csv.gz"),
        ("study.csv", "study.csv"),
        ("robot.csv", "robot.csv"),
        ("a" * 296 + ".csv", "a" * 56 + ".csv"),
        ("\U00020000" * 296 + ".csv", "\U00020000" * 56 + ".csv"),
    ],
)
def test_a_measured_file_keeps_its_name(studio: Any, name: str, kept: str) -> None:
    """As far as it is harmless; the record and its validation may have the same name."""
    for kind in ("record", "validation"):
        assert studio.upload(kind, "before.csv", csv()).status_code == 200
        assert studio.upload(kind, name, csv()).status_code == 200
    files = [p.relative_to(studio.path).as_posix() for p in sorted(studio.path.rglob("*.*"))]
    earlier = [file for file in files if file.startswith("history")]
    assert earlier == ["history/record/0001/record/before.csv"]
    assert files[len(earlier) :] == [f"record/{kept}", f"validation/{kept}"]
    page = studio.get("record").text
    assert f"<h1>Record: {kept}</h1>" in page and f'data-validation="validation/{kept}"' in page
    study = {"symgen": 1, "record": [{"files": [f"record/{kept}"]}]}
    assert studio.post("study", {"values": json.dumps(study)}).status_code == 200


@pytest.mark.parametrize(("kind", "name"), [("robot", "arm.py"), ("robot", "arm"), ("record", "run.exe"), ("record", "run.csv.exe"), ("record", ".gz"), ("record", ""), ("record", ".x"), ("record", ".csv"), ("record", "a.csv/.."), ("record", "runs"), ("record", "study.yaml"), ("record", "robot.yaml"), ("validation", "x" * 300), ("module", "arm.py")])  # fmt: skip
def test_another_kind_is_refused(studio: Any, kind: str, name: str) -> None:
    answer = studio.upload(kind, name, b"x")
    assert answer.status_code == 422 and "expected" in answer.text
    assert [p.name for p in studio.path.iterdir() if p.is_file()] == []


def test_too_much_is_refused_before_it_is_read(studio: Any) -> None:
    big = {"content-length": str(100 * 10**6)}
    assert (
        studio.post(
            "upload", params={"kind": "record", "name": "a.csv"}, content=b"", headers=big
        ).status_code
        == 413
    )
    assert studio.post("edit", headers={"content-length": str(2 * 2**20)}).status_code == 413


def test_too_much_is_refused_where_the_length_was_a_lie(
    studio: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sent in parts without a length: the file goes, none is left."""
    monkeypatch.setattr(guard, "LARGEST_UPLOAD", 10**5)
    parts = (b"0,1\n" * 10**4 for _ in range(10))
    answer = studio.post("upload", params={"kind": "record", "name": "a.csv"}, content=parts)
    assert answer.status_code == 422 and "larger than" in answer.text
    assert [p.name for p in studio.path.iterdir() if p.is_file()] == []


@pytest.mark.campaign
def test_a_bomb_ends_in_a_sentence(studio: Any) -> None:
    """100 MB of zeros in an archive, in gzip; nothing of it is unpacked in the server."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("q.npy", bytes(100 * 10**6))
    for name, content in (
        ("a.npz", buffer.getvalue()),
        ("a.csv.gz", gzip.compress(bytes(100 * 10**6))),
    ):
        answer = studio.upload("record", name, content)
        assert answer.status_code == 422 and len(answer.text) < 2500
        assert not (studio.path / "record").exists()


def test_a_new_record_is_what_the_page_shows(studio: Any) -> None:
    """The file before goes."""
    studio.upload("record", "run.csv", csv())
    assert studio.get("view/preview").json()["names"] == ["t", "q1", "q2", "tau1", "tau2"]
    studio.upload("record", "other.csv", csv().replace(b"tau", b"effort_"))
    assert studio.get("view/preview").json()["names"][-1] == "effort_2"
    asked = {
        names: {"tau": names} for names in ("effort_1,effort_2", "tau1,tau2", "q1,i_motor", "")
    }
    answers = {names: studio.get("view/preview", params=asked[names]).json() for names in asked}
    assert [answer["currents"] for answer in answers.values()] == [True, False, False, False]


def test_a_folder_of_ros_2_is_a_record_of_the_command_line(studio: Any, tmp_path: Path) -> None:
    """Copied without what is not of the bag; a record that is dropped later takes its place."""
    t = np.arange(50) / 100
    states = joint_states(
        t * 1e9, ("a", "b"), np.column_stack([t, -t]), np.column_stack([2 * t, t])
    )
    bag = write_bag("sqlite3", tmp_path / "bag", {"/joint_states": states})
    (bag / "private.txt").write_text("not of the bag")
    work = WorkFolder(studio.path)
    work.take_record_of(str(bag))
    assert work.measured("record") == "record/bag"
    assert not (studio.path / "record" / "bag" / "private.txt").exists()
    answer = studio.get("view/preview", params={"columns": "a.position,b.effort"}).json()
    assert answer["rows"] == 50 and answer["first"][1] == ["0.01", "0.01"], answer
    studio.upload("record", "run.csv", csv())
    assert work.measured("record") == "record/run.csv"
    assert [p.name for p in (studio.path / "record").iterdir()] == ["run.csv"]


def test_what_a_command_tells_is_read_as_data() -> None:
    """Counts, stages and errors by their keys, whatever their words; other lines as they are."""
    job = Job(1, "01-cestac", ("symgen",), "", progress='{"stage": "12/40 error: of words"}\n')
    assert job.counted is None and job.said == ["12/40 error: of words"]
    job.progress += '{"done": 12, "total": 40}\n{"done": 13, "tot'  # the rest is on its way
    assert job.counted == (12, 40)
    job.progress += 'al": 40}\n{"error": "no such file", "path": []}\nKilled\n'
    assert job.counted == (13, 40)
    assert job.last == "no such file" and job.said[-1] == "Killed"


def test_the_settings_of_a_run_begin_with_its_command(studio: Any) -> None:
    """Nothing that is asked for can add a line to them."""
    studio.upload("robot", "arm.yaml", TEXT.encode())
    studio.upload("record", "run.csv", csv())
    values = {"symgen": 1, "record": [{"files": ["record/run.csv"]}]}
    studio.post("study", {"values": json.dumps(values)})
    asked = {
        "kind": "advise",
        "anyway": "1",
        "delta": "2*pi/500,\n1\x85record: {files: /etc/passwd}\u2028x",
    }
    assert studio.post("solve", asked).status_code == 200
    first, _, rest = (studio.path / "study-01-advise.yaml").read_text().partition("\n")
    assert first.startswith("# symgen cestac robot-01-advise.yaml study-01-advise.yaml --advise ")
    assert len(first.splitlines()) == 1 and "passwd" not in rest
    assert studio.post("solve", {"kind": "identify --force"}).status_code == 422


# --- the table ---


def test_an_edit_changes_its_line_alone(studio: Any) -> None:
    studio.upload("robot", "arm.yaml", TEXT.encode())
    answer = edited(studio, lambda cells: cells["frames"]["2"].update(alpha="pi/2"))
    assert answer.status_code == 200 and "90°" in answer.text
    text = (studio.path / "robot.yaml").read_text()
    assert "alpha: pi/2" in text and "# a comment that stays" in text and "# another one" in text
    assert (
        symgen.load_robot(studio.path / "robot.yaml").frames[1].alpha
        == symgen.load_robot("tx40").frames[3].alpha
    )


CLASSIC = """\
symgen: 1
name: arm
gravity: [0, -9.81, 0]
frames:
  1: {ant: 0, sigma: 0, alpha: 0, d: 0.4, theta: q1, r: 0}   # as in the textbook
  2: {ant: 1, sigma: 0, alpha: 0, d: 0.3, theta: q2 + pi/6, r: 0}
values: {M1: 3, MX1: -0.6, M2: 2, MX2: -0.3}
"""


def test_the_convention_changes_how_a_table_is_read(studio: Any) -> None:
    """Bars of 3 and 2 kg, of 0.4 and 0.3 m, whose middles are behind the frames of a classic table."""
    studio.upload("robot", "arm.yaml", CLASSIC.encode())
    file = studio.path / "robot.yaml"
    answer = edited(studio, lambda cells: cells.update(convention="distal"))
    assert file.read_text() == CLASSIC + "convention: distal\n"
    assert 'aria-label="a of frame 1, m"' in answer.text and "of frame 3" not in answer.text
    model = symgen.model(file)
    standard = dict.fromkeys(model.STANDARD_PARAMETERS, 0.0) | model.VALUES
    torques = model.gravity(np.array([0, -np.pi / 6]), model.base_parameters(standard))
    by_hand = 9.81 * np.array([3 * 0.2 + 2 * (0.4 + 0.15), 2 * 0.15])
    np.testing.assert_allclose(torques, by_hand)
    edited(studio, lambda cells: cells["frames"]["2"].update(alpha="pi/2"))
    assert "convention: distal" in file.read_text()
    answer = edited(studio, lambda cells: cells["frames"]["1"].update(alpha="-pi/2"))
    angles = re.findall(r'id="f-(.-.*?)".*\n<span class="deg">(.*?)<', answer.text)
    assert angles == [("1-alpha", "-90°"), ("2-alpha", "90°"), ("2-theta", "30°")]
    for _ in range(2):
        studio.post("undo", {"digest": studio.server.folder.digest})
    assert file.read_text() == CLASSIC + "convention: distal\n"
    edited(studio, lambda cells: cells.update(convention="proximal"))
    assert file.read_text() == CLASSIC


@pytest.mark.parametrize(
    ("typed", "written"),
    [
        ("q1 + 90°", "q1 + 90*pi/180"),
        ("q1−π/2", "q1-pi/2"),
        ("q1 - 30 °", "q1 - 30*pi/180"),
        ("q1 + 3π/2", "q1 + 3*pi/2"),
    ],
)
def test_angles_are_typed_as_a_textbook_prints_them(studio: Any, typed: str, written: str) -> None:
    studio.upload("robot", "arm.yaml", CLASSIC.encode())
    edited(studio, lambda cells: cells["frames"]["1"].update(theta=typed))
    assert f"theta: {written}, r: 0" in (studio.path / "robot.yaml").read_text()


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("values:", "loops: [{cut: 1, twin: 2}]\nvalues:", ""),
        ("ant: 1", "ant: 1, gamma: 1", 'id="wrong-2"> <span class="wrong" role="alert">'),
        ("convention: distal", "convention: classic", 'id="wrong-convention">'),
    ],
)
def test_what_a_classic_table_cannot_have_is_one_sentence(
    studio: Any, old: str, new: str, place: str
) -> None:
    studio.upload("robot", "arm.yaml", CLASSIC.encode())
    text = (CLASSIC + "convention: distal\n").replace(old, new)
    answer = studio.post("edit", {"digest": studio.server.folder.digest, "text": text})
    wrong = table.wrong(text)
    assert wrong is not None
    assert answer.text.count(place + wrong.message.replace("'", "&#39;")) == 1, answer.text
    assert (studio.path / "robot.yaml").read_text() == CLASSIC


BODY = (
    '<inertial><origin xyz="0.1 0 0"/><mass value="1"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.008" '
    'iyz="0" izz="0.008"/></inertial>'
)
BARS = (
    '<robot name="bars"><link name="base"/>'
    + "".join(f'<link name="{link}">{BODY}</link>' for link in ("crank", "rod", "rocker"))
    + "".join(
        f'<joint name="j{k}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="0 1 0"/></joint>'
        for k, (parent, child, x) in enumerate(
            (("base", "crank", 0), ("crank", "rod", 0.1), ("base", "rocker", 0.3)), start=1
        )
    )
    + "</robot>"
)


def test_loops_beside_a_urdf_are_taken(studio: Any, tmp_path: Path) -> None:
    """Dropped after their URDF, or beside the one of the command line; undo takes them away."""
    hinge = "loops: [{links: [rod, rocker], points: [[0.3, 0, 0], [0.2, 0, 0]], axis: [0, 1, 0]}]\n"
    loops = (hinge + "actuated: [j1]\n").encode()
    refused = studio.upload("robot", "bars.loops.yaml", loops)
    assert refused.status_code == 422 and "drop that first" in refused.text
    (tmp_path / "bars.urdf").write_text(BARS)
    studio.upload("robot", "bars.urdf", BARS.encode())
    wrong = studio.upload("robot", "bars.loops.yaml", loops.replace(b"rocker]", b"other]"))
    assert wrong.status_code == 422 and "other" in wrong.text
    assert {path.name for path in studio.path.glob("robot.*")} == {"robot.urdf"}
    assert studio.upload("robot", "bars.loops.yaml", loops).status_code == 200
    (tmp_path / "bars.loops.yaml").write_bytes(loops)
    expected = symgen.load_robot(tmp_path / "bars.urdf")
    taken = symgen.load_robot(studio.server.folder.robot)
    assert taken.loops == expected.loops and len(taken.loops) == 1
    assert symgen.load_robot(studio.path / "robot.urdf").loops == taken.loops  # for `symgen apply`
    beside = WorkFolder(tmp_path / "beside")
    beside.take_robot_of(str(tmp_path / "bars.urdf"))
    assert symgen.load_robot(beside.robot).loops == taken.loops
    studio.post("undo", {"digest": studio.server.folder.digest})
    assert {path.name for path in studio.path.glob("robot.*")} == {"robot.urdf"}


def test_an_angle_that_is_rounded_is_no_warning(studio: Any) -> None:
    joint = '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
    origin = '<origin rpy="1.57079634 0 0"/><limit effort="1" velocity="1"/></joint>'
    urdf = f'<robot name="arm"><link name="a"/><link name="b"/>{joint}{origin}</robot>'
    studio.upload("robot", "arm.urdf", urdf.encode())
    text = studio.get("robot").text
    assert text.count("1 angle rounded to multiples of pi/12 (15 deg)") == 1
    assert re.search(r'<p class="note">[^<]*1 angle rounded to', text)


def test_comments_after_an_edited_part_stay(studio: Any) -> None:
    studio.post("packaged", {"name": "new"})
    before = (studio.path / "robot.yaml").read_text()
    edited(studio, lambda cells: cells.update(name="two", constants={"D2": "0.7", "g": "9.81"}))
    text = (studio.path / "robot.yaml").read_text()
    assert 'name: "two"' in text and "D2: 0.7" in text
    whole = [line for line in before.splitlines() if line.startswith("#")]
    assert [line for line in text.splitlines() if line.startswith("#")] == whole


def test_an_error_stands_beside_its_cell_and_the_last_robot_stays(studio: Any) -> None:
    studio.upload("robot", "arm.yaml", TEXT.encode())
    answer = edited(studio, lambda cells: cells["frames"]["2"].update(alpha="pi/"))
    assert 'aria-invalid="true" aria-describedby="wrong-2"' in answer.text
    wrong = TEXT.replace("alpha: 0, d: D2", "alpha: pi/, d: D2")
    with pytest.raises(symgen.SymgenError) as said:
        symgen.parse_robot(wrong.encode(), "robot.yaml")
    assert answer.text.count(said.value.message.replace("'", "&#39;")) == 1  # type: ignore[attr-defined]
    assert (studio.path / "robot.yaml").read_text() == TEXT
    assert studio.get("certificate").text.count("No certificate")
    late = studio.get("view/formulas")  # asked for before the edit, answered after it
    assert late.status_code == 200 and late.headers["hx-reswap"] == "none"
    assert 'value="pi/"' in studio.get("robot").text  # reloaded


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("theta: q2", "theta: q3"),
        ("D2: 0.5", "D2: (0.5"),
        ("gravity: [0, -g, 0]", "gravity: [0, -h, 0]"),
        ("{D2: 0.5, g: 9.81}", "5"),
        ("limits: {q: [3, 3]}", "loops:\n  - {cut: 2, twin: 7}"),
        ("limits: {q: [3, 3]}", "limits: {q: [3]}"),
    ],
)
def test_each_error_of_the_table_is_shown_once(studio: Any, old: str, new: str) -> None:
    studio.upload("robot", "arm.yaml", TEXT.encode())
    text = TEXT.replace(old, new)
    answer = studio.post("edit", {"digest": studio.server.folder.digest, "text": text})
    wrong = table.wrong(text)
    assert wrong is not None
    assert answer.text.count(wrong.message.replace("'", "&#39;")) == 1, answer.text


def test_the_first_proof_of_a_robot_follows_no_other(studio: Any) -> None:
    studio.upload("robot", "arm.yaml", TEXT.encode())
    answer = studio.post("prove", {}).text
    assert "Proving" in answer and "last certificate" not in answer


def test_frames_come_and_go_with_the_parts_that_are_for_them(studio: Any) -> None:
    studio.upload("robot", "arm.yaml", TEXT.encode())
    new = {"ant": "1", "sigma": "0", "alpha": "0", "d": "0", "theta": "q3", "r": "0"}
    answer = edited(studio, lambda cells: cells["frames"].update({"3": new}), resized="1")
    assert "Left out, since they were for the other frames: limits" in answer.text
    assert len(symgen.load_robot(studio.path / "robot.yaml").joints) == 3


def test_a_proof_asked_for_before_the_table_became_a_draft_is_no_error(studio: Any) -> None:
    studio.upload("robot", "arm.yaml", TEXT.encode())
    edited(studio, lambda cells: cells["frames"]["2"].update(alpha="-pi/"))
    answer = studio.post("prove", {})
    assert answer.status_code == 200 and "describes no robot yet" in answer.text
    assert not studio.server.jobs.all


def test_two_pages_do_not_overwrite_each_other(studio: Any) -> None:
    studio.upload("robot", "arm.yaml", TEXT.encode())
    old = studio.server.folder.digest
    edited(studio, lambda cells: cells["constants"].update(D2="0.7"))
    answer = studio.post("edit", {"digest": old, "text": TEXT})
    assert answer.status_code == 422 and "another page" in answer.text
    assert "0.7" in (studio.path / "robot.yaml").read_text()


def test_names_are_escaped_wherever_they_are_shown(studio: Any) -> None:
    title = json.dumps(EVIL)
    text = TEXT.replace(
        "limits: {q: [3, 3]}", f"title: {title}\nsource: {title}\nlabels: {{1: {title}, 2: b}}"
    )
    studio.upload("robot", "arm.yaml", text.encode())
    studio.upload("record", f"{EVIL}.csv", csv().replace(b"q1", b"q1<script>alert(1)</script>"))
    studio.post("study", {"text": f"symgen: 1\nrecord: {{files: [run.csv], name: {title}}}\n"})
    run = studio.path / "runs" / "01-ols"
    run.mkdir()
    data = {
        "names": [EVIL],
        "X": [1.0],
        "sigma": [1.0],
        "units": {EVIL: EVIL},
        "verdict": EVIL,
        "method": EVIL,
    }
    (run / "estimate.json").write_text(
        json.dumps(data | {"checklist": {"answer": EVIL, "use": EVIL, "state": EVIL}})
    )
    (studio.path / "check.json").write_text(json.dumps({"checks": [{"state": "no", "question": EVIL, "finding": EVIL, "remedy": EVIL}], "named": [{"cause": EVIL, "remedy": EVIL}] * 2, "deviations": {EVIL: 1.0}, "rank": 1, "count": 1}))  # fmt: skip
    for step in ("robot", "record", "check", "solve", "results"):
        answer = studio.get(step).text
        assert (
            "<script>alert" not in answer
            and "<img" not in answer
            and "49" not in answer.split("{{7*7}}")[0][-3:]
        ), step
    bad = studio.post("packaged", {"name": EVIL})
    assert "<script>alert" not in bad.text


@pytest.mark.parametrize(
    "file",
    [
        "/etc/passwd",
        "../record.csv",
        "C:\\\\x.csv",
        "a/b.csv",
        "record/other.csv",
        "record/../record/run.csv",
    ],
)
def test_a_study_of_the_browser_names_no_file_of_another_folder(studio: Any, file: str) -> None:
    studio.upload("record", "run.csv", csv())
    for text in (f"record: {{files: ['{file}']}}", f"validate: {{record: [{{files: ['{file}']}}]}}", f"record: {{files: [record.csv], also: [['{file}']]}}"):  # fmt: skip
        answer = studio.post("study", {"text": text})
        if Path(file).name != file:
            assert answer.status_code == 422 and "work folder" in answer.text
            assert not (studio.path / "study.yaml").exists()


def test_news_that_come_while_others_are_sent_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A page that reads slowly learns of every change at once, not at the next one."""

    async def at_once(news: Any, seconds: float) -> None:
        """Wait for news as `asyncio.wait_for` does, but only for those that are there."""
        waiting = asyncio.ensure_future(news)
        await asyncio.sleep(0)
        assert waiting.done()

    monkeypatch.setattr(serving.asyncio, "wait_for", at_once)

    async def versions() -> list[int]:
        own = server.Server(WorkFolder(tmp_path), {}, "token")
        events = serving.told(own)
        parts = [await anext(events)]
        own.changed()  # the stream waits for its reader
        parts.append(await anext(events))
        await events.aclose()
        return [json.loads(part.removeprefix("data: "))["version"] for part in parts]

    assert asyncio.run(versions()) == [0, 1]


def test_a_folder_opens_again(studio: Any) -> None:
    studio.upload("robot", "arm.yaml", TEXT.encode())
    studio.upload("record", "run.csv", csv())
    studio.post(
        "study", {"values": json.dumps({"symgen": 1, "record": [{"files": ["record/run.csv"]}]})}
    )
    (studio.path / "runs" / "01-killed").mkdir()
    (studio.path / "left.part").write_text("x")
    again = WorkFolder(studio.path)
    assert again.robot == studio.path / "robot.yaml" and again.study()["record"][0]["files"] == [
        "record/run.csv"
    ]
    assert sorted(p.name for p in studio.path.iterdir()) == [
        "record",
        "robot.yaml",
        "runs",
        "study.yaml",
    ]
    assert list((studio.path / "runs").iterdir()) == []


@pytest.mark.campaign
def test_many_requests_at_once(studio: Any) -> None:
    """200, among them 50 edits: each is answered, one edit of each state wins."""
    import httpx

    studio.upload("robot", "arm.yaml", TEXT.encode())
    digest, cells = studio.server.folder.digest, table.cells_of(TEXT)

    async def all_of_them() -> list[int]:
        transport = httpx.ASGITransport(app=studio.app)
        async with httpx.AsyncClient(
            transport=transport, base_url=f"http://127.0.0.1:8123/{studio.server.token}/"
        ) as client:
            edits = [
                json.dumps(cells | {"constants": {"D2": str(k), "g": "9.81"}}) for k in range(1, 51)
            ]
            posts = [
                client.post(
                    "do/edit",
                    data={"digest": digest, "cells": e},
                    headers={"origin": "http://127.0.0.1:8123"},
                )
                for e in edits
            ]
            gets = [client.get(name) for name in ("record", "check", "jobs") for _ in range(50)]
            return [answer.status_code for answer in await asyncio.gather(*posts, *gets)]

    studio.server.process.end()
    studio.server.viewing = asyncio.Lock(), asyncio.Lock()
    codes = asyncio.run(all_of_them())
    assert set(codes[50:]) == {200} and codes[:50].count(200) >= 1 and set(codes[:50]) <= {200, 422}


@pytest.mark.parametrize(
    "cells",
    [
        "{",
        "5",
        "[]",
        '{"frames": {"1": 5}, "constants": {}, "gravity": [], "loops": []}',
        '{"frames": {"x": {}}}',
    ],
)
def test_what_is_no_table_is_refused(studio: Any, cells: str) -> None:
    studio.upload("robot", "arm.yaml", TEXT.encode())
    answer = studio.post("edit", {"digest": studio.server.folder.digest, "cells": cells})
    assert answer.status_code == 422 and "no table" in answer.text
    assert (studio.path / "robot.yaml").read_text() == TEXT


@pytest.mark.parametrize(
    ("name", "content"),
    [("a.urdf", b"<robot"), ("a.yaml", bytes(range(256))), ("a.yaml", b"- a"), ("a.yaml", b"frames: {1: 5}\nsymgen: 1"), ("a.xml", b"<mujoco/>"), ("a.par", b"x")],
)  # fmt: skip
def test_a_file_that_is_no_robot_is_told_on_the_page(
    studio: Any, name: str, content: bytes
) -> None:
    studio.upload("robot", "arm.yaml", TEXT.encode())
    answer = studio.upload("robot", name, content)
    assert answer.status_code == 422 and name in answer.text
    assert [p.name for p in studio.path.iterdir() if p.is_file()] == ["robot.yaml"]
    assert (studio.path / "robot.yaml").read_text() == TEXT
    (studio.path / "robot.yaml").unlink()
    (studio.path / f"robot{Path(name).suffix}").write_bytes(content)  # by an editor
    for step in ("robot", "record", "check", "solve", "results"):
        assert studio.get(step).status_code == 200
    assert 'class="no"' in studio.get("robot").text
    assert studio.post("check", {}).status_code == 422


@pytest.mark.parametrize("text", ["- 1", "record: 5", "estimate: 7", "{" * 60, "\x00"])
def test_a_text_that_is_no_study_is_refused(studio: Any, text: str) -> None:
    for form in ({"text": text}, {"values": text}, {"values": "[1]"}):
        assert studio.post("study", form).status_code == 422
    assert studio.post("solve", {"values": "5", "name": "../x"}).status_code == 422
    assert (
        not (studio.path / "study.yaml").exists() and list((studio.path / "runs").iterdir()) == []
    )


@pytest.mark.parametrize("busy", ["page", "run"])
def test_the_server_ends_some_time_after_its_last_page_and_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, busy: str
) -> None:
    monkeypatch.setattr(serving, "IDLE_TIME", 0.2)
    ended: list[float] = []

    async def closed_after(seconds: float) -> None:
        own = server.Server(WorkFolder(tmp_path), {}, "token")
        loop = asyncio.get_running_loop()
        start = loop.time()
        if busy == "page":
            own.pages = 1
            loop.call_later(seconds, lambda: setattr(own, "pages", 0))
        else:
            own.jobs.add(
                "01-ols", ("symgen", "identify"), "runs/01-ols/estimate.json", run="01-ols"
            )
            loop.call_later(seconds, lambda: setattr(own.jobs.all[0], "state", "done"))
        await asyncio.wait_for(serving.idle(own, lambda: ended.append(loop.time() - start)), HANG)

    asyncio.run(closed_after(0.3))
    assert ended[0] >= 0.45


def test_a_check_that_is_refused_ends_with_2(tmp_path, monkeypatch, capsys):
    """Code 1 counts as a result: a failed Check said nothing."""
    (tmp_path / "arm.yaml").write_text("symgen: 1\nname: [\n")
    (tmp_path / "study.yaml").write_text("symgen: 1\n")
    monkeypatch.setattr(
        "sys.argv", ["check", str(tmp_path / "arm.yaml"), str(tmp_path / "study.yaml"), "out.json"]
    )
    with pytest.raises(SystemExit) as ended:
        views.check()
    assert ended.value.code == 2
    told = json.loads(capsys.readouterr().err)
    assert "not YAML" in told["error"] and told["path"] == []


def test_what_is_nested_without_end_is_refused(studio: Any) -> None:
    studio.upload("robot", "arm.yaml", TEXT.encode())
    deep = "[" * 100_000
    digest = studio.server.folder.digest
    for name, form in (
        ("study", {"values": deep}),
        ("study", {"text": deep}),
        ("solve", {"values": deep}),
        ("edit", {"digest": digest, "cells": deep}),
        ("edit", {"digest": digest, "text": deep}),
    ):
        answer = studio.post(name, form)
        assert answer.status_code < 500, (name, [*form])
        assert studio.get("robot").status_code == 200
        digest = studio.server.folder.digest


def test_a_run_that_was_cancelled_while_it_waited_leaves_nothing(studio: Any) -> None:
    studio.upload("robot", "arm.yaml", TEXT.encode())
    studio.upload("record", "run.csv", csv())
    values = json.dumps({"symgen": 1, "record": [{"files": ["record/run.csv"]}]})
    studio.post("study", {"values": values})
    asked = {"values": values, "kind": "advise", "anyway": "1"}
    for _ in range(2):
        assert studio.post("solve", asked).status_code == 200
    waiting = studio.server.jobs.all[-1]
    assert waiting.state == "waiting" and (studio.path / f"study-{waiting.run}.yaml").exists()
    studio.post("cancel", {"number": str(waiting.number)})
    assert waiting.state == "cancelled" and not (studio.path / f"study-{waiting.run}.yaml").exists()


def test_a_studio_that_ends_closes_the_pipes_of_its_run(tmp_path: Path) -> None:
    """Else the garbage collector closes them, anywhere, with an error and no one to catch it."""
    sleep = "import time; print(1, flush=True); time.sleep(3600)"

    async def interrupted() -> None:
        jobs = Jobs(tmp_path, {"sleep": [sys.executable, "-c", sleep]}, lambda: None)
        work = asyncio.create_task(jobs.work())
        jobs.add("Sleep", ["sleep"], "none")
        while not jobs.all[0].output:
            await asyncio.sleep(0.01)
        work.cancel()
        await asyncio.gather(work, return_exceptions=True)

    before = {*threading.enumerate()}
    with warnings.catch_warnings(record=True) as leaked:
        warnings.simplefilter("always", ResourceWarning)
        asyncio.run(interrupted())
        for thread in {*threading.enumerate()} - before:  # asyncio's, until the process ends
            thread.join()
        gc.collect()
    assert [str(warning.message) for warning in leaked] == []


def chain(n: int) -> str:
    """The file of an open chain of n revolute joints."""
    rows = [
        f"  {j}: {{ant: {j - 1}, sigma: 0, alpha: {('0', 'pi/2', '-pi/2')[j % 3]}, d: 0.{j}, theta: q{j}, r: 0.2}}"
        for j in range(1, n + 1)
    ]
    return "symgen: 1\nname: chain\ngravity: [0, 0, 9.81]\nframes:\n" + "\n".join(rows) + "\n"


@pytest.mark.campaign
def test_formulas_of_thirty_joints_take_seconds(tmp_path: Path) -> None:
    """Of processor time, which a busy machine does not lengthen; they took minutes."""
    (tmp_path / "chain.yaml").write_text(chain(30))
    start = process_time()
    shown = views.formulas(str(tmp_path / "chain.yaml"), "")
    assert len(shown["base"]) > 200 and process_time() - start < server.VIEW_PATIENCE / 2


@pytest.mark.campaign
def test_a_model_of_thirty_joints_is_its_recursion(tmp_path: Path) -> None:
    (tmp_path / "chain.yaml").write_text(chain(30))
    start = process_time()
    shown = views.model(str(tmp_path / "chain.yaml"), {"model": "inverse_dynamics"})
    assert shown["form"] == "recursive" and "more than 10000 terms." in shown["why"]
    assert len(shown["typeset"].steps) > 1 and process_time() - start < server.VIEW_PATIENCE / 2


class Held(ViewProcess):
    """A process of views that begins with the first view when `released` is set."""

    def __init__(self) -> None:
        super().__init__()
        self.asked, self.released = threading.Event(), threading.Event()
        self.thread = ThreadPoolExecutor(1)

    def submit(self, view: Any, *args: Any) -> Any:
        self.asked.set()
        return self.thread.submit(self._late, view, args)

    def _late(self, view: Any, args: tuple[Any, ...]) -> Any:
        self.released.wait(HANG)
        return view(*args)


def test_pages_do_not_wait_for_formulas(studio: Any) -> None:
    """A page of the robot comes while formulas are derived, however long they take."""
    studio.upload("robot", "chain.yaml", chain(3).encode())
    deriving = studio.server.deriving = Held()
    with ThreadPoolExecutor(1) as pool:
        formulas = pool.submit(studio.get, "view/formulas")
        assert deriving.asked.wait(HANG)
        assert "chain" in studio.get("robot").text
        assert not formulas.done()
        deriving.released.set()
        assert "ZZ3" in formulas.result().text


def test_every_page_opens_in_an_empty_folder(studio: Any) -> None:
    for name in ("robot", "record", "check", "solve", "results"):
        assert studio.get(name).status_code == 200, name
