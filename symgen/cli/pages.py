"""The report of an identification as a page: verdict, key numbers, checks, then everything that was asked for, then settings and provenance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from symgen.cli.session import SIMULATED_WARNING

if TYPE_CHECKING:
    from runtime.identification.checklist import Judgement
    from runtime.identification.identification import Identification
    from runtime.reporting.page import Page, Section
    from symgen.cli.beside import Beside


def identification_page(
    found: Identification,
    study: str,
    more: Beside | None = None,
    *,
    title: str = "",
    warning: str = "",
    verdict: str = "",
    shown: Sequence[Section] = (),
) -> Page:
    """The page. study : text of study.yaml.   warning : before the one on simulated data.   verdict : instead of that of the identification.   shown : further sections after the torques."""
    from runtime.reporting.checklist import checks_section, key_numbers
    from runtime.reporting.page import Page
    from runtime.reporting.sections import identification_sections

    judgement = judged(found, more)
    parameters, torques, *others = identification_sections(found)
    simulated = SIMULATED_WARNING if found.source == "simulated" else ""
    return Page(
        title=title or f"{found.model.NAME}: identification on {found.name}",
        question="Can I use these values?",
        state=judgement.state,
        answer=judgement.answer,
        verdict=verdict or judgement.use,
        remarks=[("Biggest doubt", judgement.doubt), ("Next", judgement.next)],
        numbers=key_numbers(found),
        warning=" ".join(text for text in (warning, simulated) if text),
        sections=[
            checks_section(judgement),
            parameters,
            torques,
            *shown,
            *others,
            *([] if more is None else more.sections()),
            settings_section(study),
            provenance_section(found),
        ],
        footer=f"Made by symgen {found.every.provenance['versions']['symgen']}. Equation numbers are those of the chapter that the documentation names.",
    )


def judged(found: Identification, more: Beside | None = None) -> Judgement:
    """The judgement, with what was computed beside the parameters."""
    from runtime.identification.checklist import judge

    return judge(found) if more is None else judge(found, feasibility=more.judged, advice=more.advice)


def settings_section(study: str) -> Section:
    """Every setting, folded."""
    from runtime.reporting.page import Section

    return Section("Settings", ("Every setting of this study, defaults included; study.yaml beside this file.",), listing=study)


def provenance_section(found: Identification) -> Section:
    """Hashes and versions that reproduce the result."""
    from runtime.reporting.page import Section, Table

    provenance = found.every.provenance
    rows = [("robot file", provenance["robot"], f"SHA-256 {provenance['robot_sha256']}")]
    rows += [("record file", name, f"SHA-256 {digest}") for name, digest in provenance["files"].items()]
    rows += [("version", name, version) for name, version in provenance["versions"].items()]
    named = {"target": "kernels", "processor": "processor", "seed": "seed", "note": "note"}
    rows += [("run", named[key], str(provenance[key])) for key in named if provenance.get(key) is not None]
    text = ("The same robot file, record, settings and versions give the same numbers.",)
    return Section("Provenance", text, tables=[Table("What these numbers come from", ("", "name", "value"), rows, wide=(1, 2))])
