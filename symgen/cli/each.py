"""The option --each of `symgen identify`: every record alone, with its results in its own folder.

    FOLDER/NAME/estimate.json, parameters.csv, study.yaml

A record is left out if FOLDER/NAME has its results already: `asked` in estimate.json is the hash of
the files of the record, the study, the robot, the options and the version.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from symgen.cli import session
from symgen.version import VERSION

if TYPE_CHECKING:
    from runtime.core.model import GeneratedModel
    from runtime.study import Study

Job = tuple[str, "Study"]
"""Name of a record, and the study of this record alone."""
ESTIMATE = "estimate.json"


def identify_each(
    model: GeneratedModel, study: Study, output: Path, workers: int, **options: Any
) -> bool:
    """Identify the parameters from each record of a study alone, and print a line for each record.

    If a record cannot be used, its line gives the reason, and the other records are still
    identified. Existing results are kept.

    options : as for `runtime.identify`.

    Returns
    -------
    bool
        Whether the parameters of every record can be used.
    """
    from runtime.parallel.processes import processes

    jobs = jobs_of(study)
    asked = partial(identified, model=model, output=output, options=options)
    lines, good, kept = [], True, 0
    with session.progress_bar("records") as progress, processes(workers) as own_map:
        try:
            for done, (line, usable, existed) in enumerate(own_map(asked, jobs), start=1):
                lines.append(line)
                good, kept = good and usable, kept + existed
                progress(done, len(jobs))
        except KeyboardInterrupt:
            typer.echo("stopped; repeat the command to continue", err=True)
            raise typer.Exit(session.INTERRUPTED) from None
    session.show("\n".join(lines))
    session.say(f"{len(jobs)} records in {output}; {kept} of them had their results already")
    return good


def jobs_of(study: Study) -> list[Job]:
    """List the records of a study, each with its name as a folder and a study of its own.

    Raise InputError if two records have the same name.
    """
    from dataclasses import replace

    from runtime.ground.errors import InputError
    from runtime.reading.records import labels
    from runtime.reading.settings import each_record

    records = each_record(study.record)
    parts = [re.split(r"[/\\]", label.name) for label in labels(records)]
    names = ["/".join(x for x in part if x.strip(". ")) or "record" for part in parts]
    for k, name in enumerate(names):
        if name in names[:k]:
            raise InputError(f"two records are called {name}; give record.name in the study")
    alone = [replace(study, record=(record,)) for record in records]
    return list(zip(names, alone, strict=True))


def identified(
    job: Job, *, model: GeneratedModel, output: Path, options: Mapping[str, Any]
) -> tuple[str, bool, bool]:
    """Identify from one record and write the results, if they do not exist.

    Return the line of the record, whether its parameters can be used, and whether its results
    existed.
    """
    import runtime
    from runtime.compose import records_of
    from runtime.core.provenance import processor
    from runtime.ground.errors import InputError
    from runtime.reporting.parameters import parameters_csv
    from runtime.reporting.result_files import write_all
    from runtime.study import study_text

    name, study = job
    folder = output / name
    try:
        hashed = hash_of(study, model, folder, options)
        if existed := (found := result_of(folder, hashed)) is not None:
            return (*told(name, found), existed)
        result = runtime.identify(
            model,
            records_of(study.record, model, study),
            study,
            provenance={"processor": processor(), "asked": hashed},
            **options,
        )
        settings: Any = result.study
        files = {
            ESTIMATE: result.to_json(),
            "parameters.csv": parameters_csv(result),
            "study.yaml": study_text(settings, folder),
        }
        write_all(folder, files)
    except InputError as e:
        return f"{name}: failed. {e}", False, False
    return (*told(name, json.loads(files[ESTIMATE])), False)


def hash_of(study: Study, model: GeneratedModel, folder: Path, options: Mapping[str, Any]) -> str:
    """Return the SHA-256 of all data that determine the results of a study of one record in
    `folder`.

    A file that cannot be read counts as empty, because reading the record will report the error.
    """
    from runtime.ground.errors import InputError
    from runtime.reading.files import is_file, sha256_of
    from runtime.reading.records import record_files
    from runtime.study import study_text

    texts = [study_text(study, folder), model.SOURCE_SHA256, VERSION]
    texts += [f"{key}: {options[key]}" for key in sorted(options) if key != "variants"]
    whole = sha256("\n".join(texts).encode())
    for file in record_files(study.record[0], Path()):
        with suppress(OSError, InputError):
            whole.update(sha256_of(file).encode() if is_file(file) else b"")
    return whole.hexdigest()


def result_of(folder: Path, hashed: str) -> dict[str, Any] | None:
    """Return the results in a folder if their hash is `hashed`, else None."""
    try:
        found = json.loads((folder / ESTIMATE).read_text(encoding="utf-8"))
        return dict(found) if found["provenance"]["asked"] == hashed else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def told(name: str, found: Mapping[str, Any]) -> tuple[str, bool]:
    """Write the line of a record from its results, and return whether the results can be used."""
    used = [one for one in found["sets"] if one["name"] == found["model_columns"]]
    error = [*used, found][0]["relative_error"]
    answer = found["checklist"]
    return f"{name}: {error:.1f} %, {answer['answer']}", answer["state"] != "no"
