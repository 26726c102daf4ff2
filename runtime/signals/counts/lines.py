"""Places of the lines of an encoder that are not evenly spaced, estimated with the motion.

A change of the count, from k to k + 1 between two samples, says that the motion crossed line k +
1/2 + delta_k there:

    x(t_e) = k + 1/2 + delta_k + n_e
        n_e of variance (qd Ts)^2/12, time alone; delta_k of variance e^2, the same at every
        crossing; w_e = 1/((qd Ts)^2/12 + e^2)
    S delta = B' A^-1 g - B' ...                  S = diag(sum w) + 1/e^2 - B' A^-1 B,
                                            B of a class: sum of w_e b_e over its changes

e is that of `runtime.signals.counts.boxes`. Classes of lines are those of period two and four
(quadrature) and single lines crossed at least CROSSINGS times, in both directions; e^2 of a class
by expectation maximisation. What is estimated is taken off the bounds, and what is left widens
them.

References: Harville (1977), random effects; Merry, van de Molengraft and Steinbuch (2010) for
encoders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, diags_array

from runtime.signals.counts.spline import Basis, Factor

Array = np.ndarray

WEAK = 0.06
"""Precision of every count taken as a position, where no count changes: a hundredth of an
interval's, since neighbours say the same.
"""
EVEN = 0.01
"""Deviation of lines that is always allowed for, steps."""
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
class LineErrors:
    """Of one encoder: shift of the lines first, first + 1 ..., steps; what is left of their
    deviation; a sentence.
    """

    first: int
    shift: Array
    left: float
    finding: str

    def of(self, number: Array) -> Array:
        """Shifts of lines by their number; 0 for lines never crossed."""
        place = number - self.first
        inside = (place >= 0) & (place < len(self.shift))
        return np.where(inside, self.shift[np.clip(place, 0, len(self.shift) - 1)], 0.0)


def estimated_lines(
    basis: Basis,
    y: Array,
    known: Array,
    rest: Array,
    c: Array,
    density: Array,
    deviation: float,
) -> LineErrors:
    """Places of the lines of one encoder whose deviation is known, steps.

    y, known, rest : counts, samples that have one, precision of the others.
    c, density : the motion with bounds widened by the deviation.
    """
    change = np.diff(y[known])
    e = np.flatnonzero((np.abs(change) == 1) & (np.diff(known) <= basis.m + 1))
    before, after, up = known[e], known[e + 1], change[e] > 0
    line = (y[before] + y[after]) / 2
    first = int(np.floor(line.min()))
    place = np.floor(line).astype(int) - first
    size = int(place.max()) + 1
    ups, downs = (np.bincount(place[way], minlength=size) for way in (up, ~up))
    own = np.flatnonzero((ups + downs >= CROSSINGS) & (ups > 0) & (downs > 0))[:MOST]
    own = own if len(own) >= ENOUGH else own[:0]
    classes = np.full(size, -1)
    classes[own] = np.arange(len(own))
    # lines of no class of their own keep e in their weight; those of a class have time alone
    of, count, e = classes[place], len(own) + 4, np.arange(len(place))
    classed = np.flatnonzero(of >= 0)
    pairs = np.append(classed, e), np.append(of[classed], len(own) + place % 4)
    E = csr_array((np.ones(len(pairs[0])), pairs), (len(e), count))  # classes of a change
    V = basis.rows(before)
    moved = basis.at_samples(c, 1)[before] * basis.Ts * (after - before)
    time, value = moved**2 / 12 + EVEN**2, line - moved / 2  # at the sample before the change
    variance_own = variance_period = deviation**2 / 2
    for _ in range(4):
        w = 1 / (time + np.where(of >= 0, 0.0, variance_own))
        tau = rest.copy()
        tau[known] = WEAK
        nu = WEAK * y
        np.add.at(tau, before, w)
        np.add.at(nu, before, w * value)
        factor = Factor.of(basis.precision(tau, density))
        g = basis.gradient(nu, density, np.zeros(basis.P))
        weighted = diags_array(w) @ E
        B = (V.T @ weighted).tocsc()
        S = (E.T @ weighted).toarray()
        for a in range(0, count, COLUMNS_AT_ONCE):
            part = B[:, a : a + COLUMNS_AT_ONCE].toarray(order="F")
            S[:, a : a + COLUMNS_AT_ONCE] -= B.T @ factor.solve(part)
        prior = np.concatenate(
            [np.full(len(own), 1 / variance_own), np.full(4, 1 / variance_period)]
        )
        C = np.linalg.inv(S + np.diag(prior))
        delta = C @ (B.T @ factor.solve(g) - weighted.T @ value)
        if len(own):
            variance_own = float(np.mean(delta[: len(own)] ** 2 + np.diag(C)[: len(own)]))
        variance_period = float(np.mean(delta[len(own) :] ** 2 + np.diag(C)[len(own) :]))
    shift = delta[len(own) :][np.arange(size) % 4]
    shift[own] += delta[: len(own)]
    unknown = np.ones(len(place)) * variance_own
    unknown[of >= 0] = np.diag(C)[of[of >= 0]]
    left = max(float(np.sqrt(np.mean(unknown))), EVEN)
    period = float(np.sqrt(np.mean(delta[len(own) :] ** 2)))
    return LineErrors(first, shift, left, _text(deviation, left, period, len(own)))


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
