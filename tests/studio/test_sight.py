"""What one sees and does at the table and the drawing: keys, blocks, symbols, bodies, times, print."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from browser import FRAME, WEAK_CONTRAST, Browser
from test_browser import URDF, go, quiet, until, wait_for
from test_mishaps import MESSAGE, lever, solved

import symgen
from runtime.reading.datasets import dataset_study
from symgen.pages.boxes import boxes
from symgen.studio.jobs import RUNNING, Job, Jobs


def test_the_box_of_a_link_is_that_of_its_mass_and_inertia(tmp_path: Path) -> None:
    """Of MuJoCo's own box with any sides and any direction; a body that cannot be has none."""
    sides = np.array([0.3, 0.1, 0.2])
    text = f"""<mujoco><worldbody><body><joint axis="0 0 1"/>
      <geom type="box" size="{" ".join(map(str, sides / 2))}" pos="0.2 0.1 -0.3" euler="20 30 40" density="800"/>
      </body></worldbody></mujoco>"""
    (tmp_path / "box.xml").write_text(text)
    robot = symgen.load_robot(tmp_path / "box.xml")
    (box,) = boxes(robot)
    assert np.sort(box["sides"]) == pytest.approx(np.sort(sides), rel=1e-6)
    assert robot.values["M1"] == pytest.approx(800 * sides.prod())
    model = mujoco.MjModel.from_xml_string(text)
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[0])
    shortest = rotation.reshape(3, 3)[:, 1]
    own = np.array(box["axes"])[int(np.argmin(box["sides"]))]
    assert abs(own @ shortest) == pytest.approx(1, abs=1e-6)
    assert box["centre"] == pytest.approx([0.2, 0.1, -0.3], abs=1e-9)


def test_what_is_left_of_a_run_is_told(tmp_path: Path) -> None:
    """From the steps that are done, else from the last run of its kind, also after a restart."""
    (tmp_path / "times.json").write_text('{"ols": 100.0}')
    jobs = Jobs(tmp_path, {}, lambda: None)
    job = Job(1, "03-ols", (), "", run="03-ols", state=RUNNING)
    job.started = -40.0 + time.monotonic()
    assert jobs.left(job) == pytest.approx(60, abs=5)
    job.progress = '{"done": 4, "total": 5}\n'
    assert jobs.left(job) == pytest.approx(10, abs=2)
    assert jobs.left(Job(2, "04-wls", (), "", run="04-wls", state=RUNNING)) is None


@pytest.mark.campaign
def test_keys_move_in_the_table_and_a_block_is_pasted(
    page: Browser, running: Callable[..., Any]
) -> None:
    """Arrows at the ends of a text, Enter, and cells from a spreadsheet as one edit."""
    studio = running("tx40")
    go(page, studio.address + "robot")
    until(page, "!!document.getElementById('f-2-d')")
    focused = "document.activeElement.id"
    page.click("#f-2-alpha")
    for key, place in (
        ("ArrowDown", "f-3-alpha"),
        ("ArrowRight", "f-3-d"),
        ("ArrowLeft", "f-3-alpha"),
        ("Enter", "f-4-alpha"),
        ("ArrowUp", "f-3-alpha"),
    ):
        page.press(key)
        assert page.run(focused) == place
    page.press("ArrowUp")
    page.run("document.activeElement.setSelectionRange(1, 1)")  # inside -pi/2
    page.press("ArrowRight")
    assert page.run(focused) == "f-2-alpha"
    page.run(
        "(() => { const data = new DataTransfer(); data.setData('text', '0.7131\\t0.7132\\r\\n0.7141\\t0.7142\\r\\n');"
        " const cell = document.getElementById('f-5-alpha'); cell.focus();"
        " cell.dispatchEvent(new ClipboardEvent('paste', {clipboardData: data, bubbles: true, cancelable: true})); })()"
    )
    wait_for(lambda: "0.7142" in (studio.work / "robot.yaml").read_text())
    frames = symgen.load_robot(studio.work / "robot.yaml").frames
    assert [str(getattr(frames[j - 1], c)) for j in (5, 6) for c in ("alpha", "d")] == ["0.7131", "0.7132", "0.7141", "0.7142"]  # fmt: skip
    assert len([*(studio.work / "history/robot").iterdir()]) == 1
    page.run(
        "(() => { const data = new DataTransfer(); data.setData('text', '1\\n2\\n3');"
        " document.getElementById('f-5-d').dispatchEvent(new ClipboardEvent('paste', {clipboardData: data, bubbles: true, cancelable: true})); })()"
    )
    until(page, f"{MESSAGE}.includes('1 cells of the block are outside')")


@pytest.mark.campaign
def test_a_symbol_says_what_it_is_where_it_is_pointed_at(
    page: Browser, running: Callable[..., Any]
) -> None:
    studio = running("planar_2r")
    go(page, studio.address + "robot")
    until(page, "document.querySelectorAll('.formulas math').length > 0")
    about = "document.querySelector('#about').hidden ? '' : document.querySelector('#about').textContent"
    page.run(
        "document.querySelector('.formulas li .formula msub, .formulas li .formula mi').id = 'pointed'"
    )
    page.hover("#pointed")
    told = until(page, about)
    name = told.partition(":")[0]
    model = symgen.model("planar_2r")
    assert name in (*model.STANDARD_PARAMETERS, *model.BASE_PARAMETERS)
    page.hover(".cells th[data-means]")
    until(page, f"({about}).includes('the frame on which frame j stands')")
    page.run(
        "document.querySelector('form[hx-get=\"view/model\"] [name=form]').value = 'recursive'"
    )
    page.click("form[hx-get='view/model'] button")
    until(page, "document.querySelectorAll('#model .steps math').length > 0")
    page.run("document.querySelector('#model .steps dt msub').id = 'step'")
    page.hover("#step")
    until(page, f"({about}).includes(': ')")
    page.hover("h1")
    assert page.run(about) == ""
    assert page.run(WEAK_CONTRAST) == []


@pytest.mark.campaign
def test_bodies_are_drawn_as_boxes(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Three faces of each; a table without values has none, and no button for them."""
    (tmp_path / "lever.urdf").write_text(URDF)
    studio = running(str(tmp_path / "lever.urdf"))
    go(page, studio.address + "robot")
    faces = "document.querySelectorAll('#arm .mass').length"
    assert until(page, faces) == 3 * 2
    page.click("#show-boxes")
    assert page.run(faces) == 0
    studio.end()
    studio = running("tx40", work=tmp_path / "other")
    go(page, studio.address + "robot")
    until(page, "!!document.querySelector('#arm svg')")
    assert page.run(faces) == 3 * len(boxes(symgen.load_robot("tx40")))
    assert page.run("document.querySelector('#show-boxes').parentElement.hidden") == (
        not boxes(symgen.load_robot("tx40"))
    )


@pytest.mark.campaign
def test_the_tx40_and_its_record_are_one_click(page: Browser, running: Callable[..., Any]) -> None:
    """At the first opening alone; the plots are of the record as its study reads it."""
    studio = running()
    go(page, studio.address + "robot")
    page.click("form.inline button")
    until(page, "location.pathname.endsWith('/record')")
    until(page, "document.querySelectorAll('#preview .plot > svg').length === 2")
    text = (studio.work / "study.yaml").read_text()
    assert dataset_study("tx40")["record"]["dataset"] in text
    assert page.run("document.querySelectorAll('.plot')[0].querySelectorAll('.line').length") == 6
    go(page, studio.address + "robot")
    assert page.run("!document.querySelector('form.inline')")
    quiet(page)


@pytest.mark.campaign
def test_the_arm_stays_in_view_beside_the_last_joint(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """And *Play*, on a wide window and on a phone; a wide window is used; print has no buttons."""
    studio = running(*lever(tmp_path))
    solved(studio, "ols")
    inside = "(() => {{ const b = document.querySelector('{}').getBoundingClientRect(); return b.bottom > 0 && b.top < innerHeight; }})()"
    for width in (390, 1280):
        go(page, studio.address + "results", width)
        until(page, "document.querySelectorAll('.plot > svg').length === 4")
        page.run(
            "[...document.querySelectorAll('.plot')].at(-1).scrollIntoView({block: 'end', behavior: 'instant'})"
        )
        page.run(FRAME)
        for place in ("#arm", "#play"):
            assert page.run(inside.format(place)), (width, place)
        assert page.run("document.documentElement.scrollWidth") <= width
    go(page, studio.address + "robot", 2560)
    assert page.run("document.querySelector('main').clientWidth") > 2400
    page.call("Emulation.setEmulatedMedia", media="print")
    try:
        shown = "[...document.querySelectorAll('button, nav, input[type=range]')].filter((n) => n.getClientRects().length).length"
        assert page.run(shown) == 0
        assert page.run("!!document.querySelector('#arm svg')")
    finally:
        page.call("Emulation.setEmulatedMedia", media="")
