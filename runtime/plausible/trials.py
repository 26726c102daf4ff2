"""The alternatives of a study, tried on its samples: which of them explains the record decisively
better with as few parameters.

Every alternative gets weighted least squares, which bounds from below what a physical robot of it
can reach; only those whose bound beats the
best so far are fitted under the conditions of a physical robot, near the values of the robot file
where there are any.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr

from runtime.estimators.physical import frame_origins
from runtime.limits import LIMIT
from runtime.model.generated import GeneratedModel, drives_of
from runtime.model.inertia import PhysicalModel, physical_model
from runtime.plausible.alternatives import Alternative, alternatives, unchanged
from runtime.plausible.fits import (
    Barrier,
    Fit,
    Grams,
    fit_of,
    least_squares,
    physical_fit,
    quick_fit,
)
from runtime.plausible.samples import Samples, moving

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Trial:
    """An alternative, fitted.

    Attributes
    ----------
    alternative : Alternative
    bound : float, nats
        Score of least squares.
    fit : Fit or None
        Under the conditions of a physical robot; None where the bound already loses.
    gain : float, nats
        Score of the study as given minus its own.
    equivalent : bool
        Whether no fit can tell it from the study as given.
    """

    alternative: Alternative
    bound: float
    fit: Fit | None
    gain: float
    equivalent: bool = False


@dataclass(frozen=True, eq=False)
class Problem:
    """What is fitted again and again.

    Attributes
    ----------
    model, variants : GeneratedModel
        The emitted module, and that of `symgen.variants` or None.
    physical : PhysicalModel
    samples : Samples
    size : float, m
        Of the robot.
    barrier : Barrier
    N : float
        Rows of a joint that count.
    free, given : Fit
        The study as it is: least squares, and under the conditions of a physical robot.
    F : ndarray, shape (n, n)
        Torques of the files from those of the joints.
    basis : ndarray, shape (K*n, rank)
        Orthonormal basis of the span of W, rows over the residual of their joint.
    """

    model: GeneratedModel
    variants: GeneratedModel | None
    physical: PhysicalModel
    samples: Samples
    size: float
    barrier: Barrier
    N: float
    free: Fit
    given: Fit
    F: Array
    basis: Array

    def regressor(self, alternative: Alternative) -> Array | None:
        """D of an alternative, shape (K, n, b), over the standard parameters where its table
        changes; None where it cannot be evaluated.
        """
        model = self.model if alternative.on_data else self.variants
        assert model is not None
        q, qd, qdd = alternative.states(self.samples)
        try:
            with np.errstate(all="ignore"):
                D = np.asarray(model.regressor(q, qd, qdd, out=None, **alternative.constants))
        except ValueError:  # a loop that does not close
            return None
        size = np.abs(D).max(axis=(0, 1), initial=0.0)
        D[:, :, size < LIMIT.COLUMN_ROUNDING * size.max(initial=0.0)] = 0.0
        return D if np.isfinite(size).all() else None

    def rows(self, alternative: Alternative) -> tuple[Array, Array, Array] | None:
        """F T^-1 W', F tau - F T^-1 known and the rows used, bool: T tau - known = W' X' in the
        torques of the files F tau.

        So every alternative explains the same numbers, and the residuals of coupled motors are not
        mixed.
        """
        D = self.regressor(alternative)
        if D is None:
            return None
        back = alternative.back(self.F)
        still = ~moving(alternative.states(self.samples)[1])
        still |= ~self.samples.steady @ (np.abs(alternative.P.T) > 1e-12)
        used = (np.abs(back) > 1e-12).reshape(-1, *self.F.shape).any(axis=0)
        known = np.einsum("...ij,...j->...i", back, alternative.subtracted(self.samples))
        return back @ D, self.tau - known, still @ used.T == 0

    @property
    def tau(self) -> Array:
        """Torques on the side of the files, shape (K, n)."""
        return np.asarray(self.samples.tau @ self.F.T)

    def grams(self, alternative: Alternative) -> Grams | None:
        """Normal equations of an alternative; None where it cannot be evaluated."""
        rows = self.rows(alternative)
        return None if rows is None else Grams.of(*rows, self.tau)

    def fit(
        self,
        grams: Grams,
        how: Callable[..., Fit] = physical_fit,
        sigma: Array | None = None,
        **options: int,
    ) -> Fit:
        """The parameters of a physical robot, over the standard parameters; weights begin at sigma,
        without it at those of least squares.
        """
        standard = grams.of_joints.shape[1] == len(self.physical.standard) + 1
        over = grams if standard else grams.mapped(self.physical.K)
        sigma = least_squares(grams, self.N).sigma if sigma is None else sigma
        return how(over, self.barrier, self.N, sigma, **options)

    def fitted(self, alternative: Alternative, grams: Grams, bound: float = -np.inf) -> Trial:
        """An alternative under the conditions of a physical robot. Rows count as much as they do
        for the residuals of the study, or for its own: what it explains makes those of the study
        alike.
        """
        fit, rows, N, nearer = self.fit(grams), self.rows(alternative), self.N, 0.0
        if rows is not None:
            D = rows[0] @ self.physical.K if alternative.on_data else rows[0]
            N = max(N, counting_rows(D, *rows[1:], fit.X))
            nearer = self.given.penalty - fit.penalty
        gain = (self.given.score - fit.score - nearer) * N / self.N + nearer
        return Trial(alternative, bound, fit, gain)

    def unseen(self, alternative: Alternative) -> float:
        """Score of an alternative in nats, each of two parts of the rows by the parameters of the
        other; parts are blocks of time by turns.
        """
        rows = self.rows(alternative)
        if rows is None:
            return np.inf
        D, Y, mask = rows
        turns = np.arange(len(Y)) * LIMIT.TURNS // len(Y) % 2
        parts = [Grams.of(D, Y, mask & (turns == k)[:, None], self.tau) for k in (0, 1)]
        score = 0.0
        for part, other in (parts, parts[::-1]):
            fit = self.fit(part)
            over = (
                other
                if len(fit.X) == len(other.of_joints[0]) - 1
                else other.mapped(self.physical.K)
            )
            score += fit_of(over, fit.X, self.N / 2, fit.penalty / 2).score
        return score

    def beyond(self, V: Array) -> float:
        """Largest part of the torques V, shape (K, n, m), on the side of the files, that no
        parameters of the study explain, relative.
        """
        rows = (V / self.free.sigma[:, None]).reshape(-1, V.shape[2])
        size = np.linalg.norm(rows, axis=0)
        left = np.linalg.norm(rows - self.basis @ (self.basis.T @ rows), axis=0)
        return float((left / np.where(size > 0, size, 1.0)).max(initial=0.0))

    def hides(self, alternative: Alternative) -> bool:
        """Whether no fit can tell an alternative from the study: its rows lie in the span of W, and
        physics asks the same of both.

        The columns are tested on random combinations of them, beside the difference of the known
        torques.
        """
        rows = self.rows(alternative)
        if rows is None:
            return False
        D, Y, _ = rows
        scale = np.sqrt((D**2).sum(axis=(0, 1)))
        V = (D / np.where(scale > 0, scale, 1.0)) @ np.random.default_rng(0).standard_normal(
            (D.shape[2], 3)
        )
        known = Y - self.tau + self.samples.tau_known @ self.F.T
        known[np.abs(known) < 1e3 * LIMIT.COLUMN_ROUNDING * np.abs(self.tau).max()] = 0.0
        if self.beyond(np.concatenate([V, known[:, :, None]], axis=2)) > LIMIT.WITHIN_SPAN:
            return False
        barrier = _barrier(
            self.physical, self.size, alternative.torque(self.samples), self.barrier.near_values
        )  # bodies as large as the torques
        other = replace(self, barrier=barrier).fitted(alternative, Grams.of(*rows, self.tau))
        return bool(abs(other.gain) < LIMIT.SAME_SCORE)


def problem_of(
    model: GeneratedModel,
    samples: Samples,
    variants: GeneratedModel | None = None,
    *,
    torque_side: str = "joint",
    values: bool = True,
) -> Problem:
    """The study as it is, fitted. torque_side : that of the files, motor or joint."""
    physical, drives = physical_model(model), drives_of(model)
    F = (
        np.linalg.inv(drives.ratio.T)
        if drives is not None and torque_side == "motor"
        else np.eye(samples.n)
    )
    size = reach(model, samples.q)
    size = size if size < LIMIT.FARTHEST_REACH else 1.0
    barrier = _barrier(physical, size, samples.tau - samples.tau_known, values)
    none = Fit(np.zeros(0), np.ones(samples.n), np.zeros(samples.n), 0.0)
    problem = Problem(
        model, variants, physical, samples, size, barrier, 1.0, none, none, F, np.zeros((0, 0))
    )
    rows = problem.rows(unchanged(samples.n))
    assert rows is not None
    base = Grams.of(*rows, problem.tau)
    N = counting_rows(*rows, least_squares(base, 1.0).X)
    free = least_squares(base, N)
    given = physical_fit(base.mapped(physical.K), barrier, N, free.sigma)
    weighted = (rows[0] / free.sigma[:, None]).reshape(-1, rows[0].shape[2])
    scale = np.linalg.norm(weighted, axis=0)
    Q, R, _ = qr(weighted / np.where(scale > 0, scale, 1.0), mode="economic", pivoting=True)
    return replace(problem, N=N, free=free, given=given, basis=Q[:, np.abs(np.diag(R)) > 1e-9])


def _barrier(physical: PhysicalModel, size: float, Y: Array, values: bool) -> Barrier:
    """Bodies of the size, m, that torques Y, shape (K, n), ask for."""
    torque = float(np.sqrt((Y**2).mean(axis=0)).max()) or 1.0
    return Barrier(
        physical, max(torque / (9.81 * size), 1e-3), 0.3 * size, 0.01 * torque, values=values
    )


def counting_rows(D: Array, Y: Array, mask: Array, X: Array) -> float:
    """Rows of a joint that count: those of the moving joints on average, less by the correlation of
    neighbouring residuals.
    """
    counts = []
    for j in range(Y.shape[1]):
        e = (Y[:, j] - D[:, j] @ X)[mask[:, j]]
        if len(e) > 2 and float(e @ e) > 0:
            rho = float(np.clip((e[1:] @ e[:-1]) / (e @ e), 0.0, 0.95))
            counts.append(len(e) * (1 - rho) / (1 + rho))
    return float(np.mean(counts)) if counts else 1.0


def reach(model: GeneratedModel, q: Array) -> float:
    """Length of the robot, m: largest distance of a frame from the first one in the positions q,
    shape (K, n); at least 0.1, 1 where not known.
    """
    P = frame_origins(model, q[:: max(1, len(q) // 32)])
    if P is None:
        return 1.0
    distance = np.linalg.norm(P - P[:, :1], axis=-1)
    return float(np.clip(np.nanmax(distance), 0.1, 1e6)) if np.isfinite(distance).any() else 1.0


def tried(problem: Problem, sides: Sequence[str] = ("joint", "joint")) -> list[Trial]:
    """All alternatives, the best first; those that cannot win are not fitted under the conditions
    of a physical robot.
    """
    given, rows = problem.given, problem.samples.moving().sum(axis=0)
    bounds: list[tuple[float, Alternative, Grams]] = []
    known = np.flatnonzero(problem.samples.tau_known.any(axis=0)).tolist()
    for alternative in alternatives(problem.model, problem.variants, sides, known):
        grams = problem.grams(alternative)
        if grams is not None and (grams.rows >= rows // 2).all():
            bounds.append((least_squares(grams, problem.N).score, alternative, grams))
    bounds.sort(key=lambda item: item[0])
    quick: list[tuple[float, float, Alternative, Grams]] = []
    best = given.score - LIMIT.DECISIVE
    for bound, alternative, grams in bounds:
        promising = bound < best + LIMIT.GAIN_ALIKE * (given.score - best)
        if len(quick) < LIMIT.ALTERNATIVES_FITTED and promising:
            score = problem.fit(grams, quick_fit).score
            best = min(best, score)
            quick.append((score, bound, alternative, grams))
    quick.sort(key=lambda item: item[0])
    trials = {}
    for bound, alternative, _ in bounds:
        alike = abs(bound - problem.free.score) < LIMIT.SAME_SCORE and problem.hides(alternative)
        trials[id(alternative)] = Trial(alternative, bound, None, -np.inf, alike)
    for _, bound, alternative, grams in quick[: LIMIT.ALTERNATIVES_REFINED]:
        if not trials[id(alternative)].equivalent:
            trials[id(alternative)] = problem.fitted(alternative, grams, bound)
    return sorted(trials.values(), key=lambda trial: -trial.gain)


def decisive(trials: Sequence[Trial], problem: Problem) -> list[Trial]:
    """Those that explain the record decisively better than the study as given, rows too that did
    not give their parameters: the best, and those like it.
    """
    given, better = problem.given, []
    for trial in trials:
        if trial.fit is not None and trial.gain >= LIMIT.DECISIVE:
            fewer, ratio = (
                given.errors - trial.fit.errors,
                given.errors / trial.fit.errors.clip(0.1),
            )
            visible = ((ratio > LIMIT.VISIBLE) & (fewer > 0.2)).any()
            if visible.any() or given.penalty - trial.fit.penalty > LIMIT.DECISIVE:
                better.append(trial)
    better = [trial for trial in better if explains_change(trial, problem)]
    if not better:
        return []
    simpler = {t.alternative.subject: t.gain for t in better if np.ndim(t.alternative.share)} | {
        t.alternative.subject.replace("constant torque", "spring or counterbalance"): t.gain
        for t in reversed(better)
        if t.alternative.kind == "offset"
    }
    alike = [
        trial
        for trial in better
        if trial.gain >= (1 - LIMIT.GAIN_ALIKE) * better[0].gain
        and trial.gain >= simpler.get(trial.alternative.subject, 0.0)
    ]
    before = problem.unseen(unchanged(problem.samples.n))
    named = [
        trial
        for trial in alike[: LIMIT.ALTERNATIVES_NAMED]
        if before - problem.unseen(trial.alternative) > np.log(len(trials))
    ]
    if not named or named[0].fit is None or (given.errors - named[0].fit.errors > 0.2).any():
        return named
    least = (1 - LIMIT.GAIN_ALIKE) * named[0].gain
    named += [load for load in loads(problem) if load.gain > least]
    return sorted(named, key=lambda trial: -trial.gain)


def explains_change(trial: Trial, problem: Problem) -> bool:
    """Whether what changes with time leaves 1/LIMIT.CHANGE of what the study leaves of a joint, and
    about as little of every joint as all parameters that change likewise do: a load that was put on
    is no factor of a torque.
    """
    share, rows = trial.alternative.share, problem.rows(unchanged(problem.samples.n))
    if np.ndim(share) == 0 or trial.fit is None or rows is None:
        return True
    (D, Y, mask), before, after = rows, problem.given.errors, trial.fit.errors
    if not ((before - after > LIMIT.LEAST_CHANGE) & (before > LIMIT.CHANGE * after)).any():
        return False
    both = np.concatenate([D, np.reshape(share, (-1, 1, 1)) * D], axis=2)
    least = least_squares(Grams.of(both, Y, mask, problem.tau), problem.N).errors
    return bool((after < LIMIT.CHANGE * least + LIMIT.LEAST_CHANGE).all())


def loads(problem: Problem) -> list[Trial]:
    """The study with other values of the last link than those of the robot file, as a load has
    them; its ten parameters cost half of log N each. None where the file does not give them.
    """
    plain, barrier = unchanged(problem.samples.n), problem.barrier
    grams = problem.grams(plain)
    if grams is None or not barrier.known_links[-1:].any():
        return []
    link, freed = problem.physical.links[-1], copy(barrier)
    freed.known_links = np.append(barrier.known_links[:-1], False)
    cause = f"link {link} has other values than those of the robot file: a load?"
    remedy = f"say what link {link} carries: payload, or values of the file that hold it"
    load = replace(plain, kind="load", cause=cause, remedy=remedy)
    trial = replace(problem, barrier=freed).fitted(load, grams)
    return [replace(trial, gain=trial.gain - 5 * float(np.log(problem.N)))]
