"""Build the HTML report pages of identifications, resolution studies and single analyses.

The page of an identification shows verdict, figures and parameter values first; the other sections
are folded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import log2, pi
from typing import Any

from runtime.core.cestac.result import Cestac, error_against_resolution
from runtime.core.result import Identification
from runtime.ground.checklist import Checklist
from runtime.ground.part import Part
from runtime.ground.table import Table
from runtime.reporting import figures as plots
from runtime.reporting.page import Number, Page, Section, State, state_mark
from runtime.reporting.parameters import parameter_section
from runtime.reporting.sections import detail_sections, part_section, torque_section

SIMULATED_WARNING = (
    "Everything here was computed on a SIMULATED record, made from the values of the robot file "
    "with encoder steps and torque noise. "
    "No figure in this report was measured."
)


def identification_page(
    result: Identification,
    study: str,
    *,
    title: str = "",
    warning: str = "",
    verdict: str = "",
    sections: Sequence[Section] = (),
) -> Page:
    """Build the HTML report page of an identification.

    Parameters
    ----------
    result : Identification
    study : str
        Text of study.yaml.
    title, verdict : str
        Texts that replace the title and the verdict of the identification.
    warning : str
        Text that precedes the warning on simulated data.
    sections : sequence of Section
        Further sections, after the parameters.
    """
    checklist = result.checklist
    simulated = SIMULATED_WARNING if result.source == "simulated" else ""
    return Page(
        title=title or f"{result.model.NAME}: identification on {result.name}",
        question="Can I use these values?",
        state=checklist.state,
        answer=checklist.answer,
        verdict=verdict or checklist.use,
        remarks=[("Biggest doubt", checklist.doubt), ("Next", checklist.next)],
        warning=" ".join(text for text in (warning, simulated) if text),
        sections=[
            torque_section(result),
            parameter_section(result),
            *sections,
            checks_section(checklist),
            *detail_sections(result),
            settings_section(study),
            provenance_section(result),
        ],
        footer=(
            f"Made by symgen {result.estimate.provenance['versions']['symgen']}. Equation "
            "numbers are those of the chapter that the documentation names."
        ),
    )


def resolution_page(result: Cestac, study: str) -> Page:
    """Build the HTML report page of a study of the encoder resolution.

    study : text of study.yaml.
    """
    page = Page(
        title=f"{_robot(result.provenance)}: encoder resolution on {_records(result.provenance)}",
        verdict=result.message,
        sections=[resolution_section(result), settings_section(study)],
        numbers=level_numbers(result),
    )
    if not result.encoder_steps:
        return page
    enough = result.enough
    return replace(
        page,
        question="Which of the encoder steps tried is enough?",
        answer=enough.text(result.unit) if enough else "None of the steps tried",
        state="good" if enough else "no",
    )


def part_page(
    part: Part, subject: str, verdict: str, provenance: Mapping[str, Any], study: str
) -> Page:
    """Build the HTML report page of a single analysis, such as the advice on encoder steps.

    subject : words of the title between the robot and the records.   study : text of study.yaml.
    """
    return Page(
        title=f"{_robot(provenance)}: {subject} {_records(provenance)}",
        verdict=verdict,
        sections=[part_section(part), settings_section(study)],
    )


def checks_section(checklist: Checklist) -> Section:
    """Build the collapsible section of the checks: question, answer, limit, and remedy if there is
    one.

    The first table has the checks that are not good, the second the others.
    """
    order = ("no", "doubtful", "open", "good")
    ordered = sorted(checklist.checks, key=lambda check: order.index(check.state))
    header = ("question", "answer", "found", "good within", "what to do")
    tables = []
    for caption, good in (("The verdict is the worst of these", False), ("These are good", True)):
        checks = [check for check in ordered if (check.state == "good") == good]
        many = 5 if not good and any(check.remedy for check in checks) else 4
        rows = [
            (c.question, state_mark(c.state), c.finding, c.limit, c.remedy)[:many] for c in checks
        ]
        wide = range(2, many)
        tables.append(Table(caption, header[:many], rows, wide=wide, stacked=True))
    return Section("Checks", tables=[table for table in tables if table.rows], folded=True)


def settings_section(study: str) -> Section:
    """Build the collapsible section that lists every setting of the study that has a value.

    study : text of study.yaml.
    """
    lines = [line for line in study.splitlines() if not line.endswith(": null")]
    return Section(
        "Settings",
        (
            "Settings of this study, defaults included; study.yaml in the same folder has all of them.",
        ),
        listing="\n".join(lines),
        folded=True,
    )


def provenance_section(result: Identification) -> Section:
    """Build the section with the file hashes and versions needed to reproduce the result."""
    provenance = result.estimate.provenance
    rows = [("robot file", provenance["robot"], f"SHA-256 {provenance['robot_sha256']}")]
    rows += [
        ("record file", name, f"SHA-256 {digest}") for name, digest in provenance["files"].items()
    ]
    rows += [("version", name, version) for name, version in provenance["versions"].items()]
    labels = {"processor": "processor", "seed": "seed", "note": "note"}
    rows += [
        ("run", label, str(provenance[key]))
        for key, label in labels.items()
        if provenance.get(key) is not None
    ]
    text = ("The same robot file, record, settings and versions give the same numbers.",)
    return Section(
        "Provenance",
        text,
        tables=[Table("What these numbers come from", ("", "name", "value"), rows, wide=(1, 2))],
        folded=True,
    )


def _robot(provenance: Mapping[str, Any]) -> str:
    return str(provenance.get("robot", "robot"))


def _records(provenance: Mapping[str, Any]) -> str:
    return ", ".join(provenance.get("records", ())) or "a record"


def resolution_section(
    result: Cestac,
    title: str = "Encoder resolution",
    *,
    curve: Cestac | None = None,
    names: Sequence[str] = (),
) -> Section:
    """Build the section of a study of encoder steps: tables of errors, and curves over the step.

    The table is Table 3 of the chapter, with both definitions of %e(rho).

    curve : study with more steps, for the figure.
    names : parameters that are coloured in the figure.
    """
    shown = curve or result
    figures = [error_against_resolution(shown, names)] if shown.figures() else []
    return replace(part_section(result), title=title, images=[*map(plots.of_part, figures)])


def level_numbers(result: Cestac) -> list[Number]:
    """Write, for each encoder or torque step, the verdict and the largest error, %.

    The error is that of a parameter. Encoder steps are given in counts per turn and bits too. The
    numbers are for the head of a page.
    """
    states: dict[str, State] = {"unbiased": "good", "doubtful": "doubtful", "biased": "no"}
    numbers = []
    for level in result.levels:
        label, delta = level.level.text(result.unit), level.level.delta
        if result.unit == "rad" and delta and not level.level.torque:
            counts = 2 * pi / delta
            label += f": {counts:.0f} counts per turn, {log2(counts):.1f} bits"
        name, error = next(iter(level.decided_by.items()))
        most = f"{name} {error:.1f} %"
        numbers.append(Number(label, f"{level.verdict}, {most}", states[level.verdict]))
    return numbers
