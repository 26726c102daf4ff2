"""`symgen datasets`: the measured records this program knows, and where their files lie."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli.session import reported_errors


def datasets(json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False) -> None:
    """List datasets: name, robot, files, where they are, and where they come from. Nothing is downloaded."""
    with reported_errors():
        from runtime.records.datasets import listing

        rows = listing()
        if json:
            import json as json_module

            typer.echo(json_module.dumps(rows, indent=2))
            return
        for row in rows:
            typer.echo(f"{row['name']}: {row['title']}")
            for file in row["files"]:
                typer.echo(f"  {file['name']:<24} {file['path'] or 'not here; symgen fetches it on first use'}")
                typer.echo(f"  {'':<24} {file['url']}\n  {'':<24} sha256 {file['sha256']}")
