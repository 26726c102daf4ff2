"""Biases of gyroscope and accelerometer on a base that moves, fitted together with the parameters.

The readings w + b_w and f + b_f have constant biases b = (b_w, b_f), in the axes of frame 0. The
torques are linear in X and depend on b through the motion of the base. By Gauss-Newton,

    Y = W(b) X + S db + rho,    S = d(W X)/db,    b <- b + db ,

with each joint weighed by its residual. W is of second degree in b_w and of first in b_f, so that
central differences of W X are exact. One set of biases holds for all records. A prior about the
start keeps a bias that the records do not show; its deviations (`PRIOR`) are wider than the bias of
any sensor.

The deviations of b are those of the linear problem [W S], with blocks of time as independent. The
deviations of X grow by what these deviations of b move: X(b) has the derivative -W^+ S.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from runtime.core.least_squares.block_covariance import block_covariance
from runtime.core.model import GeneratedModel
from runtime.core.problem import Note, Problem
from runtime.core.record import BASE_BIASES, Record
from runtime.core.result import Identification
from runtime.core.rows.observation import Observation, split_rows, stack
from runtime.core.rows.prepared import observation_of, stacked
from runtime.core.rows.regressor import Columns
from runtime.ground.errors import SettingsError
from runtime.ground.limits import LIMIT
from runtime.ground.part import Part
from runtime.ground.progress import at
from runtime.ground.table import Table

Array = np.ndarray

KIND = "biases"
"""Kind of the note that holds the Biases of a problem."""
AXES = tuple(f"{sensor} {axis}" for sensor in ("gyroscope", "accelerometer") for axis in "xyz")
UNITS = ("rad/s",) * 3 + ("m/s**2",) * 3
PRIOR = np.repeat(LIMIT.BIAS_PRIOR, 3)  # deviations, rad/s and m/s**2
PASSES = 8  # of Gauss-Newton
DONE = 0.1  # of the deviation of a bias: a smaller change ends the passes


@dataclass(frozen=True, eq=False)
class Biases(Part):
    """Fitted biases of the sensor on the base, in the axes of frame 0.

    Attributes
    ----------
    values, sigma : ndarray, shape (6,), rad/s and m/s**2
        Biases of gyroscope and accelerometer, and their standard deviations.
    moves : mapping of str to float
        Standard deviation of each base parameter that comes from those of the biases alone, SI.
    """

    values: Array
    sigma: Array
    moves: Mapping[str, float]

    name = "biases"
    title = "Biases of the sensor on the base"

    @property
    def known(self) -> Array:
        """Whether the records show each bias, shape (6,)."""
        return np.asarray(self.sigma < LIMIT.BIAS_LOOSE * PRIOR)

    @property
    def intervals(self) -> list[str]:
        """Each bias with its 95 % confidence interval, or that the records do not show it."""
        return [
            f"{b:.3g} ± {1.96 * s:.2g}" if known else "not determined"
            for b, s, known in zip(self.values, self.sigma, self.known, strict=True)
        ]

    def tables(self) -> list[Table]:
        """Make a table of the biases with their confidence intervals."""
        rows = list(zip(AXES, self.intervals, UNITS, strict=True))
        return [Table("", ("axis of frame 0", "bias ± 95 %", "unit"), rows)]

    def text(self) -> str:
        """Sentence that says how the biases were estimated."""
        return "Fitted together with the parameters and subtracted, by Gauss-Newton."

    def brief(self) -> str:
        """Write the biases with their 95 % confidence intervals in one line."""
        said = [
            f"{axis} {text}{f' {unit}' * bool(known)}"
            for axis, text, known, unit in zip(AXES, self.intervals, self.known, UNITS, strict=True)
        ]
        return f"Biases of the sensor on the base (± 95 %): {', '.join(said)}"

    def warnings(self) -> tuple[str, ...]:
        """Warn of biases that are larger than those of usual sensors; another mounting of the
        sensor would explain them.
        """
        large = [
            f"{axis} {b:.3g} {unit}"
            for axis, b, most, unit in zip(AXES, self.values, PRIOR, UNITS, strict=True)
            if abs(b) > most
        ]
        if not large:
            return ()
        return (
            f"Fitted biases are larger than those of any sensor ({', '.join(large)}): check mounting, "
            "units and sign in record.base; without biases: fit, the result names another mounting "
            "that explains the record.",
        )

    def summary(self) -> dict[str, Any]:
        """Return the biases as a mapping for JSON."""
        return {
            axis: {"value": float(b), "sigma": float(s), "unit": unit, "determined": bool(known)}
            for axis, b, s, known, unit in zip(
                AXES, self.values, self.sigma, self.known, UNITS, strict=True
            )
        }


def fitted_biases(problem: Problem) -> Problem:
    """Fit the biases of the sensor on the base, and subtract them in all records.

    This is a step of the preparation of a problem, for records with the channel base_biases.
    Without such records, or if the biases are fitted already, the problem is returned unchanged.

    Raises
    ------
    SettingsError
        One record of the problem has the channel, and another has not.
    """
    if not problem.records or problem.noted(KIND) is not None:
        return problem
    if not all(BASE_BIASES in record.channels for record in problem.records):
        raise SettingsError(
            "some records have no sensor whose biases are fitted, but one set of biases holds for all "
            "records; write biases: fit for all records, or for none",
            path=("record", "base", "biases"),
        )
    at("biases of the sensor on the base")
    start = np.mean([record.channels[BASE_BIASES][0] for record in problem.records], axis=0)
    b = start.copy()
    for _ in range(PASSES):
        fit = _Pass(problem, b, start)
        b = b + fit.step
        if (np.abs(fit.step) < DONE * fit.formal).all():
            break
    biases = Biases(b, fit.sigma, dict(zip(fit.names, map(float, fit.moves), strict=True)))
    return _with_biases(problem, b).changed(Note(KIND, "", result=biases))


def told_biases(result: Identification) -> Biases | None:
    """Return the fitted biases; None if none were fitted."""
    note = result.problem.noted(KIND)
    return None if note is None else note.result


def with_biases(result: Identification) -> Identification:
    """Widen the deviations of the parameters by what the deviations of the biases move."""
    biases = told_biases(result)
    return result if biases is None else replace(result, sets=result.sets.wider(biases.moves))


class _Pass:
    """One step of Gauss-Newton from the biases b.

    step, formal, sigma : change of b, and deviations of b for independent residuals and for blocks
    of time, (6,).   moves : deviations of X by those of b.
    """

    def __init__(self, problem: Problem, b: Array, start: Array) -> None:
        rows = _rows(problem, b)
        self.names = rows.names
        scale = _scale(rows)
        W, Y = rows.W / scale[:, None], rows.Y / scale
        X = np.linalg.lstsq(W, Y, rcond=1e-10)[0]
        S = np.empty((len(Y), 6))
        for k, h in enumerate(PRIOR):
            ahead, behind = (_torques(problem, b + s * h * np.eye(6)[k], X) for s in (1, -1))
            S[:, k] = (ahead - behind) / (2 * h) / scale
        prior = np.hstack([np.zeros((6, W.shape[1])), np.diag(1 / PRIOR)])
        whole = np.hstack([W, S])
        T = _inverse_root(np.vstack([whole, prior]))
        right = np.concatenate([Y - W @ X, (start - b) / PRIOR])
        change = T @ (T.T @ (np.vstack([whole, prior]).T @ right))
        self.step = change[-6:]
        residual = Y - W @ X - whole @ change
        blocks = split_rows(np.column_stack([whole, residual]), rows.blocks())
        by_time = block_covariance(blocks, np.zeros(whole.shape[1]), T)[-6:, -6:]
        C = (T @ T.T)[-6:, -6:]
        self.formal = np.sqrt(np.diag(C))
        if np.isfinite(by_time).all():
            larger = np.fmax(np.sqrt(np.diag(by_time)) / self.formal, 1.0)
            C = C * np.outer(larger, larger)
        self.sigma = np.sqrt(np.diag(C))
        J = np.linalg.lstsq(W, S, rcond=1e-10)[0]
        self.moves = np.sqrt(np.einsum("ik,kl,il->i", J, C, J))


def _rows(problem: Problem, b: Array) -> Observation:
    """Build Y = W(b) X + rho of the fitted records, of the columns that the study fits."""
    columns = problem.settings.estimate.columns
    moved = _with_biases(problem, b)
    return stacked(moved.model, moved.prepared, None if columns == "all" else tuple(columns))


class _OneColumn:
    """A model whose only column of W is the torque of the parameters X of another model."""

    BASE_PARAMETERS = ("torque",)

    def __init__(self, model: GeneratedModel, X: Array) -> None:
        self._model, self._X, n = model, X, len(model.JOINTS)
        self.STRUCTURE = np.ones((1, n), dtype=bool)

    def __getattr__(self, name: str) -> Any:
        if not name.isupper():
            raise AttributeError(name)
        return getattr(self._model, name)

    def store(self, N: int) -> Array:
        return np.zeros((1, len(self.STRUCTURE[0]), N))

    def regressor(self, q: Array, qd: Array, qdd: Array, out: Any = None, **further: Any) -> Array:
        return np.asarray(self._model.inverse_dynamics(q, qd, qdd, self._X, **further))[..., None]


def _torques(problem: Problem, b: Array, X: Array) -> Array:
    """Compute W(b) X of the fitted records, X of the columns that the study fits, shape (r,)."""
    moved, columns = _with_biases(problem, b), problem.settings.estimate.columns
    names = list(moved.model.BASE_PARAMETERS)
    whole = np.zeros(len(names))
    whole[[names.index(name) for name in (names if columns == "all" else columns)]] = X
    model = cast(GeneratedModel, _OneColumn(moved.model, whole))
    parts = [
        observation_of(
            Columns(model), replace(own.states, errors=None), own.torque, own.certain(moved.model)
        )
        for own in moved.prepared
    ]
    return stack(parts).W[:, 0]


def _with_biases(problem: Problem, b: Array) -> Problem:
    """Return the problem with the biases b in the records that have some."""

    def changed(records: Sequence[Record]) -> tuple[Record, ...]:
        return tuple(
            replace(r, channels={**r.channels, BASE_BIASES: np.tile(b, (len(r), 1))})
            if BASE_BIASES in r.channels
            else r
            for r in records
        )

    return problem.changed(records=changed(problem.records), unseen=changed(problem.unseen))


def _scale(rows: Observation) -> Array:
    """Return the standard deviation of the residual of the joint of each row, shape (r,)."""
    joint = rows.joints
    r = rows.Y - rows.W @ np.linalg.lstsq(rows.W, rows.Y, rcond=1e-10)[0]
    squares, counts = np.bincount(joint, r**2, rows.n), np.bincount(joint, minlength=rows.n)
    size = np.sqrt(squares / np.maximum(counts, 1))
    least = 1e-9 * max(float(np.abs(rows.Y).max(initial=0.0)), 1e-300)
    return np.asarray(np.maximum(size, least)[joint])


def _inverse_root(A: Array) -> Array:
    """Compute T with T T' = (A'A)^+, after division of each column by its norm."""
    size = np.linalg.norm(A, axis=0)
    size = np.where(size > 0, size, 1.0)
    return np.asarray(np.linalg.pinv(np.linalg.qr(A / size, mode="r"), rcond=1e-10) / size[:, None])
