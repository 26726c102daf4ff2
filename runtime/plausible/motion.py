"""Checks of the motion: do the joints move, and does the motion determine every parameter?

Joints have to move in the rows that are used, because friction at rest obeys no law of motion. The
parameters are judged before anything is fitted, by

    share_i = 100 sigma_i ||W_w,i|| / ||Y_w||
            rows of W_w, Y_w divided by the standard deviation of their torque, sigma_i as
            `runtime.core.rows.predicted` predicts it

share_i is the predicted standard deviation of parameter i, in % of the value with which this
parameter alone would make all of the measured torque. A larger value is not to be expected, so that
%sigma of the parameter is hardly below share_i. The torque noise is assumed to be white, and a
fixed share of the torque of the joint (TORQUE_NOISE in limits.toml): a convention, since the noise
is not known before the fit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from runtime.core.least_squares.linear import percent
from runtime.core.least_squares.wls import weighted_system
from runtime.core.rows.observation import Observation
from runtime.core.rows.predicted import Weights, kept_correlation
from runtime.core.rows.prepared import stacked, study_of_record
from runtime.core.rows.selection import per_joint
from runtime.core.signals.velocities import agreement
from runtime.core.study import Signals, Study
from runtime.ground.check import Answer, Question, State, first_names
from runtime.ground.errors import InputError, MemoryTooSmallError
from runtime.ground.limits import limits
from runtime.plausible.case import Case
from runtime.plausible.rests import friction_determined, rounded_up
from runtime.plausible.samples import Samples

LIMIT = limits(__package__)

Array = np.ndarray


@Question(
    "Do the joints move while they are used?",
    f"at rest in at most {100 * LIMIT.REST_SHARE:g} % of the rows that are used",
)
def rest(case: Case) -> Answer:
    """Check how long each joint rests, and how the fit changes without the samples at rest."""
    model, study = case.model, case.study
    share = standing_share(case.samples, study)
    worst = int(np.argmax(share))
    text = f"Joint {case.labels[worst]} is at rest in {100 * share[worst]:.0f} % of its rows"
    proposed = low_speed_of_rest(case.samples, study)
    if proposed is None:
        return Answer("good", text)
    stated = list(proposed) if isinstance(proposed, tuple) else proposed
    remedy = (
        f"set rows.low_speed: {stated} ({case.units[worst]}/s), or cut the record (rows.window)"
    )
    change = {"rows.low_speed": stated}
    try:
        moving = replace(study, rows=replace(study.rows, low_speed=proposed))
        without = stacked(
            model, [one.by(study_of_record(moving, one.record)) for one in case.given]
        )
    except MemoryTooSmallError:
        raise
    except InputError:
        without = None
    if case.observation is None or without is None:
        return Answer("doubtful", text, remedy, change=change)
    systems = map(weighted_system, (case.observation, without))
    before, after = (percent(*system.norms(system.solve().X)) for system in systems)
    text += f"; without these rows, the error of the fit is {after:.1f} % instead of {before:.1f} %"
    slow = per_joint(proposed, case.samples.n, "rows.low_speed")
    lost = slow > per_joint(study.rows.slow, case.samples.n, "rows.low_speed")
    lost &= [not friction_determined(model, without, j) for j in range(len(lost))]
    if lost.any():
        text += f", but do not determine the friction of joint {case.joint_labels(lost)}"
        remedy, change = (
            f"move joint {case.joint_labels(lost)} in both directions, at several speeds",
            {},
        )
    state: State = "doubtful" if after < 0.8 * before else "good"
    if after < 0.5 * before and before > LIMIT.TOTAL_ERROR[0]:  # else friction of that joint alone
        state = "no"
    return Answer(state, text, remedy, change=change)


def standing_share(samples: Samples, study: Study) -> Array:
    """Compute, for each joint, the share of its used samples at which it rests, shape (n,)."""
    speed = np.where(
        samples.still, np.inf, np.abs(samples.qd)
    )  # a joint that never moves is told as such
    used = speed >= per_joint(study.rows.slow, samples.n, "rows.low_speed")
    standing = used & (speed <= samples.standing())
    return np.asarray(standing.sum(axis=0) / np.maximum(used.sum(axis=0), 1))


def low_speed_of_rest(samples: Samples, study: Study) -> float | tuple[float, ...] | None:
    """Propose a speed `rows.low_speed`, below which the samples of a joint are left out as resting.

    The speeds are in rad/s or m/s, one for each joint; a joint that rests in few of its rows
    (REST_SHARE in limits.toml) keeps the speed of the study. The result is None if all joints keep
    theirs.
    """
    share = standing_share(samples, study)
    if share.max() <= LIMIT.REST_SHARE:
        return None
    low = per_joint(study.rows.slow, samples.n, "rows.low_speed")
    rests = (share > LIMIT.REST_SHARE) & ~samples.still
    wanted = tuple(
        rounded_up(max(v, x))
        for v, x in zip(np.where(rests, samples.standing(), 0.0), low, strict=True)
    )
    return wanted[0] if samples.n == 1 else wanted


@Question(
    "Does the motion excite every parameter?",
    f"predicted deviation below {LIMIT.UNEXCITED:g} % of the largest possible value, with "
    f"{100 * LIMIT.TORQUE_NOISE:g} % of torque noise",
    "move the joints of these parameters further or faster (symgen excite finds a motion), or "
    "leave them out (estimate.columns)",
)
def motion_excites(case: Case) -> Answer | None:
    """Check whether the motion determines every parameter.

    The result is None if there are no rows, or if a joint rests in all records.
    """
    if case.observation is None or case.samples.still.any():
        return None
    return excited(case.observation, case.given[0].study.signals, case.records[0].rate)


def excited(observation: Observation, signals: Signals, rate: float) -> Answer | None:
    """Check whether the rows of an observation matrix W determine every parameter.

    The result is None if W is rank-deficient, which the fit itself reports, or if a torque is zero
    throughout.
    """
    try:
        shares = unexcited_shares(observation, signals, rate)
    except (InputError, np.linalg.LinAlgError):
        return None
    order = sorted(shares, key=lambda name: -shares[name])
    unseen = [name for name in order if shares[name] > LIMIT.UNEXCITED]
    if unseen:
        return Answer(
            "doubtful",
            f"The motion cannot determine {first_names(unseen)}, whatever values they have",
        )
    text = f"Least excited is {order[0]}, {shares[order[0]]:.2g} %"
    if weak := [name for name in order if shares[name] > LIMIT.LARGE_DEVIATION]:
        listed = ", ".join(weak[: LIMIT.PARAMETERS_NAMED])
        text += f"; above {LIMIT.LARGE_DEVIATION:g} %: {listed}"
    return Answer("good", text, "")


def unexcited_shares(observation: Observation, signals: Signals, rate: float) -> dict[str, float]:
    """Predict the standard deviation of each parameter, in % of the largest value that it can have.

    A parameter has this value if it alone produces all measured torques. The result is share_i (see
    the head of this module), by parameter name. Raises LinAlgError if W is rank-deficient, and
    InputError if a torque is zero throughout.
    """
    s = np.array(
        [
            LIMIT.TORQUE_NOISE
            * float(np.linalg.norm(observation.Y[observation.joint(j)]) / np.sqrt(max(rows, 1)))
            for j, rows in enumerate(observation.rows)
        ]
    )
    if not s.all():
        zero = ", ".join(str(j + 1) for j in np.flatnonzero(s == 0))
        raise InputError(
            f"all measured torques of joint {zero} are zero; give the columns of these torques in "
            "record.columns.tau"
        )
    columns = np.linalg.norm(observation.factor.weighted(1 / s).R11, axis=0)
    if not columns.all():
        raise np.linalg.LinAlgError("a column of the observation matrix is zero")
    weights = Weights(
        observation.names, s, float(np.linalg.norm(observation.Y / s[observation.joints])) / columns
    )
    if weights.condition(observation) > LIMIT.SINGULAR:
        raise np.linalg.LinAlgError("no full rank")
    sigma = weights.relative_sigma(observation, kept_correlation(signals, rate))
    return dict(zip(observation.names, map(float, sigma), strict=True))


@Question(
    "Do recorded velocities agree with the positions?",
    f"gain and lag take at most {100 * LIMIT.SPEED_DISAGREES:g} %",
    "check unit, side and sign of record.columns.qd, and the filter of the drive; for such joints "
    "symgen uses differences of the positions",
)
def recorded_speeds(case: Case) -> Answer | None:
    """Compare recorded velocities with the derivatives of the positions: gain and time lag.

    The result is None if no velocities are recorded, or if the study does not use them.
    """
    own = max(case.straight, key=lambda one: len(one.record))
    record, signals = own.record, own.study.signals
    if "qd" not in record.channels or signals.velocity == "differences":
        return None
    found = agreement(record.q, record.channels["qd"], record.rate, signals)
    worst = int(np.argmax(found.share))
    text = (
        f"The recorded velocity of joint {case.labels[worst]} is {found.gain[worst]:.3f} times the "
        f"derivative of its position, and {1e3 * found.lag[worst]:.1f} ms late"
    )
    return Answer("good" if found.agrees.all() else "doubtful", text)
