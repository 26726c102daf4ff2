"""Are the measured torques torques? Beside those that the values of the robot file give, currents
have the same course and another size.

    slope_j = Y_j'W_j X_0 / ||W_j X_0||^2,    alike_j = Y_j'W_j X_0 / (||Y_j|| ||W_j X_0||),
            X_0 the base parameters of the file's values

Values of a maker's file are right to tens of per cent; a joint that runs like them (alike above
LIMIT.TORQUE_ALIKE) at less than 1/LIMIT.TORQUE_FACTOR or more than LIMIT.TORQUE_FACTOR of their
size was measured in another unit, or on the other side of its gear. Drivers of some arms publish
motor currents as effort.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from runtime.limits import LIMIT
from runtime.model.generated import GeneratedModel, joint_labels
from runtime.model.inertia import INERTIAL
from runtime.rows.observation import Observation


def torque_unit_doubt(model: GeneratedModel, observation: Observation) -> str:
    """The question to the user, a sentence; "" where nothing speaks against the unit, or the file
    has no values.
    """
    values, standard = dict(getattr(model, "VALUES", {})), getattr(model, "STANDARD_PARAMETERS", ())
    inertial = [name for name in standard if name.rstrip("0123456789") in INERTIAL]
    if (
        not inertial
        or not all(name in values for name in inertial)
        or observation.names != tuple(model.BASE_PARAMETERS)
    ):
        return ""
    X0 = np.asarray(
        cast(Any, model).base_parameters(
            dict.fromkeys(standard, 0.0) | {name: values[name] for name in inertial}
        )
    )
    joints, slopes = [], []
    for label, joint in zip(joint_labels(model), observation.factor.joints, strict=True):
        expected, measured = joint.R[:, :-1] @ X0[joint.columns], joint.R[:, -1]
        size, both = float(expected @ expected), float(expected @ measured)
        if (
            size > 0
            and both > LIMIT.TORQUE_ALIKE * np.sqrt(size) * joint.measured_norm
            and not 1 / LIMIT.TORQUE_FACTOR < both / size < LIMIT.TORQUE_FACTOR
        ):
            joints.append(label)
            slopes.append(both / size)
    if not joints:
        return ""
    return (
        f"the torques of joint {', '.join(joints)} run like those of the values in the robot file "
        f"at {', '.join(f'{x:.2g}' for x in slopes)} of their size: "
        "are they currents, or of the motor side? Say record.units.tau: A with "
        "record.torque_constant, or record.torque_side: motor"
    )
