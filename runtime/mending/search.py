"""Search for the changes of a study that explain the rows of the search: a beam of few readings.

The search continues from each reading with the causes that explain its rows better
(`runtime.plausible`), patterns of reversed torques, another direction of gravity, and delays. While
the error is large, the evidence for a step need not be decisive: a second error hides a part of the
gain of the first correction, and a wrong correction may gain more. If the error is small, only
named causes are tried.

Then each number of the best reading is searched again beside all other changes, because it was
fitted while another error was still there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from runtime.ground.limits import limits
from runtime.ground.progress import at
from runtime.mending.gravity import tilted
from runtime.mending.late import late_torques
from runtime.mending.reading import Reading, Step, best_of
from runtime.mending.reversed import reversed_torques
from runtime.plausible.causes import CAUSES, Cause
from runtime.plausible.known import known_values
from runtime.plausible.trials import DEAR, decisive, leaves_values, try_causes

BY_VALUES = ("unit", "side")
"""Kinds of causes that the values of the robot file alone may show: they fit no number."""
LIMIT, TRIED = limits(__package__), limits("runtime.plausible")


@dataclass(eq=False)
class Search:
    """Readings that a search has fitted, and those that it has gone on from.

    Attributes
    ----------
    start : Reading
        The study as given.
    spent : function that returns the processor time so far, s
    readings : dict of str to Reading
        Those that gained, by their key.
    N : float
        Number of independent rows of a joint, the largest of all readings.
    tried : dict of str to (list of Reading, tuple of Cause)
        What `further` made of a reading, by its key.
    known : dict of str to Reading
        Readings with fewer changes than another one, by their key.
    """

    start: Reading
    spent: Callable[[], float]
    readings: dict[str, Reading] = field(default_factory=dict)
    N: float = 1.0
    tried: dict[str, tuple[list[Reading], tuple[Cause, ...]]] = field(default_factory=dict)
    known: dict[str, Reading] = field(default_factory=dict)

    def without(self, reading: Reading, step: Step) -> Reading | None:
        """Leave out what one change changes; None if the others cannot be written alone."""
        fewer = self.start.again([one for one in reading.steps if one.subject != step.subject])
        return None if fewer is None else self.known.setdefault(fewer.key, fewer)

    @property
    def best(self) -> Reading:
        """The reading that explains the rows of the search best."""
        return best_of([self.start, *self.readings.values()], self.N)

    def further(self, reading: Reading) -> list[Reading]:
        """Fit the readings with one more change than this one, once."""
        if reading.key not in self.tried:
            at(f"repair: reading {len(self.tried) + 1}, {self.spent():.0f} s of processor time")
            made, hidden = further(reading)
            self.tried[reading.key] = [one for one in made if one.baseline is not None], hidden
        return self.tried[reading.key][0]

    def hidden(self, reading: Reading) -> tuple[Cause, ...]:
        """Changes that no fit can distinguish from a reading."""
        self.further(reading)
        return self.tried[reading.key][1]

    def from_start(self) -> None:
        """Go on from a beam of readings, one change after the other."""
        beam = [self.start]
        for _ in range(LIMIT.MOST_CHANGES):
            pool: dict[str, Reading] = {}
            for reading in beam:
                if len(self.tried) == LIMIT.READINGS_EXPANDED:
                    break
                for one in self.further(reading):
                    if one.key not in self.readings and one.key != self.start.key:
                        pool.setdefault(one.key, one)
            fits = [one.baseline for one in (*beam, *pool.values())]
            self.N = max([self.N, *(fit.N for fit in fits if fit is not None)])
            worst = max(reading.score(self.N) for reading in beam)
            gaining = [one for one in pool.values() if one.score(self.N) < worst]
            self.readings |= {one.key: one for one in gaining}
            if not gaining:
                break
            gaining = different(gaining, self.N)
            beam = gaining[:1] if gaining[0].error < LIMIT.GOOD_ENOUGH else gaining

    def settled(self, reading: Reading) -> Reading:
        """Search each number again beside all other changes, and one more change, until none gains.

        A number that was fitted while another error was still there has taken up a part of it.
        """
        given = self.start.score(self.N)
        for _ in range(LIMIT.SETTLING):
            reading = self.needed(reading)
            fewer = [self.without(reading, step) for step in reading.steps if step.numbers]
            bases = [base for base in (reading, *fewer) if base is not None]
            around = [
                one
                for base in bases
                for one in self.further(base)
                if len(one.steps) == len(one.subjects) <= LIMIT.MOST_CHANGES
            ]
            self.readings |= {one.key: one for one in around if one.score(self.N) < given}
            before, reading = reading, best_of([reading, *around], self.N)
            if reading is before:
                break
        return self.needed(reading)

    def needed(self, reading: Reading) -> Reading:
        """Leave out each change without which the rows of the search are explained nearly as well.

        A change must gain what names a cause (DECISIVE), and more than nearness to the values of
        the robot file, unless it is a unit or a side.
        """
        least = LIMIT.DECISIVE - LIMIT.CHANGE_PRICE
        for step in reading.steps:
            fewer = self.without(reading, step)
            if fewer is None:
                continue
            by_values = (
                fewer.error < LIMIT.LEAST_FALL * reading.error and step.kind not in BY_VALUES
            )
            if by_values or fewer.score(self.N) <= reading.score(self.N) + least:
                return self.needed(fewer)
        return reading


def different(readings: list[Reading], N: float) -> list[Reading]:
    """Return the readings from which the search continues: the best ones, with different kinds of
    changes first.
    """
    ranked = sorted(readings, key=lambda one: one.score(N))
    kinds: set[str] = set()
    first: list[Reading] = []
    rest: list[Reading] = []
    for one in ranked:
        (rest if one.steps[-1].kind in kinds else first).append(one)
        kinds.add(one.steps[-1].kind)
    return sorted([*first, *rest][: LIMIT.BEAM], key=lambda one: one.score(N))


def simple_rate(factor: float) -> bool:
    """Whether a factor on the sampling rate is a typical result of a wrong rate.

    Other errors make a fitted factor inexact.
    """
    return any(abs(factor / known - 1) < 1e-9 for known in TRIED.RATE_FACTORS)


def other_rates(reading: Reading) -> list[Cause]:
    """Return the causes that change the sampling rate, because a second error may prevent a trial
    from finding them.
    """
    if reading.data.case.noise_floor > TRIED.NOISY:  # small accelerations undo what noise makes
        return []
    robot = reading.robot
    return [
        row.cause(robot, item) for row in CAUSES if row.kind == "rate" for item in row.of(robot)
    ]


def further(reading: Reading) -> tuple[list[Reading], tuple[Cause, ...]]:
    """Make the readings with one more change, and list the changes that no fit can distinguish."""
    baseline, case = reading.baseline, reading.data.case
    if baseline is None:
        return [], ()
    trials = try_causes(baseline, reading.sides, reading.units)
    trials = [t for t in trials if t.cause.rate == 1 or simple_rate(t.cause.rate)]
    known = known_values(baseline, rotors=reading.sides[1] != "link")
    if known is not None and known.heavy:
        trials = [t for t in trials if t.cause.kind != "rate"]
    named = decisive(trials, baseline, case.noise_floor, None, reading.alone)
    hidden = tuple(t.cause for t in trials if t.equivalent)
    causes = [(t.cause, True) for t in named]
    good = reading.error < LIMIT.GOOD_ENOUGH
    if not good:
        chosen = {id(t.cause) for t in named}
        others = [
            t
            for t in trials
            if id(t.cause) not in chosen
            and t.fit is not None
            and t.gain + TRIED.RATE_GAIN * (t.cause.kind in DEAR)
            > LIMIT.STEP_GAIN  # has its own price
            and not leaves_values(t.fit, baseline)
        ]
        if case.noise_floor > TRIED.NOISY:  # small accelerations undo what noise makes
            others = [t for t in others if t.cause.kind != "rate"]
        causes += [(t.cause, False) for t in others[: LIMIT.TRIALS_TAKEN]]
        causes += [(cause, False) for cause in (*reversed_torques(reading), *other_rates(reading))]
    if (tilt := tilted(reading)) is not None:
        turned = baseline.trial(tilt)
        turned = replace(turned, gain=turned.gain - np.log(baseline.N))  # of two angles
        sure = bool(decisive([turned], baseline, case.noise_floor, None, reading.alone))
        causes += [(tilt, sure)] if sure or not good else []
    made = [reading.changed(cause, named=sure) for cause, sure in causes]
    if (late := late_torques(reading)) is not None:
        made.append(reading.late(*late, named=True) if reading.short(late[0]) else None)
    return [one for one in made if one is not None], hidden
