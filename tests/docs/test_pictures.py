"""Every picture that README.md and docs show is drawn by `docs/pictures.py`, which runs."""

from __future__ import annotations

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from browser import started_browser
from campaign import campaign
from hang import HANG
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
DRAWINGS = ("examples", "report", "studio")
SHOWN = re.compile(r"!\[[^\]]*\]\(([^)]+)\)|<img[^>]* src=\"([^\"]+)\"")


def shown() -> set[Path]:
    """Files of the pictures that the pages show; the drawings of robots are made with the site."""
    return {
        (page.parent / (a or b)).resolve()
        for page in PAGES
        for a, b in SHOWN.findall(page.read_text(encoding="utf-8"))
        if not (a or b).endswith(".svg")
    }


def drawn(draw: str, folder: Path) -> set[Path]:
    """Files from `folder` that a function of docs/pictures.py draws there, in a process of its own."""
    program = (
        f"import sys; sys.path.insert(0, {str(DOCS)!r}); import pictures; from pathlib import Path; "
        f"pictures.{draw}(Path({str(folder)!r}))"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        timeout=HANG,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr[-4000:]
    return {path.relative_to(folder) for path in folder.rglob("*.png")}


@pytest.fixture(scope="module")
def pictures() -> dict[str, set[Path]]:
    """Names of the functions of docs/pictures.py, and what each draws; Chromium is not started."""
    before = [*sys.path]
    found = runpy.run_path(str(DOCS / "pictures.py"))["PICTURES"]
    sys.path[:] = before
    return {draw.__name__: {*map(Path, files)} for draw, files in found.items()}


def test_every_picture_shown_is_drawn_by_the_script(pictures: dict[str, set[Path]]) -> None:
    files = {DOCS / path for made in pictures.values() for path in made}
    assert shown() == files
    assert {*pictures} == {*DRAWINGS}


def test_pictures_can_be_opened(pictures: dict[str, set[Path]]) -> None:
    for made in pictures.values():
        for path in made:
            with Image.open(DOCS / path) as image:
                image.verify()
                assert image.format == "PNG"


@campaign
@pytest.mark.parametrize("draw", DRAWINGS)
def test_the_script_draws_what_it_names(
    draw: str, pictures: dict[str, set[Path]], tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if draw == "report":
        request.getfixturevalue("tx40_data")
    if draw != "examples":
        with started_browser():  # skips where there is none
            pass
    assert drawn(draw, tmp_path) == pictures[draw]
    for path in pictures[draw]:
        with Image.open(tmp_path / path) as new, Image.open(DOCS / path) as kept:
            assert new.width == kept.width
