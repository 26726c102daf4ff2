"""Random robots that carry numbers: decimals in place of constants, gears, mimic ratios, square
roots, odd angles.

A seed gives one robot: a random serial or tree robot or parallelogram of this folder, or a star of
slides beside a chain (uneven depth), most of whose constants are replaced by numbers; gears on
motor inertias, friction along random combinations of joints and mimic joints are added.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from oracles.random_parallelograms import random_parallelogram
from oracles.random_robots import random_robot
from symgen.description.expression import ONE, ZERO, Expression
from symgen.description.grammar import parse
from symgen.description.robot import PRISMATIC, REVOLUTE, Element, Frame, Robot
from symgen.description.values import at_values

Generator = np.random.Generator
ROOTS = ("sqrt(3)/2", "sqrt(2)/2", "sqrt(5)/4", "sqrt(3)", "sqrt(0.02)", "sqrt(7)/9")
ANGLES = (
    "pi/6",
    "-pi/3",
    "pi/4",
    "2*pi/5",
    "pi/12",
    "0.123456789*pi",
    "1.0472",
    "0.7854",
    "0.35",
    "-1.2217",
    "0.6108652382",
    "pi/7",
)
GEARS = ("101.25", "1798/7", "100", "80", "-48", "32", "160/3", "0.5", "153.6")


def numeric_robot(seed: int) -> Robot:
    """The robot of a seed."""
    rng = np.random.default_rng([41, seed])
    kind = rng.random()
    if kind < 0.12:
        return numbers_in(random_parallelogram(seed % 400), rng, angles=False)
    robot = _uneven(rng, seed) if kind < 0.2 else random_robot(seed + 5000)
    robot = numbers_in(robot, rng, angles=True)
    robot = _geared(robot, rng)
    if rng.random() < 0.25:
        robot = _mimic(robot, rng)
    return replace(robot, name=f"numeric_{seed}")


def numbers_in(robot: Robot, rng: Generator, *, angles: bool) -> Robot:
    """`robot` with most of its constants as numbers."""
    in_angles = {
        s for f in robot.frames for e in (f.gamma, f.alpha, f.theta0) for s in e.symbols
    } | {s for e in robot.constraints.values() for s in e.symbols}
    symbolic = rng.random() < 0.3
    values: dict[str, Expression] = {}
    for name in robot.constants:
        if symbolic and rng.random() < 0.5:
            continue
        if name in in_angles:
            values[name] = (
                parse(str(rng.choice(ANGLES))) if angles else parse(f"{rng.uniform(0.2, 1.4):.4f}")
            )
        elif name.startswith("g"):
            values[name] = parse(str(rng.choice(["9.80665", "9.81", "6.93", "4.9"])))
        else:
            values[name] = _length(rng)

    return at_values(robot, values)


def _length(rng: Generator) -> Expression:
    kind = rng.random()
    if kind < 0.35:
        return parse(f"{rng.uniform(0.05, 1.2):.3f}")
    if kind < 0.75:
        return parse(f"{rng.uniform(0.05, 1.2):.5f}")
    return (
        parse(str(rng.choice(ROOTS)))
        if kind < 0.9
        else parse(str(rng.choice(["1", "2", "1/3", "0.5"])))
    )


def _geared(robot: Robot, rng: Generator) -> Robot:
    """Motor inertias and frictions behind gears, friction along combinations of two joints."""
    elements = list(robot.elements)
    moving = list(robot.joints)
    if rng.random() < 0.5:
        rows = {j: {j: parse(str(rng.choice(GEARS)))} for j in moving}
        elements.append(Element("IM", "inertia", rows, {}))
        if rng.random() < 0.6:
            elements.append(Element("FM", str(rng.choice(["viscous", "coulomb"])), rows, {}))
    if len(moving) > 1 and rng.random() < 0.4:
        i, k = sorted(int(j) for j in rng.choice(moving, 2, replace=False))
        c = parse(str(rng.choice(["1", "0.5", "1.25", "2/3", "7.5"])))
        elements += [
            Element("FA", "viscous", {i: {i: ONE, k: c}}, {}),
            Element("FB", "coulomb", {i: {i: ONE, k: c}, k: {i: ONE, k: -c}}, {}),
        ]
    return replace(robot, elements=tuple(elements))


def _mimic(robot: Robot, rng: Generator) -> Robot:
    """One joint passive, tied to another by a ratio: a decimal one for a slide, a whole one for a
    hinge.
    """
    moving = [f for f in robot.frames if f.mu]
    if len(moving) < 2 or robot.loops:
        return robot
    k = int(rng.integers(1, len(moving)))
    tied, master = moving[k], moving[int(rng.integers(0, k))]
    ratio = "0.05", "1.25", "-0.4318", "pi/10"
    factor = parse(str(rng.choice(ratio if tied.sigma == PRISMATIC else ("1", "-1", "2"))))
    if tied.sigma == REVOLUTE and master.sigma == PRISMATIC:
        return robot
    offset = parse(f"{rng.uniform(0, 0.5):.3f}") if rng.random() < 0.5 else ZERO
    frames = tuple(replace(f, mu=0) if f.j == tied.j else f for f in robot.frames)
    return replace(
        robot,
        frames=frames,
        constraints={tied.j: factor * Expression.symbol(f"q{master.j}") + offset},
    )


def _uneven(rng: Generator, seed: int) -> Robot:
    """A chain beside a star of slides, most of them massless."""
    chain, slides = int(rng.integers(1, 4)), int(rng.integers(4, 16))
    frames: list[Frame] = []
    for j in range(1, chain + slides + 1):
        hinge = j <= chain
        q = Expression.symbol(f"q{j}")
        alpha = parse(str(rng.choice(["0", "pi/2", "-pi/2"]))) if hinge and j > 1 else ZERO
        frames.append(
            Frame(
                j,
                j - 1 if 1 < j <= chain else 0,
                REVOLUTE if hinge else PRISMATIC,
                1,
                ZERO,
                ZERO,
                alpha,
                _length(rng) if j > 1 and hinge else ZERO,
                q if hinge else ZERO,
                ZERO if hinge else q,
            )
        )
    massless = frozenset(j for j in range(chain + 1, chain + slides + 1) if rng.random() < 0.85)
    each = {f.j: {f.j: ONE} for f in frames}
    one = {1: {1: ONE}}
    elements = (
        Element("FV", "viscous", each, {}),
        Element("FS", "coulomb", one, {}),
        Element("OFFSET", "offset", one, {}),
        Element("K", "stiffness", one, {}),
    )
    gravity = (
        (ZERO, parse("-9.80665"), ZERO) if rng.random() < 0.5 else (ZERO, ZERO, parse("-9.81"))
    )
    return Robot(
        name=f"uneven_{seed}",
        frames=tuple(frames),
        gravity=gravity,
        elements=elements,
        massless=massless,
    )


def describe_numbers(sample: Iterable[Robot]) -> dict[str, float]:
    """Share of the robots that have each feature."""

    def features(robot: Robot) -> dict[str, bool]:
        lengths = [e for f in robot.frames for e in (f.b, f.d, f.r0)]
        angles = [e for f in robot.frames for e in (f.gamma, f.alpha, f.theta0)]
        rows = [g for e in robot.elements for row in e.along.values() for g in row.values()]
        return {
            "decimal length": any(c.denominator > 100 for e in lengths for c in e.terms.values()),
            "square root": any("sqrt" in str(e) for e in lengths),
            "no symbol at all": not robot.constants,
            "9.80665": any("9.80665" in str(e) for e in robot.gravity),
            "odd fraction of pi": any(
                "pi" in e.atoms and c.denominator > 2
                for e in angles
                for m, c in e.terms.items()
                if m
            ),
            "decimal angle": any(m == () and c for e in angles for m, c in e.terms.items()),
            "gear": any(abs(float(c)) > 20 for g in rows for m, c in g.terms.items()),
            "combination of joints": any(
                len(row) > 1 for e in robot.elements for row in e.along.values()
            ),
            "mimic": bool(robot.constraints) and not robot.loops,
            "parallelogram": bool(robot.loops),
            "tree": any(f.ant != f.j - 1 for f in robot.frames),
            "uneven": robot.name.startswith("numeric") and len(robot.massless) > 3,
        }

    found = [features(robot) for robot in sample]
    return {name: sum(f[name] for f in found) / len(found) for name in found[0]}
