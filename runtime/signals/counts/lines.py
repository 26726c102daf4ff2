"""Lines of an encoder that are not evenly spaced: their size by evidence, their places estimated
with the motion.

A change of the count, from k to k + 1 between two samples, says that the motion crossed line k +
1/2 + delta_k there:

    x(t_e) = k + 1/2 + delta_k + n_e
        n_e of variance (qd Ts)^2/12, time alone; delta_k of variance e^2, the same at every
        crossing
    marginal of the changes, x integrated out
        log N = sum log w_e/2 - log|A|/2 + sum log(h/r_i)/2 - residual/2,   w_e = 1/((qd Ts)^2/12 +
        e^2)
    S delta = B' A^-1 g - B' ...                  S = diag(sum w) + 1/e^2 - B' A^-1 B,
                                            B of a class: sum of w_e b_e over its changes

e is the value of SIZES of largest evidence, the jerk density following each. Classes of lines are
those of period two and four (quadrature) and single
lines crossed at least CROSSINGS times, in both directions; e^2 of a class by expectation
maximisation. What is estimated is taken off the bounds, and
what is left widens them.

References: Harville (1977), random effects; Merry, van de Molengraft and Steinbuch (2010) for
encoders.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpbtrs
from scipy.sparse import csr_array, diags_array

from runtime.signals.counts.spline import Basis, Factor, next_density

Array = np.ndarray

SIZES = (0.25, 0.12, 0.06, 0.03, 0.01)
"""Deviations of lines that are compared, steps; the last counts as even."""
COMPARED, CLEAR = (0.1, 0.03, 0.01), 0.03
"""Deviations whose evidence is compared first, and the difference by change that tells."""
WEAK = 0.06
"""Precision of every count taken as a position, where no count changes: a hundredth of an
interval's, since neighbours say the same.
"""
PASSES = 2
FEWEST = 50
"""Changes below which lines count as even."""
POOR = 0.8
"""Share of the deviation that is left, from which lines count as not estimated."""
CROSSINGS, ENOUGH = 5, 20
"""Crossings from which a line is estimated by itself, and the number of such lines that tell how
much they differ.
"""
MOST = 1500
"""Lines of one encoder that are estimated one by one."""
COLUMNS_AT_ONCE = 64
"""Lines whose columns of A^-1 B are in memory at once."""


@dataclass(frozen=True, eq=False)
class Changes:
    """Changes of the count of one encoder: sample before, sample after, position of the line less
    its number's shift, number of the line, direction.
    """

    before: Array
    after: Array
    line: Array
    number: Array
    up: Array

    @classmethod
    def of(cls, y: Array, known: Array, near: int) -> Changes:
        """Changes by one count, of y, shape (N,), at most `near` missing samples apart."""
        at = np.flatnonzero(known)
        step = np.diff(y[at])
        e = np.flatnonzero((np.abs(step) == 1) & (np.diff(at) <= near + 1))
        line = (y[at[e]] + y[at[e + 1]]) / 2
        return cls(at[e], at[e + 1], line, np.floor(line).astype(int), step[e] > 0)


@dataclass(frozen=True, eq=False)
class LineErrors:
    """Of one encoder: deviation of the lines, steps; shift of the lines first, first + 1 ..., what
    is left of the deviation once shifted; a sentence.
    """

    deviation: float
    first: int
    shift: Array
    left: float
    finding: str = ""

    def of(self, number: Array) -> Array:
        """Shifts of lines by their number; 0 for lines never crossed."""
        place = number - self.first
        inside = (place >= 0) & (place < len(self.shift))
        return (
            np.where(inside, self.shift[np.clip(place, 0, max(len(self.shift) - 1, 0))], 0.0)
            if len(self.shift)
            else np.zeros(len(number))
        )


def evidence(
    basis: Basis,
    changes: Sequence[Changes],
    weak: tuple[Array, Array],
    speed: Array,
    r: Array,
    e: float,
    passes: int,
) -> tuple[Array, Array]:
    """Log evidence of the changes of every encoder with lines of deviation e, and the jerk density
    that goes with it, shape (n,) each.

    weak : precisions of single samples and these times the counts, shape (n, m M) each, which hold
    the spline where no count changes.
    speed : steps a sample, shape (n, m M).
    r : density where the passes of MacKay's rule start; from above they are few.
    """
    tau, nu = weak[0].copy(), weak[1].copy()
    fixed = -0.5 * np.divide(nu**2, tau, out=np.zeros_like(nu), where=tau > 0).sum(axis=1)
    for j, each in enumerate(changes):
        w, value = _weights(each, speed[j], e)
        np.add.at(tau[j], each.before, w)
        np.add.at(nu[j], each.before, w * value)
        fixed[j] += 0.5 * np.log(w).sum() - 0.5 * (w * value**2).sum()
    samples, g = (
        basis.of_samples(tau),
        basis.gradient(nu, np.ones((basis.n, basis.M)), np.zeros((basis.n, basis.P))),
    )
    unit = basis.of_prior(np.ones((basis.n, basis.M)))
    for _ in range(passes):
        r = next_density(basis, samples, unit, g, r)
    factor = Factor.of(samples + unit / r[:, None])
    fixed += 0.5 * basis.M * -np.log(r) + 0.5 * (g * factor.solve(g)).sum(axis=1)
    return fixed - 0.5 * factor.log_determinants, r


def _weights(changes: Changes, speed: Array, e: Array | float) -> tuple[Array, Array]:
    """w_e and the position at the sample before the change, of every change; speed, shape (m M,),
    steps a sample.
    """
    s = speed[changes.before]
    w = 1 / ((s * (changes.after - changes.before)) ** 2 / 12 + np.square(e))
    return w, changes.line + (changes.before - changes.after) / 2 * s


def line_errors(
    basis: Basis,
    y: Array,
    known: Array,
    rest: Array,
    c: Array,
    density: Array,
    Ts: float,
    *,
    estimate: bool,
) -> tuple[list[LineErrors], Array]:
    """Size of the errors of the lines of every encoder, their places where `estimate` asks for
    them, and the jerk density without these errors.

    y, known, rest, c, density : as in `runtime.signals.counts.sites`, c from the changes
    alone.
    """
    changes = [Changes.of(y[j], known[j], basis.m) for j in range(basis.n)]
    weak = np.where(known, WEAK, rest), WEAK * y
    speed = basis.at_samples(c, 1) * Ts

    def judged(sizes: Sequence[float]) -> dict[float, tuple[Array, Array]]:
        found, r = {}, density.mean(axis=1)
        for number, e in enumerate(sizes):
            found[e] = evidence(basis, changes, weak, speed, r, e, PASSES if number else 2 * PASSES)
            r = found[e][1]
        return found

    first = judged(COMPARED)
    best = np.max([first[e][0] for e in COMPARED[:-1]], axis=0)
    crossings = np.array([len(each.line) for each in changes])
    uneven = (best > first[SIZES[-1]][0] + CLEAR * crossings) & (crossings >= FEWEST)
    if not uneven.any():
        return [LineErrors(SIZES[-1], 0, np.zeros(0), SIZES[-1])] * basis.n, density
    all_sizes, errors, densities = judged(SIZES), [], density.copy()
    for j, each in enumerate(changes):
        deviation = (
            max(all_sizes, key=lambda e: float(all_sizes[e][0][j])) if uneven[j] else SIZES[-1]
        )
        if deviation > SIZES[-1]:
            densities[j] = all_sizes[deviation][1][j]
        if deviation == SIZES[-1] or not estimate:
            text = (
                f"lines are uneven by {deviation:g} steps (rms); bounds and stated deviations "
                "are widened, lines: estimated asks for their places"
            )
            errors.append(
                LineErrors(
                    deviation, 0, np.zeros(0), deviation, text if deviation > SIZES[-1] else ""
                )
            )
        else:
            alone = Basis(basis.N, 1, basis.m, Ts)
            rows = slice(j, j + 1)
            place, shift, left, period, single = _shifts(
                alone, each, (weak[0][rows], weak[1][rows]), speed[j], densities[rows], deviation
            )
            errors.append(
                LineErrors(deviation, place, shift, left, _text(deviation, left, period, single))
            )
    return errors, densities


def _text(deviation: float, left: float, period: float, single: int) -> str:
    """What became of lines of that deviation: left of it, of the pattern that repeats every four
    lines, and of single ones; steps, rms.
    """
    size = f"lines are uneven by {deviation:g} steps (rms)"
    if left > POOR * deviation:
        return (
            f"{size}; this motion does not tell their places, bounds and stated deviations are "
            f"widened by {left:.2g} steps: cross each line more often"
        )
    return (
        f"{size}, {period:.2g} of it repeat every four lines; {single} single lines estimated, "
        f"bounds widened by the {left:.2g} steps left"
    )


def _shifts(
    basis: Basis,
    changes: Changes,
    weak: tuple[Array, Array],
    speed: Array,
    density: Array,
    deviation: float,
) -> tuple[int, Array, float, float, int]:
    """Shifts of all lines from the first one crossed on, the deviation left, that of period four,
    and how many lines have a shift of their own.
    """
    first, last = int(changes.number.min()), int(changes.number.max())
    place = changes.number - first
    size = last - first + 1
    ups, downs = (
        np.bincount(place[changes.up], minlength=size),
        np.bincount(place[~changes.up], minlength=size),
    )
    own = np.flatnonzero((ups + downs >= CROSSINGS) & (ups > 0) & (downs > 0))[:MOST]
    own = own if len(own) >= ENOUGH else own[:0]
    classes = np.full(size, -1)
    classes[own] = np.arange(len(own))
    shift, left = np.zeros(size), deviation
    # lines of no class of their own keep e in their weight; those of a class have time alone
    of, count, e = classes[place], len(own) + 4, np.arange(len(place))
    classed = np.flatnonzero(of >= 0)
    pairs = np.append(classed, e), np.append(of[classed], len(own) + place % 4)
    E = csr_array((np.ones(len(pairs[0])), pairs), (len(e), count))  # classes of a change
    interval, u = np.divmod(changes.before, basis.m)
    columns = (interval[:, None] + np.arange(4)).ravel()
    V = csr_array((basis.values[0][u].ravel(), (np.repeat(e, 4), columns)), (len(e), basis.P))
    w, value = _weights(changes, speed, SIZES[-1])
    time = 1 / w
    variance_own = variance_period = deviation**2 / 2
    for _ in range(4):
        w = 1 / (time + np.where(of >= 0, 0.0, variance_own))
        tau, nu = weak[0].copy(), weak[1].copy()
        np.add.at(tau[0], changes.before, w)
        np.add.at(nu[0], changes.before, w * value)
        factor = Factor.of(basis.precision(tau, density))
        g = basis.gradient(nu, density, np.zeros((1, basis.P)))
        weighted = diags_array(w) @ E
        B = (V.T @ weighted).tocsc()
        S = (E.T @ weighted).toarray()
        for a in range(0, count, COLUMNS_AT_ONCE):
            part = B[:, a : a + COLUMNS_AT_ONCE].toarray(order="F")
            S[:, a : a + COLUMNS_AT_ONCE] -= B.T @ dpbtrs(factor.L, part, lower=1)[0]
        prior = np.concatenate(
            [np.full(len(own), 1 / variance_own), np.full(4, 1 / variance_period)]
        )
        C = np.linalg.inv(S + np.diag(prior))
        delta = C @ (B.T @ factor.solve(g)[0] - weighted.T @ value)
        if len(own):
            variance_own = float(np.mean(delta[: len(own)] ** 2 + np.diag(C)[: len(own)]))
        variance_period = float(np.mean(delta[len(own) :] ** 2 + np.diag(C)[len(own) :]))
    shift = delta[len(own) :][np.arange(size) % 4]
    shift[own] += delta[: len(own)]
    unknown = np.ones(len(place)) * variance_own
    unknown[of >= 0] = np.diag(C)[of[of >= 0]]
    left = float(np.sqrt(np.mean(unknown)))
    return (
        first,
        shift,
        max(left, SIZES[-1]),
        float(np.sqrt(np.mean(delta[len(own) :] ** 2))),
        len(own),
    )
