"""The studio in a browser, as a person works in it, and as a process that ends."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlencode
from urllib.request import Request, urlopen

import kr300
import numpy as np
import pytest
from browser import WEAK_CONTRAST, Browser
from hang import HANG

import symgen
from runtime.documents.yaml_text import yaml_text
from symgen.studio import table
from symgen.studio.folder import WorkFolder

pytestmark = pytest.mark.campaign

URDF = """\
<?xml version="1.0"?>
<robot name="lever">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="3.0"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.15 0 0"/><mass value="1.5"/>
    <inertia ixx="0.005" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="100" velocity="5"/><dynamics damping="0.5" friction="0.2"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="50" velocity="5"/>
    <dynamics damping="0.3" friction="0.1"/></joint>
</robot>
"""
HEAVIER = 1.2  # inertias of the robot that made the record, over those of the file
TYPED_ON_ARRIVAL = """
document.addEventListener("htmx:afterSwap", () => {
  const field = document.getElementById("f-2-alpha"), wrong = document.querySelector(".wrong");
  if (window.toldWrong || !wrong) return;
  window.toldWrong = wrong.textContent;
  field.value = "-pi/2";
  field.dispatchEvent(new Event("input", { bubbles: true }));
})"""  # a key between the arrival of an answer and its settling
STATES = """
window.states = [];
new MutationObserver(() => {
  const state = document.querySelector("#certificate")?.classList[1];
  if (state !== window.states.at(-1)) window.states.push(state);
}).observe(document.body, { subtree: true, childList: true, attributes: true })"""
ADDED_AND_TYPED = """(() => {
  const type = (id, value) => {
    const field = document.getElementById(id);
    field.value = value;
    field.dispatchEvent(new Event("input", { bubbles: true }));
  };
  type("f-1-r", "0.2");
  document.querySelector("[data-act='add 2']").click();
  type("f-2-r", "0.3");
})()"""  # the answer to the click comes while the next edit waits
JOB = "[...document.querySelectorAll('.job')].map((node) => node.className)"


def go(page: Browser, address: str, width: int = 1280) -> None:
    page.resize(width, 800)
    for place in ("about:blank", address):  # the page of a server that has ended is gone first
        page.run("0")
        page.events.clear()
        page.call("Page.navigate", url=place)
        while not any(e.get("method") == "Page.loadEventFired" for e in page.events):
            page.events.append(page._next())


def until(page: Browser, script: str, seconds: float = HANG) -> Any:
    end = time.monotonic() + seconds
    while not (value := page.run(script)):
        assert time.monotonic() < end, script
        time.sleep(0.05)
    return value


def choose(page: Browser, selector: str, path: Path) -> None:
    """A file for an input, as a person chooses it."""
    page.run("delete window.here; window.here = 1")
    root = page.call("DOM.getDocument")["root"]["nodeId"]
    node = page.call("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
    page.call("DOM.setFileInputFiles", files=[str(path)], nodeId=node)
    until(page, "!window.here && document.readyState === 'complete'")  # it has loaded again


def type_in(page: Browser, ident: str, text: str) -> None:
    """Replace what a field holds, key by key."""
    page.run(f"document.getElementById({json.dumps(ident)}).select()")
    page.call("Input.insertText", text=text)


def proved(page: Browser) -> None:
    until(page, "document.querySelector('#certificate')?.classList.contains('valid')")


def quiet(page: Browser) -> None:
    assert page.complaints == []


def record(path: Path) -> Path:
    """A record of a heavier lever, in degrees."""
    robot = symgen.load_robot(path.parent / "lever.urdf")
    model = symgen.model(robot)
    t = np.arange(0, 12, 0.005)
    w = 2 * np.pi * np.outer([0.13, 0.29, 0.53], [1, 1.3])
    a = np.array([[0.9, 0.5, 0.25], [0.8, 0.6, 0.3]]).T
    angle = t[:, None, None] * w
    q, qd, qdd = (
        (f * a * w**k).sum(axis=1)
        for k, f in enumerate((np.sin(angle), np.cos(angle), -np.sin(angle)))
    )
    of_links = ("M", "XX", "YY", "ZZ", "XY", "XZ", "YZ")
    values = dict.fromkeys(model.STANDARD_PARAMETERS, 0.0) | {
        name: x * (HEAVIER if name.startswith(of_links) else 1) for name, x in robot.values.items()
    }
    tau = model.inverse_dynamics(q, qd, qdd, model.base_parameters(values))
    tau += np.random.default_rng(1).normal(0, 0.05, q.shape)
    header = "time_s,shoulder_pos_deg,elbow_pos_deg,shoulder_tau_nm,elbow_tau_nm"
    table = np.column_stack([t, np.degrees(q), tau])
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.6g")
    return path


def test_from_nothing_to_a_certified_arm_of_two_joints(
    page: Browser, running: Callable[..., Any]
) -> None:
    studio = running()
    go(page, studio.address + "robot")
    page.click("button[value='new']")
    until(page, "!!document.getElementById('f-2-alpha')")
    proved(page)
    page.run("document.getElementById('f-2-alpha').scrollIntoView()")
    page.run(STATES)
    page.click("#f-2-alpha")
    type_in(page, "f-2-alpha", "pi/2")
    until(page, "window.states.includes('stale')")
    assert "90°" in page.run("document.querySelector('#cells').textContent")
    until(page, "window.states.at(-1) === 'valid'")  # after a second of rest
    until(page, "document.body.textContent.includes('alpha of frame 2: 0 -> pi/2')")
    robot = symgen.load_robot(studio.work / "robot.yaml")
    claim = json.loads((studio.work / "proof.json").read_text())
    assert claim["valid"] and claim["count"] == len(symgen.regrouping(robot).base)
    assert page.run("document.activeElement.id") == "f-2-alpha"  # the focus stays
    page.run(ADDED_AND_TYPED)
    file = studio.work / "robot.yaml"
    wait_for(lambda: all(x in file.read_text() for x in ("q3", "r: 0.2", "r: 0.3")))
    until(
        page,
        "document.getElementById('f-3-theta') && document.getElementById('f-2-r').value === '0.3'",
    )
    page.click("[data-act='remove 3']")
    until(page, "!document.getElementById('f-3-theta')")
    assert page.run(WEAK_CONTRAST) == []
    quiet(page)


def test_a_wrong_alpha_shows_in_the_picture(page: Browser, running: Callable[..., Any]) -> None:
    """Turned the other way the wrist lies below the base; its slider moves the arm."""
    studio = running("tx40")
    go(page, studio.address + "robot")
    up = until(page, "document.querySelector('#arm svg')?.outerHTML")
    page.click("#f-2-alpha")
    type_in(page, "f-2-alpha", "pi/2")
    until(page, f"document.querySelector('#arm svg').outerHTML !== {json.dumps(up)}")
    before = page.run("document.querySelector('#arm svg').outerHTML")
    page.run("document.getElementById('s-1').focus()")
    page.press("End")
    until(page, f"document.querySelector('#arm svg').outerHTML !== {json.dumps(before)}")
    page.click("[data-key='0']")
    page.click("#f-2-alpha")
    page.run(TYPED_ON_ARRIVAL)
    type_in(page, "f-2-alpha", "-pi/")
    until(page, "window.toldWrong")
    wrong = page.run("window.toldWrong")
    assert (
        wrong.startswith("frames.2.alpha: expected")
        and page.run("document.activeElement.id") == "f-2-alpha"
    )
    until(page, "!document.querySelector('.wrong')")
    page.click("[data-key='0']")
    until(page, f"document.querySelector('#arm svg').outerHTML === {json.dumps(up)}")
    page.run("document.querySelector('form[hx-get=\"view/model\"] button').click()")
    latex = until(page, "document.querySelector('#model-latex')?.textContent")
    assert latex.strip() == subprocess.run(
        [sys.executable, "-c", "from symgen.cli.main import main; main()", "show", "tx40", "--model", "gravity", "--format", "latex-fragment"],
        capture_output=True, text=True, check=True,
    ).stdout.strip()  # fmt: skip
    quiet(page)


def test_name_and_title_are_fields_of_the_table(page: Browser, running: Callable[..., Any]) -> None:
    """A wrong name stands beside its field; undo brings the earlier one back."""
    studio = running("planar_2r")
    file = studio.work / "robot.yaml"
    before = symgen.load_robot(file)
    go(page, studio.address + "robot")
    assert until(page, "document.getElementById('r-name')?.value") == before.name
    page.click("#r-name")
    type_in(page, "r-name", "2 links")
    wrong = until(page, "document.getElementById('wrong-name')?.textContent")
    assert wrong.startswith("name: '2 links' is not a valid name")
    assert page.run("document.body.textContent.split(\"'2 links' is no\").length") == 2  # once
    assert page.run("document.activeElement.id") == "r-name"
    assert symgen.load_robot(file).name == before.name
    type_in(page, "r-name", "two_links")
    until(page, "!document.getElementById('wrong-name')")
    page.click("#r-title")
    type_in(page, "r-title", 'Bras "à" 2: <b>#1</b>')
    until(page, "document.querySelector('h1').textContent.includes('<b>#1</b>')")
    robot = symgen.load_robot(file)
    assert (robot.name, robot.title) == ("two_links", 'Bras "à" 2: <b>#1</b>')
    assert robot.frames == before.frames
    assert [p.name for p in sorted((studio.work / "history/robot").iterdir())] == ["0001", "0002"]
    for _ in range(2):
        page.click("#undo")
    until(page, f"document.getElementById('r-name')?.value === '{before.name}'")
    until(page, "document.getElementById('undo').disabled")
    assert symgen.load_robot(file) == before
    assert page.run(WEAK_CONTRAST) == []
    quiet(page)


PUMA = (  # classic: a, alpha, d; m and rad
    ("0", "pi/2", "0"),
    ("0.4318", "0", "0"),
    ("0.0203", "-pi/2", "0.15005"),
)


def test_a_classic_table_of_a_textbook_is_typed(page: Browser, running: Callable[..., Any]) -> None:
    """Typed cell by cell, its formulas are those of the same arm in a table of Khalil's; its cells
    keep their texts. A loop, which a classic table cannot have, is one sentence.
    """
    studio = running()
    file = studio.work / "robot.yaml"
    go(page, studio.address + "robot")
    page.click("button[value='new']")
    until(page, "!!document.getElementById('f-2-d') && document.readyState === 'complete'")
    page.run("document.querySelector('#cells > .row > [data-act^=add]').click()")  # it may move
    until(page, "!!document.getElementById('f-3-d')")
    heads = "[...document.querySelectorAll('.cells thead th')].map((n) => n.textContent)"
    assert page.run(heads)[7:10] == ["d, m", "θ, rad", "r, m"]
    page.run("document.getElementById('r-convention').focus()")
    page.press("ArrowDown")
    until(page, "!document.getElementById('f-1-gamma')")
    assert page.run("document.activeElement.id") == "r-convention"
    assert page.run(heads)[1:8] == ["ant", "σ", "μ", "a, mfile: d", "α, rad", "d, mfile: r", "θ, rad"]  # fmt: skip
    for j, texts in enumerate(PUMA, start=1):
        for column, text in zip(("d", "alpha", "r"), texts, strict=True):
            page.run(f"document.getElementById('f-{j}-{column}').focus()")
            type_in(page, f"f-{j}-{column}", text)
    wait_for(lambda: "0.15005" in file.read_text())
    until(page, "document.getElementById('f-3-alpha').parentNode.textContent.includes('-90°')")
    proved(page)

    khalil = symgen.load_robot(file)
    assert "\nconvention: distal" in file.read_text() and len(khalil.frames) == 4
    alpha, d, r = ([str(getattr(f, name)) for f in khalil.frames] for name in ("alpha", "d", "r"))
    assert alpha == ["0", "pi/2", "0", "-pi/2"] and r == ["0", "0", "0.15005", "0"]
    assert d == ["0", "0", "0.4318", "0.0203"]
    drawn = json.loads(page.run("document.querySelector('#figure').dataset.figure"))
    assert [f["d"] for f in drawn["frames"]] == [0, 0, 0.4318, 0.0203]

    page.run("document.querySelector('[data-act=loop]').click()")  # the table may move
    until(page, "document.querySelector('#table .no')?.textContent.includes('closed loops')")
    assert page.run("document.querySelectorAll('#table [role=alert]').length") == 1
    page.run("document.querySelector('[data-act^=unloop]').click()")
    until(page, "!document.querySelector('#table .no')")
    typed = page.run("document.getElementById('f-2-d').value")
    page.run("document.getElementById('r-convention').focus()")
    page.press("ArrowUp")
    until(page, "!!document.getElementById('f-1-gamma')")
    assert page.run("document.getElementById('f-2-d').value") == typed == "0.4318"
    assert "\nconvention" not in file.read_text() and symgen.load_robot(file) != khalil
    page.click("#undo")
    until(page, "document.getElementById('r-convention')?.value === 'distal'")
    assert symgen.load_robot(file) == khalil
    assert page.run(WEAK_CONTRAST) == []
    page.resize(390, 800)
    assert page.run("document.documentElement.scrollWidth") <= 390
    quiet(page)


COPIED = """navigator.clipboard.writeText = async (text) => { window.copied = text; }"""


@pytest.mark.parametrize(
    ("robot", "model", "typeset"),
    [("planar_2r", "inertia_matrix", "closed"), ("tx40", "inertia_matrix", "closed")],
)
def test_a_model_is_typeset_and_its_latex_is_copied(
    page: Browser, running: Callable[..., Any], robot: str, model: str, typeset: str
) -> None:
    """A closed form as such, also of 535 terms; a square is above its subscript."""
    studio = running(robot)
    go(page, studio.address + "robot")
    page.run(COPIED)
    page.run(
        f"document.querySelector('form[hx-get=\"view/model\"] [name=model]').value = '{model}'"
    )
    page.click("form[hx-get='view/model'] button")
    until(page, "document.querySelectorAll('#model math').length > 0")
    assert page.run("document.querySelectorAll('#model .steps').length > 0") == (
        typeset == "recursive"
    )
    until(page, "document.querySelectorAll('.formulas msubsup').length > 0")
    assert page.run("document.querySelectorAll('msup > msub:first-child').length") == 0
    page.click("[data-copy='#model-latex']")
    latex = until(page, "window.copied")
    assert latex.strip() == symgen.symbolic(robot).show(model, format="latex-fragment").strip()
    assert page.run(WEAK_CONTRAST) == []
    go(page, studio.address + "robot", 390)
    page.run("document.querySelector('form[hx-get=\"view/model\"] button').click()")
    until(page, "document.querySelectorAll('#model math').length > 0")
    assert page.run("document.documentElement.scrollWidth") <= 390
    quiet(page)


def test_from_urdf_and_csv_to_verdict_report_and_applied_urdf(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    (tmp_path / "lever.urdf").write_text(URDF)
    studio = running()
    go(page, studio.address + "robot")
    choose(page, "#robot-file", tmp_path / "lever.urdf")
    assert until(page, "document.querySelector('label[for=s-2]')?.textContent") == "q2 elbow"
    go(page, studio.address + "record")
    choose(page, "#record-file", record(tmp_path / "run.csv"))
    until(page, "document.querySelectorAll('#preview .plot > svg').length === 2")
    assert page.run("document.querySelector('[name=\"units.q\"]').value") == "deg"
    page.click("#questions button.main")  # the side is asked for: nothing is written
    assert page.run("document.activeElement.name") == "side"
    page.run("document.querySelector('[name=side]').value = 'joint'")
    page.run(
        "document.querySelector('[name=side]').dispatchEvent(new Event('change', {bubbles: true}))"
    )
    page.click("#questions button.main")
    until(page, "document.querySelector('#study-text')?.value.includes('side: joint')")
    assert "scale" not in (studio.work / "study.yaml").read_text()  # nothing was said of it
    go(page, studio.address + "check")
    page.click("#findings button.main")
    until(page, "document.querySelectorAll('.checks li').length > 10")
    go(page, studio.address + "solve")
    page.run("document.querySelector('[value=feasible]').checked = true")
    page.click("#solve button.main")
    until(page, "document.querySelector('#jobs').dataset.runs.split(' ').length === 2")
    until(page, "document.querySelectorAll('#compared tbody tr').length === 13")
    page.run("location.reload()")
    until(page, "document.querySelector('#jobs')?.dataset.runs.split(' ').length === 2")
    go(page, studio.address + "results", 390)
    assert page.run("document.documentElement.scrollWidth") <= 390
    until(page, "document.querySelectorAll('.plot > svg').length === 4")
    assert page.run("document.querySelector('.answer').textContent").startswith("Yes")
    values = "[...document.querySelectorAll('#compared td:nth-child(3)')].map((n) => n.textContent)"
    for text in until(page, f"{values}.length === 13 && {values}"):  # digits by the deviation
        value, sigma = text.replace("−", "-").split(" ± ")
        assert len(value.partition(".")[2]) == len(sigma.partition(".")[2]), text
        assert len(sigma.replace(".", "").lstrip("0")) == 2, text
    assert "shoulder" in page.run("document.querySelector('[data-series]').innerHTML")
    page.click("form[hx-post='do/apply'] button")
    assert "mass value" in until(page, "document.querySelector('.diff')?.textContent")
    applied = symgen.load_robot(studio.work / "applied-02-feasible.urdf").values
    given = symgen.load_robot(tmp_path / "lever.urdf").values
    assert applied["MX2"] == pytest.approx(HEAVIER * given["MX2"], rel=0.01)
    assert page.run("fetch('runs/01-ols/report.html').then((answer) => answer.headers.get('content-security-policy'))").startswith("sandbox")  # fmt: skip
    quiet(page)


def begun(page: Browser, studio: Any) -> set[int]:
    """Processes of a studio after a study of the resolution that takes hours has told how far it
    is.
    """
    go(page, studio.address + "solve")
    page.run("document.querySelector('#resolution [name=runs]').value = '100000'")
    page.click("#resolution button")
    until(page, "document.querySelector('.job.running progress')?.max > 99999")
    return children(studio.process.pid)


def test_cancel_two_pages_and_a_kill(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Cancelled, a run leaves no process and no file; killed, the server leaves what was saved, and
    its processes end; a page whose robot another one has changed says so.
    """
    studio = running("tx40", "tx40")
    own = begun(page, studio)
    assert (studio.work / ".tmp").is_dir()
    page.click(".job button")
    until(page, f"{JOB}.some((name) => name.includes('cancelled'))")
    wait_for(
        lambda: not (studio.work / ".tmp").exists() and len(children(studio.process.pid)) < len(own)
    )
    assert list((studio.work / "runs").iterdir()) == [] and not list(studio.work.glob("study-*"))

    go(page, studio.address + "robot")
    until(page, "!!document.querySelector('#cells')")
    text = (studio.work / "robot.yaml").read_text()
    (studio.work / "robot.yaml").write_text(
        text.replace("D3: 0.225", "D3: 0.3")
    )  # another page, or an editor
    page.run("fetch('do/cancel', {method: 'POST', body: ''})")
    until(page, "!document.getElementById('other').hidden")

    own = begun(page, studio)
    studio.process.send_signal(signal.SIGKILL)
    studio.process.wait()
    wait_for(lambda: not any(alive(pid) for pid in own))
    again = running(work=studio.work)
    go(page, again.address + "robot")
    assert until(page, "document.getElementById('c-0-value')?.value") == "0.3"
    assert list((studio.work / "runs").iterdir()) == []
    assert again.end(signal.SIGTERM) == 130  # as after Ctrl-C
    wait_for(lambda: not children(again.process.pid))


def test_resolution_replay_a_restart_and_a_table_beside_the_urdf(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    (tmp_path / "lever.urdf").write_text(URDF)
    lines = record(tmp_path / "run.csv").read_text().splitlines()
    (tmp_path / "other.csv").write_text("\n".join(lines[:1500]))
    names = lines[0].split(",")
    columns = {"t": names[0], "q": names[1:3], "tau": names[3:]}
    settings = {"columns": columns, "units": {"q": "deg"}, "side": "joint"}
    of = {name: [settings | {"files": [f"{name}.csv"]}] for name in ("run", "other")}
    study = {"symgen": 1, "record": of["run"], "validate": {"record": of["other"]}}
    (tmp_path / "study.yaml").write_text(json.dumps(study))
    studio = running(str(tmp_path / "lever.urdf"), str(tmp_path / "study.yaml"))
    go(page, studio.address + "solve")
    page.click("[value=feasible]")
    page.click("#solve p button")
    until(page, "document.querySelectorAll('.job').length === 2")
    page.run("document.querySelector('#resolution [name=delta]').value = '2*pi/5000, 2*pi/500'")
    page.run("document.querySelector('#resolution [name=runs]').value = '10'")
    page.click("#resolution button")
    until(page, "document.querySelector('#jobs').dataset.runs.split(' ').length === 3")
    wait_for(lambda: (studio.work / "runs" / "03-cestac" / "cestac.json").is_file())

    go(page, studio.address + "results", 390)
    until(page, "document.querySelector('figure img')?.naturalWidth > 300")
    said = page.run("[...document.querySelectorAll('.checks li')].map((node) => node.textContent)")
    assert len(said) == 2 and said[0].startswith("step 0.001257 rad")
    assert page.run("document.documentElement.scrollWidth") <= 390
    result = json.loads((studio.work / "runs" / "03-cestac" / "cestac.json").read_text())
    assert [level["run_count"] for level in result["levels"]] == [10, 10]
    answer = page.run("document.querySelector('.verdict .answer').textContent")
    assert answer == (result["enough"] or "None of the steps tried")

    go(page, studio.address + "results?run=01-ols")
    until(page, "document.querySelectorAll('.plot > svg').length === 4")
    ends = page.run("document.querySelector('#cursor').max")
    page.run("document.querySelector('#part').focus()")
    page.press("ArrowDown")
    until(page, f"document.querySelector('#cursor').max !== {json.dumps(ends)}")
    assert page.run("document.querySelector('#part').value") == "1: other.csv, validation"
    assert float(ends) > 11 and float(page.run("document.querySelector('#cursor').max")) < 7.5

    assert studio.end() == 130  # as any command that Ctrl-C ends
    again = running(work=studio.work)
    go(page, again.address + "solve")
    until(page, "document.querySelectorAll('#compared tbody tr').length === 13")
    deviations = page.run("document.querySelector('#compared tbody tr td:last-child').textContent")
    ols, feasible = (
        json.loads((studio.work / "runs" / name / "estimate.json").read_text())
        for name in ("01-ols", "02-feasible")
    )
    sigma = [(fit.get("sigma_corrected") or fit["sigma"])[0] for fit in (ols, feasible)]
    far = (feasible["X"][0] - ols["X"][0]) / np.hypot(*sigma)
    assert f"{abs(far):.1f})" in deviations and len(ols["names"]) == 13

    go(page, again.address + "robot")
    until(page, "!!document.querySelector('#robot-text')")
    page.run("document.querySelector('#robot-text').value += '\\ntitle: edited here\\n'")
    page.run("document.querySelector('#robot-text').form.requestSubmit()")
    wait_for(lambda: (studio.work / "robot.yaml").is_file())
    go(page, again.address + "results?run=02-feasible")
    assert page.run("document.querySelector('h1').textContent") == "Results"
    page.click("form[hx-post='do/apply'] button")
    assert "+++ robot.urdf" in until(page, "document.querySelector('.diff')?.textContent")
    applied = symgen.load_robot(studio.work / "applied-02-feasible.urdf").values
    given = symgen.load_robot(tmp_path / "lever.urdf").values
    assert applied["MX2"] == pytest.approx(HEAVIER * given["MX2"], rel=0.01)
    quiet(page)


def children(pid: int) -> set[int]:
    """Processes that a process has started, and theirs."""
    found: set[int] = set()
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(path.read_text().rpartition(")")[2].split()[1])
        except (OSError, ValueError):
            continue
        if parent == pid:
            found |= {int(path.parent.name), *children(int(path.parent.name))}
    return found


def processor_time(pids: set[int]) -> float:
    """Seconds of processor time that these processes have used."""
    fields = (
        Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        for pid in pids
        if alive(pid)
    )
    return sum(int(x) for field in fields for x in field[11:13]) / os.sysconf("SC_CLK_TCK")


def test_pages_and_edits_cost_little(running: Callable[..., Any]) -> None:
    """Processor time beside that of `import sympy` in the same run: the first page below three
    times, an edit of the table below 1.5 times. SciPy would add two to the first.
    """
    began = os.times()
    subprocess.run([sys.executable, "-c", "import sympy"], check=True)
    ended = os.times()
    unit = ended.children_user + ended.children_system
    unit -= began.children_user + began.children_system
    studio = running("tx40")
    pid = studio.process.pid
    before = processor_time({pid, *children(pid)})
    assert "tx40" in asked(studio, "robot").lower()
    after = processor_time({pid, *children(pid)})
    assert after - before < 3 * unit
    for k in range(10):
        text = (studio.work / "robot.yaml").read_text()
        cells = table.cells_of(text)
        cells["constants"]["D3"] = str(0.3 + k)
        digest = WorkFolder(studio.work).digest
        answer = asked(studio, "do/edit", {"digest": digest, "cells": json.dumps(cells)})
        assert f'value="{0.3 + k}"' in answer
    assert (processor_time({pid, *children(pid)}) - after) / 10 < 1.5 * unit


def asked(studio: Any, name: str, form: dict[str, str] | None = None) -> str:
    """A page, or the answer to a form, as a browser asks for it."""
    origin = {} if form is None else {"Origin": "/".join(studio.address.split("/")[:3])}
    body = None if form is None else urlencode(form).encode()
    with urlopen(Request(studio.address + name, body, origin)) as answer:
        return str(answer.read().decode())


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_for(holds: Callable[[], bool], seconds: float = HANG) -> None:
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)


# --- the same numbers ---


def tx40_study() -> dict[str, Any]:
    from runtime.reading.datasets import dataset_study

    return dict(dataset_study("tx40"))


@pytest.mark.parametrize("name", ["tx40", "kr300"])
def test_the_numbers_are_those_of_the_command_line(studio: Any, tmp_path: Path, name: str) -> None:
    """To the last digit: estimate.json but for the names of files."""
    if name == "tx40":
        studio.post("packaged", {"name": "tx40"})
        values = tx40_study()
    else:
        studio.upload("robot", "kr300.yaml", kr300.robot_text().encode())
        studio.upload("record", "A.mat", (kr300.DATA / "A.mat").read_bytes())
        values = kr300.study("A")
        for part in values["record"] if isinstance(values["record"], list) else [values["record"]]:
            part["files"] = ["record/A.mat"]
    values = json.loads(json.dumps(values))
    assert studio.post("study", {"values": json.dumps(values)}).status_code == 200
    assert (
        studio.post(
            "solve", {"values": json.dumps(values), "name": "ols", "anyway": "1"}
        ).status_code
        == 200
    )
    run = studio.path / "runs" / "01-ols"
    wait_for(lambda: (run / "estimate.json").is_file() or "failed" in studio.get("jobs").text)
    (tmp_path / "by_hand").mkdir()
    (tmp_path / "by_hand" / "study.yaml").write_text(yaml_text(values))
    (tmp_path / "by_hand" / "record").mkdir()
    for file in ("robot.yaml", "record/A.mat"):
        if (studio.path / file).is_file():
            (tmp_path / "by_hand" / file).write_bytes((studio.path / file).read_bytes())
    subprocess.run(
        [sys.executable, "-P", "-c", "from symgen.cli.main import main; main()", "identify", "robot.yaml", "study.yaml", "-o", "out"],
        cwd=tmp_path / "by_hand", env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}, capture_output=True, check=False,
    )  # fmt: skip
    ours, theirs = (
        (path / "estimate.json").read_text() for path in (run, tmp_path / "by_hand" / "out")
    )
    assert ours == theirs
