"""How coarse a real encoder may be, read as positions and read as counts: the change of the
estimate along steps of law phase, by both readers (`runtime.resolution.coarse_encoders`).

White noise does not describe a sawtooth that is locked to the motion, still less what a reader of
counts leaves of it, so no first-order law is used: the curve is a quadrature over the phase.
Limits are where it crosses 1 % and 5 %; at the steps on either side the mean is taken over as many
nodes as tell it to LIMIT.CURVE_SHARPNESS of the limit. Runs of random phase confirm the limits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise, product

import numpy as np

from runtime.estimators.estimate import Estimate
from runtime.limits import LIMIT
from runtime.resolution.advice import (
    LIMITS,
    NAMES,
    EncoderAdvice,
    ReaderAdvice,
    confirmed,
    limits_of,
    step_text,
)
from runtime.resolution.coarse_encoders import PHASES, CoarseEncoders, Reader
from runtime.resolution.result import deciding_names

Array = np.ndarray


def reader_advice(
    real: CoarseEncoders,
    reference: Estimate,
    selections: Mapping[str, tuple[int, ...]],
    units: Mapping[str, str],
    start: float,
    *,
    asked: Sequence[float] = (),
    confirm: bool = True,
    progress: Callable[[], None] = lambda: None,
) -> ReaderAdvice:
    """Advice on real encoders by one reader.

    reference : estimate of the records as measured, whose deciding parameters decide here.
            selections : encoders (from 0) by label.   units : of
    each label.   start : rad or m, a step about which the walk begins.
            asked : further steps, of all encoders.   progress : called after each choice of
            encoders.
    """
    decisive = [reference.names.index(name) for name in deciding_names(reference)]
    by_label, encoders = curves(real, selections, start, decisive), []
    for label, own in selections.items():
        delta, change = by_label[label][0], by_label[label][1][:, 0]
        limits = limits_of(delta, change, reference)
        advice = EncoderAdvice(label, limits, delta, change, unit=units[label])
        if confirm:
            advice = confirmed(advice, reference, partial(real.sampled, own))
        encoders.append(advice)
        progress()
    deviation = by_label[encoders[0].label][1][:, 1]
    return ReaderAdvice(
        real.reader,
        tuple(encoders),
        (
            *(part.record.note for part in real.parts if part.record.note),
            *uncertain(real.reader, encoders[0], deviation, reference.names),
        ),
        np.array([real.asked(delta) for delta in asked]).reshape(len(asked), len(reference.names)),
    )


def curves(
    real: CoarseEncoders,
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
        coarse = [i for i, most in enumerate(coarsest) if delta <= most < np.inf]
        asked = {
            label: own
            for label, own in selections.items()
            if set(own) <= {*coarse, *np.flatnonzero(np.isinf(coarsest))}
        }
        if not asked or delta < finest * (1 - 1e-9) or not coarse:
            return {}
        try:
            nodes = real.nodes(delta, coarse)
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
    moving = {
        label: [i for i in own if np.isfinite(coarsest[i])] for label, own in selections.items()
    }
    sharp = set[tuple[str, float]]()
    while vague := vague_steps(real.reader, known, decisive, sharp):
        for at, wanted in vague.items():
            read = sorted({i for label in wanted for i in moving[label]})
            nodes = real.nodes(start * LIMIT.READER_RATIO**at, read, max(wanted.values()))
            for label, own in moving.items():
                if at in known[label] and {*own} <= {*read}:
                    known[label][at] = real.change(nodes, own)
                    sharp.add((label, at))
        for label, changes in known.items():  # a walk that ended where it is now below the limit
            last = max(changes)
            while (
                last in vague
                and np.abs(changes[last][0, decisive]).max() < LIMITS[-1]
                and label in evaluate(last + 1)
            ):
                last = max(changes)
    order = {label: sorted(own) for label, own in known.items()}
    b = len(real.reference)
    return {
        label: (
            start * LIMIT.READER_RATIO ** np.array(ks, dtype=float),
            np.array([known[label][k] for k in ks]).reshape(len(ks), 2, b),
        )
        for label, ks in order.items()
    }


def vague_steps(
    reader: Reader,
    known: Mapping[str, Mapping[float, Array]],
    decisive: Sequence[int],
    sharp: set[tuple[str, float]],
) -> dict[float, dict[str, int]]:
    """Steps beside a limit whose nodes tell the change of a choice of encoders too badly, by step
    and label how many nodes would do; those in `sharp` have had theirs.
    """
    vague: dict[float, dict[str, int]] = {}
    for label, limit in product(known, LIMITS):
        for at, count in beside(reader, known[label], decisive, limit).items():
            if (label, at) not in sharp:
                own = vague.setdefault(at, {})
                own[label] = max(count, own.get(label, 0))
    return vague


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
