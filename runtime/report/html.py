"""A report as one HTML file that opens anywhere: images inlined, no script, no request to anyone. jinja2 only here.

A Page is plain values; the template holds the layout. Everything that comes from a file or a user is escaped.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from jinja2 import Environment, PackageLoader, StrictUndefined, Template


@dataclass(frozen=True)
class Table:
    """Cells are text; the first column stands to the left, the others to the right. `note` follows the table."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""

    def __post_init__(self) -> None:
        wrong = [row for row in self.rows if len(row) != len(self.header)]
        if wrong:
            raise ValueError(
                f"table {self.caption!r}: {len(wrong[0])} cells in {tuple(wrong[0])}; expected {len(self.header)}, {self.header}"
            )


@dataclass(frozen=True)
class Image:
    """A figure as SVG; `alt` says what it shows to those who do not see it."""

    caption: str
    svg: bytes
    alt: str

    @property
    def data(self) -> str:
        """Base64 of the SVG, for a data: address."""
        return b64encode(self.svg).decode("ascii")


@dataclass(frozen=True)
class Section:
    """A heading, paragraphs, then figures, tables and a listing that opens on demand."""

    title: str
    text: Sequence[str] = ()
    images: Sequence[Image] = ()
    tables: Sequence[Table] = ()
    listing: str = ""


@dataclass(frozen=True)
class Page:
    """verdict : one sentence.   warning : what must not be overlooked, such as simulated data."""

    title: str
    verdict: str
    sections: Sequence[Section]
    warning: str = ""
    footer: str = ""


def render(page: Page) -> str:
    """The HTML text of a page."""
    return _template().render(page=page)


@lru_cache(maxsize=1)
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("runtime.report", ""), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("report.html.jinja")
