"""One number that the study takes as known, fitted beside the model: a factor of the torque or the
position of a joint, its zero, a length, an angle, the size of a spring or counterbalance.

Around the fit chi of a physical robot, with A the weighted normal matrix, B the curvature of
barrier and values, J = d(W chi)/d xi the effect of
the number,

    [A + B   W'J] [d chi]   [ 0  ]
    [J'W     J'J] [d xi ] = [J'e ],      sigma_xi^2 = 1/(J'J - J'W (A + B)^-1 W'J),
            gain = xi^2/(2 sigma_xi^2) nats,

rows over their sigma. Only what this first step finds worth it is searched: fits of a physical
robot at values of the number, by golden section.

A spring or counterbalance of a joint is a q + b sin q + c cos q, of a slide a q + b with a > 0,
in the ratio of the best a, b, c of the same step.

A zero, a factor and a constant torque of a joint may be wrong always, since an instant, or more and
more: the effect of the number times a share w(t), so that J serves them all. Beside what is wrong
always, the share whose first step gains most is searched; it has to gain LIMIT.VARYING_GAIN more.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from runtime.checks.alternatives import (
    Alternative,
    Maker,
    coupled,
    neighbours,
    springs,
    times,
    unchanged,
)
from runtime.checks.fits import Grams, quick_fit, solved
from runtime.checks.gravity import gauss_newton_step
from runtime.checks.trials import Problem, Trial
from runtime.errors import instant
from runtime.limits import LIMIT
from runtime.model.generated import joint_labels, joint_units

Array = np.ndarray

ENTRY = re.compile(r"free_(alpha|[drb])(\d+)")
TERMS, FORCES = {"rad": [0, 1, 2], "m": [0, 3]}, {"rad": "N m", "m": "N"}  # by the unit of q
GUESSES = {
    2**0.5: "1.41: effective for peak values",
    3**0.5: "1.73: phase for line values",
    2.0: "2: half of a pair of motors",
    9.81: "9.81: kp m for N m",
}


@dataclass(frozen=True, eq=False)
class Quantity:
    """A number xi that is zero in the study as given.

    Attributes
    ----------
    kind : str
        factor, scale, zero, offset, rate, coupling, length, angle, spring.
    of : str
        What it is, in words.
    span : float
        Largest |xi| that is searched.
    fields : function
        xi to what it changes of an Alternative.
    plain : Alternative
        The study as it is.
    since : str
        When it is wrong, in words; "" for always.
    share : ndarray, shape (K,), or 1
        w at every sample.
    """

    kind: str
    of: str
    span: float
    fields: Callable[[float], dict[str, Any]]
    plain: Alternative
    since: str = ""
    share: Array | float = 1.0

    def change(self, xi: float) -> Alternative:
        """The study with this xi."""
        fields = self.fields(xi)
        if self.since:
            fields["cause"] += self.since
            fields["remedy"] = (
                f"look for what changes {self.of} within the record, or use a part of it "
                "(rows.window)"
            )
        return replace(self.plain, kind=self.kind, of=self.of, share=self.share, **fields)


@dataclass(frozen=True, eq=False)
class Step:
    """First step of one quantity: xi, its deviation, its gain in nats; whether its effect lies in
    the span of W.
    """

    xi: float
    sigma: float
    gain: float
    within: bool = False


def quantities(problem: Problem, sides: Sequence[str] = ("joint", "joint")) -> list[Quantity]:
    """Factors of torques and positions and springs of all joints, zeros of those that turn, the
    sampling rate, couplings of neighbours; lengths and angles of the table where it is free.
    sides : those of positions and torques in the files.
    """
    plain = unchanged(problem.samples.n)
    joints, units = list(joint_labels(problem.model)), joint_units(problem.model)
    number, make = np.arange(len(joints)), Maker(problem.model, sides)
    which: list[tuple[str, str, float, Callable[[float], dict[str, Any]]]] = [
        ("rate", "the sampling rate", 1.0, _rate),
        (
            "factor",
            "a common factor of all torques",
            2.6,
            partial(_factor, problem, number >= 0, ""),
        ),
    ]
    for j, joint in enumerate(joints):
        size = float(np.sqrt((problem.samples.tau[:, j] ** 2).mean()))
        offset = partial(_offset, joint, FORCES[units[j]], number == j, size)
        which += [
            ("scale", f"the scale of the position of joint {joint}", 1.2, partial(_scale, make, j)),
            ("offset", f"a constant torque of joint {joint}", 2.0, offset),
        ]
        if len(joints) > 1:
            fields = partial(_factor, problem, number == j, joint)
            which.append(("factor", f"a factor of the torque of joint {joint}", 2.6, fields))
        if units[j] == "rad":
            fields = partial(_zero, number == j, joint)
            which.append(("zero", f"the zero of joint {joint}", 1.2, fields))
        if (ratios := _ratios(problem, j, TERMS[units[j]])) is not None:
            of = f"a spring or counterbalance of joint {joint}"
            which.append(("spring", of, 2.0, partial(_spring, of, number == j, ratios)))
    for i, k in neighbours(units):
        of = f"the coupling of joints {joints[min(i, k)]} and {joints[max(i, k)]}"
        for columns in ("positions and torques", "torques"):
            which.append(("coupling", of, 1.2, partial(coupled, joints, i, k, columns)))
    for key, x in ({} if problem.variants is None else problem.variants.CONSTANTS).items():
        if (match := ENTRY.fullmatch(key)) and (x or match[1] == "alpha"):
            kind, span, entry = (
                ("angle", 1.2, _angle) if match[1] == "alpha" else ("length", 1.0, _length)
            )
            fields = partial(entry, key, match[1], match[2], x)
            which.append((kind, f"{match[1]} of frame {match[2]}", span, fields))
    return [Quantity(*one, plain) for one in which]


def _factor(problem: Problem, chosen: Array, joint: str, xi: float) -> dict[str, Any]:
    """exp(xi) = the torque that the joint would need, over that of the record."""
    factor = float(np.exp(xi))
    what = f"the torque of joint {joint} is" if joint else "all torques are"
    look = (
        f"ratio, torque constant and unit of joint {joint}"
        if joint
        else "unit, torque constants and side of the torques"
    )
    scale = np.diag(np.where(chosen, factor, 1.0))
    return {
        "cause": f"{what} to be multiplied by {factor:.3g}",
        "remedy": f"look at {look} ({_guess(factor)})",
        "T": np.linalg.inv(problem.F) @ scale @ problem.F,
    }


def _scale(make: Maker, j: int, xi: float) -> dict[str, Any]:
    joint, factor = make.joints[j], float(np.exp(xi))
    return {
        "cause": f"the position of joint {joint} is to be multiplied by {factor:.3g}",
        "remedy": f"look at the counts per turn of the encoder of joint {joint}, at its ratio "
        "(drives.ratio) and at its unit (record.units.q)",
        **make.positions(np.diag(np.where(np.arange(make.n) == j, factor, 1.0))),
    }


def _zero(chosen: Array, joint: str, xi: float) -> dict[str, Any]:
    return {
        "cause": f"the zero of joint {joint} is off by {np.degrees(xi):.3g} degrees",
        "remedy": f"look at theta of the frame of joint {joint}, at drives.offset and at the "
        "calibration of its encoder",
        "p": np.where(chosen, xi, 0.0),
    }


def _rate(xi: float) -> dict[str, Any]:
    factor = float(np.exp(xi))
    return {
        "cause": f"the sampling rate is {times(factor)} the stated one",
        "remedy": "correct record.rate, or the unit of the time column (record.units.t)",
        "rate": factor,
    }


def _spring(of: str, chosen: Array, ratios: Array, xi: float) -> dict[str, Any]:
    return {
        "cause": f"{of} is missing, a torque that depends on its position",
        "remedy": f"give {of} as a known torque (record.columns.tau_known), or in the robot file "
        "(an element of kind stiffness, or a column of your own)",
        "spring": xi * np.where(chosen[:, None], ratios, 0.0),
    }


def _offset(joint: str, unit: str, chosen: Array, size: float, xi: float) -> dict[str, Any]:
    return {
        "cause": f"the torque of joint {joint} is off by {xi * size:.3g} {unit}",
        "remedy": f"look at the zero of the torque of joint {joint}, or give it as a known torque "
        "(record.columns.tau_known)",
        "spring": xi * np.outer(chosen, (0.0, 0.0, 0.0, size)),
    }


def _ratios(problem: Problem, j: int, terms: list[int]) -> Array | None:
    """Factors of these terms of `springs` for a joint beside the model, shape (4,), first order;
    None where the samples do not tell them from it.
    """
    D, now, mask = _rows(problem, unchanged(problem.samples.n))
    size = float(np.sqrt((problem.samples.tau[:, j] ** 2).mean()))  # the factors in this unit
    J = size * np.einsum("ka,i->aki", springs(problem.samples.q)[:, j, terms], problem.F[:, j])
    found = gauss_newton_step(
        problem, D, J, problem.given, problem.tau - now + D @ problem.given.X, mask
    )
    if found is None or (3 in terms and found[0][0] < 0):  # a slide has no counterbalance
        return None
    return size * found[0] @ np.eye(4)[terms]


def _angle(key: str, name: str, frame: str, value: float, xi: float) -> dict[str, Any]:
    return {
        "cause": f"{name} of frame {frame} is off by {np.degrees(xi):.3g} degrees",
        "remedy": f"look at {name} of frame {frame}: {value + xi:.3f} rad fits",
        "constants": {key: value + xi},
    }


def _length(key: str, name: str, frame: str, value: float, xi: float) -> dict[str, Any]:
    length = value * float(np.exp(xi))
    return {
        "cause": f"{name} of frame {frame} is {length:.4g} m rather than {value:.4g} m",
        "remedy": f"measure {name} of frame {frame}: {length:.4g} m fits",
        "constants": {key: length},
    }


def _guess(factor: float) -> str:
    """What a factor on a torque may be."""
    return next(
        (
            text
            for value, text in GUESSES.items()
            if abs(abs(np.log(factor)) - np.log(value)) < 0.05
        ),
        "they are right when this factor is 1",
    )


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
    D, now, mask = _rows(problem, unchanged(problem.samples.n))
    e = ((problem.tau - now) / sigma * mask).ravel()
    A, _ = Grams.of(D, problem.tau, mask).weighted(sigma)
    _, B = problem.barrier.derivatives(chi, LIMIT.BARRIER[-1])
    number = max(float(mask.sum(axis=0).mean()), 1.0)
    share = max(problem.N / number, LIMIT.LEAST_SHARE)
    DT = (D / sigma[:, None]).reshape(-1, D.shape[2]).T
    varied, steps = shares(problem), []
    for quantity in which:
        J = (
            _rows(problem, quantity.change(LIMIT.DIFFERENCE_STEP))[1] - now
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


def _rows(problem: Problem, alternative: Alternative) -> tuple[Array, Array, Array]:
    """Rows over the standard parameters, shape (K, n, p), torques that those of the study explain,
    and the rows used.
    """
    rows = problem.rows(alternative)
    if rows is None:  # a loop that does not close
        return _rows(problem, unchanged(problem.samples.n))
    D, Y, mask = rows
    D = D @ problem.physical.K if alternative.on_data else D
    return D, D @ problem.given.X + problem.tau - Y, mask


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
    more = 3 if quantity.kind == "spring" else 1  # parameters
    return replace(trial, gain=trial.gain - 0.5 * more * float(np.log(problem.N)))
