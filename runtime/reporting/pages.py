"""Pages of results: verdict, key numbers, checks, then everything that was asked for, then settings
and provenance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from runtime.core.cestac.result import Cestac
from runtime.core.checklist import Checklist, rounded
from runtime.core.part import Part
from runtime.core.result import Identification
from runtime.core.table import Table
from runtime.reporting.page import Number, Page, Section, state_mark
from runtime.reporting.resolution import level_numbers, resolution_section
from runtime.reporting.sections import identification_sections, part_section, part_sections

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
    """The page of an identification.

    Parameters
    ----------
    result : Identification
    study : str
        Text of study.yaml.
    title, verdict : str
        In place of those of the identification.
    warning : str
        Before the warning on simulated data.
    sections : sequence of Section
        Further sections, after the torques.
    """
    checklist = result.checklist
    parameters, torques, *others = identification_sections(result)
    simulated = SIMULATED_WARNING if result.source == "simulated" else ""
    return Page(
        title=title or f"{result.model.NAME}: identification on {result.name}",
        question="Can I use these values?",
        state=checklist.state,
        answer=checklist.answer,
        verdict=verdict or checklist.use,
        remarks=[("Biggest doubt", checklist.doubt), ("Next", checklist.next)],
        numbers=key_numbers(result),
        warning=" ".join(text for text in (warning, simulated) if text),
        sections=[
            checks_section(checklist),
            parameters,
            torques,
            *sections,
            *others,
            *part_sections(result),
            *([Section("Not done", result.missing)] if result.missing else []),
            settings_section(study),
            provenance_section(result),
        ],
        footer=(
            f"Made by symgen {result.estimate.provenance['versions']['symgen']}. Equation "
            "numbers are those of the chapter that the documentation names."
        ),
    )


def resolution_page(result: Cestac, study: str) -> Page:
    """The page of a resolution study; study : text of study.yaml."""
    return Page(
        title=f"{_robot(result.provenance)}: encoder resolution on {_records(result.provenance)}",
        verdict=result.message,
        sections=[resolution_section(result), settings_section(study)],
        numbers=level_numbers(result),
    )


def part_page(
    part: Part, subject: str, verdict: str, provenance: Mapping[str, Any], study: str
) -> Page:
    """The page of one part; subject : what the title says of it.   study : text of study.yaml."""
    return Page(
        title=f"{_robot(provenance)}: {subject} {_records(provenance)}",
        verdict=verdict,
        sections=[part_section(part), settings_section(study)],
    )


def checks_section(checklist: Checklist) -> Section:
    """Question, answer, limit, remedy; what is not good first."""
    ordered = sorted(
        checklist.checks, key=lambda check: ("no", "doubtful", "open", "good").index(check.state)
    )
    rows = [
        (c.question, state_mark(c.state), c.finding, c.limit, "" if c.state == "good" else c.remedy)
        for c in ordered
    ]
    table = Table(
        "The verdict is the worst of these",
        ("question", "answer", "found", "good within", "what to do"),
        rows,
        wide=(2, 3, 4),
        stacked=True,
    )
    return Section("Checks", tables=[table])


def key_numbers(result: Identification) -> list[Number]:
    """What a reader compares first."""
    fit = result.model_estimate
    worst = fit.worst_joint
    numbers = [
        Number("parameters of the model", f"{len(fit.names)} of {len(result.estimate.names)}"),
        Number("error where fitted", f"{fit.relative_error:.1f} %"),
        Number("error on unseen data", f"{result.prediction_error:.1f} %"),
    ]
    if len(fit.per_joint) > 1:
        numbers.append(Number("worst joint", f"{worst.joint}: {worst.relative_error:.1f} %"))
    return [
        *numbers,
        Number(
            "torque samples, worth of independent ones",
            f"{fit.rows}, {sum(w.effective_rows for w in result.uncertainty.whiteness):.0f}",
        ),
        Number("condition number, unit columns", rounded(fit.cond_unit)),
    ]


def settings_section(study: str) -> Section:
    """Every setting, folded; study : text of study.yaml."""
    return Section(
        "Settings",
        ("Every setting of this study, defaults included; study.yaml beside this file.",),
        listing=study,
    )


def provenance_section(result: Identification) -> Section:
    """Hashes and versions that reproduce the result."""
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
    )


def _robot(provenance: Mapping[str, Any]) -> str:
    return str(provenance.get("robot", "robot"))


def _records(provenance: Mapping[str, Any]) -> str:
    return ", ".join(provenance.get("records", ())) or "a record"
