"""The verdict on an identification: every question is asked, and the worst answer decides."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from runtime.core.result import Identification
from runtime.ground.check import Check
from runtime.ground.checklist import Checklist
from runtime.ground.limits import limits
from runtime.ground.part import About

LIMIT = limits(__package__)

Ask: TypeAlias = Callable[[Identification], Check | None]
"""A function that answers a question on an identification; None if it does not arise."""


def verdict(result: Identification, questions: Mapping[About, Sequence[Ask]]) -> Checklist:
    """Ask the questions on record, predictions and values, then those of the parts on the same.

    If the record does not determine the parameters, only the questions on the record are asked.
    """

    def of_parts(about: About) -> list[Check]:
        return [check for part in result.parts if part.about == about for check in part.checks()]

    record, checks, use = of_parts("record"), [], result.verdict
    for about, asked in questions.items():
        if about == "record" or result.determined:
            checks += [ask(result) for ask in asked]
            checks += record if about == "record" else of_parts(about)
    small = result.model_estimate.relative_error <= LIMIT.TOTAL_ERROR[0]
    if small and any(check.state == "no" for check in record):
        use += (
            " A small error does not prove that the values are right: wrong units, signs or sides "
            "may change the values instead."
        )
    return Checklist(
        tuple(check for check in checks if check is not None), use, result.expected_error
    )
