"""Can the values of an identification be used? One question after another, each with what was found, the limit, and what to do.

    good       within the limit
    doubtful   usable with the care that the remedy names
    no         not usable
    open       not asked, or only the user can tell: does not count

The verdict is the worst of the answers. Limits are constants of this module: they are conventions of practice, not theorems. Errors are relative, in %:
100 ||Y - W X|| / ||Y||; deviations are the larger of the corrected one and the one of blocks drawn again (`runtime.identification.uncertainty`), never eq. (10) alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from runtime.estimators import CLOSED_LOOP
from runtime.estimators.estimate import Estimate
from runtime.estimators.physical import CERTAIN
from runtime.identification.identification import Identification, lost_joints
from runtime.identification.validation import CORRELATION
from runtime.resolution.advice import Advice, step_text
from runtime.resolution.result import BIASED, NEGLIGIBLE, Level

if TYPE_CHECKING:
    from runtime.estimators.feasibility import Feasibility

State = Literal["good", "doubtful", "no", "open"]
WORST: tuple[State, ...] = ("no", "doubtful", "good")
ANSWERS = {"good": "Yes", "doubtful": "With care", "no": "No"}

COND = 100.0
"""Condition number of W with unit columns above which a fit is doubtful."""
TOTAL = (10.0, 20.0)
"""Relative error of all joints, %: good up to the first, unusable above the second."""
JOINT = (25.0, 50.0)
"""Of the worst joint, %."""
UNSEEN = ((1.5, 2.0), (3.0, 5.0))
"""Error on data that did not give the parameters: times the error of the fit, or % where that is larger; good, then usable."""
DEVIATION = 30.0
"""Deviation of a parameter in % of its value."""


@dataclass(frozen=True)
class Check:
    """One question. limit : what a good answer keeps to.   remedy : what to do otherwise."""

    question: str
    state: State
    found: str
    limit: str = ""
    remedy: str = ""


@dataclass(frozen=True)
class Judgement:
    """The checks, and the verdict in three sentences: use, largest doubt, next step."""

    checks: tuple[Check, ...]
    use: str

    @property
    def state(self) -> State:
        """The worst answer."""
        return next((state for state in WORST if any(check.state == state for check in self.checks)), "open")

    @property
    def answer(self) -> str:
        """Yes, with care, or no; a yes says where something was not judged."""
        open_ones = any(check.state == "open" for check in self.checks)
        return ANSWERS[self.state] + (", as far as judged" if self.state == "good" and open_ones else "")

    @property
    def worst(self) -> Check | None:
        """The first check that is not good; None where all are, open ones aside."""
        return next((check for state in WORST[:2] for check in self.checks if check.state == state), None)

    @property
    def doubt(self) -> str:
        """The largest doubt, in a sentence."""
        if self.worst is not None:
            return f"{self.worst.question} {self.worst.found}."
        left = [check.question.rstrip("?") for check in self.checks if check.state == "open"]
        return "none among the checks below" + (f"; not judged: {'; '.join(left)}." if left else ".")

    @property
    def next(self) -> str:
        """What to do, in a sentence."""
        asked = self.worst or next((check for check in self.checks if check.state == "open" and check.remedy), None)
        return (asked.remedy if asked is not None else "use the essential parameters with their corrected deviations") + "."

    def text(self) -> str:
        """The verdict as plain text."""
        return f"{self.answer}. {self.use}\nBiggest doubt: {self.doubt}\nNext: {self.next}"

    def summary(self) -> dict[str, Any]:
        """For JSON."""
        return {"state": self.state, "answer": self.answer, "use": self.use, "doubt": self.doubt, "next": self.next, "checks": self.checks}


def judge(found: Identification, *, feasibility: Feasibility | None = None, advice: Advice | None = None) -> Judgement:
    """The judgement of an identification, with what was asked besides."""
    checks = [determined(found)]
    if found.every.status != "rank-deficient":
        checks += [explained(found), *every_joint(found), predicted(found), signs(found), certain(found), apart(found.carried)]
        checks += [physical(found.every, feasibility), resolved(advice)]
    return Judgement(tuple(checks), found.verdict)


def determined(found: Identification) -> Check:
    """Rank and condition."""
    question, limit = "Does the record determine the parameters?", f"full rank, condition number below {COND:g} with unit columns"
    fits = (found.every, found.carried)
    failed = next((fit for fit in fits if fit.status != "ok"), None)
    if failed is not None and failed.status == "rank-deficient":
        groups = "; ".join(", ".join(group) for group in failed.groups)
        remedy = "record a motion that excites these parameters (symgen excite), or leave them out (estimate: columns)"
        return Check(question, "no", f"No: rank {failed.rank} for {len(failed.names)} parameters, not told apart: {groups}", limit, remedy)
    if failed is not None:
        return Check(question, "no", f"No: {failed.status}, {failed.message.rstrip('.')}", limit, "see the message of the estimator")
    cond = found.carried.cond_unit
    text = f"rank {found.carried.rank} of {len(found.carried.names)}, condition number {cond:.3g} with unit columns"
    return Check(question, "good" if cond <= COND else "doubtful", text, limit, "record a motion with a better condition (symgen excite)")


def explained(found: Identification) -> Check:
    """Error of the fit in total."""
    error = found.carried.relative_error
    remedy = "look at the joints below: units, signs and ratios of the drives first, then friction (--friction)"
    return Check(
        "Does the model explain the torques?",
        graded(error, *TOTAL),
        f"{error:.1f} % of them stay unexplained",
        f"{TOTAL[0]:g} % (usable to {TOTAL[1]:g} %)",
        remedy,
    )


def every_joint(found: Identification) -> list[Check]:
    """Error of the worst joint, which a total hides."""
    joints = found.carried.per_joint
    if len(joints) < 2:
        return []
    worst = max(joints, key=lambda joint: joint.relative_error)
    text = f"Worst is joint {worst.joint}, {worst.relative_error:.1f} % unexplained"
    remedy = (
        lost_joints(found.every, found.carried)
        or f"look at the torque of joint {worst.joint}: coupling of the drives, friction, offset, time shift between position and torque"
    )
    return [Check("On every joint?", graded(worst.relative_error, *JOINT), text, f"{JOINT[0]:g} % (usable to {JOINT[1]:g} %)", remedy)]


def predicted(found: Identification) -> Check:
    """Error on data that did not give the parameters."""
    columns = "essential" if found.carried is found.found.estimate else "all"
    errors = [p.relative_error for part in found.validation for p in part.predictions if not p.fitted and p.columns == columns]
    fit, worst = found.carried.relative_error, max(errors, default=float("nan"))
    limits = [max(times * fit, least) for times, least in UNSEEN]
    remedy = "fewer parameters (a larger essential.threshold), a longer or richer record"
    return Check(
        "Does it predict data it has not seen?",
        graded(worst, *limits) if np.isfinite(worst) else "open",
        f"{worst:.1f} % stay unexplained there, {fit:.1f} % where it was fitted",
        f"{limits[0]:.1f} % (usable to {limits[1]:.1f} %)",
        remedy,
    )


def signs(found: Identification) -> Check:
    """Friction and motor inertia below zero: told without any extra, and by far the most frequent slip of a robot file or study."""
    remedy = "look at the sign of ratio, torque constant and columns of that joint, then at its coupling, units and frame; fit again"
    text = f"Below zero: {', '.join(found.negative)}" if found.negative else "None is certainly below zero"
    question = "Have friction and motor inertia the right sign?"
    return Check(question, "no" if found.negative else "good", text, f"not below zero by {CERTAIN:g} deviations", remedy)


def certain(found: Identification) -> Check:
    """Deviations without the assumption of independent residuals."""
    fit, drawn = found.carried, found.trust.scatter
    deviations = fit.sigma_corrected.copy()
    for i, name in enumerate(fit.names):
        if name in drawn.names and fit is found.found.estimate:
            deviations[i] = np.fmax(deviations[i], drawn.drawn[drawn.names.index(name)])
    with np.errstate(divide="ignore", invalid="ignore"):
        percent = 100 * np.where(np.isfinite(deviations), deviations, fit.sigma) / np.abs(fit.X)
    order = np.argsort(-percent)
    above = [fit.names[i] for i in order if percent[i] > DEVIATION]
    state: State = "good" if not above else "no" if 2 * len(above) > len(fit.names) else "doubtful"
    text = f"Largest deviation {percent[order[0]]:.0f} % ({fit.names[order[0]]}), median {np.median(percent):.1f} %"
    if above:
        text += f"; above {DEVIATION:g} %: {', '.join(above)}"
    remedy = "do not use these values one by one: the torques know their combination better; a longer record, or one that excites them"
    return Check("Is every value certain?", state, text, f"{DEVIATION:g} % of the value", remedy)


def apart(fit: Estimate) -> Check:
    """Correlation of the estimates that carry the model."""
    deviation = np.sqrt(np.diag(fit.covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = fit.covariance / np.outer(deviation, deviation)
    pairs = [
        (fit.names[i], fit.names[k], correlation[i, k])
        for i, k in zip(*np.nonzero(np.triu(np.abs(correlation) > CORRELATION, 1)), strict=True)
    ]
    text = ", ".join(f"{a} with {b} ({c:+.2f})" for a, b, c in pairs[:4]) + (", ..." if len(pairs) > 4 else "")
    remedy = "use them together or not at all; a motion that moves them apart tells them (symgen excite)"
    found = f"These trade: {text}" if pairs else "No two of them trade against each other"
    return Check("Can the values be told apart?", "doubtful" if pairs else "good", found, f"|correlation| below {CORRELATION:g}", remedy)


def physical(fit: Estimate, feasibility: Feasibility | None) -> Check:
    """Whether a physical robot can have all parameters."""
    question, limit = (
        "Can a physical robot have them?",
        "every pseudo-inertia positive semidefinite, friction and motor inertia not negative",
    )
    remedy = "before you simulate or control with them, fit under these conditions (estimate: {method: feasible}); torque prediction is not concerned"
    if "standard" in fit.details:
        return Check(question, "good", "Yes: they were fitted under these conditions", limit)
    if feasibility is None:
        return Check(
            question, "open", "Not asked", limit, "pip install symgen[consistency], then symgen report, or symgen identify --physical"
        )
    if feasibility.feasible:
        return Check(question, "good", f"Yes, margin {feasibility.margin:.2g}", limit)
    named = ", ".join(name for name, _ in feasibility.blocking)
    return Check(question, "doubtful", f"No: in the way are {named}", limit, remedy)


def resolved(advice: Advice | None) -> Check:
    """Whether the encoder resolves enough: the answer of the advisor, and of the step in use where it is given."""
    question, limit = "Does the encoder resolve enough?", f"bias below {NEGLIGIBLE:g} % (usable to {BIASED:g} %)"
    if advice is None:
        return Check(question, "open", "Not asked", limit, "ask with symgen report, or symgen cestac --advise")
    first = advice.encoders[0].limits
    steps = ", ".join(
        f"{one.percent:g} % up to {step_text(one.delta, advice.unit) if np.isfinite(one.delta) else 'any step'}" for one in first
    )
    text = f"Least squares stays within {steps} {advice.place}"
    if not advice.asked:
        return Check(
            question,
            "open",
            text,
            limit,
            "compare these steps with that of your encoder (--encoder STEP, --side motor where it sits there)",
        )
    name, error = max((advice.worst(k) for k in range(len(advice.asked))), key=lambda item: item[1])
    text += (
        f"; at {', '.join(Level(step).label for step in advice.asked)} the largest change is {error:.{0 if error >= 10 else 1}f} % ({name})"
    )
    remedy = f"a finer encoder, or an estimator that simulates the closed loop (estimate.method: {', '.join(CLOSED_LOOP)})"
    return Check(question, graded(error, NEGLIGIBLE, BIASED), text, limit, remedy)


def graded(value: float, good: float, usable: float) -> State:
    """State of a number that should be small."""
    return "good" if value <= good else "doubtful" if value <= usable else "no"
