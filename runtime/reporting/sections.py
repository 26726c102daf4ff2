"""Sections of an identification report: values in, tables and figures out. No robot is special here."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

from runtime.identification.identification import Identification
from runtime.markup import number
from runtime.reporting import figures as plots
from runtime.reporting.correlations import weak_section
from runtime.reporting.page import Image, Number, Section, State, Table
from runtime.reporting.parameters import parameter_section
from runtime.reporting.residuals import residual_section
from runtime.reporting.series import series
from runtime.reporting.uncertainty import trust_section
from runtime.resolution.result import Cestac

MEANING = {
    "both": "position and torque (used where the settings say so)",
    "position": "position alone",
    "torque": "torque alone",
    "none": "none",
}


def torque_unit(found: Identification) -> str:
    """N for a robot whose joints are all prismatic by their units, else N m."""
    units = set(dict(getattr(found.model, "UNITS", {})).values())
    return "N" if "N" in units and "N*m" not in units else "N m"


def identification_sections(found: Identification) -> list[Section]:
    """Parameters, torques, errors per joint, residuals, weak directions, trust, trail, validation, coupling."""
    unit = torque_unit(found)
    return [
        parameter_section(found),
        torque_section(found),
        joint_section(found),
        *([record_section(found)] if found.by_record or time_texts(found) else []),
        residual_section(found, unit),
        weak_section(found),
        trust_section(found.trust),
        trail_section(found),
        validation_section(found),
        *([coupling_section(found)] if found.coupling else []),
    ]


def torque_section(found: Identification) -> Section:
    """Fig. 4 of the chapter, one figure per joint, which a script lets zoom."""
    unit = torque_unit(found)
    which = "the essential" if found.carried is found.found.estimate else "all"
    images = [
        Image(
            f"Joint {joint.joint}: {found.source}, predicted by {which} parameters, and error below; {joint.relative_error:.2f} % of the {found.source} norm",
            plots.svg(plots.joint_overlay(joint, unit, found.source)),
            f"Torque of joint {joint.joint} against time: {found.source}, predicted, error; error {joint.relative_error:.1f} %",
            series(joint, unit, found.source),
        )
        for joint in found.comparison
    ]
    text = (
        [f"Read by blocks: figures show the first {found.shown_rows} of {found.every.rows} rows, tables count all."]
        if found.in_part
        else []
    )
    thinned = max((image.series.total - len(image.series.t) for image in images if image.series is not None), default=0)
    if thinned > 0:
        text.append("Long records: the lines keep the largest and smallest value of every stretch and leave the instants between out.")
    return Section(f"{found.source.capitalize()} and predicted torques", text, images)


def joint_section(found: Identification) -> Section:
    """Errors in total and per joint."""
    header = ("joint", "rows", "all parameters: error %", "essential: error %", f"essential: sigma_rho, {torque_unit(found)}")
    every, kept = found.every, found.found.estimate
    rows = [
        (a.joint, str(a.rows), number(a.relative_error, ".2f"), number(b.relative_error, ".2f"), number(b.sigma_rho))
        for a, b in zip(every.per_joint, kept.per_joint, strict=True)
    ]
    rows.append(("total", str(every.rows), number(every.relative_error, ".2f"), number(kept.relative_error, ".2f"), number(kept.sigma_rho)))
    text = (
        f"{every.rows} rows, {len(every.names)} parameters, rank {every.rank}; condition number of W {number(every.cond)}, {number(every.cond_unit)} "
        f"with columns of norm 1. Residual norm {number(every.residual_norm, '.6g')} with all parameters, {number(kept.residual_norm, '.6g')} with the "
        "essential ones. The error is 100 ||Y - W X|| / ||Y||.",
        *([every.message] if every.message else []),
    )
    return Section("Errors in total and per joint", text, tables=[Table("Relative error by joint", header, rows)])


def record_section(found: Identification) -> Section:
    """Errors of each of several records, and what their time stamps were like."""
    header = ("record", "rows", "error %", *(f"joint {joint.joint}" for joint in found.carried.per_joint))
    rows = [
        (one.name, str(one.rows), number(one.relative_error, ".2f"), *(number(e, ".2f") for e in one.per_joint)) for one in found.by_record
    ]
    tables = [Table("Relative error by record and joint, %", header, rows)] if rows else []
    return Section("Records", time_texts(found), tables=tables)


def time_texts(found: Identification) -> tuple[str, ...]:
    """What the time stamps of the records were like, those of one file once."""
    told = {record.name.split(" (")[0]: said for record in found.records if (said := getattr(record, "time", ""))}
    return tuple(f"Time stamps of {name}: {said}." for name, said in told.items())


def trail_section(found: Identification) -> Section:
    """How the essential parameters were found."""
    essential = found.found
    first = len(found.every.names)
    rows = [
        (
            step.name if step.removed else f"{step.name} (kept)",
            str(first - k - step.removed),
            number(step.relative_sigma, ".2f"),
            number(step.ratio, ".4f"),
        )
        for k, step in enumerate(essential.trail)
    ]
    counts = ", ".join(f"{count} at {threshold:.2f}" for threshold, count in essential.counts.items())
    text = (
        f"The parameter of largest %sigma is removed and the rest fitted again while sigma_rho stays below {essential.threshold:g} times its first "
        f"value: {len(essential.names)} of {first} remain. The count depends on that threshold: {counts}.",
    )
    return Section(
        "Essential parameters", text, tables=[Table("Trail", ("removed", "left", "%sigma before", "sigma_rho ratio after"), rows)]
    )


def validation_section(found: Identification) -> Section:
    """One part of the data predicts the others."""
    tables = []
    for part in found.validation:
        rows = [
            (
                p.part,
                f"{p.columns} ({p.count})",
                "fitted" if p.fitted else "predicted",
                *(number(v, ".2f") for v in (p.relative_error, *p.per_joint)),
            )
            for p in part.predictions
        ]
        tables.append(Table("Relative error, %", ("part", "parameters", "use", "total", *(f"joint {j}" for j in part.joints)), rows))
    text = ("Parameters fitted on one part of the data predict the torques of another; the essential names are those of the whole record.",)
    return Section("Cross-validation", text, tables=tables)


def coupling_section(found: Identification) -> Section:
    """The fit with the coupling of the drives taken into account, or not."""
    joints = [joint.joint for joint in found.every.per_joint]
    rows = [
        (MEANING[coupling], number(fit.relative_error, ".2f"), *(number(joint.relative_error, ".2f") for joint in fit.per_joint))
        for coupling, fit in found.coupling.items()
    ]
    text = (
        "The drives are coupled: one motor also turns with another joint. Leaving the coupling out changes the total little, it may even look "
        "better; the joints concerned tell.",
    )
    table = Table("Relative error of all parameters, %", ("coupling used in", "total", *(f"joint {j}" for j in joints)), rows)
    return Section("With and without the coupling of the drives", text, tables=[table])


def resolution_section(
    result: Cestac, title: str = "Encoder resolution", *, curve: Cestac | None = None, names: Sequence[str] = ()
) -> Section:
    """Table 3 of the chapter with %e and %sigma, both readings of %e(rho), and the curve of %e against Delta."""
    drawn = curve or result
    unit = "m" if {drawn.reference.units.get(name, "") for name in drawn.names} & {"N*s/m", "kg"} else "rad"
    several = sum(1 for r in drawn.levels if r.level.delta and not r.level.torque) > 0
    image = (
        Image(
            "%e against resolution; dotted: the limits of the verdict, 1 % and 5 %; dashed: increase of the residual norm in % of |Y|; grey: the "
            "other parameters that decide",
            plots.svg(plots.error_against_resolution(drawn, names, unit)),
            "Change of the estimates in per cent against encoder resolution, logarithmic axes",
        )
        if several
        else None
    )
    header = ("parameter", "LS", *(r.level.label for r in result.levels))
    values = [(name, number(result.reference.X[i]), *(number(r.mean[i]) for r in result.levels)) for i, name in enumerate(result.names)]
    errors = [
        (
            name + ("" if name in result.deciding else " (does not decide)"),
            number(result.reference.relative_sigma[i], ".2f"),
            *(f"{number(r.e[i], '.2f')} ({number(r.relative_sigma[i], '.2f')})" for r in result.levels),
        )
        for i, name in enumerate(result.names)
    ]
    residual = [
        ("%e(rho) (22), measured W, as printed", *(number(r.e_rho, ".2f") for r in result.levels)),
        ("%e(rho) (22), each run's own W", *(number(r.e_rho_own, ".2f") for r in result.levels)),
        ("increase of the norm in % of |Y|, measured W", *(number(r.increase, ".2f") for r in result.levels)),
        ("increase of the norm in % of |Y|, own W", *(number(r.increase_own, ".2f") for r in result.levels)),
        ("verdict of parameters and residual", *(r.verdict for r in result.levels)),
        ("verdict of the increase (measured W) alone", *(r.residual_verdict for r in result.levels)),
        ("runs for intervals within 1 %", *(str(r.runs_needed) for r in result.levels)),
    ]
    tables = [
        Table("Mean of the runs (18)", header, values),
        Table("%e (21) and, in brackets, %sigma (20)", ("parameter", "%sigma of LS", *header[2:]), errors),
        Table("Residual and verdict", ("reading", *header[2:]), residual),
    ]
    text = (
        "Two verdicts stand below. The printed rule asks every parameter that decides, and %e(rho), to stay below 1 % (practically unbiased) and calls "
        "5 % biased. The chapter's section 4.1.4 calls the residual the best single indicator, as it sees the whole model: the last verdict applies "
        "the same limits to the increase of its norm alone.",
        *(f"{r.level.label}: {r.message}" for r in result.levels),
    )
    return Section(title, text, [image] if image else [], tables)


def level_numbers(result: Cestac) -> list[Number]:
    """The verdict of every step, for the head of a page."""
    states: dict[str, State] = {"unbiased": "good", "doubtful": "doubtful", "biased": "no"}
    return [Number(r.level.label, r.verdict, states[r.verdict]) for r in result.levels]


def parameters_csv(found: Identification) -> str:
    """parameters.csv: name, value, sigma, %sigma, corrected sigma, unit; then value and %sigma of the essential fit, empty where removed."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(("name", "X", "sigma", "relative_sigma", "sigma_corrected", "unit", "X_essential", "relative_sigma_essential"))
    every, kept = found.every, found.found.estimate
    for i, name in enumerate(every.names):
        own = [every.X[i], every.sigma[i], every.relative_sigma[i], every.sigma_corrected[i]]
        k = kept.names.index(name) if name in kept.names else None
        alone = ["", ""] if k is None else [repr(float(kept.X[k])), repr(float(kept.relative_sigma[k]))]
        writer.writerow((name, *(repr(float(x)) for x in own), every.units.get(name, ""), *alone))
    return stream.getvalue()
