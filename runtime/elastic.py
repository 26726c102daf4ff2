"""Identify stiffness and damping of gears that have an encoder on each side.

With q of the encoder before the gear and q_l of the encoder behind it (channel q_link),

    K (q - q_l) + D (qd - qd_l) = tau - Ia qdd - FV qd - FS sign(qd) - OFFSET

is the torque through the gear. The torque has less noise than the difference of the encoders, and
this difference contains lag qd if the encoders are not sampled at the same time. So the difference
is fitted by least squares, joint by joint,

    q - q_l = tau/K - (D/K) d/dt(q - q_l) - (Ia/K) qdd + (lag - FV/K) qd - (FS/K) sign(qd) + offset

with Ia of the robot file if it has a value there. Standard deviations are computed from blocks of
time. A rigid model uses qdd in place of qdd_l: at the frequency f its error is (f/f_j)^2 of the
inertia torque, f_j = sqrt(K/A_jj)/(2 pi). A_jj is the inertia about joint j, rotor included, that
the fitted parameters give at the middle of the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from runtime.core.documents import Result
from runtime.core.limits import limits
from runtime.core.model import GeneratedModel, joint_labels
from runtime.core.part import Part
from runtime.core.problem import Problem
from runtime.core.result import Identification
from runtime.core.rows.prepared import Prepared
from runtime.core.signals.filters import filtered_states, lowpass_filtered, median_filtered

GEAR_BLOCKS = 30
"""Blocks of time behind the deviation of a stiffness, by record. Measured: tests/test_elastic.py."""
GEAR_CERTAIN = 3.0
"""Deviations of its compliance from which a gear has a stiffness, deviations. Measured: tests/test_elastic.py."""
RIGID_ENOUGH = 0.05
"""Error of a rigid model at the cut-off, of the inertia torque, below which it is enough."""

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Elasticity(Result, Part):
    """Stiffness and damping of k gears that have an encoder on each side, shape (k,) each.

    Attributes
    ----------
    joints : tuple of str
        Names of the joints.
    K, sigma_K : ndarray, N m/rad or N/m
        Stiffness and its standard deviation; nan if the record does not determine the stiffness.
    D, sigma_D : ndarray, N m s/rad or N s/m
        Damping and its standard deviation.
    lag : ndarray, s
        Delay of the encoder behind the gear, minus FV/K.
    resonance : ndarray, Hz
        f_j; nan without K, or if the fitted inertia is not above zero.
    cutoff : float, Hz
        Highest frequency of the rows, from the study.
    """

    joints: tuple[str, ...]
    K: Array
    sigma_K: Array
    D: Array
    sigma_D: Array
    lag: Array
    resonance: Array
    cutoff: float

    name = "elastic"
    title = "Gears with two encoders"

    def text(self) -> str:
        """Write one sentence on each gear with two encoders, one per line."""
        return "\n".join(self.sentences)

    def brief(self) -> str:
        """Return one sentence per gear, as `text` does; this result has no shorter text."""
        return self.text()

    @property
    def sentences(self) -> tuple[str, ...]:
        """One sentence on each gear: stiffness, damping, and whether a rigid model is enough."""
        texts = []
        for j, K, s, D, d, lag, f in zip(
            self.joints,
            *(self.K, self.sigma_K, self.D, self.sigma_D, self.lag, self.resonance),
            strict=True,
        ):
            behind = f"the encoder behind it is {1e3 * lag:.2f} ms late (FV/K less)"
            if not np.isfinite(K):
                texts.append(
                    f"Gear of joint {j}: this record does not determine the stiffness; {behind}."
                )
                continue
            text = (
                f"Gear of joint {j}: stiffness {K:.3g} +- {1.96 * s:.2g}, damping {D:.2g} +- "
                f"{1.96 * d:.2g} (SI), {behind}"
            )
            if np.isfinite(f):
                share = (self.cutoff / f) ** 2
                rigid = "is enough" if share < RIGID_ENOUGH else "is no longer enough"
                text += (
                    f"; resonance near {f:.3g} Hz: a rigid model {rigid} at the cut-off of "
                    f"{self.cutoff:g} Hz, an error of {100 * share:.1f} % of the inertia torque"
                )
            texts.append(text + ".")
        return tuple(texts)


def elastic_gears(result: Identification) -> Elasticity | None:
    """Estimate the stiffness of the gears whose motor and link positions are both measured.

    None if there is no such gear, if the records are poses at rest, or if not all parameters are
    determined.
    """
    if not result.determined or result.problem.reader.at_rest:
        return None
    return elasticity(result.problem, result.estimate.names, result.estimate.X)


def elasticity(problem: Problem, names: Sequence[str], X: Array) -> Elasticity | None:
    """Estimate stiffness and damping of the gears with two encoders, from all records of a problem.

    The problem must be prepared. None if no record has link positions.

    names, X : parameters of the rigid fit, which give the inertia about each joint.
    """
    model = problem.model
    both = [reading for reading in problem.prepared if "q_link" in reading.record.channels]
    if not both:
        return None
    first = both[0]
    joints = np.flatnonzero(np.ptp(first.record.channels["q_link"], axis=0) > 0)  # nan, 0: none
    values = dict(getattr(model, "VALUES", {}))
    labels = joint_labels(model)
    gears = [_gear(both, int(j), values.get(f"Ia{model.JOINTS[j]}")) for j in joints]
    K, sigma_K, D, sigma_D, lag = np.array(gears).T
    A = _inertia(model, np.median(first.states.q, axis=0), names, X)[joints]
    with np.errstate(invalid="ignore"):
        resonance = np.sqrt(K / A) / (2 * np.pi)
    low = first.study.signals.lowpass
    cutoff = first.record.rate / 2 if low is None else low.hertz
    shown = tuple(labels[j] for j in joints)
    return Elasticity(shown, K, sigma_K, D, sigma_D, lag, resonance, cutoff)


def _gear(records: Sequence[Prepared], j: int, Ia: float | None) -> tuple[float, ...]:
    """Fit one gear: return stiffness and damping, each with its standard deviation, and a time lag.

    K and D are nan if the records do not determine the stiffness.
    """
    rows, blocks = [], []
    for prepared in records:
        record = prepared.record
        signals = prepared.study.signals
        low = signals.lowpass
        link = filtered_states(record.channels["q_link"][:, [j]], record.rate, signals)
        motor = filtered_states(record.q[:, [j]], record.rate, signals)
        tau = median_filtered(record.torque[:, [j]], signals.window_of_torques)
        for _ in () if low is None else {*low.on}:
            tau = lowpass_filtered(tau, record.rate, low)  # type: ignore[arg-type]
        gap = motor.q - link.q
        sign = np.sign(motor.qd)
        tau = tau - (Ia or 0.0) * motor.qdd
        columns = [tau, link.qd - motor.qd, motor.qd, sign, np.ones_like(sign), gap]
        A = np.hstack([*columns[:-1], *([] if Ia else [motor.qdd]), gap])
        kept = prepared.selection.samples
        moving = (
            np.abs(motor.qd[kept, 0])
            > limits("runtime.plausible").STANDING * np.abs(motor.qd).max()
        )
        rows.append(A[kept][moving])
        blocks += np.array_split(np.arange(len(rows[-1])), GEAR_BLOCKS)
    A = np.vstack(rows)
    Z = A[:, :-1]
    y = A[:, -1]
    scale = np.maximum(np.linalg.norm(Z, axis=0), 1e-300)
    Z = Z / scale
    x, *_ = np.linalg.lstsq(Z, y, rcond=None)
    inverse = np.linalg.pinv(Z.T @ Z, hermitian=True)
    e = y - Z @ x
    first = np.repeat(np.cumsum([0, *map(len, rows[:-1])]), GEAR_BLOCKS)
    g = np.array([Z[k + a].T @ e[k + a] for a, k in zip(first, blocks, strict=True)])
    C = inverse @ (g.T @ g) @ inverse * len(g) / (len(g) - 1)
    x = x / scale
    s = np.sqrt(np.diag(C)) / scale
    if x[0] < GEAR_CERTAIN * s[0]:
        return (np.nan, np.nan, np.nan, np.nan, float(x[2]))
    K = 1 / x[0]
    damping = x[1] / x[0]
    mixed = C[0, 1] / (scale[0] * scale[1])
    spread = np.sqrt(s[1] ** 2 + (damping * s[0]) ** 2 - 2 * damping * mixed) * K
    return float(K), float(s[0] * K**2), float(damping), float(spread), float(x[2])


def _inertia(model: GeneratedModel, q: Array, names: Sequence[str], X: Array) -> Array:
    """Compute the inertia about each joint at the position q from the parameters X, shape (n,).

    An inertia that is not positive becomes nan.
    """
    n = len(q)
    at_rest = np.zeros((n + 1, n))
    kept = [list(model.BASE_PARAMETERS).index(k) for k in names]
    D = model.regressor(np.tile(q, (n + 1, 1)), at_rest, np.vstack([np.zeros(n), np.eye(n)]))
    torques = np.asarray(D)[:, :, kept] @ X
    A = np.diag(torques[1:] - torques[0])
    return np.where(A > 0, A, np.nan)
