"""One number that the study takes as known, fitted beside the model: a factor of a joint, its zero, a length, an angle, the direction of gravity.

Around the fit chi of a physical robot, with A the weighted normal matrix, B the curvature of barrier and values, J = d(W chi)/d xi the effect of
the number,

    [A + B   W'J] [d chi]   [ 0  ]
    [J'W     J'J] [d xi ] = [J'e ],      sigma_xi^2 = 1/(J'J - J'W (A + B)^-1 W'J),   gain = xi^2/(2 sigma_xi^2) nats,

rows over their sigma. Only what this first step finds worth it is searched: fits of a physical robot at values of the number, by golden section.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from runtime.identification.plausibility.alternatives import Alternative, unchanged
from runtime.identification.plausibility.fits import MU, Grams, least_squares, quick_fit, solved
from runtime.identification.plausibility.trials import DECISIVE, Problem, Trial
from runtime.model.generated import joint_units

Array = np.ndarray

STEP = 1e-4
"""Finite difference, rad, m, or relative."""
WORTH = 0.4
"""Gain of the first step over DECISIVE from which a number is searched."""
SMALLEST = {"factor": 0.15, "length": 0.15, "zero": 0.17, "angle": 0.17}
"""What is told of a number, relative or rad: less is within what robots and records are."""
NEARLY = 1e-3
"""Part of the effect of a number outside the span of W, relative, from which a record may tell it; finite differences blur it."""
SEARCHED = 4
"""Numbers searched at most."""


@dataclass(frozen=True, eq=False)
class Quantity:
    """A number xi that is zero in the study as given.

    Attributes
    ----------
    kind : str
        factor, zero, length, angle.
    change : function
        xi to the Alternative.
    span : float
        Largest |xi| that is searched.
    """

    kind: str
    change: Callable[[float], Alternative]
    span: float


@dataclass(frozen=True, eq=False)
class Step:
    """First step of one quantity: xi, its deviation, its gain in nats; whether its effect lies in the span of W."""

    xi: float
    sigma: float
    gain: float
    within: bool = False


def quantities(problem: Problem) -> list[Quantity]:
    """Factors of all joints, zeros of those that turn; lengths and angles of the table where it is free."""
    return [*_factors(problem), *_zeros(problem), *(_entries(problem) if problem.variants is not None else ())]


def _factors(problem: Problem) -> Iterator[Quantity]:
    """exp(xi) = the torque that the joint would need, over that of the record; of all joints together."""
    plain, n, back = unchanged(problem.samples.n), problem.samples.n, np.linalg.inv(problem.F)

    def common(xi: float) -> Alternative:
        factor = float(np.exp(xi))
        cause = f"all torques are to be multiplied by {factor:.3g}"
        remedy = f"look at unit, torque constants and side of the torques ({_guess(factor)})"
        return replace(plain, cause=cause, remedy=remedy, kind="factor", T=factor * np.eye(n), of="a common factor of all torques")

    yield Quantity("factor", common, 2.6)
    for j, joint in enumerate(problem.model.JOINTS if n > 1 else ()):

        def change(xi: float, j: int = j, joint: int = joint) -> Alternative:
            factor = float(np.exp(xi))
            cause = f"the torque of joint {joint} is to be multiplied by {factor:.3g}"
            remedy = f"look at ratio, torque constant and unit of joint {joint} ({_guess(factor)})"
            T = back @ np.diag(np.where(np.arange(n) == j, factor, 1.0)) @ problem.F
            return replace(plain, cause=cause, remedy=remedy, kind="factor", T=T, of=f"a factor of the torque of joint {joint}")

        yield Quantity("factor", change, 2.6)


def _guess(factor: float) -> str:
    """What a factor on a torque may be."""
    for value, text in (
        (np.sqrt(2), "1.41: effective for peak values"),
        (np.sqrt(3), "1.73: phase for line values"),
        (2.0, "2: half of a pair of motors"),
        (9.81, "9.81: kp m for N m"),
    ):
        for one in (value, 1 / value):
            if abs(np.log(factor / one)) < 0.05:
                return text
    return "they are right when this factor is 1"


def _zeros(problem: Problem) -> Iterator[Quantity]:
    plain, n = unchanged(problem.samples.n), problem.samples.n
    for j, joint in enumerate(problem.model.JOINTS):
        if joint_units(problem.model)[j] != "rad":
            continue

        def change(xi: float, j: int = j, joint: int = joint) -> Alternative:
            cause = f"the zero of joint {joint} is off by {np.degrees(xi):.3g} degrees"
            remedy = f"look at theta of the frame of joint {joint}, at drives.offset and at the calibration of its encoder"
            return replace(
                plain, cause=cause, remedy=remedy, kind="zero", p=np.where(np.arange(n) == j, xi, 0.0), of=f"the zero of joint {joint}"
            )

        yield Quantity("zero", change, 1.2)


def _entries(problem: Problem) -> Iterator[Quantity]:
    """d, r, b relative to their size; alpha."""
    assert problem.variants is not None
    plain = unchanged(problem.samples.n)
    for key, value in problem.variants.CONSTANTS.items():
        name, frame = key[5:].rstrip("0123456789"), key.lstrip("abcdefghijklmnopqrstuvwxyz_")
        if not key.startswith("free_") or name not in ("d", "r", "b", "alpha"):
            continue
        if name == "alpha":

            def turned(xi: float, key: str = key, value: float = value, frame: str = frame) -> Alternative:
                cause = f"alpha of frame {frame} is off by {np.degrees(xi):.3g} degrees"
                remedy = f"look at alpha of frame {frame}: {value + xi:.3f} rad fits"
                return replace(plain, cause=cause, remedy=remedy, kind="angle", constants={key: value + xi}, of=f"alpha of frame {frame}")

            yield Quantity("angle", turned, 1.2)
        elif value:

            def longer(xi: float, key: str = key, value: float = value, frame: str = frame, name: str = name) -> Alternative:
                length = value * float(np.exp(xi))
                cause = f"{name} of frame {frame} is {length:.4g} m rather than {value:.4g} m"
                remedy = f"measure {name} of frame {frame}: {length:.4g} m fits"
                return replace(plain, cause=cause, remedy=remedy, kind="length", constants={key: length}, of=f"{name} of frame {frame}")

            yield Quantity("length", longer, 1.0)


def first_steps(problem: Problem, which: list[Quantity]) -> list[Step]:
    """xi, sigma, gain of each quantity on its own, to first order."""
    chi, sigma = problem.given.X, problem.given.sigma
    D, now, mask = _rows(problem, unchanged(problem.samples.n))
    e = (problem.tau - now) / sigma * mask
    A, _ = Grams.of(D, problem.tau, mask).weighted(sigma)
    _, B = problem.barrier.derivatives(chi, MU[-1])
    H = A + B
    share = problem.N / max(float(mask.sum(axis=0).mean()), 1.0)
    steps = []
    for quantity in which:
        J = (_rows(problem, quantity.change(STEP))[1] - now) / STEP
        within = np.linalg.norm(J) < STEP**2 * np.linalg.norm(now) or problem.beyond(J[:, :, None]) < NEARLY
        J = J / sigma * mask
        WJ = np.einsum("kjp,kj->p", D, J / sigma)
        left = float((J * J).sum() - WJ @ solved(H, WJ))
        if within or left <= 0:
            steps.append(Step(0.0, np.inf, 0.0, within))
            continue
        xi = float((J * e).sum()) / left
        steps.append(Step(xi, float((left * share) ** -0.5), 0.5 * share * xi**2 * left))
    return steps


def _rows(problem: Problem, alternative: Alternative) -> tuple[Array, Array, Array]:
    """Rows over the standard parameters, shape (K, n, p), torques that those of the study explain, and the rows used."""
    rows = problem.rows(alternative)
    if rows is None:  # a loop that does not close
        return _rows(problem, unchanged(problem.samples.n))
    D, Y, mask = rows
    D = D @ problem.physical.K if alternative.on_data else D
    return D, D @ problem.given.X + problem.tau - Y, mask


def searched(problem: Problem) -> list[Trial]:
    """The quantities whose first step is worth it, each at its best value."""
    which = quantities(problem)
    steps = first_steps(problem, which)
    order = sorted(range(len(which)), key=lambda k: -steps[k].gain)[:SEARCHED]
    trials = []
    for k in order:
        if steps[k].gain >= WORTH * DECISIVE:
            trials.append(_best(problem, which[k], steps[k]))
    small = [one.change(SMALLEST[one.kind]) for one, step in zip(which, steps, strict=True) if step.within]
    hidden = [Trial(one, -np.inf, None, -np.inf, equivalent=True) for one in small if problem.hides(one)]
    return [*(trial for trial in trials if trial is not None), *hidden]


def _best(problem: Problem, quantity: Quantity, step: Step) -> Trial | None:
    """The best value by a coarse grid and golden section."""
    scores: dict[float, float] = {}

    def score(xi: float) -> float:
        alternative = quantity.change(xi)
        grams = problem.grams(alternative)
        if grams is None:
            return np.inf
        fit = quick_fit(problem.standard(grams), problem.barrier, problem.N, least_squares(grams, problem.N).sigma)
        scores[xi] = fit.score
        return scores[xi]

    near = float(np.clip(step.xi, -quantity.span, quantity.span))
    for xi in sorted({near * 0.5, near, float(np.clip(1.6 * near, -quantity.span, quantity.span))}):
        score(xi)
    if not scores or min(scores.values()) > problem.given.score - 0.5 * WORTH * DECISIVE:
        return None
    best = min(scores, key=lambda xi: scores[xi])
    width = 0.5 * abs(best)
    bounds = max(best - width, -quantity.span), min(best + width, quantity.span)
    minimize_scalar(score, bounds=bounds, method="bounded", options={"maxiter": 7})
    xi = min(scores, key=lambda xi: scores[xi])
    if abs(xi) < SMALLEST[quantity.kind]:
        return None
    alternative = quantity.change(xi)
    grams = problem.grams(alternative)
    if grams is None:
        return None
    trial = problem.fitted(alternative, grams)
    return replace(trial, gain=trial.gain - 0.5 * float(np.log(problem.N)))  # one parameter more
