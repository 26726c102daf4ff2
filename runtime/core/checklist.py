"""Can the values of an identification be used? One question after another, each with its answer,
the limit, and what to do.

The verdict is the worst of the answers. Limits are constants of this module: they are conventions
of practice, not theorems. Errors are relative, in %:
100 ||Y - W X|| / ||Y||; deviations are the larger of the corrected one and the one of the block
bootstrap (`runtime.core.uncertainty`), never
eq. (10) alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from runtime.advisor.advice import Advice, step_text
from runtime.agreement import Homogeneity
from runtime.core.cestac.runs import Level
from runtime.core.check import WORST, Answer, Check, Question, State, named, worst_of
from runtime.core.documents import Result
from runtime.core.least_squares.estimate import Estimate
from runtime.core.limits import LIMIT
from runtime.core.table import Table, notebook
from runtime.expected import Expected

if TYPE_CHECKING:
    from runtime.physical.feasibility import Feasibility

ANSWERS = {"good": "Yes", "doubtful": "With care", "no": "No"}


@dataclass(frozen=True)
class Checklist(Result):
    """The verdict on an identification: whether its values can be used, the largest doubt, the next
    step.

    Attributes
    ----------
    checks : tuple of Check
    use : str
        What the parameters explain, in one sentence.
    grade : float, %
        Expected error of predictions of other motions; nan where it is not known.
    """

    checks: tuple[Check, ...]
    use: str
    grade: float = float("nan")

    @property
    def state(self) -> State:
        """The worst answer."""
        return next(
            (state for state in WORST if any(check.state == state for check in self.checks)), "open"
        )

    @property
    def answer(self) -> str:
        """Yes, with care, or no; a yes says where something was not judged."""
        unanswered = any(check.state == "open" for check in self.checks)
        return ANSWERS[self.state] + (
            ", as far as judged" if self.state == "good" and unanswered else ""
        )

    @property
    def worst(self) -> Check | None:
        """The first check that is not good; None where all are, open ones aside."""
        return worst_of(self.checks)

    @property
    def doubt(self) -> str:
        """The largest doubt, in a sentence."""
        if self.worst is not None:
            return f"{self.worst.question} {self.worst.finding}."
        unanswered = [check.question for check in self.checks if check.state == "open"]
        return f"none. Not judged: {' '.join(unanswered)}" if unanswered else "none."

    @property
    def next(self) -> str:
        """What to do, in a sentence."""
        if self.worst is not None:
            return f"{self.worst.remedy}."
        asked = [c.remedy for c in self.checks if c.state == "open" and c.remedy][:1]
        use = "use the parameters printed first together, with their corrected deviations"
        return "; for what was not judged, ".join([use, *asked]) + "."

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
        """The verdict as plain text."""
        return f"{self.answer}. {self.use}\nBiggest doubt: {self.doubt}\nNext: {self.next}"

    def summary(self) -> dict[str, Any]:
        """For JSON."""
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


def checklist_of(
    estimate: Estimate,
    fit: Estimate,
    use: str,
    *,
    bootstrap: Mapping[str, float],
    prediction_error: float,
    negative: Sequence[str] = (),
    feasibility: Feasibility | None = None,
    advice: Advice | None = None,
    plausible: Sequence[Check] = (),
    homogeneity: Homogeneity | None = None,
    halves: bool = False,
    expected: Expected | float = float("nan"),
    single: bool = False,
) -> Checklist:
    """The checklist of an identification; rank alone where the record does not determine the
    parameters.

    Parameters
    ----------
    estimate : Estimate
        All parameters.
    fit : Estimate
        The parameters that stand for the robot.
    use : str
        What they explain, in one sentence.
    bootstrap : mapping of str to float
        Deviations by name from blocks of time drawn again; parameters that it lacks have the
        corrected deviation.
    prediction_error : float, %
        Largest relative error of `fit` on data that did not give it; nan where there are none.
    negative : sequence of str
        Frictions and motor inertias certainly below zero.
    feasibility : Feasibility, optional
        Whether a physical robot can have the parameters.
    advice : Advice, optional
        The coarsest encoders, and the step in use.
    halves : bool
        Whether `prediction_error` is that of a part of the record from another one, not of a
        validation record.
    plausible : sequence of Check
        Whether record, study and robot file suit each other: what is wrong there is the cause of
        what follows.
    homogeneity : Homogeneity, optional
        Whether several records agree.
    expected : Expected or float, %
        Expected error of predictions of other motions, with its interval or as it is; nan where it
        is not known.
    single : bool
        Whether values are to be used one by one: deviations and correlations are doubts then, and
        where `expected` is not known; else remarks.
    """
    likely = expected if isinstance(expected, Expected) else Expected(*3 * (expected,))
    rank, expected = determined(estimate, fit), likely.error
    first, last = (
        ([], [rank]) if rank.state == "doubtful" else ([rank], [])
    )  # a bad condition is the least of several doubts
    checks = [*first, *plausible]
    if estimate.status != "rank-deficient":
        of_values = (certain(fit, bootstrap), separate(fit), *last)
        differ = homogeneity is not None and homogeneity.largest > LIMIT.RELEVANT_DIFFERENCE
        checks += [
            explained(fit),
            explained_by_joint(estimate, fit, expected),
            predicted(fit, prediction_error, halves, differ=differ, expected=expected),
            None if homogeneity is None else agreeing(homogeneity),
            expected_off(likely),
            signs(negative),
            *(remark(check, single or np.isnan(expected)) for check in of_values),
            physical(fit if "standard" in fit.details else estimate, feasibility),
            resolved(advice),
        ]
    if any(c.state == "no" for c in plausible) and fit.relative_error <= LIMIT.TOTAL_ERROR[0]:
        use += (
            " A small error alone says little: wrong units, signs and sides move into the values."
        )
    return Checklist(tuple(check for check in checks if check is not None), use, expected)


def remark(check: Check, counts: bool) -> Check:
    """The check, a remark where it does not count and has something to tell."""
    if counts or check.state == "good":
        return check
    finding = f"Single values are not asked for. {check.finding}; {check.remedy}"
    return replace(check, state="open", finding=finding, remedy="")


@Question(
    "How far off are predictions of other motions?",
    f"{LIMIT.EXPECTED_ERROR:g} % (usable where it may be less)",
    "record a motion over the range and the speeds that the model is for, longer, or with finer "
    "positions (symgen excite; signals: {reader: counts})",
)
def expected_off(likely: Expected) -> Answer | None:
    """Expected error of predictions, by its interval; None where it is not known."""
    if np.isnan(likely.error):
        return None
    limit = LIMIT.EXPECTED_ERROR
    return Answer(
        "good" if likely.high <= limit else "no" if likely.low > limit else "doubtful",
        f"{likely.error:.2g} % of the torques are expected to be off over the range of the robot"
        + (f", {likely.low:.2g} to {likely.high:.2g} % likely" if likely.low < likely.high else ""),
    )


@Question(
    "Does the record determine the parameters?",
    f"full rank, condition number below {LIMIT.CONDITION:g} with unit columns",
    "record a motion that moves the joints in more combinations (symgen excite), or use "
    "fewer parameters (essential.threshold)",
)
def determined(estimate: Estimate, fit: Estimate) -> Answer:
    """Rank and condition of W with all columns (`estimate`) and with those of the model (`fit`)."""
    for one in (estimate, fit):
        if one.status == "rank-deficient":
            groups = "; ".join(", ".join(group) for group in one.groups)
            return Answer(
                "no",
                f"No: rank {one.rank} for {len(one.names)} parameters, not told apart: {groups}",
                "record a motion that excites these parameters (symgen excite), or leave them out "
                "(estimate: columns)",
            )
        if one.status != "ok":
            text = f"No: {one.status}, {one.message.rstrip('.')}"
            return Answer("no", text, "see the message of the estimator")
    text = f"All {len(fit.names)}, condition number {rounded(fit.cond_unit)} with unit columns"
    if fit.cond_unit <= LIMIT.CONDITION:
        return Answer("good", text, "")
    return Answer("doubtful", f"{text}: some of their combinations it hardly does")


@Question(
    "Does the model explain the torques?",
    f"{LIMIT.TOTAL_ERROR[0]:g} % (usable to {LIMIT.TOTAL_ERROR[1]:g} %)",
    "look at the joints below: units, signs and ratios of the drives first, then friction "
    "(--friction)",
)
def explained(fit: Estimate) -> Answer:
    """Error of the fit in total."""
    text = f"{fit.relative_error:.1f} % of them stay unexplained"
    return Answer(_state(fit.relative_error, *LIMIT.TOTAL_ERROR), text)


@Question("On every joint?", f"{LIMIT.JOINT_ERROR[0]:g} % (usable to {LIMIT.JOINT_ERROR[1]:g} %)")
def explained_by_joint(
    estimate: Estimate, fit: Estimate, expected: float = float("nan")
) -> Answer | None:
    """Error of the worst joint, which a total hides; no check of a single joint. Where predictions
    are expected to be good (`expected`, %), a joint is no reason for a "no".
    """
    worst = fit.worst_joint
    if len(fit.per_joint) < 2 or worst.is_axis:
        return None
    state = _state(worst.relative_error, *LIMIT.JOINT_ERROR)
    return Answer(
        "doubtful" if state == "no" and expected <= LIMIT.EXPECTED_ERROR else state,
        f"Worst is joint {worst.joint}, {worst.relative_error:.1f} % unexplained",
        lost_joints(estimate, fit)
        or f"look at the torque of joint {worst.joint}: coupling of the drives, friction, offset, "
        "time shift between position and torque",
    )


def lost_joints(estimate: Estimate, fit: Estimate) -> str:
    """The joints whose torque the removed parameters explained, and what to do; "" where there is
    none.

    The threshold of the essential parameters looks at ||Y - W X|| of all joints. Without weights a
    joint of large forces rules it, such as a lift
    in N beside a wrist in N m.
    """
    whole = {joint.joint: joint.relative_error for joint in estimate.per_joint}
    lost = [
        joint
        for joint in fit.per_joint
        if joint.relative_error > max(LIMIT.LOST_JOINT, 2 * whole.get(joint.joint, np.inf))
    ]
    if not lost:
        return ""
    weighted = any(joint.scale != 1.0 for joint in estimate.per_joint)
    remedy = (
        "lower essential.threshold"
        if weighted
        else "weigh the joints by their noise (estimate: {method: wls})"
    )
    by_all = " and ".join(f"{whole[joint.joint]:.1f} % of joint {joint.joint}" for joint in lost)
    by_essential = " and ".join(f"{joint.relative_error:.1f} %" for joint in lost)
    return (
        f"all parameters leave {by_all} unexplained, the essential ones {by_essential}: "
        f"parameters of small torques were removed beside large forces; {remedy}"
    )


@Question("Does it predict data it has not seen?")
def predicted(
    fit: Estimate,
    error: float,
    halves: bool = False,
    *,
    differ: bool = False,
    expected: float = float("nan"),
) -> Answer:
    """Largest relative error, %, on data that did not give the parameters; open where it is nan.

    halves : it is that of a half of the record, fitted from the other half. Half a record may lack
    what the whole one shows: good up to the second limit, or up to the last one where predictions
    of the whole are expected to be good (`expected`, %); never a "no".
    differ : records disagree by more than LIMIT.RELEVANT_DIFFERENCE.
    """
    limits = [
        min(max(times * fit.relative_error, least), most)
        for (times, least), most in zip(LIMIT.PREDICTION_ERROR, LIMIT.PREDICTION_MOST, strict=True)
    ]
    if halves:
        sure = expected <= LIMIT.EXPECTED_ERROR
        limits = [LIMIT.PREDICTION_MOST[1] if sure else limits[1], np.inf]
    state: State = "open" if not np.isfinite(error) else _state(error, *limits)
    remedy = "a longer or richer record"
    if "standard" not in fit.details:
        remedy = f"fewer parameters (a larger essential.threshold), {remedy}"
    if halves:
        remedy = f"name a record that it has to predict (validate.record); {remedy}"
    if differ:
        remedy = (
            "see in which parameters the records differ: another robot, load or wiring, or a "
            "motion that one of them does not excite"
        )
    return Answer(
        state,
        f"{error:.1f} % stay unexplained there, {fit.relative_error:.1f} % where it was fitted",
        remedy,
        f"{limits[0]:.1f} %" + ("" if halves else f" (usable to {limits[1]:.1f} %)"),
    )


@Question(
    "Do the records agree?",
    f"differences within the stated deviations, p above {LIMIT.AGREEMENT_LEVEL:g}",
    "look at the record that differs: load, temperature, time since the last one; or its "
    "motion shows what the model leaves out",
)
def agreeing(homogeneity: Homogeneity) -> Answer:
    """Whether several records tell the same parameters."""
    text = homogeneity.text.rstrip(".")
    if len(homogeneity.records) < 2:
        return Answer("open", text, "")
    if homogeneity.agree or homogeneity.largest > LIMIT.RELEVANT_DIFFERENCE:
        return Answer("good" if homogeneity.agree else "doubtful", text)
    return Answer(
        "good",
        "They differ by more than their stated deviations, but by at most "
        f"{homogeneity.largest:.0f} % of a value",
        limit=f"differences within the stated deviations, p above {LIMIT.AGREEMENT_LEVEL:g}, or by "
        f"at most {LIMIT.RELEVANT_DIFFERENCE:g} % of any value",
    )


@Question(
    "Have friction and motor inertia the right sign?",
    f"not below zero by {LIMIT.CERTAIN_SIGN:g} deviations",
    "look at the sign of ratio, torque constant and columns of that joint, then at its "
    "coupling, units and frame; fit again",
)
def signs(negative: Sequence[str]) -> Answer:
    """Friction and motor inertias certainly below zero. Usual cause: the sign of a ratio."""
    if negative:
        return Answer("no", f"Below zero: {', '.join(negative)}")
    return Answer("good", "None is certainly below zero")


@Question(
    "Is every value certain?",
    f"{LIMIT.LARGE_DEVIATION:g} % of the value",
    "do not use these values one by one: the torques know their combination better; a "
    "longer record, or one that excites them",
)
def certain(fit: Estimate, bootstrap: Mapping[str, float]) -> Answer:
    """Deviations without the assumption of independent residuals; bootstrap : as for
    `checklist_of`.
    """
    deviations = np.fmax(fit.sigma_corrected, [bootstrap.get(name, np.nan) for name in fit.names])
    with np.errstate(divide="ignore", invalid="ignore"):
        percent = 100 * np.where(np.isfinite(deviations), deviations, fit.sigma) / np.abs(fit.X)
    order = np.argsort(-percent)
    above = [fit.names[i] for i in order if percent[i] > LIMIT.LARGE_DEVIATION]
    text = (
        f"Largest deviation {percent[order[0]]:.0f} % ({fit.names[order[0]]}), median "
        f"{np.median(percent):.1f} %"
    )
    if not above:
        return Answer("good", text)
    # a physical set has all columns, held together by the conditions and the values of the file
    most = 2 * len(above) > len(fit.names) and "standard" not in fit.details
    text += f"; above {LIMIT.LARGE_DEVIATION:g} %: {named(above)}"
    return Answer("no" if most else "doubtful", text)


@Question(
    "Can the values be told apart?",
    f"|correlation| below {LIMIT.CORRELATION:g}",
    "use them together or not at all; a motion that moves them apart tells them (symgen excite)",
)
def separate(fit: Estimate) -> Answer:
    """Correlations of the estimates, eq. (10)."""
    deviation = np.sqrt(np.diag(fit.covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = fit.covariance / np.outer(deviation, deviation)
    above = np.triu(np.abs(correlation) > LIMIT.CORRELATION, 1)
    pairs = [
        f"{fit.names[i]} with {fit.names[k]} ({correlation[i, k]:+.2f})"
        for i, k in zip(*np.nonzero(above), strict=True)
    ]
    if not pairs:
        return Answer("good", "No two of them trade against each other")
    more = ", ..." if len(pairs) > 4 else ""
    return Answer("doubtful", f"These trade: {', '.join(pairs[:4])}{more}")


@Question(
    "Can a physical robot have them?",
    "every pseudo-inertia positive semidefinite, friction and motor inertia not negative",
)
def physical(estimate: Estimate, feasibility: Feasibility | None) -> Answer:
    """Whether a physical robot can have all parameters."""
    if "standard" in estimate.details:
        return Answer("good", "Yes: they were fitted under these conditions")
    if feasibility is None:
        return Answer("open", "Not asked", "symgen report, or symgen identify --physical")
    if feasibility.feasible:
        return Answer("good", f"Yes, margin {feasibility.margin:.2g}")
    blocking = ", ".join(name for name, _ in feasibility.blocking)
    return Answer(
        "doubtful",
        f"No: no body has what the fit of all parameters gives {blocking}",
        "before you simulate or control with them, fit under these conditions (estimate: "
        "{method: feasible}); torque prediction is not concerned",
    )


@Question(
    "Does the encoder resolve enough?",
    f"bias below {LIMIT.NEGLIGIBLE:g} % (usable to {LIMIT.BIASED:g} %)",
)
def resolved(advice: Advice | None) -> Answer:
    """Whether the encoder resolves enough: the answer of the advisor, and of the step in use where
    it is given.
    """
    if advice is None:
        return Answer("open", "Not asked", "ask with symgen report, or symgen cestac --advise")
    steps = ", ".join(
        f"{one.percent:g} % up to "
        f"{step_text(one.delta, advice.unit) if np.isfinite(one.delta) else 'any step'}"
        for one in advice.encoders[0].limits
    )
    text = f"Least squares stays within {steps} {advice.place}"
    if not advice.asked:
        return Answer(
            "open",
            text,
            "say which step your encoder has (symgen report --encoder STEP, --side motor "
            "where it sits there)",
        )
    name, error = max((advice.worst(k) for k in range(len(advice.asked))), key=lambda item: item[1])
    labels = ", ".join(Level(step).label for step in advice.asked)
    return Answer(
        _state(error, LIMIT.NEGLIGIBLE, LIMIT.BIASED),
        f"{text}; at {labels} the largest change is {error:.{0 if error >= 10 else 1}f} % ({name})",
        "a finer encoder, or an estimator that simulates the closed loop (estimate.method: iv, didim)",
    )


def rounded(cond: float) -> str:
    """A condition number, three digits, without a power of ten where it is short."""
    return f"{float(f'{cond:.3g}'):.0f}" if 100 <= cond < 1e6 else f"{cond:.3g}"


def _state(value: float, good: float, usable: float) -> State:
    """State of a number that should be small."""
    return "good" if value <= good else "doubtful" if value <= usable else "no"
