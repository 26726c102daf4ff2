"""What goes wrong while one works, in a browser: each is told where one looks, and nothing is lost."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser
from test_browser import URDF, asked, choose, go, record, type_in, until, wait_for

from symgen.studio.folder import WorkFolder

pytestmark = pytest.mark.campaign


def lever(folder: Path, **more: Any) -> tuple[str, str]:
    """A robot of two joints and a study of its record, as arguments of the command line."""
    (folder / "lever.urdf").write_text(URDF)
    names = record(folder / "run.csv").read_text().partition("\n")[0].split(",")
    columns = {"t": names[0], "q": names[1:3], "tau": names[3:]}
    settings = {"files": ["run.csv"], "columns": columns, "units": {"q": "deg"}, "side": "joint"}
    (folder / "study.yaml").write_text(json.dumps({"symgen": 1, "record": settings | more}))
    return str(folder / "lever.urdf"), str(folder / "study.yaml")


def test_a_check_that_fails_says_why(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Where it refuses its input, and where it breaks (exit code 1, as a verdict of no)."""
    studio = running(*lever(tmp_path, columns={"q": ["no", "such"], "tau": ["no", "such"]}))
    alert = "document.querySelector('#findings [role=alert]')?.textContent"
    go(page, studio.address + "check")
    page.click("#findings button.main")
    assert "no such" in until(page, alert) or "column" in page.run(alert)
    studio.end()
    again = running(*lever(tmp_path))
    (again.work / "check.json").mkdir()
    go(page, again.address + "check")
    page.click("#findings button.main")
    assert "check.json" in until(page, alert)


MESSAGE = "document.querySelector('#message').textContent"


def test_errors_in_a_row_are_each_told_and_stay(page: Browser, running: Callable[..., Any]) -> None:
    """Of the table after a conflict of two pages, until it is loaded again; of the study."""
    studio = running("tx40", "tx40")
    file = studio.work / "robot.yaml"
    go(page, studio.address + "robot")
    until(page, "!!document.querySelector('#cells')")
    file.write_text(file.read_text().replace("D3: 0.225", "D3: 0.3"))  # another page, or an editor
    for text in ("0.1", "0.2"):
        page.run("document.querySelector('#message').replaceChildren()")
        type_in(page, "f-2-alpha", text)
        until(page, f"{MESSAGE}.includes('another page')")
    page.run("fetch('do/cancel', {method: 'POST', body: ''})")  # news: parts load again
    until(page, "!document.getElementById('other').hidden")
    assert "another page" in page.run(MESSAGE)
    page.click("#other a")
    until(
        page,
        "document.getElementById('c-0-value')?.value === '0.3' && !!document.querySelector('#arm svg')",
        10,
    )
    page.click("#f-2-alpha")
    type_in(page, "f-2-alpha", "0.25")
    wait_for(lambda: "alpha: 0.25" in file.read_text())
    go(page, studio.address + "record")
    for text, said in (("record: 5", "record"), ("signals: 7", "signals")):
        page.run(f"document.querySelector('#study-text').value = {text!r}")
        page.run("document.querySelector('#study-text').form.requestSubmit()")
        below = "document.querySelector('#study-text + .wrong')?.textContent"
        until(page, f"{below}?.includes({said!r})")


def give(page: Browser, selector: str, path: Path) -> None:
    """A file for an input, as a person chooses it, without waiting for what comes of it."""
    root = page.call("DOM.getDocument")["root"]["nodeId"]
    node = page.call("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
    page.call("DOM.setFileInputFiles", files=[str(path)], nodeId=node)


def answering(page: Browser, answer: str) -> None:
    """Whoever is asked answers so; what was asked is in `asked`."""
    page.run(
        f"window.asked = []; window.confirm = (text) => {{ asked.push(text); return {answer}; }}"
    )


def test_no_robot_is_lost(page: Browser, running: Callable[..., Any], tmp_path: Path) -> None:
    """A file that is none leaves the robot; one that is, or another robot, is asked for, and what was
    there comes back, with its draft; so does a frame that was removed.
    """
    (tmp_path / "empty.urdf").write_bytes(b"")
    (tmp_path / "lever.urdf").write_text(URDF)
    studio = running("tx40")
    file, draft = studio.work / "robot.yaml", studio.work / "robot.draft.yaml"
    before = file.read_text()
    place = studio.address + "robot"

    def loaded() -> None:
        until(
            page,
            "!window.asked && !!document.querySelector('#cells') && document.readyState === 'complete'",
            20,
        )

    go(page, place)
    answering(page, "true")
    give(page, "#robot-file", tmp_path / "empty.urdf")
    until(page, f"{MESSAGE} && !{MESSAGE}.includes('sending')")
    assert file.read_text() == before and not (studio.work / "robot.urdf").exists()
    go(page, place)
    page.click("#f-2-alpha")
    type_in(page, "f-2-alpha", "pi/")
    wait_for(draft.is_file)
    for ask in (
        lambda: page.click("button[value='new']"),
        lambda: page.run(
            "document.querySelector('button[value=new]').previousElementSibling.click()"
        ),
        lambda: give(page, "#robot-file", tmp_path / "lever.urdf"),
    ):
        go(page, place)
        page.run("document.querySelector('details.start').open = true")
        answering(page, "false")
        ask()
        until(page, "asked.length === 1")
    assert file.read_text() == before and draft.is_file()

    page.run("document.querySelector('details.start').open = true")
    answering(page, "true")
    page.click("button[value='new']")
    loaded()
    assert file.read_text() != before and not draft.exists()
    page.click("#undo")
    wait_for(draft.is_file)
    assert file.read_text() == before and "pi/" in draft.read_text()
    page.click("#undo")  # to before the draft
    wait_for(lambda: not draft.exists())
    go(page, place)
    page.click("[data-act='remove 6']")
    until(page, "!document.getElementById('f-6-theta')")
    page.click("#undo")
    until(page, "!!document.getElementById('f-6-theta')")
    assert file.read_text() == before
    page.click("#redo")
    until(page, "!document.getElementById('f-6-theta')")


FIELD = "document.querySelector('#questions [name=\"{}\"]').value"


def test_columns_of_a_log_are_one_family_each(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Target and actual side by side, as UR robots write them, as by `identify --suggest`; units with
    other names stand in the form too.
    """
    lever(tmp_path)
    columns = np.loadtxt(tmp_path / "run.csv", delimiter=",", skiprows=1)
    families = ("target_q", "actual_q", "target_current", "actual_current")
    names = [
        f"{family}_{j} [{'°' if '_q' in family else 'A'}]" for j in (0, 1) for family in families
    ]
    table = columns[:, [0, 1, 1, 3, 3, 2, 2, 4, 4]]
    np.savetxt(
        tmp_path / "rtde.csv",
        table,
        delimiter=",",
        comments="",
        header=",".join(["timestamp", *names]),
    )
    studio = running(str(tmp_path / "lever.urdf"))
    go(page, studio.address + "record")
    choose(page, "#record-file", tmp_path / "rtde.csv")
    until(page, "document.querySelectorAll('#preview .plot > svg').length === 2")
    assert page.run(FIELD.format("columns.t")) == "timestamp"
    assert page.run(FIELD.format("columns.q")) == "actual_q_0 [°], actual_q_1 [°]"
    assert page.run(FIELD.format("columns.tau")) == "actual_current_0 [A], actual_current_1 [A]"
    assert [page.run(FIELD.format(f"units.{key}")) for key in ("q", "tau")] == ["°", "A"]
    shown = page.run(
        "[...document.querySelectorAll('#preview th')].map((node) => node.textContent)"
    )
    assert len(shown) == 5 and not [name for name in shown if "target" in name]
    shown = "document.querySelector('[name={}]').checkVisibility()"
    asks = [page.run(shown.format(name)) for name in ("torque_constant", "rate")]
    assert asks == [True, False]  # A needs one; the rate is that of the time column
    pick(page, "columns.t", "")
    pick(page, "units.tau", "N*m")
    asks = [page.run(shown.format(name)) for name in ("torque_constant", "rate")]
    assert asks == [False, True]


def test_solve_waits_for_a_check(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Without one, and with one of another study, it asks for it first; `anyway` goes on."""
    studio = running(*lever(tmp_path))
    words = "[...document.querySelectorAll('#solve p .main, #solve p button')].map((n) => n.textContent)"
    go(page, studio.address + "solve")
    assert page.run(words) == ["Check first", "Solve anyway"]
    assert "anyway" in page.run("document.querySelector('#resolution button').textContent")
    page.run(  # a page that was loaded before the study changed
        "fetch('do/solve', {method: 'POST', headers: {'content-type': "
        "'application/x-www-form-urlencoded'}, body: 'kind=identify'}).then(async (answer) => "
        "{ window.answer = await answer.text(); })"
    )
    assert "check" in until(page, "window.answer")
    page.click("#solve .main")
    until(
        page,
        "document.querySelector('#findings button.main') && document.readyState === 'complete'",
        10,
    )
    page.click("#findings button.main")
    until(page, "document.querySelectorAll('.checks li').length > 10")
    go(page, studio.address + "solve")
    assert page.run(words) == ["Solve"]
    digest = WorkFolder(studio.work).study_digest
    asked(studio, "do/study", {"text": "symgen: 1\n", "digest": digest})
    wait_for(lambda: (studio.work / "study.yaml").read_text() == "symgen: 1\n")
    go(page, studio.address + "solve")
    assert page.run(words) == ["Check first", "Solve anyway"]


def pick(page: Browser, name: str, value: str) -> None:
    """A choice of the questions, as a person makes it."""
    field = f"document.querySelector('#questions [name=\"{name}\"]')"
    page.run(f"{field}.value = {json.dumps(value)}")
    page.run(f"{field}.dispatchEvent(new Event('change', {{bubbles: true}}))")


def test_decimal_commas(page: Browser, running: Callable[..., Any], tmp_path: Path) -> None:
    """Read, asked and written; the first rows and the plots are those of what the form says."""
    lever(tmp_path)
    text = (tmp_path / "run.csv").read_text().replace(",", ";").replace(".", ",")
    header, _, rows = text.partition("\n")
    (tmp_path / "excel.csv").write_text(f"{header.replace('time_s', 'Zeit [s]')}\n{rows}")
    studio = running(str(tmp_path / "lever.urdf"))
    go(page, studio.address + "record")
    choose(page, "#record-file", tmp_path / "excel.csv")
    plots = "document.querySelectorAll('#preview .plot > svg').length === 2"
    until(page, plots)
    assert page.run(FIELD.format("decimal")) == ","
    assert "step 0.005 s" in page.run("document.querySelector('#preview').textContent")
    pick(page, "decimal", ".")
    until(
        page,
        "document.querySelector('#preview .no')?.textContent.includes('expected a number')",
        10,
    )
    pick(page, "decimal", ",")
    pick(page, "units.t", "ms")
    until(page, "document.querySelector('#preview').textContent.includes('step 5e-06 s')")
    pick(page, "units.t", "s")
    pick(page, "columns.q", "elbow_pos_deg")
    until(page, "document.querySelectorAll('#preview th').length === 4")
    pick(page, "columns.q", "shoulder_pos_deg, elbow_pos_deg")
    pick(page, "side", "joint")
    page.click("#questions button.main")
    until(page, "document.querySelector('#study-text')?.value.includes('side: joint')")
    until(page, "!!document.querySelector('#study-text').form['htmx-internal-data']")  # settled
    assert WorkFolder(studio.work).study()["record"][0]["decimal"] == ","
    text = "record: {files: [record/excel.csv], decimal: ',', columns: {q: [elbow_pos_deg]}}"
    page.run(f"document.querySelector('#study-text').value = {json.dumps(text)}")
    page.run("document.querySelector('#study-text').form.requestSubmit()")
    until(page, "document.querySelectorAll('#preview th').length === 4")
    assert page.run(FIELD.format("columns.q")) == "elbow_pos_deg"


def solved(studio: Any, *methods: str) -> None:
    """Runs 01-METHOD, 02-METHOD ... of a studio, without its page."""
    work = WorkFolder(studio.work)  # it clears away what a killed run has left
    for method in methods:
        study = work.study() | {"estimate": {"method": method}}
        form = {"values": json.dumps(study), "name": method, "anyway": "1"}
        asked(studio, "do/solve", form)
    wait_for(lambda: len(work.results()) == len(methods))


def test_each_run_has_its_own_changes_of_the_file(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Shown where they were asked for, and kept side by side."""
    studio = running(*lever(tmp_path))
    solved(studio, "feasible", "ols")
    diff = "document.querySelector('.diff')?.textContent"
    go(page, studio.address + "results?run=01-feasible")
    page.click("form[hx-post='do/apply'] button")
    until(page, diff)
    go(page, studio.address + "results?run=02-ols")
    assert not page.run(diff)
    page.run("fetch('do/cancel', {method: 'POST', body: ''})")  # news: parts load again
    page.run("new Promise((done) => setTimeout(done, 800))")
    assert not page.run(diff)
    go(page, studio.address + "results?run=01-feasible")
    assert page.run(diff)
    link = page.run("document.querySelector('#applied a').getAttribute('href')")
    assert link == "file/applied-01-feasible.urdf" and "mass" in asked(studio, link)


OWN_CLOCK = """
let clock = 0;
const ticking = new Map();
performance.now = () => clock;
window.setInterval = (tick) => { ticking.set(ticking.size + 1, tick); return ticking.size; };
window.clearInterval = (number) => ticking.delete(number);
window.passed = (seconds) => {
  for (let k = 0; k < 20 * seconds; k++) { clock += 50; [...ticking.values()].forEach((tick) => tick()); }
};"""  # the time of Play, which passes when a test says so


THINNED = """
const whole = window.fetch;
window.fetch = async (address, ...more) => {
  const answer = await whole(address, ...more);
  if (!String(address).includes("view/series")) return answer;
  const value = await answer.json();
  const kept = (text, Kind = Float32Array) => btoa(String.fromCharCode(...new Uint8Array(floats(text, Kind).filter((_, k) => k % 30 === 0).buffer)));
  for (const key of ["q", "measured", "predicted"]) value[key] = value[key].map((row) => kept(row));
  return new Response(JSON.stringify({ ...value, t: kept(value.t, Float64Array) }));
};
document.querySelector("#part").dispatchEvent(new Event("change"))"""


def test_play_runs_in_time_however_far_apart_the_instants_are(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Here 0.45 s, as of a record of six minutes; it stays where it is stopped."""
    studio = running(*lever(tmp_path))
    solved(studio, "ols")
    go(page, studio.address + "results")
    until(page, "document.querySelectorAll('.plot > svg').length === 4")
    line = "document.querySelector('.plot .line').getAttribute('d')"
    whole = page.run(line)
    page.run(THINNED)
    until(page, f"{line} !== {json.dumps(whole)}")
    page.run(OWN_CLOCK)
    cursor = "Number(document.querySelector('#cursor').value)"
    before = page.run(cursor)
    page.click("#play")
    page.run("passed(3.0)")
    assert page.run(cursor) == pytest.approx(before + 3.0, abs=0.5)  # an instant, 0.45 s
    stopped = page.run(cursor)
    page.click("#play")
    page.run("passed(0.2)")
    assert page.run(cursor) == stopped


def test_a_flipped_sign_is_turned_by_one_click(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Of a robot whose joints have names; the remedy is the one of that joint, and helps."""
    settings = lever(tmp_path)
    header, *rows = (tmp_path / "run.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    turned = [",".join([*row[:4], str(-float(row[4]))]) for row in cells]
    (tmp_path / "run.csv").write_text("\n".join([header, *turned]))
    studio = running(*settings)
    go(page, studio.address + "check")
    page.click("#findings button.main")
    until(page, "document.querySelectorAll('.checks li').length > 10")
    remedies = (
        "[...document.querySelectorAll('[data-change] button')].map((node) => node.textContent)"
    )
    shown = until(page, f"{remedies}.length && {remedies}")
    assert shown == ["Multiply record.scale.tau by 1, -1"]  # each remedy once
    page.click("[data-change] button")
    wait_for(
        lambda: WorkFolder(studio.work).study()["record"][0].get("scale", {}).get("tau") == [1, -1],
        10,
    )
    until(
        page,
        "!document.querySelector('#findings .busy') && !document.querySelector('[data-change] button')",
        60,
    )


def test_a_gain_that_is_a_name_is_not_multiplied(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Of a MATLAB file, as gtau of EMPS: one sentence in place of the button; numbers have one."""
    studio = running(*lever(tmp_path, scale={"tau": "gtau"}))
    cause = {"cause": "signs", "remedy": "turn", "change": {"record.scale.tau": [1, -1]}}
    findings = {"checks": [], "named": [{}, cause], "deviations": {}, "rank": 1, "count": 1}
    (studio.work / "check.json").write_text(json.dumps(findings))
    shown = "document.querySelector('[data-change*=scale] > :last-child')?.textContent"
    go(page, studio.address + "check")
    until(page, "!!document.querySelector('[data-change*=scale]')")
    assert page.run(shown) == (
        "record.scale.tau is the name gtau, which this page cannot multiply by 1, -1: "
        "on Record, write the product as numbers."
    )
    assert page.run("!document.querySelector('[data-change] button')")
    study = WorkFolder(studio.work).study()
    study["record"][0]["scale"]["tau"] = [2, 3]
    (studio.work / "study.yaml").write_text(json.dumps(study))
    go(page, studio.address + "check")
    page.click("[data-change] button")
    wait_for(lambda: WorkFolder(studio.work).study()["record"][0]["scale"]["tau"] == [2, -3])


def test_results_have_the_values_of_the_robot_file_as_the_report_has(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Where the file has changed since, they are those of the run's own copy, and the page says so."""
    studio = running(*lever(tmp_path))
    solved(studio, "ols")
    rows = "[...document.querySelectorAll('{} tr')].map((row) => [...row.cells].map((cell) => cell.textContent))"
    go(page, studio.address + "results")
    until(page, "document.querySelectorAll('#compared th[scope=col]').length === 5")
    (head, *shown) = page.run(rows.format("#compared"))
    assert head[3:] == ["robot file", "difference %"] and "95 %" in page.run("document.querySelector('#compared .note').textContent")  # fmt: skip
    page.call("Page.navigate", url=studio.address + "runs/01-ols/report.html")
    script = "[...document.querySelectorAll('table')].find((table) => table.textContent.includes('difference %'))"
    until(page, f"!!{script}")
    page.run(f"{script}.id = 'every'")
    (titles, *written) = page.run(rows.format("#every"))
    title = [text.split("\n")[0].strip() for text in titles]
    value, given, change = map(title.index, ("value", "robot file", "difference %"))
    assert len(shown) == len(written) == 13 and shown[1][4].startswith("+")
    for ours, theirs in zip(shown, written, strict=True):
        assert [x.replace("−", "-") for x in ours[3:]] == [theirs[given], theirs[change]]
        number = ours[2].partition(" ± ")[0].replace("−", "-")
        assert (number == "–") == (theirs[value] == "")
        if number != "–":
            assert float(number) == pytest.approx(float(theirs[value]), rel=0.02, abs=1e-3)
    robot = studio.work / "robot.urdf"
    robot.write_text(robot.read_text().replace('value="3.0"', 'value="4.0"'))
    go(page, studio.address + "results")
    until(page, "document.querySelector('main .doubtful')?.textContent.includes('has changed')")
    until(page, "document.querySelectorAll('#compared th[scope=col]').length === 5")
    assert page.run(rows.format("#compared"))[1:] == shown  # of the run's own robot


def press(page: Browser, study: Path) -> None:
    """Click a remedy until it has changed the study: late news may replace the button meanwhile."""
    button, before = "document.querySelector('[data-change] button')", study.read_text()

    def changed_or_replaced() -> bool:
        return study.read_text() != before or not page.run("window.pressed?.isConnected")

    while study.read_text() == before:
        until(page, f"!!(window.pressed = {button})")
        page.click("[data-change] button")
        wait_for(changed_or_replaced)


def test_units_that_differ_by_joint_are_set_by_one_click_each(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """The elbow alone is in rad and N mm; each click sets the unit of this joint, and helps."""
    settings = lever(tmp_path)
    header = (tmp_path / "run.csv").read_text().partition("\n")[0]
    table = np.loadtxt(tmp_path / "run.csv", delimiter=",", skiprows=1) * [
        1,
        1,
        np.pi / 180,
        1,
        1e3,
    ]
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", comments="", header=header, fmt="%.8g")
    studio = running(*settings)
    go(page, studio.address + "check")
    page.click("#findings button.main")
    button, clicked = "document.querySelector('[data-change] button')", []
    busy = (
        "/have changed since|running|waiting/.test(document.querySelector('#findings').textContent)"
    )
    found = studio.work / "check.json"
    for _ in range(2):
        clicked.append(until(page, f"!{busy} && {button}?.textContent"))
        before = found.read_text()
        press(page, studio.work / "study.yaml")
        wait_for(lambda was=before: found.read_text() != was)
    assert sorted(clicked) == ["Set record.units.q: deg, rad", "Set record.units.tau: N*m, N*mm"]
    until(page, f"!{busy} && !{button}")
    units = {"q": ["deg", "rad"], "tau": ["N*m", "N*mm"]}
    assert WorkFolder(studio.work).study()["record"][0]["units"] == units | {"t": "s"}


def test_two_pages_do_not_overwrite_their_studies(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """The older page is told, and its text stays to be copied."""
    studio = running(*lever(tmp_path))
    file = studio.work / "study.yaml"
    go(page, studio.address + "record")
    other = file.read_text() + "# of another page\n"
    asked(studio, "do/study", {"text": other, "digest": WorkFolder(studio.work).study_digest})
    page.run("document.querySelector('#study-text').value += '# mine'")
    page.run("document.querySelector('#study-text').form.requestSubmit()")
    until(page, f"{MESSAGE}.includes('another page has changed the study')")
    assert file.read_text() == other
    assert page.run("document.querySelector('#study-text').value").endswith("# mine")
    go(page, studio.address + "record")
    page.run("document.querySelector('#study-text').value += '# mine'")
    page.run("document.querySelector('#study-text').form.requestSubmit()")
    wait_for(lambda: file.read_text().endswith("# mine"))


def test_a_server_that_has_ended_is_told_at_once(
    page: Browser, running: Callable[..., Any]
) -> None:
    studio = running("planar_2r")
    go(page, studio.address + "robot")
    until(page, "!!document.querySelector('#cells')")
    studio.end()
    until(page, f"{MESSAGE}.includes('server has ended')")


def test_quick_clicks_add_as_many_frames(page: Browser, running: Callable[..., Any]) -> None:
    studio = running("planar_2r")
    go(page, studio.address + "robot")
    until(page, "!!document.querySelector('[data-act^=add]')")
    page.run("for (let k = 0; k < 3; k++) document.querySelector('[data-act^=add]').click()")
    until(page, "!!document.querySelector('#f-5-alpha')")
    wait_for(lambda: any("q5" in p.read_text() for p in studio.work.glob("robot*.yaml")))


def test_a_model_leaves_with_its_choice(page: Browser, running: Callable[..., Any]) -> None:
    """An old result does not stay under a new choice, and work shows that it is done."""
    studio = running("planar_2r")
    go(page, studio.address + "robot")
    result = "document.querySelector('#model').textContent.trim()"
    page.run("document.querySelector('[hx-target=\"#model\"] button').click()")
    assert "deriving" in until(page, result)
    until(page, f"{result}.includes('GAM') || {result}.includes('Q')")
    page.run(
        "const s = document.querySelector('[hx-target=\"#model\"] select'); s.value = 'closure';"
        "s.dispatchEvent(new Event('change', {bubbles: true}))"
    )
    assert page.run(result) == ""


def test_a_validation_record_leaves_the_answers(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    studio = running(lever(tmp_path)[0])
    record(tmp_path / "second.csv")
    go(page, studio.address + "record")
    give(page, "#record-file", tmp_path / "run.csv")
    until(page, "!!document.querySelector('#preview table')")
    typed = "document.querySelector('#questions [name=\"columns.q\"]').value"
    page.run(f"{typed} = 'b, a'")
    page.run("document.querySelector('details.start').open = true")
    give(page, "#validation-file", tmp_path / "second.csv")
    until(page, "document.querySelector('[data-named] b').textContent === 'second.csv'")
    assert (
        page.run("document.querySelector('#values').dataset.validation") == "validation/second.csv"
    )
    assert page.run(typed) == "b, a"


def test_a_draft_says_why_there_are_no_formulas(page: Browser, running: Callable[..., Any]) -> None:
    studio = running("planar_2r")
    go(page, studio.address + "robot")
    until(page, "!!document.querySelector('#cells')")
    page.click("#f-2-alpha")
    type_in(page, "f-2-alpha", "pi/")
    wait_for((studio.work / "robot.draft.yaml").is_file)
    go(page, studio.address + "robot")
    until(page, "document.body.textContent.includes('when the table describes a robot')")
