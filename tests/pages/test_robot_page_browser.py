"""The page of a robot in headless Chromium: sliders, keys, pointer, narrow windows; positions
against the emitted modules.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from browser import WEAK_CONTRAST
from campaign import sampled, some

from runtime.core.model import load_model
from symgen.description import load_robot
from symgen.pages.page import robot_page
from symgen.regroup.regrouping import regroup

GENERATED = Path(__file__).resolve().parents[2] / "generated"
ROBOTS = sampled(("tx40", "haptic", "scara", "four_bar"), 0, always=("haptic", "scara", "four_bar"))
POSES = """[...document.querySelectorAll('#poses tr')].map(
  r => [1, 2, 3].map(k => Number(r.cells[k].dataset.value)))"""
SET = (
    "(() => {{ const s = document.getElementById('q{}'); s.value = {}; s.dispatchEvent(new "
    "Event('input')); return Number(s.value); }})()"
)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The page of a robot, written once."""
    folder = tmp_path_factory.mktemp("pages")

    @cache
    def written(name):
        page = folder / f"{name}.html"
        page.write_text(robot_page(regroup(load_robot(name))), encoding="utf-8")
        return page

    return written


@pytest.mark.parametrize("name", ROBOTS)
@some(2)
def test_nothing_complains_and_nothing_scrolls_sideways(browser, files, name):
    for width in (1280, 390):
        browser.open(files(name), width)
        assert browser.complaints == []
        assert browser.requests == [files(name).as_uri()]
        assert (
            browser.run(
                "document.documentElement.scrollWidth <= window.innerWidth && window.innerWidth"
            )
            == width
        )


@pytest.mark.parametrize("name", ROBOTS)
def test_sliders_move_the_frames_as_the_module_does(browser, files, name):
    """Origins of all frames, from the page and from `frame_poses` of the emitted module, which
    shares no code with it.
    """
    model = load_model(GENERATED / f"{name}.py")
    browser.open(files(name))
    before = browser.run("document.querySelector('#view svg').innerHTML")
    joints = browser.run("JSON.parse(document.getElementById('robot').textContent).joints")
    rng = np.random.default_rng(5)
    for _ in range(3):
        q = [
            browser.run(
                SET.format(j["j"], j["low"] + rng.uniform(0.2, 0.8) * (j["high"] - j["low"]))
            )
            for j in joints
        ]
        expected = np.asarray(model.frame_poses(np.array([q])))[0, :, :3, 3]
        np.testing.assert_allclose(
            browser.run(POSES), expected, atol=1e-10
        )  # a loop is closed to 1e-12 here, to rounding there
    assert browser.run("document.querySelector('#view svg').innerHTML") != before
    assert browser.complaints == []


def test_loop_that_cannot_close_stays_closed(browser, files):
    """The rocker of a longer crank: lengths changed in the page's own functions, so that the
    linkage has dead points.
    """
    browser.open(files("four_bar"))
    result = browser.run(
        "(() => { const r = JSON.parse(document.getElementById('robot').textContent); "
        "r.frames[1].d = 0.49;"
        " const s = closeLoops(r, { ...r.tied, 1: 1 }); const m = moved(r, s, 1, 3.1, 0.05);"
        " return [m.open, m.q[1], Math.max(...gaps(r, m.q).map(Math.abs))]; })()"
    )
    assert result[0] is True and 1 < result[1] < 3.1 and result[2] < 1e-7


def test_keyboard(browser, files):
    browser.open(files("scara"))
    drawing = "document.querySelector('#view svg').innerHTML"
    browser.run("document.getElementById('view').focus()")
    seen = [browser.run(drawing)]
    for key in ("ArrowLeft", "ArrowUp", "+", "0"):
        browser.press(key)
        seen.append(browser.run(drawing))
    assert len(set(seen[:4])) == 4 and seen[4] == seen[0]
    browser.run("document.getElementById('q4').focus()")
    browser.press("ArrowRight")
    assert browser.run("Number(document.getElementById('q4').value)") > 0
    assert "metres" in browser.run("document.getElementById('q4').getAttribute('aria-valuetext')")
    assert "Origin of frame 4" in browser.run("document.getElementById('status').textContent")
    browser.run("document.querySelector('.formulas button').focus()")
    browser.press("ArrowDown")
    assert browser.run("document.activeElement.dataset.p") == "ZZ2R"
    assert "ZZ2R, link 2" in browser.run("document.getElementById('detail').textContent")
    browser.press("End")
    assert browser.run("document.activeElement.dataset.p") == "OFFSET4R"
    browser.press("Escape")
    assert browser.run("document.querySelectorAll('.marked').length") == 0
    assert browser.run("document.querySelectorAll('.formulas button[tabindex=\"0\"]').length") == 2


def test_pointer_shows_rows_and_link(browser, files):
    browser.open(files("tx40"))
    browser.hover("li[data-p=MX2R] .formula [data-p=M4]")
    text = browser.run("document.getElementById('detail').textContent")
    assert "M4, link 4: mass of link 4" in text and "through" in text and "MX2R" in text
    browser.hover("li[data-p=XX2R] .unit")
    text = browser.run("document.getElementById('detail').textContent")
    assert "XX2R, link 2" in text and "enters Γ1, Γ2" in text
    assert browser.run(
        "[...document.querySelectorAll('li.marked .on')].map(n => n.textContent)"
    ) == ["Γ1", "Γ2"]
    assert browser.run(
        "[...new Set([...document.querySelectorAll('#view .marked')].map(n => n.dataset.link))]"
    ) == ["2"]
    browser.hover(".chip[data-p=XX1]")
    assert "no effect: link 1 never turns about x1" in browser.run(
        "document.getElementById('detail').textContent"
    )
    before = browser.run("document.querySelector('#view svg').innerHTML")
    browser.drag("#view", 60, 20)
    assert (
        browser.run("document.querySelector('#view svg').innerHTML") != before
        and browser.complaints == []
    )


def test_a_finger_turns_the_drawing_and_opens_a_parameter(browser, files):
    browser.open(files("tx40"), 390)
    browser.call("Emulation.setTouchEmulationEnabled", enabled=True)
    before = browser.run("document.querySelector('#view svg').innerHTML")
    x, y = browser.centre("#view")
    browser.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
    for step in range(1, 6):
        browser.call(
            "Input.dispatchTouchEvent", type="touchMove", touchPoints=[{"x": x + 12 * step, "y": y}]
        )
    browser.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    assert browser.run("document.querySelector('#view svg').innerHTML") != before
    x, y = browser.centre(".chip[data-p=YY2]")
    place = "document.querySelector('.chip[data-p=YY2]').getBoundingClientRect().y + scrollY"
    there = browser.run(place)
    browser.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": x, "y": y}])
    browser.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    assert "YY2, link 2" in browser.run("document.getElementById('detail').textContent")
    assert browser.run(place) == there  # else the tap's own mouse events meet a neighbour
    inside = (
        "(() => { const b = document.getElementById('detail').getBoundingClientRect(); return "
        "b.top > 0 && b.bottom <= innerHeight + 1; })()"
    )
    assert browser.run(inside)
    browser.call("Emulation.setTouchEmulationEnabled", enabled=False)


def test_everything_that_can_be_focused_has_a_name(browser, files):
    """Names as Chromium's accessibility tree gives them to a screen reader."""
    browser.open(files("haptic"))
    nodes = browser.call("Accessibility.getFullAXTree")["nodes"]
    named = {"button", "slider", "link", "checkbox", "application", "toolbar", "region", "table"}
    found = [
        (n["role"]["value"], n.get("name", {}).get("value", ""))
        for n in nodes
        if not n["ignored"] and n["role"]["value"] in named
    ]
    assert {"slider", "application", "button", "checkbox"} <= {role for role, _ in found}
    assert [f for f in found if not f[1].strip()] == []
    assert [name for role, name in found if role == "slider"] == [
        "joint 1, revolute",
        "joint 2, revolute",
        "joint 5, revolute",
    ]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_colours_have_contrast(browser, files, scheme):
    """At least 4.5 to 1 (WCAG 2 AA) for every text on its own background, as computed by the
    browser.
    """
    preferred = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.call("Emulation.setEmulatedMedia", features=preferred)
    try:
        browser.open(files("scara"))
        browser.run("document.querySelectorAll('details').forEach((n) => { n.open = true; })")
        browser.hover("li[data-p=ZZ2R] .unit")
        assert browser.run(WEAK_CONTRAST) == []
    finally:
        browser.call("Emulation.setEmulatedMedia", features=[])
