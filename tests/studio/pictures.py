"""The pictures of docs/guide/studio.md: `python tests/studio/pictures.py` (Chromium, Pillow)."""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

from browser import Browser, find_browser  # noqa: E402
from conftest import Running  # noqa: E402
from PIL import Image  # noqa: E402
from test_browser import URDF, choose, go, proved, record, until  # noqa: E402

DOCS = Path(__file__).parents[2] / "docs" / "guide"
READY = {
    "robot": "document.querySelectorAll('.formulas li').length > 0",
    "record": "document.querySelectorAll('#preview .plot > svg').length === 2",
    "check": "document.querySelectorAll('.checks li').length > 10",
    "solve": "document.querySelectorAll('#compared tbody tr').length > 0",
    "results?run=02-feasible": "document.querySelectorAll('.plot > svg').length === 4 && document.querySelectorAll('#compared th[scope=col]').length === 5",
    "results?run=03-cestac": "document.querySelector('figure img')?.naturalWidth > 300",
}


def main() -> None:
    """Work through the five steps, then take each at 1280 and 390 px."""
    with tempfile.TemporaryDirectory() as folder, Browser(find_browser()) as page:
        here = Path(folder)
        (here / "lever.urdf").write_text(URDF)
        studio = Running(work=here / "work")
        try:
            go(page, studio.address + "robot")
            choose(page, "#robot-file", here / "lever.urdf")
            proved(page)
            go(page, studio.address + "record")
            choose(page, "#record-file", record(here / "run.csv"))
            until(page, READY["record"])
            page.run("document.querySelector('[name=side]').value = 'joint'")
            page.run(
                "document.querySelector('[name=side]').dispatchEvent(new Event('change', {bubbles: true}))"
            )
            page.click("#questions button.main")
            until(page, "!!document.querySelector('#study-text')")
            go(page, studio.address + "check")
            page.click("#findings button.main")
            until(page, READY["check"], 120)
            go(page, studio.address + "solve")
            page.run("document.querySelector('[value=feasible]').checked = true")
            page.click("#solve button.main")
            until(page, "document.querySelector('#jobs').textContent.includes('02-feasible')")
            page.run(
                "document.querySelector('#resolution [name=delta]').value = '2*pi/10000, 2*pi/2000, 2*pi/500'"
            )
            page.click("#resolution button")
            until(page, "document.querySelector('#jobs').dataset.runs.split(' ').length === 3", 300)
            for step, ready in READY.items():
                for width in (1280, 390):
                    go(page, studio.address + step, width)
                    until(page, ready)
                    if step == "results?run=02-feasible":
                        page.run(
                            "(() => { const c = document.querySelector('#cursor'); c.value = 6; c.dispatchEvent(new Event('input')); })()"
                        )
                    picture = Image.open(io.BytesIO(page.screenshot()))
                    small = picture.convert("RGB").quantize(96, dither=Image.Dither.NONE)
                    name = step.partition("?")[0] if "cestac" not in step else "resolution"
                    small.save(DOCS / f"studio_{name}_{width}.png", optimize=True)
        finally:
            studio.end()


if __name__ == "__main__":
    main()
