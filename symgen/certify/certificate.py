"""The certificate of the regrouping formulas: an exact check modulo primes, and a check in floats.

Exact, over F_p at new random lengths and states, for two or more primes:

    D_chi = sum_k coefficient_k,chi D_base,k   for every standard parameter chi,
            rank_p(D_base) = number of base parameters.

The primes are drawn anew, so that no coefficient is checked over the prime that gave it. The rank
over F_p is never above the generic rank, so equality proves that no further relation exists.

A false identity is a nonzero rational function of the geometry and of each state. Its degree is at
most d (`degree`: every angle counts 2 per multiple, numerator and denominator together). By
Schwartz and Zippel, it vanishes at a random geometry, or at every state of one geometry, with
probability at most 2 d/p (Schwartz 1980, Zippel 1979). Draws are repeated until (2 d/p)**draws is
negligible (below `SURE`). Numbers in the robot file are not random: a false identity between
numbers is a fixed nonzero number, which only its own few prime factors divide.

General loops: the same identities are checked at random points of the closed mechanism
(`regroup.states`), with the values of lengths that are numbers in the robot file. The rank is
checked at random lengths.

Numeric, in floating point at the lengths of the robot file: the standard regressor W is that of a
dynamics by energies (`certify.lagrange`), which shares no code with the recursions. W has the rank
of the base parameters (by SVD), and W chi = W_base X for random chi and the X that the formulas
give.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.certify.texts import TOLERANCE, TextCheck
from symgen.certify.witness import base_values, is_assumed
from symgen.derive.closure import parts
from symgen.derive.constants import numbered, roots_of, rows_of, symbolic_angle, units_of
from symgen.derive.doubts import nearly_round
from symgen.derive.exact import Array, Draw, primes_for
from symgen.derive.loops import close
from symgen.description.expression import Call, Expression, Number, quarter_turns
from symgen.description.robot import REVOLUTE, Frame, Robot
from symgen.description.values import WITHIN
from symgen.regroup.finite_field import rank as rank_modulo
from symgen.regroup.regrouping import EXACT, Regrouping
from symgen.regroup.states import closed_draw, sample, states_for

if TYPE_CHECKING:
    from symgen.certify.lagrange import Sample

Sampler = Callable[[Draw, tuple[str, ...]], Array]
LOST = 1e12  # sums of numbers as large keep less than three decimals of numbers of size 1
ROUNDED = 1e-7  # of the largest entry: columns by coefficients that are numbers
ZERO_BELOW = 1e-9  # rad, m or a cosine: a denominator that is zero but for rounding
AT_VALUES = "use --at-values to regroup for these numbers"
SURE, MOST_DRAWS = (
    1e-12,
    8,
)  # largest probability that a false identity passes, and draws over F_p at most
FEW_STATES = 3  # of each draw for the identities: one would do
FAR_APART = 1e6  # lengths of one robot: squares of their ratio come near rounding
SEEN = 1e3  # gap of singular values that rounding does not make
# gap of singular values at the rank of a geometry that is special; less where it is a hair off one
CLEAR = 1e9
# relative to the largest entry: rounding of some thousand operations and of the closed loops


@dataclass(frozen=True)
class Certificate:
    """Results of all checks of the base parameters of a robot and of the code emitted from them.

    Attributes
    ----------
    name, method : str
        Name of the robot, and how the formulas were derived.
    count, rank : int
        Number of base parameters, and exact rank of their columns (the smallest over the primes).
    primes : tuple of int
        Primes of the exact checks; empty if coefficients are numbers.
    identities : int
        Number of column identities checked: one per standard parameter.
    failures : tuple of str
        Exact checks that do not hold, one sentence each.
    numeric_rank : int
        Rank by SVD of the independent regressor.
    numeric_gap : float
        Smallest singular value that counts for the rank, divided by the largest that does not.
    torque_error : float
        Largest difference between torques by base parameters and torques by standard parameters, on
        the independent regressor, relative to the largest torque.
    texts : mapping
        Check of each emitted file, by file name; empty if no file was given.
    rank_in_floats : bool
        Whether `rank` is the rank of the independent regressor, because the loops cannot be closed
        exactly modulo a prime.
    error_probability : float
        Bound on the probability that a false identity passes the exact checks; 1 if coefficients
        are numbers, which are checked in floating point.
    """

    name: str
    method: str
    count: int
    rank: int
    primes: tuple[int, ...]
    identities: int
    failures: tuple[str, ...]
    numeric_rank: int
    numeric_gap: float
    torque_error: float
    texts: Mapping[str, TextCheck] = field(default_factory=dict)
    rank_in_floats: bool = False
    error_probability: float = 0.0

    @property
    def numeric_valid(self) -> bool:
        """Whether the rank by SVD and the torques, both in floating point, agree with the
        regrouping formulas.
        """
        return self.numeric_rank == self.count and self.torque_error < TOLERANCE

    @property
    def valid(self) -> bool:
        """Whether every check of the certificate holds."""
        return (
            not self.failures and self.numeric_valid and all(t.valid for t in self.texts.values())
        )

    @property
    def formulas(self) -> str:
        """Text that states how the regrouping formulas were checked: exactly modulo primes, or in
        floats.
        """
        if not self.primes:
            return "checked in floats"
        sure = f", a false one passes with probability below {self.error_probability:.0e}"
        return f"exact modulo {' and '.join(map(str, self.primes))}" + sure * (
            self.error_probability < 1
        )

    @property
    def errors(self) -> dict[str, float]:
        """Largest relative error of each emitted function, by a key such as `bias of arm.py`.

        The error is the difference from independently computed values.
        """
        return {
            f"{name} of {file}": error
            for file, text in self.texts.items()
            for name, error in text.errors.items()
        }

    @property
    def checks(self) -> list[tuple[bool, str]]:
        """List of all checks as pairs: whether the check holds, and a text that describes it."""
        where = "in floats" if self.rank_in_floats or not self.primes else "modulo the primes"
        columns = any(text.startswith("column") for text in self.failures)
        checks = [
            (self.rank == self.count, f"rank of the base columns {where}: {self.rank}"),
            (
                not columns,
                f"{self.identities} column identities at fresh lengths and states {self.formulas}",
            ),
            (
                self.numeric_rank == self.count,
                f"rank of the CasADi regressor by SVD: {self.numeric_rank} "
                f"(gap {self.numeric_gap:.1e})",
            ),
            (
                self.torque_error < TOLERANCE,
                "torques of the base parameters against CasADi: "
                f"{self.torque_error:.1e} of the largest",
            ),
        ]
        return checks + [check for file, text in self.texts.items() for check in text.checks(file)]

    def mapping(self) -> dict[str, Any]:
        """Return the certificate as tables, numbers and texts for JSON, with null for NaN and
        infinity.
        """
        values = {"valid": self.valid, "numeric_valid": self.numeric_valid, **asdict(self)}
        return dict(_plain(values))

    def brief(self) -> str:
        """Return a text: a line with the verdict (valid or FALSE), then a line per failed check."""
        verdict = "valid" if self.valid else "FALSE"
        head = (
            f"{self.name}: certificate {verdict}, {self.count} base parameters of "
            f"{self.identities}, {self.method}; {len(self.checks)} checks"
        )
        wrong = [f"FALSE {text}" for holds, text in self.checks if not holds]
        return "\n".join([head, *wrong, *self.failures])

    def __str__(self) -> str:
        """Return a text: one line per check, marked `ok` or FALSE, then a line with the verdict."""
        head = f"{self.name}: {self.count} base parameters of {self.identities}, {self.method}"
        lines = [f"{'ok   ' if holds else 'FALSE'} {text}" for holds, text in self.checks]
        verdict = f"certificate {'valid' if self.valid else 'FALSE'}"
        return "\n".join([head, *lines, *self.failures, verdict])


def _plain(value: Any) -> Any:
    """Replace numbers that are not finite by None in a nested mapping, since JSON has no NaN."""
    if isinstance(value, Mapping):
        return {key: _plain(x) for key, x in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def certify_formulas(
    regrouping: Regrouping, *, seed: int = 101, sampler: Sampler = sample
) -> Certificate:
    """Check the regrouping formulas of the base parameters, and return the certificate.

    `certify.modules.certify` checks the emitted module too.

    Parameters
    ----------
    regrouping : Regrouping
        Base parameters with their formulas.
    seed : int
        Seed of the random lengths and states over F_p.
    sampler : callable
        Computes the standard regressor over F_p at the states of a draw.

    Raises
    ------
    DescriptionError
        The loops close in too few random states.
    """
    robot = regrouping.robot
    witness = independent(robot)
    acting = [c for c, name in enumerate(robot.parameters) if name not in regrouping.no_effect]
    base = [robot.parameters.index(own) for own in regrouping.own]
    bound = 2 * degree(regrouping) / 2**30
    draws = 2
    while bound**draws > SURE and draws < MOST_DRAWS:
        draws += 1
    primes = primes_for(robot, draws, seed)
    exact_ranks, wrong = zip(
        *(_modulo(regrouping, seed + k, p, sampler) for k, p in enumerate(primes)), strict=True
    )
    ranks = [r for r in exact_ranks if r is not None]
    told = len(ranks) == draws  # else no random lengths close the loops modulo the primes
    exact_rank, told = (min(ranks), True) if told else rank_by_gap(witness.W[:, base])
    rank, gap = numeric_rank(witness.W[:, acting], proved=exact_rank)
    failures = []
    if exact_rank != len(regrouping):
        failures.append(
            f"rank is {exact_rank}, not {len(regrouping)}: the base columns are dependent"
            if told
            else "the rank of the base columns cannot be verified in double precision: at least "
            f"{exact_rank}, and the singular values of the others show no gap"
        )
    if regrouping.method != EXACT:
        failures += [
            f"column of {name} is not what the formulas say (in floats)"
            for name in _false_in_floats(regrouping, witness.W, base)
        ]
        primes = ()
    else:
        failures += [
            f"column of {name} is not what the formulas say (modulo {p})"
            for p, names in zip(primes, wrong, strict=True)
            for name in names
        ]
    vanishing = vanishing_denominators(regrouping)
    failures += [f"{text}; the formulas do not hold there, {AT_VALUES}" for text in vanishing]
    if rank < len(regrouping) == exact_rank:
        failures.append(_special(robot, gap, witness.W[:, base]))
    sizes = sorted(
        (x, f"{x:.2g} m ({e}, frame {robot.labels.get(f.j, f.j)})")
        for f in robot.frames
        for e in (f.b, f.d, f.r0)
        if (x := abs(e.value(robot.constants)))
    )
    if sizes and rank > exact_rank == len(regrouping) and sizes[-1][0] > FAR_APART * sizes[0][0]:
        failures.append(
            f"lengths between {sizes[0][1]} and {sizes[-1][1]} lie too far apart for checks in "
            "double precision; give them in one order of size"
        )
    chi = np.random.default_rng(6).standard_normal(len(robot.parameters)) * ~is_assumed(robot)
    tau, X = witness.W @ chi, base_values(regrouping, chi, robot.constants)
    error = float(np.abs(tau - witness.W[:, base] @ X).max() / np.abs(tau).max())
    if sizes and error >= TOLERANCE and not vanishing and (size := np.abs(X).max()) > LOST:
        name = regrouping.names[int(np.abs(X).argmax())]
        failures.append(
            f"the formula of {name} gives {size:.0e} where standard parameters are of size 1: "
            "double precision keeps no digit of that sum. Lengths as small as "
            f"{sizes[0][1]} divide in it; write 0 where nothing is meant"
        )
    return Certificate(
        robot.name,
        regrouping.method,
        len(regrouping),
        exact_rank,
        primes,
        len(robot.parameters),
        tuple(failures),
        numeric_rank=rank,
        numeric_gap=gap,
        torque_error=error,
        rank_in_floats=len(ranks) < draws,
        error_probability=min(1.0, bound**draws) if primes else 1.0,
    )


def _special(robot: Robot, gap: float, W: Array) -> str:
    """Write the reason why the base parameter columns W have a lower rank at the numbers of the
    robot file.
    """
    if roots := independent_roots(robot):
        return (
            f"{', '.join(roots)} {'count' if len(roots) > 1 else 'counts'} as any number in the "
            "proof, but the rank is smaller if such a root is a combination of other roots, "
            "cosines or constants; write it as this "
            f"combination{f', or {AT_VALUES}' if robot.constants else ''}"
        )
    if gap > CLEAR and robot.constants and not nearly_round(robot, WITHIN):
        rank, generic = numeric_rank(W)[0], W.shape[1]
        values = ", ".join(f"{name} = {value:g}" for name, value in robot.constants.items())
        return (
            f"the constants of the file ({values}) are special: the rank is {rank} there, "
            f"{generic} elsewhere; {AT_VALUES}"
        )
    return hair_off(robot, _too_small(W))


def independent_roots(robot: Robot) -> list[str]:
    """List the square roots in a robot file whose argument is not rational, such as sqrt(2*D3).

    Over F_p each of these roots is an independent unknown.
    """
    return [root.text for root in roots_of(robot) if root.argument.constant is None]


def _too_small(W: Array) -> str:
    """Return a text with the number of combinations of base parameters that hardly affect the
    torques.

    Their singular values in W are below 1e-9 of the largest.
    """
    s = np.linalg.svd(W, compute_uv=False)
    return f"{np.sum(s < 1e-9 * s[0])} combinations of base parameters"


def hair_off(robot: Robot, what: str) -> str:
    """Write the error message for a geometry that is almost special, such as 1.570796 rad for pi/2.

    The difference from the special geometry has an effect that no record can show.
    """
    angles = "; ".join(nearly_round(robot, WITHIN)) or "round the numbers that are meant round"
    return (
        f"the geometry of the file is almost a special one: {what} have less than 1e-9 of the "
        f"effect of the others, which no record can show; {angles}; --at-values replaces angles "
        "within 1e-6 rad of a multiple of pi/12 by this multiple"
    )


def vanishing_denominators(regrouping: Regrouping) -> list[str]:
    """Describe each regrouping formula that divides by zero at the constants of the robot file."""
    values, texts = regrouping.robot.constants, []
    for b in regrouping.base:
        below = {
            a
            for c in b.combination.values()
            for m in c.terms
            for a, n in m
            if n < 0 or (isinstance(a, Call) and a.function == "inv")
        }
        for a in sorted(below, key=str):
            base = (
                a.argument
                if isinstance(a, Call) and a.function == "inv"
                else Expression({((a, 1),): Fraction(1)})
            )
            if abs(base.value(values)) < ZERO_BELOW:
                at = ", ".join(f"{name} = {values[name]:g}" for name in sorted(base.symbols))
                texts.append(f"{b.name} = {b.formula} divides by {base}, which is zero at {at}")
    return texts


def degree(regrouping: Regrouping) -> int:
    """Compute an upper bound of the polynomial degree of the identities between regressor columns.

    The variables are half-angle tangents, lengths, rates and directions of motion. An entry of the
    regressor passes each frame of a path at most three times: outwards in products of two
    velocities, and back.
    """
    robot, closure = regrouping.robot, close(regrouping.robot)
    units = units_of(numbered(robot))

    def angle(e: Expression) -> int:
        return 2 * sum(abs(k) for unit, k in units.of(quarter_turns(symbolic_angle(e))[1]))

    def constant(e: Expression) -> int:
        return max((sum(abs(n) * atom(a) for a, n in m) for m in e.terms), default=0)

    def atom(a: str | Number | Call) -> int:
        if not isinstance(a, Call):
            return 1
        return angle(a.argument) if a.function in ("cos", "sin") else constant(a.argument)

    def frame(f: Frame) -> int:
        turn = (
            2 * int(sum(abs(Fraction(n)) * parts(robot) for _, n in closure.turn(f.j)[0]))
            + angle(closure.offset[f.j])
            if f.sigma == REVOLUTE
            else 1
        )
        return (
            turn
            + sum(map(angle, (f.gamma, f.alpha, f.theta0)))
            + max(map(constant, (f.b, f.d, f.r0)))
        )

    of_frame = {f.j: frame(f) for f in robot.frames}
    path = max((sum(of_frame[i] for i in robot.path(j)) for j in of_frame), default=0)
    coefficients = max(map(constant, regrouping.coefficients), default=0)
    return 3 * path + 3 + 2 * max(map(constant, rows_of(robot)), default=0) + coefficients


def _modulo(
    regrouping: Regrouping, seed: int, p: int, sampler: Sampler
) -> tuple[int | None, list[str]]:
    """Check, modulo a prime p, the rank of the base parameter columns and all regrouping formulas.

    Return the rank (None if the loops cannot be closed exactly modulo p), and the columns that
    differ from their formulas.
    """
    robot = regrouping.robot
    names, own = robot.parameters, [robot.parameters.index(name) for name in regrouping.own]
    if close(robot).tied:
        states = len(own) // len(robot.rows) + 10
        try:  # identities at the numbers of the file, where some were recognised; rank at any
            draw: Draw = closed_draw(robot, seed, 1, count=FEW_STATES, p=p, at_numbers=True)
            fixed = closed_draw(robot, seed, states, p=p)
            few = np.moveaxis(sample(draw, names), 0, 1)
            rank = rank_modulo(sample(fixed, regrouping.own)[0], p)
        except ArithmeticError:
            return None, list(names) if regrouping.method == EXACT else []
    else:
        draw = Draw(robot, seed, states_for(robot, names), p=p)
        W = sampler(draw, names)
        rank = rank_modulo(W[:, own], p)
        few = W.reshape(len(robot.rows), -1, len(names))[:, :FEW_STATES]
    predicted, column = np.zeros_like(few), {name: k for k, name in enumerate(names)}
    residues = {c: draw.residues(draw.constant(c)) for c in regrouping.coefficients}
    for k, b in enumerate(regrouping.base):
        for name, c in b.combination.items():
            x = predicted[..., column[name]]
            predicted[..., column[name]] = (x + few[..., own[k]] * residues[c]) % p
    wrong = np.flatnonzero((predicted != few).any(axis=(0, 1)) & ~is_assumed(robot))
    return rank, [names[c] for c in wrong]


def _false_in_floats(regrouping: Regrouping, W: Array, base: list[int]) -> list[str]:
    """List the columns of the regressor W (derived from energies) that contradict the formulas.

    A column is listed if its error, relative to the largest entry, exceeds rounding (`ROUNDED`).
    """
    robot = regrouping.robot
    K = base_values(regrouping, np.eye(len(robot.parameters)), robot.constants)
    off = np.abs(W[:, base] @ K - W).max(axis=0) > ROUNDED * np.abs(W).max()
    off &= ~is_assumed(robot)
    return [robot.parameters[c] for c in np.flatnonzero(off)]


@lru_cache(maxsize=4)
def independent(robot: Robot) -> Sample:
    """Compute the regressor of `robot` from its energies, at random states; cache the result."""
    from symgen.certify.lagrange import (
        in_one_mode,
        sampled,
    )  # CasADi, loaded late

    count = 3 * len(robot.parameters) // len(robot.rows) + 10
    return sampled(in_one_mode(robot), count, seed=5, in_time=bool(robot.channels))


def rank_by_gap(W: Array) -> tuple[int, bool]:
    """Compute the rank of a matrix by its singular values, and whether this rank is certain.

    It is certain if all singular values are far above rounding errors, or if one exceeds the next
    by a factor of 1000 (`SEEN`). Otherwise the rank is a lower bound.
    """
    rank, _ = numeric_rank(W)
    if rank == W.shape[1]:
        return rank, True
    norms = np.linalg.norm(W, axis=0)
    s = np.linalg.svd(W / np.where(norms > 0, norms, 1.0), compute_uv=False)
    tiny = np.finfo(float).tiny
    drops = s[:-1] / np.maximum(s[1:], tiny)
    last = int(drops.argmax()) + 1
    return (last, True) if drops[last - 1] > SEEN else (rank, False)


def numeric_rank(W: Array, *, proved: int = 0) -> tuple[int, float]:
    """Compute the rank of a matrix by SVD of its scaled columns, and the ratio s_rank / s_(rank+1)
    of singular values.

    If `proved` is a larger rank that was proved exactly, it is the result, provided that its last
    singular value exceeds the next by a factor of 1000 (`SEEN`).
    """
    norms = np.linalg.norm(W, axis=0)
    acts = norms > 0
    if (
        acts.any()
    ):  # below the median (np.median loads numpy.ma): rounding of a column without effect
        acts = norms > 1e-12 * np.sort(norms[acts])[acts.sum() // 2]
    s = np.linalg.svd(W[:, acts] / norms[acts], compute_uv=False)
    rank = int(np.sum(s > 1e-9 * s[0]))
    if rank < proved < s.size and s[proved - 1] > SEEN * s[proved]:
        rank = proved
    gap = float(s[rank - 1] / max(s[rank], np.finfo(float).tiny)) if rank < s.size else float("inf")
    return rank, gap
