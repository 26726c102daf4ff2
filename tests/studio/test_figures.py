"""The figures of the studio in a browser: lines, zoom, keys and cursor as in a report, and Play."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from browser import FRAME, WEAK_CONTRAST, Browser
from hang import HANG
from test_browser import choose, go, quiet, until
from test_mishaps import OWN_CLOCK, lever, solved

pytestmark = pytest.mark.campaign

KINDS = (
    "[...document.querySelectorAll('.plot')].map((plot) => "
    "[...plot.querySelectorAll('.line')].map((line) => line.classList[1]))"
)
DRAWN = (
    "[...document.querySelectorAll('.plot')].map((plot) => "
    "plot.querySelector('.line').getAttribute('d'))"
)
TEXTS = "[...document.querySelectorAll('.plot')].map((n) => n.textContent)"
CURSOR = "Number(document.querySelector('#cursor').value)"
READOUT = "document.querySelector('.readout').textContent"


def zoomed(page: Browser) -> tuple[list[str], list[str]]:
    """What the figures draw as a whole, and after a drag of 90 px to the right from the middle."""
    page.run(FRAME)
    whole = page.run(DRAWN)
    page.drag(".plot", 90, 0)
    page.run(FRAME)
    return whole, page.run(DRAWN)


def point(page: Browser) -> None:
    """The pointer on the middle of the first figure, until the cursor has left the first instant."""
    start, end = page.run(CURSOR), time.monotonic() + HANG
    while page.run(CURSOR) == start:
        assert time.monotonic() < end
        page.hover(".plot")
        page.run(FRAME)


@pytest.fixture
def results(page: Browser, running: Callable[..., Any], tmp_path: Path) -> Browser:
    """The page of results of an arm of two joints."""
    studio = running(*lever(tmp_path))
    solved(studio, "ols")
    go(page, studio.address + "results")
    until(page, "document.querySelectorAll('.plot > svg').length === 4")
    return page


def test_results_show_measured_predicted_and_error_of_every_joint(results: Browser) -> None:
    """Over time and over the position; drag, wheel and keys zoom; a button hides a line."""
    lines = ["measured", "predicted", "error"]
    assert results.run(KINDS) == [[*lines, "c0"], lines] * 2
    for text in results.run(TEXTS):
        assert {"torque, N m", "error, N m", "position, rad"} <= set(
            re.findall(r"(?:torque|error|position), (?:N m|rad)", text)
        )
    whole, near = zoomed(results)
    assert all(a != b for a, b in zip(whole, near, strict=True))
    x, y = results.centre(".plot")
    results.call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=-120)
    results.run(FRAME)
    assert all(a != b for a, b in zip(near, results.run(DRAWN), strict=True))
    results.press("0")
    results.run(FRAME)
    assert results.run(DRAWN) == whole
    results.click("[role=toolbar] [aria-pressed]")
    results.run(FRAME)
    assert results.run(KINDS) == [[*lines[1:], "c0"], lines[1:]] * 2
    assert results.run(WEAK_CONTRAST) == []
    quiet(results)


def test_the_pointer_moves_one_cursor(results: Browser) -> None:
    """Of all figures, the slider and the values; the error is the difference of the torques."""
    point(results)
    marks = "document.querySelectorAll('.plot line.cursor').length"
    assert results.run(marks) == 4
    found = re.fullmatch(
        r"(\S+) s: measured (\S+), predicted (\S+) N m; error (\S+) N m; position \S+ rad",
        results.run(READOUT).replace("−", "-"),
    )
    assert found
    t, measured, predicted, error = map(float, found.groups())
    assert t == pytest.approx(results.run(CURSOR), abs=0.1)
    assert error == pytest.approx(measured - predicted, abs=0.01)


def test_play_repeats_the_span_that_is_shown(results: Browser) -> None:
    point(results)
    start = results.run(CURSOR)
    zoomed(results)
    end = results.run(CURSOR)
    results.run("document.querySelector('#cursor').value = 0")
    results.run(OWN_CLOCK)
    results.click("#play")
    results.run("passed(1.0)")
    assert start <= results.run(CURSOR) <= end
    results.click("#play")


def test_a_record_shows_its_columns_and_zooms(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    studio = running(lever(tmp_path)[0])
    go(page, studio.address + "record")
    choose(page, "#record-file", tmp_path / "run.csv")
    until(page, "document.querySelectorAll('#preview .plot > svg').length === 2")
    assert page.run(KINDS) == [["c0", "c1"]] * 2
    assert "q, deg" in page.run(TEXTS)[0] and "time, s" in page.run(TEXTS)[1]
    whole, near = zoomed(page)
    assert all(a != b for a, b in zip(whole, near, strict=True))
    assert "shoulder_pos_deg" in page.run(READOUT)
    quiet(page)
