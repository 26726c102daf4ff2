"""`symgen excite ROBOT [RECORD]`: a motion that lets the parameters be identified as well as the limits of the robot allow."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from runtime.result_files import reserved
from symgen.cli.session import model_of, progress_bar, reported_errors, single_thread, symbolic_path

if TYPE_CHECKING:
    from runtime.excitation.criteria import Limits, Weights
    from runtime.excitation.search import Excitation
    from runtime.model.generated import GeneratedModel
    from runtime.records.record import Record
    from runtime.settings.excitation import ExcitationSettings
    from runtime.settings.study import Study


@dataclass(frozen=True)
class Known:
    """What the search starts from: parameters, weights, and how good the motion of a record was (None without one)."""

    study: Study
    X: Any
    source: str
    weights: Weights
    before: float | None = None
    before_sigma: Any = None


def excite(
    robot: Annotated[str, typer.Argument(help="Packaged robot, robot file (.yaml, .par, .urdf) or generated module (.py).")],
    record: Annotated[
        str | None,
        typer.Argument(
            help="Dataset, study file or measured file: its estimate gives parameters and torque deviations, its motion is compared."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder for trajectory.csv, motion.yaml, excitation.json, report.html, the figure."),
    ] = None,
    criterion: Annotated[str | None, typer.Option(help="cond, logdet or sigma.")] = None,
    columns: Annotated[str | None, typer.Option(help="essential, all, or names separated by commas.")] = None,
    starts: Annotated[int | None, typer.Option(min=1, help="Random starts.")] = None,
    rate: Annotated[float | None, typer.Option(help="Controller rate, Hz.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the starts.")] = None,
    workers: Annotated[int, typer.Option(min=0, help="Processes; 0: this one. The results do not depend on it.")] = 0,
    json: Annotated[bool, typer.Option("--json", help="Print excitation.json instead of tables.")] = False,
) -> None:
    """Search an exciting motion. Families, limits and distances: section `excitation` of a study file.

    Without RECORD, or with a study file that names none, parameters are the values of the robot file.
    """
    single_thread()
    given: dict[str, Any] = {"criterion": criterion, "starts": starts, "rate": rate, "seed": seed}
    given["columns"] = columns.split(",") if columns and columns not in ("essential", "all") else columns
    with reported_errors(), reserved(output) as results:
        from runtime.excitation.criteria import limits_of
        from runtime.excitation.search import excite as search
        from runtime.records.named import study_of
        from runtime.records.reading import read_records
        from runtime.settings.excitation import ExcitationSettings
        from runtime.settings.schema import structure
        from runtime.settings.study import Study, to_mapping

        model = model_of(robot)
        study = Study()
        records: list[Record] = []
        if record is not None:
            study, folder = study_of(record)
            records = read_records(study.record, model, folder=folder)
        asked = to_mapping(study.excitation) if study.excitation is not None else {}
        settings = structure(ExcitationSettings, {**asked, **{k: v for k, v in given.items() if v is not None}})
        known = _known(model, replace(study, excitation=settings), settings, records)
        limits = limits_of(model, settings.limits)
        with progress_bar("starts") as progress:
            path = str(symbolic_path(robot, model))
            found = search(model, path, known.study, settings, known.weights, limits, known.X, workers=workers, progress=progress)
        summary = summary_of(model, found, known, settings, limits)
        if results is not None:
            results.write_all(excitation_files(model, found, known, limits, summary))
        typer.echo(json_of(summary) if json else console_text(summary), nl=not json)
        if output is not None:
            typer.echo(f"report: {output / 'report.html'}", err=True)


def _known(model: GeneratedModel, study: Study, settings: ExcitationSettings, records: Any) -> Known:
    """From a record: its estimate, deviations, essential parameters and condition. Without: the values of the robot file."""
    import numpy as np

    from runtime.errors import InputError
    from runtime.estimators.essential import essential_of
    from runtime.estimators.methods import estimate_of
    from runtime.excitation.criteria import kept_correlation, weights_of
    from runtime.observation.observation import observe, stack

    functions: Any = model
    if not records:
        values = dict(getattr(model, "VALUES", None) or {})
        if not values:
            raise InputError(f"{model.NAME} has no `values`; give a RECORD whose estimate tells the size of the parameters")
        values = dict.fromkeys(functions.NO_EFFECT, 0.0) | values
        if missing := [name for name in functions.STANDARD_PARAMETERS if name not in values]:
            raise InputError(
                f"`values` of {model.NAME} lack {', '.join(missing)}; give them (0 where one is zero), or a RECORD whose estimate tells them"
            )
        X = np.asarray(functions.base_parameters(values))
        return Known(study, X, "values of the robot file", weights_of(model, settings, dict(zip(model.BASE_PARAMETERS, X, strict=True))))
    seen = stack([observe(model, record, study) for record in records])
    linear = replace(study.estimate, method="ols", weights="none", options={}, columns="all")
    fit = estimate_of(seen, linear, model=model)
    if fit.status == "rank-deficient":
        raise InputError(f"the record does not determine {', '.join(' '.join(g) for g in fit.groups)}; leave RECORD out, or name columns")
    chosen = essential_of(seen, study.essential, linear)
    by_name = dict(zip(fit.names, fit.X, strict=True))
    s = [joint.sigma_rho for joint in fit.per_joint]
    weights = weights_of(model, settings, by_name, essential=chosen.names, s=s)
    names = ", ".join(record.name for record in records)
    return Known(
        study,
        fit.X,
        f"estimate of {names}",
        weights,
        weights.condition(seen),
        weights.relative_sigma(seen, kept_correlation(study.signals, records[0].rate)),
    )


def summary_of(model: GeneratedModel, found: Excitation, known: Known, settings: ExcitationSettings, limits: Limits) -> dict[str, Any]:
    """excitation.json."""
    import numpy as np

    from runtime.excitation.criteria import usage
    from runtime.settings.study import to_mapping

    names = known.weights.names
    before = {} if known.before_sigma is None else dict(zip(names, map(float, known.before_sigma), strict=True))
    return {
        "robot": model.NAME,
        "parameters_from": known.source,
        "duration": found.motion.duration,
        "cond": found.condition,
        "cond_of_record": known.before,
        "relative_sigma": found.relative_sigma,
        "relative_sigma_of_record": before,
        "torque_sigma": np.asarray(known.weights.s).tolist(),
        "limits_used": usage(model, found.motion, limits, settings.rate, known.X),
        "margin": found.margin,
        "starts": [{"number": s.number, "criterion": s.criterion, "violation": s.violation, "message": s.message} for s in found.starts],
        "settings": to_mapping(settings),
    }


def console_text(summary: dict[str, Any]) -> str:
    """Condition, the least certain parameters, how far the limits are used."""
    worst = sorted(summary["relative_sigma"].items(), key=lambda item: -item[1])[:10]
    before = summary["relative_sigma_of_record"]
    lines = [
        verdict(summary),
        "",
        f"{'predicted %sigma':<20}{'this motion':>12}{'record':>12}" if before else f"{'predicted %sigma':<20}{'this motion':>12}",
    ]
    lines += [f"{name:<20}{value:>12.3g}" + (f"{before[name]:>12.3g}" if before else "") for name, value in worst]
    lines += ["", "share of the limits used, % by joint"]
    lines += [f"{what:<14}" + "".join(f"{100 * x:8.1f}" for x in shares) for what, shares in summary["limits_used"].items()]
    return "\n".join(lines)


def verdict(summary: dict[str, Any]) -> str:
    """One sentence."""
    against = "" if summary["cond_of_record"] is None else f" (motion of the record: {summary['cond_of_record']:.1f})"
    worst = max(summary["relative_sigma"], key=summary["relative_sigma"].__getitem__)
    return (
        f"A motion of {summary['duration']:.1f} s within all limits with weighted cond(W) {summary['cond']:.1f}{against}; "
        f"least certain is {worst} with a predicted %sigma of {summary['relative_sigma'][worst]:.2g}."
    )


def excitation_files(
    model: GeneratedModel, found: Excitation, known: Known, limits: Limits, summary: dict[str, Any]
) -> dict[str, str | bytes]:
    """Contents of the output folder, by file name."""
    import numpy as np

    from runtime.reporting import figures as plots
    from runtime.reporting.excitation import excitation_page, motion_figure
    from runtime.reporting.page import render
    from runtime.settings.yaml import yaml_text

    functions: Any = model
    t, q, qd, qdd = found.motion.sampled(summary["settings"]["rate"])
    tau = functions.inverse_dynamics(q, qd, qdd, known.X)
    n = q.shape[1]
    header = ",".join(["t", *(f"{x}{j + 1}" for x in ("q", "qd", "qdd") for j in range(n))])
    rows = "\n".join(",".join(f"{x:.10g}" for x in row) for row in np.column_stack([t, q, qd, qdd]))
    figure = motion_figure(model.JOINTS, t, (q, qd, qdd, tau), limits)
    return {
        "report.html": render(excitation_page(model.NAME, verdict(summary), plots.svg(figure), summary)),
        "excitation.json": json_of(summary),
        "trajectory.csv": f"{header}\n{rows}\n",
        "motion.yaml": yaml_text({"motion": found.motion.to_mapping()}),
        "motion.png": plots.png(figure),
    }


def json_of(summary: dict[str, Any]) -> str:
    """Text of excitation.json."""
    from runtime.json_documents import json_text

    return json_text(summary)
