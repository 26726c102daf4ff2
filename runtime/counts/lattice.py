"""Conversion of encoder positions to counts: position = count step + phase (a constant offset).

Contradictions in the record are reported or refused. The step comes from a data sheet or from the
record, the phase from the record alone. Counts cannot show whether a driver truncates or rounds,
nor an offset of the joint zero of up to half a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime.ground.errors import InputError

Array = np.ndarray

OFF = 0.1
"""rms distance from the lattice, steps, from which positions are none of its points; positions
anywhere have 0.29.
"""
WRAPS = (16, 32)
"""Bits of counters."""
INTERPOLATED = (1, 2, 4)
"""Counts by which a count may change at least, where the step is that of the record."""
FAST = 20
"""Median change of the count from sample to sample, where it changes, above which a record tells of
positions alone.
"""
FEW = 50
"""Changes of a count below which little is known of its motion."""
UNEQUAL = 1.01
"""Ratio of the steps of two encoders above which they are not the same kind."""
JUMP = 30
"""A change of the count this many times its neighbours is none of a motion."""
SHAKEN = 0.009
"""Share of the changes of an encoder that cross a line the third time in a row, from which its
motion counts as shaken.
"""
FEWEST = 1000
"""Changes from which a share is one: nine such passages at least, since a coarse encoder sees one
or two where a joint turns back near a line.
"""


@dataclass(frozen=True, eq=False)
class Lattice:
    """Grid of the positions that n encoders can report: counts times step, plus an offset (phase).

    Attributes
    ----------
    step, phase : ndarray, shape (n,), rad or m
    findings : tuple of str
        Sentences about the steps and the motion.
    counted : tuple of tuple of int
        For each encoder: how many counts of the device one step may be.
    rounded : bool
        Whether positions differ a little from the lattice, as if they had been rounded to few
        digits.
    """

    step: Array
    phase: Array
    findings: tuple[str, ...] = ()
    counted: tuple[tuple[int, ...], ...] = ()
    rounded: bool = False

    def counts(self, position: Array) -> Array:
        """Convert positions to counts, shape (N, n), as floats; nan if the position is missing."""
        return np.asarray(np.round((position - self.phase) / self.step))

    def position(self, counts: Array) -> Array:
        """Convert counts to positions, shape (N, n), in rad or m."""
        return np.asarray(counts * self.step + self.phase)


def lattice(
    position: Array,
    step: Array | Sequence[float] | float | None = None,
    *,
    name: str = "record",
) -> Lattice:
    """Find the step and the offset (phase) of encoder positions: position = count step + phase.

    step : step in rad or m, for all encoders or for each; default: from the record.

    Raises InputError if a step is not positive or is larger than the motion, or if the positions
    are not multiples of the step.
    """
    n = position.shape[1]
    if step is not None:
        given = np.atleast_1d(np.asarray(step, dtype=float))
        if given.shape not in {(1,), (n,)} or not (np.isfinite(given).all() and (given > 0).all()):
            raise InputError(
                (
                    f"step {step}; expected a positive number (rad or m), or {n} such numbers, one "
                    "for each encoder"
                ),
                file=name,
            )
        step = np.broadcast_to(given, (n,))
    if not any(np.nanmax(x) > np.nanmin(x) for x in position.T if np.isfinite(x).any()):
        raise InputError(
            "no position changes, so the counts do not contain a motion; record a motion",
            file=name,
        )
    steps, phases, shares, findings = np.empty(n), np.empty(n), np.zeros(n), []
    rounded = False
    for j in range(n):
        x, label = position[np.isfinite(position[:, j]), j], f"encoder {j + 1}"
        if not len(x):
            raise InputError(
                (
                    f"{label}: all positions are missing; record the positions of its joint, or remove "
                    "this joint from the robot file"
                ),
                file=name,
            )
        steps[j], said = _step(x, None if step is None else float(step[j]), label, name)
        phases[j] = _phase(x, steps[j])
        counts = np.round((x - phases[j]) / steps[j])
        findings += [*said, *_speed(np.diff(counts), label)]
        shares[j] = shaken_share(counts)
        off = _distance(x, steps[j], phases[j])
        if off > OFF:
            raise InputError(f"{label}: {_off(x, off, steps[j], step is None)}", file=name)
        if off > OFF / 5:
            rounded = True
            findings.append(
                f"{label}: positions lie {off:.2g} steps (rms) off the lattice of step "
                f"{steps[j]:.6g}, as if rounded to few digits"
            )
    if shares.max() > SHAKEN:
        findings.append(
            f"encoder {np.argmax(shares) + 1}: {100 * shares.max():.0f} % of its changes cross one "
            "line to and fro; the joint shakes, as if the controller answers single counts. The "
            "counts do not show this shaking: the estimated motion and its deviations are those "
            "of the smooth motion alone. Compare the result with signals: {reader: lowpass}, "
            "since either may be nearer to the truth"
        )
    if step is None:
        moving = sum(bool(np.nanmax(x) > np.nanmin(x)) for x in position.T)
        unequal = steps.max() > UNEQUAL * steps.min() and moving > 1
        text = f"steps from the record: {', '.join(f'{x:.6g}' for x in steps)}"
        findings.insert(
            0, f"{text}; the encoders differ, compare with their data sheets" if unequal else text
        )
    counted = [INTERPOLATED] * n if step is None else [(round(x),) for x in steps / step]
    return Lattice(steps, phases, tuple(findings), tuple(counted), rounded)


def smallest_step(x: Array) -> float:
    """Estimate the step of an encoder from the distances between its positions x, shape (N,).

    The result is 0 if the positions never change.
    """
    values = np.unique(x)
    gaps = np.diff(values)
    gaps = gaps[gaps > 1e-9 * max(np.ptp(values), np.abs(values).max() * 1e-5)]
    if not len(gaps):
        return 0.0
    least = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    for _ in range(3):  # gaps are few steps each: their sum over their number of steps
        near = gaps[gaps < 20.5 * least]
        least = float(near.sum() / np.round(near / least).sum())
    return least


def to_and_fro(counts: Array) -> Array:
    """Find the moments at which counts cross the same encoder line three times in a row.

    Returns, shape (m, 2), the sample before the first change and the sample behind the last. The
    counts have shape (N,), none missing. A smooth motion crosses a line once, or twice if it turns
    back between two lines.
    """
    change = np.diff(counts)
    at = np.flatnonzero(change)
    same = np.diff(counts[at] + change[at] / 2) == 0
    third = np.flatnonzero(same[1:] & same[:-1])
    return np.stack([at[third], at[third + 2] + 1], axis=1)


def shaken_share(counts: Array) -> float:
    """Compute the share of count changes that cross the same encoder line the third time in a row.

    A large share shows that the motion shakes.
    """
    return len(to_and_fro(counts)) / max(int(np.count_nonzero(np.diff(counts))), FEWEST)


def unwrapped_counts(
    position: Array,
    step: Array | Sequence[float] | float | None = None,
    *,
    name: str = "record",
) -> tuple[Lattice, Array, tuple[str, ...]]:
    """Convert positions to counts, and undo the overflows of a 16-bit or 32-bit counter.

    Returns the lattice of the positions (see `lattice`), the counts, shape (N, n), and a sentence
    for each encoder that overflows. Raises InputError if counts jump otherwise.
    """
    lattice_of_all = lattice(position, step, name=name)
    counts = lattice_of_all.counts(position)
    findings = []
    for j, counted in enumerate(lattice_of_all.counted):
        known = np.flatnonzero(np.isfinite(counts[:, j]))
        k = counts[known, j]
        change = np.diff(k)
        near = np.maximum(np.abs(np.roll(change, 1)), np.abs(np.roll(change, -1)))
        near = np.maximum(near, np.maximum(np.abs(np.roll(change, 2)), np.abs(np.roll(change, -2))))
        near = (near + 2) * np.diff(known)
        jumps = np.flatnonzero(np.abs(change) > JUMP * near)
        if not len(jumps):
            continue
        size, moved, at = change[jumps], 2 * near[jumps], known[jumps + 1]
        periods = {2**bits / steps: bits for bits in WRAPS for steps in counted}  # bits by steps
        wrap = next((w for w in periods if (np.abs(np.abs(size) - w) <= moved).all()), None)
        if wrap is None:
            is_wrap = np.any([np.abs(np.abs(size) - w) <= moved for w in periods], axis=0)
            first = int(np.argmin(is_wrap))
            raise InputError(
                f"encoder {j + 1}: the count jumps by {size[first]:.0f} at sample {at[first]}; "
                "the encoder was reset or its count was lost, cut the record at such samples",
                file=name,
            )
        turns = np.zeros(len(k))
        turns[jumps + 1] = -np.sign(size) * wrap
        counts[known, j] = k + np.cumsum(turns)
        findings.append(
            f"encoder {j + 1}: the count wraps at 2^{periods[wrap]} {len(jumps)} times; symgen "
            "made the count continuous from the first sample on, so the zero of the joint must "
            "belong to the turn of this sample"
        )
    return lattice_of_all, counts, tuple(findings)


def _step(x: Array, given: float | None, label: str, name: str) -> tuple[float, list[str]]:
    span = float(np.ptp(x))
    if given is None:
        own = smallest_step(x)
        if own == 0:
            return 1.0, [f"{label}: the count never changes; the position is taken as at rest"]
        return own, []
    if span == 0:
        return given, [
            (
                f"{label}: the count never changes; the position is known to "
                f"{given / np.sqrt(12):.3g} "
                "and taken as at rest"
            )
        ]
    if given > 1.5 * span:
        raise InputError(
            (
                f"{label}: step {given:g} is larger than the motion of the encoder, {span:g}; correct "
                f"signals.step or signals.side (whether {label} measures the motor or the joint)"
            ),
            file=name,
        )
    changes = np.abs(np.round(np.diff(x) / given))
    changes = changes[changes > 0].astype(np.int64)
    common = int(np.gcd.reduce(changes)) if len(changes) >= 20 else 1
    if common > 1:
        return common * given, [
            (
                f"{label}: counts change by multiples of {common}; the step of the record is "
                f"{common * given:.6g}, not {given:.6g}"
            )
        ]
    return given, []


def _phase(x: Array, step: float) -> float:
    return float(step * np.angle(np.exp(2j * np.pi * (x / step)).mean()) / (2 * np.pi))


def _distance(x: Array, step: float, phase: float) -> float:
    cell = (x - phase) / step
    return float(np.sqrt(np.mean((cell - np.round(cell)) ** 2)))


def _off(x: Array, off: float, step: float, own: bool) -> str:
    """Write the error message for positions that are no multiples of the encoder step.

    `off` is their distance from the nearest multiples, in steps (rms).
    """
    text = f"positions are {off:.2g} steps (rms) away from the values that an encoder of step {step:.6g} reports"
    suggested = 0.0 if own else smallest_step(x)
    if suggested and _distance(x, suggested, _phase(x, suggested)) < OFF / 5:
        part, remedy = step / suggested, f"set signals.step to {suggested:.6g} for this encoder"
        if part > 1.5 and abs(part - round(part)) < 0.01:
            return (
                f"{text}, but fit a step {round(part)} times finer: {remedy}, or, if a driver "
                "averaged that number of samples, record the counts"
            )
        return f"{text}, but fit step {suggested:.6g}: {remedy}"
    return (
        f"{text}; the positions were filtered, interpolated or converted by a driver or by "
        "record.resample, or the step is wrong: correct signals.step, "
        "record the counts, or use reader: lowpass"
    )


def _speed(change: Array, label: str) -> list[str]:
    moving = np.abs(change[change != 0])
    if 0 < len(moving) < FEW:
        return [
            (
                f"{label}: the count changes {len(moving)} times only, so the motion is known only "
                "at these times; move further or use a finer encoder"
            )
        ]
    if len(moving) and (fast := float(np.median(moving))) > FAST:
        return [
            (
                f"{label}: the count changes by {fast:.0f} a sample; single changes are not "
                "visible, so counts contain no more than positions; log at a higher rate"
            )
        ]
    return []
