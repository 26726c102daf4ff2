"""How coarse a real encoder may be, read as positions and read as counts: the change of the
estimate along steps of law phase, by both readers.

    error of encoder i, as read
            e_i = reader(phi_i + Delta round((x_i - phi_i)/Delta)) - reader of the record, filtered
            alike
    states with the encoders S coarse   those of the record + sum over i in S of (R^-1)_i e_i
    change at Delta
            mean over phases of the least squares, over that of the record on the same rows, less 1

The reader of counts leaves out rows in which dry friction has no certain direction. What that alone
does to the estimate is no error of the encoder and is
not in the change; `runtime.resolution.cestac`, which compares with all rows of the record, has
both.

White noise does not describe a sawtooth that is locked to the motion, still less what a reader of
counts leaves of it, so no first-order law is used:
the mean over the random phase is a quadrature. Its nodes are equidistant, shuffled from encoder to
encoder, so that the harmonics of the sawtooth cancel
that are linear in the estimate; what is left is the bias. One reading of all encoders serves every
choice S. Limits are where the curve crosses 1 % and
5 %; at the steps on either side the mean is taken over as many nodes as tell it to
LIMIT.CURVE_SHARPNESS of the
limit. Runs of random phase confirm the limits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise, product
from typing import Literal

import numpy as np

from runtime.estimators.estimate import Estimate
from runtime.estimators.method import linear_system
from runtime.limits import LIMIT
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel
from runtime.records.missing import require_positions
from runtime.resolution.advice import (
    LIMITS,
    NAMES,
    EncoderAdvice,
    Limit,
    ReaderAdvice,
    Sampled,
    confirmed,
    crossing,
    sampled,
    step_text,
)
from runtime.resolution.perturbed import PreparedRecord, prepared_record
from runtime.resolution.result import deciding_names
from runtime.resolution.rounding import counted, stream
from runtime.rows.observation import Observation, stack
from runtime.rows.prepared import Prepared, observation_from_states
from runtime.rows.selection import Selection, certain_rows
from runtime.settings.study import EstimateSettings, Study
from runtime.signals.counts.reading import read_counts
from runtime.signals.filters import SpeedErrors, States, filtered_states
from runtime.signals.states import encoder_root, joint_states

Array = np.ndarray

Reader = Literal["lowpass", "counts"]

READERS: tuple[Reader, ...] = ("lowpass", "counts")
PHASES: Mapping[Reader, int] = {"lowpass": 8, "counts": 4}  # nodes of the quadrature over the phase
QUADRATURE = 1 << 20  # number of the first stream of the nodes: beyond those of runs


@dataclass(frozen=True, eq=False)
class Encoders:
    """One record at its encoders.   x : positions at the encoders as measured, shape (N, n).
    states : joint side, as measured.   root : R^-1.
    """

    record: PreparedRecord
    x: Array
    states: States
    root: Array
    drives: Drives | None


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors of q, qd, qdd as read, encoder side, shape (N, n) each, zero where exact; deviation of
    qd.
    """

    states: States
    deviation: Array


class RealEncoders:
    """What one reader makes of coarser encoders on several records of one robot."""

    def __init__(
        self,
        model: GeneratedModel,
        records: Sequence[Prepared],
        study: Study,
        names: Sequence[str],
        drives: Drives | None,
        constants: Mapping[str, float],
        reader: Reader,
    ) -> None:
        own = (
            study.signals
            if reader == study.signals.reader
            else replace(study.signals, reader=reader, step=None, side="joint")
        )
        self.study = replace(
            study,
            signals=own,
            cestac=replace(study.cestac, rounding="phase", delta=(), place="record"),
        )
        self.model, self.names, self.constants, self.reader = (
            model,
            tuple(names),
            dict(constants),
            reader,
        )
        self.estimate: EstimateSettings = replace(study.estimate, columns="all")
        side = drives if study.cestac.side == "motor" else None
        self.parts = []
        for measured in records:
            record = measured.record
            require_positions(record.missing, "advice on encoders", record.file)
            part = prepared_record(measured, self.study, drives)
            x = record.q if side is None else side.motor_position(record.q)
            states = part.states or measured.by(self.study).filtered
            self.parts.append(
                Encoders(part, x, replace(states, errors=None), encoder_root(side, record.n), side)
            )
        self.reference = self._solved(
            [self._observed(part, part.states, part.record.selection) for part in self.parts]
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
        return np.full(len(self.names), np.nan)

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
            band = 1.0 if low is None else 2 * low.cutoff / rate
            speed = (
                np.abs(
                    part.states.qd[:: max(1, len(part.x) // LIMIT.SPEEDS_COMPARED)]
                    @ np.linalg.inv(part.root).T
                )
                / rate
            )  # per sample
            for k, step in enumerate(delta):
                turns = h[:, None, None] * speed / step
                passed = (np.abs(turns - np.round(turns)) < band / 2).mean(axis=1)
                most[k] = max(most[k], float((weight @ passed).max()) / band)
        return most

    def nodes(
        self, delta: float, moving: Sequence[int], count: int | None = None
    ) -> list[list[Errors]]:
        """Errors of every record at the nodes of the quadrature, the encoders `moving` coarse.
        count : of nodes; default: PHASES.
        """
        count = count or PHASES[self.reader]
        shuffled = [
            stream(self.study.cestac.seed, QUADRATURE + i).permutation(count)
            for i in range(len(self.model.JOINTS))
        ]
        shift = stream(self.study.cestac.seed, QUADRATURE).random(len(shuffled))
        at = [
            np.array([(order[k] + u) / count for order, u in zip(shuffled, shift, strict=True)])
            for k in range(count)
        ]
        seed = self.study.cestac.seed
        return [
            [
                self._errors(part, delta, delta * phases, moving, stream(seed, QUADRATURE, k))
                for part in self.parts
            ]
            for k, phases in enumerate(at)
        ]

    def change(self, nodes: Sequence[Sequence[Errors]], encoders: Sequence[int]) -> Array:
        """Mean change of the estimate with these encoders coarse, and the deviation of that mean,
        shape (2, b), %.
        """
        ratios = np.array([self._ratio(errors, encoders) for errors in nodes])
        return 100 * np.array(
            [ratios.mean(axis=0) - 1, ratios.std(axis=0, ddof=1) / np.sqrt(len(ratios))]
        )

    def sampled(self, encoders: Sequence[int], delta: float, runs: int | None = None) -> Sampled:
        """CESTAC by law phase with these encoders coarse, eqs. (17), (18), (21)."""
        X = []
        for run in range(runs or self.study.cestac.runs):
            rng = stream(self.study.cestac.seed, run, *encoders)
            phases = delta * rng.random(len(self.model.JOINTS))
            X.append(
                self._ratio(
                    [self._errors(part, delta, phases, encoders, rng) for part in self.parts],
                    encoders,
                )
            )
        return sampled(delta, np.array(X), np.ones(len(self.names)))

    def _errors(
        self,
        part: Encoders,
        delta: float,
        phases: Array,
        encoders: Sequence[int],
        rng: np.random.Generator,
    ) -> Errors:
        uneven, chosen = self.study.cestac.uneven, list(encoders)
        y = np.column_stack([counted(part.x[:, i], delta, phases[i], uneven, rng) for i in chosen])
        rate, signals = part.record.rate, part.record.selection.signals
        deviation = np.zeros_like(part.x)
        if self.reader == "counts":
            read = joint_states(*read_counts(y, rate, delta).motion, rate, signals, None)
            assert read.errors is not None
            deviation[:, chosen] = read.errors.deviation
        else:
            read = filtered_states(np.asfortranarray(y), rate, signals)
        into = np.linalg.inv(part.root).T
        errors = States(np.zeros_like(part.x), np.zeros_like(part.x), np.zeros_like(part.x))
        for got, of, error, at in zip(
            _three(read), _three(part.states), _three(errors), (True, False, False), strict=True
        ):
            if part.drives is None:
                exact = of
            else:
                exact = part.drives.motor_position(of) if at else of @ into
            error[:, chosen] = got - exact[:, chosen]
        return Errors(errors, deviation)

    def _ratio(self, errors: Sequence[Errors], encoders: Sequence[int]) -> Array:
        """X with the errors of some encoders over X without, on the same rows, shape (b,)."""
        chosen = np.isin(np.arange(len(self.model.JOINTS)), list(encoders))
        coarse, exact = [], []
        for part, error in zip(self.parts, errors, strict=True):
            q, qd, qdd = (
                of + (own * chosen) @ part.root.T
                for of, own in zip(_three(part.states), _three(error.states), strict=True)
            )
            states, selection = States(q, qd, qdd), part.record.selection
            if self.reader == "counts":
                known = replace(states, errors=SpeedErrors(error.deviation * chosen, part.root))
                certain = certain_rows(
                    self.model, known[selection.samples][selection.kept], self.constants
                )
                selection = replace(selection, mask=selection.mask & certain)
                exact.append(self._observed(part, part.states, selection))
            coarse.append(self._observed(part, states, selection))
        return np.asarray(self._solved(coarse) / (self._solved(exact) if exact else self.reference))

    def _observed(self, part: Encoders, states: States, selection: Selection) -> Observation:
        return observation_from_states(
            self.model,
            states,
            part.record.torque,
            selection,
            files=part.record.files,
            columns=self.names,
            constants=self.constants,
        )

    def _solved(self, rows: Sequence[Observation]) -> Array:
        return linear_system(rows[0] if len(rows) == 1 else stack(rows), self.estimate).solve().X


def real_encoders(
    model: GeneratedModel,
    records: Sequence[Prepared],
    study: Study,
    reference: Estimate,
    selections: Mapping[str, tuple[int, ...]],
    units: Sequence[str],
    start: float,
    *,
    asked: Sequence[float] = (),
    drives: Drives | None,
    constants: Mapping[str, float],
    confirm: bool = True,
    progress: Callable[[], None] = lambda: None,
) -> tuple[ReaderAdvice, ...]:
    """Advice on real encoders read as positions, then as counts.

    reference : estimate of the records as measured, whose deciding parameters decide here.
            selections : encoders (from 0) by label.   units : of
    each encoder.   start : rad or m, a step about which the walk begins.
            asked : further steps, of all encoders.   progress : called after each choice of
            encoders.
    """
    advices = []
    for reader in READERS:
        real = RealEncoders(model, records, study, reference.names, drives, constants, reader)
        by_label = curves(
            real,
            selections,
            start,
            [reference.names.index(name) for name in deciding_names(reference)],
        )
        encoders = []
        for label, own in selections.items():
            unit = " or ".join(sorted({units[i] for i in own}, reverse=True))
            advice = _advice(label, by_label[label][0], by_label[label][1][:, 0], reference, unit)
            if confirm:
                advice = confirmed(advice, reference, partial(real.sampled, own))
            encoders.append(advice)
            progress()
        notes = [part.record.note for part in real.parts if part.record.note]
        steps = np.array([real.asked(delta) for delta in asked]).reshape(
            len(asked), len(real.names)
        )
        advices.append(
            ReaderAdvice(
                reader,
                tuple(encoders),
                (
                    *notes,
                    *uncertain(
                        reader, encoders[0], by_label[encoders[0].label][1][:, 1], reference.names
                    ),
                ),
                steps,
            )
        )
    return tuple(advices)


def curves(
    real: RealEncoders,
    selections: Mapping[str, tuple[int, ...]],
    start: float,
    decisive: Sequence[int],
) -> dict[str, tuple[Array, Array]]:
    """Steps and changes by label: from `start` down until all is below the first limit, up until
    all is above the last; finer where steps lock.
    """
    known: dict[str, dict[float, Array]] = {label: {} for label in selections}
    finest, coarsest = real.finest, real.coarsest
    start = min(max(start, finest), float(coarsest.min()))

    def evaluate(k: float) -> dict[str, float]:
        delta = start * LIMIT.READER_RATIO**k
        moving = [i for i, most in enumerate(coarsest) if delta <= most < np.inf]
        asked = {
            label: own
            for label, own in selections.items()
            if set(own) <= {*moving, *np.flatnonzero(np.isinf(coarsest))}
        }
        if not asked or delta < finest * (1 - 1e-9) or not moving:
            return {}
        try:
            nodes = real.nodes(delta, moving)
        except np.linalg.LinAlgError:  # steps that this reader does not resolve
            return {}
        for label, own in asked.items():
            if k not in known[label]:
                known[label][k] = real.change(nodes, own)
        return {
            label: float(np.abs(known[label][k][0, decisive]).max(initial=0.0)) for label in asked
        }

    for step, most, limit in ((-1, LIMIT.READER_DOWN, LIMITS[0]), (1, LIMIT.READER_UP, LIMITS[-1])):
        for k in range(0 if step < 0 else 1, most):
            worst = evaluate(step * k)
            if not worst or (
                max(worst.values()) < limit if step < 0 else min(worst.values()) > limit
            ):
                break
    tried = sorted({k for own in known.values() for k in own})
    for a, b in pairwise(tried) if real.reader == "lowpass" else ():
        between = np.linspace(a, b, LIMIT.LOCKED_STEPS + 1)
        share = real.locking(start * LIMIT.READER_RATIO**between)
        if share[1:-1].max() > LIMIT.LOCKED_POWER * max(share[0], share[-1]):
            for k in between[1:-1].tolist():
                evaluate(k)
    sharp: dict[str, set[float]] = {label: set() for label in selections}
    for label, limit in product(selections, LIMITS):
        moving = [i for i in selections[label] if np.isfinite(coarsest[i])]
        while vague := {
            at: n
            for at, n in beside(real.reader, known[label], decisive, limit).items()
            if at not in sharp[label]
        }:
            for at, count in vague.items():
                known[label][at] = real.change(
                    real.nodes(start * LIMIT.READER_RATIO**at, moving, count), moving
                )
            sharp[label].update(vague)
            onward = (
                max(known[label]) in vague
            )  # the walk ended where the change is now below the last limit
            while (
                onward
                and np.abs(known[label][(last := max(known[label]))][0, decisive]).max()
                < LIMITS[-1]
            ):
                onward = label in evaluate(last + 1)
    order = {label: sorted(own) for label, own in known.items()}
    b = len(real.names)
    return {
        label: (
            start * LIMIT.READER_RATIO ** np.array(ks, dtype=float),
            np.array([known[label][k] for k in ks]).reshape(len(ks), 2, b),
        )
        for label, ks in order.items()
    }


def beside(
    reader: Reader, known: Mapping[float, Array], decisive: Sequence[int], limit: float
) -> dict[float, int]:
    """Of the two steps between which the first parameter crosses a limit, those whose nodes do not
    tell its change to LIMIT.CURVE_SHARPNESS of it, and how many would.

    known : change and its deviation, shape (2, b), %, by step.
    """
    steps = sorted(known)
    over = [
        j for j, k in enumerate(steps) if np.abs(known[k][0, decisive]).max(initial=0.0) >= limit
    ]
    if not over:
        return {}
    first = decisive[int(np.argmax(np.abs(known[steps[over[0]]][0, decisive])))]
    share = {
        k: known[k][1, first] / (LIMIT.CURVE_SHARPNESS * limit)
        for k in steps[max(over[0] - 1, 0) : over[0] + 1]
    }
    return {
        k: min(int(np.ceil(PHASES[reader] * x**2)), LIMIT.PHASES_TAKEN)
        for k, x in share.items()
        if x > 1
    }


def _advice(
    label: str, delta: Array, change: Array, reference: Estimate, unit: str
) -> EncoderAdvice:
    """Limits where the first parameter that matters crosses them; nan where the finest step is
    already beyond or none is judged, inf where no step is.
    """
    names = deciding_names(reference)
    if not len(delta):
        return EncoderAdvice(
            label, tuple(Limit(percent, np.nan, "") for percent in LIMITS), delta, change, unit=unit
        )
    limits = []
    for percent in LIMITS:
        first = {
            name: crossing(delta, np.abs(change[:, reference.names.index(name)]), percent)
            for name in names
        }
        beyond = [name for name in names if abs(change[0, reference.names.index(name)]) > percent]
        reached = {name: step for name, step in first.items() if np.isfinite(step)}
        if beyond:
            worst = max(beyond, key=lambda name: abs(change[0, reference.names.index(name)]))
            limits.append(Limit(percent, np.nan, worst))
        elif reached:
            name = min(reached, key=lambda name: reached[name])
            limits.append(Limit(percent, reached[name], name))
        else:
            limits.append(Limit(percent, np.inf, ""))
    return EncoderAdvice(label, tuple(limits), delta, change, unit=unit)


def uncertain(
    reader: Reader, advice: EncoderAdvice, error: Array, names: Sequence[str]
) -> list[str]:
    """Sentences on the limits about which the change hardly depends on the step, or scatters as
    much; error : deviation of the change, shape (m, b), %.
    """
    found = []
    for limit in advice.limits:
        if not np.isfinite(limit.delta):
            continue
        i = names.index(limit.parameter)
        e, apart = (
            np.abs(advice.change[:, i]),
            np.maximum(LIMIT.PREDICTION_AGREES * limit.percent, 2 * error[:, i]),
        )
        first = advice.delta[(e < limit.percent - apart) & (advice.delta < limit.delta)].max(
            initial=advice.delta[0]
        )
        last = advice.delta[(e > limit.percent + apart) & (advice.delta > limit.delta)].min(
            initial=advice.delta[-1]
        )
        if last > LIMIT.FLAT_CURVE * first:
            found.append(
                f"Read as {NAMES[reader]}, all encoders alike, from "
                f"{step_text(first, advice.unit)} to {step_text(last, advice.unit)}: the predicted "
                f"change of {limit.parameter} is {limit.percent:g} %, within the accuracy of the "
                "prediction. Simulate the encoder's own step: symgen cestac --rounding phase "
                "--delta "
                "STEP."
            )
    return found


def _three(states: States) -> tuple[Array, Array, Array]:
    return states.q, states.qd, states.qdd
