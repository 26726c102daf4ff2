"""Predict the coarsest encoder that an identification allows, from filtered positions and from counts.

The change of the estimate is computed along steps of law phase, for both readers
(`runtime.advisor.coarse_encoders`). White noise does not describe a sawtooth that is locked to the
motion, and still less the error that a reader of counts leaves. So no first-order law is used: each
point of the curve is a mean over phases of the encoder (a quadrature). Limits are the steps at
which the curve crosses 1 % and 5 %. At the steps on either side, the number of phases is doubled
until the limit is certain (CURVE_SHARPNESS in limits.toml). Runs of random phase confirm the
limits.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise, product

import numpy as np

from runtime.advisor.advice import (
    LIMITS,
    EncoderAdvice,
    EncoderGroup,
    ReaderAdvice,
    confirm_by_runs,
    deciding_columns,
    limits_of,
    step_text,
)
from runtime.advisor.coarse_encoders import CoarseEncoders, mean_change
from runtime.core.cestac.result import weighed_change
from runtime.core.least_squares.estimate import Estimate
from runtime.core.signals.reader import Reader
from runtime.ground.limits import limits
from runtime.ground.progress import Work, at

LIMIT = limits(__package__)

Array = np.ndarray


def encoder_readers(listed: Mapping[str, Reader], own: str) -> dict[str, Reader]:
    """Choose the readers by which real encoders are judged, by name.

    A reader with two names is judged once: by the name `own` of the study, or else by the first.
    """
    suited = {name: reader for name, reader in listed.items() if reader.reads_encoders}
    names: dict[Reader, str] = {}
    for name, reader in suited.items():
        names[reader] = name if name == own else names.get(reader, name)
    return {name: reader for reader, name in names.items()}


def readers_in_words(readers: Mapping[str, Reader]) -> dict[str, str]:
    """Say of each reader what it reads positions as: "positions" or "counts".

    The name of the reader is added if another reader gives the same word.
    """
    read_as = {
        name: "positions" if reader.motion is None else "counts" for name, reader in readers.items()
    }
    alike = list(read_as.values())
    return {
        name: f"{word} ({name})" if alike.count(word) > 1 else word
        for name, word in read_as.items()
    }


def reader_advice(
    real: CoarseEncoders,
    name: str,
    read_as: str,
    reference: Estimate,
    groups: Sequence[EncoderGroup],
    start: float,
    *,
    asked: Sequence[float] = (),
    confirm: bool = True,
    work: Work | None = None,
) -> ReaderAdvice:
    """Compute how coarse real encoders may be if one reader reads them.

    name, read_as : name of the reader, and what it reads positions as, in words.
    reference : estimate of the records as measured, whose deciding parameters decide here.
    groups : the choices of coarse encoders.
    start : a step about which the curve begins, rad or m.
    asked : further steps, of all encoders.
    confirm : whether random runs confirm the limits.
    work : counts its parts: steps of a curve, and limits that runs confirm.
    """
    work = work or Work()
    at(f"real encoders, read as {read_as}")
    work.begin(parts_of_reader(groups, confirm))
    selections = {group.label: group.encoders for group in groups}
    by_label, encoders = curves(real, selections, start, reference, work), []
    work.left = len(LIMITS) * len(groups) * confirm
    for group in groups:
        delta, change = by_label[group.label][0], by_label[group.label][1][:, 0]
        found = limits_of(delta, change, reference)
        advice = EncoderAdvice(group.label, found, delta, change, unit=group.unit)
        if confirm:
            advice = confirm_by_runs(advice, reference, partial(real.sampled, group.encoders))
        encoders.append(advice)
        work.advance(len(LIMITS) * confirm)
    work.end()
    deviation = by_label[groups[0].label][1][:, 1]
    notes = [part.record.note for part in real.parts if part.record.note]
    steps = np.array([real.asked(delta) for delta in asked])
    return ReaderAdvice(
        name,
        read_as,
        tuple(encoders),
        (*notes, *uncertain(read_as, encoders[0], deviation, reference.names)),
        steps.reshape(len(asked), len(reference.names)),
    )


def parts_of_reader(groups: Sequence[EncoderGroup], confirm: bool) -> int:
    """Guess the parts of the work for one reader: steps of a curve and two limits, by group."""
    return len(groups) * (int(LIMIT.READER_DOWN) + len(LIMITS) * confirm)


def curves(
    real: CoarseEncoders,
    selections: Mapping[str, tuple[int, ...]],
    start: float,
    reference: Estimate,
    work: Work,
) -> dict[str, tuple[Array, Array]]:
    """Compute, for each group of coarse encoders, how the estimate changes with their step.

    A label names a group of encoders. Return for each label the steps, shape (m,), and the changes
    with their standard deviations, shape (m, 2, b), %.
    """
    start = min(max(start, real.finest), float(real.coarsest.min()))
    ratios: dict[str, dict[float, Array]] = {label: {} for label in selections}
    steps = ReadSteps(real, selections, start, reference, ratios, work)
    read_until_limits(steps)
    if real.reader.motion is None:
        read_locked_steps(steps)
    read_vague_steps(steps)
    return {label: steps.curve(label) for label in selections}


@dataclass(frozen=True, eq=False)
class ReadSteps:
    """Store of the estimates X with coarse encoders, by group of encoders and by step.

    The step of exponent k is start r^k, with the ratio r = READER_RATIO in limits.toml.

    Attributes
    ----------
    real : CoarseEncoders
    selections : mapping
        Numbers of the encoders of each group, by label.
    start : float, rad or m
    reference : Estimate
        Estimate from the records as measured, with the parameters that decide.
    ratios : dict
        By label and exponent k: estimates at the phases of the encoders over the exact estimate,
        shape (phases, b).
    work : Work
        Counts the steps.
    """

    real: CoarseEncoders
    selections: Mapping[str, tuple[int, ...]]
    start: float
    reference: Estimate
    ratios: dict[str, dict[float, Array]]
    work: Work

    def step(self, k: float | Array) -> Array:
        """Compute the steps of exponents k, rad or m."""
        return np.asarray(self.start * LIMIT.READER_RATIO**k)

    def read(self, k: float, labels: Iterable[str], more: int = 0) -> list[str]:
        """Store the estimates of some groups at the step of exponent k.

        The estimates are those at the first phases of the encoders, or at `more` further phases.
        Return the labels of the groups for which the step can be simulated and read.
        """
        real, delta = self.real, self.start * LIMIT.READER_RATIO**k
        coarsest = real.coarsest
        own = {label: self.selections[label] for label in labels}
        own = {label: group for label, group in own.items() if (delta <= coarsest[[*group]]).all()}
        moving = {i for group in own.values() for i in group if np.isfinite(coarsest[i])}
        if delta < real.finest * (1 - 1e-9) or not moving:
            return []
        try:
            errors = real.nodes(delta, sorted(moving), more)
            ratios = {label: real.ratios(errors, group) for label, group in own.items()}
        except np.linalg.LinAlgError:  # steps that this reader does not resolve
            return []
        for label, added in ratios.items():
            known = self.ratios[label]
            known[k] = np.concatenate([known[k], added]) if more else added
        self.work.advance(len(own))
        return list(own)

    def exponents(self) -> list[float]:
        """List the exponents of all steps that were read, ascending."""
        return sorted({k for known in self.ratios.values() for k in known})

    def changes(self, label: str) -> dict[float, Array]:
        """Compute change and standard deviation, shape (2, b), %, by exponent, ascending."""
        return {k: mean_change(ratios) for k, ratios in sorted(self.ratios[label].items())}

    def worst(self, label: str, k: float) -> float:
        """Compute the largest weighed change of a deciding parameter at the step of exponent k."""
        return float(self.weighed(self.ratios[label][k])[0, self.decisive].max(initial=0.0))

    @cached_property
    def decisive(self) -> list[int]:
        """Numbers of the parameters that decide."""
        return deciding_columns(self.reference)

    def weighed(self, ratios: Array) -> Array:
        """Compute weighed change and standard deviation, shape (2, b), at one step."""
        return weighed_change(mean_change(ratios), self.reference)

    def curve(self, label: str) -> tuple[Array, Array]:
        """Return steps, shape (m,), and changes with standard deviations, shape (m, 2, b), %."""
        changes, b = self.changes(label), len(self.real.reference)
        delta = self.step(np.array(list(changes), dtype=float))
        return delta, np.array(list(changes.values())).reshape(len(changes), 2, b)


def read_until_limits(steps: ReadSteps) -> None:
    """Read steps from the start down until all changes are below the first limit, then up until all
    are above the last limit.
    """
    groups = list(steps.selections)
    for k in range(0, -LIMIT.READER_DOWN, -1):
        e = [steps.worst(label, k) for label in steps.read(k, groups)]
        if not e or max(e) < LIMITS[0]:
            break
    for k in range(1, LIMIT.READER_UP):
        e = [steps.worst(label, k) for label in steps.read(k, groups)]
        if not e or min(e) > LIMITS[-1]:
            break
        more = np.log(LIMITS[-1] / max(min(e), 1e-9)) / (2 * np.log(LIMIT.READER_RATIO))
        steps.work.left = len(groups) * min(int(more), LIMIT.READER_UP - k)  # changes as Delta^2


def read_locked_steps(steps: ReadSteps) -> None:
    """Read finer steps where constant speeds of the record lock to the sampling."""
    for a, b in pairwise(steps.exponents()):
        between = np.linspace(a, b, LIMIT.LOCKED_STEPS + 1)
        share = steps.real.locking(steps.step(between))
        if share[1:-1].max() > LIMIT.LOCKED_POWER * max(share[0], share[-1]):
            for k in between[1:-1].tolist():
                steps.read(k, steps.selections)


def read_vague_steps(steps: ReadSteps) -> None:
    """Double the phases at the steps next to the limits, until the limits are certain.

    If a curve ends below the last limit, coarser steps are then read.
    """
    exhausted = set[tuple[str, float]]()  # steps at which no more phases can be read
    while vague := vague_groups(steps, exhausted):
        for (k, phases), labels in vague.items():
            done = steps.read(k, labels, phases)
            exhausted.update((label, k) for label in labels if label not in done)
            for label in done:
                read_on(steps, label, k)


def vague_groups(
    steps: ReadSteps, exhausted: set[tuple[str, float]]
) -> dict[tuple[float, int], list[str]]:
    """List the groups whose change is too uncertain, by exponent and number of known phases.

    exhausted : groups and exponents that are left out.
    """
    vague: dict[tuple[float, int], dict[str, None]] = {}
    for label, limit in product(steps.selections, LIMITS):
        weighed = {k: steps.weighed(one) for k, one in sorted(steps.ratios[label].items())}
        for k in vague_steps(weighed, steps.decisive, limit):
            phases = len(steps.ratios[label][k])
            if phases < LIMIT.PHASES_TAKEN and (label, k) not in exhausted:
                vague.setdefault((k, phases), {})[label] = None
    return {key: list(labels) for key, labels in vague.items()}


def read_on(steps: ReadSteps, label: str, k: float) -> None:
    """Read steps above exponent k, if k is the last exponent of a group and the curve is still
    below the last limit.
    """
    while (
        k == max(steps.ratios[label])
        and steps.worst(label, k) < LIMITS[-1]
        and steps.read(k + 1, [label])
    ):
        k += 1


def vague_steps(
    changes: Mapping[float, Array], decisive: Sequence[int], limit: float
) -> list[float]:
    """Find which encoder steps near the limiting step have too uncertain a change of X. At the
    limiting step, the weighed change of X is `limit`, for instance 1.

    The limiting step is between two steps. A step is returned if the standard deviation of its
    change moves the limiting step by more than a small share (CURVE_SHARPNESS in limits.toml), by
    straight lines on logarithmic axes. If even the finest step is above the limit, only this step
    is judged.

    changes : weighed change and its standard deviation, shape (2, b), by exponent of the step,
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


def uncertain(read_as: str, advice: EncoderAdvice, error: Array, names: Sequence[str]) -> list[str]:
    """Write a warning if the curve of the change is too flat to find the step of 1 or 5 % change.

    read_as : what the reader reads positions as, in words.
    error : standard deviation of the change, shape (m, b), %.
    """
    found = []
    for limit in advice.limits:
        if not np.isfinite(limit.delta):
            continue
        i = names.index(limit.parameter)
        e, apart = (
            np.abs(advice.change[:, i]),
            np.maximum(LIMIT.PREDICTION_AGREES * limit.change, 2 * error[:, i]),
        )
        first = advice.delta[(e < limit.change - apart) & (advice.delta < limit.delta)].max(
            initial=advice.delta[0]
        )
        last = advice.delta[(e > limit.change + apart) & (advice.delta > limit.delta)].min(
            initial=advice.delta[-1]
        )
        if last > LIMIT.FLAT_CURVE * first:
            found.append(
                f"Read as {read_as}, all encoders alike, from "
                f"{step_text(first, advice.unit)} to {step_text(last, advice.unit)}: the predicted "
                f"change of {limit.parameter} is {limit.change:.2g} %, within the accuracy of the "
                "prediction. Simulate the encoder's own step: symgen cestac --rounding phase "
                "--delta STEP."
            )
    return found
