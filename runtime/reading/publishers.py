"""Find the messages of a second publisher among those of a ROS topic.

Several nodes may publish on one topic, for instance the driver of an arm and a node that repeats
its positions without efforts. A record must contain the messages of one publisher: between messages
of two publishers, efforts would be interpolated from one to the other. Publishers are distinguished

    by their names        the node in a ROS 1 bag, the channel of an MCAP file, the frame_id and the
                          counter seq of the header
    by their efforts      missing, or all zero in single messages between others that are not zero
    by their stamps       two regular trains of stamps, whose values do not continue each other

A publisher without efforts is left out and named. If two publishers have values, or if it is
uncertain which messages the second publisher sent, the record is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from runtime.ground.errors import InputError

Array = np.ndarray

REMEDY = "keep the messages of one publisher only, for instance record it on a topic of its own"
JUMP = 5.0  # times the usual change of an effort: less is the noise of a torque near zero
QUANTA = 3.0  # steps of an effort that is written in steps; less is a torque near zero
BRIEF = 3.0  # periods of the other messages; efforts that are zero for longer are a pause
FEWEST = 3  # interruptions of one kind that are no accident
RARE = 0.01  # of the messages: single failures, which a median filter removes
FILLED = 1.25  # periods of the other messages, where none of them is missing
LOOKED_AT = 2000  # messages in which trains of stamps are searched
OFF = 0.1  # periods that the stamps of a train may be off
MOST_PUBLISHERS = 20  # of one topic; more names or counters name no publishers
LARGEST_STEP = 100  # of the counter of a publisher: messages that were lost in between


@dataclass(frozen=True, eq=False)
class Sent:
    """The data of the messages of a topic that may show their publishers.

    Attributes
    ----------
    topic, file : str
        Names for messages to the user.
    senders : tuple of str
        Name of the publisher of each of N messages, as the bag gives it.
    stamps : ndarray of int, shape (N,), ns
    values : ndarray, shape (N, c)
        The columns of the record; nan where a message has no value.
    efforts : ndarray of bool, shape (c,)
        Whether a column is an effort.
    """

    topic: str
    file: str
    senders: tuple[str, ...]
    stamps: Array
    values: Array
    efforts: Array

    @property
    def silent(self) -> Array:
        """Whether a message has no effort that is not zero, shape (N,)."""
        tau = self.values[:, self.efforts]
        return np.asarray(self.efforts.any() & ((tau == 0) | np.isnan(tau)).all(axis=1))

    def refused(self, reason: str) -> InputError:
        """Make the error that names the file, the reason, and what to record instead."""
        return InputError(f"{reason}; {REMEDY}", file=self.file)


def of_one_publisher(sent: Sent) -> tuple[Array, str]:
    """Select the messages of one publisher; return a mask, shape (N,), and a sentence on the others.

    Raise InputError if messages of two publishers have values, or cannot be distinguished.
    """
    kept, notes = np.ones(len(sent.stamps), dtype=bool), []
    for rule in (_by_names, _by_efforts, _by_stamps):
        part, note = rule(_only(sent, kept))
        kept[np.flatnonzero(kept)[~part]] = False
        notes += [note] if note else []
    return kept, ". ".join(notes)


def counted_senders(counters: Sequence[int]) -> list[str]:
    """Name publishers by the counter in the header of their messages, which each of them increases.

    A counter that is not constant and does not rise by one for each publisher gives no information:
    every name is then "".
    """
    last: list[int] = []  # by publisher
    steps: list[list[int]] = []
    of = []
    nothing = [""] * len(counters)
    if len(set(counters)) == 1:
        return nothing
    for count in counters:
        behind = [k for k, c in enumerate(last) if c < count <= c + LARGEST_STEP]
        if not behind:
            last.append(count)
            steps.append([])
            k = len(last) - 1
        else:
            k = max(behind, key=lambda k: last[k])
            steps[k].append(count - last[k])
            last[k] = count
        of.append(k)
        if len(last) > MOST_PUBLISHERS:
            return nothing
    if any(len(step) < FEWEST or np.median(step) != 1 for step in steps):
        return nothing
    return [f"the one that counts to {last[k]}" for k in of]


def _only(sent: Sent, kept: Array) -> Sent:
    senders = tuple(np.array(sent.senders, dtype=object)[kept])
    return Sent(sent.topic, sent.file, senders, sent.stamps[kept], sent.values[kept], sent.efforts)


def _by_names(sent: Sent) -> tuple[Array, str]:
    """Keep the only publisher with values, of several whose messages alternate."""
    everything = np.ones(len(sent.stamps), dtype=bool)
    names = tuple(dict.fromkeys(sent.senders))
    if not 1 < len(names) <= MOST_PUBLISHERS:
        return everything, ""
    of = {name: np.array([x == name for x in sent.senders]) for name in names}
    if not _alternate(list(of.values())):
        return everything, ""
    whole = ~np.isnan(sent.values).any(axis=1)
    speaking = {name: mask for name, mask in of.items() if (mask & whole & ~sent.silent).any()}
    if not speaking or _alternate(list(speaking.values())):
        listed = ", ".join(speaking or of)
        raise sent.refused(
            f"{len(speaking or of)} publishers ({listed}) send these joints on {sent.topic} at the "
            "same time, and the messages of both would be mixed"
        )
    others = [name for name in of if name not in speaking]
    kept = np.logical_or.reduce(list(speaking.values()))
    why = "without efforts" if sent.efforts.any() else "without all these joints"
    return kept, (
        f"{np.count_nonzero(~kept)} of {len(kept)} messages on {sent.topic} are of another publisher "
        f"({', '.join(others)}), {why}, and are left out"
    )


def _alternate(masks: Sequence[Array]) -> bool:
    """Whether the messages of two publishers alternate, instead of following each other in two
    blocks.
    """
    ends = [np.flatnonzero(mask)[[0, -1]] for mask in masks]
    return any(a[0] < b[1] and b[0] < a[1] for a, b in combinations(ends, 2))


def _by_efforts(sent: Sent) -> tuple[Array, str]:
    """Leave out messages without efforts that come between the regular messages of a publisher."""
    silent = sent.silent
    loud = np.flatnonzero(~silent)
    everything = np.ones(len(silent), dtype=bool)
    if not silent.any() or len(loud) < 2 * FEWEST:
        return everything, ""
    step = np.diff(sent.stamps[loud])
    brief = step <= BRIEF * np.median(step)
    across = brief & (np.diff(loud) > 1)
    broken = across & (_jumps(sent, loud) | _missing(sent, loud))
    if np.count_nonzero(broken) < max(FEWEST, np.count_nonzero(across) / 2):
        return everything, ""
    kept = ~silent
    for k in np.flatnonzero(~brief).tolist():  # pauses
        kept[loud[k] : loud[k + 1]] = True
    count = f"{np.count_nonzero(~kept)} of {len(kept)} messages on {sent.topic}"
    if np.median(step[across]) <= FILLED * np.median(step[brief]):
        return kept, (
            f"{count} have no efforts, or only zeros, and lie between the others: those of a "
            "second publisher, which are left out"
        )
    if np.count_nonzero(~kept) < RARE * len(kept):
        return everything, f"{count} have no efforts, or only zeros, between others that have"
    raise sent.refused(
        f"{count} have no efforts, or only zeros, between others that have: a second publisher, or a "
        "driver that fails to read"
    )


def _jumps(sent: Sent, loud: Array) -> Array:
    """Whether efforts that are zero between two of the messages `loud` would be a jump, by pair.

    The mean of both efforts is compared with the usual deviation of an effort from the mean of its
    neighbours, and with the step in which efforts are written.
    """
    tau = sent.values[loud][:, sent.efforts]
    usual = np.abs(tau[1:-1] - (tau[2:] + tau[:-2]) / 2)
    changes = np.abs(np.diff(tau, axis=0))
    steps = np.nanmin(np.where(changes > 0, changes, np.inf), axis=0, initial=np.inf)
    steps[np.isinf(steps)] = 0
    least = np.maximum(JUMP * np.nanmedian(usual, axis=0), QUANTA * steps)
    return np.asarray((np.abs(tau[1:] + tau[:-1]) / 2 > least).any(axis=1))


def _missing(sent: Sent, loud: Array) -> Array:
    """Whether the messages between two of the messages `loud` have no efforts at all, by pair."""
    none = np.isnan(sent.values[:, sent.efforts]).all(axis=1)
    before = np.concatenate([[0], np.cumsum(none)])
    return np.asarray(before[loud[1:]] > before[loud[:-1] + 1])


def _by_stamps(sent: Sent) -> tuple[Array, str]:
    """Refuse messages whose stamps are two regular trains of values that do not continue each other."""
    everything = np.ones(len(sent.stamps), dtype=bool)
    t = (sent.stamps[:LOOKED_AT] - sent.stamps[0]).astype(float)
    x = sent.values[:LOOKED_AT]
    if np.isnan(x).any() or not _irregular(t):
        return everything, ""
    first = _train(t)
    if first is None:
        return everything, ""
    others = np.setdiff1d(np.arange(len(t)), first)
    others = others[(others > first[1]) & (others < first[-2])]
    if not _regular(t[others]):
        return everything, ""
    if _continue(t, x, first, others):
        return everything, ""
    raise sent.refused(
        f"the stamps on {sent.topic} are of two publishers, with steps of "
        f"{np.median(np.diff(t[first])) / 1e6:.3g} ms and {np.median(np.diff(t[others])) / 1e6:.3g} ms, "
        "whose values do not continue each other"
    )


def _irregular(t: Array) -> bool:
    """Whether one in twenty steps of increasing stamps differs from the median step."""
    step = np.diff(t)
    if len(step) < 4 * FEWEST or (step < 0).any():
        return False
    return bool(np.mean(np.abs(step / np.median(step) - 1) > OFF) > 0.05)


def _regular(t: Array) -> bool:
    """Whether stamps are those of one train, from which one in ten may be missing."""
    if len(t) <= FEWEST:
        return False
    step = np.diff(t)
    return bool(np.mean(np.abs(step / np.median(step) - 1) <= OFF) >= 0.9)


def _train(t: Array) -> Array | None:
    """Find a regular train of stamps that begins with one of the first stamps; None if there is no
    train.

    Return the numbers of its messages; among several trains, the longest is returned.
    """
    best = None
    for a, b in combinations(range(min(6, len(t))), 2):
        period = t[b] - t[a]
        if period <= 0:
            continue
        found = [a, b]
        while True:
            expected = t[found[-1]] + period
            k = int(np.searchsorted(t, expected))
            near = [i for i in (k - 1, k) if found[-1] < i < len(t)]
            nearest = min(near, key=lambda i: abs(t[i] - expected), default=None)
            if nearest is None or abs(t[nearest] - expected) > OFF * period:
                break
            found.append(nearest)
        whole = t[-1] - t[found[-1]] < 2 * period
        if whole and len(found) < len(t) and (best is None or len(found) > len(best)):
            best = np.array(found)
    return best


def _continue(t: Array, x: Array, first: Array, others: Array) -> bool:
    """Whether the values at the messages `others` lie between those of the train `first`.

    Rounded stamps, or stamps late by a constant time, do not count as a difference: the part of the
    difference that is a delay is subtracted.
    """
    at = t[first]
    between = np.stack([np.interp(t[others], at, column) for column in x[first].T], axis=1)
    slopes = np.gradient(x[first], at, axis=0)
    speed = np.stack([np.interp(t[others], at, column) for column in slopes.T], axis=1)
    usual = np.abs(x[first][1:-1] - (x[first][2:] + x[first][:-2]) / 2)
    scale = JUMP * np.median(usual, axis=0) + 1e-9 * np.abs(x).max(axis=0) + 1e-300
    difference, speed = (x[others] - between) / scale, speed / scale
    square = float((speed**2).sum())
    late = 0.0 if square == 0 else float((speed * difference).sum()) / square
    left = np.abs(difference - late * speed)
    return bool((np.median(left, axis=0) <= 1).all())
