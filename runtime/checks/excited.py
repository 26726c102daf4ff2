"""Which parameters the motion of a record cannot tell, from W alone, before anything is fitted.

    share_i = 100 sigma_i ||W_w,i|| / ||Y_w||
            rows of W_w, Y_w divided by the deviation of their torque, sigma_i as
            `runtime.excitation` predicts it

is the predicted deviation of parameter i in % of the value with which it alone would make all of
the measured torque. A larger value is not to be expected, so
its %sigma is hardly below share_i. The torque noise is taken as LIMIT.TORQUE_NOISE of the torque of
the joint, white: a convention, since the noise is not known before the fit.
"""

from __future__ import annotations

import numpy as np

from runtime.checks.case import Case
from runtime.checks.check import Answer, Question, named
from runtime.errors import InputError
from runtime.excitation.criteria import Weights, kept_correlation
from runtime.limits import LIMIT
from runtime.rows.observation import Observation
from runtime.settings.study import Signals


@Question(
    "Does the motion excite every parameter?",
    f"predicted deviation below {LIMIT.UNEXCITED:g} % of the largest possible value, with "
    f"{100 * LIMIT.TORQUE_NOISE:g} % of torque noise",
    "move the joints behind these parameters more, further or faster (symgen excite finds "
    "a motion), or leave them out (estimate.columns)",
)
def motion_excites(case: Case) -> Answer | None:
    """Parameters that the motion cannot tell; None where the study has no rows."""
    if case.observation is None:
        return None
    return excited(case.observation, case.study.signals, case.records[0].rate)


def excited(observation: Observation, signals: Signals, rate: float) -> Answer | None:
    """Parameters that the motion cannot tell; None where W has no full rank, which the fit itself
    says by name.
    """
    try:
        shares = unexcited_shares(observation, signals, rate)
    except (InputError, np.linalg.LinAlgError):
        return None
    order = sorted(shares, key=lambda name: -shares[name])
    unseen = [name for name in order if shares[name] > LIMIT.UNEXCITED]
    if unseen:
        return Answer("doubtful", f"It cannot tell {named(unseen)}, whatever their values")
    text = f"Least excited is {order[0]}, {shares[order[0]]:.2g} %"
    if weak := [name for name in order if shares[name] > LIMIT.LARGE_DEVIATION]:
        listed = ", ".join(weak[: LIMIT.PARAMETERS_NAMED])
        text += f"; above {LIMIT.LARGE_DEVIATION:g} %: {listed}"
    return Answer("good", text, "")


def unexcited_shares(observation: Observation, signals: Signals, rate: float) -> dict[str, float]:
    """share_i, %, by name of the parameter; LinAlgError where W has no full rank."""
    s = np.array(
        [
            LIMIT.TORQUE_NOISE * float(np.sqrt(np.mean(observation.Y[observation.joint(j)] ** 2)))
            for j in range(observation.n)
        ]
    )
    if not s.all():
        raise InputError("torques that are zero throughout")
    columns = np.linalg.norm(observation.W / s[observation.joints][:, None], axis=0)
    if not columns.all():
        raise np.linalg.LinAlgError("a column is zero")
    weights = Weights(
        observation.names, s, float(np.linalg.norm(observation.Y / s[observation.joints])) / columns
    )
    if weights.condition(observation) > LIMIT.SINGULAR:
        raise np.linalg.LinAlgError("no full rank")
    sigma = weights.relative_sigma(observation, kept_correlation(signals, rate))
    return dict(zip(observation.names, map(float, sigma), strict=True))
