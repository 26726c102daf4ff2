"""report.html in headless Chromium: wide, narrow and printed; figures and tables by pointer and
keys; what a checker of web pages asks.
"""

import base64
import json
from itertools import pairwise

import numpy as np
import pytest
from browser import FRAME, WEAK_CONTRAST
from campaign import campaign
from typer.testing import CliRunner

from runtime.core.model import load_model
from symgen.cli.main import app
from symgen.description import load_robot
from symgen.emit.generate import generate_module

pytestmark = campaign

UNFOLD = "document.querySelectorAll('details').forEach((n) => { n.open = true; })"
DRAWN = "[...document.querySelectorAll('.plot .line')].map((n) => n.getAttribute('d')).join('|')"
SPAN = (
    "[...document.querySelectorAll('.plot')[0].querySelectorAll('text')].map((n) => n.textContent)"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The report of a 2R arm whose record has noise and a friction that the model does not know;
    and a resolution study of it.
    """
    folder = tmp_path_factory.mktemp("report")
    (folder / "planar_2r.py").write_text(generate_module(load_robot("planar_2r")))
    model = load_model(folder / "planar_2r.py", trust=True)
    t, rng = np.arange(6000) / 1000, np.random.default_rng(3)
    w = 2 * np.pi * np.array([0.3, 0.7, 1.1, 1.9])[:, None, None]
    a, p = rng.uniform(0.1, 0.5, (4, 1, 2)), rng.uniform(0, 6, (4, 1, 2))
    q, qd, qdd = (
        np.sum(x, axis=0)
        for x in (
            a * np.sin(w * t[:, None] + p),
            a * w * np.cos(w * t[:, None] + p),
            -a * w**2 * np.sin(w * t[:, None] + p),
        )
    )
    X = np.linspace(1.0, 2.0, len(model.BASE_PARAMETERS))
    tau = (
        model.inverse_dynamics(q, qd, qdd, X)
        + 0.5 * np.exp(-((qd / 0.3) ** 2)) * np.sign(qd)
        + rng.normal(size=q.shape)
    )
    np.savetxt(
        folder / "record.csv",
        np.column_stack([t, q, tau]),
        delimiter=",",
        header="t,q1,q2,tau1,tau2",
        comments="",
        fmt="%.9g",
    )
    for verb, *options in (
        ("report", "--encoder", "2*pi/2000"),
        ("cestac", "--delta", "2*pi/5000"),
    ):
        result = CliRunner().invoke(
            app, [verb, "planar_2r", str(folder / "record.csv"), "-o", str(folder / verb), *options]
        )
        assert result.exit_code in (0, 1), result.output
    return folder


@pytest.fixture(scope="module")
def page(folder):
    return folder / "report" / "report.html"


@pytest.fixture
def shown(browser, page):
    browser.open(page)
    return browser


@pytest.mark.parametrize("verb", ["report", "cestac"])
def test_nothing_complains_is_asked_for_or_scrolls_sideways(browser, folder, verb):
    path = folder / verb / "report.html"
    for width in (1280, 390):
        browser.open(path, width)
        assert browser.complaints == []
        assert [
            address
            for address in browser.requests
            if not address.startswith("data:image/svg+xml;base64,")
        ] == [path.as_uri()]
        assert (
            browser.run(
                "document.documentElement.scrollWidth <= window.innerWidth && window.innerWidth"
            )
            == width
        )


@pytest.mark.parametrize("verb", ["report", "cestac"])
def test_structure(browser, folder, verb):
    """One h1, no level left out, language, title, viewport; images have a text, drawings are hidden
    from readers, cells have headers.
    """
    browser.open(folder / verb / "report.html")
    levels = browser.run(
        "[...document.querySelectorAll('h1, h2, h3, h4, h5, h6')].map((n) => Number(n.tagName[1]))"
    )
    assert levels.count(1) == 1 and levels[0] == 1 and all(b - a <= 1 for a, b in pairwise(levels))
    assert (
        browser.run("document.documentElement.lang") == "en"
        and browser.run("document.title.length") > 5
    )
    assert "width=device-width" in browser.run(
        "document.querySelector('meta[name=viewport]').content"
    )
    assert browser.run("[...document.images].filter((n) => n.alt.length < 10).length") == 0
    assert browser.run("[...document.images].every((n) => n.complete && n.naturalWidth > 0)")
    assert (
        browser.run(
            "[...document.querySelectorAll('svg')].filter((n) => !n.closest('[aria-hidden=true]')).length"
        )
        == 0
    )
    assert (
        browser.run(
            "[...document.querySelectorAll('th')].filter((n) => !['row', "
            "'col'].includes(n.scope)).length"
        )
        == 0
    )
    assert (
        browser.run("[...document.querySelectorAll('table')].filter((n) => !n.caption).length") == 0
    )
    ids = browser.run("[...document.querySelectorAll('[id]')].map((n) => n.id)")
    assert len(ids) == len(set(ids))


def test_axes_tell_a_scale_and_texts_stay_in_their_cells(shown):
    """Two labels at least on either vertical axis of every chart; no text, such as a hash, that
    leaves its cell.
    """
    labels = (
        "[...document.querySelectorAll('.plot > svg')].map((s) => "
        "[...s.querySelectorAll('text[text-anchor=end]')].map((n) => Number(n.getAttribute('y'))))"
    )
    for places in shown.run(labels):
        assert sum(y < 190 for y in places) >= 2 and sum(y > 190 for y in places) >= 2
    assert (
        shown.run(
            f"{UNFOLD}; [...document.querySelectorAll('td, th')].filter((n) => n.scrollWidth > n.clientWidth "
            "+ 1).map((n) => n.textContent)"
        )
        == []
    )


def test_verdict_is_said_in_words_and_first(shown, page):
    answer = shown.run("document.querySelector('.answer').textContent.trim()")
    assert answer.split()[0] in "✓!✕" and answer[1:].strip() in (
        "Yes",
        "Yes, as far as judged",
        "With care",
        "No",
    )
    text = shown.run("document.querySelector('.verdict').textContent")
    assert "Can I use these values?" in text and "Biggest doubt:" in text and "Next:" in text
    assert shown.run("document.querySelector('.verdict').getBoundingClientRect().bottom") < 500
    sections = shown.run("[...document.querySelectorAll('main h2')].map((n) => n.textContent)")
    assert sections[:3] == ["Measured and predicted torques", "Parameters", "Checks"]
    assert shown.run("document.querySelector('figure').getBoundingClientRect().bottom") < 1500
    open_ones = (
        "[...document.querySelectorAll('main section')].filter((n) => !n.querySelector('.fold'))"
    )
    assert shown.run(f"{open_ones}.length") == 2
    for title in (
        "Checks",
        "Parameters",
        "Friction curves",
        "Resolution advice",
        "Resolution study",
        "Settings",
        "Provenance",
    ):
        assert title in sections


def test_everything_that_can_be_focused_has_a_name(shown):
    """Names as Chromium's accessibility tree gives them to a screen reader."""
    shown.run(UNFOLD)
    nodes = shown.call("Accessibility.getFullAXTree")["nodes"]
    named = {
        "button",
        "link",
        "application",
        "toolbar",
        "region",
        "table",
        "image",
        "DisclosureTriangle",
        "navigation",
    }
    found = [
        (n["role"]["value"], n.get("name", {}).get("value", ""))
        for n in nodes
        if not n["ignored"] and n["role"]["value"] in named
    ]
    assert {"button", "application", "toolbar", "region", "table", "image"} <= {
        role for role, _ in found
    }
    assert [f for f in found if not f[1].strip()] == []
    assert ("button", "Zoom in") in found and ("button", "measured") in found


def test_a_study_of_encoders_answers_first(browser, folder):
    """The only step tried, 2 pi / 5000, biases this record."""
    browser.open(folder / "cestac" / "report.html")
    verdict = browser.run("document.querySelector('.verdict').textContent.split(/\\s{2,}|\\n/)")
    said = [text for text in verdict if text.strip()]
    assert said[0] == "Which of the encoder steps tried is enough?"
    assert "None of the steps tried" in said[1]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("verb", ["report", "cestac"])
def test_colours_have_contrast(browser, folder, verb, scheme):
    preferred = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.call("Emulation.setEmulatedMedia", features=preferred)
    try:
        for width in (1280, 390):
            browser.open(folder / verb / "report.html", width)
            browser.run(UNFOLD)
            assert browser.run(WEAK_CONTRAST) == []
    finally:
        browser.call("Emulation.setEmulatedMedia", features=[])


def test_lines_are_the_torques(shown, folder):
    """Norm of the error in the page against the residual norm of the essential parameters."""
    fit = json.loads((folder / "report" / "estimate.json").read_text())["essential"]["per_joint"]
    norms = shown.run(
        "JSON.parse(document.getElementById('data').textContent).map((d) => { const a = "
        "floats(d.measured), b = floats(d.predicted);"
        " return Math.sqrt(a.reduce((sum, x, k) => sum + (x - b[k] || 0) ** 2, 0)); })"
    )
    assert norms == pytest.approx([joint["residual_norm"] for joint in fit], rel=1e-5)


def test_keyboard_reaches_and_zooms_a_figure(shown):
    for _ in range(200):
        shown.press("Tab")
        if shown.run("document.activeElement.className") == "plot":
            break
    assert shown.run("document.activeElement.getAttribute('aria-label')").startswith(
        "Torque of joint 1"
    )
    shown.run(FRAME)
    seen = [shown.run(DRAWN)]
    for key in ("+", "+", "ArrowRight", "-", "0"):
        shown.press(key)
        shown.run(FRAME)
        seen.append(shown.run(DRAWN))
    assert len(set(seen[:5])) == 5 and seen[5] == seen[0]
    assert shown.complaints == []


def test_pointer_zooms_all_figures_and_legend_hides_lines(shown):
    shown.run(UNFOLD)
    shown.run(FRAME)
    whole, drawn = shown.run(SPAN), shown.run(DRAWN)
    shown.drag(".plot", 90, 0)
    shown.run(FRAME)
    assert shown.run(SPAN) != whole
    assert all(
        new != old for new, old in zip(shown.run(DRAWN).split("|"), drawn.split("|"), strict=True)
    )
    shown.hover(".plot")
    assert "measured" in shown.run("document.querySelector('.readout').textContent")
    near = shown.run(DRAWN)
    x, y = shown.centre(".plot")
    shown.call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=-120)
    shown.run(FRAME)
    assert shown.run(DRAWN) != near  # the drag has given the figure the focus
    shown.click("[aria-label='all: show the whole time']")
    shown.run(FRAME)
    assert shown.run(SPAN) == whole
    shown.click("[role=toolbar] button:nth-of-type(8)")
    shown.run(FRAME)
    assert shown.run(
        "[...new Set([...document.querySelectorAll('.plot .line')].map((n) => n.classList[1]))]"
    ) == ["measured", "predicted"]
    assert shown.run("document.querySelectorAll('.tools [aria-pressed=false]').length") == 1
    assert shown.complaints == []


def test_parameters_are_sorted(shown):
    values = (
        "[...document.querySelector('.sortable').tBodies[0].rows].map((r) => "
        "r.cells[{}].textContent)"
    )
    first = shown.run(values.format(0))
    for expected in ("ascending", "descending"):
        shown.click(".sortable thead th:nth-child(2) button")
        assert (
            shown.run(
                "document.querySelector('.sortable th:nth-child(2)').getAttribute('aria-sort')"
            )
            == expected
        )
        column = [float(x) for x in shown.run(values.format(1))]
        assert column == sorted(column, reverse=expected == "descending")
    shown.click(".sortable thead th:nth-child(2) button")
    assert shown.run(values.format(0)) == first


def test_formula_opens_by_key(shown):
    shown.run("document.querySelector('details summary').focus()")
    assert not shown.run("document.querySelector('details').open")
    shown.press("Enter")
    assert shown.run("document.querySelector('details').open")


def test_a_figure_on_a_phone_is_as_wide_as_the_page(browser, page):
    """Its panels take four fifths of the page, and no label is cut."""
    browser.open(page, 390)
    browser.run(FRAME)
    lefts = (
        "[...document.querySelectorAll('.plot text')].map((n) => n.getBoundingClientRect().left)"
    )
    assert min(browser.run(lefts)) >= 0
    panels = (
        "[...document.querySelectorAll('.plot > svg > g > svg')].map((n) => n.width.baseVal.value)"
    )
    assert min(browser.run(panels)) >= 0.8 * 390
    assert browser.run("document.documentElement.scrollWidth") <= 390


def test_targets_of_a_finger(browser, page):
    """At least 24 by 24 (WCAG 2.2 AA); buttons 44."""
    browser.open(page, 390)
    size = (
        "[...document.querySelectorAll('{}')].map((n) => n.getBoundingClientRect()).map((b) => "
        "Math.min(b.width, b.height))"
    )
    assert min(browser.run(size.format("button"))) >= 44
    browser.run(UNFOLD)
    assert min(browser.run(size.format("summary"))) >= 24


PRINTED = """(() => {
  const seen = (n) => n.getClientRects().length > 0, all = (s) => [...document.querySelectorAll(s)];
  const right = (n) => n.getBoundingClientRect().right;
  const cut = all('table, img, pre, p').filter(
    (n) => seen(n) && right(n) > right(n.closest('section, body')) + 1);
  return { controls: all('.tools, .plot, .hint, details:not(.fold) > summary').filter(seen).length,
    images: all('figure img').every(seen), cut: cut.map((n) => n.textContent.slice(0, 40)),
    folded: all('.formula').filter((n) => !n.getBoundingClientRect().height).length,
    listing: seen(all('pre')[0]),
    heads: [...new Set(all('thead button').map((n) => getComputedStyle(n).display))] };
})()"""


def test_print_is_whole(browser, page):
    """As laid out on A4, 186 mm wide, and on the broad pages, 273 mm: nothing cut, no controls,
    figures as images, everything unfolded.

    A button in a header would keep Chromium from repeating it on the next page.
    """
    for width in (703, 1032):
        browser.open(page, width)
        browser.call("Emulation.setEmulatedMedia", media="print")
        found = browser.run(PRINTED)
        browser.call("Emulation.setEmulatedMedia", media="")
        broad = (
            []
            if width > 1000
            else browser.run(
                "[...document.querySelectorAll('section.broad table')].map((n) => "
                "n.textContent.slice(0, 40))"
            )
        )
        assert found == {
            "controls": 0,
            "images": True,
            "cut": [c for c in found["cut"] if c in broad],
            "folded": 0,
            "listing": True,
            "heads": ["contents"],
        }
    pdf = base64.b64decode(
        browser.call("Page.printToPDF", printBackground=True, preferCSSPageSize=True)["data"]
    )
    assert pdf.startswith(b"%PDF")
    assert browser.run("[...document.querySelectorAll('details')].every((n) => !n.open)")


def test_without_scripts_figures_are_images(browser, page):
    browser.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.open(page)
        assert browser.run("document.querySelectorAll('.plot, .tools').length") == 0
        assert browser.run(
            "[...document.images].every((n) => n.getBoundingClientRect().height > 50)"
        )
    finally:
        browser.call("Emulation.setScriptExecutionDisabled", value=False)


def test_policy_stops_other_scripts_and_requests(shown):
    """What an escape would bring in does not run and asks nobody."""
    shown.run(
        "document.body.append(Object.assign(document.createElement('script'), { textContent: "
        "'window.broken = 1' }))"
    )
    shown.run(
        "document.body.append(Object.assign(document.createElement('img'), { src: "
        "'file:///nowhere.png' }))"
    )
    assert shown.run("window.broken === undefined")
    assert sum("Content Security Policy" in text for text in shown.complaints) >= 2
