"""Identification of each of many records alone, with the results of each in its own folder.

    FOLDER/NAME/estimate.json, parameters.csv, study.yaml

A record is left out if FOLDER/NAME has its results already: `asked` in estimate.json is the hash of
the measured files, the study, the robot, the options and the version.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

from runtime.compose import entry, identify, records_of, require_study
from runtime.core.model import GeneratedModel, require_emitted
from runtime.core.provenance import processor, versions
from runtime.ground.arrays import require_kind
from runtime.ground.errors import InputError
from runtime.reading.files import is_file, sha256_of
from runtime.reading.records import labels, record_files
from runtime.reading.settings import each_record
from runtime.reporting.parameters import parameters_csv
from runtime.reporting.result_files import results_in, write_all
from runtime.study import Study, located, study_text

Job = tuple[str, Study, str]
"""Name of a record, the study of this record alone, and the hash of all that decides its results."""
Row = dict[str, Any]
"""What is known of one record: record, error, state, text, kept; see `identify_each`."""
ESTIMATE = "estimate.json"


@entry
def identify_each(
    model: GeneratedModel,
    study: Study,
    folder: str | Path,
    *,
    map: Callable[..., Iterable[Any]] = map,
    progress: Callable[[int, int], None] | None = None,
    physical: bool = False,
    friction: bool = False,
    variants: GeneratedModel | None = None,
    plausible: bool | None = None,
) -> list[Row]:
    """Identify the parameters from each record of a study alone, and write the results of each.

    FOLDER/NAME/ gets estimate.json, parameters.csv and study.yaml. Results that exist are kept if
    the measured files, the study, the robot, the options and the version are those of before; so an
    interrupted call is continued by the same call. If a record cannot be
    used, its row gives the reason, and the other records are still identified.

    Parameters
    ----------
    model : GeneratedModel
        An emitted module.
    study : Study
        Settings, with the files of all records (`record.files`, `record.also`).
    folder : str or Path
        Folder of the results, which is made if it is missing. On a cluster, every machine needs
        this folder and the measured files, under the same names.
    map : function
        Like the built-in map; identifies the records in processes
        (`runtime.parallel.processes.processes`) or on a Dask cluster (docs/many_runs.md).
    progress : function of two numbers, optional
        Called with the number of finished records and of all; first with the number of those whose
        results are kept.
    physical, friction, variants, plausible
        As of `identify`.

    Returns
    -------
    list of dict
        A row for each record, in the order of the study: `record`, its name and that of its folder;
        `error`, the relative error of the torques, %, or None; `state`, good, doubtful or no, or
        failed; `text`, the answer of the verdict or the reason of the failure; `kept`, whether its
        results existed.

    Raises
    ------
    InputError
        The folder cannot be written. An error of `map`, for example of a worker that died, is
        raised with a note that names the record and says how many records are finished.

    Examples
    --------
    >>> import tempfile, numpy as np, runtime, symgen
    >>> folder, t = tempfile.mkdtemp(), np.arange(0, 10, 0.001)
    >>> for k, mass in enumerate((95, 105)):
    ...     q, tau = np.sin(t), 200 * np.cos(t) - mass * np.sin(t) + 20 * np.sign(np.cos(t))
    ...     np.savez(f"{folder}/run{k}.npz", t=t, q1=q, tau1=tau)
    >>> files = {"files": [f"{folder}/run0.npz"], "also": [[f"{folder}/run1.npz"]]}
    >>> model, study = symgen.model("emps"), runtime.Study(record=files)
    >>> rows = runtime.identify_each(model, study, f"{folder}/results")
    >>> [(row["record"], row["kept"]) for row in rows]
    [('run0', False), ('run1', False)]
    """
    require_emitted(model)
    require_kind(folder, (str, Path), "folder", "the name of a folder")
    place = Path(folder).absolute()
    options = {"physical": physical, "friction": friction, "plausible": plausible}
    asked = {**options, "variants": variants is not None}
    jobs = jobs_of(require_study(study), model, place, asked)
    rows = {name: kept for name, _, hashed in jobs if (kept := row_of(place, name, hashed))}
    left = [job for job in jobs if job[0] not in rows]
    work = partial(identified, model=model, place=place, options={**options, "variants": variants})
    tell = progress or (lambda done, total: None)
    with results_in(place):
        tell(len(rows), len(jobs))
        try:
            for job, row in zip(left, map(work, left), strict=True):
                rows[job[0]] = row
                tell(len(rows), len(jobs))
        except BaseException as e:
            following = next((name for name, *_ in left if name not in rows), None)
            e.add_note(
                f"{len(rows)} of {len(jobs)} records are finished, and their results are in {folder}"
                + (f"; the next one was {following}" if following else "")
            )
            raise
    return [rows[name] for name, *_ in jobs]


def jobs_of(
    study: Study, model: GeneratedModel, place: Path, options: Mapping[str, Any]
) -> list[Job]:
    """List the records of a study: name as a folder, study of its own with absolute paths, and hash.

    InputError if there is no record, or if two have the same name.
    """
    records = each_record(study.record)
    if not records:
        raise InputError("the study names no record; set record.files")
    parts = [re.split(r"[/\\]", label.name) for label in labels(records)]
    names = ["/".join(x for x in part if x.strip(". ")) or "record" for part in parts]
    for name, count in Counter(names).most_common(1):
        if count > 1:
            raise InputError(f"two records are called {name}; give record.name in the study")
    alone = [located(replace(study, record=(record,)), Path.cwd()) for record in records]
    return [
        (name, one, hash_of(one, model, place / name, options))
        for name, one in zip(names, alone, strict=True)
    ]


def hash_of(study: Study, model: GeneratedModel, folder: Path, options: Mapping[str, Any]) -> str:
    """Compute the SHA-256 of all that decides the results of a study of one record in `folder`.

    A file that cannot be read counts as empty: reading the record tells it.
    """
    texts = [study_text(study, folder), model.SOURCE_SHA256, versions()["symgen"]]
    texts += [f"{key}: {options[key]}" for key in sorted(options)]
    whole = sha256("\n".join(texts).encode())
    loaded = () if study.payload is None else study.payload.record
    for record in (*study.record, *study.validate.record, *loaded):
        with suppress(OSError, InputError):
            for file in record_files(record, Path()):
                whole.update(sha256_of(file).encode() if is_file(file) else b"")
    return whole.hexdigest()


def row_of(place: Path, name: str, hashed: str) -> Row | None:
    """Return the row of a record whose results are in its folder and are those of `hashed`."""
    with suppress(OSError, ValueError, KeyError, TypeError, RecursionError):
        found = json.loads((place / name / ESTIMATE).read_text(encoding="utf-8"))
        if found["provenance"]["asked"] == hashed:
            return {**_judged(name, found), "kept": True}
    return None


def identified(job: Job, *, model: GeneratedModel, place: Path, options: Mapping[str, Any]) -> Row:
    """Identify the parameters from one record, write the results, and return its row."""
    name, study, hashed = job
    folder = place / name
    try:
        records = records_of(study.record, model, study)
        provenance = {"processor": processor(), "asked": hashed}
        result = identify(model, records, study, provenance=provenance, **options)
        settings: Any = result.study
        files = {
            ESTIMATE: result.to_json(),
            "parameters.csv": parameters_csv(result),
            "study.yaml": study_text(settings, folder),
        }
        write_all(folder, files)
    except InputError as e:
        return {"record": name, "error": None, "state": "failed", "text": str(e), "kept": False}
    return {**_judged(name, json.loads(files[ESTIMATE])), "kept": False}


def _judged(name: str, found: Mapping[str, Any]) -> Row:
    """Return error and answer of the verdict from the results of a record."""
    used = [one for one in found["sets"] if one["name"] == found["model_columns"]]
    error = [*used, found][0]["relative_error"]
    answer = found["checklist"]
    return {"record": name, "error": error, "state": answer["state"], "text": answer["answer"]}


__all__ = ["identify_each"]
