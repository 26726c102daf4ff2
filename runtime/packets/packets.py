"""Use only rows that are measurements, not rows that repeat an earlier packet.

A log may be faster than the bus that it reads, and a controller may hold its last packet. The rows
in between repeat positions, torques, or both:

    positions         change only with the packets of a bus: the rows of new packets are kept, at
                      the uniform times of the bus (`runtime.packets.ticks`)
    torques alone     the same, if the kept rows explain the torques better; otherwise the drives
                      themselves hold the torque of a slow controller, and every row is measured
    single samples    of a moving joint repeat the one before, and the next step makes up for it
                      (`runtime.packets.held`): such samples are interpolated, or they are missing
                      for a reader that accepts missing positions

A record is refused if its signals come in packets of different times, or if most positions repeat
and new positions come at no uniform times.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from runtime.core.automatic import automatic_cutoff
from runtime.core.least_squares.linear import percent
from runtime.core.least_squares.wls import weighted_system
from runtime.core.missing import Missing
from runtime.core.problem import Note, Problem
from runtime.core.record import JOINT_CHANNELS, Record
from runtime.core.result import Identification
from runtime.core.rows.prepared import stacked
from runtime.ground.check import Check
from runtime.ground.errors import InputError
from runtime.ground.limits import limits
from runtime.ground.part import Part
from runtime.packets.held import held_positions, repeated_mostly
from runtime.packets.ticks import Ticks, changed, ticks_of

LIMIT = limits(__package__)
KIND = "packets"
REMEDY = "log each packet once, with its own time"

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Bus:
    """The slowest bus of a record.

    Attributes
    ----------
    ticks : Ticks
        Rows with a new packet.
    q, tau : bool
        Whether positions and torques change only with packets of this bus or of a faster bus.
    """

    ticks: Ticks
    q: bool
    tau: bool

    @property
    def carries(self) -> str:
        """Signals that change only with packets, in words."""
        return " and ".join(["positions"] * self.q + ["torques"] * self.tau)


@dataclass(frozen=True, eq=False)
class Told(Part):
    """Part on the rows that are left out or replaced because they are no measurements.

    Attributes
    ----------
    sentences : tuple of str
    """

    sentences: tuple[str, ...]

    name = "packets"
    title = "Rows that are no measurement"
    about = "record"

    def checks(self) -> tuple[Check, ...]:
        """Return one check, which is good: the rows that are no measurement do not count."""
        finding = " ".join(self.sentences).rstrip(".")
        return (Check("Is every row a measurement?", "good", finding),)


def packets_told(result: Identification) -> Told | None:
    """Return the part on rows that are no measurements; None if every row is a measurement."""
    note = result.problem.noted(KIND)
    return None if note is None else Told(note.result)


def packets_once(problem: Problem) -> Problem:
    """Use each packet of the records once, and replace samples that a controller held.

    This is a step of the preparation of a problem. Records in which every row is a measurement, and
    poses at rest, are not changed.

    Raises
    ------
    InputError
        Signals whose packets come at different times, or positions that repeat at no uniform times.
    """
    if problem.reader.at_rest:
        return problem
    told: list[str] = []
    records = tuple(_measured(problem, record, told) for record in problem.records)
    unseen = tuple(_measured(problem, record, told) for record in problem.unseen)
    if not told:
        return problem
    note = Note(KIND, " ".join(told), result=tuple(told))
    return problem.changed(note, records=records, unseen=unseen)


def _measured(problem: Problem, record: Record, told: list[str]) -> Record:
    """Return a record without rows that repeat earlier rows; add sentences on the repeated rows to
    `told`.
    """
    bus = slowest_bus(record)
    if bus is not None and (bus.q or _sampled(problem, record, bus.ticks)):
        period, kept = bus.ticks.period, len(bus.ticks.rows)
        told.append(
            f"{record.name}: the {bus.carries} change once in {period:.4g} rows, as if a log of "
            f"{record.rate:.4g} Hz reads a bus of {record.rate / period:.4g} Hz; "
            f"{len(record) - kept} of {len(record)} rows repeat earlier ones and are left out."
        )
        record = at_ticks(record, bus.ticks)
    if any(repeated_mostly(x) for x in record.q.T):
        same = len(record) - 1 - len(changed(record.q))
        raise InputError(
            f"the positions repeat in {same} of {len(record)} rows while the joints move, and new "
            f"ones come at no uniform times, as if a log repeats a slower source; {REMEDY}",
            file=record.file,
        )
    return _without_held(problem, record, told)


def slowest_bus(record: Record) -> Bus | None:
    """Find the slowest bus of a record; None if positions and torques are measured in each row.

    Raise InputError if a signal that changes with packets has no packet at the times of the slowest
    bus.
    """
    signals = [*record.q.T, *([] if record.origin.by_law else record.tau.T)]
    found = [ticks_of(changed(x[:, None]), len(x)) if many_steps(x) else None for x in signals]
    slowest = max(filter(None, found), key=lambda ticks: ticks.period, default=None)
    if slowest is None:
        return None
    for k, ticks in enumerate(found):
        if ticks is not None and not ticks.new_at(slowest.rows):
            other = found.index(slowest)
            raise InputError(
                f"the {_signal(k, record)} changes once in {ticks.period:.4g} rows and the "
                f"{_signal(other, record)} once in {slowest.period:.4g} rows, but in other rows: "
                f"they were measured at different times; {REMEDY}",
                file=record.file,
            )
    return Bus(slowest, any(found[: record.n]), any(found[record.n :]))


def many_steps(x: Array) -> bool:
    """Whether a signal x, shape (N,), changes by more than its smallest step in most changes.

    An encoder that moves slowly changes step by step; the rows between are measurements.
    """
    steps = np.abs(np.diff(x))
    steps = steps[steps > 0]
    return bool(len(steps)) and float(np.median(steps)) > LIMIT.ONE_STEP * float(steps.min())


def at_ticks(record: Record, ticks: Ticks) -> Record:
    """Return the record of the rows with a new packet, at the uniform times of the bus."""
    rows, known, missing = ticks.rows, record.tau_known, record.missing
    return replace(
        record,
        t=record.t[0] + (ticks.start + ticks.period * np.arange(len(rows))) / record.rate,
        q=record.q[rows],
        tau=record.tau[rows],
        rate=record.rate / ticks.period,
        tau_known=None if known is None else known[rows],
        missing=None if missing is None else replace(missing, samples=missing.samples[rows]),
        channels={name: x[rows] for name, x in record.channels.items()},
    )


def _sampled(problem: Problem, record: Record, ticks: Ticks) -> bool:
    """Whether torques that change with packets are samples: rows of new torques fit clearly better.

    Otherwise the drives hold the torque between the ticks of a controller, and all rows are right.
    """
    errors = []
    for one in (at_ticks(record, ticks), record):
        try:
            own = automatic_cutoff(_alone(problem, one))
            system = weighted_system(stacked(own.model, own.prepared), "joint")
        except (InputError, np.linalg.LinAlgError):
            return False
        errors.append(percent(*system.norms(system.solve().X)))
    return bool(errors[0] < LIMIT.SAMPLED_TORQUE * errors[1])


def _alone(problem: Problem, record: Record) -> Problem:
    """Return the problem of one record, whose velocities are differences of its positions."""
    signals = replace(problem.settings.signals, velocity="differences")
    settings = replace(problem.settings, signals=signals)
    return replace(problem, records=(record,), unseen=(), settings=settings)


def _without_held(problem: Problem, record: Record, told: list[str]) -> Record:
    """Replace single samples that repeat the sample before; add a sentence on them to `told`."""
    held = held_positions(record.q)
    held[_long(np.asarray(held.any(axis=1)), LIMIT.BRIDGED * record.rate)] = False
    rows = held.any(axis=1)
    if not rows.any():
        return record
    accepted = problem.reader.missing
    packets = int(np.count_nonzero(np.diff(rows, prepend=False) & rows))
    told.append(
        f"{record.name}: {packets} packets were held: {int(rows.sum())} of {len(record)} rows repeat "
        "earlier positions while the joints move; these are "
        f"{'taken as missing' if accepted else 'replaced by interpolation'}."
    )
    whole = held.all(axis=1)
    if accepted:
        q = np.where(held, np.nan, record.q)
        before = record.missing
        missing = (
            Missing(held) if before is None else replace(before, samples=before.samples | held)
        )
        return replace(record, q=q, missing=missing)
    channels = {
        name: bridged(x, _repeats(x) & whole) if name in JOINT_CHANNELS else x
        for name, x in record.channels.items()
    }
    tau = bridged(record.tau, _repeats(record.tau) & whole)
    q = np.column_stack([bridged(x[:, None], h) for x, h in zip(record.q.T, held.T, strict=True)])
    return replace(record, q=q, tau=tau, channels=channels)


def bridged(x: Array, held: Array) -> Array:
    """Replace the rows `held` of x, shape (N, c), by a cubic spline through the other rows."""
    if not held.any():
        return x
    from scipy.interpolate import CubicSpline  # 60 ms, where it is used

    at, x = np.arange(len(x)), np.array(x)
    x[held] = CubicSpline(at[~held], x[~held])(at[held])
    return x


def _repeats(x: Array) -> Array:
    """Whether each row of x repeats the row before, bool (N,)."""
    return np.append(False, (x[1:] == x[:-1]).all(axis=1))


def _long(rows: Array, longest: float) -> Array:
    """Mark the runs of `rows` that are longer than `longest` samples, bool (N,)."""
    ends = np.flatnonzero(np.diff(rows, prepend=False, append=False)).reshape(-1, 2)
    long = np.zeros(len(rows), dtype=bool)
    for a, b in ends[ends[:, 1] - ends[:, 0] > longest]:
        long[a:b] = True
    return long


def _signal(k: int, record: Record) -> str:
    """Name the signal k of slowest_bus: position or torque of a joint."""
    joint = (record.origin.joints or range(1, record.n + 1))[k % record.n]
    return f"{'position' if k < record.n else 'torque'} of joint {joint}"
