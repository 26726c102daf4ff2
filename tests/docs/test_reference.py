"""Reference pages hold what the program says, in the repository; every link between pages leads to
a page and to a heading of it.
"""

from __future__ import annotations

import re
import sys
from dataclasses import fields
from importlib import import_module
from pathlib import Path

import runtime
import symgen
from runtime.study import Study
from symgen.cli.main import VERBS
from symgen.description import packaged_robots

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "benchmarks").glob("*.md")),
    *sorted(DOCS.rglob("*.md")),
]
LINK = re.compile(r"(?<!!)\[[^\]]*\]\((?P<path>[^)#\s]*)(?:#(?P<anchor>[^)\s]+))?\)")
CODE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)


def page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def written() -> object:
    sys.path.insert(0, str(DOCS))
    try:
        return import_module("write_reference")
    finally:
        sys.path.remove(str(DOCS))


def test_reference_pages_are_current() -> None:
    stale = written().outdated()  # type: ignore[attr-defined]
    assert [path.name for path in stale] == [], "run python docs/write_reference.py"


def test_references_hold_every_verb_section_and_robot() -> None:
    for verb in VERBS:
        assert f"\n## symgen {verb}\n" in page("reference/commands.md")
    for field in fields(Study):
        assert f"\n| `{field.name}` |" in page("reference/study_file.md"), field.name
    for name in packaged_robots():
        assert f"\n## {name}\n" in page("reference/gallery.md")
    assert "{6: q6\\*\\*2 + 2\\*q5\\*q6}" in page("reference/robot_file.md"), (
        "asterisks of a description are read as emphasis"
    )


def test_every_public_name_is_described() -> None:
    described = page("reference/python.md")
    for package in (symgen, runtime):
        for name in package.__all__:
            assert f"\n### `{name}`\n" in described, f"{package.__name__}.{name}"


def slugs(text: str) -> set[str]:
    """Anchors of the headings of a page."""
    found: dict[str, int] = {}
    for title in re.findall(r"^#+ (.*)$", CODE.sub("", text), re.MULTILINE):
        slug = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
        found[slug] = found.get(slug, -1) + 1
        if found[slug]:
            found[f"{slug}-{found[slug]}"] = 0
    return set(found)


def test_links_between_pages_lead_somewhere() -> None:
    checked = 0
    for path in (p for p in PAGES if p.exists()):
        for link in LINK.finditer(CODE.sub("", path.read_text(encoding="utf-8"))):
            if re.match(r"\w+:", link["path"]):
                continue
            target = (path.parent / link["path"]).resolve() if link["path"] else path
            assert target.exists(), f"{path.name} links to {link[0]}"
            if link["anchor"] and target.suffix == ".md":
                assert link["anchor"] in slugs(target.read_text(encoding="utf-8")), (
                    f"{path.name} links to {link[0]}"
                )
            checked += 1
    assert checked > 50
