"""Models and records of a robot whose base moves.

An emitted model of such a robot takes the motion of the base before the states of the joints,

    Gamma = D(base, q, qd, qdd) X ,     base = (w0, wd0, a0) ,

while an identification knows states of joints, and channels: signals that a record gives at each
sample. `MovingModel` makes the nine components of the base channels of the model, so that every
analysis that supports channels supports a base that moves.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np

from runtime.core.model import GeneratedModel
from runtime.core.problem import Problem
from runtime.core.record import (
    BASE_GRAVITY,
    BASE_IMU,
    BASE_MOTION,
    BASE_POSITION,
    BASE_QUATERNION,
    WRENCH,
    Record,
)
from runtime.core.signals.base import INPUTS
from runtime.ground.errors import InputError

Array = np.ndarray
UNIT = 0.01  # of the length of a measured quaternion


class MovingModel:
    """A model whose base moves, with the motion of the base as channels W10 .. VP30.

    A component that is not given is that of a base at rest in the axes of the world.
    """

    def __init__(self, model: GeneratedModel) -> None:
        self._model = model
        known = dict(getattr(model, "CHANNELS", {}))
        self.CHANNELS = dict.fromkeys(INPUTS, tuple(model.BASE_PARAMETERS)) | known
        rest = (0.0,) * 6 + tuple(-g + 0.0 for g in cast(Any, model).GRAVITY)
        self._rest = dict(zip(INPUTS, rest, strict=True))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._model, name)

    def _base(self, q: Array, further: dict[str, Any]) -> Array:
        """Take the motion of the base, shape (..., 9), out of the keyword arguments `further`."""
        base = np.empty((*np.shape(q)[:-1], len(INPUTS)))
        for k, (name, rest) in enumerate(self._rest.items()):
            base[..., k] = further.pop(name, rest)
        return base

    def regressor(self, q: Array, qd: Array, qdd: Array, **further: Any) -> Array:
        """Compute the regressor D, shape (N, n, b)."""
        base = self._base(q, further)
        return np.asarray(cast(Any, self._model).regressor(base, q, qd, qdd, **further))

    def observation_matrix(self, q: Array, qd: Array, qdd: Array, **further: Any) -> Array:
        """Compute the observation matrix W, shape (n*N, b), with the rows of joint 1 first."""
        base = self._base(q, further)
        return np.asarray(cast(Any, self._model).observation_matrix(base, q, qd, qdd, **further))

    def inverse_dynamics(self, q: Array, qd: Array, qdd: Array, X: Array, **further: Any) -> Array:
        """Compute the joint torques, shape (N, n)."""
        base = self._base(q, further)
        return np.asarray(cast(Any, self._model).inverse_dynamics(base, q, qd, qdd, X, **further))


def moved_base(problem: Problem) -> Problem:
    """Use the motion of the base of each record, if the base of the robot moves.

    This is a step of the preparation of a problem.

    Raises
    ------
    InputError
        A record without the motion of the base of such a robot, or with that of a fixed base; a
        quaternion that is not of unit length; a pose of the base with poses at rest; force sensors;
        a free base.
    """
    model, records = problem.model, (*problem.records, *problem.unseen)
    if getattr(model, "BASE", "fixed") == "free":
        raise InputError(
            f"records of a free base are not read yet; use --base moving for {model.NAME}, whose "
            "rows are the joints alone"
        )
    moves = getattr(model, "BASE", "fixed") == "moving"
    for record in records:
        _require_motion(model, record, moves)
        if problem.reader.at_rest and {BASE_POSITION, BASE_IMU} & {*record.channels}:
            raise InputError(
                "poses at rest have no rates of the base; give record.base: {motion: [...]}",
                file=record.file,
            )
        if moves and any(c.startswith(WRENCH) for c in record.channels):
            raise InputError(
                "force sensors are not possible on a base that moves; remove record.columns.wrench",
                file=record.file,
            )
    if not moves or isinstance(model, MovingModel):
        return problem
    g = cast(Any, model).GRAVITY
    return problem.changed(
        model=cast(GeneratedModel, MovingModel(model)),
        records=tuple(_with_gravity(record, g) for record in problem.records),
        unseen=tuple(_with_gravity(record, g) for record in problem.unseen),
    )


def _require_motion(model: GeneratedModel, record: Record, moves: bool) -> None:
    given = {BASE_MOTION, BASE_POSITION, BASE_IMU} & {*record.channels}
    if moves and not given:
        raise InputError(
            f"the base of {model.NAME} moves, but the record does not say how; give record.base: "
            "{motion: [nine columns]}, {position: [...], quaternion: [...]} or {gyroscope: [...], "
            "accelerometer: [...]} in the study, or use a model with base: fixed",
            file=record.file,
        )
    if given and not moves:
        raise InputError(
            f"the record has the motion of the base, but the base of {model.NAME} is fixed; use "
            "--base moving (symgen.model(ROBOT, base='moving')), or remove record.base",
            file=record.file,
        )
    widths = {BASE_MOTION: 9, BASE_POSITION: 3, BASE_QUATERNION: 4, BASE_IMU: 9}
    for name, width in widths.items():
        if name in record.channels and record.channels[name].shape[1] != width:
            raise InputError(
                f"{name} has {record.channels[name].shape[1]} columns; expected {width}",
                file=record.file,
            )
    if BASE_POSITION in given:
        Q = record.channels.get(BASE_QUATERNION)
        if Q is None:
            raise InputError(
                "record.base has a position, but no quaternion; give both", file=record.file
            )
        length = np.linalg.norm(Q, axis=1)
        if (wrong := np.abs(length - 1) > UNIT).any():
            k = int(wrong.argmax())
            raise InputError(
                f"the quaternion of the base has the length {length[k]:.3g} at sample {k + 1}; "
                "expected 1, without gaps",
                file=record.file,
            )


def _with_gravity(record: Record, g: tuple[float, float, float]) -> Record:
    if BASE_POSITION not in record.channels:
        return record
    gravity = np.broadcast_to(np.array(g), (len(record), 3))
    return replace(record, channels={**record.channels, BASE_GRAVITY: gravity})
