"""The verdict on an identification: all questions are answered, and the worst answer decides."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from runtime.core.result import Identification
from runtime.ground.check import Check
from runtime.ground.checklist import Checklist
from runtime.ground.limits import limits
from runtime.ground.part import About

LIMIT = limits(__package__)

Ask: TypeAlias = Callable[[Identification], Sequence[Check] | Check | None]
"""A function that answers one or several questions on an identification, or none that arises."""


def of_parts(about: About) -> Ask:
    """Make an Ask of the questions that the parts of an identification have about one subject."""
    return lambda result: [c for part in result.parts if part.about == about for c in part.checks()]


def verdict(
    result: Identification, on_record: Sequence[Ask], on_parameters: Sequence[Ask]
) -> Checklist:
    """Ask the questions on the record, then the questions on parameters that the record determines."""

    def answers(questions: Sequence[Ask]) -> list[Check]:
        given = [ask(result) for ask in questions]
        return [
            check for one in given for check in ([one] if isinstance(one, Check) else one or ())
        ]

    record = answers(on_record)
    others = answers(on_parameters) if result.determined else []
    use = result.verdict
    small = result.determined and result.model_estimate.relative_error <= LIMIT.TOTAL_ERROR[0]
    if small and any(check.state == "no" for check in record):
        use += (
            " A small error does not prove that the values are right: wrong units, signs or sides "
            "may change the values instead."
        )
    return Checklist((*record, *others), use, result.expected_error)
