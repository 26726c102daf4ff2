"""Random arms with one or two planar parallelograms: the cases that the packaged loops leave out.

A seed gives one robot: up to two joints, a parallelogram, up to three joints, sometimes a second
parallelogram. Two kinds:

    driven     crank and arm on one axis, a bar from the crank to the forearm (SR400): forearm parallel to crank, bar to arm
    guided     arm and rocker on two axes of one link, a coupler between their ends: coupler parallel to that link

Alpha of every axis, offsets gamma, b, r, shifts along the axes of the loop, offsets of theta
(quarter turns, constants), direction of the twin,
gravity, friction of passive joints, massless bars and the actuated pair vary; relations are
declared in some and left to be found in others.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from oracles.random_robots import _Constants, _gravity
from symgen.description.expression import ONE, PI, ZERO, Expression
from symgen.description.grammar import parse
from symgen.description.robot import FIXED, PRISMATIC, REVOLUTE, Element, Frame, Loop, Robot

Generator = np.random.Generator
SEEDS = tuple(range(30))


@dataclass
class _Arm:
    """Frames and loops so far; `shape` = (arm, bar) of every parallelogram: frames that keep their
    orientation to each other.
    """

    rng: Generator
    constants: _Constants
    frames: list[Frame] = field(default_factory=list)
    loops: list[Loop] = field(default_factory=list)
    relations: dict[int, Expression] = field(default_factory=dict)
    bars: list[int] = field(default_factory=list)
    slanted: int = 0  # constants among the angles

    def add(self, ant: int, sigma: int, mu: int, **row: Expression) -> int:
        j = len(self.frames) + 1
        q = Expression.symbol(f"q{j}")
        place = {name: row.get(name, ZERO) for name in ("gamma", "b", "alpha", "d", "theta", "r")}
        place["theta"] += q if sigma == REVOLUTE else ZERO
        place["r"] += q if sigma == PRISMATIC else ZERO
        self.frames.append(Frame(j, ant, sigma, mu, **place))
        return j

    def chance(self, probability: float) -> bool:
        return bool(self.rng.random() < probability)

    def length(self, name: str, probability: float = 1.0) -> Expression:
        if not self.chance(probability):
            return ZERO
        return self.constants.length(name) * (-1 if probability < 1 and self.chance(0.3) else 1)

    def turn(self, name: str, probability: float = 0.4) -> Expression:
        """An offset of theta: a quarter turn or, rarely, a constant."""
        if not self.chance(probability):
            return ZERO
        if self.slanted < 2 and self.chance(0.35):
            self.slanted += 1
            return self.constants.angle(name)
        return parse(str(self.rng.choice(["pi/2", "-pi/2", "pi"])))

    def axis(self) -> dict[str, Expression]:
        """Row of a joint somewhere on the link before, without theta and r."""
        j = len(self.frames) + 1
        alpha = parse(str(self.rng.choice(["0", "pi/2", "-pi/2"], p=[0.35, 0.4, 0.25])))
        if self.slanted < 1 and self.chance(0.12):
            self.slanted += 1
            alpha = self.constants.angle(f"AL{j}")
        row = {"alpha": alpha, "d": self.length(f"D{j}", 0.5)}
        if self.chance(0.25):
            row |= {
                "gamma": parse(str(self.rng.choice(["pi/2", "-pi/2", "pi"]))),
                "b": self.length(f"LB{j}", 0.6),
            }
        return row

    def serial(self, ant: int) -> int:
        """One more actuated joint on link `ant`."""
        j = len(self.frames) + 1
        sigma = PRISMATIC if self.chance(0.2) else REVOLUTE
        return self.add(
            ant,
            sigma,
            1,
            **self.axis(),
            r=self.length(f"RL{j}", 0.4),
            theta=self.turn(f"TH{j}", 0.3),
        )

    def driven(self, base: int) -> int:
        """Arm and crank turn about one axis of link `base`; returns the forearm.

        The arm and the bar have length L, the crank and the lever of the forearm K. The bar may run
        in another plane, shifted by E.
        """
        L, K = (
            self.constants.length(f"L{len(self.frames)}"),
            self.constants.length(f"K{len(self.frames)}"),
        )
        E = self.length(f"E{len(self.frames)}", 0.4)
        row, r = self.axis(), self.length(f"RL{len(self.frames)}", 0.4)
        by_crank = self.chance(
            0.85
        )  # else the joint of the forearm is actuated and the crank follows
        turns = [self.turn(f"TH{len(self.frames)}{k}") for k in "ABCDE"]
        arm = self.add(base, REVOLUTE, 1, **row, r=r, theta=turns[0])
        forearm = self.add(arm, REVOLUTE, int(not by_crank), d=L, theta=turns[1])
        crank = self.add(base, REVOLUTE, int(by_crank), **row, r=r + E, theta=turns[2])
        bar = self.add(crank, REVOLUTE, 0, d=K, theta=turns[3])
        cut = self.add(bar, REVOLUTE, 0, d=L, theta=turns[4])
        opposite = self.chance(0.6)  # lever behind the elbow, as in the SR400
        gamma = parse(str(self.rng.choice(["0", "pi/2", "-pi/2"], p=[0.5, 0.3, 0.2])))
        twin = self.add(forearm, FIXED, 0, gamma=gamma, d=-K if opposite else K, r=E)
        self.loops.append(Loop(cut, twin))
        q = {
            j: Expression.symbol(f"q{j}") + theta
            for j, theta in zip((arm, forearm, crank, bar, cut), turns, strict=True)
        }
        lever = gamma + (
            PI if opposite else ZERO
        )  # forearm + lever = crank, bar = arm, cut = forearm + gamma, as angles
        if by_crank:
            self.relations[forearm] = q[crank] - q[arm] - lever - turns[1]
        else:
            self.relations[crank] = q[arm] + q[forearm] + lever - turns[2]
        self.relations[bar] = q[arm] - q[crank] - turns[3]
        self.relations[cut] = q[forearm] + gamma - turns[4]
        self.bars.append(bar)
        return forearm

    def guided(self, base: int) -> int:
        """Arm and rocker turn about parallel axes of link `base`, at a distance K; returns the
        coupler between their ends.
        """
        L, K = (
            self.constants.length(f"L{len(self.frames)}"),
            self.constants.length(f"K{len(self.frames)}"),
        )
        row, r = self.axis(), self.length(f"RL{len(self.frames)}", 0.4)
        turns = [self.turn(f"TH{len(self.frames)}{k}") for k in "ABCD"]
        arm = self.add(base, REVOLUTE, 1, **row, r=r, theta=turns[0])
        coupler = self.add(arm, REVOLUTE, 0, d=L, theta=turns[1])
        rocker = self.add(base, REVOLUTE, 0, **(row | {"d": row["d"] + K}), r=r, theta=turns[2])
        cut = self.add(rocker, REVOLUTE, 0, d=L, theta=turns[3])
        gamma = parse(str(self.rng.choice(["0", "pi/2", "pi"], p=[0.5, 0.3, 0.2])))
        self.loops.append(Loop(cut, self.add(coupler, FIXED, 0, gamma=gamma, d=K)))
        q = {
            j: Expression.symbol(f"q{j}") + theta
            for j, theta in zip((arm, coupler, rocker, cut), turns, strict=True)
        }
        self.relations[coupler] = -q[arm] - gamma - turns[1]
        self.relations[rocker] = q[arm] - turns[2]
        self.relations[cut] = q[arm] + q[coupler] + gamma - q[rocker] - turns[3]
        self.bars.append(rocker)
        return coupler


def random_parallelogram(seed: int) -> Robot:
    """The mechanism of `seed`; for about half of the seeds some or all relations are declared."""
    rng = np.random.default_rng([23, seed])
    arm = _Arm(rng, _Constants(rng))
    tip, double = 0, arm.chance(0.3)
    for _ in range(int(rng.choice([0, 1, 2], p=[0.25, 0.5, 0.25]))):
        tip = arm.serial(tip)
    kinds = [arm.driven, arm.driven, arm.guided]
    tip = kinds[int(rng.integers(3))](tip)
    for _ in range(int(rng.choice([0, 1, 2, 3] if not double else [0, 1]))):
        tip = arm.serial(tip)
    if double:
        tip = kinds[int(rng.integers(3))](tip)
        if arm.chance(0.5):
            arm.serial(tip)
    gravity = _gravity(rng, arm.constants)
    moving = [f.j for f in arm.frames if f.sigma != FIXED]
    actuated = [f.j for f in arm.frames if f.mu]
    rubbing = moving if arm.chance(0.35) else actuated
    each, friction = {j: {j: ONE} for j in actuated}, {j: {j: ONE} for j in rubbing}
    elements = [Element("FV", "viscous", friction, {}), Element("FS", "coulomb", friction, {})]
    if arm.chance(0.8):
        elements.insert(0, Element("Ia", "inertia", each, {}))
    if arm.chance(0.7):
        elements.append(Element("OFFSET", "offset", each, {}))
    return Robot(
        name=f"parallelogram_{seed}",
        frames=tuple(arm.frames),
        gravity=gravity,
        title=f"random parallelogram, seed {seed}",
        constants=arm.constants.values,
        elements=tuple(elements),
        loops=tuple(arm.loops),
        constraints=_declared(arm) if arm.chance(0.45) else {},
        massless=frozenset(arm.bars) if arm.chance(0.3) else frozenset(),
    )


def _declared(arm: _Arm) -> dict[int, Expression]:
    """All relations, or the first alone."""
    return arm.relations if arm.chance(0.6) else dict([next(iter(arm.relations.items()))])
