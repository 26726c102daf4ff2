"""The documentation builds without a warning, links to what exists, asks nobody for anything."""

from __future__ import annotations

import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from browser import started_browser
from campaign import campaign
from hang import HANG

from symgen.description import packaged_robots

ROOT = Path(__file__).resolve().parents[2]
SHOWN = (
    "index.html",
    "guide/my_robot.html",
    "theory/cestac.html",
    "reference/gallery.html",
    "reference/study_file.html",
    "reference/python.html",
)


@campaign
def test_site(tmp_path: Path) -> None:
    """One test, since each process that tests would build a site of its own."""
    site = built(tmp_path)
    links_and_addresses(site)
    assert "{6: q6**2 + 2*q5*q6}" in (site / "reference" / "robot_file.html").read_text(
        encoding="utf-8"
    )
    pages_in_a_browser_ask_for_files_of_the_site_alone(site)


def built(out: Path) -> Path:
    """The site, built with warnings as errors."""
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "-W",
        "--keep-going",
        "-n",
        "-q",
        "-d",
        out / "trees",
        ROOT / "docs",
        out / "html",
    ]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=HANG, check=False)
    assert ended.returncode == 0, ended.stderr[-4000:]
    return out / "html"


class Addresses(HTMLParser):
    """Addresses a page fetches by itself, those it links to, and its anchors."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.linked: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if given.get("id"):
            self.anchors.add(str(given["id"]))
        if tag == "a" and given.get("href"):
            self.linked.append(str(given["href"]))
        elif tag == "link" and given.get("href"):
            self.fetched.append(str(given["href"]))
        elif given.get("src"):
            self.fetched.append(str(given["src"]))


def links_and_addresses(site: Path) -> None:
    pages = {page: Addresses(page.read_text(encoding="utf-8")) for page in site.rglob("*.html")}
    assert {f"{name}.{kind}" for name in packaged_robots() for kind in ("html", "svg")} == {
        page.name for page in (site / "robots").iterdir()
    }
    for page, addresses in pages.items():
        away = [
            address
            for address in addresses.fetched
            if urlsplit(address).scheme or address.startswith("//")
        ]
        assert all(address.startswith("data:") for address in away), f"{page.name} fetches {away}"
        for address in {*addresses.fetched, *addresses.linked}:
            parts = urlsplit(address)
            if parts.scheme:
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            assert target.exists(), f"{page.relative_to(site)} links to {address}"
            if parts.fragment and target in pages and "robots" not in target.parts:
                assert unquote(parts.fragment) in pages[target].anchors | {""}, (
                    f"{page.relative_to(site)} links to {address}"
                )


def pages_in_a_browser_ask_for_files_of_the_site_alone(site: Path) -> None:
    with started_browser() as browser:
        for name in SHOWN:
            for width in (1280, 390):
                browser.open(site / name, width, 800)
                assert not browser.complaints, (name, browser.complaints)
                foreign = [
                    r for r in browser.requests if not r.startswith((site.as_uri(), "data:"))
                ]
                assert not foreign, (name, foreign)
                assert browser.run("document.documentElement.scrollWidth <= window.innerWidth"), (
                    f"{name} is wider than {width}"
                )
        browser.open(site / "theory" / "cestac.html")
        sizes = browser.run(
            "[...document.querySelectorAll('math')].map(m => m.getBoundingClientRect().height)"
        )
        assert len(sizes) > 10
        assert min(sizes) > 5
