"""Six rows more: the wrench of a force sensor below the base, beside the joint torques or without
them.

    [Y ]   [D K]         [0]
    [  ] = [   ] chi  +  [ ] b ,        w = WB(q, qd, qdd) chi + b
    [w ]   [WB ]         [1]

chi standard parameters, X = K chi those of the joint torques, WB the columns of
`base_wrench_regressor` (force, then moment about the origin of frame 0, in frame 0, by which the
sensor moves the robot), b the offset of the sensor. A wrench knows parameters that no joint torque
depends on, and none of the drives: the rotor's own moment on the base, its inertia by the gear
ratio once, is left out. So the base parameters are others than those of the module: columns that
do not depend on those before them, at random states, and what they take in (Gautier 1991, in
numbers and for the constants of the robot file).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.errors import InputError
from runtime.model.generated import GeneratedModel
from runtime.model.inertia import physical_model
from runtime.records.record import Record
from runtime.rows.observation import Observation
from runtime.rows.prepared import Prepared, decimated_rows, decimated_torque, prepared
from runtime.settings.study import Study

Array = np.ndarray

SENSOR_OFFSETS = ("BFX", "BFY", "BFZ", "BNX", "BNY", "BNZ")  # offset of the sensor, N and N m
PROBED_STATES = 64  # random ones that tell columns apart
LEFT_OF_COLUMN = 1e-8  # of the norm of a column: less is left of it beside those before


@dataclass(frozen=True, eq=False)
class WrenchRows:
    """Joint torques and wrench as one linear system.

    Attributes
    ----------
    observation : Observation
        Its rows are those of each joint, then those of FX, FY, FZ, NX, NY, NZ: an estimator with
        weights by joint finds a deviation for each of the six.
    standard : tuple of str
        Standard parameters, then the offsets SENSOR_OFFSETS; p + 6 names.
    K : ndarray, shape (b, p + 6)
        X = K (chi, b) of the columns of `observation`.
    """

    observation: Observation
    standard: tuple[str, ...]
    K: Array

    @property
    def formulas(self) -> dict[str, str]:
        """What every parameter takes in, by name."""
        return {
            name: " ".join(
                f"{x:+.6g}*{own}" for own, x in zip(self.standard, row, strict=True) if x
            )
            for name, row in zip(self.observation.names, self.K, strict=True)
        }


def observe_wrench(
    model: GeneratedModel,
    record: Record | Prepared,
    study: Study | None = None,
    *,
    torques: bool = True,
) -> WrenchRows:
    """The rows of a record with a channel `wrench`, shape (N, 6), N and N m in frame 0.

    Parameters
    ----------
    model : GeneratedModel
        Emitted with the function base_wrench_regressor.
    record : Record or Prepared
        `Record(t, q, tau, channels={"wrench": ...})`.
    study : Study, optional
        Signals and rows; default: Study().
    torques : bool
        Whether joint torques are rows too.

    Raises
    ------
    InputError
        A module without the function, or a record without such a channel.
    """
    own = prepared(model, record, study or Study())
    wrench = own.record.channels.get("wrench")
    if not hasattr(model, "base_wrench_regressor"):
        raise InputError(
            f"{model.NAME} has no base_wrench_regressor; emit the module by symgen generate ROBOT "
            "--with base_wrench_regressor"
        )
    if wrench is None or wrench.shape[1:] != (6,):
        raise InputError(
            "no channel `wrench` with three forces and three moments by sample; give it as "
            'Record(..., channels={"wrench": ...}), shape (N, 6)',
            file=own.record.name,
        )
    standard, base = physical_model(model).standard, physical_model(model).K
    random = np.random.default_rng(0).uniform(-np.pi, np.pi, (3, PROBED_STATES, len(model.JOINTS)))
    rows = [_by_sensor(model, *random)]
    if torques:
        D = model.regressor(*random) @ base
        rows.append(np.pad(D, ((0, 0), (0, 0), (0, 6))))
    of_joints = {name.removesuffix("R") for name in model.BASE_PARAMETERS}
    order = sorted(range(len(standard)), key=lambda k: standard[k] not in of_joints)
    order += range(len(standard), len(standard) + 6)
    kept, K = _independent(np.concatenate([x.reshape(-1, len(order)) for x in rows]), order)
    used = own.selection.mask.any(axis=0)
    states, number = own.states, int(used.sum())
    signals = _by_sensor(model, states.q, states.qd, states.qdd)[:, :, kept]
    decimated = decimated_rows(signals.reshape(len(states), -1), own.selection)[:, used]
    W = decimated.reshape(6, len(kept), number).swapaxes(1, 2).reshape(-1, len(kept))
    Y = decimated_torque(wrench, own.selection)[:, used]
    names, t = (*standard, *SENSOR_OFFSETS), np.tile(own.selection.t[used], 6)
    joints, above = own.observation(model), np.pad(base, ((0, 0), (0, 6)))[:, kept]
    count = sum(joints.rows) if torques else 0
    observation = replace(
        joints,
        W=np.concatenate([joints.W[:count] @ above, W]),
        Y=np.concatenate([joints.Y[:count], Y.ravel()]),
        rows=(*(joints.rows if torques else ()), *[number] * 6),
        names=tuple(names[k] + "R" * int((x != 0).sum() > 1) for k, x in zip(kept, K, strict=True)),
        t=np.concatenate([joints.t[:count], t]),
        record=np.zeros(count + len(t), dtype=int),
        dropped={},
    )
    return WrenchRows(observation, names, K)


def _by_sensor(model: Any, *states: Array) -> Array:
    """Columns of the wrench by standard parameter and by offset, shape (N, 6, p + 6)."""
    WB = np.asarray(model.base_wrench_regressor(*states))
    return np.concatenate([WB, np.broadcast_to(np.eye(6), (len(WB), 6, 6))], axis=2)


def _independent(A: Array, order: Sequence[int]) -> tuple[list[int], Array]:
    """Columns that do not depend on those before them in `order`, and K, shape (b, p), of A = A_1 K
    with A_1 these columns.
    """
    Q: Array = np.zeros((len(A), 0))
    kept: list[int] = []
    for k in order:
        rest = A[:, k] - Q @ (Q.T @ A[:, k])
        rest -= Q @ (Q.T @ rest)  # twice is enough (Giraud, Langou and Rozloznik 2005)
        if np.linalg.norm(rest) > LEFT_OF_COLUMN * max(
            float(np.linalg.norm(A[:, k])), LEFT_OF_COLUMN
        ):
            Q, kept = np.column_stack([Q, rest / np.linalg.norm(rest)]), [*kept, k]
    K = np.linalg.lstsq(A[:, kept], A, rcond=None)[0]
    return kept, np.where(np.abs(K) > LEFT_OF_COLUMN, K, 0.0)
