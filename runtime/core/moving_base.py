"""Models and records of a robot whose base moves.

An emitted model of such a robot takes the motion of the base before the states of the joints,

    Gamma = D(base, q, qd, qdd) X ,     base = (w0, wd0, a0) ,

while an identification knows only states of joints and channels, which are signals that a record
gives at each sample. `MovingModel` makes the nine components of the base channels of the model, so
that every analysis that supports channels supports a base that moves. The six rows of a free base
become the rows of six more joints, which follow the other joints and stay at zero
(`runtime.core.contacts`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np

from runtime.core.contacts import on_links, touches
from runtime.core.model import GeneratedModel, base_rows, joint_units
from runtime.core.problem import CONTACTS, Note, Problem
from runtime.core.record import (
    BASE_BIASES,
    BASE_GRAVITY,
    BASE_IMU,
    BASE_MOTION,
    BASE_POSITION,
    BASE_QUATERNION,
    Record,
)
from runtime.core.signals.base import INPUTS
from runtime.ground.errors import InputError

Array = np.ndarray
UNIT = 0.01  # of the length of a measured quaternion
KEPT = ("base_parameters", "elements", "store")
"""Functions of an emitted model of a free base that hold for its joints and axes together."""


class MovingModel:
    """A model whose base moves, with the motion of the base as channels W10 .. VP30.

    A component that is not given is that of a base at rest in the axes of the world. A free base
    adds the joints FX0 .. NZ0, whose torques are the wrench on it.
    """

    def __init__(self, model: GeneratedModel) -> None:
        self._model = model
        known = dict(getattr(model, "CHANNELS", {}))
        self.CHANNELS = dict.fromkeys(INPUTS, tuple(model.BASE_PARAMETERS)) | known
        rest = (0.0,) * 6 + tuple(-g + 0.0 for g in cast(Any, model).GRAVITY)
        self._rest = dict(zip(INPUTS, rest, strict=True))

        rows, self._n = base_rows(model), len(model.JOINTS)
        self._order = [*range(len(rows), len(rows) + self._n), *range(len(rows))]
        if rows:
            of_axes = ("m" if row[0] == "F" else "rad" for row in rows)
            self.JOINTS, self.JOINT_UNITS = (*model.JOINTS, *rows), (*joint_units(model), *of_axes)
            self.STRUCTURE, self.DRIVES = np.asarray(model.STRUCTURE)[:, self._order], None

    def __getattr__(self, name: str) -> Any:
        free = len(self._order) > self._n
        if name.startswith("_") or (free and name not in KEPT and not name.isupper()):
            raise AttributeError(name)
        return getattr(self._model, name)

    def _joints(self, *states: Array) -> Any:
        """Leave out the six joints of a free base, which stay at zero."""
        return tuple(x[..., : self._n] for x in states)

    def _base(self, q: Array, further: dict[str, Any]) -> Array:
        """Take the motion of the base, shape (..., 9), out of the keyword arguments `further`."""
        base = np.empty((*np.shape(q)[:-1], len(INPUTS)))
        for k, (name, rest) in enumerate(self._rest.items()):
            base[..., k] = further.pop(name, rest)
        return base

    def regressor(self, q: Array, qd: Array, qdd: Array, **further: Any) -> Array:
        """Compute the regressor D, shape (N, n, b)."""
        base, states = self._base(q, further), self._joints(q, qd, qdd)
        D = np.asarray(cast(Any, self._model).regressor(base, *states, **further))
        return D if len(self._order) == self._n else D[..., self._order, :]

    def observation_matrix(self, q: Array, qd: Array, qdd: Array, **further: Any) -> Array:
        """Compute the observation matrix W, shape (n*N, b), with the rows of joint 1 first."""
        base, states = self._base(q, further), self._joints(q, qd, qdd)
        W = np.asarray(cast(Any, self._model).observation_matrix(base, *states, **further))
        if len(self._order) == self._n:
            return W
        return W.reshape(len(self._order), -1, W.shape[1])[self._order].reshape(W.shape)

    def inverse_dynamics(self, q: Array, qd: Array, qdd: Array, X: Array, **further: Any) -> Array:
        """Compute the joint torques, shape (N, n)."""
        base, states = self._base(q, further), self._joints(q, qd, qdd)
        tau = np.asarray(cast(Any, self._model).inverse_dynamics(base, *states, X, **further))
        return tau if len(self._order) == self._n else tau[..., self._order]


def moved_base(problem: Problem) -> Problem:
    """Use the motion of the base of each record, if the base of the robot moves or is free.

    This is a step of the preparation of a problem.

    Raises
    ------
    InputError
        A record of such a robot has no motion of the base, or a record of a fixed base has one; a
        quaternion is not of unit length; a pose of the base is given with poses at rest; or
        `on_links` refuses the wrenches on links.
    """
    model, records = problem.model, (*problem.records, *problem.unseen)
    if isinstance(model, MovingModel):
        return problem
    moves = getattr(model, "BASE", "fixed") != "fixed"
    for record in records:
        _require_motion(model, record, moves)
        if problem.reader.at_rest and {BASE_POSITION, BASE_IMU} & {*record.channels}:
            raise InputError(
                "poses at rest have no rates of the base; give record.base: {motion: [...]}",
                file=record.file,
            )
    if not moves:
        return problem
    changed, g = on_links(problem), cast(Any, model).GRAVITY
    for part in ("records", "unseen"):
        records = changed.get(part, getattr(problem, part))
        changed[part] = tuple(_with_gravity(record, g) for record in records)
    notes = [Note(CONTACTS, "")] if touches(problem) else []
    return problem.changed(*notes, model=cast(GeneratedModel, MovingModel(model)), **changed)


def _require_motion(model: GeneratedModel, record: Record, moves: bool) -> None:
    given = {BASE_MOTION, BASE_POSITION, BASE_IMU} & {*record.channels}
    if moves and not given:
        raise InputError(
            f"the base of {model.NAME} moves, but the record does not say how; give record.base: "
            "{motion: [nine columns]}, {position: [...], quaternion: [...]} or {gyroscope: [...], "
            "accelerometer: [...]} in the study (a record of validate or payload needs its own "
            "`base`), or use a model with base: fixed",
            file=record.file,
        )
    if given and not moves:
        raise InputError(
            f"the record has the motion of the base, but the base of {model.NAME} is fixed; use "
            "--base moving (symgen.model(ROBOT, base='moving')), or remove record.base",
            file=record.file,
        )
    if BASE_BIASES in record.channels and BASE_IMU not in given:
        raise InputError(
            f"the record has {BASE_BIASES}, but no {BASE_IMU}; give both, or remove {BASE_BIASES}",
            file=record.file,
        )
    widths = {BASE_MOTION: 9, BASE_POSITION: 3, BASE_QUATERNION: 4, BASE_IMU: 9, BASE_BIASES: 6}
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
