"""Runs of CESTAC with some encoders coarse and the others exact, by one law and one reader.

    error of encoder i, as read
            e_i = reader(rounded(x_i)) - reader of the record, filtered alike
    states with the encoders S coarse   those of the record + sum over i in S of (R^-1)_i e_i
    change at Delta
            mean of the least squares, over that of the record on the same rows, less 1

The low-pass is linear: positions moved by the errors of the encoders are an ordinary run.
The reader of counts leaves out rows in which dry friction has no certain direction. What that alone
does to the estimate is no error of the encoder and is
not in the change; `runtime.resolution.cestac`, which compares with all rows of the record, has
both.

The mean over the random phase of law phase is a quadrature. Its nodes are equidistant, shuffled
from encoder to encoder, so that the harmonics of the sawtooth cancel that are linear in the
estimate; what is left is the bias. One reading of all encoders serves every choice S.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from runtime.estimators.method import linear_system
from runtime.limits import LIMIT
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel
from runtime.records.missing import require_positions
from runtime.resolution.advice import Sampled, sampled
from runtime.resolution.perturbed import PreparedRecord, Task, prepared_record
from runtime.resolution.rounding import Mode, counted, rounded, stream
from runtime.resolution.run import moved_estimate
from runtime.rows.observation import Observation, stack
from runtime.rows.prepared import Prepared, observation_from_states
from runtime.rows.selection import Selection, certain_rows
from runtime.settings.study import Study
from runtime.signals.counts.reading import read_counts
from runtime.signals.filters import SpeedErrors, States
from runtime.signals.states import encoder_drives, encoder_position, encoder_root, joint_states

Array = np.ndarray

Reader = Literal["lowpass", "counts"]

READERS: tuple[Reader, ...] = ("lowpass", "counts")
PHASES: Mapping[Reader, int] = {"lowpass": 8, "counts": 4}  # nodes of the quadrature over the phase
QUADRATURE = 1 << 20  # number of the first stream of the nodes: beyond those of runs


@dataclass(frozen=True, eq=False)
class Encoders:
    """One record at its encoders.

    Attributes
    ----------
    record : PreparedRecord
    x : ndarray, shape (N, n), rad or m
        Positions at the encoders as measured.
    states : States
        Of the joints, as measured.
    at_encoders : States
        The same at the encoders.
    """

    record: PreparedRecord
    x: Array
    states: States
    at_encoders: States


class CoarseEncoders:
    """Coarser encoders on several records of one robot, by a law and a reader in place of those of
    the study.
    """

    def __init__(
        self,
        model: GeneratedModel,
        records: Sequence[Prepared],
        study: Study,
        names: Sequence[str],
        drives: Drives | None,
        constants: Mapping[str, float],
        law: Mode,
        reader: Reader,
    ) -> None:
        signals = study.signals
        if reader != signals.reader:
            signals = replace(signals, reader=reader, step=None, side="joint")
        settings = replace(study.cestac, rounding=law, delta=(), place="record")
        study = replace(study, signals=signals, cestac=settings)
        side = encoder_drives(settings.side, drives, "cestac")
        self.reader, self.root, self.parts = reader, encoder_root(side, len(model.JOINTS)), []
        into = np.linalg.inv(self.root).T
        for own in records:
            require_positions(own.record.missing, "advice on encoders", own.record.file)
            part = prepared_record(own, study, drives)
            states = replace(part.states or own.by(study).filtered, errors=None)
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
            dict(constants),
        )
        self.reference = (
            moved_estimate(self.task, [np.zeros_like(part.x) for part in self.parts])
            if reader == "lowpass"
            else self._solved(
                [self._observed(part, part.states, part.record.selection) for part in self.parts]
            )
        )

    @property
    def coarsest(self) -> Array:
        """Largest step of each encoder, shape (n,): LIMIT.LINES_IN_MOTION of them in its motion;
        inf of one at
        rest.
        """
        spans = np.min([np.ptp(part.x, axis=0) for part in self.parts], axis=0)
        return np.where(spans > 0, spans / LIMIT.LINES_IN_MOTION, np.inf)

    @property
    def finest(self) -> float:
        """Smallest step beside which the positions of the records count as exact, rad or m."""
        own = (part.record.own for part in self.parts)
        steps = (float(encoder.step.max()) for encoder in own if encoder is not None)
        return float(LIMIT.EXACT_FROM * max(steps, default=0.0))

    def asked(self, delta: float) -> Array:
        """Mean change with all encoders that move of this step, shape (b,), %; nan where the
        records do not tell.
        """
        moving = [i for i, most in enumerate(self.coarsest) if np.isfinite(most)]
        if self.finest * (1 - 1e-9) <= delta <= self.coarsest.min():
            try:
                return np.asarray(self.change(self.nodes(delta, moving), moving)[0])
            except np.linalg.LinAlgError:  # a step that this reader does not resolve
                pass
        return np.full(len(self.reference), np.nan)

    def locking(self, delta: Array) -> Array:
        """Power of the sawtooth that passes the low-pass, over that of white noise, the largest of
        the encoders, shape (m,); delta, shape (m,).

        Harmonic h of the error of a count has the frequency h |qd|/Delta and a power as 1/h^2;
        sampled, it is as slow as its distance from a multiple of
        the rate. Where a joint keeps a speed that is a simple fraction of a step per sample, the
        error stands still.
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

    def nodes(
        self, delta: float, moving: Sequence[int], count: int | None = None
    ) -> list[list[Array]]:
        """Errors of every record at the nodes of the quadrature, the encoders `moving` coarse.
        count : of nodes; default: PHASES.
        """
        count, seed, n = count or PHASES[self.reader], self.task.settings.seed, len(self.root)
        order = np.array([stream(seed, QUADRATURE + i).permutation(count) for i in range(n)])
        phases = delta * (order.T + stream(seed, QUADRATURE).random(n)) / count
        return [self._counts(delta, own, moving, (QUADRATURE, k)) for k, own in enumerate(phases)]

    def change(self, nodes: Sequence[Sequence[Array]], encoders: Sequence[int]) -> Array:
        """Mean change of the estimate with these encoders coarse, and the deviation of that mean,
        shape (2, b), %.
        """
        ratios = np.array([self._ratio(errors, encoders) for errors in nodes])
        return 100 * np.array(
            [ratios.mean(axis=0) - 1, ratios.std(axis=0, ddof=1) / np.sqrt(len(ratios))]
        )

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
        """Errors of every record by a law that rounds every sample; the streams of an encoder do
        not depend on which others are coarse.
        """
        settings, errors = self.task.settings, [np.zeros_like(part.x) for part in self.parts]
        for k, part in enumerate(self.parts):
            for i in encoders:
                x, rng = part.x[:, i], stream(settings.seed, k, run, i)
                errors[k][:, i] = rounded(x, delta, settings.rounding, rng) - x
        return errors

    def _counted_at_random(self, delta: float, encoders: Sequence[int], run: int) -> list[Array]:
        """Errors of every record by law phase."""
        phases = stream(self.task.settings.seed, run, *encoders).random(len(self.root))
        return self._counts(delta, delta * phases, encoders, (run, *encoders, 0))

    def _counts(
        self, delta: float, phases: Array, encoders: Sequence[int], key: tuple[int, ...]
    ) -> list[Array]:
        """Errors of every record whose encoders have steps of these phases, at the encoders: of
        the positions, shape (N, n); of the reader of counts as read, shape (4, N, n), those of q,
        qd, qdd and the deviation of qd. Zero where exact. key : of the stream of uneven lines,
        which are those of the encoder in every record.
        """
        settings, chosen, errors = self.task.settings, list(encoders), []
        for part in self.parts:
            rng = stream(settings.seed, *key)
            columns = [
                counted(part.x[:, i], delta, phases[i], settings.uneven, rng) for i in chosen
            ]
            y, rate, exact = np.column_stack(columns), part.record.rate, part.at_encoders
            error = np.zeros((4, *part.x.shape))
            if self.reader == "lowpass":
                error[0][:, chosen] = y - part.x[:, chosen]
                errors.append(error[0])
                continue
            motion, signals = read_counts(y, rate, delta).motion, part.record.selection.signals
            read = joint_states(*motion, rate, signals, None)
            assert read.errors is not None
            error[0][:, chosen] = read.q - exact.q[:, chosen]
            error[1][:, chosen] = read.qd - exact.qd[:, chosen]
            error[2][:, chosen] = read.qdd - exact.qdd[:, chosen]
            error[3][:, chosen] = read.errors.deviation
            errors.append(error)
        return errors

    def _ratio(self, errors: Sequence[Array], encoders: Sequence[int]) -> Array:
        """X with the errors of some encoders over X without, on the same rows, shape (b,)."""
        chosen = np.isin(np.arange(len(self.root)), list(encoders))
        if self.reader == "lowpass":
            moved = [(error * chosen) @ self.root.T for error in errors]
            return np.asarray(moved_estimate(self.task, moved) / self.reference)
        coarse, exact, task = [], [], self.task
        for part, error in zip(self.parts, errors, strict=True):
            q, qd, qdd = (error[:3] * chosen) @ self.root.T
            own, selection = part.states, part.record.selection
            states = States(own.q + q, own.qd + qd, own.qdd + qdd)
            known = replace(states, errors=SpeedErrors(error[3] * chosen, self.root))
            rows = known[selection.samples][selection.kept]
            certain = certain_rows(task.model, rows, task.constants)
            selection = replace(selection, mask=selection.mask & certain)
            exact.append(self._observed(part, own, selection))
            coarse.append(self._observed(part, states, selection))
        return np.asarray(self._solved(coarse) / self._solved(exact))

    def _observed(self, part: Encoders, states: States, selection: Selection) -> Observation:
        return observation_from_states(
            self.task.model,
            states,
            part.record.torque,
            selection,
            files=part.record.files,
            columns=self.task.names,
            constants=self.task.constants,
        )

    def _solved(self, rows: Sequence[Observation]) -> Array:
        whole = rows[0] if len(rows) == 1 else stack(rows)
        return linear_system(whole, self.task.estimate).solve().X
