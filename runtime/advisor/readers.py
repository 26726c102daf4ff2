"""Predict the coarsest encoder that an identification allows, from filtered positions and from counts.

The change of the estimate is computed along steps of law phase, for both readers
(`runtime.advisor.coarse_encoders`). White noise does not describe a sawtooth that is locked to the
motion, still less what a reader of counts leaves of it. So no first-order law is used: each point
of the curve is a mean over phases of the encoder (a quadrature). Limits are the steps at which the
curve crosses 1 % and 5 %. At the steps on either side, the number of phases is doubled until the
limit is certain to LIMIT.CURVE_SHARPNESS. Runs of random phase confirm the limits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import pairwise, product

import numpy as np

from runtime.advisor.advice import (
    LIMITS,
    NAMES,
    EncoderAdvice,
    ReaderAdvice,
    confirm_by_runs,
    limits_of,
    step_text,
)
from runtime.advisor.coarse_encoders import CoarseEncoders, ReaderName, mean_change
from runtime.core.cestac.result import deciding_names
from runtime.core.least_squares.estimate import Estimate
from runtime.ground.limits import limits

LIMIT = limits(__package__)

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
    """Compute how coarse real encoders may be if they are read as positions, or as counts.

    reference : estimate of the records as measured, whose deciding parameters decide here.
    selections : numbers (from 0) of the coarse encoders, by label.
    units : unit of the steps, by label.
    start : a step about which the curve begins, rad or m.
    asked : further steps, of all encoders.
    confirm : whether random runs confirm the limits.
    progress : called after each choice of encoders.
    """
    decisive = [reference.names.index(name) for name in deciding_names(reference)]
    by_label, encoders = curves(real, selections, start, decisive), []
    for label, own in selections.items():
        delta, change = by_label[label][0], by_label[label][1][:, 0]
        limits = limits_of(delta, change, reference)
        advice = EncoderAdvice(label, limits, delta, change, unit=units[label])
        if confirm:
            advice = confirm_by_runs(advice, reference, partial(real.sampled, own))
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
    """Compute, for each group of coarse encoders, how the estimate changes with their step.

    Steps go from `start` down until all changes are below the first limit, and up until all are
    above the last limit. They are finer where constant speeds of the record lock to the sampling.

    A label names a group of encoders. Return for each label the steps, shape (m,), and the changes
    with their standard deviations, shape (m, 2, b), %.
    """
    known: dict[str, dict[float, Array]] = {label: {} for label in selections}
    finest, coarsest = real.finest, real.coarsest
    start = min(max(start, finest), float(coarsest.min()))

    def changes(label: str) -> dict[float, Array]:
        return {k: mean_change(ratios) for k, ratios in sorted(known[label].items())}

    def worst(label: str, k: float) -> float:
        return float(np.abs(mean_change(known[label][k])[0, decisive]).max(initial=0.0))

    def read(k: float, labels: Iterable[str], nodes: int = 0) -> list[str]:
        """Compute and store how the estimate X changes at one more encoder step of the curve. The
        step is start*LIMIT.READER_RATIO^k.

        The changes are computed at the first phases of the encoder, or at `nodes` more phases.
        Return the labels of the groups of encoders for which this is possible.
        """
        delta = start * LIMIT.READER_RATIO**k
        labels = [label for label in labels if (delta <= coarsest[[*selections[label]]]).all()]
        moving = {i for label in labels for i in selections[label] if np.isfinite(coarsest[i])}
        if delta < finest * (1 - 1e-9) or not moving:
            return []
        try:
            errors = real.nodes(delta, sorted(moving), nodes)
            ratios = {label: real.ratios(errors, selections[label]) for label in labels}
        except np.linalg.LinAlgError:  # steps that this reader does not resolve
            return []
        for label, own in ratios.items():
            known[label][k] = np.concatenate([known[label][k], own]) if nodes else own
        return labels

    for step, most, limit in ((-1, LIMIT.READER_DOWN, LIMITS[0]), (1, LIMIT.READER_UP, LIMITS[-1])):
        for i in range(0 if step < 0 else 1, most):
            e = [worst(label, step * i) for label in read(step * i, selections)]
            if not e or (max(e) < limit if step < 0 else min(e) > limit):
                break
    tried = sorted({k for own in known.values() for k in own})
    for a, b in pairwise(tried) if real.reader == "lowpass" else ():
        between = np.linspace(a, b, LIMIT.LOCKED_STEPS + 1)
        share = real.locking(start * LIMIT.READER_RATIO**between)
        if share[1:-1].max() > LIMIT.LOCKED_POWER * max(share[0], share[-1]):
            for k in between[1:-1].tolist():
                read(k, selections)
    exhausted = set[tuple[str, float]]()  # steps at which no more nodes can be read
    while True:
        vague: dict[tuple[float, int], dict[str, None]] = {}
        for label, limit in product(selections, LIMITS):
            for k in vague_steps(changes(label), decisive, limit):
                nodes = len(known[label][k])
                if nodes < LIMIT.PHASES_TAKEN and (label, k) not in exhausted:
                    vague.setdefault((k, nodes), {})[label] = None
        if not vague:
            break
        for (k, nodes), labels in vague.items():
            done = read(k, labels, nodes)
            exhausted.update((label, k) for label in labels if label not in done)
            for label, last in dict.fromkeys(done, k).items():  # a walk that ended below the limit
                while (
                    last == max(known[label])
                    and worst(label, last) < LIMITS[-1]
                    and read(last + 1, [label])
                ):
                    last += 1
    by_label, b = {label: changes(label) for label in selections}, len(real.reference)
    return {
        label: (
            start * LIMIT.READER_RATIO ** np.array(list(own), dtype=float),
            np.array(list(own.values())).reshape(len(own), 2, b),
        )
        for label, own in by_label.items()
    }


def vague_steps(
    changes: Mapping[float, Array], decisive: Sequence[int], limit: float
) -> list[float]:
    """Find which encoder steps near the limiting step have too uncertain a change of X. At the
    limiting step, X changes by `limit` %, for instance 1 %.

    The limiting step is between two steps. A step is returned if the standard deviation of its
    change moves the limiting step by more than LIMIT.CURVE_SHARPNESS of it, by straight lines on
    logarithmic axes. If even the finest step is above the limit, only this step is judged.

    changes : change and its standard deviation, shape (2, b), %, by exponent of the step,
        ascending.
    """
    steps, e = list(changes), [np.abs(change[0]) for change in changes.values()]
    over = [j for j, own in enumerate(e) if own[decisive].max(initial=0.0) >= limit]
    if not over:
        return []
    pair = range(max(over[0] - 1, 0), over[0] + 1)
    first = decisive[int(np.argmax(e[over[0]][decisive]))]
    deviation = np.array([changes[steps[j]][1, first] for j in pair])
    change = np.maximum([e[j][first] for j in pair], deviation)
    moved = deviation / change * np.log(LIMIT.READER_RATIO)
    if len(pair) > 1:  # d log(Delta)/d log(change), linear between the two
        height = np.log(change / limit)
        with np.errstate(divide="ignore", invalid="ignore"):
            moved *= np.abs(height[::-1]) / np.ptp(height) ** 2 * (steps[pair[1]] - steps[pair[0]])
    return [steps[j] for j, x in zip(pair, moved, strict=True) if x > LIMIT.CURVE_SHARPNESS]


def uncertain(
    reader: ReaderName, advice: EncoderAdvice, error: Array, names: Sequence[str]
) -> list[str]:
    """Write a warning if the curve of the change is too flat to find the step of 1 or 5 % change.

    error : standard deviation of the change, shape (m, b), %.
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
                "--delta STEP."
            )
    return found
