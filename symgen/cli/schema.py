"""The command `symgen schema`: print the JSON Schema of robot files, study files or results.

Editors use the schema of robot files; programs that read results use the other schemas.
"""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli.session import fail

KINDS = ("robot", "study", "estimate", "cestac")


def schema(
    of: Annotated[
        str,
        typer.Option(
            help=(
                "Kind of file whose schema is printed: robot, study, estimate (estimate.json) or cestac (cestac.json)."
            )
        ),
    ] = "robot",
) -> None:
    """Print the JSON Schema of one kind of file. Robot files from `symgen new` refer to the
    schema of robot files as robot.schema.json in the same folder.
    """
    if of not in KINDS:
        fail(f"--of {of}; expected one of {', '.join(KINDS)}")
    from runtime.ground.documents import json_text

    if of == "robot":
        from symgen.description import json_schema

        schema = json_schema()
    else:
        from runtime import compose

        schema = compose.json_schema(of)
    typer.echo(json_text(schema), nl=False)
