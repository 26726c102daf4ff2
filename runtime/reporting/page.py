"""Write a report as one HTML file that any browser can open: images, style and script are inside.

The page requests nothing from other files or servers. Only this module of the package uses jinja2.

A Page has plain values; the template has the layout. All text from a file or a user is escaped, by
the template or by `markup.element`; numbers for the script are JSON in which <, > and & are
escapes. The content security policy allows only this script and this style sheet, by their hashes.
Without scripts, and in print, the page shows the images, and the rows of tables in the order of the
file.
"""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256
from importlib.resources import files
from typing import Any, Literal

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from runtime.ground.markup import Markup, element
from runtime.ground.table import Table
from runtime.reporting.series import Series

State = Literal["good", "doubtful", "no", "open", ""]
SCRIPTS, STYLES = ("chart.js", "page.js"), ("chart.css", "page.css")
SIGNS = {"good": "✓", "doubtful": "!", "no": "✕", "open": "–"}
WORDS = {"good": "good", "doubtful": "doubtful", "no": "no", "open": "not judged"}


@dataclass(frozen=True)
class Matrix:
    """Square table of correlations between parameters on a report page; cells are shaded by size.

    Attributes
    ----------
    caption : str
    names : sequence of str
        Names of the rows, which are also the names of the columns.
    values : sequence of sequences of float
    """

    caption: str
    names: Sequence[str]
    values: Sequence[Sequence[float]]

    @property
    def cells(self) -> list[list[tuple[str, int]]]:
        """Text and shade (0 to 4) of each cell, by row; a number that rounds to zero is "0"."""
        return [
            [
                (f"{x:+.2f}".replace("-", "−") if abs(x) >= 0.005 else "0", min(4, int(5 * abs(x))))
                for x in row
            ]
            for row in self.values
        ]


@dataclass(frozen=True)
class Image:
    """A figure of a report page: its SVG, caption and files.

    Attributes
    ----------
    caption : str
    svg : bytes
    alt : str
        Description of the figure for readers who cannot see it.
    series : Series or None
        Data from which a script draws the figure instead of the image.
    files : mapping of str to bytes
        The figure in every format that is written next to the page, by file name.
    """

    caption: str
    svg: bytes
    alt: str
    series: Series | None = None
    files: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def data(self) -> str:
        """The SVG encoded in base64, so that the page can contain it as a data: address."""
        return b64encode(self.svg).decode("ascii")


@dataclass(frozen=True)
class Section:
    """A section of a report page: a heading, paragraphs, then figures, tables and a listing.

    folded : whether the section is closed until the reader opens it.
    """

    title: str
    text: Sequence[str] = ()
    images: Sequence[Image] = ()
    tables: Sequence[Table] = ()
    listing: str = ""
    matrices: Sequence[Matrix] = ()
    folded: bool = False


@dataclass(frozen=True)
class Number:
    """A number with a label, which a report page shows below the verdict."""

    label: str
    value: str
    state: State = ""


@dataclass(frozen=True)
class Page:
    """Content of a report page: its verdict, numbers and sections.

    Attributes
    ----------
    title : str
    verdict : str
        One sentence.
    sections : sequence of Section
    warning : str
        Text that must not be overlooked, for instance that data are simulated.
    footer : str
    state : State
        State of the verdict.
    question, answer : str
        The question that the verdict answers, and the answer in one or two words.
    remarks : sequence of (str, str)
        Subject and sentence of each remark after the verdict.
    numbers : sequence of Number
        The numbers below the verdict.
    """

    title: str
    verdict: str
    sections: Sequence[Section]
    warning: str = ""
    footer: str = ""
    state: State = ""
    question: str = "Verdict"
    answer: str = ""
    remarks: Sequence[tuple[str, str]] = ()
    numbers: Sequence[Number] = ()

    @property
    def files(self) -> dict[str, bytes]:
        """Contents of the figure files that are written next to the page, by file name."""
        return {
            name: content
            for section in self.sections
            for image in section.images
            for name, content in image.files.items()
        }


def state_mark(state: State) -> Markup:
    """Write the state of a check of the report as an HTML sign and word, such as "✓ good"."""
    return element(
        "span", f"{SIGNS[state]} {WORDS[state]}" if state else "", class_=f"state {state}"
    )


def render(page: Page) -> str:
    """Write the HTML text of a page. Equal pages give equal bytes."""
    images = [
        image for section in page.sections for image in section.images if image.series is not None
    ]
    scripted = bool(images) or any(
        table.sortable for section in page.sections for table in section.tables
    )
    style = "\n".join(map(_resource, STYLES))
    script = "\n".join(map(_resource, SCRIPTS)) if scripted else ""
    allowed = f"script-src '{_hash(script)}'; " if scripted else ""
    return _template().render(
        page=page,
        state_mark=state_mark,
        signs=SIGNS,
        style=Markup(style),
        script=Markup(script),
        data=embedded([image.series.data for image in images if image.series is not None]),
        number_of={id(image): k for k, image in enumerate(images)},
        id=id,
        policy=(
            f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; {allowed}base-uri "
            "'none'; form-action 'none'"
        ),
    )


def embedded(value: Any) -> Markup:
    """Write a value as JSON that can be placed inside a script element of an HTML page.

    The characters <, > and & are escaped, so that no text can end the element or open a comment.
    """
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


def _hash(text: str) -> str:
    return "sha256-" + b64encode(sha256(text.encode("utf-8")).digest()).decode("ascii")


@lru_cache(maxsize=4)
def _resource(name: str) -> str:
    return files("runtime.reporting").joinpath(name).read_text(encoding="utf-8")


@lru_cache(maxsize=1)
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("runtime.reporting", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html.jinja")
