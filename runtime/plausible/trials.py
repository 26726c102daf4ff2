"""Try the possible errors of `runtime.plausible.causes`: which error explains the record best?

A cause is a possible error of the study, tried as a change that corrects it. Every cause is first
fitted by weighted least squares: this score is a bound, because no physical robot can have a better
score. Only causes whose bound is better than the best score so far are fitted under the conditions
of a physical robot, near the values of the robot file if there are any.

An unknown number xi of a cause, for instance a factor, is searched if its first step gains enough.
Around the fit chi of a physical robot, with A the weighted normal matrix, B the stiffness of bodies
and values, J = d(W chi)/d xi its effect,

    [A + B   W'J] [d chi]   [ 0  ]
    [J'W     J'J] [d xi ] = [J'e ],      sigma_xi^2 = 1/(J'J - J'W (A + B)^-1 W'J)

    gain = xi^2/(2 sigma_xi^2) nats

with rows divided by their sigma. Then fits of a physical robot search the best xi.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy.linalg import qr
from scipy.optimize import minimize_scalar

from runtime.core.model import GeneratedModel, drives_of
from runtime.ground.limits import limits
from runtime.physical.inertia import INERTIAL, PhysicalModel, frame_origins, physical_model
from runtime.plausible.bodies import (
    Bodies,
    Fit,
    Grams,
    fit_of,
    least_squares,
    physical_fit,
    quick_fit,
    solve_scaled,
)
from runtime.plausible.causes import (
    NUMBERS,
    Cause,
    Robot,
    Row,
    causes,
    unchanged_study,
    unmodelled_torques,
)
from runtime.plausible.samples import Samples, moving

LIMIT = limits(__package__)
DEAR = ("rate", "coupling", "offset", "scale", "ratio")
"""Kinds of causes that give the parameters more freedom: they must gain LIMIT.RATE_GAIN more."""

Array = np.ndarray
Change = Callable[[float], Cause]


@dataclass(frozen=True, eq=False)
class Trial:
    """One cause (a possible error of the study), and the fit with this error corrected.

    Attributes
    ----------
    cause : Cause
    fit : Fit or None
        Fit under the conditions of a physical robot; None if the fit was not made because a simpler
        fit shows that the cause cannot win.
    gain : float, nats
        Score of the study as given minus the score of this fit; for some causes, a penalty is
        subtracted.
    equivalent : bool
        Whether no fit can distinguish the cause from the study as given.
    """

    cause: Cause
    fit: Fit | None
    gain: float
    equivalent: bool = False


@dataclass(frozen=True, eq=False)
class Baseline:
    """Reference fit, with the study as given, to which fits with a corrected error are compared.

    Attributes
    ----------
    model, variants : GeneratedModel
        The generated module of the robot, and that of `symgen.variants` or None.
    physical : PhysicalModel
    samples : Samples
    D : ndarray, shape (K, n, b)
        Regressor of the study at the samples.
    size : float, m
        Length of the robot.
    bodies : Bodies
    N : float
        Number of independent rows of a joint.
    free, given : Fit
        Fit of free parameters by least squares, and fit of a physical robot.
    F : ndarray, shape (n, n)
        Matrix that converts torques of the joints to torques on the side of the files.
    """

    model: GeneratedModel
    variants: GeneratedModel | None
    physical: PhysicalModel
    samples: Samples
    D: Array
    size: float
    bodies: Bodies
    N: float
    free: Fit
    given: Fit
    F: Array

    def regressor(self, cause: Cause) -> Array | None:
        """Evaluate the regressor with one possible error (cause) corrected.

        If the table of frames changes, its columns are the standard parameters. The shape is (K, n,
        b); None if the regressor cannot be evaluated.
        """
        if cause.on_torques:
            return self.D
        model = self.variants if cause.constants else self.model
        assert model is not None
        try:
            return regressor(model, cause.states(self.samples), **cause.constants)
        except ValueError:  # a loop that does not close
            return None

    def rows(self, cause: Cause) -> tuple[Array, Array, Array] | None:
        """Form the regressor and the torques with one possible error (cause) corrected.

        On the side of the files, return the regressor F T^-1 W', the torques F tau - F T^-1 known,
        and the rows used, bool (K, n). Together they are T tau - known = W' X', multiplied by F
        T^-1. So every cause explains the same measured torques F tau, and residuals of coupled
        motors are not mixed. The result is None if the regressor cannot be evaluated.
        """
        D = self.regressor(cause)
        if D is None:
            return None
        back = self.F @ np.linalg.inv(cause.T)
        still = ~moving(cause.states(self.samples)[1])
        still |= ~self.samples.steady @ (np.abs(cause.P.T) > 1e-12)
        known = cause.subtracted(self.samples) @ back.T
        if not np.array_equal(back, np.eye(len(back))):
            D = (back @ D.T).T
        return D, self.tau - known, still @ (np.abs(back) > 1e-12).T == 0

    @cached_property
    def tau(self) -> Array:
        """Measured torques of the joints or motors, as in the files, shape (K, n)."""
        return np.asarray(self.samples.tau @ self.F.T)

    @cached_property
    def as_given(self) -> tuple[Array, Array, Array]:
        """Regressor, torques and used samples (a mask), with unchanged settings of the study."""
        rows = self.rows(unchanged_study(self.samples.n))
        assert rows is not None
        return rows

    @cached_property
    def basis(self) -> Array:
        """Orthonormal basis of the column space of the observation matrix W, shape (K*n, rank).

        Each row of W is first divided by the residual of its joint.
        """
        weighted = (self.as_given[0] / self.free.sigma[:, None]).reshape(-1, self.D.shape[2])
        scale = np.linalg.norm(weighted, axis=0)
        Q, R, _ = qr(weighted / np.where(scale > 0, scale, 1.0), mode="economic", pivoting=True)
        return np.asarray(Q[:, np.abs(np.diag(R)) > 1e-9])

    def grams(self, cause: Cause) -> Grams | None:
        """Form the normal equations of least squares with one possible error (cause) corrected.

        The result is None if the regressor cannot be evaluated.
        """
        rows = self.rows(cause)
        return None if rows is None else Grams.of(*rows, self.tau)

    def standard(self, grams: Grams) -> Grams:
        """Transform normal equations of base parameters to the standard parameters, if needed."""
        p = len(self.physical.standard)
        return grams if grams.of_joints.shape[1] == p + 1 else grams.mapped(self.physical.K)

    def bound(self, grams: Grams) -> Fit:
        """Fit without physical conditions; no physical fit of the same samples has a better score.

        If the robot file has values of links, the penalty draws the parameters towards them.
        """
        if self.bodies.near_values:
            return least_squares(self.standard(grams), self.N, self.bodies)
        return least_squares(grams, self.N)

    def fit(
        self, grams: Grams, how: Callable[..., Fit] = physical_fit, sigma: Array | None = None
    ) -> Fit:
        """Fit the standard parameters under physical conditions, by physical_fit or quick_fit
        (`how`).

        sigma : residuals of the joints that give the first weights; default: those of least
            squares.
        """
        sigma = self.bound(grams).sigma if sigma is None else sigma
        return how(self.standard(grams), self.bodies, self.N, sigma)

    def trial(self, cause: Cause, sigma: Array | None = None) -> Trial:
        """Correct one possible error (cause), fit a physical robot, and compute how much the fit
        improves.

        The gain is that of the score, in nats. The number of independent rows is the larger of two,
        those of the study and of the cause.

        sigma : residuals of the joints that give the first weights; default: those of least
            squares.
        """
        rows = self.rows(cause)
        if rows is None:
            return Trial(cause, None, -np.inf)
        fit = self.fit(Grams.of(*rows, self.tau), sigma=sigma)
        D = rows[0] if cause.constants else rows[0] @ self.physical.K
        N = max(self.N, counting_rows(D, *rows[1:], fit.X))
        nearer = self.given.penalty - fit.penalty
        gain = (self.given.score - fit.score - nearer) * N / self.N + nearer
        return Trial(cause, fit, gain)

    def unseen(self, cause: Cause) -> float:
        """Correct one possible error, and compute how well a fit of half of the rows predicts the
        other half.

        The rows are divided into two parts, of alternating blocks of time. The fit of each part
        predicts the other part; the result is the score in nats, and smaller is better.
        """
        rows = self.rows(cause)
        if rows is None:
            return np.inf
        D, Y, mask = rows
        turns = np.arange(len(Y)) * LIMIT.TURNS // len(Y) % 2
        parts = [Grams.of(D, Y, mask & (turns == k)[:, None], self.tau) for k in (0, 1)]
        score = 0.0
        for part, other in (parts, parts[::-1]):
            fit = self.fit(part)
            score += fit_of(self.standard(other), fit.X, self.N / 2, fit.penalty / 2).score
        return score

    def held_out(self, cause: Cause) -> Array:
        """Correct one possible error, and predict each half of the time by a fit of the other half,
        %.

        Returns the relative torque error of each joint, shape (n,); inf if the regressor cannot be
        evaluated.
        """
        rows = self.rows(cause)
        if rows is None:
            return np.full(self.samples.n, np.inf)
        D, Y, mask = rows
        second = (np.arange(len(Y)) >= len(Y) // 2)[:, None]
        parts = [Grams.of(D, Y, mask & half, self.tau) for half in (~second, second)]
        squares = [
            fit_of(self.standard(other), self.fit(part).X, self.N / 2).errors ** 2
            for part, other in (parts, parts[::-1])
        ]
        return np.asarray(np.sqrt(np.mean(squares, axis=0)))

    def beyond(self, V: Array) -> float:
        """Compute the largest share, of m given sets of torques, that no parameter values can
        explain.

        For each of the m sets of torques, the share is the norm of the part outside the span of W,
        divided by the norm of the set.

        V : m sets of torques on the side of the files, shape (K, n, m).
        """
        rows = (V / self.free.sigma[:, None]).reshape(-1, V.shape[2])
        size = np.linalg.norm(rows, axis=0)
        left = np.linalg.norm(rows - self.basis @ (self.basis.T @ rows), axis=0)
        return float((left / np.where(size > 0, size, 1.0)).max(initial=0.0))

    def hides(self, cause: Cause) -> bool:
        """Whether the record fits equally well with and without correcting one possible error.

        If the fits are equal, the rows of the cause are in the span of W, and a physical robot
        explains both equally well. The columns are tested in random combinations, together with the
        change of the known torques.
        """
        rows = self.rows(cause)
        if rows is None:
            return False
        D, Y, _ = rows
        scale = np.sqrt((D**2).sum(axis=(0, 1)))
        mixed = np.random.default_rng(0).standard_normal((D.shape[2], 3))
        V = (D / np.where(scale > 0, scale, 1.0)) @ mixed
        known = Y - self.tau + self.samples.tau_known @ self.F.T
        known[np.abs(known) < 1e3 * LIMIT.COLUMN_ROUNDING * np.abs(self.tau).max()] = 0.0
        if self.beyond(np.concatenate([V, known[:, :, None]], axis=2)) > LIMIT.WITHIN_SPAN:
            return False
        torque = cause.torque(self.samples)  # bodies as large as the torques
        bodies = bodies_of(self.physical, self.size, torque, self.bodies.near_values)
        other = replace(self, bodies=bodies).trial(cause, sigma=self.given.sigma)
        return bool(abs(other.gain) < LIMIT.SAME_SCORE)

    @cached_property
    def normal(self) -> tuple[Array, Array, Array, Array]:
        """Four arrays of the linearised least-squares problem, in which an error of size xi is
        fitted.

        The arrays are W for the standard parameters, shape (K, n, p), the torques that W explains,
        shape (K, n), the residuals e divided by sigma, shape (K, n), and the matrix A + B.
        """
        D, Y, mask = self.as_given
        W = D @ self.physical.K
        explained = W @ self.given.X
        e = (Y - explained) / self.given.sigma * mask
        A, _ = Grams.of(W, Y, mask).weighted(self.given.sigma)
        return W, explained, e, A + self.bodies.stiffness(self.given.X)

    def effect(self, change: Callable[[float], Cause]) -> Array:
        """Compute the derivative of the torques with respect to the size xi of an error, shape (K,
        n).

        The size is for instance a factor or a zero position; J = d tau/d xi is a finite difference.

        change : makes the cause for a value of xi.
        """
        explained = self.normal[1]
        cause = change(LIMIT.DIFFERENCE_STEP)
        rows = self.rows(cause)
        if rows is None:  # a loop that does not close
            return np.zeros_like(explained)
        D, Y, _ = rows
        chi = self.given.X if cause.constants else self.physical.K @ self.given.X
        moved = D @ chi + self.tau - Y
        plain = explained + self.tau - self.as_given[1]
        return np.asarray((moved - plain) / LIMIT.DIFFERENCE_STEP)

    def first_step(self, J: Array) -> tuple[Array, Array] | None:
        """Estimate the sizes of small errors from the residuals, by one linearised least-squares
        step.

        The parameters of the model are free.

        J : effects of a numbers, shape (a, K, n).

        Return xi, shape (a,), and its covariance. Return None if the samples determine none of the
        numbers in addition to the parameters.
        """
        W, _, e, H = self.normal
        mask = self.as_given[2]
        weight = mask / self.given.sigma
        WJ = np.einsum("kjp,akj->pa", W * weight[:, :, None], J * weight)
        J = J * weight
        size = np.einsum("akj,bkj->ab", J, J)
        left = size - WJ.T @ np.column_stack([solve_scaled(H, column) for column in WJ.T])
        share = max(self.N / max(float(mask.sum(axis=0).mean()), 1.0), LIMIT.LEAST_SHARE)
        eigenvalues, V = np.linalg.eigh(left)
        least = max(0.1 / share, LIMIT.NEARLY_HIDDEN**2 * float(np.diag(size).max()))
        if not eigenvalues[-1] > least:
            return None
        variances = 1 / eigenvalues.clip(1e-9 * eigenvalues[-1])
        step = (V * variances * (eigenvalues > least)) @ V.T @ np.einsum("akj,kj->a", J, e)
        return step, (V * variances) @ V.T / share


def baseline_of(
    model: GeneratedModel,
    samples: Samples,
    D: Array,
    variants: GeneratedModel | None = None,
    *,
    torque_side: str = "joint",
    values: bool = True,
) -> Baseline:
    """Make the reference fit of the samples, by free parameters and by a physical robot.

    D : regressor at the samples, shape (K, n, b).
    torque_side : side of the torques in the files, motor or joint.
    values : whether the fit stays near the values of the robot file.
    """
    physical, drives = physical_model(model), drives_of(model)
    F = np.eye(samples.n)
    if drives is not None and torque_side == "motor":
        F = np.linalg.inv(drives.ratio.T)
    size = reach(model, samples.q)
    size = size if size < LIMIT.FARTHEST_REACH else 1.0
    bodies = bodies_of(physical, size, samples.tau - samples.tau_known, values)
    none = Fit(np.zeros(0), np.ones(samples.n), np.zeros(samples.n), 0.0)
    baseline = Baseline(model, variants, physical, samples, D, size, bodies, 1.0, none, none, F)
    grams = Grams.of(*baseline.as_given, baseline.tau)
    N = counting_rows(*baseline.as_given, least_squares(grams, 1.0).X)
    free = least_squares(grams, N)
    given = physical_fit(grams.mapped(physical.K), bodies, N, free.sigma)
    return replace(baseline, N=N, free=free, given=given)


def regressor(model: GeneratedModel, states: tuple[Array, Array, Array], **constants: Any) -> Array:
    """Evaluate the regressor D at given states q, qd, qdd, shape (K, n, b).

    Columns that contain only rounding errors, such as those of cos(pi/2), are set to zero.

    Raises
    ------
    ValueError
        A loop does not close, or D is not finite.
    """
    with np.errstate(all="ignore"):
        D = np.asarray(model.regressor(*states, out=None, **constants))
    size = np.abs(D).max(axis=(0, 1), initial=0.0)
    if not np.isfinite(size).all():
        raise ValueError("the regressor is not finite")
    D[:, :, size < LIMIT.COLUMN_ROUNDING * size.max(initial=0.0)] = 0.0
    return D


def bodies_of(physical: PhysicalModel, size: float, Y: Array, values: bool) -> Bodies:
    """Make the physical conditions on the links of a robot of length `size`, m, with the torques Y.

    The usual mass of a link follows from the largest torque.
    """
    torque = float(np.sqrt((Y**2).mean(axis=0)).max()) or 1.0
    mass = max(torque / (9.81 * size), 1e-3)
    return Bodies(physical, mass, 0.3 * size, 0.01 * torque, values=values)


def counting_rows(D: Array, Y: Array, mask: Array, X: Array) -> float:
    """Estimate the number of independent samples of a joint, on average over the joints that move.

    The number is smaller than that of the rows, because neighbouring residuals are correlated.
    """
    counts = []
    for j in range(Y.shape[1]):
        e = (Y[:, j] - D[:, j] @ X)[mask[:, j]]
        if len(e) > 2 and float(e @ e) > 0:
            rho = float(np.clip((e[1:] @ e[:-1]) / (e @ e), 0.0, 0.95))
            counts.append(len(e) * (1 - rho) / (1 + rho))
    return float(np.mean(counts)) if counts else 1.0


def reach(model: GeneratedModel, q: Array) -> float:
    """Compute the length of the robot, m: the largest distance of a frame from the first frame.

    q : positions, shape (K, n), in which the distance is computed.

    The length is at least 0.1, and 1 if it is unknown.
    """
    P = frame_origins(model, q[:: max(1, len(q) // 32)])
    if P is None:
        return 1.0
    distance = np.linalg.norm(P - P[:, :1], axis=-1)
    return float(np.clip(np.nanmax(distance), 0.1, 1e6)) if np.isfinite(distance).any() else 1.0


def try_causes(
    baseline: Baseline,
    sides: Sequence[str] = ("joint", "joint"),
    column_units: Mapping[str, tuple[str, ...]] | None = None,
) -> list[Trial]:
    """Try every possible error of the study (cause), and return the fits, the best first.

    Some kinds of causes are improbable, so that their gain is lowered (by RATE_GAIN in
    limits.toml).
    """
    model, variants, samples = baseline.model, baseline.variants, baseline.samples
    robot = Robot(model, variants, sides, samples, slow_friction(baseline), column_units)
    trials = [*_of_causes(baseline, causes(robot)), *_of_numbers(baseline, robot)]
    priced = [
        replace(trial, gain=trial.gain - LIMIT.RATE_GAIN) if trial.cause.kind in DEAR else trial
        for trial in trials
    ]
    return sorted(priced, key=lambda trial: -trial.gain)


def _of_causes(baseline: Baseline, which: Sequence[Cause]) -> list[Trial]:
    """Try the possible errors that have no unknown number, for instance a wrong sign.

    Errors whose correction cannot win are not fitted under the conditions of a physical robot.
    """
    given, least = baseline.given, baseline.samples.moving().sum(axis=0) // 2
    trials: list[Trial] = []
    bounds: list[tuple[Fit, Cause, Grams]] = []
    unchanged_bound = baseline.bound(Grams.of(*baseline.as_given, baseline.tau)).score
    for cause in which:
        grams = baseline.grams(cause)
        if grams is None or (grams.rows < least).any():
            continue
        bound = baseline.bound(grams)
        if abs(bound.score - unchanged_bound) < LIMIT.SAME_SCORE and baseline.hides(cause):
            trials.append(Trial(cause, None, -np.inf, equivalent=True))
        else:
            bounds.append((bound, cause, grams))
    bounds.sort(key=lambda item: item[0].score)
    quick: list[tuple[Fit, Cause]] = []
    best = given.score - LIMIT.DECISIVE
    for bound, cause, grams in bounds:
        promising = bound.score < best + LIMIT.GAIN_ALIKE * (given.score - best)
        if not promising or len(quick) == LIMIT.ALTERNATIVES_FITTED:
            break
        fit = baseline.fit(grams, quick_fit, bound.sigma)
        best = min(best, fit.score)
        quick.append((fit, cause))
    quick.sort(key=lambda item: item[0].score)
    refined = quick[: LIMIT.ALTERNATIVES_REFINED]
    trials += [baseline.trial(cause, fit.sigma) for fit, cause in refined]
    chosen = {id(cause) for _, cause in refined}
    trials += [Trial(cause, None, -np.inf) for _, cause, _ in bounds if id(cause) not in chosen]
    return trials


def _of_numbers(baseline: Baseline, robot: Robot) -> list[Trial]:
    """Try the possible errors that have an unknown number, such as a factor, at its best value.

    Only errors whose first step gains enough are searched. Errors that no fit can distinguish from
    the study are returned, too.
    """
    trials: list[Trial] = []
    steps: list[tuple[float, float, Row, Change]] = []
    for row in NUMBERS:
        for item in row.of(robot):
            change: Change = partial(row.cause, robot, item)
            J = baseline.effect(change)
            flat = np.linalg.norm(J) < LIMIT.DIFFERENCE_STEP**2 * np.linalg.norm(baseline.tau)
            if flat or baseline.beyond(J[:, :, None]) < LIMIT.NEARLY_HIDDEN:
                small = change(LIMIT.SMALLEST_CHANGE[row.kind])
                # a model may have the column of a constant torque
                if row.kind != "offset" and baseline.hides(small):
                    trials.append(Trial(small, None, -np.inf, equivalent=True))
                continue
            step = baseline.first_step(J[None])
            if step is None:
                continue
            xi, variance = float(step[0][0]), float(step[1][0, 0])
            gain = 0.5 * xi**2 / variance
            if gain >= LIMIT.WORTH_SEARCHING * LIMIT.DECISIVE:
                steps.append((gain, xi, row, change))
    steps.sort(key=lambda item: -item[0])
    for _, xi, row, number in steps[: LIMIT.NUMBERS_SEARCHED]:
        trial = _search_number(baseline, row, number, xi)
        if trial is not None:
            trials.append(trial)
    return trials


def _search_number(baseline: Baseline, row: Row, change: Change, first: float) -> Trial | None:
    """Search for the size xi of one possible error, such as a torque factor, that fits the record best.

    Return None if no size improves the fit enough. A few sizes are tried with the joint weights of
    the study, then a bounded search uses the weights of each trial. Each unknown number of the
    error reduces the gain by log(N)/2 for N independent samples.
    """
    scores: dict[float, float] = {}
    sigma = baseline.given.sigma

    def score(xi: float, sigma: Array | None = None) -> float:
        grams = baseline.grams(change(xi))
        if grams is None:
            return np.inf
        scores[xi] = baseline.fit(grams, quick_fit, sigma).score
        return scores[xi]

    near = far = float(np.clip(first, -row.span, row.span))
    for xi in (near * 0.25, near * 0.5):
        score(xi, sigma)
    while score(far, sigma) <= min(scores.values(), default=-np.inf) and abs(far) < row.span:
        far = float(np.clip(1.6 * far, -row.span, row.span))
    enough = baseline.given.score - LIMIT.WORTH_SEARCHING * LIMIT.DECISIVE
    if min(scores.values(), default=np.inf) > enough:
        return None
    best = min(scores, key=scores.__getitem__)
    bounds = np.clip(best + 0.5 * abs(best) * np.array([-1, 1]), -row.span, row.span)
    scores.clear()
    minimize_scalar(
        score, bounds=bounds, method="bounded", options={"maxiter": 9, "xatol": 0.02 * abs(best)}
    )
    xi = min(scores, key=scores.__getitem__, default=best)
    if abs(xi) < LIMIT.SMALLEST_CHANGE[row.kind]:
        return None
    trial = baseline.trial(change(xi))
    parameters = max(int(np.count_nonzero(trial.cause.unmodelled)), 1)
    return replace(trial, gain=trial.gain - 0.5 * parameters * float(np.log(baseline.N)))


def slow_friction(baseline: Baseline) -> Array | None:
    """Estimate for each joint the friction at low speed that the model lacks, N m or N.

    The friction is zero for joints in which it is uncertain; the result is None if it is uncertain
    in all joints.
    """
    samples = baseline.samples
    size = np.sqrt((samples.tau**2).mean(axis=0))
    effect = size * unmodelled_torques(samples)[:, :, 1]
    step = baseline.first_step(np.einsum("kj,ij->jki", effect, baseline.F))
    if step is None:
        return None
    xi, covariance = step
    certain = np.abs(xi) >= LIMIT.CERTAIN_FRICTION * np.sqrt(np.diag(covariance))
    return size * xi * certain if certain.any() else None


def decisive(
    trials: Sequence[Trial],
    baseline: Baseline,
    floor: float,
    other: Baseline | None = None,
    alone: Baseline | None = None,
) -> list[Trial]:
    """Select the corrections that explain the record decisively better than the study as given.

    A selected correction must also improve the prediction of rows that were not fitted, and lower
    the error of a joint in a half of the record that was not fitted, unless it only brings the
    bodies nearer to the values. The best trial is first; trials with a similar gain follow.

    floor : error of a joint, %, that noise of the positions alone may cause. A smaller error is no
        evidence for a cause. The distance from the robot file's values is no evidence either, if
        the floor is high (above NOISY in limits.toml) or if the error of a joint grows
        considerably.
    other : baseline of the validation records, which a cause must explain better, too.
    alone : baseline without the values of the robot file. A cause must reduce an error there, too,
        if its bodies differ from those of the file, for instance because a unit makes torques
        small.
    """
    given, better, closer = baseline.given, [], set()
    for trial in trials:
        if trial.fit is not None and trial.gain >= LIMIT.DECISIVE:
            slower = trial.cause.kind == "rate"  # small accelerations undo what noise makes
            noise = floor if slower else min(floor, LIMIT.NOISE_MADE_MOST)
            visible = bool((takes_away(given, trial.fit) & (given.errors > noise)).any())
            nearer = (
                given.penalty - trial.fit.penalty > LIMIT.DECISIVE
                and floor < LIMIT.NOISY
                and not takes_away(trial.fit, given).any()
            )
            if alone is not None and leaves_values(trial.fit, baseline):
                fit = alone.trial(trial.cause).fit
                visible &= fit is not None and bool(takes_away(alone.given, fit).any())
                nearer = False
            lost = trial.fit.errors - given.errors > LIMIT.LOST
            if (visible or nearer) and not lost.any():
                better.append(trial)
                closer |= {id(trial)} if nearer else set()
    if not better:
        return []
    least = (1 - LIMIT.GAIN_ALIKE) * better[0].gain
    alike = [trial for trial in better if trial.gain >= least]
    before = baseline.unseen(unchanged_study(baseline.samples.n))
    named = [
        trial
        for trial in alike[: LIMIT.ALTERNATIVES_NAMED]
        if before - baseline.unseen(trial.cause) > np.log(len(trials))
        and (other is None or helps(trial, baseline, other))
        and (id(trial) in closer or falls(baseline, trial, alone))
    ]
    if named:  # of those that gain the same, a sign changes least
        same = LIMIT.GAIN_SAME * named[0].gain
        named.sort(key=lambda trial: trial.gain < same or trial.cause.kind != "sign")
    if not named or named[0].fit is None or (given.errors - named[0].fit.errors > 0.2).any():
        return named
    least = (1 - LIMIT.GAIN_ALIKE) * named[0].gain
    named += [trial for trial in loads(baseline) if trial.gain > least]
    return sorted(named, key=lambda trial: -trial.gain)


def takes_away(given: Fit, fit: Fit) -> Array:
    """Whether the torque error of each joint is clearly smaller in `fit` than in `given`, bool
    (n,).
    """
    return clearly_smaller(given.errors, fit.errors)


def clearly_smaller(before: Array, after: Array) -> Array:
    """Whether the error of each joint is clearly smaller after a correction, bool (n,); errors in %."""
    return np.asarray((before / after.clip(0.1) > LIMIT.VISIBLE) & (before - after > 0.2))


def falls(baseline: Baseline, trial: Trial, alone: Baseline | None) -> bool:
    """Whether a correction clearly lowers the error of a joint in a half of the record that was not
    fitted.

    If the bodies differ from those of the file, the fits without the values of the file (`alone`)
    must show this.
    """
    assert trial.fit is not None
    judge = alone if alone is not None and leaves_values(trial.fit, baseline) else baseline
    causes = (unchanged_study(judge.samples.n), trial.cause)
    before, after = (judge.held_out(cause) for cause in causes)
    return bool(clearly_smaller(before, after).any())


def leaves_values(fit: Fit, baseline: Baseline) -> bool:
    """Whether the fitted links need far larger or smaller torques than links with the file's
    values.

    The ratio of the torques is then outside CAD_RATIOS (limits.toml). The answer is False if the
    file does not give every body.
    """
    bodies, physical = baseline.bodies, baseline.physical
    if not bodies.near_values or not bodies.known_links.all():
        return False
    numbers = [k for link in bodies.links for k in link.numbers]
    W = baseline.normal[0][:, :, numbers]
    values = np.array([physical.values[physical.standard[k]] for k in numbers])
    ratio = float(np.linalg.norm(W @ fit.X[numbers]) / np.linalg.norm(W @ values))
    return bool(not LIMIT.CAD_RATIOS[0] <= ratio <= LIMIT.CAD_RATIOS[1])


def helps(trial: Trial, baseline: Baseline, other: Baseline) -> bool:
    """Whether a correction improves the prediction of the validation records by the fitted model.

    A validation record may or may not have the same error: the better result counts.

    other : baseline of the validation records.
    """

    def misfit(cause: Cause, X: Array) -> float:
        if (rows := other.rows(cause)) is None:
            return np.inf
        return fit_of(other.standard(Grams.of(*rows, other.tau)), X, 1.0).score

    assert trial.fit is not None
    given = unchanged_study(other.samples.n)
    after = min(misfit(cause, trial.fit.X) for cause in (given, trial.cause))
    return bool(misfit(given, baseline.given.X) - after > np.log(LIMIT.VISIBLE) / 2)


def loads(baseline: Baseline) -> list[Trial]:
    """Fit the records with free inertial parameters of the last link, which may carry a load.

    Each of the ten parameters of this link costs (log N)/2. The list is empty if the file does not
    give these parameters.
    """
    if not baseline.bodies.known_links[-1:].any():
        return []
    link = baseline.physical.links[-1]
    load = unchanged_study(
        baseline.samples.n,
        kind="load",
        says=f"link {link} has other values than those of the robot file: a load?",
        remedy=f"declare the load of link {link} as `payload`, or correct its values in the robot file",
    )
    known = {f"{family}{link}" for family in INERTIAL}
    values = {name: x for name, x in baseline.physical.values.items() if name not in known}
    physical = replace(baseline.physical, values=values)
    torque = baseline.samples.tau - baseline.samples.tau_known
    freed = replace(baseline, bodies=bodies_of(physical, baseline.size, torque, values=True))
    trial = freed.trial(load)
    return [replace(trial, gain=trial.gain - 5 * float(np.log(baseline.N)))]
