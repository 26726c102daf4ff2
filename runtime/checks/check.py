"""One question about a record, a study, a robot file or an identification, with its answer.

good       within the limit
doubtful   usable with the care that the remedy names
no         not usable
open       not asked, or only the user can tell: does not count
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

State = Literal["good", "doubtful", "no", "open"]
WORST: tuple[State, ...] = ("no", "doubtful", "good")


@dataclass(frozen=True)
class Check:
    """One question.

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
    """

    question: str
    state: State
    finding: str
    limit: str = ""
    remedy: str = ""


def worst_of(checks: Sequence[Check]) -> Check | None:
    """The first check of the worst answer; None where all are good, open ones aside."""
    return next((c for state in WORST[:2] for c in checks if c.state == state), None)
