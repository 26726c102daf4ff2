"""Simulate records in which some encoders are coarse and the others exact, and estimate X anew.

    error of encoder i, as read
            e_i = reader(rounded(x_i)) - reader of the record, filtered alike
    states with the encoders S coarse   those of the record + sum over i in S of (R^-1)_i e_i
    change at Delta
            mean of the least squares, over that of the record on the same rows, less 1

A reader of counts leaves out rows in which dry friction has no certain direction. The effect of
this choice of rows is no error of the encoder and is not part of the change;
`runtime.core.cestac.cestac`, which compares with all rows of the record, includes both.

The mean over the random phase of law phase is a quadrature. Its nodes (phases) are equidistant, and
shuffled from encoder to encoder, so that harmonics of the sawtooth that are linear in the estimate
cancel; the bias is left. Each refinement adds as many nodes again, in the middle between the known
nodes. One reading of all encoders serves every choice S. The first phase gives the errors of the
counts and the knots of the motion, which the other phases use again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from runtime.advisor.advice import Sampled, sampled
from runtime.core.cestac.perturbed import PreparedRecord, Task, prepared_record
from runtime.core.cestac.rounding import Mode, counted, rounded, stream
from runtime.core.drives import Drives, encoder_drives, encoder_root
from runtime.core.least_squares.method import linear_system
from runtime.core.missing import require_positions
from runtime.core.problem import Problem
from runtime.core.rows.observation import stack
from runtime.core.rows.prepared import observation_of
from runtime.core.rows.selection import certain_rows
from runtime.core.signals.filters import SpeedErrors, States, filtered_states
from runtime.core.signals.reader import Reader
from runtime.counts.own_encoder import own_encoder
from runtime.counts.reader import encoder_position
from runtime.ground.limits import limits

LIMIT = limits(__package__)

Array = np.ndarray

QUADRATURE = 1 << 20  # number of the first stream of the nodes: beyond those of runs


@dataclass(frozen=True, eq=False)
class Encoders:
    """Encoder positions of one record, and the joint states q, qd, qdd computed from the positions.

    Attributes
    ----------
    record : PreparedRecord
    x : ndarray, shape (N, n), rad or m
        Positions at the encoders as measured.
    states : States
        States of the joints, as measured.
    at_encoders : States
        The same states on the side of the encoders.
    known : dict
        By step and encoders, results of the first phase that make reading other phases faster.
    """

    record: PreparedRecord
    x: Array
    states: States
    at_encoders: States
    known: dict[tuple[float, ...], Any] = field(default_factory=dict)


class CoarseEncoders:
    """Simulation of coarser encoders on the records of one robot.

    A given rounding law and a given reader replace those of the study.
    """

    def __init__(
        self,
        problem: Problem,
        names: Sequence[str],
        drives: Drives | None,
        law: Mode,
        reader: Reader,
    ) -> None:
        model, study = problem.model, problem.settings
        signals = study.signals
        if reader != problem.reader:
            signals = replace(signals, options={}, **problem.reader.own_settings)
        settings = replace(study.cestac, rounding=law, delta=())
        study = reader.settled(replace(study, signals=signals, cestac=settings))
        side = encoder_drives(settings.side, drives, "cestac")
        self.reader, self.root, self.parts = reader, encoder_root(side, len(model.JOINTS)), []
        into = np.linalg.inv(self.root).T
        readings = problem.changed(settings=study, reader=reader).prepared
        for own in readings:
            require_positions(own.record.missing, "advice on encoders", own.record.file)
            part = prepared_record(own, study, own_encoder, drives)
            read = part.states
            if reader.motion is None:  # without recorded velocities, as the errors below
                read = filtered_states(own.record.q, own.record.rate, part.selection.signals)
            states = replace(read, errors=None, channels=own.channels)
            q = encoder_position(states.q, side)
            at_encoders = States(q, states.qd @ into, states.qdd @ into)
            x = encoder_position(own.record.q, side)
            self.parts.append(Encoders(part, x, states, at_encoders))
        self.task = Task(
            tuple(part.record for part in self.parts),
            model,
            tuple(names),
            replace(study.estimate, columns="all"),
            settings,
            (),
            drives,
            reader,
            problem.methods,
        )
        self.columns = self.task.columns
        self.exact = [(part.states, part.record.selection.mask) for part in self.parts]
        self.reference = self._solved(self.exact)

    @property
    def coarsest(self) -> Array:
        """Largest encoder steps that the recorded motion can simulate, shape (n,), rad or m.

        The motion of the encoder contains at least a few steps of this size (LINES_IN_MOTION of the
        limits); inf for an encoder at rest.
        """
        spans = np.min([np.ptp(part.x, axis=0) for part in self.parts], axis=0)
        return np.where(spans > 0, spans / LIMIT.LINES_IN_MOTION, np.inf)

    @property
    def phases(self) -> int:
        """First number of nodes (phases) of the quadrature."""
        values = self.reader.motion is None
        return int(LIMIT.PHASES_OF_POSITIONS if values else LIMIT.PHASES_OF_COUNTS)

    @property
    def finest(self) -> float:
        """Smallest encoder step that can be simulated with the recorded positions, rad or m.

        The step is several times (EXACT_FROM in limits.toml) the largest step of the encoders that
        made the records, so that the recorded positions are exact in comparison; 0 if those
        encoders are unknown.
        """
        own = (part.record.own for part in self.parts)
        steps = (float(encoder.step.max()) for encoder in own if encoder is not None)
        return float(LIMIT.EXACT_FROM * max(steps, default=0.0))

    def asked(self, delta: float) -> Array:
        """Compute the mean change of the estimate if all moving encoders have the step `delta`.

        Return the change, shape (b,), %; nan if the records do not allow this step.
        """
        moving = [i for i, most in enumerate(self.coarsest) if np.isfinite(most)]
        if self.finest * (1 - 1e-9) <= delta <= self.coarsest.min():
            try:
                return np.asarray(mean_change(self.ratios(self.nodes(delta, moving), moving))[0])
            except np.linalg.LinAlgError:  # a step that this reader does not resolve
                pass
        return np.full(len(self.reference), np.nan)

    def locking(self, delta: Array) -> Array:
        """Compute the power of rounding errors behind the low-pass filter, relative to white noise.

        The rounding error is a sawtooth. The result, shape (m,), is the largest power of all
        records and speeds.

        delta : steps of the encoders, shape (m,).

        Harmonic h of the error of a count has the frequency h |qd|/Delta and a power proportional
        to 1/h^2. After sampling, its frequency is the distance from h |qd|/Delta to the nearest
        multiple of the rate. If a joint keeps a speed that is a simple fraction of a step per
        sample, the error is constant.
        """
        h = np.arange(1, LIMIT.SAWTOOTH_HARMONICS + 1)
        weight, most = 1 / h**2 / np.sum(1 / h**2), np.zeros(len(delta))
        for part in self.parts:
            rate, low = part.record.record.rate, part.record.selection.signals.lowpass
            band = 1.0 if low is None else 2 * low.hertz / rate
            every = max(1, len(part.x) // LIMIT.SPEEDS_COMPARED)
            speed = np.abs(part.at_encoders.qd[::every]) / rate  # per sample
            for k, step in enumerate(delta):
                turns = h[:, None, None] * speed / step
                passed = (np.abs(turns - np.round(turns)) < band / 2).mean(axis=1)
                most[k] = max(most[k], float((weight @ passed).max()) / band)
        return most

    def nodes(self, delta: float, moving: Sequence[int], read: int = 0) -> list[list[Array]]:
        """Compute errors of q, qd and qdd for several offsets (phases) of simulated encoder lines.

        These phases are the nodes of a quadrature. At first there are `phases` nodes. If `read` nodes
        are known already, as many new ones are computed, in the middle between the known ones.

        moving : numbers of the coarse encoders.
        """
        few, seed, n = self.phases, self.task.settings.seed, len(self.root)
        count, first = read or few, stream(seed, QUADRATURE).random(n)
        order = [stream(seed, QUADRATURE + i + n * read).permutation(count) for i in range(n)]
        phases = (np.transpose(order) + ((first * read / few + 0.5) % 1 if read else first)) / count
        return [
            self._counts(delta, delta * own, moving, (QUADRATURE, read + k))
            for k, own in enumerate(phases)
        ]

    def ratios(self, nodes: Sequence[Sequence[Array]], encoders: Sequence[int]) -> Array:
        """Compute the estimate X with some encoders coarse, divided by X with exact encoders.

        encoders : numbers of the coarse encoders.

        nodes : errors of every record, for each phase of the encoder lines.

        Return one row for each phase, shape (count, b).
        """
        return np.array([self._ratio(errors, encoders) for errors in nodes])

    def sampled(self, encoders: Sequence[int], delta: float, runs: int | None = None) -> Sampled:
        """Run CESTAC with the step `delta` on the given encoders, while the others are exact.

        Eqs. (17), (18), (21).

        runs : number of runs; default: that of the settings.
        """
        draw = self._counted_at_random if self.task.settings.rounding == "phase" else self._rounded
        ratios = [
            self._ratio(draw(delta, encoders, run), encoders)
            for run in range(runs or self.task.settings.runs)
        ]
        return sampled(delta, np.array(ratios))

    def _rounded(self, delta: float, encoders: Sequence[int], run: int) -> list[Array]:
        """Draw random errors of q, qd and qdd for encoders that round each sample independently.

        The random numbers of an encoder do not depend on which other encoders are coarse.
        """
        seed, law = self.task.settings.seed, self.task.settings.rounding
        drawn = [
            [rounded(part.x[:, i], delta, law, stream(seed, k, run, i)) for i in encoders]
            for k, part in enumerate(self.parts)
        ]
        return self._read(drawn, encoders, delta)

    def _counted_at_random(self, delta: float, encoders: Sequence[int], run: int) -> list[Array]:
        """Draw errors of q, qd and qdd for encoders that count lines at random offsets (phases)."""
        phases = stream(self.task.settings.seed, run, *encoders).random(len(self.root))
        return self._counts(delta, delta * phases, encoders, (run, *encoders, 0))

    def _counts(
        self, delta: float, phases: Array, encoders: Sequence[int], key: tuple[int, ...]
    ) -> list[Array]:
        """Compute errors of q, qd and qdd for encoders that count lines at the given offsets.

        key : selects the random numbers of uneven lines, which are the same in every record.
        """
        seed, uneven = self.task.settings.seed, self.task.settings.uneven
        drawn = [
            [counted(part.x[:, i], delta, phases[i], uneven, rng) for i in encoders]
            for part, rng in ((part, stream(seed, *key)) for part in self.parts)
        ]
        return self._read(drawn, encoders, delta)

    def _read(
        self, drawn: Sequence[Sequence[Array]], encoders: Sequence[int], delta: float
    ) -> list[Array]:
        """Compute the errors of q, qd and qdd that follow from simulated encoder positions.

        drawn : for every record, the positions of each coarse encoder, shape (N,).

        Return for every record the errors of q, qd, qdd and the standard deviation of qd, on the
        side of the encoders, shape (4, n, N); zero for exact encoders.
        """
        of_records, key, chosen = [], (delta, *encoders), list(encoders)
        for part, columns in zip(self.parts, drawn, strict=True):
            y, errors = np.column_stack(columns), np.zeros((4, *part.x.T.shape))
            rate = part.record.record.rate
            if self.reader.motion is not None:
                y, deviation, known = self.reader.motion(y, rate, delta, part.known.get(key))
                part.known.setdefault(key, known)
                errors[3].T[:, chosen] = deviation
            read = filtered_states(y, rate, part.record.selection.signals)
            errors[:3, chosen] = [
                read.q.T - part.at_encoders.q.T[chosen],
                read.qd.T - part.at_encoders.qd.T[chosen],
                read.qdd.T - part.at_encoders.qdd.T[chosen],
            ]
            of_records.append(errors)
        return of_records

    def _ratio(self, errors: Sequence[Array], encoders: Sequence[int]) -> Array:
        """Compute the estimate X with errors of some encoders, divided by X without, shape (b,).

        Both are estimated on the same rows.
        """
        chosen = np.isin(np.arange(len(self.root)), list(encoders))
        coarse, exact = [], []
        for part, error in zip(self.parts, errors, strict=True):
            q, qd, qdd = (self.root * chosen) @ error[:3]
            own, selection = part.states, part.record.selection
            states = replace(own, q=own.q + q.T, qd=own.qd + qd.T, qdd=own.qdd + qdd.T)
            speeds = replace(states, errors=SpeedErrors(error[3].T * chosen, self.root))
            rows = speeds[selection.samples][selection.kept]
            certain = selection.mask & certain_rows(self.task.model, rows)
            coarse.append((states, certain))
            exact.append((own, certain))
        if not any(mask.any() for _, mask in exact):
            raise np.linalg.LinAlgError(
                "the direction of the dry friction is uncertain at every sample"
            )
        every = all(np.array_equal(x[1], y[1]) for x, y in zip(self.exact, exact, strict=True))
        return np.asarray(self._solved(coarse) / (self.reference if every else self._solved(exact)))

    def _solved(self, parts: Sequence[tuple[States, Array]]) -> Array:
        """Solve least squares for X from the states q, qd and qdd of every record.

        Each part has the states of a record and the mask of its rows, bool (n, K).
        """
        rows = [
            observation_of(
                self.columns,
                states,
                record.torque,
                replace(record.selection, mask=mask),
                files=record.record.files,
            )
            for (states, mask), record in zip(parts, self.task.records, strict=True)
        ]
        return linear_system(stack(rows), self.task.estimate, self.task.methods).solve().X


def mean_change(ratios: Array) -> Array:
    """Compute the mean change of X over encoder offsets (phases), and its standard deviation.

    Return both in one array, shape (2, b), %. The standard deviation is that of the mean, if the
    phases (nodes) were independent.

    ratios : estimates at the nodes over the exact estimate, shape (count, b).
    """
    deviation = ratios.std(axis=0, ddof=1) / np.sqrt(len(ratios))
    return np.asarray(100 * np.array([ratios.mean(axis=0) - 1, deviation]))
