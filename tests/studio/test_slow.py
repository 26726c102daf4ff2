"""Clicks and keys while answers are late: each request waits up to 2 s before it leaves the page."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser
from test_browser import go, type_in, until, wait_for
from test_mishaps import MESSAGE, answering, give, lever

import symgen

pytestmark = pytest.mark.campaign

LATE = """(() => {{
  let state = {seed};
  const draw = () => (state = (state * 48271) % 2147483647) / 2147483647;  // Park and Miller
  const send = XMLHttpRequest.prototype.send, ask = window.fetch;
  XMLHttpRequest.prototype.send = function (...given) {{ setTimeout(() => send.apply(this, given), 2000 * draw()); }};
  window.fetch = (...given) => new Promise((done) => setTimeout(done, 2000 * draw())).then(() => ask(...given));
}})()"""


def late(page: Browser, address: str, seed: int) -> None:
    """Open a page whose requests are late."""
    go(page, address)
    until(page, "document.readyState === 'complete' && !!document.querySelector('#cells')")
    page.run(LATE.format(seed=seed))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_double_click_adds_two_frames_in_a_row(
    page: Browser, running: Callable[..., Any], seed: int
) -> None:
    """*Add a frame* means on the last one when its turn comes: no branch."""
    studio = running("planar_2r")
    late(page, studio.address + "robot", seed)
    page.run(
        "for (let k = 0; k < 2; k++) document.querySelector('#cells > .row > [data-act=add]').click()"
    )
    until(page, "!!document.getElementById('f-4-alpha')")
    wait_for(lambda: "q4" in (studio.work / "robot.yaml").read_text())
    robot = symgen.load_robot(studio.work / "robot.yaml")
    assert [frame.ant for frame in robot.frames] == [0, 1, 2, 3]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_undo_waits_for_the_edit(page: Browser, running: Callable[..., Any], seed: int) -> None:
    """Pressed while an edit is on its way, Undo takes back this edit, and what is typed next counts."""
    studio = running("planar_2r")
    file = studio.work / "robot.yaml"
    before = symgen.load_robot(file)
    late(page, studio.address + "robot", seed)
    page.click("#f-2-alpha")
    type_in(page, "f-2-alpha", "pi/2")
    page.run("document.getElementById('cells').requestSubmit()")  # its request is under way
    page.click("#undo")
    until(
        page,
        "document.getElementById('f-2-alpha').value !== 'pi/2' && document.getElementById('undo').disabled",
    )
    assert page.run(MESSAGE) == ""
    assert symgen.load_robot(file) == before
    page.click("#redo")
    until(page, "document.getElementById('f-2-alpha').value === 'pi/2'")
    assert str(symgen.load_robot(file).frames[1].alpha) == "pi/2"


def test_a_text_that_is_saved_during_an_edit_comes_after_it(
    page: Browser, running: Callable[..., Any]
) -> None:
    studio = running("planar_2r")
    file = studio.work / "robot.yaml"
    text = file.read_text().replace("planar_2r", "other_2r", 1)
    late(page, studio.address + "robot", 4)
    page.click("#f-2-alpha")
    type_in(page, "f-2-alpha", "pi/2")
    page.run("document.getElementById('cells').requestSubmit()")
    page.run(f"document.getElementById('robot-text').value = {text!r}")
    page.run("document.getElementById('whole').requestSubmit()")
    until(page, "document.getElementById('r-name').value === 'other_2r'")
    assert page.run(MESSAGE) == "" and file.read_text() == text


def test_a_wrong_file_leaves_the_record_and_undo_brings_it_back(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """What is no table is refused before the record goes; a table that is not wanted goes back."""
    studio = running(lever(tmp_path)[0])
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "picture.csv").write_bytes(bytes.fromhex("89504e470d0a1a0a0000000d49484452"))
    np.savetxt(tmp_path / "other.csv", np.eye(5), delimiter=",", header="a,b,c,d,e", comments="")
    go(page, studio.address + "record")
    give(page, "#record-file", tmp_path / "run.csv")
    until(page, "!!document.querySelector('#preview table')")
    page.run("document.querySelector('[name=side]').value = 'joint'")
    page.run(
        "document.querySelector('[name=side]').dispatchEvent(new Event('change', {bubbles: true}))"
    )
    page.click("#questions button.main")
    wait_for((studio.work / "study.yaml").is_file)
    study = (studio.work / "study.yaml").read_text()
    kept = (studio.work / "record/run.csv").read_bytes()
    for name in ("empty.csv", "picture.csv"):
        go(page, studio.address + "record")
        answering(page, "true")
        give(page, "#record-file", tmp_path / name)
        until(page, f"{MESSAGE}.includes('the earlier record stays in use')")
        assert page.run("asked.length") == 1
        assert (studio.work / "record/run.csv").read_bytes() == kept
        assert (studio.work / "study.yaml").read_text() == study
    answering(page, "true")
    give(page, "#record-file", tmp_path / "other.csv")
    wait_for((studio.work / "record/other.csv").is_file)
    until(
        page,
        "document.querySelector('h1')?.textContent.includes('other.csv')"
        " && document.readyState === 'complete'",
    )
    assert not (studio.work / "study.yaml").exists()
    page.click("form[hx-post='do/earlier_record'] button")
    until(page, "document.querySelector('h1')?.textContent.includes('run.csv')")
    assert (studio.work / "record/run.csv").read_bytes() == kept
    assert (studio.work / "study.yaml").read_text() == study


def test_a_draft_keeps_the_drawing_of_the_last_robot(
    page: Browser, running: Callable[..., Any]
) -> None:
    studio = running("planar_2r")
    go(page, studio.address + "robot")
    until(page, "!!document.querySelector('#arm svg')")
    lines = page.run("document.querySelectorAll('#arm svg *').length")
    page.click("#f-2-alpha")
    type_in(page, "f-2-alpha", "pi/")
    wait_for((studio.work / "robot.draft.yaml").is_file)
    go(page, studio.address + "robot")
    assert until(page, "document.querySelectorAll('#arm svg *').length") == lines
    assert page.run("document.getElementById('f-2-alpha').value") == "pi/"


def test_a_run_keeps_its_robot_and_a_failure_leaves(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """After an edit, the verdict says that it is of another robot, whose figures are drawn; a box of
    a failed run goes when it is dismissed, or when the task is done.
    """
    studio = running(*lever(tmp_path))
    solve = "document.querySelector('#solve button[name=anyway], #solve button.main').click()"
    go(page, studio.address + "solve")
    until(page, "!!document.querySelector('#solve button')")
    good = (studio.work / "study.yaml").read_text()
    (studio.work / "study.yaml").write_text(good.replace("deg", "rev"))
    page.run(solve)
    until(page, "!!document.querySelector('.job, #jobs table')")
    until(page, "!document.querySelector('.job.running, .job.waiting')")
    (studio.work / "study.yaml").write_text(good)
    go(page, studio.address + "solve")
    until(page, "!!document.querySelector('#solve button')")
    page.run(solve)
    until(page, "!!document.querySelector('#jobs table') && !document.querySelector('.job')")
    run = sorted((studio.work / "runs").iterdir())[-1].name
    robot = studio.work / f"robot-{run}.urdf"
    assert robot.read_bytes() == (studio.work / "robot.urdf").read_bytes()
    text = (studio.work / "robot.urdf").read_text()
    (studio.work / "robot.urdf").write_text(text.replace('xyz="0.4 0 0"', 'xyz="0.9 0 0"'))
    go(page, studio.address + f"results?run={run}")
    until(
        page,
        "document.querySelector('main .doubtful')?.textContent.includes('The robot has changed since this run')",
    )
    until(page, "document.querySelectorAll('[data-series] .plot > svg').length > 0")
    drawn = page.run("document.querySelector('#figure').dataset.figure")
    assert '"d": 0.4' in drawn and "0.9" not in drawn


def test_a_bookmark_survives_a_restart(running: Callable[..., Any], tmp_path: Path) -> None:
    """Port and token stand in a file that only its owner reads; asked for, both change."""
    first = running("planar_2r")
    kept = first.work / ".address.json"
    assert os.name == "nt" or stat.S_IMODE(kept.stat().st_mode) == 0o600
    first.end()
    second = running(work=first.work)
    assert second.address == first.address
    third = running(work=first.work)  # the port is another server's
    assert (
        third.address != first.address
        and third.address.split("/")[-2] == first.address.split("/")[-2]
    )
    third.end()
    second.end()
    kept.chmod(0o644)  # others have read it
    fourth = running(work=first.work)
    assert fourth.address.split("/")[-2] != first.address.split("/")[-2]
    fourth.end()
    fifth = running("--new-address", work=first.work)
    assert fifth.address.split("/")[-2] not in first.address + fourth.address
