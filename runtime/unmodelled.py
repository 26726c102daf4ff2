"""Torques that the model lacks: does load, position or time explain the error of a joint?

    e = Y - W X                   error of all parameters, joints weighted by their errors
    F                             columns of one law, in the rows of one joint:
            load                  |tau_j| sign(qd_j), tau_j the torque W_j X without friction
            position              sin(k q_j), cos(k q_j), k = 1 ... ORDERS
            time                  t, t sign(qd_j)
    M = 1 - W (W'W)^-1 W',        a = (F'M F)^-1 F'e
    C_a = (F'M F)^-1 (sum_k s_k s_k') (F'M F)^-1,        s_k = (M F)_k' (e - M F a)_k

over blocks k of time, so that the noise may be correlated; C_a grows by the factor of
`block_correlation` for noise that is correlated for longer than a block. A law is found if a'
C_a^-1 a/q exceeds the quantile of F(q, K - q) that belongs to the probability LAW_CERTAIN
(limits.toml) over all laws tried, and if a from either half of the blocks reduces the error in the
other half. The laws are found one after another, the most certain law first, and each law is fitted
together with those found before. The parameters then become

    X + dX = X - (W'W)^-1 W'F a

Reference: White (1980) and Arellano (1987) for C_a.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

import numpy as np
from scipy.stats import f as fisher

from runtime.core.model import (
    TRANSMITTED,
    GeneratedModel,
    channels_of,
    elements_of,
    is_axis,
    joint_labels,
    joint_units,
)
from runtime.core.residuals import block_correlation, correlation_time, residual_correlation
from runtime.core.result import Identification
from runtime.core.rows.regressor import in_time
from runtime.core.signals.decimation import PIECE, decimated_parts
from runtime.core.signals.filters import States
from runtime.ground.check import Answer, Question
from runtime.ground.limits import LIMIT

BLOCKS = 20
"""Blocks of time of the test."""
ORDERS = 12
"""Largest multiple of the position, or of a turn over the range of a slide."""
ROWS = 30_000
"""Rows that are tested at most; of more, every second, third, ... instant."""
VISIBLE = 0.02
"""Share of F that the columns of W must leave for a test."""
MOST = 8
"""Laws that are found at most."""

Array = np.ndarray
Kind = Literal["load", "position", "time"]


@dataclass(frozen=True, eq=False)
class Law:
    """A torque that the model lacks at one joint.

    Attributes
    ----------
    j : int
        Joint, from 0.
    kind : "load", "position" or "time"
    order : float
        Multiple of the position, 1/rad or 1/m; 0 for the other kinds.
    a, sigma : ndarray, shape (q,), SI
        Factors of the columns, and their deviations.
    percent : float, %
        Root mean square of the torque F a, in % of the torque of the joint.
    """

    j: int
    kind: Kind
    order: float
    a: Array
    sigma: Array
    percent: float

    def torque(self, q: Array, qd: Array, load: Array) -> Array:
        """Torque of the law in other states of its joint, N m or N; zero for a law of time."""
        if self.kind == "time":
            return np.zeros(len(q))
        return np.asarray(columns_of(self.kind, self.order, q, qd, load) @ self.a)


@dataclass(frozen=True, eq=False)
class Lacking:
    """All laws that were found, and the change of the parameters if they are in the model.

    Attributes
    ----------
    laws : tuple of Law
    dX : ndarray, shape (b,)
        Change of the parameters of the fit if the model had the laws.
    before, after : ndarray, shape (n,), %
        Error of each joint without and with the laws.
    """

    laws: tuple[Law, ...]
    dX: Array
    before: Array
    after: Array

    @property
    def left(self) -> float:
        """Share of the squared error that the laws leave, on average over the joints, 0 to 1."""
        shown = self.before > 0
        return float(np.mean((self.after[shown] / self.before[shown]) ** 2)) if self.laws else 1.0


@Question(
    "Does the error depend on load, position or time?",
    f"what does takes less than {LIMIT.LAW_SHARE:g} % of the torque of a joint, or less than "
    f"{LIMIT.LAW_TAKES:g} % of its error",
)
def depends(lacking: Lacking, model: GeneratedModel) -> Answer:
    """Answer the question whether the model lacks a law of load, position or time."""
    labels, names = joint_labels(model), model.JOINTS
    gain = lacking.before - lacking.after
    clear = 100 * gain >= LIMIT.LAW_TAKES * lacking.before
    large = [law for law in lacking.laws if law.percent >= LIMIT.LAW_SHARE and clear[law.j]]
    if not large:
        return Answer("good", "No clear dependence is found")
    law = max(large, key=lambda law: gain[law.j])
    alike = [names[one.j] for one in (law, *large) if one.kind == law.kind]
    unit = "N*m" if joint_units(model)[law.j] == "rad" else "N"
    others = "" if len(large) == 1 else f" ({len(large)} such laws are found)"
    what = {
        "load": f"friction of joint {labels[law.j]} that grows with its load",
        "position": f"a torque of joint {labels[law.j]} that depends on its position",
        "time": f"a torque of joint {labels[law.j]} that changes with time",
    }[law.kind]
    return Answer(
        "doubtful",
        f"The model lacks {what}, {law.percent:.1f} % of its torque{others}; with it, the error of the "
        f"joint goes from {lacking.before[law.j]:.1f} to {lacking.after[law.j]:.1f} %",
        remedy_of(law, [*dict.fromkeys(alike)], unit),
    )


def remedy_of(law: Law, joints: Sequence[int], unit: str) -> str:
    """Sentence that offers the law in the form of the robot file.

    joints : numbers of the joints with such a law, the joint of the law first. unit : unit of its
      torque.
    """
    along = joints[0] if len(joints) == 1 else sorted(joints)
    if law.kind == "load":
        return (
            f"write in the robot file, elements: {{FL: {{kind: load_dependent, along: {along}}}}} "
            f"(FL{joints[0]} is about {law.a[0]:.2g} +- {1.96 * law.sigma[0]:.1g}); then identify again"
        )
    if law.kind == "position":
        angle = "q" if law.order == 1 else f"{law.order:.4g}*q"
        columns = ", ".join(
            f'{name}: {{along: {joints[0]}, torque: "{function}({angle})", unit: {unit}}}'
            for name, function in (("PS", "sin"), ("PC", "cos"))
        )
        return f"write in the robot file, columns: {{{columns}}}; then identify again"
    return (
        "warm the robot up, look for a drift of its torque or offset, or identify parts of the "
        "record alone (rows.window)"
    )


def columns_of(kind: Kind, order: float, q: Array, qd: Array, load: Array) -> Array:
    """Compute the columns of a law in states of its joint, shape (K, q)."""
    if kind == "load":
        return np.asarray((np.abs(load) * np.sign(qd))[:, None])
    return np.column_stack([np.sin(order * q), np.cos(order * q)])


def loaded_joints(model: GeneratedModel) -> set[int]:
    """Numbers of the joints whose friction grows with their load in the model already."""
    return {
        int(c.removeprefix(TRANSMITTED)) for c in channels_of(model) if c.startswith(TRANSMITTED)
    }


def friction_columns(model: GeneratedModel, names: Sequence[str]) -> Array:
    """Whether each parameter is dry or viscous friction, which is no load, bool (b,)."""
    elements = elements_of(model)
    return np.array([elements.get(name, ("",))[0] in ("coulomb", "viscous") for name in names])


def with_sign(result: Identification, step: int) -> tuple[Array, Array]:
    """Compute |tau_j| sign(qd_j) and sign(qd_j) in every `step`-th row of each joint.

    Both are computed at the rate of the record and decimated like the torques, so that a reversal
    is rounded in the same way. tau_j is the torque of all parameters except those of friction.
    """
    model, fit = result.model, result.estimate
    names, n = model.BASE_PARAMETERS, len(model.JOINTS)
    X = np.array([fit[name] if name in fit.names else 0.0 for name in names])
    X[friction_columns(model, names)] = 0.0
    parts: list[list[Array]] = [[] for _ in range(n)]
    before = np.zeros(n, dtype=int)  # rows of each joint in the records before
    for record in result.prepared:
        selection = record.certain(model)
        window, plan = record.states[selection.samples], selection.plan

        def signals(t0: int, t1: int, window: States = window) -> Array:
            own = window[t0:t1]
            states = (own.q, own.qd, own.qdd)
            tau = cast(Any, model).inverse_dynamics(*states, X, **in_time(model, own))
            return np.vstack([(np.abs(tau) * np.sign(own.qd)).T, np.sign(own.qd).T])

        used = [
            np.flatnonzero(own)[-k % step :: step]
            for own, k in zip(selection.mask, before, strict=True)
        ]
        before += selection.mask.sum(axis=1)
        pieces = (
            decimated_parts(signals, 2 * n, plan)
            if plan is not None
            else (
                (slice(a, a + PIECE), signals(a, a + PIECE)) for a in range(0, len(window), PIECE)
            )
        )
        for part, values in pieces:
            for j, rows in enumerate(used):
                own = rows[(rows >= part.start) & (rows < part.stop)] - part.start
                parts[j].append(values[[j, n + j]][:, own])
    load, sign = np.concatenate([own for of_joint in parts for own in of_joint], axis=-1)
    return load, sign


def lacking_of(result: Identification) -> Lacking | None:
    """Find the laws that the model lacks, from the rows of an identification.

    The result is None if the method is not linear, the parameters are not determined, nothing
    moves, or the model does not state which of its parameters are friction.
    """
    observation, fit, model = result.observation, result.estimate, result.model
    known = result.determined and result.usable and observation.motion is not None
    known = known and hasattr(model, "ELEMENTS")
    if not known or not result.problem.method.linear or result.problem.reader.at_rest:
        return None
    assert observation.motion is not None
    step = -(-len(observation.Y) // ROWS)
    chosen = np.concatenate(
        [np.arange(s.start, s.stop)[::step] for s in map(observation.joint, range(observation.n))]
    )
    joint = observation.joints[chosen]
    at = np.array([observation.names.index(name) for name in fit.names])
    W, Y = observation.W[np.ix_(chosen, at)], observation.Y[chosen]
    e, n = Y - W @ fit.X, observation.n
    size = np.array(
        [np.sqrt(np.mean(e[joint == j] ** 2)) if (joint == j).any() else 0.0 for j in range(n)]
    )
    measured = np.array(
        [np.sqrt(np.mean(Y[joint == j] ** 2)) if (joint == j).any() else 0.0 for j in range(n)]
    )
    usable = [
        j for j in range(n) if size[j] > 1e-9 * measured[j] > 0 and not is_axis(model.JOINTS[j])
    ]
    if not usable:
        return None
    weight = 1 / np.where(size > 0, size, np.inf)[joint]
    loaded, sign = with_sign(result, step)
    blocks = observation.blocks((observation.span[1] - observation.span[0]) / BLOCKS)[chosen]
    t = observation.t[chosen] - observation.t[chosen].mean()
    t = t / (np.ptp(t) or 1.0)
    own = Rows(W * weight[:, None], e * weight, blocks, np.bincount(joint, minlength=n))
    q = observation.motion[chosen, 0]
    candidates = []
    for j in usable:
        rows = np.flatnonzero(joint == j)
        unit = 1.0 if joint_units(model)[j] == "rad" else 2 * np.pi / max(np.ptp(q[rows]), 1e-9)
        kinds: list[tuple[Kind, float]] = [("time", 0.0)]
        kinds += [("load", 0.0)] if model.JOINTS[j] not in loaded_joints(model) else []
        kinds += [("position", k * unit) for k in range(1, ORDERS + 1)]
        for kind, order in kinds:
            if kind == "load":
                F = loaded[rows][:, None]
            elif kind == "time":
                F = np.column_stack([t[rows], t[rows] * sign[rows]])
            else:
                F = columns_of(kind, order, q[rows], sign[rows], sign[rows])
            candidates.append(Candidate(j, kind, order, rows, F / size[j]))
    return search(own, candidates, size, measured)


def with_lacking(result: Identification) -> Identification:
    """Find the laws that the model lacks, and increase the deviations of the parameters by the
    changes that the laws cause.

    The deviation of a parameter becomes sqrt(s^2 + dX^2): relative to a model with the laws, X has
    the error dX. No resampling of this record shows this error, since every part of the record has
    the same laws.
    """
    lacking = lacking_of(result)
    if lacking is None:
        return result
    moves = dict(zip(result.estimate.names, map(float, lacking.dX), strict=True))
    sets = result.sets.wider(moves) if lacking.laws else result.sets
    return replace(result, sets=sets, lacking=lacking)


@dataclass(frozen=True, eq=False)
class Rows:
    """Weighted rows: W (r, b), error e (r,), number of the block of each row, rows by joint."""

    W: Array
    e: Array
    blocks: Array
    count: Array

    def with_columns(self, rows: Array, F: Array) -> Rows:
        """The same rows with further columns in some of them; e does not change."""
        more = np.zeros((len(self.e), F.shape[1]))
        more[rows] = F
        return Rows(np.column_stack([self.W, more]), self.e, self.blocks, self.count)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A law that is tested: joint, kind, order, rows of the joint, and its weighted columns in
    these rows.
    """

    j: int
    kind: Kind
    order: float
    rows: Array
    F: Array


def search(own: Rows, candidates: Sequence[Candidate], size: Array, measured: Array) -> Lacking:
    """Find missing laws one after another, and fit all of them together."""
    found: list[Candidate] = []
    b, system = own.W.shape[1], own
    level = LIMIT.LAW_CERTAIN / max(len(candidates), 1)
    for _ in range(MOST):
        projector = Projector(system)
        tests = [
            (projector.p_value(one), k) for k, one in enumerate(candidates) if one not in found
        ]
        p, best = min(tests, default=(1.0, 0))
        if p > level:
            break
        found.append(candidates[best])
        system = system.with_columns(candidates[best].rows, candidates[best].F)
    whole, without = Projector(system), Projector(own)
    laws, column = [], b
    for one in found:
        at = slice(column, column + one.F.shape[1])
        a = whole.X[at]
        effect = np.sqrt(np.mean((one.F @ a) ** 2)) * size[one.j]
        laws.append(
            Law(one.j, one.kind, one.order, a, whole.sigma(at), 100 * effect / measured[one.j])
        )
        column = at.stop
    left = [
        np.sqrt(np.mean(x**2)) if len(x) else 0.0
        for x in np.split(whole.left, np.cumsum(own.count)[:-1])
    ]
    scale = 100 * size / np.where(measured > 0, measured, np.inf)
    return Lacking(tuple(laws), whole.X[:b] - without.X, scale, scale * np.array(left))


class Projector:
    """Least squares of the error e by the columns of a system, and the improvement by further
    columns.
    """

    def __init__(self, system: Rows) -> None:
        W, norm = system.W, np.linalg.norm(system.W, axis=0)
        self.norm = np.where(norm > 0, norm, 1.0)
        values, V = np.linalg.eigh((W / self.norm).T @ (W / self.norm))
        kept = values > 1e-12 * values[-1]
        self.T = V[:, kept] / np.sqrt(values[kept]) / self.norm[:, None]
        self.W, self.blocks = W, system.blocks
        self.X = self.T @ (self.T.T @ (W.T @ system.e))
        self.left = system.e - W @ self.X
        self.order = np.argsort(system.blocks, kind="stable")
        self.starts = np.flatnonzero(np.diff(system.blocks[self.order], prepend=-1))

    def by_block(self, x: Array) -> Array:
        """Sums of the rows of each block, shape (K, ...)."""
        return np.asarray(np.add.reduceat(x[self.order], self.starts, axis=0))

    def sigma(self, at: slice) -> Array:
        """Deviations of some of the coefficients, over blocks of time."""
        scores = self.by_block(self.W * self.left[:, None]) @ self.T
        return np.asarray(np.sqrt(np.sum((self.T[at] @ scores.T) ** 2, axis=1)))

    def p_value(self, one: Candidate) -> float:
        """Probability of the coefficients of a law if there is no such law; 1 if the law does not
        reduce the error.
        """
        F, rows = one.F, one.rows
        G = self.T.T @ (self.W[rows].T @ F)
        B = F.T @ F - G.T @ G
        if (
            np.linalg.eigvalsh(B)[0] < VISIBLE * np.linalg.eigvalsh(F.T @ F)[0]
            or not np.trace(B) > 0
        ):
            return 1.0
        MF = -(self.W @ (self.T @ G))
        MF[rows] += F
        a = np.linalg.solve(B, F.T @ self.left[rows])
        e = self.left - MF @ a
        s, q = self.by_block(MF * e[:, None]), F.shape[1]
        K = len(s)
        if 2 * q >= K:
            return 1.0
        lasting = correlation_time(residual_correlation(e[rows])) * K / len(rows)
        C = s.T @ s * K / (K - 1) * block_correlation(lasting / 2)
        g = F.T @ self.left[rows]
        statistic = float(g @ np.linalg.pinv(C, hermitian=True) @ g) / q * (K - q) / (K - 1)
        p = float(fisher.sf(statistic, q, K - q))
        return p if p > LIMIT.LAW_CERTAIN or self.helps(MF) else 1.0

    def helps(self, MF: Array) -> bool:
        """Whether the law from the even blocks reduces the error in the odd blocks, and vice versa."""
        even = self.blocks % 2 == 0
        for fit, unseen in ((even, ~even), (~even, even)):
            a = np.linalg.lstsq(MF[fit], self.left[fit], rcond=None)[0]
            e = self.left[unseen]
            if np.sum((e - MF[unseen] @ a) ** 2) >= np.sum(e**2):
                return False
        return True
