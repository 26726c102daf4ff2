"""The certificate of a regrouping: exact rank and identities over F_p at fresh geometry, numeric rank of an independent regressor.

With fresh random lengths and states, for two primes,

    D_chi = sum_k coefficient_k,chi D_base,k   for every standard parameter chi,      rank_p(D_base) = number of base parameters.

The rank over F_p is never above the generic rank, so equality proves that no further relation exists; a false identity survives
one state with probability at most degree/p.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from symgen.derive.exact import Array, Draw, Fp, primes_for
from symgen.derive.loops import close
from symgen.description.expression import ZERO, Expression
from symgen.regroup.finite_field import rref
from symgen.regroup.general import FloatStates, float_states, identities

from symgen.regroup.regrouping import NUMERIC, Regrouping
from symgen.regroup.solve import sample, states_for

Sampler = Callable[[Draw, tuple[str, ...]], Array]


@dataclass(frozen=True)
class Certificate:
    """What was checked and what did not hold; `valid` if nothing failed."""

    count: int
    rank: int
    primes: tuple[int, ...]
    identities: int
    failures: tuple[str, ...]

    @property
    def valid(self) -> bool:
        return not self.failures

    def mapping(self) -> dict[str, object]:
        return {
            "valid": self.valid,
            "count": self.count,
            "rank": self.rank,
            "primes": list(self.primes),
            "identities": self.identities,
            "failures": list(self.failures),
        }


def certify(regrouping: Regrouping, *, seed: int = 101, sampler: Sampler = sample) -> Certificate:
    """Check every formula of `regrouping`. `sampler` gives the standard regressor over F_p (a test may pass a wrong one)."""
    robot = regrouping.robot
    if close(robot).tied:
        return _certify_general(regrouping, seed)
    primes = primes_for(robot, 2)
    failures: list[str] = []
    ranks: list[int] = []
    for k, p in enumerate(primes):
        draw = Draw(robot, seed + k, states_for(robot, robot.parameters), p=p)
        W = sampler(draw, robot.parameters)
        index = {name: c for c, name in enumerate(robot.parameters)}
        base = W[:, [index[name] for name in regrouping.own]]
        ranks.append(len(rref(base, p)[0]))
        if ranks[-1] != len(regrouping):
            failures.append(f"rank modulo {p} is {ranks[-1]}, not {len(regrouping)}: the base columns are dependent")
        failures += _false_identities(regrouping, draw, W, index, base)
    return Certificate(len(regrouping), min(ranks), primes, len(robot.parameters), tuple(failures))


def _certify_general(regrouping: Regrouping, seed: int) -> Certificate:
    """General loops: the identities at random points of the closed mechanism over F_p, the rank at its lengths in floats.

    A smallest singular value far above rounding proves that the base columns are independent.
    """
    robot = regrouping.robot
    K: dict[str, dict[str, Expression]] = {}
    for b in regrouping.base:
        for name, c in b.combination.items():
            K.setdefault(name, {})[b.own] = c
    W = FloatStates(robot, seed).regressor(robot.parameters, float_states(robot, robot.parameters))
    base = W[:, [robot.parameters.index(own) for own in regrouping.own]]
    rank = numeric_rank(base)[0]
    failures = [] if rank == len(regrouping) else [f"rank is {rank}, not {len(regrouping)}: the base columns are dependent"]
    primes = primes_for(robot, 2)
    try:
        for k, p in enumerate(primes):
            wrong = identities(robot, K, regrouping.own, seed + k, p=p)
            failures += [f"column of {name} is not what the formulas say (modulo {p})" for name in wrong]
    except ArithmeticError:
        primes = ()
    if not primes or regrouping.method == NUMERIC:
        failures = [f for f in failures if f.startswith("rank")]
        predicted = base @ np.array([[K.get(name, {}).get(own, ZERO).value(robot.constants) for name in robot.parameters] for own in regrouping.own])
        off = np.abs(predicted - W).max(axis=0) > 1e-7 * np.abs(W).max()
        failures += [f"column of {robot.parameters[c]} is not what the formulas say" for c in np.flatnonzero(off)]
        primes = ()
    return Certificate(len(regrouping), rank, primes, len(robot.parameters), tuple(failures))


def _false_identities(regrouping: Regrouping, draw: Draw, W: Array, index: dict[str, int], base: Array) -> list[str]:
    p = draw.p
    predicted = np.zeros_like(W)
    for k, b in enumerate(regrouping.base):
        for name, coefficient in b.combination.items():
            c = draw.constant(coefficient)
            residue = int(c.x[0]) if isinstance(c, Fp) else c % p
            column = index[name]
            predicted[:, column] = (predicted[:, column] + base[:, k] * residue) % p
    wrong = np.flatnonzero((predicted != W).any(axis=0))
    return [f"column of {regrouping.robot.parameters[c]} is not what the formulas say (modulo {p})" for c in wrong]


def numeric_rank(W: Array, *, tolerance: float = 1e-9) -> tuple[int, float]:
    """Rank of a float matrix by SVD after scaling its columns, and the gap s_rank / s_(rank+1)."""
    norms = np.linalg.norm(W, axis=0)
    acts = norms > 1e-12 * norms.max(initial=0.0)  # below: rounding of a column without effect
    s = np.linalg.svd(W[:, acts] / norms[acts], compute_uv=False)
    rank = int(np.sum(s > tolerance * s[0]))
    gap = float(s[rank - 1] / max(s[rank], np.finfo(float).tiny)) if rank < s.size else float("inf")
    return rank, gap
