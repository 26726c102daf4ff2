"""A reading of the records: positions and torques as they are if a set of errors of the study is
corrected.

    q'(t) = P q(t f) + p,   tau'_j(t) = [T tau]_j((t + delay_j) f),   t f: instants of the record

f is the factor on the sampling rate. Filters are linear, so that all readings use the same filtered
samples of the records; the robot of a reading is a table of constants for the module of
`symgen.variants`. Each change is written into the study at once (`runtime.mending.edits`), so that
every reading is one that a study can express.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from json import dumps
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from runtime.core.drives import Drives
from runtime.core.record import Record
from runtime.ground.documents import plain
from runtime.ground.limits import limits
from runtime.mending.bound import Bound
from runtime.mending.edits import (
    Lines,
    Place,
    delayed,
    edited,
    monomial,
    of_files,
    rounded,
    with_variable,
)
from runtime.plausible.bodies import Grams, fit_of
from runtime.plausible.case import Case
from runtime.plausible.causes import ENTRY, GRAVITY, Cause, Robot
from runtime.plausible.samples import SIGNALS, Samples
from runtime.plausible.trials import Baseline, baseline_of, regressor

LIMIT = limits(__package__)

Array = np.ndarray

FITTED = {
    "gravity": 2,
    "factor": 1,
    "scale": 1,
    "ratio": 1,
    "zero": 1,
    "angle": 1,
    "length": 1,
    "rate": 1,
}
"""Numbers that a cause fits, by its kind."""
NOT_WRITTEN = ("load", "friction", "offset", "known")
"""Causes that no line of a study corrects."""


@dataclass(frozen=True, eq=False)
class Step:
    """One change of a reading: a cause, or the delays of the torques.

    Attributes
    ----------
    says : str
        Sentence on the error.
    cause : Cause or None
    delay : ndarray, shape (n,), s, or None
    named : bool
        Whether the change was decisive where it was made.
    """

    says: str
    cause: Cause | None = None
    delay: Array | None = None
    named: bool = False

    @property
    def kind(self) -> str:
        """Family of the cause, or delay."""
        return "delay" if self.cause is None else self.cause.kind

    @property
    def subject(self) -> str:
        """What it changes: the same for all amounts of one number."""
        return "delay" if self.cause is None else self.cause.subject or self.cause.says

    @property
    def numbers(self) -> int:
        """Numbers that were fitted: none of a sign or a unit, two of a direction of gravity."""
        if self.cause is None:
            return 0 if self.delay is None else len({*self.delay})
        return FITTED.get(self.cause.kind, 0)


@dataclass(frozen=True, eq=False)
class Data:
    """The samples of the records as they were read, with the rows that are set aside.

    Attributes
    ----------
    case : Case
    samples : Samples
        Filtered samples of all records, at K instants.
    seen, aside : ndarray of bool, shape (K,)
        Instants of the search, and instants set aside before the search. Instants near a border
        between the two belong to neither.
    unseen : Samples or None
        Samples of the validation records.
    place : Place
    """

    case: Case
    samples: Samples
    seen: Array
    aside: Array
    unseen: Samples | None
    place: Place

    @cached_property
    def torques(self) -> list[CubicSpline]:
        """Filtered torques of each record as functions of time, shape (n,) at an instant."""
        return [CubicSpline(one.record.t, one.torque(one.record.tau)) for one in self.case.through]

    def torque(self, t: Array, record: Array) -> Array:
        """Evaluate the filtered torques at instants t of the records of these numbers."""
        tau = np.empty((len(t), self.samples.n))
        for k, spline in enumerate(self.torques):
            own = record == k
            tau[own] = spline(np.clip(t[own], spline.x[0], spline.x[-1]))
        return tau


def set_aside(samples: Samples, margin: float) -> tuple[Array, Array]:
    """Divide the instants of each record into blocks of time; every third block is set aside.

    margin : time on both sides of a border that belongs to no block, s.

    Return two masks, bool (K,): the instants of the search, and the instants set aside.
    """
    seen, aside = np.zeros(len(samples), dtype=bool), np.zeros(len(samples), dtype=bool)
    for number in np.unique(samples.record):
        own = np.flatnonzero(samples.record == number)
        t = samples.t[own] - samples.t[own[0]]
        length = max(float(t[-1]), 1e-12) / LIMIT.BLOCKS
        block = np.minimum(t // length, LIMIT.BLOCKS - 1)
        late = block % 3 == 1
        aside[own] = late
        near = [
            (np.minimum(t + side * margin, t[-1]).clip(0) // length).clip(0, LIMIT.BLOCKS - 1) % 3
            == 1
            for side in (-1, 1)
        ]
        seen[own] = ~(late | near[0] | near[1])
    return seen, aside


@dataclass(frozen=True, eq=False)
class Reading:
    """The records, read by a study with some changes.

    Attributes
    ----------
    data : Data
    study : mapping
        The study with these changes, as plain values.
    P, p, T : ndarray, shape (n, n), (n,) and (n, n)
    rate : float
        Factor on the sampling rate.
    delay : ndarray, shape (n,), s
        Time by which the torques are late, after T.
    constants : mapping of str to float
        Entries of the table of frames, and gravity.
    sides : (str, str)
        Sides of positions and torques.
    units : mapping of str to tuple of str
        Units of the columns q and tau.
    drives : Drives or None
    steps : tuple of Step
        The changes, in their order.
    """

    data: Data
    study: Lines
    P: Array
    p: Array
    T: Array
    rate: float = 1.0
    delay: Array = field(default_factory=lambda: np.zeros(1))
    constants: Mapping[str, float] = field(default_factory=dict)
    sides: tuple[str, str] = ("joint", "joint")
    units: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    drives: Drives | None = None
    steps: tuple[Step, ...] = ()

    @classmethod
    def given(cls, data: Data, study: Lines) -> Reading:
        """Return the reading by the study as it was given."""
        n, case = data.samples.n, data.case
        still = (np.eye(n), np.zeros(n), np.eye(n))
        return cls(
            data,
            study,
            *still,
            delay=np.zeros(n),
            sides=case.sides,
            units=case.column_units,
            drives=data.place.drives,
        )

    @property
    def key(self) -> str:
        """Text that is the same for readings with the same lines of the study."""
        return dumps(plain(self.study), sort_keys=True)

    @property
    def subjects(self) -> frozenset[str]:
        """What the changes change, whatever their amounts."""
        return frozenset(step.subject for step in self.steps)

    @property
    def named(self) -> bool:
        """Whether every change was a named cause: decisive where it was made."""
        return all(step.named for step in self.steps)

    # --- changes ---

    def changed(self, cause: Cause, *, named: bool = False) -> Reading | None:
        """Correct one more error; return None if no study can express the correction."""
        if cause.kind in NOT_WRITTEN:
            return None
        if cause.kind == "zero":
            found = self._zeros(cause)
            if found is None:
                return None
            cause = found
        if ({*cause.constants} & {*self.constants}) - {*GRAVITY}:
            return None  # one number is fitted once
        cause = self._of_columns(self._rounded(cause))
        constants = {**self.constants, **cause.constants}
        delay = self._reordered(cause.T)
        if delay is None:
            return None
        place = replace(self.data.place, drives=self.drives)
        study = edited(self.study, cause, place, {**self._free, **constants})
        if study is None:
            return None
        sides, drives, units = self.sides, self.drives, dict(self.units)
        for key, x in cause.change.items():
            if key.startswith("record.units."):
                name = key.rpartition(".")[2]
                units[name] = (x,) * len(self.p) if isinstance(x, str) else tuple(x)
        if cause.kind == "side":
            q = cause.change.get("record.side", sides[0])
            sides = (q, cause.change.get("record.torque_side", sides[1]) or q)
        if cause.kind == "coupling":
            sides, made = ("motor", "motor"), study["robot"]["drives"]
            drives = Drives(
                np.array(made["ratio"]),
                made.get("offset", 0.0 if drives is None else drives.offset),
                np.ones(len(self.p)),
            )
        order = monomial(of_files(cause, self.sides, self.drives)[0])
        if order is not None and "q" in units and order[0] != [*range(len(self.p))]:
            units["q"] = tuple(units["q"][k] for k in order[0])
        return replace(
            self,
            study=study,
            P=cause.P @ self.P,
            p=cause.P @ self.p + cause.p,
            T=cause.T @ self.T,
            rate=self.rate * cause.rate,
            delay=delay / cause.rate,
            constants=constants,
            sides=sides,
            units=units,
            drives=drives,
            steps=(*self.steps, Step(cause.says, cause, named=named)),
        )

    def late(self, delay: Array, says: str, *, named: bool = False) -> Reading:
        """Read the torques of each joint later by the delay, s, shape (n,)."""
        own = np.round(delay, 4)
        return replace(
            self,
            study=delayed(self.study, own - self.delay),
            delay=own,
            steps=(*self.steps, Step(says, delay=own, named=named)),
        )

    def short(self, delay: Array) -> bool:
        """Whether delays, s, are below a twentieth of every record, by the clock of this reading."""
        lasts = min(float(one.record.t[-1] - one.record.t[0]) for one in self.data.case.through)
        return bool(np.abs(delay).max() < 0.05 * lasts / self.rate)

    def again(self, steps: Sequence[Step]) -> Reading | None:
        """Make the changes `steps` in this reading; return None if one of them cannot be written."""
        reading: Reading | None = self
        for step in steps:
            if reading is None:
                return None
            if step.delay is not None:
                reading = reading.late(step.delay, step.says, named=step.named)
            elif step.cause is not None:
                reading = reading.changed(step.cause, named=step.named)
        return reading

    def _zeros(self, cause: Cause) -> Cause | None:
        """Write the zeros of some joints as entries theta or r of the table of frames."""
        constants = {}
        for j in np.flatnonzero(cause.p):
            frame, turning = self.data.place.joints[j], self.data.place.turning[j]
            key = f"free_{'theta' if turning else 'r'}{frame}"
            if key not in self._free:
                return None
            constants[key] = {**self._free, **self.constants}[key] + float(cause.p[j])
        still = np.zeros(len(self.p))
        return replace(cause, p=still, constants=constants) if constants else None

    @property
    def _free(self) -> Mapping[str, float]:
        variants = self.data.case.variants
        return {} if variants is None else variants.CONSTANTS

    def _rounded(self, cause: Cause) -> Cause:
        """Round the numbers of a cause to the digits that are written."""
        if cause.constants:
            return replace(
                cause,
                constants={
                    key: x
                    if not (ENTRY.fullmatch(key) or key[:10] == "free_theta" or key in GRAVITY)
                    else rounded(x)
                    for key, x in cause.constants.items()
                },
            )
        if cause.kind not in ("factor", "scale", "ratio"):
            return cause
        E = dict(zip("PT", of_files(cause, self.sides, self.drives), strict=True))
        E = {name: np.vectorize(lambda x: float(f"{x:.4g}"))(x) for name, x in E.items()}
        robot = self.robot
        return replace(cause, **robot.positions(E["P"]), **robot.torques(E["T"]))

    def _of_columns(self, cause: Cause) -> Cause:
        """Apply a change of motor positions before the offset of the drives is subtracted, as in a
        file.

        q' = P (q - offset) + offset
        """
        still = np.array_equal(cause.P, np.eye(len(self.p)))
        if still or self.sides[0] != "motor" or self.drives is None:
            return cause
        if cause.kind in ("side", "coupling"):
            return cause
        offset = self.drives.offset
        return replace(cause, p=offset - cause.P @ offset)

    @property
    def robot(self) -> Robot:
        """Joints and drives of this reading, to convert changes of the files to changes at the
        joints.
        """
        robot = Robot(self.data.case.model, None, self.sides)
        if self.drives is not None:
            robot.R, robot.offset = self.drives.ratio, self.drives.offset
        return robot

    def _reordered(self, T: Array) -> Array | None:
        """Delays of the joints after a change T of the torques; None if T mixes torques that are
        late.
        """
        if len({*self.delay}) == 1:
            return self.delay
        found = monomial(T)
        return None if found is None else self.delay[found[0]]

    def of_robot(self, path: tuple[str | int, ...]) -> Any:
        """Return an entry of the robot file with the value in this reading; None if there is no
        such entry.
        """
        free = {**self._free, **self.constants}
        if path == ("gravity",):
            return [free.get(key, 0.0) for key in GRAVITY]
        if path[0] == "frames" and (key := f"free_{path[2]}{path[1]}") in free:
            return with_variable(str(path[2]), int(path[1]), free[key], self.data.place)
        if path[0] == "drives" and self.drives is not None:
            return plain(getattr(self.drives, str(path[1])))
        return None

    # --- samples and fits ---

    def samples(self, which: Array | None = None, raw: Samples | None = None) -> Samples:
        """Read the samples `which` of the records, or the samples of the validation records."""
        raw = self.data.samples if raw is None else raw
        if which is not None:
            raw = replace(raw, **{name: getattr(raw, name)[which] for name in SIGNALS})
        tau = raw.tau @ self.T.T
        if self.delay.any() and raw.record.max(initial=-1) < len(self.data.case.through):
            for j, late in enumerate(self.delay):
                shifted = self.data.torque(raw.t + late * self.rate, raw.record)
                tau[:, j] = shifted @ self.T[j]
        mixed = np.abs(self.P.T) > 1e-12
        return replace(
            raw,
            t=raw.t / self.rate,
            q=raw.q @ self.P.T + self.p,
            qd=self.rate * raw.qd @ self.P.T,
            qdd=self.rate**2 * raw.qdd @ self.P.T,
            tau=tau,
            steady=~(~raw.steady @ mixed),
            still=np.array([raw.still[own].all() for own in mixed.T]),
        )

    @cached_property
    def model(self) -> Any:
        """The model of this reading; if `variants` is given, its columns are the standard
        parameters.
        """
        case = self.data.case
        return case.model if case.variants is None else Bound(case.variants, self.constants)

    def regressor(self, samples: Samples) -> Array:
        """Compute the regressor at samples of this reading, shape (K, n, p)."""
        return regressor(self.model, (samples.q, samples.qd, samples.qdd))

    def fitted(self, *, values: bool = True) -> Baseline | None:
        """Fit the rows of the search; None if the model cannot be evaluated there.

        values : whether the fit stays near the values of the robot file.
        """
        samples = self.samples(self.data.seen)
        try:
            D = self.regressor(samples)
            return baseline_of(
                self.model,
                samples,
                D,
                None if self.data.case.variants is None else self.model,
                torque_side=self.sides[1],
                values=values,
            )
        except (ValueError, np.linalg.LinAlgError):
            return None

    @cached_property
    def baseline(self) -> Baseline | None:
        """Fit of the rows of the search by a physical robot near the values of the robot file."""
        return self.fitted()

    @cached_property
    def alone(self) -> Baseline | None:
        """Fit of the rows of the search by a physical robot, without the values of the robot file."""
        if self.data.case.robot_values is None:
            return self.baseline
        return self.fitted(values=False)

    @cached_property
    def error(self) -> float:
        """Error of the rows of the search, %: root mean square over the joints."""
        return np.inf if self.baseline is None else over_joints(self.baseline.given.errors)

    def score(self, N: float) -> float:
        """Minus the log-likelihood of the rows of the search, nats, plus a penalty for each change.

        N : number of independent rows of a joint. Errors are relative to the torques of the
        reading, so that readings with other torques can be compared.
        """
        if self.baseline is None:
            return np.inf
        fit = self.baseline.given
        errors = np.maximum(fit.errors, 100 * LIMIT.RESIDUAL_LEAST)
        moving = self.baseline.as_given[2].any(axis=0)
        return float(N * np.log(errors[moving] / 100).sum() + fit.penalty + self.price(N))

    def price(self, N: float) -> float:
        """Price of the changes, nats: of each change, and half of log N of each fitted number."""
        numbers = sum(step.numbers for step in self.steps)
        return float(LIMIT.CHANGE_PRICE * len(self.steps) + numbers * np.log(max(N, 1.0)) / 2)

    @property
    def unseen_error(self) -> float:
        """Error of the rows that are set aside, %: root mean square over the joints."""
        return self.unseen[0]

    @property
    def unseen_total(self) -> float:
        """Error of the rows that are set aside, % of all torques."""
        return self.unseen[1]

    @cached_property
    def unseen(self) -> tuple[float, float]:
        """Errors of the rows that are set aside, %, by the fit of the rows of the search.

        The result is the root mean square over the joints, and the share of all torques; each is
        the larger value of the records and the validation records.
        """
        if self.baseline is None:
            return np.inf, np.inf
        parts = [self.samples(self.data.aside)]
        if self.data.unseen is not None:
            parts.append(self.samples(raw=self.data.unseen))
        errors = [self._predicted(part) for part in parts]
        return max(e for e, _ in errors), max(e for _, e in errors)

    def _predicted(self, samples: Samples) -> tuple[float, float]:
        assert self.baseline is not None
        try:
            other = replace(self.baseline, samples=samples, D=self.regressor(samples))
        except ValueError:
            return np.inf, np.inf
        grams = Grams.of(*other.as_given, other.tau)
        fit = fit_of(other.standard(grams), self.baseline.given.X, 1.0)
        sizes = np.sqrt(grams.measured)
        total = np.linalg.norm(fit.errors * sizes) / np.linalg.norm(sizes)
        return over_joints(fit.errors[grams.rows > 0]), float(total)


def over_joints(errors: Array) -> float:
    """Root mean square of the errors of the joints, %; each counts 1000 % at most."""
    return float(np.sqrt(np.mean(np.minimum(errors, 1000.0) ** 2)))


def best_of(readings: Sequence[Reading], N: float) -> Reading:
    """Return the reading with the best score; of several alike, that with the fewest changes."""
    return min(readings, key=lambda one: (one.score(N), len(one.steps)))


def record_of(reading: Reading, record: Record) -> Record:
    """Read one record: positions, torques and clock after all changes."""
    P, p, f = reading.P, reading.p, reading.rate
    tau = record.tau @ reading.T.T
    t, kept = record.t, slice(None)
    if reading.delay.any():
        period = float(t[-1] - t[0]) / (len(t) - 1) / f
        late = reading.delay
        first = int(np.ceil(max(0.0, -late.min()) / period - 1e-9))
        last = len(t) - int(np.ceil(max(0.0, late.max()) / period - 1e-9))
        kept = slice(first, last)
        at = [np.clip(t + d * f, t[0], t[-1]) for d in late]
        tau = np.stack([CubicSpline(t, x)(own) for x, own in zip(tau.T, at, strict=True)], axis=1)
    channels = dict(record.channels)
    for key in ("qd", "qd_ref"):
        if key in channels:
            channels[key] = f * channels[key] @ P.T
    if "q_r" in channels:
        channels["q_r"] = channels["q_r"] @ P.T + p
    known = record.tau_known
    return Record(
        t[kept] / f,
        (record.q @ P.T + p)[kept],
        tau[kept],
        name=record.name,
        tau_known=None if known is None else known[kept],
        channels={key: x[kept] for key, x in channels.items()},
        origin=replace(record.origin, sides=reading.sides),
    )
