"""The alternatives of a study, tried on its samples: which of them explains the record decisively better with as few parameters.

Every alternative gets weighted least squares, which bounds from below what a physical robot of it can reach; only those whose bound beats the
best so far are fitted under the conditions of a physical robot, near the values of the robot file where there are any.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.identification.plausibility.alternatives import Alternative, alternatives
from runtime.identification.plausibility.fits import Barrier, Fit, Grams, least_squares, physical_fit, quick_fit
from runtime.identification.plausibility.samples import Samples
from runtime.model.generated import GeneratedModel
from runtime.model.inertia import PhysicalModel, physical_model

Array = np.ndarray

DECISIVE = 20.0
"""Gain of an alternative, nats, from which it is named, ..."""
VISIBLE = 1.2
"""... where it divides the error of a joint by this at least, or the distance from the values of the robot file shrinks as much as DECISIVE."""
ALIKE = 0.4
"""Alternatives within this share of the best gain are named with it."""
NAMED = 6
"""Alternatives named at most."""
LOOKED_AT = 80
"""Alternatives fitted under the conditions of a physical robot, those of the best least squares."""
REFINED = 10
"""Alternatives fitted to the end."""
FARTHEST = 20.0
"""Reach, m, beyond which a robot file is not believed."""
SAME = 0.3
"""Scores within this, nats, are the same: no record tells these models apart."""


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
    """

    alternative: Alternative
    bound: float
    fit: Fit | None
    gain: float


@dataclass(frozen=True, eq=False)
class Problem:
    """What is fitted again and again.

    Attributes
    ----------
    model, variants : GeneratedModel
        The emitted module, and that of `symgen.variants` or None.
    physical : PhysicalModel
    samples : Samples
    barrier : Barrier
    N : float
        Rows of a joint that count.
    free, given : Fit
        The study as it is: least squares, and under the conditions of a physical robot.
    """

    model: GeneratedModel
    variants: GeneratedModel | None
    physical: PhysicalModel
    samples: Samples
    barrier: Barrier
    N: float
    free: Fit
    given: Fit

    def grams(self, alternative: Alternative) -> Grams | None:
        """Normal equations of an alternative, over the standard parameters where its table changes; None where it cannot be evaluated."""
        q, qd, qdd = alternative.states(self.samples)
        model = self.model if alternative.on_data else self.variants
        assert model is not None
        try:
            with np.errstate(all="ignore"):
                D = model.regressor(q, qd, qdd, out=None, **alternative.constants)
        except ValueError:  # a loop that does not close
            return None
        if not np.isfinite(D).all():
            return None
        return Grams.of(D, alternative.torque(self.samples), moving(qd))

    def standard(self, grams: Grams) -> Grams:
        """The same over the standard parameters."""
        return grams if grams.of_joints.shape[1] == len(self.physical.standard) + 1 else grams.mapped(self.physical.K)


def moving(qd: Array) -> Array:
    """Samples at which each joint moves, bool (K, n)."""
    from runtime.identification.plausibility.samples import STANDING

    return np.asarray(np.abs(qd) > np.maximum(STANDING * np.abs(qd).max(axis=0), 1e-12))


def problem_of(model: GeneratedModel, samples: Samples, variants: GeneratedModel | None = None, *, values: bool = True) -> Problem:
    """The study as it is, fitted."""
    physical = physical_model(model)
    D = model.regressor(samples.q, samples.qd, samples.qdd)
    mask, Y = samples.moving(), samples.tau - samples.known
    base = Grams.of(D, Y, mask)
    N = counting_rows(D, Y, mask, least_squares(base, 1.0).X)
    size = reach(model, samples.q)
    size = size if size < FARTHEST else 1.0
    torque = float(np.sqrt((Y**2).mean(axis=0)).max()) or 1.0
    barrier = Barrier(physical, max(torque / (9.81 * size), 1e-3), 0.3 * size, 0.01 * torque, values=values)
    free = least_squares(base, N)
    given = physical_fit(base.mapped(physical.K), barrier, N, free.sigma)
    return Problem(model, variants, physical, samples, barrier, N, free, given)


def counting_rows(D: Array, Y: Array, mask: Array, X: Array) -> float:
    """Rows of a joint that count: those of the moving joints on average, less by the correlation of neighbouring residuals."""
    counts = []
    for j in range(Y.shape[1]):
        e = (Y[:, j] - D[:, j] @ X)[mask[:, j]]
        if len(e) > 2 and float(e @ e) > 0:
            rho = float(np.clip((e[1:] @ e[:-1]) / (e @ e), 0.0, 0.95))
            counts.append(len(e) * (1 - rho) / (1 + rho))
    return float(np.mean(counts)) if counts else 1.0


def reach(model: GeneratedModel, q: Array) -> float:
    """Length of the robot, m: largest distance of a frame from the first one in the positions q, shape (K, n); at least 0.1, 1 where not known."""
    poses = getattr(model, "frame_poses", None)
    if poses is None:
        return 1.0
    try:
        with np.errstate(all="ignore"):
            P = np.asarray(poses(q[:: max(1, len(q) // 32)]))[:, :, :3, 3]
    except ValueError:
        return 1.0
    distance = np.linalg.norm(P - P[:, :1], axis=-1)
    return float(np.clip(np.nanmax(distance), 0.1, 1e6)) if np.isfinite(distance).any() else 1.0


def tried(
    problem: Problem,
    sides: Sequence[str] = ("joint", "joint"),
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Trial]:
    """All alternatives, the best first; those that cannot win are not fitted under the conditions of a physical robot."""
    every = alternatives(problem.model, problem.variants, sides)
    given, rows = problem.given, problem.samples.moving().sum(axis=0)
    bounds: list[tuple[float, float, Alternative, Grams, Array]] = []
    for k, alternative in enumerate(every):
        progress(k, len(every))
        grams = problem.grams(alternative)
        if grams is not None and (grams.rows >= rows // 2).all():
            volume = problem.N * float(np.linalg.slogdet(alternative.T)[1])
            free = least_squares(grams, problem.N)
            bounds.append((free.score - volume, volume, alternative, grams, free.sigma))
    bounds.sort(key=lambda item: item[0])
    quick: list[tuple[float, float, float, Alternative, Grams, Array]] = []
    best = given.score - DECISIVE
    for bound, volume, alternative, grams, sigma in bounds:
        if len(quick) < LOOKED_AT and bound < best + ALIKE * (given.score - best):
            standard = problem.standard(grams)
            score = quick_fit(standard, problem.barrier, problem.N, sigma).score - volume
            best = min(best, score)
            quick.append((score, bound, volume, alternative, standard, sigma))
    quick.sort(key=lambda item: item[0])
    trials = {id(a): Trial(a, bound, None, -np.inf) for bound, _, a, *_ in bounds}
    for _, bound, volume, alternative, standard, sigma in quick[:REFINED]:
        fit = physical_fit(standard, problem.barrier, problem.N, sigma)
        trials[id(alternative)] = Trial(alternative, bound, fit, given.score - fit.score + volume)
    return sorted(trials.values(), key=lambda trial: -trial.gain)


def decisive(trials: Sequence[Trial], given: Fit) -> list[Trial]:
    """Those that explain the record decisively better than the study as given: the best, and those like it."""
    better = [trial for trial in trials if trial.fit is not None and trial.gain >= DECISIVE and _visible(trial.fit, given)]
    return [trial for trial in better if trial.gain >= (1 - ALIKE) * better[0].gain][:NAMED]


def _visible(fit: Fit, given: Fit) -> bool:
    ratio = given.errors / np.maximum(fit.errors, 0.1)
    return bool(((ratio > VISIBLE) & (given.errors - fit.errors > 0.2)).any()) or given.penalty - fit.penalty > DECISIVE
