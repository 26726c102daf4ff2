"""The answered questions on an identification: can its values be used, and what to do next?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from runtime.ground.check import WORST, Check, State, worst_of
from runtime.ground.documents import Result
from runtime.ground.table import Table, notebook

ANSWERS = {"good": "Yes", "doubtful": "With care", "no": "No"}


@dataclass(frozen=True)
class Checklist(Result):
    """Verdict on an identification: can its values be used, the largest doubt, and the next step.

    Attributes
    ----------
    checks : tuple of Check
    use : str
        Sentence that says which part of the torques the parameters explain.
    grade : float, %
        Expected error of predictions of other motions; nan if it is not known.
    """

    checks: tuple[Check, ...]
    use: str
    grade: float = float("nan")

    @property
    def state(self) -> State:
        """Worst state of all checks: "no", "doubtful" or "good"; "open" if no check is answered."""
        return next(
            (state for state in WORST if any(check.state == state for check in self.checks)), "open"
        )

    @property
    def answer(self) -> str:
        """The verdict in words: "Yes", "With care" or "No".

        "Yes, as far as judged" means that some checks were not made.
        """
        unanswered = any(check.state == "open" for check in self.checks)
        return ANSWERS[self.state] + (
            ", as far as judged" if self.state == "good" and unanswered else ""
        )

    @property
    def worst(self) -> Check | None:
        """The check to name first, of the worst answers mostly; None if all answered checks are good."""
        return worst_of(self.checks)

    @property
    def doubt(self) -> str:
        """Sentence on the check with the worst answer; if all are good, on the open questions."""
        if self.worst is not None:
            return f"{self.worst.question} {self.worst.finding}."
        unanswered = [check.question for check in self.checks if check.state == "open"]
        return f"none. Open questions: {' '.join(unanswered)}" if unanswered else "none."

    @property
    def next(self) -> str:
        """Advice to the user: the remedy of the worst check, or how to use the parameters."""
        if self.worst is not None:
            return f"{self.worst.remedy}."
        asked = dict.fromkeys(c.remedy for c in self.checks if c.state == "open" and c.remedy)
        use = "use these parameters together, with their intervals"
        return "; for the open questions, ".join([use, *filter(None, ["; ".join(asked)])]) + "."

    def _repr_html_(self) -> str:
        rows = [
            (
                check.question,
                check.state,
                check.finding,
                check.remedy if check.state != "good" else "",
            )
            for check in self.checks
        ]
        return notebook(
            [f"{self.answer}. {self.use}"],
            Table("", ("question", "answer", "finding", "what to do"), rows, wide=(1, 2, 3)),
        )

    def to_text(self) -> str:
        """Write the verdict as plain text: the answer, the largest doubt and the next step."""
        return f"{self.answer}. {self.use}\nBiggest doubt: {self.doubt}\nNext: {self.next}"

    def summary(self) -> dict[str, Any]:
        """Return the verdict as a mapping, for JSON."""
        checks = [
            {
                "question": c.question,
                "state": c.state,
                "found": c.finding,
                "limit": c.limit,
                "remedy": c.remedy,
            }
            for c in self.checks
        ]
        return {
            "state": self.state,
            "answer": self.answer,
            "grade": self.grade,
            "use": self.use,
            "doubt": self.doubt,
            "next": self.next,
            "checks": checks,
        }
