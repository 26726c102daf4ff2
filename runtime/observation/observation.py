"""From a record to the observed linear system Y = W X + rho, eqs. (6) and (14).

    observe(model, record, study)                    the whole way, or its steps:
    filtered_states(q, rate, signals)                q, qd, qdd
    select_rows(record, qd, study)                   window, decimated instants, rows left out
    decimated_torque(tau, selection)                 Y, shape (n, K)
    observation_from_states(model, states, torque, selection)

A study that perturbs the positions (CESTAC) calls `select_rows` and `decimated_torque` once, on the measured record, and repeats
`filtered_states` and `observation_from_states` with perturbed positions: Y and the choice of rows stay those of the record, so that a row is
never kept or dropped because of noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from runtime.errors import InputError
from runtime.model.generated import GeneratedModel, check_states
from runtime.observation.filters import States, decimated, filtered_states, median_filtered
from runtime.observation.regressor_signals import decimated_columns
from runtime.observation.rows import Selection, select_rows
from runtime.records.record import Record
from runtime.settings.study import Study, to_mapping

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class LoopRows:
    """The closed loop that made the records (`runtime.estimators.closed_loop`), and which of its rows an observation holds, shape (r,)."""

    loop: Any
    rows: Array


@dataclass(frozen=True, eq=False)
class Observation:
    """The decimated system Y = W X + rho with its row bookkeeping.

    Parameters
    ----------
    W : ndarray, shape (r, b), rows joint-major: every row of joint 1 first.   Y : ndarray, shape (r,), N m or N.
    rows : number of rows of each joint, sum r.   names : the b columns.
    t : ndarray, shape (r,), time of each row, s.   record : ndarray, shape (r,), which of the stacked records it came from (from 0).
    rate : rows per second of one joint after decimation, Hz.
    dropped : rows left out, per joint, by reason ("trim", "low_speed", "mask"), counted after decimation.
    settings : the signals and rows used, complete (to_mapping), with the factor that "auto" became.
    files : SHA-256 of the measured files, by name.
    errors : ndarray, shape (n, b, b), mean covariance of the errors of one row of W of joint j, where it is known (`runtime.observation.position_errors`).
    closed_loop : what can simulate the same rows with other parameters, where it is known.
    """

    W: Array
    Y: Array
    rows: tuple[int, ...]
    names: tuple[str, ...]
    t: Array
    record: Array
    rate: float
    dropped: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    errors: Array | None = None
    closed_loop: LoopRows | None = None

    def __post_init__(self) -> None:
        r = sum(self.rows)
        if self.W.shape != (r, len(self.names)) or self.Y.shape != (r,) or self.t.shape != (r,) or self.record.shape != (r,):
            shapes = f"W {self.W.shape}, Y {self.Y.shape}, t {self.t.shape}, record {self.record.shape}"
            raise InputError(f"{shapes}; expected {r} rows, the sum of {self.rows}, and {len(self.names)} columns")

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.rows)

    @property
    def joints(self) -> Array:
        """Joint of each row, from 0, shape (r,)."""
        return np.repeat(np.arange(self.n), self.rows)

    @property
    def span(self) -> tuple[float, float]:
        """Time of the first and of the last row, s."""
        return float(self.t.min()), float(self.t.max())

    def joint(self, j: int) -> slice:
        """Rows of the j-th joint, j from 0."""
        start = sum(self.rows[:j])
        return slice(start, start + self.rows[j])

    def columns(self, names: Sequence[str]) -> Observation:
        """The same rows with the named columns alone, in the order given."""
        kept = _numbers(names, self.names)
        errors = None if self.errors is None else self.errors[:, kept][:, :, kept]
        return replace(self, W=np.asfortranarray(self.W[:, kept]), names=tuple(names), errors=errors)

    def where(self, mask: Array) -> Observation:
        """The rows where `mask`, bool of shape (r,), is true."""
        if mask.shape != self.Y.shape or mask.dtype != np.bool_:
            raise InputError(f"mask {mask.dtype} {mask.shape}; expected bool {self.Y.shape}")
        rows = tuple(int(np.count_nonzero(mask[self.joint(j)])) for j in range(self.n))
        loop = None if self.closed_loop is None else replace(self.closed_loop, rows=self.closed_loop.rows[mask])
        W = np.asfortranarray(self.W[mask])
        return replace(self, W=W, Y=self.Y[mask], t=self.t[mask], record=self.record[mask], rows=rows, closed_loop=loop)

    def between(self, t0: float | None, t1: float | None) -> Observation:
        """The rows with t0 <= t <= t1, s; None leaves an end open."""
        inside = np.ones(len(self.t), dtype=bool)
        if t0 is not None:
            inside &= self.t >= t0
        if t1 is not None:
            inside &= self.t <= t1
        if not inside.any():
            raise InputError(f"no row in [{t0}, {t1}] s; the rows lie in [{self.t.min():g}, {self.t.max():g}] s")
        return self.where(inside)


def observe(
    model: GeneratedModel,
    record: Record,
    study: Study,
    *,
    keep: Array | None = None,
    columns: Sequence[str] | None = None,
    constants: Mapping[str, float] | None = None,
) -> Observation:
    """Filter, differentiate, evaluate the regressor, decimate, and leave rows out.

    keep : bool, shape (N,) or (N, n): samples (and joints) that may be used, e.g. from a simulated velocity.
    columns : names of the columns wanted; default: all.
    constants : values in place of the robot file's, for the model's keyword arguments.
    """
    states = filtered_states(record.q, record.rate, study.signals)
    selection = select_rows(record, states.qd, study.signals, study.rows, keep=keep)
    torque = decimated_torque(record.tau, selection)
    return observation_from_states(model, states, torque, selection, files=record.files, columns=columns, constants=constants)


def decimated_torque(tau: Array, selection: Selection) -> Array:
    """Y before rows are left out, shape (n, K), of measured joint torques tau, shape (N, n): median filter, window, decimation."""
    windowed = median_filtered(tau, selection.signals.median)[selection.samples]
    return decimated(np.ascontiguousarray(windowed.T), selection.factor, selection.signals.decimate)


def observation_from_states(
    model: GeneratedModel,
    states: States,
    torque: Array,
    selection: Selection,
    *,
    files: Mapping[str, str] | None = None,
    columns: Sequence[str] | None = None,
    constants: Mapping[str, float] | None = None,
) -> Observation:
    """W of the given states, shape (N, n) each, beside Y = torque, shape (n, K), as decimated before.

    columns : names of the columns wanted; the others are neither filtered nor stored. Default: all.
    """
    check_states(model, states.q, states.qd, states.qdd)
    n, K = selection.mask.shape
    if torque.shape != (n, K) or len(model.JOINTS) != n:
        raise InputError(f"torque {torque.shape}, model {model.NAME} with {len(model.JOINTS)} joints; expected {(n, K)} and {n} joints")
    names = tuple(model.BASE_PARAMETERS) if columns is None else tuple(columns)
    numbers = _numbers(names, model.BASE_PARAMETERS)
    store = decimated_columns(model, states[selection.samples], selection.factor, selection.signals.decimate, constants or {}, numbers)
    mask = selection.mask.ravel()
    settings = {"signals": to_mapping(selection.signals), "rows": to_mapping(selection.rows), "factor": selection.factor}
    return Observation(
        W=np.compress(mask, store.reshape(len(names), n * K), axis=1).T,
        Y=torque.ravel()[mask],
        rows=tuple(int(k) for k in selection.mask.sum(axis=1)),
        names=names,
        t=np.tile(selection.t, n)[mask],
        record=np.zeros(int(mask.sum()), dtype=int),
        rate=selection.rate,
        dropped=selection.dropped,
        settings=settings,
        files=dict(files or {}),
    )


def stack(observations: Sequence[Observation]) -> Observation:
    """Several records of one robot as one system, joint-major; `record` tells the rows apart."""
    if not observations:
        raise InputError("no observation to stack")
    first = observations[0]
    for o in observations[1:]:
        if o.names != first.names or o.n != first.n:
            raise InputError(f"columns {o.names} on {o.n} joints; expected those of the first record, {first.names} on {first.n} joints")
    offsets = np.cumsum([0] + [int(o.record.max(initial=-1)) + 1 for o in observations])
    order = [(o, o.joint(j), k) for j in range(first.n) for o, k in zip(observations, offsets, strict=False)]
    W = np.empty((sum(sum(o.rows) for o in observations), len(first.names)), order="F")
    np.concatenate([o.W[rows] for o, rows, _ in order], out=W)
    return Observation(
        W=W,
        Y=np.concatenate([o.Y[rows] for o, rows, _ in order]),
        rows=tuple(sum(o.rows[j] for o in observations) for j in range(first.n)),
        names=first.names,
        t=np.concatenate([o.t[rows] for o, rows, _ in order]),
        record=np.concatenate([o.record[rows] + k for o, rows, k in order]),
        rate=max(o.rate for o in observations),
        dropped={
            reason: tuple(sum(o.dropped.get(reason, (0,) * first.n)[j] for o in observations) for j in range(first.n))
            for reason in first.dropped
        },
        settings=first.settings
        if all(o.settings == first.settings for o in observations)
        else {"records": [o.settings for o in observations]},
        files=all_files([o.files for o in observations]),
        errors=_mean_errors(observations),
    )


def _mean_errors(observations: Sequence[Observation]) -> Array | None:
    """Means over all rows of each joint; None unless every observation knows its errors."""
    known = [o.errors for o in observations if o.errors is not None]
    if len(known) < len(observations):
        return None
    rows = np.array([o.rows for o in observations], dtype=float)
    return np.asarray(np.einsum("oj,ojab->jab", rows / np.maximum(rows.sum(axis=0), 1), np.array(known)))


def all_files(hashes: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """Hashes by file name; a name that stands for another file in a later record gets the number of that record."""
    files: dict[str, str] = {}
    for k, of_record in enumerate(hashes, start=1):
        for name, digest in of_record.items():
            files[name if files.get(name, digest) == digest else f"{name} ({k})"] = digest
    return files


def _numbers(names: Sequence[str], among: Sequence[str]) -> list[int]:
    unknown = [name for name in names if name not in among]
    if unknown:
        raise InputError(f"no column {', '.join(unknown)}; there are {', '.join(among)}")
    return [list(among).index(name) for name in names]


__all__ = [
    "Observation",
    "Selection",
    "decimated_torque",
    "filtered_states",
    "observation_from_states",
    "observe",
    "select_rows",
    "stack",
]
