"""One number that the study takes as known (`runtime.plausible.quantities`), fitted beside the model.

Around the fit chi of a physical robot, with A the weighted normal matrix, B the curvature of
barrier and values, J = d(W chi)/d xi the effect of
the number,

    [A + B   W'J] [d chi]   [ 0  ]
    [J'W     J'J] [d xi ] = [J'e ],      sigma_xi^2 = 1/(J'J - J'W (A + B)^-1 W'J),
            gain = xi^2/(2 sigma_xi^2) nats,

rows over their sigma. Only what this first step finds worth it is searched: fits of a physical
robot at values of the number, by golden section.

A zero, a factor and a constant torque of a joint may be wrong always, since an instant, or more and
more: the effect of the number times a share w(t), so that J serves them all. Beside what is wrong
always, the share whose first step gains most is searched; it has to gain LIMIT.VARYING_GAIN more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from runtime.errors import instant
from runtime.limits import LIMIT
from runtime.plausible.alternatives import unchanged
from runtime.plausible.fits import Grams, quick_fit, solved
from runtime.plausible.quantities import Quantity, explained_rows, quantities
from runtime.plausible.trials import Problem, Trial

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Step:
    """First step of one quantity: xi, its deviation, its gain in nats; whether its effect lies in
    the span of W.
    """

    xi: float
    sigma: float
    gain: float
    within: bool = False


def shares(problem: Problem) -> list[tuple[str, Array | float]]:
    """When a number is wrong, in words, and w at every sample: always, since one of LIMIT.SPLITS
    instants, more and more; of several records always.
    """
    t = problem.samples.t
    varied: list[tuple[str, Array | float]] = [("", 1.0)]
    if np.ptp(problem.samples.record) == 0:
        text = ", growing to that from nothing at the beginning: a drift"
        varied.append((text, (t - t[0]) / (t[-1] - t[0])))
        for split in np.linspace(t[0], t[-1], LIMIT.SPLITS + 2)[1:-1]:
            varied.append((f" since {instant(round(float(split), 1))} s", 1.0 * (t >= split)))
    return varied


def first_steps(problem: Problem, which: list[Quantity]) -> list[tuple[Quantity, Step]]:
    """xi, sigma, gain of each quantity on its own, to first order; of those that may change with
    time, also at the share that gains most.
    """
    chi, sigma = problem.given.X, problem.given.sigma
    D, now, mask = explained_rows(problem, unchanged(problem.samples.n))
    e = ((problem.tau - now) / sigma * mask).ravel()
    A, _ = Grams.of(D, problem.tau, mask).weighted(sigma)
    _, B = problem.barrier.derivatives(chi, LIMIT.BARRIER[-1])
    number = max(float(mask.sum(axis=0).mean()), 1.0)
    share = max(problem.N / number, LIMIT.LEAST_SHARE)
    DT = (D / sigma[:, None]).reshape(-1, D.shape[2]).T
    varied, steps = shares(problem), []
    for quantity in which:
        J = (
            explained_rows(problem, quantity.change(LIMIT.DIFFERENCE_STEP))[1] - now
        ) / LIMIT.DIFFERENCE_STEP
        within = (
            np.linalg.norm(J) < LIMIT.DIFFERENCE_STEP**2 * np.linalg.norm(now)
            or problem.beyond(J[:, :, None]) < LIMIT.NEARLY_HIDDEN
        )
        told = quantity.kind == "spring" and problem.barrier.near_values  # by the values alone
        found: list[tuple[Quantity, Step]] = []
        for since, w in varied if quantity.kind in LIMIT.VARYING else varied[:1]:
            one = replace(quantity, since=since, share=w)
            rows = (np.reshape(w, (-1, 1)) * J / sigma * mask).ravel()
            WJ = DT @ rows
            left = float(rows @ rows - WJ @ solved(A + B, WJ))
            hidden = within and not since
            if (hidden and not told) or left <= LIMIT.NEARLY_HIDDEN**2 * float(rows @ rows):
                found.append((one, Step(0.0, np.inf, 0.0, hidden)))
                continue
            xi = float(rows @ e) / left
            gain = 0.5 * share * xi**2 * left
            found.append((one, Step(xi, float((left * share) ** -0.5), gain, hidden)))
        steps += [found[0], *sorted(found[1:], key=lambda one: -one[1].gain)[:1]]
    return steps


def searched(problem: Problem, sides: Sequence[str] = ("joint", "joint")) -> list[Trial]:
    """The quantities whose first step is worth it, each at its best value."""
    steps = first_steps(problem, quantities(problem, sides))
    first = sorted(steps, key=lambda one: -one[1].gain)[: LIMIT.NUMBERS_SEARCHED]
    trials = [
        _best(problem, quantity, step)
        for quantity, step in first
        if step.gain >= LIMIT.WORTH_SEARCHING * LIMIT.DECISIVE
    ]
    small = [
        one.change(LIMIT.SMALLEST_CHANGE[one.kind])
        for one, step in steps
        if step.within and one.kind != "offset"  # a model may have its column
    ]
    hidden = [
        Trial(one, -np.inf, None, -np.inf, equivalent=True) for one in small if problem.hides(one)
    ]
    return [*(trial for trial in trials if trial is not None), *hidden]


def _best(problem: Problem, quantity: Quantity, step: Step) -> Trial | None:
    """The best value by a coarse grid, weights those of the study, then golden section, weights
    those of each value by itself: far from the best these may be worse than none.
    """
    scores: dict[float, float] = {}

    def score(xi: float, sigma: Array | None = None) -> float:
        grams = problem.grams(quantity.change(xi))
        if grams is None:
            return np.inf
        scores[xi] = problem.fit(grams, quick_fit, sigma).score
        return scores[xi]

    near = far = float(np.clip(step.xi, -quantity.span, quantity.span))
    for xi in (near * 0.25, near * 0.5):
        score(xi, problem.given.sigma)
    while (
        score(far, problem.given.sigma) <= min(scores.values(), default=-np.inf)
        and abs(far) < quantity.span
    ):
        far = float(np.clip(1.6 * far, -quantity.span, quantity.span))
    enough = problem.given.score - 0.5 * LIMIT.WORTH_SEARCHING * LIMIT.DECISIVE
    if min(scores.values(), default=np.inf) > enough:
        return None
    best = min(scores, key=scores.__getitem__)
    bounds = np.clip(best + 0.5 * abs(best) * np.array([-1, 1]), -quantity.span, quantity.span)
    scores.clear()
    minimize_scalar(score, bounds=bounds, method="bounded", options={"maxiter": 9})
    xi = min(scores, key=scores.__getitem__, default=best)
    if abs(xi) < LIMIT.SMALLEST_CHANGE[quantity.kind] * (0.5 if quantity.since else 1.0):
        return None
    grams = problem.grams(quantity.change(xi))
    assert grams is not None
    trial = problem.fitted(quantity.change(xi), grams)
    more = max(int(np.count_nonzero(trial.alternative.unmodelled)), 1)  # parameters
    return replace(trial, gain=trial.gain - 0.5 * more * float(np.log(problem.N)))
