"""One question about a record, a study, a robot file or an identification, with its answer.

good       within the limit
doubtful   usable with the care that the remedy names
no         not usable
open       not asked, or only the user knows: does not count
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import wraps
from typing import Any, Literal, NamedTuple, ParamSpec

from runtime.core.limits import LIMIT

State = Literal["good", "doubtful", "no", "open"]
WORST: tuple[State, ...] = ("no", "doubtful", "good")
P = ParamSpec("P")


@dataclass(frozen=True)
class Check:
    """One question of the verdict with its answer.

    Attributes
    ----------
    question : str
    state : "good", "doubtful", "no" or "open"
    finding : str
        The answer, with its numbers.
    limit : str
        What a good answer keeps to.
    remedy : str
        What to do where the answer is not good.
    ahead : bool
        Whether its finding is printed ahead of the values, most of which mean nothing then.
    change : mapping of str to value
        The remedy as a change of the study, if it is one: {"record.units.q": "deg"}. What stands
        under record.scale are factors on the scale that is there, one a joint.
    """

    question: str
    state: State
    finding: str
    limit: str = ""
    remedy: str = ""
    ahead: bool = False
    change: Mapping[str, Any] = field(default_factory=dict)

    @property
    def sentence(self) -> str:
        """Question, finding, and what to do."""
        remedy = f" {self.remedy[0].upper()}{self.remedy[1:]}." if self.remedy else " "
        return f"{self.question} {self.finding}.{remedy}"


class Answer(NamedTuple):
    """State and finding of a Check; remedy and limit replace those of its Question."""

    state: State
    finding: str
    remedy: str | None = None
    limit: str | None = None
    change: Mapping[str, Any] = {}


@dataclass(frozen=True)
class Question:
    """A decorator for functions that answer one question: it turns their Answer into a Check, and None into None.

    It holds the limit of a good answer and the remedy for the others.
    """

    question: str
    limit: str = ""
    remedy: str = ""
    ahead: bool = False

    def __call__(self, judge: Callable[P, Answer | None]) -> Callable[P, Any]:
        @wraps(judge)
        def check(*args: P.args, **options: P.kwargs) -> Check | None:
            answer = judge(*args, **options)
            if answer is None:
                return None
            limit = self.limit if answer.limit is None else answer.limit
            remedy = self.remedy if answer.remedy is None else answer.remedy
            state, finding, change = answer.state, answer.finding, answer.change
            return Check(self.question, state, finding, limit, remedy, self.ahead, change)

        return check


def worst_of(checks: Sequence[Check]) -> Check | None:
    """The first check with the worst answer; None if all answered checks are good."""
    return next((c for state in WORST[:2] for c in checks if c.state == state), None)


def first_names(names: Sequence[str]) -> str:
    """The first LIMIT.PARAMETERS_NAMED names, and the number of the others."""
    more = len(names) - LIMIT.PARAMETERS_NAMED
    listed = ", ".join(names[: LIMIT.PARAMETERS_NAMED])
    return f"{listed} and {more} more" if more > 0 else listed


def state_of(value: float, good: float, usable: float) -> State:
    """State of a number that should be small, from its two limits."""
    if value <= good:
        return "good"
    return "doubtful" if value <= usable else "no"
