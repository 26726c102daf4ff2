"""Questions of the verdict on every identification: can its parameter values be used?

Each question has an answer, a limit and a remedy; `runtime.compose` lists the questions. The limits
are conventions of practice, not theorems. Errors are relative, in %: 100 ||Y - W X|| / ||Y||. The
standard deviation of a parameter is the larger of two: the corrected deviation, and that of the
block bootstrap (`runtime.core.uncertainty`); eq. (10) alone is used only if both are unknown.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from typing import Any

import numpy as np

from runtime.core.essential import lost_joints
from runtime.core.result import Identification
from runtime.ground.check import WORST, Answer, Check, Question, State, first_names, state_of
from runtime.ground.limits import limits

LIMIT = limits(__package__)

COUNT_VALUES = "set validate: {values: true} in the study, so that single values count"
"""What answers an open question about single values."""


def of_single_values(question: Callable[[Identification], Check | None]) -> Callable[..., Any]:
    """Turn an answer about single values that is not good into a remark, with the state "open".

    Single values count only if the study asks for them (validate.values), or if the expected error
    of predictions is not known.
    """

    @wraps(question)
    def asked(result: Identification) -> Check | None:
        check = question(result)
        counts = result.study.validate.values or np.isnan(result.expected_error)
        if check is None or counts or check.state == "good":
            return check
        finding = f"Single values do not count in this verdict. {check.finding}; {check.remedy}"
        return replace(check, state="open", finding=finding, remedy=COUNT_VALUES)

    return asked


@Question(
    "Does the record determine the parameters?",
    f"full rank, condition number below {LIMIT.CONDITION:g} with unit columns",
    "record a motion that moves the joints in more combinations (symgen excite), or use "
    "fewer parameters (essential.threshold)",
)
def rank_and_condition(result: Identification) -> Answer:
    """Check the rank of the observation matrix W, and its condition number with columns of norm 1.

    The rank is checked for all parameters and for the used parameters, the condition number for the
    used parameters only.
    """
    fit = result.model_estimate
    for one in (result.estimate, fit):
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
    outcome=True,
)
def total_error(result: Identification) -> Answer:
    """Check the relative error 100 ||Y - W X|| / ||Y|| of the fit over all joints, in %."""
    fit = result.model_estimate
    text = f"{fit.relative_error:.1f} % of the torques stay unexplained"
    return Answer(state_of(fit.relative_error, *LIMIT.TOTAL_ERROR), text)


@Question(
    "On every joint?",
    f"{LIMIT.JOINT_ERROR[0]:g} % (usable to {LIMIT.JOINT_ERROR[1]:g} %)",
    outcome=True,
)
def explained_by_joint(result: Identification) -> Answer | None:
    """Check the largest relative error of the fit on a single joint; the total error may hide it.

    Return None if fewer than two joints have a motor. If predictions of other motions are expected
    to be good, the answer is never "no".
    """
    fit = result.model_estimate
    worst = fit.worst_joint
    if sum(joint.has_motor for joint in fit.per_joint) < 2 or worst.is_axis:
        return None
    state = state_of(worst.relative_error, *LIMIT.JOINT_ERROR)
    return Answer(
        "doubtful" if state == "no" and result.expected_error <= LIMIT.EXPECTED_ERROR else state,
        f"Worst is joint {worst.joint}, {worst.relative_error:.1f} % unexplained",
        lost_joints(result.estimate, fit)
        or f"check the torque of joint {worst.joint}: coupling of the drives, friction, offset, "
        "time shift between position and torque",
    )


@Question("Does it predict data it has not seen?", outcome=True)
def predicted(result: Identification) -> Answer:
    """Check the relative error, %, of torques that the model predicts for data not fitted.

    The answer is "open" if there are no such data. If these data are one part of the record,
    predicted with parameters from another part, the other part may not excite all parameters. The
    answer is then never "no", and it is good up to the error that the deviations of these
    parameters explain (but not above the last limit).
    """
    fit, error = result.model_estimate, result.prediction_error
    halves = bool(result.validation) and not result.by_records
    levels = [
        min(max(times * fit.relative_error, least), most)
        for (times, least), most in zip(LIMIT.PREDICTION_ERROR, LIMIT.PREDICTION_MOST, strict=True)
    ]
    if halves:
        unknown = levels[0] < error and np.isnan(result.unseen_error)
        explained = levels[1] if unknown else result.unseen_error if error > levels[0] else 0.0
        levels = [min(max(levels[0], explained), LIMIT.PREDICTION_MOST[1]), np.inf]
    state: State = "open" if not np.isfinite(error) else state_of(error, *levels)
    remedy = "a longer or richer record"
    if "standard" not in fit.details:
        remedy = f"fewer parameters (a larger essential.threshold), {remedy}"
    if halves:
        remedy = f"name a record that the model must predict (validate.record); {remedy}"
    if any(part.records_differ for part in result.parts):
        remedy = (
            "see in which parameters the records differ: another robot, load or wiring, or a "
            "motion that one of them does not excite"
        )
    return Answer(
        state,
        f"{error:.1f} % stay unexplained there, {fit.relative_error:.1f} % where it was fitted",
        remedy,
        f"{levels[0]:.1f} %" + ("" if halves else f" (usable to {levels[1]:.1f} %)"),
    )


@Question(
    "Have friction and motor inertia the right sign?",
    f"not below zero by {LIMIT.CERTAIN_SIGN:g} deviations",
    "check the sign of ratio, torque constant and columns of this joint, then its coupling, units "
    "and frame; then identify again",
    outcome=True,
)
def signs(result: Identification) -> Answer:
    """Check that no friction parameter and no motor inertia is certainly below zero.

    The usual cause is a wrong sign of a gear ratio.
    """
    if result.negative:
        return Answer("no", f"Below zero: {', '.join(result.negative)}")
    return Answer("good", "None is certainly below zero")


@of_single_values
@Question(
    "Is every value certain?",
    f"{LIMIT.LARGE_DEVIATION:g} % of the value",
    "use only the predicted torques, not these single values; record longer, or a motion that "
    "excites them",
)
def certain(result: Identification) -> Answer:
    """Check that the standard deviation of each parameter is small compared with its value.

    A parameter whose 95 % interval contains zero has no percentage: it is certain if its deviation
    is small compared with the largest parameter of the same unit. The standard deviations do not
    assume independent residuals; eq. (10) is used only if no other deviation is known.
    """
    fit, drawn = result.model_estimate, result.uncertainty.bootstrap
    essential = result.model_columns == "essential"
    bootstrap = dict(zip(drawn.names, drawn.drawn, strict=True)) if essential else {}
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


@of_single_values
@Question(
    "Can the values be separated?",
    f"|correlation| below {LIMIT.CORRELATION:g}",
    "use these values only together, or record a motion that separates them (symgen excite)",
)
def separate(result: Identification) -> Answer:
    """Check that no two parameters have strongly correlated estimates, by the covariance of X."""
    fit = result.model_estimate
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


def determined(result: Identification) -> Check | None:
    """Ask whether the record determines the parameters, unless only a bad condition is in doubt.

    If a part has found a cause by which most values mean nothing, such as joints that rest in all
    records, its remedy comes first.
    """
    check: Check = rank_and_condition(result)
    if check.state != "no":
        return None if check.state == "doubtful" else check
    known = (c for part in result.parts if part.about == "record" for c in part.checks())
    cause = next((c for c in known if c.ahead and c.state in WORST[:2]), None)
    return check if cause is None else replace(check, remedy=cause.remedy)


@of_single_values
def conditioned(result: Identification) -> Check | None:
    """Check the condition number of W; if several answers are doubtful, this doubt is named last."""
    check = rank_and_condition(result)
    return check if check.state == "doubtful" else None


def rounded(cond: float) -> str:
    """Write a condition number with three digits, for instance 1230 or 1.23e+06."""
    return f"{float(f'{cond:.3g}'):.0f}" if 100 <= cond < 1e6 else f"{cond:.3g}"
