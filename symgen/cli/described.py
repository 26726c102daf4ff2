"""The ROBOT argument of the verbs on robots: its description, with notes on what is valid but probably not meant."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from symgen.description import Robot

AT_VALUES = "Every constant as its number: base parameters and formulas that hold for these values, where the generic ones do not."


def described_robot(source: str, at_values: bool = False) -> Robot:
    """The robot of a name or file, at the values of its constants where asked; notes on it go to the error stream."""
    from symgen.derive.doubts import doubts
    from symgen.description import read_robot
    from symgen.description.at_values import at_values as with_values
    from symgen.description.urdf import SNAPPED

    robot, read = read_robot(source)
    for sentence in (*(f"{Path(source).name}: {note}" for note in read if note.startswith(SNAPPED)), *doubts(robot)):
        typer.echo(f"note: {sentence}", err=True)
    return with_values(robot) if at_values else robot
