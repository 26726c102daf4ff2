"""Predict how errors of the position change the normal equations, on average and without sampling.

Let e be the errors of the encoders, independent from sample to sample and of variance v. Filters
are linear (`runtime.core.signals.noise_gain`), so the columns of W change by dW = sum_i W_qi dq_i +
W_qdi dqd_i + W_qddi dqdd_i + second order. Over the rows t of joint j that are used

    E[dW_j' dW_j] = v sum_i sum_t S_i(t) C S_i(t)'
        S_i = [W_qi, W_qdi, W_qddi]: sensitivities to encoder i, C after decimation
    E[dW_j]       = v sum_i 1/2 sum_cd W_cd C_0cd
                  C_0 ahead of decimation: the column is a mean over the errors around its instant

    E[W_c' W_c] = W'W + E[dW'dW] + W'E[dW] + E[dW]'W          E[W_c' Y] = W'Y + E[dW]'Y

Decimation filters the products S(t) e(t). S varies as fast as the motion; the errors vary as fast
as the cut-off of the filters allows, which is ten times faster by the rule of the chapter. So S is
assumed to be constant over one impulse response, while the correlation of the errors in time is
exact. Sensitivities are central differences of the generated regressor along the principal axes of
C_0, at the kept instants alone. For columns that switch with the sign of a speed, see
`runtime.advisor.sign_errors`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import floor, log

import numpy as np

from runtime.advisor.sign_errors import Kernels, Switched, kernels, switch_with_error
from runtime.core.drives import Drives, encoder_drives, encoder_root
from runtime.core.missing import require_positions
from runtime.core.model import GeneratedModel
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import Prepared, study_of_record
from runtime.core.rows.regressor import in_time
from runtime.core.rows.selection import Selection
from runtime.core.rows.switches import Switch, switches
from runtime.core.signals.filters import States
from runtime.core.signals.noise_gain import Bandwidth, bandwidth
from runtime.core.signals.reader import LOWPASS, Reader
from runtime.core.study import Study
from runtime.ground.settings import to_mapping

Array = np.ndarray

STEP = 1e-4
"""Step of the central differences in q, rad or m: errors of second differences below 1e-7."""
NODE = 1.5
"""Ratio of the deviations at which switches are computed; between them they are interpolated."""


@dataclass(frozen=True, eq=False)
class Perturbation:
    """Effect of position errors on the normal equations of one record.

    Gram matrices are those of [W_j Y_j], one for each joint, shape (n, b + 1, b + 1).

    observation : the rows without errors.
    along : for each column that switches sign, s = G qd over the window, shape (N,).
    root : joint position error per encoder error, shape (n, encoders).
    clean : Gram matrices of the rows without errors.
    smooth : for each encoder, what errors of variance 1 add to the Gram matrices, without the
        columns that switch sign.
    speeds : for each encoder, sensitivity of the rows to the error dqd of its velocity, times the
        standard deviation of dqd for errors of variance 1, shape (encoders, n, b, K).
    used : instants of the window nearest to a row that is used, bool (n, N).
    known : effects on switching columns that were computed so far.
    """

    observation: Observation
    selection: Selection
    along: Mapping[int, Array]
    band: Bandwidth
    root: Array
    clean: Array
    smooth: Array
    speeds: Array
    switches: tuple[Switch, ...]
    kernels: Kernels
    used: Array
    known: dict[tuple[int, int], Switched] = field(default_factory=dict)

    def expected(self, variance: float, encoders: Sequence[int]) -> Array:
        """Compute the expected Gram matrices of [W Y] if some encoders have random errors.

        The encoders are numbered from 0; all others are exact.
        """
        coarse = list(encoders)
        gram = self.clean + variance * self.smooth[coarse].sum(axis=0)
        if variance:
            self._add_switches(gram, variance, coarse)
        return np.asarray(gram)

    def _add_switches(self, gram: Array, variance: float, encoders: list[int]) -> None:
        """Add the effect of encoder errors on columns of W such as sign(qd) to the Gram matrices.

        The columns are those that switch sign. The effect is the change of their means, covariances
        and variances.
        """
        before, after = self.band.before[1, 1], self.band.after[1, 1]
        acting = []
        for switch in self.switches:
            share = switch.G @ self.root[:, encoders]  # of each encoder's error in s
            if share.any():
                sigma = np.sqrt(variance * before) * float(np.linalg.norm(share))
                acting.append((switch, share, self._at(switch, sigma)))
        for j in range(len(gram)):
            own = [each for each in acting if each[0].G[j]]
            if not own:
                continue
            columns, used = [switch.column for switch, *_ in own], self.selection.mask[j]
            scale = np.array([switch.G[j] for switch, *_ in own])
            shares = scale[:, None] * np.array([share for _, share, _ in own])
            slopes = np.array([noisy.slope for *_, noisy in own])
            shift = scale * np.array([noisy.shift[used] for *_, noisy in own]).T
            change = _rows(self.observation, j).T @ shift
            change[:-1] += (variance * after / np.sqrt(before)) * np.einsum(
                "mK,me,ebK->bm", slopes, shares, self.speeds[encoders, j], optimize=True
            )
            gram[j][:, columns] += change
            gram[j][columns] += change.T
            both = variance * after * (shares @ shares.T) * (slopes[:, used] @ slopes[:, used].T)
            np.fill_diagonal(both, scale**2 * [noisy.variance[j] for *_, noisy in own])
            gram[j][np.ix_(columns, columns)] += shift.T @ shift + both

    def _at(self, switch: Switch, sigma: float) -> Switched:
        """Compute the effect of velocity errors on a column of W that contains sign(qd) or similar.

        The effect is interpolated. sigma : standard deviation of the error; the effect is computed
        at the two nearest nodes.
        """
        node = floor(log(sigma) / log(NODE))
        return self._node(switch, node).between(self._node(switch, node + 1), sigma)

    def _node(self, switch: Switch, node: int) -> Switched:
        key = (switch.column, node)
        if key not in self.known:
            factor, settings = self.selection.factor, self.selection.signals.decimate
            self.known[key] = switch_with_error(
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


def value_reader(reader: Reader) -> Reader:
    """Return the given reader if it uses positions as they are, otherwise the low-pass."""
    return reader if reader.filters_positions else LOWPASS


def solution(gram: Array, weights: Array) -> Array:
    """Solve least squares for X, shape (b,), with the rows of joint j multiplied by weights[j].

    gram : Gram matrices of [W_j Y_j], shape (n, b + 1, b + 1). Columns are scaled first.
    """
    total = np.einsum("j,jab->ab", weights**2, gram)
    D = 1 / np.sqrt(np.diag(total)[:-1])
    A, y = total[:-1, :-1] * np.outer(D, D), D * total[:-1, -1]
    return np.asarray(D * np.linalg.solve(A, y))


def perturbation(
    model: GeneratedModel,
    record: Prepared,
    study: Study,
    names: Sequence[str],
    *,
    drives: Drives | None = None,
) -> Perturbation:
    """Compute how errors of the encoders change the normal equations of one record.

    Encoders are on the side study.cestac.side. Filters are those of the study, with the median of
    study.cestac.

    names : columns of W that are fitted.
    drives : drives for encoders on the motor side; default: those of the record.
    """
    study = study_of_record(study, record.record)
    signals = replace(study.signals, median=study.cestac.median)
    own = replace(record, study=replace(study, signals=signals), reader=value_reader(record.reader))
    own.take_states(record)
    band = bandwidth(signals, own.record.rate)
    require_positions(own.record.missing, "the effect of encoder steps", own.record.file)
    selection = own.selection
    observation = own.observation(model, names)
    settings = {**observation.settings, "signals": to_mapping(signals)}
    observation = replace(observation, settings=settings)
    window, switching = own.states[selection.samples], switches(model, names)
    root = encoder_root(
        encoder_drives(study.cestac.side, drives or own.drives, "cestac"), own.record.n
    )
    rows = [_rows(observation, j) for j in range(observation.n)]
    smooth, speeds = _smooth(
        model,
        window[selection.kept],
        selection.mask,
        rows,
        names,
        band,
        root,
        switching,
    )
    nearest = np.rint((np.arange(len(window)) - selection.kept[0]) / selection.factor).astype(int)
    return Perturbation(
        observation=observation,
        selection=selection,
        along={switch.column: window.qd @ switch.G for switch in switching},
        band=band,
        root=root,
        clean=np.array([A.T @ A for A in rows]),
        smooth=smooth,
        speeds=speeds,
        switches=switching,
        kernels=kernels(band, len(window), selection.factor),
        used=selection.mask[:, np.clip(nearest, 0, len(selection.kept) - 1)],
    )


def _rows(observation: Observation, j: int) -> Array:
    """Join the rows of W and the torques Y of joint j to one matrix [W_j Y_j]."""
    own = observation.joint(j)
    return np.column_stack([observation.W[own], observation.Y[own]])


def _smooth(
    model: GeneratedModel,
    kept: States,
    mask: Array,
    rows: Sequence[Array],
    names: Sequence[str],
    band: Bandwidth,
    root: Array,
    switching: Sequence[Switch],
) -> tuple[Array, Array]:
    """Compute what position errors of variance 1 of each encoder add to the Gram matrices of [W Y].

    Columns that switch sign are left out. Return these additions, and the sensitivities of the rows
    to the error of the velocity.

    kept : states at the kept instants.
    mask : rows used, bool (n, K).
    """
    columns = np.array([model.BASE_PARAMETERS.index(name) for name in names])
    rigid = np.array(model.STRUCTURE)[columns].T & ~np.isin(
        np.arange(len(columns)), [s.column for s in switching]
    )
    axes = np.linalg.cholesky(band.before)
    into = np.linalg.inv(axes)
    C = np.linalg.cholesky(into @ band.after @ into.T)
    out, timed = model.store(len(kept)), in_time(model, kept)

    def store(direction: Array, scale: float, joints: Array) -> Array:
        q, qd, qdd = (
            x + scale * c * joints
            for x, c in zip((kept.q, kept.qd, kept.qdd), direction, strict=True)
        )
        D = model.regressor(q, qd, qdd, out=out, **timed)
        return np.asarray(D.transpose(2, 1, 0)[columns])

    at_rest = store(axes[:, 0], 0.0, root[:, 0])
    encoders, (n, b) = root.shape[1], rigid.shape
    smooth = np.zeros((encoders, n, b + 1, b + 1))
    speeds = np.zeros((encoders, n, b, len(kept)))
    for i in range(encoders):
        first, second = np.empty((3, *at_rest.shape)), np.zeros_like(at_rest)
        for k in range(3):
            h = STEP / axes[0, 0] if k == 0 else 1 / axes[k, k]
            up, down = (store(axes[:, k], sign * h, root[:, i]) for sign in (1, -1))
            first[k] = (up - down) / (2 * h)
            second += (up - 2 * at_rest + down) / (2 * h**2)
        for j in range(n):
            C_j, used = np.flatnonzero(rigid[j]), mask[j]
            S = np.einsum("kl,kbK->blK", C, first[:, C_j, j][..., used]).reshape(
                len(C_j), 3 * int(used.sum())
            )
            smooth[i, j][np.ix_(C_j, C_j)] += S @ S.T
            shifted = band.gain * second[C_j, j][:, used] @ rows[j]  # E[dW]'[W Y]
            smooth[i, j][C_j] += shifted
            smooth[i, j][:, C_j] += shifted.T
            speeds[i, j, C_j] = first[1, C_j, j] * used
    return smooth, speeds
