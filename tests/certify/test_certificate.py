"""The certificate holds for what is right and refuses what is wrong: mutated coefficients, a
mutated recursion, a wrong base.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from campaign import campaign, sampled, some

from oracles.random_robots import describe_mix, random_robot
from oracles.same_draw import same_draw
from symgen.certify import lagrange
from symgen.certify.certificate import (
    certify_formulas,
    independent,
    numeric_rank,
    rank_by_gap,
)
from symgen.derive import newton_euler
from symgen.derive.derivation import derive
from symgen.description import Robot, load_robot, packaged_robots
from symgen.description.expression import Expression
from symgen.regroup.regrouping import BaseParameter, Regrouping, regroup

RANDOM = range(250)


@pytest.mark.parametrize("name", packaged_robots())
@some(6)
def test_packaged_robots_are_certified(name: str) -> None:
    certificate = certify_formulas(regroup(load_robot(name)))
    assert certificate.valid, certificate.failures
    assert certificate.rank == certificate.count


def flipped(regrouping: Regrouping, k: int, name: str) -> Regrouping:
    """The same with the sign of one coefficient turned."""
    b = regrouping.base[k]
    wrong = BaseParameter(b.name, b.own, {**b.combination, name: -b.combination[name]})
    return replace(regrouping, base=(*regrouping.base[:k], wrong, *regrouping.base[k + 1 :]))


def coefficients(regrouping: Regrouping) -> list[tuple[int, str]]:
    return [
        (k, name) for k, b in enumerate(regrouping.base) for name in b.combination if name != b.own
    ]


def certified_as_it_is_alone(regrouping: Regrouping) -> None:
    once = same_draw()
    assert certify_formulas(regrouping, sampler=once).valid
    for k, name in coefficients(regrouping):
        assert not certify_formulas(flipped(regrouping, k, name), sampler=once).valid, (
            regrouping.base[k].name,
            name,
        )


@pytest.mark.parametrize("name", ["tx40", "stanford", pytest.param("two_branch", marks=campaign)])
def test_every_flipped_coefficient_is_caught(name: str) -> None:
    certified_as_it_is_alone(regroup(load_robot(name)))


def test_a_slightly_wrong_coefficient_is_caught() -> None:
    regrouping = regroup(load_robot("tx40"))
    b = regrouping.base[0]
    wrong = BaseParameter(
        b.name, b.own, {**b.combination, "M4": b.combination["M4"] + Expression.number("0.001")}
    )
    assert not certify_formulas(replace(regrouping, base=(wrong, *regrouping.base[1:]))).valid


def test_a_dependent_base_is_caught() -> None:
    """One parameter too many: the rank shows it."""
    regrouping = regroup(load_robot("planar_2r"))
    extra = BaseParameter("M2", "M2", {"M2": Expression.number(1)})
    certificate = certify_formulas(replace(regrouping, base=(*regrouping.base, extra)))
    assert not certificate.valid and certificate.rank == len(regrouping)


@pytest.mark.parametrize("name", ["planar_2r", "tx40", "haptic", "panda", "scara"])
def test_a_gap_tells_dependent_columns(name: str) -> None:
    """Ten sets of columns a robot, each with one that is a combination of others; and a matrix whose
    singular values fall without a gap, which tells nothing.
    """
    regrouping = regroup(load_robot(name))
    W = independent(regrouping.robot).W
    W = W[:, [regrouping.robot.parameters.index(own) for own in regrouping.own]]
    assert rank_by_gap(W) == (len(regrouping), True)
    rng = np.random.default_rng(3)
    for _ in range(10):
        k, *others = rng.permutation(len(regrouping))[: rng.integers(3, 6)]
        dependent = W.copy()
        dependent[:, k] = W[:, others] @ rng.uniform(0.5, 2, len(others))
        assert rank_by_gap(dependent) == (len(regrouping) - 1, True)
    U, V = (np.linalg.qr(rng.normal(size=(40, 20)))[0] for _ in range(2))
    rank, told = rank_by_gap(U * 10.0 ** -np.arange(20.0) @ V[:20].T)
    assert rank < 20 and not told


def test_a_missing_base_parameter_is_caught() -> None:
    regrouping = regroup(load_robot("planar_2r"))
    assert not certify_formulas(replace(regrouping, base=regrouping.base[1:])).valid


def test_a_mutated_recursion_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """One sign in U: the general rules are theorems of mechanics, so the wrong columns do not obey
    them.
    """
    right = newton_euler.Motion._products

    def wrong(self, w, wd, j):
        DV, DW, U = right(self, w, wd, j)
        return DV, DW, (U[0], (U[1][0], U[1][1], -U[1][2]), U[2])

    monkeypatch.setattr(newton_euler.Motion, "_products", wrong)
    derive.cache_clear()
    regrouping = regroup(load_robot("tx40"), seed=77)  # not what is kept for other tests
    assert not certify_formulas(regrouping).valid
    derive.cache_clear()


def test_random_robots_are_a_mix() -> None:
    """The shares printed at the end of the run (tests/conftest.py)."""
    mix = describe_mix(random_robot(seed) for seed in RANDOM)
    assert (
        mix["oblique axes"] >= 0.3
        and mix["prismatic"] >= 0.3
        and mix["zero or in-plane gravity"] >= 0.2
    )


@pytest.mark.parametrize("seed", sampled(RANDOM, 15, more=20))
def test_random_robots_exactly_and_numerically(seed: int) -> None:
    """Exact rank = SVD rank of the CasADi regressor; coefficients = its least-squares fit to 1e-10."""
    robot = random_robot(seed)
    regrouping = regroup(robot)
    certificate = certify_formulas(regrouping)
    assert certificate.valid, certificate.failures
    check_numerically(robot, regrouping)


def check_numerically(robot: Robot, regrouping: Regrouping) -> None:
    n_states = 3 * len(robot.parameters) // len(robot.joints) + 10
    W, names = lagrange.sampled(robot, n_states, seed=9).W, robot.parameters
    rank, _ = numeric_rank(W)
    assert rank == len(regrouping), robot.name
    columns = [names.index(name) for name in regrouping.own]
    scale = np.linalg.norm(W[:, columns], axis=0)
    fit, *_ = np.linalg.lstsq(W[:, columns] / scale, W, rcond=None)
    K = np.array(
        [
            [
                b.combination[name].value(robot.constants) if name in b.combination else 0.0
                for name in names
            ]
            for b in regrouping.base
        ]
    )
    difference = fit / scale[:, None] - K
    assert np.abs(difference * scale[:, None]).max() <= 1e-10 * np.abs(fit).max(), robot.name


@pytest.mark.parametrize("seed", sampled(RANDOM, 3, more=10))
def test_every_flipped_coefficient_of_the_random_robots_is_caught(seed: int) -> None:
    certified_as_it_is_alone(regroup(random_robot(seed)))
