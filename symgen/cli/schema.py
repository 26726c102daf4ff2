"""`symgen schema`: the JSON Schema of robot files, for editors."""

from __future__ import annotations

import typer


def schema() -> None:
    """Print the JSON Schema of robot files; `symgen new` refers to the installed copy in its first line."""
    from symgen.description.schema import schema_text

    typer.echo(schema_text(), nl=False)
