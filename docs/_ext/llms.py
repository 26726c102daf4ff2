"""llms.txt of the site: what symgen is, then every page with its title."""

from __future__ import annotations

from pathlib import Path

from sphinx.application import Sphinx

ABOUT = (
    "symgen derives the dynamic model of a robot with formulas, identifies its parameters from a "
    "measured record, and says how far the values can be trusted."
)


def write_list(app: Sphinx, failure: Exception | None) -> None:
    if failure is None and app.builder.name == "html":
        titles = {name: app.env.titles[name].astext() for name in sorted(app.env.found_docs)}
        pages = [f"- [{title}]({name}.html)" for name, title in titles.items()]
        text = "\n".join(["# symgen", "", f"> {ABOUT}", "", "## Pages", "", *pages, ""])
        (Path(app.outdir) / "llms.txt").write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("build-finished", write_list)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
