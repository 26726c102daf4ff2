"""`symgen schema`: the JSON Schema of robot files, for editors, and of results, for programs that read them."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli.session import fail

KINDS = ("robot", "estimate", "cestac")


def schema(
    of: Annotated[str, typer.Option(help="robot (robot files), estimate (estimate.json) or cestac (cestac.json).")] = "robot",
) -> None:
    """Print a JSON Schema; `symgen new` refers to the installed copy of that of robot files in its first line."""
    if of not in KINDS:
        fail(f"--of {of}; expected one of {', '.join(KINDS)}")
    typer.echo(text_of(of), nl=False)


def text_of(kind: str) -> str:
    """The JSON Schema of one of KINDS."""
    if kind == "robot":
        from symgen.description.schema import schema_text as robot_schema

        return robot_schema()
    from runtime.json_documents import schema_text

    return schema_text(kind)
