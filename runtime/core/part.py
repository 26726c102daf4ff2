"""What is found in an identification besides its parameters: a Part carries its own words, tables, figures, questions and JSON.

Whoever prints, judges, exports or reports an identification goes through its parts and knows none by name. An Extra makes a Part of an Identification (`runtime.core.identify`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from runtime.core.check import Check
from runtime.core.table import Table

About = Literal["record", "prediction", "values"]

BLACK = "#000000"
BLUE = "#0072B2"
ORANGE = "#D55E00"
GREEN = "#007A5A"
PURPLE = "#AA4499"
SKY = "#56B4E9"
GREY = "#9A9A9A"
LIGHT = "#C8C8C8"
DOTTED: Any = (0, (1, 2))


@dataclass(frozen=True, eq=False)
class Figure:
    """Description of a figure with one or more panels, which a report draws.

    Attributes
    ----------
    caption : str
    alt : str
        What the figure shows, for those who do not see it.
    panels : sequence of functions of Matplotlib Axes
        Each fills one panel.
    name : str
        Of its files next to the page, PNG and SVG; "": the page alone has it.
    columns : int
        Largest number of panels in a row.
    cell : (float, float), inch
        Width and height of a panel; `extra` is added to the height of all, and the whole is at least `least` wide.
    legend : int
        Columns of the one legend above the panels, in letters of `letters` points; 0: none.
    logarithmic : bool
        Both axes of every panel.
    x, y : str
        Labels of all panels together; numbers are then at the outer panels only.
    """

    caption: str
    alt: str
    panels: Sequence[Callable[[Any], None]]
    name: str = ""
    columns: int = 2
    cell: tuple[float, float] = (4.8, 2.9)
    extra: float = 0.4
    least: float = 0.0
    legend: int = 0
    letters: float = 9.0
    logarithmic: bool = False
    x: str = ""
    y: str = ""


class Part:
    """Result of one analysis with its texts, tables, figures and checks; a subclass overrides what it has.

    Attributes
    ----------
    name : str
        By which `Identification.part` finds it, and its key in estimate.json.
    title : str
        Heading of its section.
    about : "record", "prediction" or "values"
        What its questions are about: those of the record stand first in a verdict, since what is wrong there is the cause of what follows.
    """

    name: str
    title: str
    about: About = "values"

    @property
    def expected_error(self) -> float:
        """Expected error of predictions of other motions, %, for the verdict; nan if the part has none."""
        return float("nan")

    @property
    def records_differ(self) -> bool:
        """Whether the records seem to come from different robots."""
        return False

    def text(self) -> str:
        """Paragraphs of text, one a line."""
        return ""

    def brief(self) -> str:
        """Short text for a short print."""
        return ""

    def warnings(self) -> Sequence[str]:
        """Sentences to read before the values are used."""
        return ()

    def tables(self) -> Sequence[Table]:
        """Tables, printed after the text."""
        return ()

    def figures(self) -> Sequence[Figure]:
        """Figures for a report."""
        return ()

    def checks(self) -> Sequence[Check]:
        """Checks for the verdict."""
        return ()

    def summary(self) -> Any:
        """The part as a mapping for JSON."""
        return None

    def entries(self) -> Mapping[str, Any]:
        """Entries of estimate.json by key: the summary, if there is one."""
        summary = self.summary()
        return {} if summary is None else {self.name: summary}

    def files(self) -> Mapping[str, str]:
        """Texts of further files, by file name."""
        return {}

    def arrays(self) -> Mapping[str, Mapping[str, np.ndarray]]:
        """Arrays of NPZ and MAT files, by file name without its ending."""
        return {}


def printed(part: Part) -> str:
    """Title, text and tables of a part; "" if it has neither text nor table."""
    tables = [table.to_text() for table in part.tables()]
    shown = "\n\n".join(text for text in (part.text(), *tables) if text)
    return f"{part.title}\n{shown}" if shown else ""
