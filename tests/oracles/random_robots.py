"""Random serial and tree robots of 2 to 7 frames: the cases that published arms leave out.

A seed gives one robot. Lengths and some angles are constants with distinct default values; some
lengths are zero. Parallel,
perpendicular and oblique axes, fixed frames, branches, offsets of theta, four kinds of gravity,
coupled elements, massless links.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np
from hypothesis import strategies as st

from symgen.description.expression import ONE, ZERO, Expression, quarter_turns
from symgen.description.grammar import parse
from symgen.description.robot import FIXED, INERTIAL, PRISMATIC, REVOLUTE, Element, Frame, Robot

Array = np.ndarray[Any, Any]
Generator = np.random.Generator
OBLIQUE = ("0.7", "-1.1", "0.4", "1.3", "-0.35", "pi/3", "-pi/4", "1.9")


class _Constants:
    """Constants handed out on demand, with distinct values."""

    def __init__(self, rng: Generator) -> None:
        self.values: dict[str, float] = {}
        self._lengths = list(rng.permutation(np.arange(13, 99, 3)) / 100)
        self._angles = list(
            rng.permutation([0.31, 0.52, 0.83, 1.01, 1.22, 2.03, -0.44, -0.67, -1.27, -2.11])
        )

    def length(self, name: str) -> Expression:
        self.values[name] = float(self._lengths.pop())
        return Expression.symbol(name)

    def angle(self, name: str) -> Expression:
        self.values[name] = float(self._angles.pop())
        return Expression.symbol(name)


@cache
def random_robot(seed: int) -> Robot:
    rng = np.random.default_rng([20, seed])
    n = int(rng.choice([2, 3, 4, 5, 6, 7], p=[0.12, 0.22, 0.22, 0.18, 0.14, 0.12]))
    constants = _Constants(rng)
    oblique, tree, offsets = rng.random(3) < [0.45, 0.4, 0.35]
    sigma = _kinds(rng, n)
    ant = [int(rng.choice(j)) if tree and rng.random() < 0.5 else j - 1 for j in range(1, n + 1)]
    places = {int(rng.integers(2, n + 1)) for _ in range(2)} if oblique else set()
    frames = tuple(
        _frame(rng, constants, j, ant[j - 1], sigma[j - 1], j in places, bool(offsets))
        for j in range(1, n + 1)
    )
    gravity = _gravity(rng, constants)
    moving = [f.j for f in frames if f.sigma != FIXED]
    massless = (
        frozenset(
            int(j) for j in rng.choice(np.arange(1, n + 1), rng.integers(1, n), replace=False)
        )
        if rng.random() < 0.15
        else frozenset()
    )
    return Robot(
        name=f"random_{seed}",
        frames=frames,
        gravity=gravity,
        title=f"random robot, seed {seed}",
        constants=constants.values,
        elements=_elements(rng, moving),
        massless=massless,
    )


def _kinds(rng: Generator, n: int) -> list[int]:
    """sigma of every frame, at least two of them moving."""
    prismatic, fixed = rng.random(2) < [0.55, 0.38]
    weights = np.array([0.6, 0.4 if prismatic else 0.0, 0.25 if fixed else 0.0])
    while True:
        sigma = [
            int(s) for s in rng.choice([REVOLUTE, PRISMATIC, FIXED], n, p=weights / weights.sum())
        ]
        if sum(s != FIXED for s in sigma) >= 2:
            return sigma


def _frame(
    rng: Generator,
    constants: _Constants,
    j: int,
    ant: int,
    sigma: int,
    oblique: bool,
    offsets: bool,
) -> Frame:
    def angle(name: str, slanted: bool) -> Expression:
        if slanted:
            return (
                constants.angle(f"{name}{j}")
                if rng.random() < 0.4
                else parse(str(rng.choice(OBLIQUE)))
            )
        return parse(str(rng.choice(["0", "pi/2", "-pi/2", "pi"], p=[0.4, 0.28, 0.28, 0.04])))

    def length(name: str, probability: float) -> Expression:
        if rng.random() >= probability:
            return ZERO
        e = constants.length(f"{name}{j}")
        return -e if rng.random() < 0.25 else e

    branch = ant != j - 1 and rng.random() < 0.7
    gamma, b = (
        (angle("GB", bool(rng.random() < 0.2)), length("LB", 0.5)) if branch else (ZERO, ZERO)
    )
    alpha, d, r = angle("AL", oblique), length("D", 0.55), length("RL", 0.45)
    q = Expression.symbol(f"q{j}")
    theta = ZERO
    if sigma != REVOLUTE or offsets:
        theta = angle("TH", bool(rng.random() < 0.15)) if rng.random() < 0.6 else ZERO
    if sigma == REVOLUTE:
        theta = q + theta
    elif sigma == PRISMATIC:
        r = q + r
    return Frame(j, ant, sigma, int(sigma != FIXED), gamma, b, alpha, d, theta, r)


def _gravity(rng: Generator, constants: _Constants) -> tuple[Expression, Expression, Expression]:
    kind = rng.choice(["z", "plane", "zero", "general"], p=[0.42, 0.2, 0.15, 0.23])
    if kind == "zero":
        return ZERO, ZERO, ZERO
    if kind == "z" or (kind == "plane" and rng.random() < 0.5):
        constants.values["g"] = 9.81
        g = Expression.symbol("g") * int(rng.choice([1, -1]))
        if kind == "z":
            return ZERO, ZERO, g
        return (g, ZERO, ZERO) if rng.random() < 0.5 else (ZERO, g, ZERO)
    constants.values |= {"gx": 3.1, "gy": -4.7}
    if kind == "general":
        constants.values["gz"] = -8.2
    gx, gy, gz = (Expression.symbol(s) for s in ("gx", "gy", "gz"))
    return gx, gy, gz if kind == "general" else ZERO


def _elements(rng: Generator, moving: list[int]) -> tuple[Element, ...]:
    if rng.random() < 0.08:
        return ()
    each = {j: {j: ONE} for j in moving}
    inertia = Element("Ia", "inertia", each, {})
    viscous, coulomb, offset = (
        [Element("FV", "viscous", each, {})],
        [Element("FS", "coulomb", each, {})],
        [Element("OFFSET", "offset", each, {})],
    )
    special, (i, k) = rng.random(), sorted(int(j) for j in rng.choice(moving, 2, replace=False))
    if (
        special < 0.08
    ):  # a motor that also turns with an earlier joint: cross forms, as the wrist of an arm
        cross = {(k, k): ONE, (i, k): ONE, (k, i): ONE}
        inertia = Element(
            "Ia", "inertia", {j: row for j, row in each.items() if j != k}, {k: cross}
        )
        viscous.append(Element("FVM", "viscous", {}, {k: {(i, k): ONE, (k, i): ONE}}))
        coulomb.append(Element("FSM", "coulomb", {k: {i: ONE, k: ONE}}, {}))
    elif special < 0.16:  # the same as a row
        row = {i: parse(str(rng.choice(["1", "-1", "2", "1/3"]))), k: ONE}
        inertia = Element("Ia", "inertia", {**each, k: row}, {})
        coulomb.append(Element("FSM", "coulomb", {k: row}, {}))
    elif special < 0.22:  # friction that depends on the direction of motion
        viscous = [
            Element("FVP", "viscous", each, {}, "positive"),
            Element("FVN", "viscous", each, {}, "negative"),
        ]
    elif special < 0.26:
        coulomb, offset = (
            [
                Element("FSP", "coulomb", each, {}, "positive"),
                Element("FSN", "coulomb", each, {}, "negative"),
            ],
            [],
        )
    elif special < 0.32:
        offset.append(Element("KS", "stiffness", {k: {k: ONE}}, {i: {(i, i): parse("2")}}))
    return (inertia, *viscous, *coulomb, *offset)


def robots(largest: int = 10**6) -> st.SearchStrategy[Robot]:
    """Hypothesis strategy; a failing example shrinks to a small seed, not to a small robot."""
    return st.integers(0, largest).map(random_robot)


def random_state(robot: Robot, samples: int, seed: int) -> tuple[Array, Array, Array]:
    """q within half a turn or 1 m, qd and qdd standard normal; each (samples, n), order
    `robot.moving`.
    """
    rng = np.random.default_rng([21, seed])
    reach = [np.pi if robot.frame(j).sigma == REVOLUTE else 1.0 for j in robot.moving]
    q = rng.uniform(-1, 1, (samples, len(reach))) * reach
    qd, qdd = rng.standard_normal((2, samples, len(reach)))
    return q, qd, qdd


def random_parameters(robot: Robot, seed: int) -> Array:
    """Standard parameters of links that could exist: masses at a few points; elements between 0.1
    and 1, of a cross form a tenth of that: it stays positive. (p,)
    """
    rng = np.random.default_rng([22, seed])
    value: dict[str, float] = {}
    for j in robot.links:
        m, x = rng.uniform(0.2, 1.0, 6), rng.uniform(-0.5, 0.5, (6, 3))
        S = (m[:, None] * x).T @ x
        J, MS = np.trace(S) * np.eye(3) - S, m @ x
        elements = (*J[np.triu_indices(3)], *MS, m.sum())  # XX XY XZ YY YZ ZZ MX MY MZ M
        value |= {f"{p}{j}": v for p, v in zip(INERTIAL, elements, strict=True)}
    cross = {f"{element.family}{j}" for element in robot.elements for j in element.form}
    return np.array(
        [
            value.get(name, rng.uniform(0.1, 1.0) * (0.1 if name in cross else 1.0))
            for name in robot.parameters
        ]
    )


def describe_mix(sample: Iterable[Robot]) -> dict[str, float]:
    """Share of the robots that have each feature, and how many there are."""
    features: list[dict[str, bool]] = [_features(robot) for robot in sample]
    shares = {name: sum(f[name] for f in features) / len(features) for name in features[0]}
    return {"robots": float(len(features)), **shares}


def _features(robot: Robot) -> dict[str, bool]:
    def slanted(e: Expression) -> bool:
        return bool(quarter_turns(e)[1])

    g = [bool(e) for e in robot.gravity]
    inner = [f for f in robot.frames if f.ant]
    special = [
        e
        for e in robot.elements
        if e.family not in ("Ia", "FV", "FS", "OFFSET")
        or e.form
        or any(len(r) > 1 for r in e.along.values())
    ]
    return {
        "tree": any(f.ant != f.j - 1 for f in robot.frames),
        "oblique axes": any(slanted(f.alpha) for f in inner),
        "any oblique angle": any(
            slanted(e) for f in robot.frames for e in (f.alpha, f.gamma, f.theta0)
        ),
        "symbolic angle": any(
            e.symbols for f in robot.frames for e in (f.alpha, f.gamma, f.theta0)
        ),
        "parallel axes": any(not f.alpha for f in inner),
        "perpendicular axes": any(
            quarter_turns(f.alpha)[0] % 2 == 1 and not slanted(f.alpha) for f in inner
        ),
        "prismatic": any(f.sigma == PRISMATIC for f in robot.frames),
        "fixed frame": any(f.sigma == FIXED for f in robot.frames),
        "theta offset": any(f.sigma == REVOLUTE and bool(f.theta0) for f in robot.frames),
        "gamma or b": any(f.gamma or f.b for f in robot.frames),
        "zero gravity": not any(g),
        "gravity in the x-y plane": any(g[:2]) and not g[2],
        "zero or in-plane gravity": not g[2],
        "general gravity": all(g),
        "massless links": bool(robot.massless),
        "no elements": not robot.elements,
        "coupled or special elements": bool(special),
    }


def print_mix(sample: Iterable[Robot]) -> str:
    """The mix as lines of a table."""
    return "\n".join(
        f"{name:30} {share:6.0f}" if name == "robots" else f"{name:30} {100 * share:5.0f} %"
        for name, share in describe_mix(sample).items()
    )
