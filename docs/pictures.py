"""Draw every picture of README.md and docs: `python docs/pictures.py [FOLDER]` (Chromium, Pillow,
matplotlib, the record tx40). They are written to docs, or to FOLDER.

PICTURES maps a function to the files that it draws. Each file is a path from docs.
"""

from __future__ import annotations

import io
import os
import runpy
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

DOCS = Path(__file__).parent
TESTS = DOCS.parent / "tests"
sys.path[:0] = [str(TESTS / "studio"), str(TESTS)]

import matplotlib as mpl  # noqa: E402
from browser import Browser, find_browser  # noqa: E402
from PIL import Image  # noqa: E402

EXAMPLES = sorted((DOCS / "examples").glob("[0-9]*.py"))
STUDIO = {  # a page, and the script that says when it is complete
    "robot": "document.querySelectorAll('.formulas li').length > 0",
    "record": "document.querySelectorAll('#preview .plot > svg').length === 2",
    "check": "document.querySelectorAll('.checks li').length > 10",
    "solve": "document.querySelectorAll('#compared tbody tr').length > 0",
    "results?run=02-feasible": "document.querySelectorAll('.plot > svg').length === 4 && document.querySelectorAll('#compared th[scope=col]').length === 5",
    "results?run=03-cestac": "document.querySelector('figure img')?.naturalWidth > 300",
}
NAMES = {"results?run=02-feasible": "results", "results?run=03-cestac": "resolution"}
WIDTHS = (1280, 390)
STYLE = {"figure.figsize": (4, 3), "figure.constrained_layout.use": True, "savefig.dpi": 200}
REPORT_WIDTH = 1280
FIRST_ROW = "document.querySelectorAll('figure')[1].getBoundingClientRect().bottom"


def examples(out: Path) -> None:
    """The figure of each numbered example, under the example's name."""
    with tempfile.TemporaryDirectory() as name, mpl.rc_context(STYLE):
        os.chdir(name)
        for example in EXAMPLES:
            runpy.run_path(str(example), run_name="__main__")
            (figure,) = Path().glob("*.png")
            save(figure.read_bytes(), out / "examples" / f"{example.stem}.png")
            figure.unlink()
        os.chdir(DOCS)


def report(out: Path) -> None:
    """The report of the TX40 and its public record, down to the torques of two joints."""
    import runtime
    import symgen
    from runtime.reading.records import read_records
    from runtime.study import study_of

    model = symgen.model("tx40")
    study, _ = study_of("tx40")
    result = runtime.identify(model, read_records(study.record, model), study, plausible=True)
    with tempfile.TemporaryDirectory() as folder, Browser(find_browser()) as page:
        runtime.report(result, folder)
        page.call("Emulation.setScrollbarsHidden", hidden=True)
        page.open(Path(folder) / "report.html", REPORT_WIDTH, 1200)
        save(page.screenshot(), out / "report_desktop.png", height=round(page.run(FIRST_ROW)) + 8)


def studio(out: Path) -> None:
    """The five pages of the studio, after work in them, and a study of the resolution, each at two widths."""
    from conftest import Running
    from test_browser import URDF, choose, go, proved, record, until

    with tempfile.TemporaryDirectory() as folder, Browser(find_browser()) as page:
        here = Path(folder)
        (here / "lever.urdf").write_text(URDF)
        page.call("Emulation.setScrollbarsHidden", hidden=True)
        server = Running(work=here / "work")
        try:
            go(page, server.address + "robot")
            choose(page, "#robot-file", here / "lever.urdf")
            proved(page)
            go(page, server.address + "record")
            choose(page, "#record-file", record(here / "run.csv"))
            until(page, STUDIO["record"])
            page.run("document.querySelector('[name=side]').value = 'joint'")
            page.run(
                "document.querySelector('[name=side]').dispatchEvent(new Event('change', {bubbles: true}))"
            )
            page.click("#questions button.main")
            until(page, "!!document.querySelector('#study-text')")
            go(page, server.address + "check")
            page.click("#findings button.main")
            until(page, STUDIO["check"], 120)
            go(page, server.address + "solve")
            page.run("document.querySelector('[value=feasible]').checked = true")
            page.click("#solve button.main")
            until(page, "document.querySelector('#jobs').textContent.includes('02-feasible')")
            page.run(
                "document.querySelector('#resolution [name=delta]').value = '2*pi/10000, 2*pi/2000, 2*pi/500'"
            )
            page.click("#resolution button")
            until(page, "document.querySelector('#jobs').dataset.runs.split(' ').length === 3", 300)
            for step, complete in STUDIO.items():
                for width in WIDTHS:
                    go(page, server.address + step, width)
                    until(page, complete)
                    if step == "results?run=02-feasible":
                        page.run(
                            "(() => { const c = document.querySelector('#cursor'); c.value = 6; c.dispatchEvent(new Event('input')); })()"
                        )
                    name = NAMES.get(step, step)
                    save(page.screenshot(), out / "guide" / f"studio_{name}_{width}.png")
        finally:
            server.end()


def save(png: bytes, path: Path, *, height: int | None = None) -> None:
    """96 colours; the upper `height` pixels."""
    image = Image.open(io.BytesIO(png)).convert("RGB")
    image = image.crop((0, 0, image.width, height or image.height))
    path.parent.mkdir(parents=True, exist_ok=True)
    image.quantize(96, dither=Image.Dither.NONE).save(path, optimize=True)


PICTURES: dict[Callable[[Path], None], tuple[str, ...]] = {
    examples: tuple(f"examples/{path.stem}.png" for path in EXAMPLES),
    report: ("report_desktop.png",),
    studio: tuple(f"guide/studio_{NAMES.get(x, x)}_{w}.png" for x in STUDIO for w in WIDTHS),
}


def main(out: Path = DOCS) -> None:
    """Draw all of them."""
    for draw in PICTURES:
        draw(out.resolve())


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
