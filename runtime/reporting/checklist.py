"""The judgement of an identification on a page: key numbers under the verdict, the checks one by one."""

from __future__ import annotations

from runtime.identification.checklist import Judgement
from runtime.identification.identification import Identification
from runtime.reporting.page import Number, Section, Table, told


def checks_section(judgement: Judgement) -> Section:
    """Question, answer, limit, remedy."""
    rows = [(c.question, told(c.state), c.found, c.limit, "" if c.state == "good" else c.remedy) for c in judgement.checks]
    table = Table(
        "The verdict is the worst of these",
        ("question", "answer", "found", "good within", "what to do"),
        rows,
        wide=(2, 3, 4),
        stacked=True,
    )
    return Section("Checks", tables=[table])


def key_numbers(found: Identification) -> list[Number]:
    """What a reader compares first."""
    fit = found.carried
    worst = max(fit.per_joint, key=lambda joint: joint.relative_error)
    numbers = [
        Number("parameters that carry the model", f"{len(fit.names)} of {len(found.every.names)}"),
        Number("error where fitted", f"{fit.relative_error:.1f} %"),
        Number("error on unseen data", f"{found.predicted_error:.1f} %"),
    ]
    if len(fit.per_joint) > 1:
        numbers.append(Number("worst joint", f"{worst.joint}: {worst.relative_error:.1f} %"))
    return [
        *numbers,
        Number("rows of W, worth of independent ones", f"{fit.rows}, {sum(w.effective_rows for w in found.trust.whiteness):.0f}"),
        Number("condition number, unit columns", f"{fit.cond_unit:.3g}"),
    ]
