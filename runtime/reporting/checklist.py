"""The checklist of an identification on a page: key numbers under the verdict, the checks one by
one.
"""

from __future__ import annotations

from runtime.identification.checklist import Checklist, rounded
from runtime.identification.result import Identification
from runtime.reporting.page import Number, Section, state_mark
from runtime.table import Table


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
    worst = max(fit.per_joint, key=lambda joint: joint.relative_error)
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
