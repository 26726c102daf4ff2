"""What errors of the position do to the normal equations, on average and without sampling.

With e the errors of the encoders, independent from sample to sample and of variance v, and filters
that are linear (`runtime.signals.noise_gain`), the
columns of W move by dW = sum_i W_qi dq_i + W_qdi dqd_i + W_qddi dqdd_i + second order. Over the
rows t of joint j that are used

    E[dW_j' dW_j] = v sum_i sum_t S_i(t) C S_i(t)'
        S_i = [W_qi, W_qdi, W_qddi]: sensitivities to encoder i, C after decimation
    E[dW_j]       = v sum_i 1/2 sum_cd W_cd C_0cd
                  C_0 ahead of decimation: the column is a mean over the errors around its instant

    E[W_c' W_c] = W'W + E[dW'dW] + W'E[dW] + E[dW]'W          E[W_c' Y] = W'Y + E[dW]'Y

Decimation filters the products S(t) e(t). S varies with the motion, the errors with the filters'
cut-off, ten times faster by the rule of the chapter:
S is taken as constant over one impulse response, the correlation of the errors in time is exact.
Sensitivities are central differences of the
emitted regressor along the principal axes of C_0, at the kept instants alone. Columns that switch
with the sign of a speed: `runtime.rows.sign_errors`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import floor, log

import numpy as np

from runtime.errors import SettingsError
from runtime.model.drives import Drives
from runtime.model.generated import GeneratedModel
from runtime.records.missing import require_positions
from runtime.records.record import Record
from runtime.rows.observation import Observation
from runtime.rows.prepared import Prepared, prepared
from runtime.rows.selection import Selection
from runtime.rows.sign_errors import Kernels, Switch, Switched, kernels, switched, switches
from runtime.settings.study import Signals, Study, to_mapping
from runtime.signals.filters import States
from runtime.signals.noise_gain import Bandwidth, bandwidth
from runtime.signals.states import encoder_drives, encoder_root

Array = np.ndarray

STEP = 1e-4
"""Step of the central differences in q, rad or m: errors of second differences below 1e-7."""
NODE = 1.5
"""Ratio of the deviations at which switches are computed; between them they are interpolated."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """By joint: G, shape (n, b, b), of W_j'W_j, and g, shape (n, b), of W_j'Y_j."""

    G: Array
    g: Array

    def __add__(self, other: NormalEquations) -> NormalEquations:
        return NormalEquations(self.G + other.G, self.g + other.g)

    def solve(self, weights: Array) -> Array:
        """X, shape (b,), with the rows of joint j multiplied by weights[j]; columns are scaled
        first.
        """
        A, y = np.einsum("j,jab->ab", weights**2, self.G), weights**2 @ self.g
        D = 1 / np.sqrt(np.diag(A))
        return np.asarray(D * np.linalg.solve(A * np.outer(D, D), D * y))


@dataclass(frozen=True, eq=False)
class Perturbation:
    """One record under position errors.

    observation : the unperturbed rows; torque : Y before rows are left out, shape (n, K).
    clean : their normal equations.
    smooth : by encoder, what errors of variance 1 add to them, switching columns left out.
    errors : by encoder, ndarray, shape (n, b, b), E[dW_j'dW_j] alone.
    speeds : by encoder, ndarray, shape (n, b, K): sensitivity of the rows to dqd of that encoder,
    times the root of its variance.
    root : ndarray, shape (n, encoders), joint position error per encoder error.
    along : s = G qd over the window, shape (N,), by column that switches.
    used : bool, shape (n, N), instants of the window nearest to a row that is used.
    known : switches computed so far.
    """

    observation: Observation
    torque: Array
    selection: Selection
    along: Mapping[int, Array]
    band: Bandwidth
    root: Array
    clean: NormalEquations
    smooth: tuple[NormalEquations, ...]
    errors: tuple[Array, ...]
    speeds: tuple[Array, ...]
    switches: tuple[Switch, ...]
    kernels: Kernels
    used: Array
    known: dict[tuple[int, int], Switched] = field(default_factory=dict)

    def expected(self, variance: float, encoders: Sequence[int]) -> NormalEquations:
        """Expected normal equations with errors of that variance on the encoders named (from 0),
        the others exact.
        """
        normal = self.clean
        for i in encoders:
            normal = normal + NormalEquations(
                variance * self.smooth[i].G, variance * self.smooth[i].g
            )
        if not self.switches or variance == 0:
            return normal
        G, g = normal.G.copy(), normal.g.copy()
        self._add_switches(G, g, variance, encoders)
        return NormalEquations(G, g)

    def _add_switches(self, G: Array, g: Array, variance: float, encoders: Sequence[int]) -> None:
        """Means, covariances with the smooth columns and with each other, variances of the columns
        that switch.
        """
        before, after = self.band.before[1, 1], self.band.after[1, 1]
        kept = self.selection.mask
        acting = []
        for switch in self.switches:
            share = switch.G @ self.root[:, list(encoders)]  # of each encoder's error in s
            if share.any():
                sigma = np.sqrt(variance * before) * float(np.linalg.norm(share))
                acting.append((switch, share, self._at(switch, sigma)))
        for j in range(len(G)):
            rows, used = self.observation.joint(j), kept[j]
            acting_here = [
                (k, scale * share, scale, noisy) for k, share, scale, noisy in _on_joint(acting, j)
            ]
            if not acting_here:
                continue
            columns = [k for k, *_ in acting_here]
            shift = np.array([scale * noisy.shift[used] for _, _, scale, noisy in acting_here]).T
            slopes = [noisy.slope[used] for *_, noisy in acting_here]
            W, Y = self.observation.W[rows], self.observation.Y[rows]
            change = W.T @ shift
            G[j][:, columns] += change
            G[j][columns] += change.T
            G[j][np.ix_(columns, columns)] += shift.T @ shift
            g[j][columns] += shift.T @ Y
            for a, (k, share, scale, noisy) in enumerate(acting_here):
                along = sum(
                    share[m] * (self.speeds[i][j] @ noisy.slope)
                    for m, i in enumerate(encoders)
                    if share[m]
                )
                along = np.sqrt(variance * variance / before) * after * along
                G[j][:, k] += along
                G[j][k] += along
                G[j][k, k] += scale**2 * noisy.variance[j]
                for c, (other, share_c, *_) in enumerate(acting_here):
                    if c != a:
                        G[j][k, other] += (
                            variance * after * (share @ share_c) * float(slopes[a] @ slopes[c])
                        )

    def _at(self, switch: Switch, sigma: float) -> Switched:
        """The switch at one deviation of its speed, interpolated between nodes."""
        node = floor(log(sigma) / log(NODE))
        return self._node(switch, node).between(self._node(switch, node + 1), sigma)

    def _node(self, switch: Switch, node: int) -> Switched:
        key = (switch.column, node)
        if key not in self.known:
            factor, settings = self.selection.factor, self.selection.signals.decimate
            self.known[key] = switched(
                switch,
                self.along[switch.column],
                NODE**node,
                self.band.gain,
                self.kernels,
                factor,
                settings,
                self.used,
            )
        return self.known[key]


def _on_joint(
    acting: Sequence[tuple[Switch, Array, Switched]], j: int
) -> list[tuple[int, Array, float, Switched]]:
    return [
        (switch.column, share, float(switch.G[j]), noisy)
        for switch, share, noisy in acting
        if switch.G[j]
    ]


def _used(selection: Selection, N: int) -> Array:
    """bool, shape (n, N): instants nearest to a row that is used."""
    nearest = np.rint((np.arange(N) - selection.kept[0]) / selection.factor).astype(int)
    return np.asarray(selection.mask[:, np.clip(nearest, 0, len(selection.kept) - 1)])


def perturbation(
    model: GeneratedModel,
    record: Record | Prepared,
    study: Study,
    names: Sequence[str],
    *,
    drives: Drives | None = None,
    constants: Mapping[str, float] | None = None,
) -> Perturbation:
    """The record under errors of its encoders on the side study.cestac.side, through the filters of
    the study with the median of study.cestac.

    names : columns, as fitted.
    drives : motor side; default: DRIVES of the model.
    constants : values in place of the robot file's.
    """
    signals = replace(study.signals, median=study.cestac.median)
    own = prepared(model, record, replace(study, signals=lowpass_alone(signals)))
    band = bandwidth(signals, own.record.rate)
    require_positions(own.record.missing, "the effect of steps on them", own.record.file)
    states, selection = own.states, own.selection
    observation = own.observation(model, names, constants)
    settings = {**observation.settings, "signals": to_mapping(signals)}
    observation = replace(observation, settings=settings)
    switching = switches(model, names, constants)
    window = states[selection.samples]
    root = encoder_root(
        encoder_drives(study.cestac.side, drives or own.drives, "cestac"), own.record.n
    )
    smooth, errors, speeds = _smooth(
        model, window, selection, observation, band, root, switching, dict(constants or {})
    )
    return Perturbation(
        observation=observation,
        torque=own.torque,
        selection=selection,
        along={switch.column: window.qd @ switch.G for switch in switching},
        band=band,
        root=root,
        clean=_normal(
            [observation.W[observation.joint(j)] for j in range(observation.n)],
            [observation.Y[observation.joint(j)] for j in range(observation.n)],
        ),
        smooth=smooth,
        errors=errors,
        speeds=speeds,
        switches=switching,
        kernels=kernels(band, len(window), selection.factor),
        used=_used(selection, len(window)),
    )


def with_errors(
    model: GeneratedModel,
    record: Record | Prepared,
    study: Study,
    observation: Observation,
    deviation: float,
    *,
    drives: Drives | None = None,
) -> Observation:
    """`observation` of the record with the covariance of the errors of its columns, for errors of
    every encoder of that deviation.

    deviation : of one raw position, rad or m, on the side study.cestac.side. Columns that switch
    with the sign of a speed count as exact.
    Raises SettingsError where a median filter stands ahead of the others, or positions are read as
    counts.
    """
    if study.signals.reader != "lowpass":
        raise SettingsError(
            "counts; the errors of the columns are known for reader: lowpass alone",
            path=("signals", "reader"),
        )
    if study.signals.median != 1:
        raise SettingsError(
            (
                f"{study.signals.median}; the errors of the columns are known for linear filters "
                "alone, use 1"
            ),
            path=("signals", "median"),
        )
    part = perturbation(
        model,
        record,
        replace(study, cestac=replace(study.cestac, median=1)),
        observation.names,
        drives=drives,
    )
    total = deviation**2 * sum(part.errors)
    return replace(observation, errors=total / np.maximum(observation.rows, 1)[:, None, None])


def lowpass_alone(signals: Signals) -> Signals:
    """The same filters on positions as they are."""
    return replace(signals, reader="lowpass", step=None, side="joint", lines="detected")


def _smooth(
    model: GeneratedModel,
    window: States,
    selection: Selection,
    observation: Observation,
    band: Bandwidth,
    root: Array,
    switching: Sequence[Switch],
    constants: Mapping[str, float],
) -> tuple[tuple[NormalEquations, ...], tuple[Array, ...], tuple[Array, ...]]:
    """Per encoder: what errors of variance 1 add to the normal equations, E[dW'dW] of it, and the
    sensitivities to the speed.
    """
    kept = States(window.q[selection.kept], window.qd[selection.kept], window.qdd[selection.kept])
    columns = np.array([model.BASE_PARAMETERS.index(name) for name in observation.names])
    rigid = np.array(model.STRUCTURE)[columns].T & ~np.isin(
        np.arange(len(columns)), [s.column for s in switching]
    )
    axes = np.linalg.cholesky(band.before)
    into = np.linalg.inv(axes)
    C = np.linalg.cholesky(into @ band.after @ into.T)

    out = model.store(len(kept))

    def store(direction: Array, scale: float, joints: Array) -> Array:
        q, qd, qdd = (
            x + scale * c * joints
            for x, c in zip((kept.q, kept.qd, kept.qdd), direction, strict=True)
        )
        D = model.regressor(q, qd, qdd, out=out, **constants)
        return np.asarray(D.transpose(2, 1, 0)[columns])

    at_rest = store(axes[:, 0], 0.0, root[:, 0])
    smooth, errors, speeds = [], [], []
    for i in range(root.shape[1]):
        first, second = [], np.zeros_like(at_rest)
        for k in range(3):
            h = STEP / axes[0, 0] if k == 0 else 1 / axes[k, k]
            up, down = (store(axes[:, k], sign * h, root[:, i]) for sign in (1, -1))
            first.append((up - down) / (2 * h))
            second += (up - 2 * at_rest + down) / (2 * h**2)
        squares = _squares(selection, np.array(first), C, rigid)
        shifted = _shifted(observation, selection, band.gain * second, rigid)
        smooth.append(NormalEquations(squares + shifted.G, shifted.g))
        errors.append(squares)
        speeds.append(
            np.where(rigid.T[:, :, None], first[1], 0.0).transpose(1, 0, 2)
            * selection.mask[:, None, :]
        )
    return tuple(smooth), tuple(errors), tuple(speeds)


def _squares(selection: Selection, first: Array, C: Array, rigid: Array) -> Array:
    """E[dW'dW] by joint, shape (n, b, b); first, shape (3, b, n, K), C a Cholesky factor, shape (3,
    3).
    """
    n, b = rigid.shape
    G = np.zeros((n, b, b))
    for j in range(n):
        columns, used = np.flatnonzero(rigid[j]), selection.mask[j]
        S = np.einsum("kl,kbK->blK", C, first[:, columns, j][..., used]).reshape(
            len(columns), 3 * int(used.sum())
        )
        G[j][np.ix_(columns, columns)] = S @ S.T
    return G


def _shifted(
    observation: Observation, selection: Selection, second: Array, rigid: Array
) -> NormalEquations:
    """W'E[dW] + E[dW]'W and E[dW]'Y by joint; second = E[dW], shape (b, n, K)."""
    n, b = rigid.shape
    G, g = np.zeros((n, b, b)), np.zeros((n, b))
    for j in range(n):
        columns, used = np.flatnonzero(rigid[j]), selection.mask[j]
        B = second[columns, j][:, used]
        change = B @ observation.W[observation.joint(j)]
        G[j][columns] += change
        G[j][:, columns] += change.T
        g[j][columns] = B @ observation.Y[observation.joint(j)]
    return NormalEquations(G, g)


def _normal(W: Sequence[Array], Y: Sequence[Array]) -> NormalEquations:
    return NormalEquations(
        np.array([A.T @ A for A in W]), np.array([A.T @ y for A, y in zip(W, Y, strict=True)])
    )
