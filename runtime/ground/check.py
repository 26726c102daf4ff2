"""A check is one question about a record, a robot file or an identification, with its answer.

The state of the answer is one of these:

    good       within the limit
    doubtful   usable with the care that the remedy describes
    no         not usable
    open       not examined, or only the user can answer; the verdict does not count it
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import wraps
from typing import Any, Literal, NamedTuple, ParamSpec

from runtime.ground.errors import MemoryTooSmallError
from runtime.ground.limits import LIMIT

State = Literal["good", "doubtful", "no", "open"]
WORST: tuple[State, ...] = ("no", "doubtful", "good")
P = ParamSpec("P")


@dataclass(frozen=True)
class Check:
    """One question on a record or an identification: its answer, the limit for "good", a remedy.

    Attributes
    ----------
    question : str
    state : "good", "doubtful", "no" or "open"
    finding : str
        The answer, with its numbers.
    limit : str
        Limit that a good answer respects, in words.
    remedy : str
        What to do if the answer is not good.
    ahead : bool
        Whether the finding is printed before the values of the parameters, because most of these
        values are then meaningless.
    change : mapping of str to value
        The remedy as a change of the study, if there is such a change: {"record.units.q": "deg"}.
        Entries under record.scale are factors, one per joint, on the present scale.
    explains : float
        Share of the unexplained torque of a joint that the remedy takes away; 0 if it is unknown.
    outcome : bool
        Whether the question is about a result, such as an error, not about a possible cause of the
        result.
    """

    question: str
    state: State
    finding: str
    limit: str = ""
    remedy: str = ""
    ahead: bool = False
    change: Mapping[str, Any] = field(default_factory=dict)
    explains: float = 0.0
    outcome: bool = False

    @property
    def sentence(self) -> str:
        """Text of the check: its question, what was found, and the remedy if there is one."""
        remedy = f" {self.remedy[0].upper()}{self.remedy[1:]}." if self.remedy else " "
        return f"{self.question} {self.finding}.{remedy}"


class Answer(NamedTuple):
    """Answer to a Question: its state (good, doubtful, no, open) and a sentence on what was found.

    remedy and limit, if given, replace those of the Question.
    """

    state: State
    finding: str
    remedy: str | None = None
    limit: str | None = None
    change: Mapping[str, Any] = {}
    explains: float = 0.0


@dataclass(frozen=True)
class Question:
    """Decorator for a function that answers one question: the function then returns a Check.

    The decorator holds the question, the limit of a good answer and the remedy for other answers.
    If the function returns None, the decorated function returns None too. If it needs more memory
    than there is, the question is open, and the answer says what is needed.
    """

    question: str
    limit: str = ""
    remedy: str = ""
    ahead: bool = False
    outcome: bool = False

    def __call__(self, judge: Callable[P, Answer | None]) -> Callable[P, Any]:
        @wraps(judge)
        def check(*args: P.args, **options: P.kwargs) -> Check | None:
            try:
                answer = judge(*args, **options)
            except MemoryTooSmallError as e:
                answer = Answer("open", f"Not judged: {e}", "")
            if answer is None:
                return None
            limit = self.limit if answer.limit is None else answer.limit
            remedy = self.remedy if answer.remedy is None else answer.remedy
            return Check(
                self.question,
                answer.state,
                answer.finding,
                limit,
                remedy,
                self.ahead,
                answer.change,
                answer.explains,
                self.outcome,
            )

        return check


def worst_of(checks: Sequence[Check]) -> Check | None:
    """Return the check to name first; None if no check is "doubtful" or "no".

    The result is the first check of the worst state, unless another check explains more: a check of
    the same state, or any check if the first is about a result only.
    """
    worst = next((c for state in WORST[:2] for c in checks if c.state == state), None)
    if worst is None:
        return None
    rivals = [
        c for c in checks if c.state == worst.state or (worst.outcome and c.state in WORST[:2])
    ]
    strongest = max(rivals, key=lambda check: check.explains)
    return strongest if strongest.explains > worst.explains else worst


def first_names(names: Sequence[str]) -> str:
    """List the first few names as text, and count the rest: "M1, MX2 and 3 more".

    The largest number of listed names is PARAMETERS_NAMED in limits.toml.
    """
    more = len(names) - LIMIT.PARAMETERS_NAMED
    listed = ", ".join(names[: LIMIT.PARAMETERS_NAMED])
    return f"{listed} and {more} more" if more > 0 else listed


def state_of(value: float, good: float, usable: float) -> State:
    """Judge a value that should be small: "good" up to `good`, "doubtful" up to `usable`, or "no"."""
    if value <= good:
        return "good"
    return "doubtful" if value <= usable else "no"
