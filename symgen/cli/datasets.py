"""The command `symgen datasets`: list the known measured records, and where their files are."""

from __future__ import annotations

from symgen.cli import options, session


def datasets(json: options.Json = False) -> None:
    """List datasets: name, robot, files, where they are, and where they come from. Nothing is
    downloaded.
    """
    with session.reported_errors():
        from json import dumps

        from runtime.reading.datasets import listing

        rows, lines = listing(), []
        for row in rows:
            lines.append(f"{row['name']}: {row['title']}")
            for file in row["files"]:
                place = file["path"] or "not here; symgen fetches it on first use"
                lines.append(f"  {file['name']:<24} {place}")
                lines += [f"{'':<26} {text}" for text in (file["url"], f"sha256 {file['sha256']}")]
        session.show(dumps(rows, indent=2) if json else "\n".join(lines))
