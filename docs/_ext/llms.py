"""llms.txt of the site: the purpose of symgen, then one line for each page, with its first sentence."""

from __future__ import annotations

from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx

ABOUT = (
    "symgen derives the dynamic model of a robot with formulas, identifies its parameters from a "
    "measured record, and says how far the values can be trusted."
)


def first_sentence(document: nodes.document) -> str:
    """First sentence of the first paragraph of a page."""
    for paragraph in document.findall(nodes.paragraph):
        return " ".join(paragraph.astext().split()).split(". ")[0].rstrip(".:")
    return ""


def write_list(app: Sphinx, failure: Exception | None) -> None:
    if failure is None and app.builder.name == "html":
        lines = [
            f"- [{app.env.titles[name].astext()}]({name}.html): "
            f"{first_sentence(app.env.get_doctree(name))}"
            for name in sorted(app.env.found_docs)
        ]
        text = "\n".join(["# symgen", "", f"> {ABOUT}", "", "## Pages", "", *lines, ""])
        (Path(app.outdir) / "llms.txt").write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("build-finished", write_list)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
