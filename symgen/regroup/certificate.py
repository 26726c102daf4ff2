"""The certificate of regrouping formulas: two independent routes, one exact, one numeric.

Exact, over F_p at fresh random lengths and states, for two primes:

    D_chi = sum_k coefficient_k,chi D_base,k   for every standard parameter chi,      rank_p(D_base) = number of base parameters.

The rank over F_p is never above the generic rank, so equality proves that no further relation exists; a false identity survives
one state with probability at most degree/p. General loops: the same identities at random points of the closed mechanism (`regroup.general`).

Numeric, in floats at the lengths of the robot file: the standard regressor W of a dynamics by energies (`derive.lagrange`), which shares
no code with the recursions, has the rank of the base parameters (SVD), and W chi = W_base X for random chi and X of the formulas.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from symgen.derive.exact import Array, Draw, Fp, primes_for
from symgen.derive.loops import close
from symgen.description.expression import ZERO, Expression
from symgen.description.robot import Robot
from symgen.regroup.finite_field import rref
from symgen.regroup.general import FloatStates, float_states, identities
from symgen.regroup.regrouping import NUMERIC, Regrouping
from symgen.regroup.solve import sample, states_for

if TYPE_CHECKING:
    from symgen.derive.lagrange import Sample

Sampler = Callable[[Draw, tuple[str, ...]], Array]
ROUNDED = 1e-7  # of the largest entry: columns by coefficients that are numbers
TOLERANCE = 1e-9  # relative to the largest entry: rounding of some thousand operations and of the closed loops


@dataclass(frozen=True)
class Certificate:
    """Results of the checks of a regrouping, and of the module emitted from it.

    Attributes
    ----------
    name, method : str
        Robot, and how the formulas were derived.
    count, rank : int
        Number of base parameters, and exact rank of their columns (the smallest over the primes).
    primes : tuple of int
        Primes of the exact checks; empty where coefficients are numbers.
    identities : int
        Number of column identities checked: one per standard parameter.
    failures : tuple of str
        Exact checks that do not hold, one sentence each.
    numeric_rank : int
        Rank by SVD of the independent regressor.
    numeric_gap : float
        Its smallest singular value that counts over the largest that does not.
    torque_error : float
        Largest difference of torques by base and by standard parameters on the independent regressor, of the largest torque.
    module_errors : mapping
        Largest difference of each function of the emitted module from the independent dynamics, of the largest entry; empty where no
        module was evaluated.
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
    module_errors: Mapping[str, float] = field(default_factory=dict)

    @property
    def numeric_valid(self) -> bool:
        """Whether the numeric rank and the torques agree with the formulas."""
        return self.numeric_rank == self.count and self.torque_error < TOLERANCE

    @property
    def module_valid(self) -> bool:
        """Whether every evaluated function of the module agrees; NaN does not."""
        return all(error < TOLERANCE for error in self.module_errors.values())

    @property
    def valid(self) -> bool:
        """Whether every check holds: the verdict of `symgen check`."""
        return not self.failures and self.numeric_valid and self.module_valid

    def mapping(self) -> dict[str, object]:
        """The certificate as plain values for JSON; null stands for a number that is not finite."""
        return {
            "valid": self.valid,
            "count": self.count,
            "rank": self.rank,
            "primes": list(self.primes),
            "identities": self.identities,
            "failures": list(self.failures),
            "method": self.method,
            "numeric_rank": self.numeric_rank,
            "numeric_gap": _finite(self.numeric_gap),
            "torque_error": _finite(self.torque_error),
            "numeric_valid": self.numeric_valid,
            "module_errors": {name: _finite(error) for name, error in self.module_errors.items()},
        }

    def __str__(self) -> str:
        """A line per check, marked `ok` or FALSE, then the verdict."""
        where = f"modulo {' and '.join(map(str, self.primes))}" if self.primes else "in floats"
        columns = any(text.startswith("column") for text in self.failures)
        lines = [
            f"{self.name}: {self.count} base parameters of {self.identities}, {self.method}",
            f"{_mark(self.rank == self.count)} rank of the base columns {where}: {self.rank}",
            f"{_mark(not columns)} {self.identities} column identities at fresh lengths and states",
            f"{_mark(self.numeric_rank == self.count)} rank of the CasADi regressor by SVD: {self.numeric_rank} (gap {self.numeric_gap:.1e})",
            f"{_mark(self.torque_error < TOLERANCE)} torques of the base parameters against CasADi: {self.torque_error:.1e} of the largest",
            *(
                f"{_mark(error < TOLERANCE)} {name} of the emitted module against CasADi: {error:.1e} of the largest"
                for name, error in self.module_errors.items()
            ),
        ]
        return "\n".join([*lines, *self.failures, "certificate " + ("valid" if self.valid else "FALSE")])


def _mark(holds: bool) -> str:
    return "ok   " if holds else "FALSE"


def _finite(x: float) -> float | None:
    return x if math.isfinite(x) else None


def certify_formulas(regrouping: Regrouping, *, seed: int = 101, sampler: Sampler = sample) -> Certificate:
    """The certificate of the formulas of `regrouping`; `emit.certified.certify` adds the emitted module.

    Parameters
    ----------
    regrouping : Regrouping
        Base parameters with their formulas.
    seed : int
        Of the random lengths and states over F_p.
    sampler : callable
        Gives the standard regressor over F_p at the states of a draw.

    Raises
    ------
    DescriptionError
        The loops close in too few random states.
    """
    robot = regrouping.robot
    exact = _general(regrouping, seed) if close(robot).tied else _over_primes(regrouping, seed, sampler)
    witness, rank, gap = independent(robot)
    chi = np.random.default_rng(6).standard_normal(len(robot.parameters))
    tau, base = witness.W @ chi, [robot.parameters.index(own) for own in regrouping.own]
    error = float(np.abs(tau - witness.W[:, base] @ base_values(regrouping, chi)).max() / np.abs(tau).max())
    return Certificate(robot.name, regrouping.method, len(regrouping), *exact, numeric_rank=rank, numeric_gap=gap, torque_error=error)


Exact = tuple[int, tuple[int, ...], int, tuple[str, ...]]  # rank, primes, identities, failures


def _over_primes(regrouping: Regrouping, seed: int, sampler: Sampler) -> Exact:
    robot = regrouping.robot
    primes = primes_for(robot, 2)
    index = {name: c for c, name in enumerate(robot.parameters)}
    failures: list[str] = []
    ranks: list[int] = []
    for k, p in enumerate(primes):
        draw = Draw(robot, seed + k, states_for(robot, robot.parameters), p=p)
        W = sampler(draw, robot.parameters)
        base = W[:, [index[name] for name in regrouping.own]]
        ranks.append(len(rref(base, p)[0]))
        if ranks[-1] != len(regrouping):
            failures.append(f"rank modulo {p} is {ranks[-1]}, not {len(regrouping)}: the base columns are dependent")
        failures += _false_identities(regrouping, draw, W, index, base)
    return min(ranks), primes, len(robot.parameters), tuple(failures)


def _general(regrouping: Regrouping, seed: int) -> Exact:
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
    if regrouping.method == NUMERIC:
        predicted = base @ np.array(
            [[K.get(name, {}).get(own, ZERO).value(robot.constants) for name in robot.parameters] for own in regrouping.own]
        )
        off = np.abs(predicted - W).max(axis=0) > ROUNDED * np.abs(W).max()
        return (
            rank,
            (),
            len(robot.parameters),
            (*failures, *(f"column of {robot.parameters[c]} is not what the formulas say" for c in np.flatnonzero(off))),
        )
    primes = primes_for(robot, 2)
    for k, p in enumerate(primes):
        wrong = identities(robot, K, seed + k, p=p)
        failures += [f"column of {name} is not what the formulas say (modulo {p})" for name in wrong]
    return rank, primes, len(robot.parameters), tuple(failures)


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


@lru_cache(maxsize=4)
def independent(robot: Robot) -> tuple[Sample, int, float]:
    """The regressor by energies at random states of `robot`, its numeric rank and gap; kept for further certificates of the robot."""
    from symgen.derive.lagrange import in_one_mode, sampled  # CasADi, which nothing else of this room needs

    witness = sampled(in_one_mode(robot), 3 * len(robot.parameters) // len(robot.joints) + 10, seed=5)
    return witness, *numeric_rank(witness.W)


def base_values(regrouping: Regrouping, chi: Array) -> Array:
    """X (b,) of standard parameters chi (p,) by the formulas, at the lengths of the robot file."""
    robot = regrouping.robot
    value = dict(zip(robot.parameters, chi, strict=True))
    return np.array([sum(c.value(robot.constants) * value[name] for name, c in b.combination.items()) for b in regrouping.base])


def numeric_rank(W: Array, *, tolerance: float = 1e-9) -> tuple[int, float]:
    """Rank of a float matrix by SVD after scaling its columns, and the gap s_rank / s_(rank+1)."""
    norms = np.linalg.norm(W, axis=0)
    acts = norms > 1e-12 * norms.max(initial=0.0)  # below: rounding of a column without effect
    s = np.linalg.svd(W[:, acts] / norms[acts], compute_uv=False)
    rank = int(np.sum(s > tolerance * s[0]))
    gap = float(s[rank - 1] / max(s[rank], np.finfo(float).tiny)) if rank < s.size else float("inf")
    return rank, gap
