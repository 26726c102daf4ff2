"""Build the sections of an identification report, with tables and figures, from a result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from runtime.core.result import Identification
from runtime.core.signals.decimation import CUTOFF
from runtime.core.validation import JointComparison
from runtime.ground.part import Part
from runtime.ground.table import Table, number, percentage
from runtime.reporting import figures as plots
from runtime.reporting.page import Section
from runtime.reporting.parameters import correlation_section, every_section
from runtime.reporting.series import series

FIGURES_SHOWN = 8  # of joints, before the table of parameters


def detail_sections(result: Identification) -> list[Section]:
    """Build the collapsible report sections, such as fit errors, validation and residuals."""
    trust = result.uncertainty
    sections = [
        *other_torques_section(result),
        every_section(result),
        Section("How far to trust it", trust.verdict, tables=trust.tables()[:2]),
        trail_section(result),
        validation_section(result),
        joint_section(result),
        *([record_section(result)] if result.record_errors or result.remarks else []),
        *([motion_section(result)] if result.motion_table().rows else []),
        residual_section(result, result.torque_unit),
        correlation_section(result),
        *part_sections(result),
        *([Section("Not done", result.missing)] if result.missing else []),
    ]
    return [replace(section, folded=True) for section in sections]


def torque_section(result: Identification) -> Section:
    """Build the section of measured and predicted torques, with one figure for each joint.

    The figures are as Figure 4 of the book chapter. If there are many joints, only the joints with
    the largest errors are shown. A script on the page lets the reader zoom.
    """
    shown = _joints_shown(result)
    section = _torque_figures(result, shown, f"{result.source.capitalize()} and predicted torques")
    if len(shown) == len(result.comparison):
        return section
    text = f"The {len(shown)} joints with the largest errors; the others are below, folded."
    return replace(section, text=[text, *section.text])


def other_torques_section(result: Identification) -> list[Section]:
    """Build the section with the torque figures of the joints that `torque_section` does not show.

    The list is empty if `torque_section` shows all joints.
    """
    shown = _joints_shown(result)
    others = [joint for joint in result.comparison if joint not in shown]
    return [_torque_figures(result, others, "Torques of the other joints")] if others else []


def _joints_shown(result: Identification) -> list[JointComparison]:
    """Select the joints whose torque figures come first on the page, in the order of the robot.

    If there are many joints, those with the largest errors are selected.
    """
    joints = result.comparison
    if len(joints) <= FIGURES_SHOWN:
        return list(joints)
    worst = sorted(joints, key=lambda joint: joint.relative_error)[-FIGURES_SHOWN:]
    return [joint for joint in joints if joint in worst]


def _torque_figures(
    result: Identification, joints: Sequence[JointComparison], title: str
) -> Section:
    """Build a section with figures of measured torque, predicted torque and error of each joint."""
    unit = result.torque_unit
    columns = {"essential": "the essential", "feasible": "the physical", "all": "all"}[
        result.model_columns
    ]
    images = [
        plots.draw_figure(
            (
                f"Joint {joint.joint}: {result.source}, predicted by {columns} parameters, and "
                f"error below; {joint.relative_error:.2f} % of the {result.source} norm"
            ),
            plots.joint_overlay(joint, unit, result.source),
            (
                f"Torque of joint {joint.joint} against time: {result.source}, predicted, error; "
                f"error {joint.relative_error:.1f} %"
            ),
            series=series(joint, unit, result.source),
        )
        for joint in joints
    ]
    text = []
    thinned = max(
        (image.series.total - len(image.series.t) for image in images if image.series is not None),
        default=0,
    )
    if thinned > 0:
        text.append(
            "Long records: the lines keep the largest and smallest value of every stretch and "
            "leave the instants between out."
        )
    return Section(title, text, images)


def joint_section(result: Identification) -> Section:
    """Build the section of the fit errors, in total and for each joint."""
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
        f"{number(fit.cond)}, {number(fit.cond_unit)} with columns of norm 1. Residual norm "
        f"{number(fit.residual_norm, '.4g')} with all parameters, "
        f"{number(essential.residual_norm, '.4g')} with the essential ones. The error is 100 ||Y - "
        "W X|| / ||Y||.",
        *([fit.message] if fit.message else []),
    )
    return Section(
        "Errors in total and per joint",
        text,
        tables=[Table("Relative error by joint", header, rows)],
    )


def record_section(result: Identification) -> Section:
    """Build the section with the errors of each record and remarks on the records."""
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
    return Section("Records", result.remarks, tables=tables)


def motion_section(result: Identification) -> Section:
    """Build the section that shows whether the simulated control loop follows the record."""
    text = (
        (
            "The control loop of the study, simulated with the parameters found, compared with the "
            "record. If the simulation does not follow the record, the parameters mean nothing."
        ),
    )
    return Section("Simulated motion", text, tables=[result.motion_table()])


def trail_section(result: Identification) -> Section:
    """Build the section on the parameters that were removed to find the essential parameters, with
    F-tests.

    The table lists each removed parameter, in order, with the ratio of sigma_rho after its removal.
    """
    essential, trust = result.essential, result.uncertainty
    first, tests = len(result.estimate.names), trust.f_tests
    header = ["removed", "left", "%sigma before", "sigma_rho ratio after"]
    rows = [
        [
            step.name if step.removed else f"{step.name} (kept)",
            str(first - k - step.removed),
            percentage(step.relative_sigma, step.relative_sigma, ".2g"),
            number(step.ratio, ".4f"),
        ]
        for k, step in enumerate(essential.trail)
    ]
    if tests:
        header += ["F", "p", "F of this one", "p of this one"]
        for row, t in zip(rows, tests, strict=True):
            row += [f"{t.F:.3g}", probability(t.p), f"{t.F_step:.3g}", probability(t.p_step)]
    text = (
        "The parameter with the largest %sigma is removed and the rest is fitted again, as long as sigma_rho "
        f"stays below {essential.threshold:g} times its first value: {len(essential.names)} of "
        f"{first} remain. The F-tests judge the removals up to each line, with the effective number "
        "of rows. No %sigma: the interval contains zero.",
    )
    tables = [Table("Trail", header, rows), *trust.tables()[3:]]
    return Section("Essential parameters", text, tables=tables)


def probability(p: float) -> str:
    """Write a probability; below 0.0001 only the bound "< 0.0001"."""
    return f"{p:.2g}" if p >= 1e-4 else "< 0.0001"


def validation_section(result: Identification) -> Section:
    """Build the section of the cross-validation: one part of the data predicts the other parts."""
    tables = [part.table(".2f") for part in result.validation]
    text = (
        (
            "Parameters fitted on one part of the data predict the torques of another; the "
            "essential names are those of the whole record."
        ),
        result.ranking,
    )
    return Section("Cross-validation", text, tables=tables)


def residual_section(result: Identification, unit: str = "N m") -> Section:
    """Build the section of the residuals: their spectra and their histograms.

    The spectra show the cut-off of the decimation, the histograms the normal distribution.
    """
    joints = result.uncertainty.whiteness
    if not joints:
        return Section("Residuals: spectrum and distribution")
    cutoff = decimation_cutoff(result)
    peaks = ", ".join(f"joint {w.joint} {w.peak:.3g} Hz" for w in joints)
    text = [
        "A peak at the frequency of the motion is model error, not noise: friction, flexibility or "
        "a parameter that is missing. A level that is flat up to "
        "the cut-off and falls behind it is filtered noise, the best there is.",
        f"Largest density: {peaks}.",
    ]
    if cutoff is not None:
        text.append(
            f"The rows come {result.observation.rate:g} times a second; the filter of the "
            f"decimation ends at {cutoff:g} Hz (dotted)."
        )
    images = [
        plots.draw_figure(
            "Spectral density of the residuals",
            plots.spectra_figure(joints, unit, cutoff),
            "Spectral density of the residuals of every joint, by frequency",
        ),
        plots.draw_figure(
            "Residuals over their deviation; line: normal law",
            plots.residual_histogram(result.comparison, unit),
            "Histograms of the residuals, joint by joint",
            "residuals",
        ),
    ]
    return Section("Residuals: spectrum and distribution", text, images)


def decimation_cutoff(result: Identification) -> float | None:
    """Return the cut-off frequency of the decimation filter, Hz; None without decimation."""
    if result.study.signals.decimate is None or result.observation.settings.get("factor") == 1:
        return None
    return CUTOFF * result.observation.rate / 2


def part_sections(result: Identification) -> list[Section]:
    """Build a section for every analysis that has text, figures or tables."""
    sections = map(part_section, result.parts)
    return [one for one in sections if one.text or one.images or one.tables]


def part_section(part: Part) -> Section:
    """Build the section of one analysis: its warnings, text, figures and tables."""
    text = [*part.warnings(), *filter(None, part.text().splitlines())]
    images = [plots.of_part(figure) for figure in part.figures()]
    return Section(part.title, text, images, part.tables())
