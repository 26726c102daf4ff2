"""Wrenches of the world on links of a robot whose base moves: a free base adds six rows.

The channel wrench7 of a record, shape (N, 6), is the force F (N) and the moment N (N m) by which the
world acts on the link of frame 7, in the axes of this frame and about its origin; wrench0 acts on
the base. With the pose R, P of the frame in frame 0 and its Jacobian J there, the joints of the
model have to deliver

    tau + sum J' (R F, R N)

and the base of a free robot is moved by

    sum (R F, R N + P x R F) ,

the force and the moment about the origin of frame 0 in its axes. The model treats these six numbers
as the torques of six more joints, FX0 .. NZ0, that stay at zero and follow the other joints. So all
rules for axes of force sensors (`runtime.wrench`) hold for the six joints.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from runtime.core.least_squares.method import Methods, linear_method
from runtime.core.model import GeneratedModel, base_rows
from runtime.core.problem import Problem
from runtime.core.record import JOINT_CHANNELS, WRENCH, Record
from runtime.core.rows.selection import UNMEASURED, per_joint
from runtime.core.study import Study
from runtime.ground.errors import InputError

Array = np.ndarray


def wrench_channels(record: Record) -> list[str]:
    """Return the channels of a record that are wrenches: wrench0, wrench7 ..."""
    return sorted(c for c in record.channels if re.fullmatch(rf"{WRENCH}\d+", c))


def with_axes(record: Record, wrenches: Sequence[Array], tau: Array | None = None) -> Record:
    """Add six joints at zero for each wrench (N, 6), which is their torque, to a record.

    The channels of wrenches are removed. tau : torques of the joints; default: those of the record.
    """
    rest = np.zeros((len(record), 6 * len(wrenches)))
    wrench, known = wrench_channels(record), record.tau_known
    return replace(
        record,
        q=np.hstack([record.q, rest]),
        tau=np.hstack([record.tau if tau is None else tau, *wrenches]),
        tau_known=None if known is None else np.hstack([known, rest]),
        channels={
            c: np.hstack([x, rest]) if c in JOINT_CHANNELS else x
            for c, x in record.channels.items()
            if c not in wrench
        },
        origin=replace(record.origin, drives=None),
    )


def settings_of_axes(settings: Study, n: int, axes: int, torques: bool, methods: Methods) -> Study:
    """Return the settings of a problem whose n joints are followed by axes of wrenches.

    Without measured torques, joints give no rows. If the method is ols, it becomes wls with a
    weight for each joint and axis, because N and N m cannot be added.
    """
    if not torques or settings.rows.low_speed != "auto":
        slow = per_joint(settings.rows.slow, n, "rows.low_speed") if torques else [UNMEASURED] * n
        low_speed = (*map(float, slow), *[0.0] * axes)
        settings = replace(settings, rows=replace(settings.rows, low_speed=low_speed))
    method = methods[settings.estimate.method]
    if method.linear and not method.weighs:  # N and N m in one sum
        estimate = replace(
            settings.estimate, method=linear_method("joint", methods), weights="joint"
        )
        settings = replace(settings, estimate=estimate)
    return settings


def touches(problem: Problem) -> bool:
    """Whether the world acts on the robot of a record: a wrench is measured that is not zero."""
    return any(map(_acts, (*problem.records, *problem.unseen)))


def on_links(problem: Problem) -> dict[str, Any]:
    """Take the wrenches of the world on the links into the torques of the records.

    The robot of the problem has a base that moves or is free. Return what changes of the problem by
    field: records, unseen records and settings; an empty mapping if no wrench acts on a robot whose
    base only moves.

    Raises
    ------
    InputError
        A record of a free base without a wrench, or of no torques and no wrench but zero; a wrench
        in a frame that the robot lacks, or not of six columns; torques in A or V; a reader of
        encoder counts.
    """
    model, records = problem.model, (*problem.records, *problem.unseen)
    rows, n = base_rows(model), len(model.JOINTS)
    if not rows and not any(map(wrench_channels, records)):
        return {}
    for record in records:
        _require_wrenches(model, record, free=bool(rows))
        if record.origin.command:
            raise InputError(
                f"the joint torques are in {record.origin.command}, but wrenches are in N and N m, and "
                "both share parameters; give record.torque_constant (N*m/A or N*m/V) of every joint",
                file=record.file,
            )
    if not problem.reader.linear:
        raise InputError(
            f"signals.reader: {problem.settings.signals.reader} does not support wrenches; write "
            "signals: {reader: lowpass} in the study"
        )
    torques = any(record.tau.any() for record in problem.records)
    if problem.records and not torques and not any(map(_acts, problem.records)):
        raise InputError(
            "all torques and all wrenches are zero, so that no row determines a parameter; give the "
            "joint torques (record.columns.tau), or the wrench of the world"
        )
    changed: dict[str, Any] = {
        key: tuple(_with_contacts(model, record, bool(rows)) for record in part)
        for key, part in (("records", problem.records), ("unseen", problem.unseen))
    }
    if rows:
        changed["settings"] = settings_of_axes(
            problem.settings, n, len(rows), torques, problem.methods
        )
    return changed


def _acts(record: Record) -> bool:
    return any(record.channels[c].any() for c in wrench_channels(record))


def _require_wrenches(model: GeneratedModel, record: Record, free: bool) -> None:
    channels = wrench_channels(record)
    if free and not channels:
        raise InputError(
            f"the base of {model.NAME} is free, but the record does not say what acts on it; give "
            "record.columns: {wrench: {FRAME: [six columns]}} for every contact, wrench: none for "
            "flight, or leave the base out with --base moving",
            file=record.file,
        )
    frames = len(cast(Any, model).frame_poses(record.q[:1])[0]) if channels else 0
    for c in channels:
        if (width := record.channels[c].shape[1]) != 6:
            raise InputError(
                f"{c} has {width} columns; expected 6: force (N), moment (N m)", file=record.file
            )
        if int(c.removeprefix(WRENCH)) > frames:
            raise InputError(
                f"{c}: {model.NAME} has the frames 0 to {frames}; give the number of the frame of "
                "the link that the world acts on",
                file=record.file,
            )


def _with_contacts(model: GeneratedModel, record: Record, free: bool) -> Record:
    """Return the record with the torques that move the links, and the wrench that moves the base."""
    emitted = cast(Any, model)
    channels = wrench_channels(record)
    T = emitted.frame_poses(record.q) if channels else np.empty(0)
    tau, base = record.tau.copy(), np.zeros((len(record), 6))
    for c in channels:
        frame = int(c.removeprefix(WRENCH))
        F, N = np.hsplit(record.channels[c], 2)
        if frame:
            R, P = T[:, frame - 1, :3, :3], T[:, frame - 1, :3, 3]
            F, N = (np.einsum("tab,tb->ta", R, x) for x in (F, N))
            J = emitted.jacobian(record.q, frame=frame)
            tau += np.einsum("tan,ta->tn", J, np.hstack([F, N]))
            N = N + np.cross(P, F)
        base += np.hstack([F, N])
    return with_axes(record, [base] if free else [], tau)
