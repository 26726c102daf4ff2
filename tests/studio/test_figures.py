"""The figures of the studio in a browser: lines, zoom, keys and cursor as in a report, and Play."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import FRAME, WEAK_CONTRAST, Browser
from hang import HANG
from test_browser import URDF, choose, go, quiet, until
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


POINTS = """(() => {
  const path = document.querySelector(".plot .line").getAttribute("d");
  return [...path.matchAll(/[ML](\\S+) ([^ML]+)/g)].map(([, x, y]) => [Number(x), Number(y)]);
})()"""


def test_a_plot_has_all_samples_and_times_from_zero(
    page: Browser, running: Callable[..., Any], tmp_path: Path
) -> None:
    """Of 60,000 rows with stamps of an epoch: each column of pixels has the smallest and the largest
    value of its rows, a spike of one row too; of a short span, every row is drawn.
    """
    N = 60_000
    t = np.arange(N) * 0.005
    q = np.sin(0.7 * t) + np.random.default_rng(2).normal(0, 0.2, N)
    q[43_210] = 9.0
    columns = np.column_stack([1.7644e9 + t, q, q, q, q])
    header = "time_s,shoulder_pos_rad,elbow_pos_rad,shoulder_tau_nm,elbow_tau_nm"
    np.savetxt(
        tmp_path / "long.csv", columns, delimiter=",", header=header, comments="", fmt="%.6f"
    )
    (tmp_path / "lever.urdf").write_text(URDF)
    studio = running(str(tmp_path / "lever.urdf"))
    go(page, studio.address + "record")
    choose(page, "#record-file", tmp_path / "long.csv")
    until(page, "document.querySelectorAll('#preview .plot > svg').length === 2")
    until(page, "document.querySelector('#preview .plot .line').getAttribute('d').length > 9")
    x, y = np.array(page.run(POINTS)).T
    width = x[-1]
    of_row, of_point = np.floor(t / t[-1] * width), np.floor(x)
    high, low = y.min(), y.max()  # downwards
    drawn = q.min() + (y - low) / (high - low) * (q.max() - q.min())
    for pixel in np.unique(of_point)[1:-1]:  # rounded places may cross a border of pixels
        rows, own = q[np.abs(of_row - pixel) <= 1], drawn[of_point == pixel]
        inner = q[of_row == pixel]
        assert rows.min() - 0.05 < own.min() and own.max() < rows.max() + 0.05
        near = drawn[np.abs(of_point - pixel) <= 1]
        assert near.min() < inner.min() + 0.05 and near.max() > inner.max() - 0.05
    said = page.run(TEXTS)[0]
    assert "time, s after 1764400000.000" in said and "100" in said and "17644000" not in said.replace("1764400000.000", "")  # fmt: skip
    page.run("document.querySelector('.plot').focus()")
    for _ in range(18):
        page.press("+")
    page.run(FRAME)
    times = re.findall(r"[\d.]+(?= s:)", page.run(READOUT)) or ["0"]
    assert float(times[0]) < 300
    span = t[-1] * 0.7**18
    points = page.run(POINTS)
    assert abs(len(points) - span / 0.005) <= 3


def test_a_plot_over_a_position_draws_each_stroke_once(results: Browser) -> None:
    """It reaches as far as the plot of all points, with fewer strokes than samples."""
    over = "document.querySelectorAll('.plot')[1].querySelector('.line').getAttribute('d')"
    path = results.run(over)
    strokes = re.findall(r"L\S+ [^ML]+", path)
    assert len(strokes) > 100 and len(set(strokes)) > 0.2 * len(strokes)
    ends = np.array([[*map(float, s[1:].split())] for s in strokes])
    box = results.run("document.querySelectorAll('.plot')[1].clientWidth")
    assert np.ptp(ends[:, 0]) > 0.7 * (box - 70) and np.ptp(ends[:, 1]) > 100
