"""Result of a further analysis of an identification: its texts, tables, figures and checks.

Code that prints, judges, exports or reports an identification treats all its parts in the same way,
and mentions no part by name. An Extra makes a Part of an Identification (`runtime.core.identify`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from runtime.ground.check import Check
from runtime.ground.table import Table

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
        What the figure shows, in words, for readers who do not see the figure.
    panels : sequence of functions of Matplotlib Axes
        Each function fills one panel.
    name : str
        Name of the PNG and SVG files next to the page; "": the figure is on the page only.
    columns : int
        Largest number of panels in a row.
    cell : (float, float), inch
        Width and height of a panel; `extra` is added to the height of the figure, and the figure is
        at least `least` wide.
    legend : int
        Number of columns of the common legend above the panels, whose letters have `letters`
        points; 0: no legend.
    logarithmic : bool
        Whether both axes of every panel are logarithmic.
    x, y : str
        Labels of all panels together; numbers then stand at the outer panels only.
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
    """Result of one analysis, with its texts, tables, figures and checks.

    A subclass overrides the methods for the items that it has.

    Attributes
    ----------
    name : str
        Name by which `Identification.part` finds the part, and its key in estimate.json.
    title : str
        Heading of its section.
    about : "record", "prediction" or "values"
        Subject of its questions. A verdict begins with the questions about the record, because an
        error of the record causes later errors.
    """

    name: str
    title: str
    about: About = "values"

    @property
    def expected_error(self) -> float:
        """Expected relative error of torques predicted for other motions, %; nan if unknown."""
        return float("nan")

    @property
    def unseen_error(self) -> float:
        """Error on a part of the record that fits of other parts explain, %; nan if unknown."""
        return float("nan")

    @property
    def records_differ(self) -> bool:
        """Whether the parameters of the records differ as if the robot had changed."""
        return False

    def text(self) -> str:
        """Return the text on this analysis: paragraphs, one per line."""
        return ""

    def brief(self) -> str:
        """Return a short text on this analysis, for the short printed form of the result."""
        return ""

    def warnings(self) -> Sequence[str]:
        """Return sentences that the user should read before the parameter values are used."""
        return ()

    def tables(self) -> Sequence[Table]:
        """Return the tables of this analysis, which are printed after its text."""
        return ()

    def figures(self) -> Sequence[Figure]:
        """Return the figures of this analysis, for a report."""
        return ()

    def checks(self) -> Sequence[Check]:
        """Return the checks of this analysis, which count in the verdict."""
        return ()

    def summary(self) -> Any:
        """Return this result as a mapping for estimate.json; None if it has no entry there."""
        return None

    def entries(self) -> Mapping[str, Any]:
        """Return the entries that this analysis adds to estimate.json, by key.

        Default: the summary under the name of the part.
        """
        summary = self.summary()
        return {} if summary is None else {self.name: summary}

    def files(self) -> Mapping[str, str]:
        """Return the text files that this analysis writes: their contents, by file name."""
        return {}

    def arrays(self) -> Mapping[str, Mapping[str, np.ndarray]]:
        """Return arrays to write as NPZ and MAT files, by file name without its ending."""
        return {}


@dataclass(frozen=True)
class Doubt(Part):
    """A part with one sentence that the user should read before the values are used."""

    name: str
    title: str
    sentence: str

    def warnings(self) -> tuple[str, ...]:
        """Return a tuple of one text: the sentence."""
        return (self.sentence,)


def printed(part: Part) -> str:
    """Write the title, text and tables of an analysis (Part); "" without text and tables."""
    tables = [table.to_text() for table in part.tables()]
    shown = "\n\n".join(text for text in (part.text(), *tables) if text)
    return f"{part.title}\n{shown}" if shown else ""
