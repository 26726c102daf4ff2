"""The verdict on an identification: can its parameter values be used?

The verdict consists of questions, each with its answer, its limit and a remedy; the worst answer
decides. The limits are in runtime/ground/limits.toml: they are conventions of practice, not theorems.
Errors are relative, in %: 100 ||Y - W X|| / ||Y||. Standard deviations are the larger of the
corrected one and the one of the block bootstrap (`runtime.core.uncertainty`); eq. (10) alone is
used only if both are unknown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.core.least_squares.estimate import Estimate
from runtime.core.model import SIGNED, GeneratedModel, is_form
from runtime.ground.check import (
    WORST,
    Answer,
    Check,
    Question,
    State,
    first_names,
    state_of,
    worst_of,
)
from runtime.ground.documents import Result
from runtime.ground.limits import LIMIT
from runtime.ground.part import About, Part
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
        """The first check with the worst answer; None if all answered checks are good."""
        return worst_of(self.checks)

    @property
    def doubt(self) -> str:
        """Sentence on the check with the worst answer; if all are good, on the open questions."""
        if self.worst is not None:
            return f"{self.worst.question} {self.worst.finding}."
        unanswered = [check.question for check in self.checks if check.state == "open"]
        return f"none. Not judged: {' '.join(unanswered)}" if unanswered else "none."

    @property
    def next(self) -> str:
        """Advice to the user: the remedy of the worst check, or how to use the parameters."""
        if self.worst is not None:
            return f"{self.worst.remedy}."
        asked = [c.remedy for c in self.checks if c.state == "open" and c.remedy][:1]
        use = "use these parameters together, with their intervals"
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


def checklist_of(
    estimate: Estimate,
    fit: Estimate,
    use: str,
    *,
    bootstrap: Mapping[str, float],
    prediction_error: float,
    expected_error: float = float("nan"),
    negative: Sequence[str] = (),
    parts: Sequence[Part] = (),
    halves: bool = False,
    single: bool = False,
) -> Checklist:
    """Make the verdict on an identification: check its record, its predictions and its values.

    If the record does not determine the parameters, only the checks of the record are made.

    Parameters
    ----------
    estimate : Estimate
        Fit with all parameters.
    fit : Estimate
        Fit with the parameters that are used.
    use : str
        Sentence that says what the used parameters explain.
    bootstrap : mapping of str to float
        Standard deviations from the block bootstrap, by name of the parameter. A parameter without
        an entry has its corrected standard deviation.
    prediction_error : float, %
        Largest relative error of `fit` on data that were not fitted; nan if there are no such data.
    expected_error : float, %
        Expected error of predictions of other motions; nan if it is not known.
    negative : sequence of str
        Friction parameters and motor inertias that are certainly below zero.
    parts : sequence of Part
        Further analyses; their questions follow those about the same subject (record, prediction
        or values).
    halves : bool
        Whether `prediction_error` is the error on one part of the record with parameters from
        another part, not the error on a validation record.
    single : bool
        Whether values are to be used one by one. If so, or if `expected_error` is not known, large
        standard deviations and correlations count as doubts; otherwise they are only remarks.
    """

    def of_parts(about: About) -> list[Check]:
        return [check for part in parts if part.about == about for check in part.checks()]

    rank = rank_and_condition(estimate, fit)
    record = of_parts("record")
    if rank.state != "doubtful":
        record = [rank, *record]
    checks = record
    if estimate.status != "rank-deficient":
        differ = any(part.records_differ for part in parts)
        of_values = [certain(fit, bootstrap), separate(fit)]
        if rank.state == "doubtful":  # a bad condition is the least of several doubts
            of_values.append(rank)
        counts = single or bool(np.isnan(expected_error))
        checks = [
            *record,
            total_error(fit),
            explained_by_joint(estimate, fit, expected_error),
            predicted(fit, prediction_error, halves, differ=differ, expected=expected_error),
            *of_parts("prediction"),
            signs(negative),
            *(remark(check, counts) for check in of_values),
            *of_parts("values"),
        ]
    wrong = any(check.state == "no" and check is not rank for check in record)
    if wrong and fit.relative_error <= LIMIT.TOTAL_ERROR[0]:
        use += (
            " A small error does not prove that the values are right: wrong units, signs or sides "
            "may change the values instead."
        )
    return Checklist(tuple(check for check in checks if check is not None), use, expected_error)


def remark(check: Check, counts: bool) -> Check:
    """Turn a check that is not good into a remark, which does not count in the verdict.

    A remark has the state "open". The check is returned unchanged if `counts` is true or if it is
    good.
    """
    if counts or check.state == "good":
        return check
    finding = f"Single values do not count in this verdict. {check.finding}; {check.remedy}"
    return replace(check, state="open", finding=finding, remedy="")


@Question(
    "Does the record determine the parameters?",
    f"full rank, condition number below {LIMIT.CONDITION:g} with unit columns",
    "record a motion that moves the joints in more combinations (symgen excite), or use "
    "fewer parameters (essential.threshold)",
)
def rank_and_condition(estimate: Estimate, fit: Estimate) -> Answer:
    """Check the rank of the observation matrix W, and its condition number with columns of norm 1.

    The rank is checked for all parameters (`estimate`) and for the used ones (`fit`), the condition
    number for the used parameters only.
    """
    for one in (estimate, fit):
        if one.status == "rank-deficient":
            groups = "; ".join(", ".join(group) for group in one.groups)
            return Answer(
                "no",
                f"No: rank {one.rank} for {len(one.names)} parameters; these cannot be separated: {groups}",
                "record a motion that excites these parameters (symgen excite), or leave them out "
                "(estimate: columns)",
            )
        if one.status != "ok":
            text = f"No: {one.status}, {one.message.rstrip('.')}"
            return Answer("no", text, "see the message of the estimator")
    text = f"All {len(fit.names)}, condition number {rounded(fit.cond_unit)} with unit columns"
    if fit.cond_unit <= LIMIT.CONDITION:
        return Answer("good", text, "")
    return Answer(
        "doubtful", f"{text}: the record hardly determines some combinations of the parameters"
    )


@Question(
    "Does the model explain the torques?",
    f"{LIMIT.TOTAL_ERROR[0]:g} % (usable to {LIMIT.TOTAL_ERROR[1]:g} %)",
    "check the joints named below: first units, signs and ratios of the drives, "
    "then friction (--friction)",
)
def total_error(fit: Estimate) -> Answer:
    """Check the relative error 100 ||Y - W X|| / ||Y|| of the fit over all joints, in %."""
    text = f"{fit.relative_error:.1f} % of the torques stay unexplained"
    return Answer(state_of(fit.relative_error, *LIMIT.TOTAL_ERROR), text)


@Question("On every joint?", f"{LIMIT.JOINT_ERROR[0]:g} % (usable to {LIMIT.JOINT_ERROR[1]:g} %)")
def explained_by_joint(
    estimate: Estimate, fit: Estimate, expected: float = float("nan")
) -> Answer | None:
    """Check the largest relative error of the fit on a single joint; the total error may hide it.

    Return None if fewer than two joints have a motor. If predictions are expected to be good
    (`expected`, %), the answer is never "no".
    """
    worst = fit.worst_joint
    if sum(joint.has_motor for joint in fit.per_joint) < 2 or worst.is_axis:
        return None
    state = state_of(worst.relative_error, *LIMIT.JOINT_ERROR)
    return Answer(
        "doubtful" if state == "no" and expected <= LIMIT.EXPECTED_ERROR else state,
        f"Worst is joint {worst.joint}, {worst.relative_error:.1f} % unexplained",
        lost_joints(estimate, fit)
        or f"check the torque of joint {worst.joint}: coupling of the drives, friction, offset, "
        "time shift between position and torque",
    )


def lost_joints(estimate: Estimate, fit: Estimate) -> str:
    """Name the joints whose torques fit badly because parameters were removed, and give a remedy.

    Return "" if there are none.

    Such joints occur because the threshold of the essential parameters uses ||Y - W X|| of all
    joints. Without weights this norm mostly depends on the joint with the largest forces, such as a
    lift in N next to a wrist in N m.
    """
    if len(fit.names) == len(estimate.names):
        return ""
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
        f"parameters with small torques were removed because other joints have large forces; {remedy}"
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
    """Check the relative error, %, of torques that the model predicts for data not fitted.

    error : the largest one; the answer is "open" if it is nan.

    halves : whether the error is that of one half of the record, with parameters from the other
    half. Half a record may not excite all parameters: the answer is good up to the second limit, or
    up to the last limit if predictions of other motions are expected to be good (`expected`, %),
    and never "no".

    differ : whether records disagree by more than LIMIT.RELEVANT_DIFFERENCE.
    """
    limits = [
        min(max(times * fit.relative_error, least), most)
        for (times, least), most in zip(LIMIT.PREDICTION_ERROR, LIMIT.PREDICTION_MOST, strict=True)
    ]
    if halves:
        sure = expected <= LIMIT.EXPECTED_ERROR
        limits = [LIMIT.PREDICTION_MOST[1] if sure else limits[1], np.inf]
    state: State = "open" if not np.isfinite(error) else state_of(error, *limits)
    remedy = "a longer or richer record"
    if "standard" not in fit.details:
        remedy = f"fewer parameters (a larger essential.threshold), {remedy}"
    if halves:
        remedy = f"name a record that the model must predict (validate.record); {remedy}"
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
    "Have friction and motor inertia the right sign?",
    f"not below zero by {LIMIT.CERTAIN_SIGN:g} deviations",
    "check the sign of ratio, torque constant and columns of this joint, then its coupling, units "
    "and frame; then identify again",
)
def signs(negative: Sequence[str]) -> Answer:
    """Check that no friction parameter and no motor inertia is certainly below zero.

    negative : names of the parameters that are. The usual cause is a wrong sign of a gear ratio.
    """
    if negative:
        return Answer("no", f"Below zero: {', '.join(negative)}")
    return Answer("good", "None is certainly below zero")


@Question(
    "Is every value certain?",
    f"{LIMIT.LARGE_DEVIATION:g} % of the value",
    "use only the predicted torques, not these single values; record longer, or a motion that "
    "excites them",
)
def certain(fit: Estimate, bootstrap: Mapping[str, float]) -> Answer:
    """Check that the standard deviation of each parameter is small compared with its value.

    A parameter whose 95 % interval contains zero has no percentage: it is certain if its deviation
    is small compared with the largest parameter of the same unit. The standard deviations do not
    assume independent residuals; eq. (10) is used only if no other is known.

    bootstrap : as for `checklist_of`.
    """
    deviations = np.fmax(fit.sigma_corrected, [bootstrap.get(name, np.nan) for name in fit.names])
    sigma = np.where(np.isfinite(deviations), deviations, fit.sigma)
    size, units = np.abs(fit.X), [fit.units.get(name, "") for name in fit.names]
    zero = size <= 1.96 * sigma
    largest = {unit: size[np.array(units) == unit].max() for unit in {*units}}
    scale = np.where(zero, [largest[unit] for unit in units], size)
    with np.errstate(divide="ignore", invalid="ignore"):
        percent = np.where(sigma > 0, 100 * sigma / scale, 0.0)
    order = np.argsort(-percent)
    above = [i for i in order if percent[i] > LIMIT.LARGE_DEVIATION]
    told, texts = [i for i in order if not zero[i]], []
    if told:
        texts = [
            f"Largest deviation {percent[told[0]]:.0f} % ({fit.names[told[0]]}), median "
            f"{np.median(percent[told]):.1f} %"
        ]
    if zero.any():
        names = first_names([fit.names[i] for i in order if zero[i]])
        texts.append(f"{'not' if told else 'Not'} told from zero: {names}")
    text = "; ".join(texts)
    if not above:
        return Answer("good", text)
    # a physical set has all columns, held together by the conditions and the values of the file
    most = 2 * len(above) > len(fit.names) and "standard" not in fit.details
    if named := [fit.names[i] for i in above if not zero[i]]:
        text += f"; above {LIMIT.LARGE_DEVIATION:g} %: {first_names(named)}"
    return Answer("no" if most else "doubtful", text)


@Question(
    "Can the values be separated?",
    f"|correlation| below {LIMIT.CORRELATION:g}",
    "use these values only together, or record a motion that separates them (symgen excite)",
)
def separate(fit: Estimate) -> Answer:
    """Check that no two parameters have strongly correlated estimates, by the covariance of X."""
    deviation = np.sqrt(np.diag(fit.covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = fit.covariance / np.outer(deviation, deviation)
    above = np.triu(np.abs(correlation) > LIMIT.CORRELATION, 1)
    pairs = [
        f"{fit.names[i]} with {fit.names[k]} ({correlation[i, k]:+.2f})"
        for i, k in zip(*np.nonzero(above), strict=True)
    ]
    if not pairs:
        return Answer("good", "No two values are strongly correlated")
    more = ", ..." if len(pairs) > 4 else ""
    return Answer("doubtful", f"These trade: {', '.join(pairs[:4])}{more}")


def rounded(cond: float) -> str:
    """Write a condition number with three digits, for instance 1230 or 1.23e+06."""
    return f"{float(f'{cond:.3g}'):.0f}" if 100 <= cond < 1e6 else f"{cond:.3g}"


def negative_elements(model: GeneratedModel, fit: Estimate) -> tuple[str, ...]:
    """Return the friction parameters and motor inertias of a fit that are certainly below zero.

    Certainly means by LIMIT.CERTAIN_SIGN standard deviations, of which the larger kind is used.
    Parameters that are regrouped with others are not tested.
    """
    elements: Mapping[str, Any] = getattr(model, "ELEMENTS", {})
    signed = {
        name for name, (kind, _, acts) in elements.items() if kind in SIGNED and not is_form(acts)
    }
    sigma = np.fmax(fit.sigma, fit.sigma_corrected)
    return tuple(
        name
        for i, name in enumerate(fit.names)
        if name in signed and fit.X[i] < -LIMIT.CERTAIN_SIGN * sigma[i]
    )
