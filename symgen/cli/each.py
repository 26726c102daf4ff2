"""The option --each of `symgen identify`: every record alone, with a line for each."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgen.cli import session

if TYPE_CHECKING:
    from runtime.core.model import GeneratedModel
    from runtime.each import Row
    from runtime.study import Study


def identify_each(
    model: GeneratedModel, study: Study, output: Path, workers: int, **options: Any
) -> bool:
    """Identify the parameters from each record of a study alone, and print a line for each record.

    If a record cannot be used, its line gives the reason, and the other records are still
    identified. Existing results are kept.

    options : as for `runtime.identify_each`.

    Returns
    -------
    bool
        Whether the parameters of every record can be used.
    """
    import runtime
    from runtime.parallel.processes import processes

    with session.progress_bar("records") as progress, processes(workers) as own_map:
        try:
            rows = runtime.identify_each(
                model, study, output, map=own_map, progress=progress, **options
            )
        except KeyboardInterrupt as e:
            session.stopped("; ".join(getattr(e, "__notes__", ())))
    session.show("\n".join(map(line_of, rows)))
    kept = sum(row["kept"] for row in rows)
    session.say(f"{len(rows)} records in {output}; {kept} of them had their results already")
    return all(row["state"] not in ("no", "failed") for row in rows)


def line_of(row: Row) -> str:
    """Write the line of a record: its error and the answer of the verdict, or why it failed."""
    failed = "failed. " if row["state"] == "failed" else ""
    error = "" if row["error"] is None else f"{row['error']:.1f} %, "
    return f"{row['record']}: {failed}{error}{row['text']}"
