"""Three people's ways through the studio, with their clicks, typed fields and seconds of waiting.

`python tests/studio/ways.py FOLDER` walks each way in Chromium, prints a table, and saves a picture
of the last page of each way in FOLDER. A click, a chosen file and a choice in a list count as one
click each. Run it on a quiet machine.
"""

import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

from browser import Browser, find_browser  # noqa: E402
from conftest import Running  # noqa: E402
from test_browser import STATES, URDF, choose, go, record, type_in, until  # noqa: E402

LOADED = "document.readyState === 'complete' && !window.left"


class Way:
    """One person's way: counts what the person does, and times what the person waits for."""

    def __init__(self, page: Browser) -> None:
        self.page = page
        self.clicks = self.fields = 0
        self.waited = 0.0

    def click(self, selector: str) -> None:
        self.clicks += 1
        self.page.click(selector)

    def follow(self, link: str) -> None:
        """Click a link, and wait for its page."""
        self.page.run("window.left = true")
        self.click(link)
        self.wait(LOADED)

    def file(self, selector: str, path: Path) -> None:
        self.clicks += 1
        start = time.monotonic()
        choose(self.page, selector, path)
        self.waited += time.monotonic() - start

    def option(self, selector: str, value: str) -> None:
        self.clicks += 1
        field = f"document.querySelector({json.dumps(selector)})"
        self.page.run(f"{field}.value = {json.dumps(value)}")
        self.page.run(f"{field}.dispatchEvent(new Event('change', {{bubbles: true}}))")

    def type(self, ident: str, text: str) -> None:
        self.fields += 1
        self.page.click(f"#{ident}")
        type_in(self.page, ident, text)

    def wait(self, script: str) -> None:
        start = time.monotonic()
        until(self.page, script, 60)
        self.waited += time.monotonic() - start


def textbook(way: Way, _: Path) -> None:
    """A table of three frames from a textbook, to its base parameters and their proof."""
    way.click("button[value='new']")
    way.wait("!!document.getElementById('f-2-alpha')")
    way.type("f-2-alpha", "pi/2")
    way.click("#cells > .row > [data-act^='add']")
    way.wait("!!document.getElementById('f-3-d')")
    way.page.run(STATES)
    way.type("f-3-d", "0.4")
    way.wait("window.states.includes('running') && window.states.at(-1) === 'valid'")
    way.wait("document.querySelectorAll('.formulas li').length > 0")


def measured(way: Way, folder: Path) -> None:
    """A URDF and a log in degrees, to a verdict and the lines of the URDF that change."""
    (folder / "lever.urdf").write_text(URDF)
    way.file("#robot-file", folder / "lever.urdf")
    way.follow("header a[href='record']")
    way.file("#record-file", record(folder / "run.csv"))
    way.wait("document.querySelectorAll('#preview .plot > svg').length === 2")
    way.option("[name=side]", "joint")
    way.click("#questions button.main")
    way.wait("document.querySelector('#study-text')?.value.includes('side: joint')")
    way.follow(".row a[href='check']")
    way.wait("!!document.querySelector('#findings button.main')")
    way.click("#findings button.main")
    way.wait("document.querySelectorAll('.checks li').length > 10")
    way.follow(".row a[href='solve']")
    way.wait("!!document.querySelector('#solve button.main')")
    way.click("#solve button.main")
    way.wait("document.querySelector('#jobs')?.dataset.runs.length > 0")
    way.follow("header a[href='results']")
    way.wait("!!document.querySelector('.verdict .answer')")


def lecture(way: Way, _: Path) -> None:
    """A packaged robot, to one typeset model as LaTeX and the certificate as a page."""
    way.option("#packaged", "planar_2r")
    way.click("form:has(#packaged) button")
    way.wait("document.querySelectorAll('.formulas li').length > 0")
    way.option("form[hx-get='view/model'] [name=model]", "inertia_matrix")
    way.click("form[hx-get='view/model'] button")
    way.wait("!!document.querySelector('#model-latex')")
    way.click("[data-copy='#model-latex']")
    way.wait("document.getElementById('certificate')?.classList.contains('valid')")


WAYS: dict[str, Callable[[Way, Path], None]] = {
    "table of a textbook": textbook,
    "URDF and log": measured,
    "lecture": lecture,
}


def main(pictures: Path) -> None:
    """Walk the three ways, each in a studio of its own."""
    pictures.mkdir(parents=True, exist_ok=True)
    print(f"{'way':<20} clicks  fields  waiting, s  all, s")
    for name, walk in WAYS.items():
        with tempfile.TemporaryDirectory() as folder, Browser(find_browser()) as page:
            studio = Running(work=Path(folder) / "work")
            try:
                go(page, studio.address + "robot")
                way, start = Way(page), time.monotonic()
                walk(way, Path(folder))
                whole = time.monotonic() - start
                picture = pictures / f"{name.replace(' ', '_')}.png"
                picture.write_bytes(page.screenshot())
            finally:
                studio.end()
        print(f"{name:<20} {way.clicks:6}  {way.fields:6}  {way.waited:10.1f}  {whole:6.1f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
