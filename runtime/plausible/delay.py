"""Estimate the delay of the torque of each joint relative to its position, with standard
deviations.

    Y_j(t) = [W_j X](t - delta_j) + rho
    Y_j(t + delta) = W_j X - (delta_j - delta) d/dt(W_j X) + ...

X and all delta_j are estimated together by Gauss-Newton steps: torques are shifted by the last
delta (cubic interpolation of the filtered signal), and W stays the same. The iteration starts from
the best common shift of a grid. Rows near a reversal are left out for columns sign(qd), which have
no derivative there and whose step the filter smears. The standard deviation is the larger of two:
that of least squares, and that between blocks of time that are assumed to be independent.

Controllers and field buses often cause a delay of a few ms; at 1 Hz and 10 rad/s^2, such a delay
changes the torque by some per cent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from runtime.core.model import GeneratedModel, is_axis, joint_labels
from runtime.core.problem import Problem
from runtime.core.rows.regressor import in_time
from runtime.ground.documents import Result
from runtime.ground.errors import InputError
from runtime.ground.limits import limits
from runtime.ground.table import Table, number
from runtime.plausible.bodies import Grams, solve_scaled
from runtime.plausible.samples import Filtered, filtered, usable

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Delay(Result):
    """Delay of the torque of each joint relative to its position; positive if the torque is late.

    Attributes
    ----------
    joints : tuple of str
    shift, sigma : ndarray, shape (n,), s
        Delay of each joint, and its standard deviation; nan for a joint that does not move enough.
    common, sigma_common : float, s
        Weighted mean over the joints, and its standard deviation: the larger of two, computed from
        sigma and from the scatter of the delays.
    before, after : ndarray, shape (n,), %
        Relative error 100 ||Y_j - W_j X|| / ||Y_j|| without and with the delays.
    """

    joints: tuple[str, ...]
    shift: Array
    sigma: Array
    common: float
    sigma_common: float
    before: Array
    after: Array

    def table(self) -> Table:
        """Tabulate, for each joint, the delay in ms and the fit error before and after correction."""
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
        """Write the table of the delays, then their mean over the joints."""
        return (
            f"{self.table().to_text()}\nall joints: {1e3 * self.common:.2f} ms, deviation "
            f"{1e3 * self.sigma_common:.2f} ms"
        )


def delay(problem: Problem, *, longest: float = LIMIT.LONGEST_DELAY) -> Delay:
    """Estimate the time shift between positions and torques of the first record, joint by joint.

    Parameters
    ----------
    problem : Problem
        Its settings give the filters and the window.
    longest : float, s
        Largest delay that is searched for.

    Returns
    -------
    Delay

    Raises
    ------
    InputError
        `longest` is more than a tenth of the record, or there are too few rows.
    """
    problem.require_motion("a delay")
    reading = problem.prepared[0]
    return delay_of(problem.model, filtered(reading, reading.study), longest)


def delay_of(model: GeneratedModel, through: Filtered, longest: float) -> Delay:
    """Estimate the delay of the torque of each joint in a record whose signals are filtered."""
    record = through.record
    duration = float(record.t[-1] - record.t[0])
    if not 0 < longest <= duration / 10:
        raise InputError(
            f"the longest delay is {longest:g} s; expected more than 0 and at most a tenth of the "
            f"record, which lasts {duration:g} s",
            file=record.name,
        )
    shifts = Shifts(model, through, longest)
    sigmas = [shifts.fit(np.full(record.n, d))[1] for d in shifts.grid]
    start = shifts.grid[int(np.argmin(np.log(sigmas).sum(axis=1)))]
    shift = np.full(record.n, start)
    for _ in range(LIMIT.DELAY_PASSES):
        step = np.clip(shifts.step(shift)[0], -longest / 2, longest / 2)
        shift = np.clip(shift + step, -longest, longest)
        if np.abs(step).max() < 1e-7:
            break
    _, sigma, share = shifts.step(shift)
    known = share & (np.abs(shift) < longest)
    shift, sigma = np.where(known, shift, np.nan), np.where(known, sigma, np.nan)
    common, sigma_common = _mean(shift[known], sigma[known])
    labels = joint_labels(model)
    before, after = shifts.errors(np.zeros(record.n)), shifts.errors(np.where(known, shift, 0.0))
    return Delay(labels, shift, sigma, common, sigma_common, before, after)


def _mean(shift: Array, sigma: Array) -> tuple[float, float]:
    """Compute the weighted mean of the delays and its standard deviation, both in s."""
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


class Shifts:
    """Least-squares problem of one record whose torques can be shifted in time.

    The problem stores W and its time derivative at some instants.
    """

    def __init__(self, model: GeneratedModel, through: Filtered, longest: float) -> None:
        record, states, cutoff = through.record, through.states, through.low.hertz
        tau = through.torque(record.torque)
        margin = int(np.ceil((longest + 1 / cutoff) * record.rate)) + 2
        inside = usable(record, through.study, margin // 10, margin)
        inside[:margin] = inside[-margin:] = False
        kept = np.flatnonzero(inside)
        step = max(1, int(0.8 * record.rate / (2 * cutoff)), -(-len(kept) // LIMIT.DELAY_INSTANTS))
        kept = kept[::step]
        self.b, self.n = len(model.BASE_PARAMETERS), record.n
        self.alike = max(1.0, record.rate / (LIMIT.NOISE_BAND * cutoff) / step)
        if len(kept) * self.n <= 2 * self.b:
            raise InputError(
                f"{len(kept)} samples are too few for {self.b} parameters and {self.n} delays; use "
                "a longer record",
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

        channels = in_time(model, states)

        def W(k: Array) -> Array:
            timed = {name: x[k] for name, x in channels.items()}
            return np.asarray(model.regressor(states.q[k], states.qd[k], states.qdd[k], **timed))

        self.D = W(kept)
        self.rate = (W(kept + 1) - W(kept - 1)) * (record.rate / 2)
        # a step of dry friction is smeared by the filter of the torques: rows near a jump of a
        # column of signs are left out
        flat = np.isin(np.abs(self.D), (0.0, 1.0)).all(axis=0)
        self.rate[:, flat] = 0.0
        smeared = int(LIMIT.SMEARED * record.rate / cutoff)
        steps = [
            np.sign(W(kept + k)) != np.sign(self.D)
            for k in (-smeared, -smeared // 2, smeared // 2, smeared)
        ]
        moving = np.abs(states.qd[kept]) > LIMIT.STANDING * np.abs(states.qd).max(axis=0)
        axes = [is_axis(joint) for joint in model.JOINTS]  # of force sensors, which joints move
        moving[:, axes] = moving.any(axis=1, keepdims=True)
        self.mask = moving & ~(np.any(steps, axis=0) & flat).any(axis=2)

    def shifted(self, shift: Array) -> Array:
        """Interpolate the torque of each joint at the times t + shift, s, shape (K, n).

        Each joint has its own shift.
        """
        return np.column_stack(
            [torque(self.t + d) for torque, d in zip(self.torques, shift, strict=True)]
        )

    def fit(self, shift: Array) -> tuple[Array, Array, Array]:
        """Fit the base parameters X to torques that are shifted in time by `shift`, s.

        Return X, the residual of each joint (root mean square), and all residuals, shape (K, n).
        """
        Y = self.shifted(shift)
        grams = Grams.of(self.D, Y, self.mask)
        rows = np.maximum(self.mask.sum(axis=0), 1)
        sigma = np.sqrt(np.where(grams.measured > 0, grams.measured, 1.0) / rows)
        for _ in range(4):
            X = solve_scaled(*grams.weighted(sigma))
            sigma = np.maximum(np.sqrt(grams.squares(X) / rows), 1e-6 * sigma)
        return X, sigma, (Y - self.D @ X) * self.mask

    def errors(self, shift: Array) -> Array:
        """Compute the fit error of each joint, %, with torques shifted in time by `shift`, s."""
        size = np.linalg.norm(self.shifted(shift) * self.mask, axis=0)
        left = np.linalg.norm(self.fit(shift)[2], axis=0)
        return np.asarray(100 * left / np.maximum(size, 1e-300))

    def step(self, shift: Array) -> tuple[Array, Array, Array]:
        """Compute one Gauss-Newton step of the torque delays of all joints.

        Return the step and its standard deviation for each joint, s, and whether the record
        determines this delay.
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
