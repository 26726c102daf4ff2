"""From records to the observed linear system Y = W X + rho, eqs. (6) and (14).

observe(model, records, study)        one record or several stacked
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from runtime.errors import InputError
from runtime.model.generated import GeneratedModel
from runtime.rows.observation import Observation, stack
from runtime.rows.prepared import Prepared, Source, decimated_torque, prepared, resolved
from runtime.settings.study import SIMULATING, Study
from runtime.signals.states import require_motion

Array = np.ndarray


def observe(
    model: GeneratedModel,
    records: Source | Sequence[Source],
    study: Study | None = None,
    *,
    keep: Array | None = None,
    columns: Sequence[str] | None = None,
    constants: Mapping[str, float] | None = None,
) -> Observation:
    """Y = W X + rho of one record, or of several stacked: filtered, differentiated, decimated, rows
    left out.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    records : Record, Prepared, or a sequence of them
        Joint side, SI.
    study : Study, optional
        Signals and rows; default: Study().
    keep : ndarray of bool, shape (N,) or (N, n), optional
        Samples (and joints) of the one record that may be used, e.g. from a simulated velocity.
    columns : sequence of str, optional
        Columns wanted; default: all.
    constants : mapping of str to float, optional
        Values in place of the robot file's, for the model's keyword arguments.

    Raises
    ------
    InputError
        No record; `keep` with several records; no row left.
    """
    several = list(records) if isinstance(records, Sequence) else [records]
    study = resolved(study or Study(), several)[0]
    if not several:
        raise InputError("no record to observe")
    if keep is not None and len(several) > 1:
        raise InputError(f"{len(several)} records; keep goes with one")
    own = [prepared(model, record, study) for record in several]
    if keep is not None:
        own = [replace(own[0], keep=keep)]
    parts = [one.observation(model, columns, constants) for one in own]
    return parts[0] if len(parts) == 1 else stack(parts)


def at_rest(model: GeneratedModel, records: Sequence[Source], study: Study) -> tuple[Study, str]:
    """The study without the columns that vanish in poses at rest, qd = qdd = 0: those of inertias
    and of friction; and a sentence on it. As it is, and "", where the records are of a motion.

    Raises
    ------
    InputError
        Every column vanishes.
    SettingsError
        A method that simulates the loop, a load.
    """
    if study.signals.reader != "static":
        return study, ""
    if study.estimate.method in SIMULATING or study.payload is not None:
        require_motion(study.signals, "a load, or a method that simulates the loop,")
    W, asked = observe(model, records, study).W, study.estimate.columns
    moving = np.abs(W).max(axis=0) > 1e-9 * np.abs(W).max()  # not zero but for rounding
    acting = set(np.array(model.BASE_PARAMETERS)[moving])
    names = model.BASE_PARAMETERS if asked == "all" else asked
    shown = tuple(name for name in names if name in acting)
    if not shown:
        raise InputError(
            f"poses at rest show no parameter of {model.NAME}: gravity acts along none of its "
            "joints, and there is no offset or spring; record a motion, or correct gravity in the "
            "robot file"
        )
    text = (
        f"Poses at rest: {len(shown)} of {len(names)} base parameters have a torque in them, the "
        "others (inertias, friction) are left out. Dry friction holds a joint with a torque of "
        "unknown sign: approach every pose from both sides and record the mean, or both as poses."
    )
    return replace(study, estimate=replace(study.estimate, columns=shown)), text


def with_torques(
    observation: Observation, records: Sequence[Prepared], torques: Sequence[Array]
) -> Observation:
    """The same rows of W beside other torques, shape (N, n), of the records observed."""
    Y = np.empty_like(observation.Y)
    for number, (own, tau) in enumerate(zip(records, torques, strict=True)):
        rows = observation.record == number
        Y[rows] = decimated_torque(tau, own.selection)[
            observation.joints[rows], np.searchsorted(own.selection.t, observation.t[rows])
        ]
    return replace(observation, Y=Y)
