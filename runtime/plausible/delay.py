"""The time by which the torque of each joint is late against its position, estimated with its
deviation.

    Y_j(t) = [W_j X](t - delta_j) + rho:      Y_j(t + delta) = W_j X - (delta_j - delta) d/dt(W_j X)
                                              + ...

Gauss-Newton over X and every delta_j together: torques are shifted by the last delta (cubic
interpolation of the filtered signal), W stays. The start is
the best common shift of a grid. Rows near a reversal are left out, where sign(qd) has no derivative
and the filter smears its step. Deviations are the larger of two, that of
least squares and that of blocks of time taken as independent.

A delay of a few ms is what controllers and field buses make of a record; at 1 Hz and 10 rad/s^2 it
costs some per cent of the torque.

Positions of some joints J that are late, alone or with their torques, are another delay, of one
number:

    Y_j(t + [j in J] delta) = W_j(q_J(t + delta), q(t)) X + rho

Its first step tells which joints, one or all from some joint on, are searched.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PPoly
from scipy.optimize import minimize_scalar

from runtime.errors import InputError
from runtime.json_documents import Result
from runtime.limits import LIMIT
from runtime.markup import number
from runtime.model.generated import GeneratedModel, joint_labels
from runtime.plausible.fits import Grams, solved
from runtime.plausible.samples import lowpassed, usable
from runtime.records.record import Record
from runtime.rows.prepared import Prepared, prepared
from runtime.settings.study import Study
from runtime.signals.states import require_motion
from runtime.table import Table

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Delay(Result):
    """Delays of the torques, by joint; a positive one is a torque that comes late.

    Attributes
    ----------
    joints : tuple of str
    shift, sigma : ndarray, shape (n,), s
        Delay of each joint, and its deviation; nan of a joint that does not move enough.
    common, sigma_common : float, s
        Weighted mean over the joints, and its deviation; the larger of the stated one and that of
        their scatter.
    before, after : ndarray, shape (n,), %
        100 ||Y_j - W_j X|| / ||Y_j|| without and with the delays.
    """

    joints: tuple[str, ...]
    shift: Array
    sigma: Array
    common: float
    sigma_common: float
    before: Array
    after: Array

    def table(self) -> Table:
        """One line per joint, ms and %."""
        columns = (1e3 * self.shift, 1e3 * self.sigma, self.before, self.after)
        return Table(
            "Delay of the torques against the positions",
            ("joint", "torque late by, ms", "deviation, ms", "error without, %", "with, %"),
            [
                (joint, *(number(x, ".2f") for x in row))
                for joint, *row in zip(self.joints, *columns, strict=True)
            ],
        )

    def to_table(self) -> str:
        """The table, and the mean over the joints."""
        return (
            f"{self.table().to_text()}\nall joints: {1e3 * self.common:.2f} ms, deviation "
            f"{1e3 * self.sigma_common:.2f} ms"
        )


@dataclass(frozen=True, eq=False)
class LatePositions:
    """Positions of some joints, recorded later than the others.

    Attributes
    ----------
    joints : ndarray of bool, shape (n,)
    torques : bool
        Whether the torques of these joints are late by as much.
    shift : float, s
    before, after : ndarray, shape (n,), %
        As those of `Delay`.
    """

    joints: Array
    torques: bool
    shift: float
    before: Array
    after: Array


def delay(
    model: GeneratedModel,
    record: Record | Prepared,
    study: Study | None = None,
    *,
    longest: float = LIMIT.LONGEST_DELAY,
) -> Delay:
    """The time shift between positions and torques of a record, by joint.

    Parameters
    ----------
    model : GeneratedModel
    record : Record or Prepared
        Joint side, SI.
    study : Study, optional
        Filters and window; default: Study().
    longest : float, s
        Largest delay looked for.

    Returns
    -------
    Delay

    Raises
    ------
    InputError
        `longest` beyond a tenth of the record, or fewer rows than unknowns.
    """
    return delays(model, record, study, longest, positions=False)[0]


def delays(
    model: GeneratedModel,
    record: Record | Prepared,
    study: Study | None,
    longest: float,
    *,
    positions: bool = True,
) -> tuple[Delay, LatePositions | None]:
    """As `delay`; also the positions that are late instead, those that leave least, None where none
    leave less than the record as it is, or where they are not asked for.
    """
    study = study or Study()
    require_motion(study.signals, "a delay")
    own = prepared(model, record, study)
    record = own.record
    duration = float(record.t[-1] - record.t[0])
    if not 0 < longest <= duration / 10:
        raise InputError(
            (
                f"delays up to {longest:g} s in a record of {duration:g} s; expected at most a "
                "tenth "
                "of it"
            ),
            file=record.name,
        )
    problem = _Problem(model, own, study, longest)
    sigmas = [problem.fit(np.full(record.n, d))[1] for d in problem.grid]
    start = problem.grid[int(np.argmin(np.log(sigmas).sum(axis=1)))]
    shift = np.full(record.n, start)
    for _ in range(LIMIT.DELAY_PASSES):
        step = np.clip(problem.step(shift)[0], -longest / 2, longest / 2)
        shift = np.clip(shift + step, -longest, longest)
        if np.abs(step).max() < 1e-7:
            break
    _, sigma, share = problem.step(shift)
    known = share & (np.abs(shift) < longest)
    shift, sigma = np.where(known, shift, np.nan), np.where(known, sigma, np.nan)
    common, sigma_common = _mean(shift[known], sigma[known])
    labels = joint_labels(model)
    before, after = problem.errors(np.zeros(record.n)), problem.errors(np.where(known, shift, 0.0))
    late = Delay(labels, shift, sigma, common, sigma_common, before, after)
    try:
        return late, problem.late_positions(before) if positions else None
    except ValueError:  # a loop that does not close in other positions
        return late, None


def _mean(shift: Array, sigma: Array) -> tuple[float, float]:
    """Weighted mean, and its deviation."""
    if not len(shift):
        return float("nan"), float("nan")
    w = sigma**-2.0
    mean = float(w @ shift / w.sum())
    stated = float(w.sum() ** -0.5)
    scatter = (
        float(np.sqrt((w @ (shift - mean) ** 2) / w.sum() / max(len(shift) - 1, 1)))
        if len(shift) > 1
        else 0.0
    )
    return mean, max(stated, scatter)


class _Problem:
    """W and its rate at some instants, and torques that can be shifted."""

    def __init__(self, model: GeneratedModel, own: Prepared, study: Study, longest: float) -> None:
        record = own.record
        cutoff, states, torque = lowpassed(own, study)
        tau = torque(record.torque)
        margin = int(np.ceil((longest + 1 / cutoff) * record.rate)) + 2
        inside = usable(record, study, margin // 10, margin)
        inside[:margin] = inside[-margin:] = False
        kept = np.flatnonzero(inside)
        step = max(1, int(0.8 * record.rate / (2 * cutoff)), -(-len(kept) // LIMIT.DELAY_INSTANTS))
        kept = kept[::step]
        self.b, self.n = len(model.BASE_PARAMETERS), record.n
        self.alike = max(1.0, record.rate / (LIMIT.NOISE_BAND * cutoff) / step)
        if len(kept) * self.n <= 2 * self.b:
            raise InputError(
                (
                    f"{len(kept)} instants for {self.b} parameters and {self.n} delays; use a "
                    "longer "
                    "record"
                ),
                file=record.name,
            )
        self.t, self.longest = record.t[kept], longest
        self.grid = (
            0.0,
            *(
                sign * d
                for d in (0.002, 0.005, 0.01, 0.02, 0.04, 0.07)
                for sign in (1, -1)
                if d < longest
            ),
        )
        spline = CubicSpline(record.t, tau)
        self.torques = [PPoly(spline.c[:, :, j], spline.x) for j in range(self.n)]

        def W(k: Array) -> Array:
            return np.asarray(model.regressor(states.q[k], states.qd[k], states.qdd[k]))

        self.model = model
        self.states = CubicSpline(record.t, np.stack([states.q, states.qd, states.qdd], axis=1))
        self.D = W(kept)
        self.rate = (W(kept + 1) - W(kept - 1)) * (record.rate / 2)
        # a step of dry friction is smeared by the filter of the torques: rows near a jump of a
        # column of signs are left out
        flat = np.isin(np.abs(self.D), (0.0, 1.0)).all(axis=0)
        self.rate[:, flat], self.flat = 0.0, flat
        smeared = int(LIMIT.SMEARED * record.rate / cutoff)
        steps = [
            np.sign(W(kept + k)) != np.sign(self.D)
            for k in (-smeared, -smeared // 2, smeared // 2, smeared)
        ]
        moving = np.abs(states.qd[kept]) > LIMIT.STANDING * np.abs(states.qd).max(axis=0)
        self.mask = moving & ~(np.any(steps, axis=0) & flat).any(axis=2)

    def shifted(self, shift: Array) -> Array:
        """Y_j(t + delta_j), shape (K, n)."""
        return np.column_stack(
            [torque(self.t + d) for torque, d in zip(self.torques, shift, strict=True)]
        )

    def rows(self, shift: Array) -> tuple[Array, Array]:
        """W with the positions of each joint taken a time later, shape (K, n, b), and its rows away
        from jumps.
        """
        states, mask = self.states(self.t), self.mask.copy()
        for j in np.flatnonzero(shift):
            later = self.t + shift[j]
            states[:, :, j] = self.states(later)[:, :, j]
            mask[:, j] = self.mask[np.searchsorted(self.t, later).clip(max=len(self.t) - 1), j]
        return np.asarray(self.model.regressor(*states.transpose(1, 0, 2))), mask

    def late_positions(self, before: Array) -> LatePositions | None:
        """The set of joints, one or all from some joint on, and the time by which their positions,
        or positions and torques, are late, that leave least.
        """
        zero, number = np.zeros(self.n), np.arange(self.n)
        X, sigma, e = self.fit(zero)
        w = self.mask / sigma
        slope = np.zeros((self.n, len(self.t), self.n))  # of the torques by the time of each joint
        for j in number:
            change = self.rows(LIMIT.DELAY_STEP * (number == j))[0] - self.D
            change[:, self.flat] = 0.0
            slope[j] = w * (change @ X) / LIMIT.DELAY_STEP
        own = np.einsum("kj,kj,ji->jki", w, self.rate @ X, np.eye(self.n))
        sets = [number == j for j in number]
        sets += [number >= j for j in range(1, self.n - 1)]
        which = [(joints, both) for joints in sets for both in (False, True)]
        Z = np.stack([(slope - both * own)[joints].sum(axis=0).ravel() for joints, both in which])
        D = (self.D * w[:, :, None]).reshape(-1, self.b)
        Z = Z - Z @ D @ np.linalg.pinv(D.T @ D, rcond=1e-10, hermitian=True) @ D.T
        size = np.maximum((Z * Z).sum(axis=1), 1e-12)
        along = Z @ (e / sigma).ravel()
        best = None
        for k in np.argsort(-(along**2) / size)[: LIMIT.LATE_SETS]:
            joints, both = which[k]

            def left(d: float, joints: Array = joints, both: bool = both) -> Array:
                return self.errors(d * joints if both else zero, d * joints)

            def total(d: float, left: Callable[[float], Array] = left) -> float:
                return float(np.log(np.maximum(left(d), 0.1)).sum())

            first = float(np.clip(along[k] / size[k], -self.longest, self.longest))
            near = min((0.5 * first, first, 1.5 * first), key=total)
            bounds = sorted(np.clip((0.6 * near, 1.5 * near), -self.longest, self.longest))
            d = float(
                minimize_scalar(total, bounds=bounds, method="bounded", options={"maxiter": 10}).x
            )
            of = joints if d > 0 or not both else ~joints  # early ones are others that are late
            found = LatePositions(of, both, abs(d) if both else d, before, left(d))
            if best is None or total(d) < np.log(np.maximum(best.after, 0.1)).sum():
                best = found
        return best

    def fit(self, shift: Array, late: Array | None = None) -> tuple[Array, Array, Array]:
        """X, sigma by joint, and the residuals, shape (K, n). late : time of the positions."""
        D, mask = (self.D, self.mask) if late is None else self.rows(late)
        Y = self.shifted(shift)
        grams, rows = Grams.of(D, Y, mask), np.maximum(mask.sum(axis=0), 1)
        sigma = np.sqrt(np.maximum(grams.measured, 1e-300) / rows)
        for _ in range(4):
            X = solved(*grams.weighted(sigma))
            sigma = np.maximum(np.sqrt(grams.squares(X) / rows), 1e-6 * sigma)
        return X, sigma, (Y - D @ X) * mask

    def errors(self, shift: Array, late: Array | None = None) -> Array:
        """Relative error by joint, %. late : time of the positions."""
        Y = self.shifted(shift) * (self.mask if late is None else self.rows(late)[1])
        return np.asarray(
            100
            * np.linalg.norm(self.fit(shift, late)[2], axis=0)
            / np.maximum(np.linalg.norm(Y, axis=0), 1e-300)
        )

    def step(self, shift: Array) -> tuple[Array, Array, Array]:
        """Gauss-Newton step of the delays, their deviations, and which of them the record
        determines.
        """
        X, sigma, e = self.fit(shift)
        w = self.mask / sigma
        slope = -(self.rate @ X) * w
        K, n, b = len(self.t), self.n, self.b
        Z = np.zeros((K, n, b + n))
        Z[:, :, :b] = self.D * w[:, :, None]
        Z[:, np.arange(n), b + np.arange(n)] = slope
        columns = Z.reshape(-1, b + n)
        A = columns.T @ columns
        scale = np.sqrt(np.diag(A))
        scale = np.where(scale > 0, scale, 1.0)
        inverse = np.linalg.pinv(
            A / np.outer(scale, scale), rcond=1e-10, hermitian=True
        ) / np.outer(scale, scale)
        r = e / sigma
        x = inverse @ (columns.T @ r.ravel())
        rows = int(self.mask.sum())
        share = self.alike * rows / max(rows - b - n, 1)
        blocks = np.array_split(np.arange(K), min(LIMIT.DELAY_BLOCKS, K))
        g = np.array([np.tensordot(r[k], Z[k], axes=2) for k in blocks])
        between = inverse @ (g.T @ g) @ inverse * share * len(blocks) / (len(blocks) - 1)
        deviation = np.sqrt(np.maximum(np.diag(inverse) * share, np.diag(between)))[b:]
        seen = (slope**2).sum(axis=0) > 1e-6
        return np.where(seen, x[b:], 0.0), deviation, seen & (deviation < self.longest)


__all__ = ["Delay", "delay"]
