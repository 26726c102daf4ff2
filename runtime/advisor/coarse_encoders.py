"""Runs of CESTAC with some encoders coarse and the others exact, by one law and one reader.

    error of encoder i, as read
            e_i = reader(rounded(x_i)) - reader of the record, filtered alike
    states with the encoders S coarse   those of the record + sum over i in S of (R^-1)_i e_i
    change at Delta
            mean of the least squares, over that of the record on the same rows, less 1

The reader of counts leaves out rows in which dry friction has no certain direction. What that alone
does to the estimate is no error of the encoder and is not in the change;
`runtime.core.cestac.cestac`, which compares with all rows of the record, has both.

The mean over the random phase of law phase is a quadrature. Its nodes are equidistant, shuffled
from encoder to encoder, so that the harmonics of the sawtooth cancel that are linear in the
estimate; what is left is the bias. Further nodes are as many again, in the middle between those
before. One reading of all encoders serves every choice S, and the first phase read tells the errors
of the counts and the knots of the motion for the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from runtime.advisor.advice import Sampled, sampled
from runtime.core.cestac.perturbed import PreparedRecord, Task, prepared_record
from runtime.core.cestac.rounding import Mode, counted, rounded, stream
from runtime.core.drives import Drives, encoder_drives, encoder_root
from runtime.core.least_squares.method import linear_system
from runtime.core.limits import LIMIT
from runtime.core.missing import require_positions
from runtime.core.problem import Problem
from runtime.core.rows.observation import stack
from runtime.core.rows.prepared import observation_of
from runtime.core.rows.selection import certain_rows
from runtime.core.signals.filters import SpeedErrors, States, filtered_states
from runtime.core.signals.states import Reader, lowpassed
from runtime.counts.own_encoder import own_encoder
from runtime.counts.reader import counted as counted_states
from runtime.counts.reader import encoder_position
from runtime.counts.reading import Starts, read_counts

Array = np.ndarray

ReaderName = Literal["lowpass", "counts"]

READERS: tuple[ReaderName, ...] = ("lowpass", "counts")
STATES: Mapping[ReaderName, Reader] = {"lowpass": lowpassed, "counts": counted_states}
PHASES: Mapping[ReaderName, int] = {
    "lowpass": 8,
    "counts": 4,
}  # nodes of the quadrature over the phase
QUADRATURE = 1 << 20  # number of the first stream of the nodes: beyond those of runs


@dataclass(frozen=True, eq=False)
class Encoders:
    """The encoders of one record.

    Attributes
    ----------
    record : PreparedRecord
    x : ndarray, shape (N, n), rad or m
        Positions at the encoders as measured.
    states : States
        Of the joints, as measured.
    at_encoders : States
        The same at the encoders.
    starts : mapping
        By step and encoders, what the first phase told of the counts of the others.
    """

    record: PreparedRecord
    x: Array
    states: States
    at_encoders: States
    starts: dict[tuple[float, ...], Starts] = field(default_factory=dict)


class CoarseEncoders:
    """Coarser encoders on several records of one robot, by a law and a reader in place of those of the study."""

    def __init__(
        self,
        problem: Problem,
        names: Sequence[str],
        drives: Drives | None,
        law: Mode,
        reader: ReaderName,
    ) -> None:
        model, study = problem.model, problem.settings
        signals = study.signals
        if reader != signals.reader:
            signals = replace(signals, reader=reader, step=None, side="joint")
        settings = replace(study.cestac, rounding=law, delta=(), place="record")
        study = replace(study, signals=signals, cestac=settings)
        side = encoder_drives(settings.side, drives, "cestac")
        self.reader, self.root, self.parts = reader, encoder_root(side, len(model.JOINTS)), []
        into = np.linalg.inv(self.root).T
        readings = problem.changed(settings=study, reader=STATES[reader]).prepared
        for own in readings:
            require_positions(own.record.missing, "advice on encoders", own.record.file)
            part = prepared_record(own, study, own_encoder, drives)
            read = part.states or filtered_states(part.q, part.rate, part.selection.signals)
            states = replace(read, errors=None, channels=part.channels)
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
            STATES[reader],
            problem.methods,
        )
        self.columns = self.task.columns
        self.exact = [(part.states, part.record.selection.mask) for part in self.parts]
        self.reference = self._solved(self.exact)

    @property
    def coarsest(self) -> Array:
        """Largest step of each encoder, shape (n,): LIMIT.LINES_IN_MOTION of them in its motion.

        inf for an encoder at rest.
        """
        spans = np.min([np.ptp(part.x, axis=0) for part in self.parts], axis=0)
        return np.where(spans > 0, spans / LIMIT.LINES_IN_MOTION, np.inf)

    @property
    def finest(self) -> float:
        """Smallest step at which the positions of the records are exact in comparison, rad or m."""
        own = (part.record.own for part in self.parts)
        steps = (float(encoder.step.max()) for encoder in own if encoder is not None)
        return float(LIMIT.EXACT_FROM * max(steps, default=0.0))

    def asked(self, delta: float) -> Array:
        """Mean change if all moving encoders have this step, shape (b,), %; nan if the records do not allow it."""
        moving = [i for i, most in enumerate(self.coarsest) if np.isfinite(most)]
        if self.finest * (1 - 1e-9) <= delta <= self.coarsest.min():
            try:
                return np.asarray(mean_change(self.ratios(self.nodes(delta, moving), moving))[0])
            except np.linalg.LinAlgError:  # a step that this reader does not resolve
                pass
        return np.full(len(self.reference), np.nan)

    def locking(self, delta: Array) -> Array:
        """Power of the rounding error that passes the low-pass, relative to white noise, shape (m,).

        The rounding error is a sawtooth; of all records and speeds the largest power is taken.

        delta, shape (m,).

        Harmonic h of the error of a count has the frequency h |qd|/Delta and a power as 1/h^2;
        sampled, it is as slow as its distance from a multiple of the rate. Where a joint keeps a
        speed that is a simple fraction of a step per sample, the error is constant.
        """
        h = np.arange(1, LIMIT.SAWTOOTH_HARMONICS + 1)
        weight, most = 1 / h**2 / np.sum(1 / h**2), np.zeros(len(delta))
        for part in self.parts:
            rate, low = part.record.rate, part.record.selection.signals.lowpass
            band = 1.0 if low is None else 2 * low.hertz / rate
            every = max(1, len(part.x) // LIMIT.SPEEDS_COMPARED)
            speed = np.abs(part.at_encoders.qd[::every]) / rate  # per sample
            for k, step in enumerate(delta):
                turns = h[:, None, None] * speed / step
                passed = (np.abs(turns - np.round(turns)) < band / 2).mean(axis=1)
                most[k] = max(most[k], float((weight @ passed).max()) / band)
        return most

    def nodes(self, delta: float, moving: Sequence[int], read: int = 0) -> list[list[Array]]:
        """Errors of every record at the first PHASES nodes of the quadrature.

        If `read` nodes are known already, there are as many, in the middle between those.

        The encoders `moving` coarse.
        """
        few, seed, n = PHASES[self.reader], self.task.settings.seed, len(self.root)
        count, first = read or few, stream(seed, QUADRATURE).random(n)
        order = [stream(seed, QUADRATURE + i + n * read).permutation(count) for i in range(n)]
        phases = (np.transpose(order) + ((first * read / few + 0.5) % 1 if read else first)) / count
        return [
            self._counts(delta, delta * own, moving, (QUADRATURE, read + k))
            for k, own in enumerate(phases)
        ]

    def ratios(self, nodes: Sequence[Sequence[Array]], encoders: Sequence[int]) -> Array:
        """X with these encoders coarse, divided by X without, at every node; shape (count, b)."""
        return np.array([self._ratio(errors, encoders) for errors in nodes])

    def sampled(self, encoders: Sequence[int], delta: float, runs: int | None = None) -> Sampled:
        """CESTAC with these encoders coarse, eqs. (17), (18), (21). runs : default: as many as the
        settings say.
        """
        draw = self._counted_at_random if self.task.settings.rounding == "phase" else self._rounded
        ratios = [
            self._ratio(draw(delta, encoders, run), encoders)
            for run in range(runs or self.task.settings.runs)
        ]
        return sampled(delta, np.array(ratios))

    def _rounded(self, delta: float, encoders: Sequence[int], run: int) -> list[Array]:
        """Errors of every record under a law that rounds each sample independently.

        The streams of an encoder do not depend on which others are coarse.
        """
        seed, law = self.task.settings.seed, self.task.settings.rounding
        drawn = [
            [rounded(part.x[:, i], delta, law, stream(seed, k, run, i)) for i in encoders]
            for k, part in enumerate(self.parts)
        ]
        return self._read(drawn, encoders, delta)

    def _counted_at_random(self, delta: float, encoders: Sequence[int], run: int) -> list[Array]:
        """Errors of every record under the law `phase`, with random phases."""
        phases = stream(self.task.settings.seed, run, *encoders).random(len(self.root))
        return self._counts(delta, delta * phases, encoders, (run, *encoders, 0))

    def _counts(
        self, delta: float, phases: Array, encoders: Sequence[int], key: tuple[int, ...]
    ) -> list[Array]:
        """Errors of every record whose encoders have steps of these phases. key : of the stream of
        uneven lines, which are those of the encoder in every record.
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
        """Errors of q, qd, qdd as read from `drawn` positions, shape (N,) of each of the encoders
        in every record, and the deviation of qd, at the encoders, shape (4, n, N). Zero where
        exact.
        """
        of_records, key, chosen = [], (delta, *encoders), list(encoders)
        for part, columns in zip(self.parts, drawn, strict=True):
            y, errors = np.column_stack(columns), np.zeros((4, *part.x.T.shape))
            if self.reader == "counts":
                reading = read_counts(y, part.record.rate, delta, starts=part.starts.get(key))
                part.starts.setdefault(key, reading.starts)
                y, errors[3].T[:, chosen] = reading.motion
            read = filtered_states(y, part.record.rate, part.record.selection.signals)
            errors[:3, chosen] = [
                read.q.T - part.at_encoders.q.T[chosen],
                read.qd.T - part.at_encoders.qd.T[chosen],
                read.qdd.T - part.at_encoders.qdd.T[chosen],
            ]
            of_records.append(errors)
        return of_records

    def _ratio(self, errors: Sequence[Array], encoders: Sequence[int]) -> Array:
        """X with the errors of some encoders divided by X without them, on the same rows; shape (b,)."""
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
            raise np.linalg.LinAlgError("no direction of dry friction is certain")
        every = all(np.array_equal(x[1], y[1]) for x, y in zip(self.exact, exact, strict=True))
        return np.asarray(self._solved(coarse) / (self.reference if every else self._solved(exact)))

    def _solved(self, parts: Sequence[tuple[States, Array]]) -> Array:
        """Solve for X from the states of every record and the mask of its rows, bool, shape (n, K)."""
        rows = [
            observation_of(
                self.columns,
                states,
                record.torque,
                replace(record.selection, mask=mask),
                files=record.files,
            )
            for (states, mask), record in zip(parts, self.task.records, strict=True)
        ]
        whole = rows[0] if len(rows) == 1 else stack(rows)
        return linear_system(whole, self.task.estimate).solve().X


def mean_change(ratios: Array) -> Array:
    """Mean change of the estimate, of its ratios at nodes, shape (count, b), and the deviation of that mean, as if the nodes were independent, shape (2, b), %."""
    deviation = ratios.std(axis=0, ddof=1) / np.sqrt(len(ratios))
    return np.asarray(100 * np.array([ratios.mean(axis=0) - 1, deviation]))
