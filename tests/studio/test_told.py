"""What the page says: errors beside their fields, all of a table at once, and what is taken along."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import WEAK_CONTRAST, Browser
from test_browser import COPIED, go, until
from test_mishaps import MESSAGE, give, lever

import symgen
from symgen.description import packaged_robots
from symgen.studio import table
from symgen.studio.folder import WorkFolder

WRONG = {  # a cell, what is typed, and a word of what is said
    "frames.2.alpha": ("pi/", "end of text"),
    "frames.3.sigma": ("7", "sigma = 7"),
    "frames.4.d": ("D9", "undeclared symbol 'D9'"),
    "frames.6.theta": ("q5", "expected q6 once"),
    "constants.D3": ("abc", "undeclared symbol 'abc'"),
    "gravity.0": ("x+", "undeclared symbol 'x'"),
    "name": ("2 x", "not a valid name"),
}


def with_wrong(text: str, places: Any) -> str:
    """The text of a robot with wrong cells."""
    cells = table.cells_of(text)
    for place in places:
        *keys, last = (int(k) if k.isdigit() and place[0] == "g" else k for k in place.split("."))
        at = cells
        for key in keys:
            at = at[key]
        at[last] = WRONG[place][0]
    return table.with_cells(text, json.dumps(cells))


@pytest.mark.parametrize("count", range(len(WRONG) + 1))
def test_all_errors_of_a_table_are_found_and_no_others(tmp_path: Path, count: int) -> None:
    """Of the TX40: as many as there are, each at its cell, whichever comes first."""
    work = WorkFolder(tmp_path)
    work.take_robot_of("tx40")
    places = [*WRONG][-count:] if count else []
    found = table.errors(with_wrong(work.read("robot.yaml"), places))
    assert {".".join(map(str, e.path)) for e in found} == {*places}
    for error in found:
        assert WRONG[".".join(map(str, error.path))][1] in error.message


@pytest.mark.parametrize("robot", packaged_robots())
def test_one_wrong_cell_is_one_error(tmp_path: Path, robot: str) -> None:
    """In every row of every packaged robot: a usual value in its place makes no further error."""
    work = WorkFolder(tmp_path)
    work.take_robot_of(robot)
    text = work.read("robot.yaml")
    for j in table.cells_of(text)["frames"]:
        cells = table.cells_of(text)
        cells["frames"][j]["alpha"] = "pi/"
        (error,) = table.errors(table.with_cells(text, json.dumps(cells)))
        assert error.path == ("frames", int(j), "alpha")


@pytest.mark.campaign
def test_the_page_tells_all_errors_beside_their_cells(
    page: Browser, running: Callable[..., Any]
) -> None:
    studio = running("tx40")
    file = studio.work / "robot.yaml"
    (studio.work / "robot.draft.yaml").write_text(with_wrong(file.read_text(), WRONG))
    go(page, studio.address + "robot")
    until(page, f"document.querySelectorAll('#table .wrong').length === {len(WRONG)}")
    marked = page.run(
        "[...document.querySelectorAll('#cells [aria-invalid]')].map((cell) => cell.dataset.cell)"
    )
    assert {*marked} == {place for place in WRONG if place[0] in "fn"}
    assert f"{len(WRONG)} cells are wrong" in page.run("document.querySelector('#table').innerText")
    assert page.run(WEAK_CONTRAST) == []


@pytest.mark.campaign
def test_a_setting_is_told_beside_its_field(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """A question, a cut-off, a number of runs; in the text below it, with its line selected."""
    studio = running(*lever(tmp_path))
    wrong = "document.querySelector('.wrong')?.textContent"
    go(page, studio.address + "solve")
    for field, text, button in (
        ("cutoff", "ten", "#solve button[name=anyway]"),
        ("runs", "-3", "#resolution button"),
    ):
        until(page, f"!!document.querySelector('[name={field}]')")
        page.run(f"document.querySelector('[name={field}]').value = {text!r}")
        page.click(button)
        assert "expected" in until(page, wrong) and "study" not in page.run(wrong)
        assert page.run("document.activeElement.name") == field and page.run(MESSAGE) == ""
        page.run(
            "document.activeElement.dispatchEvent(new Event('input', {bubbles: true}))"
        )  # it leaves with the next key
        assert not page.run(wrong)
    go(page, studio.address + "record")
    until(page, "!!document.querySelector('#study-text')")
    page.run("document.querySelector('#study-text').value = 'symgen: 1\\nsignals:\\n  median: two'")
    page.run("document.querySelector('#study-text').form.requestSubmit()")
    assert until(page, wrong).startswith("line 3: signals.median: ")
    picked = "(() => { const t = document.activeElement; return t.value.slice(t.selectionStart, t.selectionEnd); })()"
    assert page.run(picked) == "  median: two"
    assert page.run("!document.querySelector('#questions') || true")


@pytest.mark.campaign
def test_a_question_is_told_beside_itself(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    studio = running(lever(tmp_path)[0])
    go(page, studio.address + "record")
    give(page, "#record-file", tmp_path / "run.csv")
    until(page, "!!document.querySelector('#preview table')")
    for name, value in {"side": "joint", "scale.tau": "1, x y"}.items():
        page.run(f"document.querySelector('[name=\"{name}\"]').value = '{value}'")
        page.run(
            f"document.querySelector('[name=\"{name}\"]').dispatchEvent(new Event('change', {{bubbles: true}}))"
        )
    page.click("#questions button.main")
    until(page, "!!document.querySelector('[name=\"scale.tau\"] + .wrong')")
    assert not (studio.work / "study.yaml").exists()


@pytest.mark.campaign
def test_a_log_of_six_joints_on_a_robot_of_two_is_told(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """In UTF-16, of a robot without names of joints: no column is filled in."""
    t = np.arange(0, 2, 0.01)
    values = np.column_stack([t, *(np.sin((k + 1) * t) for k in range(12))])
    names = ["time_s", *(f"J{j} Pos deg" for j in range(1, 7)), *(f"J{j} Torque Nm" for j in range(1, 7))]  # fmt: skip
    rows = [",".join(names), *(",".join(f"{x:.6g}" for x in row) for row in values)]
    (tmp_path / "six.csv").write_text("\n".join(rows), encoding="utf-16")
    studio = running("planar_2r")
    go(page, studio.address + "record")
    give(page, "#record-file", tmp_path / "six.csv")
    said = until(page, "document.querySelector('#preview .doubtful')?.textContent")
    assert said.startswith("The names show positions of 6 joints and torques of 6; the robot has 2")
    assert page.run("document.querySelector('[name=\"columns.q\"]').value") == ""
    assert page.run("document.querySelector('[name=\"columns.t\"]').value") == "time_s"


@pytest.mark.campaign
def test_few_runs_decide_nothing_and_one_click_runs_more(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    studio = running(*lever(tmp_path))
    go(page, studio.address + "solve")
    for field, text in (("delta", "2*pi/2000"), ("runs", "3")):
        page.run(f"document.querySelector('#resolution [name={field}]').value = {text!r}")
    page.click("#resolution button")
    work = WorkFolder(studio.work)
    until(page, "document.querySelector('#jobs').dataset.runs === '01-cestac'")
    few = work.about(work.results()[0])["few"]
    assert few["runs"] == 3 and few["needed"] > 3
    go(page, studio.address + "results")
    said = page.run("document.querySelector('.verdict .answer').textContent")
    assert said == f"3 runs decide nothing: run {few['needed']}"
    page.click(".verdict button")
    until(page, "document.querySelector('#jobs')?.dataset.runs.includes('02-cestac')")
    (level,) = json.loads((studio.work / "runs/02-cestac/cestac.json").read_text())["levels"]
    assert level["run_count"] == few["needed"]


@pytest.mark.campaign
def test_formulas_certificate_and_figures_are_taken_along(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Each link gives its file; a long closed form is what is shown where it is chosen."""
    studio = running("tx40")
    go(page, studio.address + "robot")
    page.run(COPIED)
    until(page, "!!document.querySelector('#base-latex')")
    for kind, form in {"latex": "latex-fragment", "sympy": "sympy", "text": "text"}.items():
        page.run("delete window.copied")
        page.click(f"[data-copy='#base-{kind}']")
        copied = until(page, "window.copied")
        shown = symgen.symbolic("tx40").show("base_parameters", format=form)
        assert copied.strip() == shown.strip()
    until(page, "document.querySelector('#certificate')?.classList.contains('valid')")
    href = page.run("document.querySelector('#certificate a').getAttribute('href')")
    opened = page.run(
        f"fetch('{href}').then(async (answer) => [answer.headers.get('content-type'), await answer.text()])"
    )
    assert opened[0].startswith("text/plain")
    assert opened[1] == (studio.work / "proof.json").read_text()
    page.run(
        "document.querySelector('form[hx-get=\"view/model\"] [name=model]').value = 'inertia_matrix'"
    )
    page.click("form[hx-get='view/model'] button")
    until(page, "document.querySelectorAll('#model math').length > 0")
    closed = symgen.symbolic("tx40").model("inertia_matrix").closed
    assert page.run("document.querySelectorAll('#model .steps').length") == 0
    assert page.run("document.querySelectorAll('#model dt').length") >= len(closed.entries)
    assert page.run("document.querySelector('#model .scroll').clientHeight") > 400
    page.run(
        "document.querySelector('form[hx-get=\"view/model\"] [name=model]').value = 'inverse_dynamics'"
    )
    page.click("form[hx-get='view/model'] button")
    until(page, "document.querySelector('#model-text')?.closest('details').open")
    assert "terms; it is shown as text" in page.run("document.querySelector('#model').textContent")


@pytest.mark.campaign
def test_figures_of_a_run_have_links(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    studio = running(*lever(tmp_path))
    go(page, studio.address + "solve")
    page.click("#solve button[name=anyway]")
    until(page, "document.querySelector('#jobs').dataset.runs === '01-ols'")
    go(page, studio.address + "results")
    links = page.run("[...document.querySelectorAll('a[href*=\".svg\"]')].map((a) => a.href)")
    assert len(links) == len([*(studio.work / "runs/01-ols").glob("*.svg")]) > 0
    for link in links:
        assert page.run(f"fetch('{link}').then((answer) => answer.text())").startswith("<?xml")
