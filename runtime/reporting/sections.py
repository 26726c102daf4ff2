"""Sections of an identification report: values in, tables and figures out. No robot is special
here.
"""

from __future__ import annotations

import csv
import io

from runtime.identification.result import Identification
from runtime.markup import number
from runtime.reporting import figures as plots
from runtime.reporting.correlations import correlation_section
from runtime.reporting.page import Section
from runtime.reporting.parameters import parameter_section
from runtime.reporting.plausibility import plausibility_section
from runtime.reporting.residuals import residual_section
from runtime.reporting.series import series
from runtime.reporting.uncertainty import uncertainty_section
from runtime.table import Table

MEANING = {
    "both": "position and torque (used where the settings say so)",
    "position": "position alone",
    "torque": "torque alone",
    "none": "none",
}


def identification_sections(result: Identification) -> list[Section]:
    """Parameters, torques, errors per joint, residuals, weak directions, trust, trail, validation,
    coupling.
    """
    unit = result.torque_unit
    return [
        parameter_section(result),
        *([] if result.plausibility is None else [plausibility_section(result.plausibility)]),
        torque_section(result),
        joint_section(result),
        *(
            [record_section(result)]
            if result.record_errors or result.time_stamps or result.homogeneity
            else []
        ),
        *([motion_section(result)] if result.motion_table().rows else []),
        residual_section(result, unit),
        correlation_section(result),
        uncertainty_section(result.uncertainty),
        trail_section(result),
        validation_section(result),
        *([coupling_section(result)] if result.coupling else []),
    ]


def torque_section(result: Identification) -> Section:
    """Fig. 4 of the chapter, one figure per joint, which a script lets zoom."""
    unit = result.torque_unit
    columns = {"essential": "the essential", "feasible": "the physical", "all": "all"}[
        result.model_columns
    ]
    images = [
        plots.drawn(
            (
                f"Joint {joint.joint}: {result.source}, predicted by {columns} parameters, and "
                "error "
                f"below; {joint.relative_error:.2f} % of the {result.source} norm"
            ),
            plots.joint_overlay(joint, unit, result.source),
            (
                f"Torque of joint {joint.joint} against time: {result.source}, predicted, error; "
                "error "
                f"{joint.relative_error:.1f} %"
            ),
            series=series(joint, unit, result.source),
        )
        for joint in result.comparison
    ]
    text = (
        [
            (
                f"Read by blocks: figures show the first {result.compared_rows} of "
                f"{result.estimate.rows} rows, tables count all."
            )
        ]
        if result.compared_rows < result.estimate.rows
        else []
    )
    thinned = max(
        (image.series.total - len(image.series.t) for image in images if image.series is not None),
        default=0,
    )
    if thinned > 0:
        text.append(
            "Long records: the lines keep the largest and smallest value of every stretch and "
            "leave the instants between out."
        )
    return Section(f"{result.source.capitalize()} and predicted torques", text, images)


def joint_section(result: Identification) -> Section:
    """Errors in total and per joint."""
    header = (
        "joint",
        "rows",
        "all parameters: error %",
        "essential: error %",
        f"essential: sigma_rho, {result.torque_unit}",
    )
    fit, essential = result.estimate, result.essential.estimate
    rows = [
        (
            a.joint,
            str(a.rows),
            number(a.relative_error, ".2f"),
            number(b.relative_error, ".2f"),
            number(b.sigma_rho),
        )
        for a, b in zip(fit.per_joint, essential.per_joint, strict=True)
    ]
    rows.append(
        (
            "total",
            str(fit.rows),
            number(fit.relative_error, ".2f"),
            number(essential.relative_error, ".2f"),
            number(essential.sigma_rho),
        )
    )
    text = (
        f"{fit.rows} rows, {len(fit.names)} parameters, rank {fit.rank}; condition number of W "
        f"{number(fit.cond)}, {number(fit.cond_unit)} "
        f"with columns of norm 1. Residual norm {number(fit.residual_norm, '.6g')} with all "
        f"parameters, {number(essential.residual_norm, '.6g')} with the "
        "essential ones. The error is 100 ||Y - W X|| / ||Y||.",
        *([fit.message] if fit.message else []),
    )
    return Section(
        "Errors in total and per joint",
        text,
        tables=[Table("Relative error by joint", header, rows)],
    )


def record_section(result: Identification) -> Section:
    """Errors of each of several records, and what their time stamps were like."""
    header = (
        "record",
        "rows",
        "error %",
        *(f"joint {joint.joint}" for joint in result.model_estimate.per_joint),
    )
    rows = [
        (
            one.name,
            str(one.rows),
            number(one.relative_error, ".2f"),
            *(number(e, ".2f") for e in one.per_joint),
        )
        for one in result.record_errors
    ]
    tables = [Table("Relative error by record and joint, %", header, rows)] if rows else []
    text = list(result.time_stamps)
    if result.homogeneity is not None:
        text.append(result.homogeneity.text)
        tables += [result.homogeneity.table()] if result.homogeneity.disagreements else []
    return Section("Records", text, tables=tables)


def motion_section(result: Identification) -> Section:
    """Whether the simulated loop follows the record."""
    text = (
        (
            "The loop of the study with the parameters found, beside the record. Parameters of a "
            "simulation that does not follow the record are those of nothing."
        ),
    )
    return Section("Simulated motion", text, tables=[result.motion_table()])


def trail_section(result: Identification) -> Section:
    """How the essential parameters were result."""
    essential = result.essential
    first = len(result.estimate.names)
    rows = [
        (
            step.name if step.removed else f"{step.name} (kept)",
            str(first - k - step.removed),
            number(step.relative_sigma, ".2f"),
            number(step.ratio, ".4f"),
        )
        for k, step in enumerate(essential.trail)
    ]
    counts = ", ".join(
        f"{count} at {threshold:.2f}" for threshold, count in essential.counts.items()
    )
    text = (
        "The parameter of largest %sigma is removed and the rest fitted again while sigma_rho "
        f"stays below {essential.threshold:g} times its first "
        f"value: {len(essential.names)} of {first} remain. The count depends on that threshold: "
        f"{counts}.",
    )
    return Section(
        "Essential parameters",
        text,
        tables=[
            Table("Trail", ("removed", "left", "%sigma before", "sigma_rho ratio after"), rows)
        ],
    )


def validation_section(result: Identification) -> Section:
    """One part of the data predicts the others."""
    tables = []
    for part in result.validation:
        rows = [
            (
                p.part,
                f"{p.columns} ({p.count})",
                "fitted" if p.fitted else "predicted",
                *(number(v, ".2f") for v in (p.relative_error, *p.per_joint)),
            )
            for p in part.predictions
        ]
        tables.append(
            Table(
                "Relative error, %",
                ("part", "parameters", "use", "total", *(f"joint {j}" for j in part.joints)),
                rows,
            )
        )
    text = (
        (
            "Parameters fitted on one part of the data predict the torques of another; the "
            "essential "
            "names are those of the whole record."
        ),
        result.ranking,
    )
    return Section("Cross-validation", text, tables=tables)


def coupling_section(result: Identification) -> Section:
    """The fit with the coupling of the drives taken into account, or not."""
    joints = [joint.joint for joint in result.estimate.per_joint]
    rows = [
        (
            MEANING[coupling],
            number(fit.relative_error, ".2f"),
            *(number(joint.relative_error, ".2f") for joint in fit.per_joint),
        )
        for coupling, fit in result.coupling.items()
    ]
    text = (
        "The drives are coupled: one motor also turns with another joint. Leaving the coupling out "
        "changes the total little, it may even look "
        "better; the joints concerned tell.",
    )
    table = Table(
        "Relative error of all parameters, %",
        ("coupling used in", "total", *(f"joint {j}" for j in joints)),
        rows,
    )
    return Section("With and without the coupling of the drives", text, tables=[table])


def parameters_csv(result: Identification) -> str:
    """parameters.csv: name, value, sigma, %sigma, corrected sigma, unit; then value and %sigma of
    the essential fit, empty where removed.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(
        (
            "name",
            "X",
            "sigma",
            "relative_sigma",
            "sigma_corrected",
            "unit",
            "X_essential",
            "relative_sigma_essential",
        )
    )
    fit, essential = result.estimate, result.essential.estimate
    for i, name in enumerate(fit.names):
        own = [fit.X[i], fit.sigma[i], fit.relative_sigma[i], fit.sigma_corrected[i]]
        k = essential.names.index(name) if name in essential.names else None
        alone = (
            ["", ""]
            if k is None
            else [repr(float(essential.X[k])), repr(float(essential.relative_sigma[k]))]
        )
        writer.writerow((name, *(repr(float(x)) for x in own), fit.units.get(name, ""), *alone))
    return stream.getvalue()
