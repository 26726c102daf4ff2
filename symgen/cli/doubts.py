"""Notes of the verbs on robots that are valid but probably not what was meant."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from symgen.description import Robot


def tell_doubts(robot: Robot) -> None:
    """Print the notes on `robot` on the error stream, before a derivation that they may spare."""
    from symgen.derive.doubts import doubts

    for sentence in doubts(robot):
        typer.echo(f"note: {sentence}", err=True)
