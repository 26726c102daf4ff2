"""The filters of `runtime.observation.filters` and `runtime.observation.decimation` for signals that do not fit into memory: samples go in by pieces, results come out.

    y = stage.push(x)       what the samples so far determine        (perhaps nothing yet)
    y = stage.finish()      the rest, after the last sample

A stage gives what the whole-record function gives, both ends included. Forward recursions carry their state. A backward recursion would need the
end of the record first: it starts `ahead` samples later than what it returns instead, from the steady state there. What it does not know decays by
|lambda| per sample, lambda the slowest pole, so with |lambda|^ahead <= TRUNCATION the error is below TRUNCATION of the signal times the small
constant of the modal form (decimation: 5.2), four orders of magnitude below rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, log
from typing import Protocol

import numpy as np
from scipy.signal import sosfilt, sosfilt_zi

from runtime.observation.decimation import Plan, copy_overlap, recursion
from runtime.observation.filters import butterworth, derivative, median_filtered, require_longer
from runtime.settings.study import Lowpass, Signals

Array = np.ndarray

TRUNCATION = 1e-20
DIFFERENCE = 2  # samples of reach, so that one-sided differences of second order find three samples


class Stage(Protocol):
    """One step of a chain of filters."""

    def push(self, x: Array) -> Array:
        """What the samples so far, x being the next ones, determine of the result."""

    def finish(self) -> Array:
        """The rest of the result."""


class Local:
    """A filter whose value at a sample depends on `reach` samples before and after; samples along the first axis."""

    def __init__(self, function: Callable[[Array], Array], reach: int) -> None:
        self.function, self.reach = function, reach
        self.held: Array | None = None  # 2 reach samples that were returned, then those that were not
        self.returned = 0  # of those held

    def push(self, x: Array) -> Array:
        """Results up to `reach` samples before the last one; x, shape (B, n)."""
        self.held = x if self.held is None else np.concatenate([self.held, x])
        return self._result(self.held, len(self.held) - self.reach)

    def finish(self) -> Array:
        """Results at the end of the record."""
        return np.empty((0, 0)) if self.held is None else self._result(self.held, len(self.held))

    def _result(self, held: Array, stop: int) -> Array:
        if stop <= self.returned:
            return held[:0]
        y = self.function(held)[self.returned : stop]
        forgotten = max(stop - 2 * self.reach, 0)
        self.held, self.returned = held[forgotten:], stop - forgotten
        return y


def memory(sos: Array) -> int:
    """Samples after which a filter has forgotten all but TRUNCATION of its state; sos, shape (sections, 6)."""
    slowest = max(np.abs(np.roots(section[3:])).max() for section in sos)
    return ceil(log(TRUNCATION) / log(slowest))


class ZeroPhase:
    """`signals.zero_phase` along the first axis: forward and backward after odd reflection of `pad` samples at each end."""

    def __init__(self, sos: Array, pad: int) -> None:
        self.sos, self.pad, self.zi = sos, pad, sosfilt_zi(sos)[..., None]
        self.ahead = memory(sos)
        self.waiting: list[Array] = []  # forward results not yet filtered backward
        self.state: Array | None = None  # of the forward filter; None before more than `pad` samples have come
        self.last = np.empty((0, 0))  # the last pad + 1 samples

    def push(self, x: Array) -> Array:
        """Results up to `ahead` samples before the last one, when there are at least twice as many; x, shape (B, n)."""
        if not len(x):
            return x
        if self.state is None:
            x = np.concatenate([self.last.reshape(-1, x.shape[1]), x])
            if len(x) <= self.pad:
                self.last = x
                return x[:0]
            before = 2 * x[:1] - x[self.pad : 0 : -1]
            _, self.state = sosfilt(self.sos, before, axis=0, zi=self.zi * before[0])
            self.last = x[:0]
        f, self.state = sosfilt(self.sos, x, axis=0, zi=self.state)
        self.last = np.concatenate([self.last, x])[-self.pad - 1 :]
        self.waiting.append(f)
        count = sum(map(len, self.waiting)) - self.ahead
        if count < 2 * self.ahead:
            return x[:0]
        f = np.concatenate(self.waiting)
        self.waiting = [f[count:]]
        return self._backward(f)[:count]

    def finish(self) -> Array:
        """Results at the end of the record."""
        if self.state is None:
            require_longer(len(self.last), self.pad)
        after = 2 * self.last[-1:] - self.last[-2::-1]
        f, _ = sosfilt(self.sos, after, axis=0, zi=self.state)
        return self._backward(np.concatenate([*self.waiting, f]))[: -self.pad]

    def _backward(self, f: Array) -> Array:
        y, _ = sosfilt(self.sos, f[::-1], axis=0, zi=self.zi * f[-1])
        return np.asarray(y[::-1])


class StreamedDecimation:
    """`decimation.Decimation` of signals that come in any pieces: rows (S, B) in, kept samples (S, k) out. Pieces of whole blocks are not copied."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.ahead = plan, ceil(log(TRUNCATION) / log(np.abs(plan.step).max()))
        self.taken = 0  # samples so far
        self.first, self.last = np.empty((0, 0)), np.empty((0, 0))  # of the record, as in Decimation
        self.rest = np.empty((0, 0))  # samples behind the last block that was complete
        self.block = 0  # blocks the forward recursion has passed
        self.x: Array | None = None  # its state, shape (S, 2 m)
        self.waiting: list[tuple[Array, Array]] = []  # drive of the backward recursion (B, S, 2 m), and y without its effect (B, S, G)
        self.count = 0  # blocks that wait

    def push(self, u: Array) -> Array:
        """Kept samples of all blocks but the last `ahead` ones, when there are at least twice as many."""
        p, t0 = self.plan, self.taken
        if not t0:
            self.first, self.last, self.rest = np.empty((len(u), len(p.X0))), np.empty((len(u), len(p.A))), u[:, :0]
        self.taken += u.shape[1]
        copy_overlap(u, t0, self.first, 0)
        copy_overlap(u, t0, self.last, p.N - len(p.A))
        u = np.concatenate([self.rest, u], axis=1) if self.rest.size else u
        if self.x is None and self.taken >= len(p.X0):
            self.x, u = self.first @ p.X0, u[:, p.phase :]
        if self.x is not None:
            u = self._forward(self.x, u)
        self.rest = u.copy()
        count = self.count - self.ahead
        return self._backward(np.zeros((len(u), len(p.Mx))), count) if count >= 2 * self.ahead else u[:, :0]

    def finish(self) -> Array:
        """The kept samples at the end of the record."""
        p = self.plan
        if self.x is None:
            raise ValueError(f"{self.taken} samples were pushed; the plan is for {p.N}")
        end = self.last @ p.A + self.x @ p.Ax
        m2 = len(p.Mx)
        return np.concatenate([self._backward(end[:, :m2], self.count), end[:, m2:]], axis=1)

    def _forward(self, x: Array, u: Array) -> Array:
        """Pass the blocks that are complete in u, the samples from the next block on; returns what is left of u."""
        p, S, m2 = self.plan, len(u), len(self.plan.Mx)
        B = min(p.blocks - self.block, u.shape[1] // p.L)
        if B < 1:
            return u
        products = (u[:, : B * p.L].reshape(-1, p.L) @ p.PQY).reshape(S, B, -1).swapaxes(0, 1)
        states = np.empty((B + 1, S, m2))
        states[0] = x
        recursion(p.step, states, np.ascontiguousarray(products[..., :m2]))
        self.x, before = states[-1], states[:-1].reshape(-1, m2)
        drive = products[..., m2 : 2 * m2] + (before @ p.Mx).reshape(B, S, m2)
        self.waiting.append((drive, products[..., 2 * m2 :] + (before @ p.Yx).reshape(B, S, -1)))
        self.block, self.count = self.block + B, self.count + B
        return u[:, B * p.L :]

    def _backward(self, v: Array, count: int) -> Array:
        """y of the first `count` blocks that wait, from v at the end of the last of them."""
        if not self.count:
            return np.empty((len(v), 0))
        drive, known = (np.concatenate(x) for x in zip(*self.waiting, strict=True))
        states = np.empty_like(drive)
        states[-1] = v
        recursion(self.plan.step, states[::-1], drive[:0:-1])
        y = known[:count] + (states[:count].reshape(-1, states.shape[2]) @ self.plan.Yv).reshape(count, len(v), -1)
        self.waiting, self.count = [(drive[count:], known[count:])], self.count - count
        return np.asarray(y.swapaxes(0, 1).reshape(len(v), -1))


class Chain:
    """Stages one after the other."""

    def __init__(self, *stages: Stage) -> None:
        self.stages = stages

    def push(self, x: Array) -> Array:
        """Through every stage."""
        for stage in self.stages:
            x = stage.push(x)
        return x

    def finish(self) -> Array:
        """The end of every stage goes through the next one."""
        x = np.empty((0, 0))
        for stage in self.stages:
            parts = [part for part in ([stage.push(x)] if x.size else []) + [stage.finish()] if part.size]
            x = np.concatenate(parts) if parts else x[:0]
        return x


def median_stage(window: int) -> list[Stage]:
    """`signals.median_filtered`."""
    return [] if window == 1 else [Local(lambda x: median_filtered(x, window), window // 2)]


def lowpass_stage(rate: float, low: Lowpass | None, signal: str) -> list[Stage]:
    """`signals.lowpass_filtered` of "q" or "qd" where the settings ask for it."""
    if low is None or signal not in low.on:
        return []
    return [ZeroPhase(*butterworth(rate, low))]


def derivative_stage(rate: float, ends: str) -> Stage:
    """`signals.derivative`."""
    return Local(lambda x: derivative(x, rate, ends), DIFFERENCE)


def position_stage(rate: float, signals: Signals) -> Chain:
    """Measured to filtered positions."""
    return Chain(*median_stage(signals.median), *lowpass_stage(rate, signals.lowpass, "q"))


def velocity_stage(rate: float, signals: Signals) -> Chain:
    """Filtered positions to filtered velocities."""
    return Chain(derivative_stage(rate, signals.ends), *lowpass_stage(rate, signals.lowpass, "qd"))
