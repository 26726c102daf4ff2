"""Compute the data that the studio pages show, as plain values, in a separate process.

A view that fails returns an error and its place in the file.
"""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from functools import wraps
from hashlib import sha256
from html import unescape
from json import dumps
from pathlib import Path
from typing import Any

import numpy as np

import runtime
import symgen
from runtime.core.model import joint_labels, joint_torque_units, joint_units
from runtime.ground.errors import InputError, instant
from runtime.reporting.result_files import write_all
from runtime.reporting.series import base64, extremes
from symgen.derive.doubts import doubts
from symgen.derive.loops import close
from symgen.description import AngleWarning
from symgen.description.files import write_robot
from symgen.errors import SymgenError
from symgen.pages.page import figure
from symgen.studio.table import cells_of, degrees, errors
from symgen.studio.words import on_page
from symgen.update.mended import mended
from symgen.update.models import corrected, model_of, variants_of

FIRST_ROWS = 5  # first ones that are shown
MOST_NUMBERS = 2**23  # of the lines of one answer; of larger records, the extreme values
NAMES_LISTED = 200  # columns that are listed
COPIES = {"latex": "latex-fragment", "sympy": "sympy", "text": "text"}
"""Formats of the copies of a model, by the key of their button."""
TYPESET = 1000  # terms of a closed form that a browser draws at once


def answered(view: Callable[..., dict[str, Any]]) -> Callable[..., dict[str, Any]]:
    """Wrap a function so that an error is returned as a mapping with the keys error and path.

    Warnings of the library are added to the value as notes; a warning of rounded angles becomes a
    remark.
    """

    @wraps(view)
    def shown(*args: Any) -> dict[str, Any]:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                value = view(*args)
            except (SymgenError, InputError, OSError, MemoryError, ArithmeticError) as e:
                text = getattr(e, "message", "") or str(e) or type(e).__name__
                return {"error": on_page(text), "path": list(map(str, getattr(e, "path", ())))}
        angles = [str(w.message) for w in caught if issubclass(w.category, AngleWarning)]
        others = [str(w.message) for w in caught if not issubclass(w.category, AngleWarning)]
        notes = [on_page(note) for note in [*others, *value.get("notes", [])]]
        return value | {"remarks": [*map(on_page, angles)], "notes": notes}

    return shown


@answered
def robot(path: str, draft: str) -> dict[str, Any]:
    """Describe a robot file, or an unfinished draft of it, without deriving any model.

    Returns the text of its table, its drawing, angles in degrees, and doubts about the file.
    """
    if draft and (found := errors(draft)):
        told = [
            {"place": ".".join(map(str, e.path[:3])), "text": on_page(e.message)} for e in found
        ]
        return {"error": told[0]["text"], "errors": told}
    described = (
        symgen.parse_robot(draft.encode(), "robot.yaml") if draft else symgen.load_robot(path)
    )
    drawn = figure(described, close(described))
    for joint in drawn["joints"]:
        joint["label"] = described.labels.get(joint["j"], "")
    own = draft or (Path(path).read_text() if path.endswith(".yaml") else "")
    text = own or write_robot(described, "robot.yaml")[0]
    return {
        "text": text,
        "name": described.name,
        "title": described.title or described.name,
        "joints": described.joints,
        "labels": [described.labels.get(f.j, "") for f in described.frames],
        "figure": drawn,
        "degrees": degrees(cells_of(text)["frames"], described.constants),
        "notes": doubts(described),
    }


@answered
def formulas(path: str, before: str) -> dict[str, Any]:
    """List the base parameters with formulas, and the role of every standard parameter in them.

    A standard parameter is alone, regrouped or without effect, and the view says why. If `before`,
    an earlier text of the robot, is given, the differences of the base parameters from it are
    added.
    """
    from symgen.emit.spec import module_spec
    from symgen.pages.effects import effects
    from symgen.pages.page import printed
    from symgen.symbols import expressions
    from symgen.symbols.documents import printed as printed_model
    from symgen.symbols.printers import math, math_terms

    regrouping = symgen.regrouping(symgen.load_robot(path))
    reasons = {a.name: f"{a.columns}: {a.rule}" for a in symgen.absorptions(regrouping)}
    of = {e.name: e for e in effects(module_spec(regrouping))}
    difference = ""
    if before:
        earlier = symgen.regrouping(symgen.parse_robot(before.encode(), "robot.yaml"))
        difference = str(symgen.base_difference(earlier, regrouping))
    base = [
        {
            "symbol": math(expressions.parameter(b.name)),
            "terms": math_terms(expressions.formula(b.formula)) if b.name != b.own else [],
            "unit": printed(of[b.own].unit),
        }
        for b in regrouping.base
    ]
    parameters = [
        asdict(e)
        | {"symbol": math(expressions.parameter(e.name)), "unit": printed(e.unit)}
        | {"why": e.why or reasons.get(e.name, "identified in its own name")}
        for e in of.values()
    ]
    asked = symgen.symbolic(regrouping.robot).model("base_parameters")
    texts = {kind: printed_model(asked, "closed", form) for kind, form in COPIES.items()}
    meanings = {bare(p["symbol"]): f"{p['name']}: {p['meaning']}, {p['unit']}" for p in parameters}
    for b, row in zip(regrouping.base, base, strict=True):
        if row["terms"]:
            said = f"{b.name}: base parameter, {row['unit']}; {b.own} and what is regrouped into it"
            meanings[bare(str(row["symbol"]))] = said
    return {
        "base": base,
        "parameters": parameters,
        "difference": difference,
        "texts": texts,
        "meanings": meanings,
    }


@answered
def model(path: str, request: Mapping[str, str]) -> dict[str, Any]:
    """Prepare a symbolic model of the robot in four forms: typeset, text, LaTeX and SymPy.

    The form is the requested one; a closed form of more than 1000 terms (`TYPESET`) is not typeset.
    If a model has too many terms for a closed form, all forms show its recursion.
    """
    from symgen.symbols.documents import notes, printed, shown_model
    from symgen.symbols.symbolic_model import NoClosedFormError

    name, form = request.get("model", "gravity"), request.get("form", "closed")
    frames: dict[str, Any] = {
        key: int(x) for key in ("of", "frame") if (x := request.get(key, "")).isdigit()
    }
    asked = symgen.symbolic(symgen.load_robot(path)).model(name, **frames)
    why, long = "", False
    if form == "closed":
        try:
            terms = asked.closed.size
            if long := terms > TYPESET:
                why = f"The closed form has {terms} terms; it is shown as text. Its recursion is short."
        except NoClosedFormError as e:
            if asked.model.cases is None:
                raise
            form = "recursive"
            why = f"{e.reason[0].upper()}{e.reason[1:]}. The page shows and copies the recursion."
    return {
        "typeset": None if long else shown_model(asked, form, TYPESET),
        "why": why,
        "about": notes(asked),
        "form": form,
        "texts": {kind: printed(asked, form, language) for kind, language in COPIES.items()},
        "meanings": {} if long else meanings_of(asked, form),
    }


def meanings_of(asked: Any, form: str) -> dict[str, str]:
    """Describe the symbols of a symbolic model, by their printed texts."""
    from symgen.derive.names import FAMILIES, MEMBER
    from symgen.symbols import expressions
    from symgen.symbols.printers import math

    robot = asked.source.robot
    own = asked.closed.angles if form == "closed" else [x.name for x in asked.listing.lines]
    meanings = {
        f"q{j}": f"q{j}: position of joint {j}{f', {name}' if (name := robot.labels.get(j)) else ''}"
        for j in robot.joints
    }
    for name in [*own, *map(asked.label, asked.places)]:
        if member := MEMBER.match(name):
            meanings[bare(math(expressions.symbol(name)))] = (
                f"{name}: {FAMILIES[member[1] or member[2]]}"
            )
    return meanings


def bare(markup: str) -> str:
    """The text of a piece of MathML, as a browser copies it."""
    return unescape(re.sub(r"<[^>]*>|\s", "", markup))


@answered
def module(path: str, request: Mapping[str, str]) -> dict[str, Any]:
    """Generate the module of one target language, with certificate; return text by file name."""
    from symgen.certify.modules import certified_files

    described, targets = symgen.load_robot(path), (request.get("target", "numpy"),)
    return {"files": certified_files(described, targets=targets, command=described.file)}


@answered
def preview(path: str, request: Mapping[str, Any]) -> dict[str, Any]:
    """Show the columns of a measured file: names, first rows, and lines of all samples.

    `columns`, names separated by commas, selects the columns with rows and lines. The result
    includes the roles of columns as far as their names show them, as in `identify --suggest`, and
    sampling rate and gaps of the time column `t` in its `unit`. If `decimal` is not given, the
    decimal mark that reads more columns is used. `currents` says whether a name in `tau` has a word
    for current or effort; `others` is the number of joints of the file if it exceeds that of the
    robot.
    """
    from runtime.ground.clock import time_stamps
    from runtime.reading.formats import read_table
    from runtime.reading.likely_columns import joint_counts, known_columns, may_be_currents
    from runtime.reading.units import time_unit

    topic, mark = request["topic"], request.get("decimal", "") or "."
    opened = read_table(Path(path), topic, mark)
    if opened.refused and not request.get("decimal"):
        with suppress(InputError):
            other = read_table(Path(path), topic, ",")
            if len(other.refused) < len(opened.refused):
                opened, mark = other, ","
    if not opened.names:
        nothing = InputError("the file has no columns of numbers", file=opened.file)
        raise next(iter(opened.refused.values()), nothing)
    names = list(opened.names)[:NAMES_LISTED]
    asked = [n for n in request.get("columns", "").split(",") if n in names]
    chosen = opened.chosen(asked)
    values = [chosen.read([name])[:, 0] for name in asked]
    columns = dict(zip(asked, values, strict=True))
    N, t = len(values[0]) if values else 0, columns.get(request.get("t", ""))
    if t is not None:
        t = t * time_unit(request.get("unit") or "s")
    kept = _shown(np.reshape(values, (len(values), N)))
    known = known_columns(opened.columns, joints := request["joints"])
    counts = joint_counts(opened.columns, joints)
    return {
        "names": names,
        "others": counts if joints and max(counts.values()) > len(joints) else {},
        "known": known | ({"decimal": mark} if mark != "." else {}),
        "currents": may_be_currents(request.get("tau", "").split(",")),
        "rows": N,
        "stamps": "" if t is None else time_stamps(t).to_text(),
        "first": [[instant(x[k]) for x in values] for k in range(min(N, FIRST_ROWS))],
        "t": base64(kept if t is None else t[kept], "<f8"),
        "lines": {name: base64(x[kept]) for name, x in columns.items()},
    }


@answered
def recorded(path: str, request: Mapping[str, str]) -> dict[str, Any]:
    """Compute the lines of the record of a study, in SI units, for a plot.

    path : robot file.
    request : `study`, the study file.
    """
    model, _, (record, *_), named = _read(path, Path(request["study"]))
    kept = _shown(np.vstack([record.q.T, record.tau.T]))
    labels = joint_labels(model)
    units = {"q": joint_units(model), "tau": joint_torque_units(model)}
    lines = {
        name: {f"{name} {label}": base64(x) for label, x in zip(labels, values.T, strict=True)}
        for name, values in (("q", record.q[kept]), ("tau", record.tau[kept]))
    }
    return {
        "records": list(named),
        "rows": len(record),
        "t": base64(record.t[kept], "<f8"),
        "lines": lines,
        "units": {key: " or ".join(dict.fromkeys(own)) for key, own in units.items()},
    }


@answered
def series(path: str, request: Mapping[str, str]) -> dict[str, Any]:
    """Compute measured and predicted torques of one record of a run, with positions, for a plot.

    The record may be fitted or validated.

    path : robot file.
    request : `run`, the folder of the run, and `record`, the name of the record.
    """
    from runtime.core.validation import direct_comparison
    from runtime.documents.estimates import load_whole_estimate

    place = Path(request["run"])
    loaded, study, (record, *_), named = _read(path, place / "study.yaml", request["record"])
    fit = load_whole_estimate(place / "estimate.json")
    problem = runtime.problem(loaded, record, study)
    own = problem.prepared[0]
    selection, K = own.selection, len(own.selection.kept)
    torques = np.full((2, len(loaded.JOINTS), K), np.nan)
    for j, joint in enumerate(direct_comparison(own.observation(problem.model), fit)):
        rows = np.searchsorted(selection.t, joint.t).clip(max=K - 1)
        torques[:, j, rows] = joint.measured, joint.predicted
    lines = np.concatenate([*torques, torques[0] - torques[1]])
    shown = _shown(lines)
    return {
        "records": list(named),
        "t": base64(selection.t[shown], "<f8"),
        "joints": joint_labels(loaded),
        "q": list(map(base64, own.states.q[selection.samples.start + selection.kept[shown]].T)),
        "measured": list(map(base64, torques[0][:, shown])),
        "predicted": list(map(base64, torques[1][:, shown])),
    }


@answered
def changes(path: str, request: Mapping[str, str]) -> dict[str, Any]:
    """Compare the parameters of a run with the values of the robot file, as in the run's report.

    The table columns are empty if the robot file has no values, or if it has changed since the run.

    path : robot file.
    request : `run`, the folder of the run.
    """
    from runtime.documents.estimates import load_used_set
    from runtime.reporting.parameters import FILE_NOTE, cad_values, file_columns

    study = runtime.load_study(Path(request["run"]) / "study.yaml")
    loaded = model_of(corrected(symgen.load_robot(path), study), study=study)
    fit, used = load_used_set(Path(request["run"]) / "estimate.json")
    if fit.provenance.get("robot_sha256") != loaded.SOURCE_SHA256:
        return {
            "columns": {},
            "note": "The robot file has changed since this run; its values are left out.",
        }
    if not (cad := cad_values(loaded)):
        return {"columns": {}, "note": ""}
    columns = file_columns(fit.names, used, cad)
    of = {title: dict(zip(fit.names, cells, strict=True)) for title, cells in columns}
    return {"columns": of, "note": FILE_NOTE}


def _read(path: str, study_file: Path, asked: str | None = None) -> tuple[Any, ...]:
    """Load the model and the study, and read records of the study.

    Return model, study, records, and the settings of all records by name. The records are the
    fitted ones, or only the record called `asked`, by default the first. File names are relative to
    the study.
    """
    from runtime.compose import records_of
    from runtime.study import located

    study = located(runtime.load_study(study_file), study_file.parent)
    model = model_of(corrected(symgen.load_robot(path), study), study=study)
    named = {
        f"{k + 1}: {', '.join(Path(f).name for f in part.files) or part.dataset}, {use}": part
        for use, settings in (("fitted", study.record), ("validation", study.validate.record))
        for k, part in enumerate(settings)
    }
    chosen = study.record if asked is None else (named.get(asked, study.record[0]),)
    return model, study, records_of(chosen, model, study), named


@answered
def findings(robot_file: str, study_file: str) -> dict[str, Any]:
    """Check record, study and robot, and list checks, remedies and uncertain parameters.

    The uncertainty is the predicted standard deviation of each parameter, % of its largest possible
    value.
    """
    from runtime.plausible.motion import unexcited_shares

    of = digest_of(Path(robot_file), Path(study_file))
    loaded, study, records, _ = _read(robot_file, Path(study_file))
    variants = variants_of(corrected(symgen.load_robot(robot_file), study))
    judged = runtime.plausibility(loaded, records, study, variants=variants)
    rank, shares = 0, {}
    with suppress(InputError, np.linalg.LinAlgError):
        rows = runtime.observe(loaded, records, study)
        rank = int(np.linalg.matrix_rank(rows.W))
        shares = unexcited_shares(rows, study.signals, records[0].rate)
    return {
        "of": of,
        "checks": [asdict(check) for check in judged.checks()],
        "named": judged.named_causes,
        "deviations": dict(sorted(shares.items(), key=lambda item: -item[1])),
        "rank": rank,
        "count": len(loaded.BASE_PARAMETERS),
    }


@answered
def repair(robot_file: str, study_file: str) -> dict[str, Any]:
    """Search for the errors of the study, and write the mended study over it; list the changes.

    The list contains the earlier text of the study, so that it can be restored. If the study or the
    robot has been changed meanwhile, nothing is written.
    """
    from runtime.compose import records_of
    from runtime.study import located

    paths = Path(robot_file), Path(study_file)
    before, of = paths[1].read_text(encoding="utf-8"), digest_of(*paths)
    described = symgen.load_robot(robot_file)
    study = located(runtime.load_study(paths[1]), Path())
    model = model_of(corrected(described, study), study=study)
    found, text = mended(described, study, records_of(study.record, model, study), Path())
    if digest_of(*paths) != of:
        raise InputError("robot or study have been changed during the repair; repair again")
    if text:
        write_all(Path(), {paths[1].name: text})
    changes = [
        {
            "line": change.line,
            "was": change.was,
            "says": change.says,
            "without": change.error_without,
            "with": change.error_with,
        }
        for change in found.changes
    ]
    told = ("kept", "reason", "apart", "equivalent", "candidates")
    summary = {key: found.summary()[key] for key in told}
    return summary | {"of": digest_of(*paths), "changes": changes, "before": before, "after": text}


def check() -> None:
    """Check the robot and the study named on the command line, and write the findings to a file."""
    _written(findings)


def mend() -> None:
    """Repair the study named on the command line, and write the changes to a file."""
    _written(repair)


def _written(view: Callable[..., dict[str, Any]]) -> None:
    """Compute a view of ROBOT and STUDY and write it to FILE; ROBOT, STUDY and FILE are the
    arguments.

    If there is an error, print it as a line of JSON and exit with code 2.
    """
    robot_file, study_file, target = sys.argv[1:4]
    value = view(robot_file, study_file)
    if "error" in value:
        print(dumps({key: value[key] for key in ("error", "path")}), file=sys.stderr)
        sys.exit(2)
    write_all(Path(), {target: f"{dumps(value, indent=1)}\n"})


def digest_of(*paths: Path) -> str:
    """Compute one SHA-256 over the contents of several files."""
    return sha256(b"".join(path.read_bytes() for path in paths if path.is_file())).hexdigest()


def _shown(lines: np.ndarray) -> np.ndarray:
    """Indices of the samples of plotted lines that are sent to the page: all samples, unless they
    are too many.

    lines : shape (m, N).
    """
    return extremes(np.nan_to_num(lines), MOST_NUMBERS // (len(lines) + 1))
