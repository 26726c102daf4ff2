"""The filters of `runtime.signals` and `runtime.decimation` for signals that do not fit into memory: samples go in by pieces, results come out.

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

from runtime.decimation import Plan
from runtime.signals import butterworth, derivative, median_filtered, require_longer
from runtime.study import Lowpass, Signals

Array = np.ndarray

TRUNCATION = 1e-20


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


class ZeroPhase:
    """`signals.zero_phase` along the first axis: forward and backward after odd reflection of `pad` samples at each end."""

    def __init__(self, sos: Array, pad: int) -> None:
        self.sos, self.pad, self.zi = sos, pad, sosfilt_zi(sos)[..., None]
        slowest = max(np.abs(np.roots(section[3:])).max() for section in sos)
        self.ahead = ceil(log(TRUNCATION) / log(slowest))
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
    """`decimation.decimate` by one plan, of signals that come in any pieces: rows (S, B) in, kept samples (S, k) out."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.ahead = plan, ceil(log(TRUNCATION) / log(np.abs(plan.step).max()))
        self.raw, self.base = np.empty((0, 0)), 0  # samples still needed, and the number of the first one
        self.block = 0  # blocks the forward recursion has passed
        self.x: Array | None = None  # its state, complex, shape (S, m)
        self.drive: list[Array] = []  # of the backward recursion, complex, shape (S, m), by block not yet returned
        self.known: list[Array] = []  # the part of y that does not depend on what follows, shape (S, G), by block

    def push(self, u: Array) -> Array:
        """Kept samples of all blocks but the last `ahead` ones, when there are at least twice as many."""
        p = self.plan
        self.raw = np.concatenate([self.raw.reshape(len(u), -1), u], axis=1)
        if self.x is None:
            if self.raw.shape[1] < len(p.X0):
                return u[:, :0]
            self.x = (self.raw[:, : len(p.X0)] @ p.X0).view(complex)
        self._forward()
        count = len(self.drive) - self.ahead
        if count < 2 * self.ahead:
            return u[:, :0]
        y = self._backward(np.zeros_like(self.x), count)
        self.drive, self.known = self.drive[count:], self.known[count:]
        return y

    def finish(self) -> Array:
        """The kept samples at the end of the record."""
        p = self.plan
        if self.x is None:
            require_longer(self.raw.shape[1], len(p.X0) - 1)
            raise ValueError(f"{self.raw.shape[1]} samples were pushed; the plan is for {p.N}")
        end = self.raw[:, -len(p.A) :] @ p.A + self.x.view(float) @ p.Ax
        m2 = len(p.Mx)
        v = np.ascontiguousarray(end[:, :m2]).view(complex)
        return np.concatenate([self._backward(v, len(self.drive)), end[:, m2:]], axis=1)

    def _forward(self) -> None:
        p, S, x = self.plan, len(self.raw), self.x
        assert x is not None
        stop = min(p.blocks, (self.base + self.raw.shape[1] - p.phase) // p.L)
        start = p.phase + self.block * p.L - self.base
        blocks = self.raw[:, start : start + max(stop - self.block, 0) * p.L].reshape(-1, p.L)
        products = (blocks @ p.PQY).reshape(S, -1, p.PQY.shape[1])
        m2 = len(p.Mx)
        for b in range(products.shape[1]):
            P, Q, Y = np.split(products[:, b], [m2, 2 * m2], axis=1)
            pairs = x.view(float)
            self.drive.append((Q + pairs @ p.Mx).view(complex))
            self.known.append(Y + pairs @ p.Yx)
            x = p.step * x + np.ascontiguousarray(P).view(complex)
        self.x, self.block = x, max(stop, self.block)
        needed = max(min(p.phase + self.block * p.L - self.base, self.raw.shape[1] - len(p.A)), 0)
        self.raw, self.base = self.raw[:, needed:].copy(), self.base + needed

    def _backward(self, v: Array, count: int) -> Array:
        """y of the first `count` blocks that wait, from v behind the last of them that has come."""
        y = []
        for b in range(len(self.drive) - 1, -1, -1):
            if b < count:
                y.append(self.known[b] + v.view(float) @ self.plan.Yv)
            v = self.plan.step * v + self.drive[b]
        return np.concatenate([v.real[:, :0], *y[::-1]], axis=1)


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
    """`signals.derivative`; two samples of reach, so that its one-sided differences of second order find three samples."""
    return Local(lambda x: derivative(x, rate, ends), 2)


def position_stage(rate: float, signals: Signals) -> Chain:
    """Measured to filtered positions."""
    return Chain(*median_stage(signals.median), *lowpass_stage(rate, signals.lowpass, "q"))


def velocity_stage(rate: float, signals: Signals) -> Chain:
    """Filtered positions to filtered velocities."""
    return Chain(derivative_stage(rate, signals.ends), *lowpass_stage(rate, signals.lowpass, "qd"))
