"""The gallery: the page of every packaged robot, as `symgen show ROBOT --html` writes it, into
robots/ of the site.
"""

from __future__ import annotations

from pathlib import Path

from reference import regrouped
from sphinx.application import Sphinx

from symgen.description import packaged_robots
from symgen.pages.page import robot_page


def write_pages(app: Sphinx, failure: Exception | None) -> None:
    if failure is None and app.builder.name == "html":
        folder = Path(app.outdir) / "robots"
        folder.mkdir(exist_ok=True)
        for name in packaged_robots():
            (folder / f"{name}.html").write_text(robot_page(regrouped(name)), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("build-finished", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
