"""Search for the changes of a study that explain the rows of the search: a beam of few readings.

The search continues from each reading with the causes that explain its rows better
(`runtime.plausible`), patterns of reversed torques, another direction of gravity, and delays. While
the error is large, the evidence for a step need not be decisive: a second error hides a part of the
gain of the first correction, and a wrong correction may gain more. If the error is small, only
named causes are tried.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from runtime.ground.limits import limits
from runtime.ground.progress import at
from runtime.mending.gravity import tilted
from runtime.mending.late import late_torques
from runtime.mending.reading import Reading, best_of
from runtime.mending.reversed import reversed_torques
from runtime.plausible.causes import CAUSES, Cause
from runtime.plausible.trials import DEAR, decisive, leaves_values, try_causes

LIMIT, TRIED = limits(__package__), limits("runtime.plausible")


@dataclass(frozen=True, eq=False)
class Found:
    """Readings that a search has fitted.

    Attributes
    ----------
    readings : dict of str to Reading
        Readings by their key; the first is the given study.
    N : float
        Number of independent rows of a joint, the largest of all readings.
    expanded : int
        Number of readings for which all causes were tried.
    hidden : dict of str to tuple of Cause
        Changes that no fit can distinguish from a reading, by its key.
    """

    readings: dict[str, Reading]
    N: float
    expanded: int
    hidden: dict[str, tuple[Cause, ...]]

    @property
    def best(self) -> Reading:
        """The reading that explains the rows of the search best."""
        return best_of([*self.readings.values()], self.N)


def search(start: Reading, spent: Callable[[], float]) -> Found:
    """Search for the readings that explain the rows of the search better than the study as given.

    spent : function that returns the processor time so far, s.
    """
    every = {start.key: start}
    hidden: dict[str, tuple[Cause, ...]] = {}
    beam, expanded, N = [start], 0, 1.0
    for step in range(1, LIMIT.MOST_CHANGES + 1):
        pool: dict[str, Reading] = {}
        for reading in beam:
            if expanded == LIMIT.READINGS_EXPANDED:
                break
            at(
                f"repair: change {step}, reading {expanded + 1} of at most "
                f"{LIMIT.READINGS_EXPANDED}, {spent():.0f} s of processor time"
            )
            expanded += 1
            candidates, hidden[reading.key] = further(reading)
            for one in candidates:
                if one.key not in every and one.baseline is not None:
                    pool.setdefault(one.key, one)
        fits = [one.baseline for one in (*beam, *pool.values())]
        N = max([N, *(fit.N for fit in fits if fit is not None)])
        worst = max(reading.score(N) for reading in beam)
        gaining = [one for one in pool.values() if one.score(N) < worst]
        every |= {one.key: one for one in gaining}
        if not gaining:
            break
        gaining = different(gaining, N)
        beam = gaining[:1] if gaining[0].error < LIMIT.GOOD_ENOUGH else gaining
    return Found(every, N, expanded, hidden)


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
    if case.robot_values is not None and case.robot_values.heavy:
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
        causes.append((tilt, True))
    made = [reading.changed(cause, named=sure) for cause, sure in causes]
    if (late := late_torques(reading)) is not None:
        made.append(reading.late(*late, named=True) if reading.short(late[0]) else None)
    return [one for one in made if one is not None], hidden
