"""Check whether the stated control law explains the torques of the record, before any simulation.

    u = P e + Vr qd_r - Vm qd_m + K I + feed-forward
            from the recorded reference and positions, e = q_r - q, at the rate of the record
    share     100 (1 - ||tau - tau_law||/||tau||)
            by joint, decimated like Y; tau_law = sat(u), known torques included in tau
    factor    of tau_law nearest to tau: 1 if gains and units are those of the record
    delay     of tau against tau_law with the largest share, s

A law that explains little is not the law of the record, even if a simulation with this law fits:
gains may be in other units or on the motor side, or there may be a delay or another reference.

If the record is slower than the controller, the differences qd_m are those of the record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import numpy as np

from runtime.core.record import Record
from runtime.ground.limits import limits
from runtime.loop.reference import Reference
from runtime.loop.settings import Controller

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True)
class LawFit:
    """Measures of how well the control law explains the recorded torque of one joint.

    Attributes
    ----------
    joint : str
    share : float, %
        Share of the torque that the law explains; below 0 if the law explains nothing.
    factor : float
        Factor that brings the torque of the law nearest to the recorded torque.
    delay : float, s
        Delay at which the share is largest.
    best : float, %
        The share with that factor and delay.
    """

    joint: str
    share: float
    factor: float
    delay: float
    best: float


def law_fits(
    law: Any, parts: Sequence[Any], controller: Controller, joints: Sequence[str]
) -> tuple[LawFit, ...]:
    """Compare the torque of the control law with the recorded torque, joint by joint.

    parts : parts of a `ClosedLoop`, with references at the rate of the controller.
    """
    torques = [law_torque(law, part.record, part.reference, controller) for part in parts]
    rate, fits = parts[0].record.rate, []
    for j, label in enumerate(joints):
        shares: list[tuple[float, float, float]] = []
        for lag in range(round(LIMIT.LAW_DELAYS * rate) + 1):
            pairs = []
            for part, tau in zip(parts, torques, strict=True):
                late = np.concatenate([np.full(lag, tau[0, j]), tau[: len(tau) - lag, j]])
                both = part.decimated(np.column_stack([part.record.tau[:, j], late]))
                pairs.append(both[:, part.selection.mask[j]])
            shares.append(_share(*(np.concatenate(rows) for rows in zip(*pairs, strict=True))))
        share, factor, _ = shares[0]
        lag = int(np.argmax([best for _, _, best in shares]))
        fits.append(
            LawFit(label, share, shares[lag][1] if lag else factor, lag / rate, shares[lag][2])
        )
    return tuple(fits)


def law_torque(law: Any, record: Record, reference: Reference, controller: Controller) -> Array:
    """Compute the torque tau_law of the control law at the samples of a record, N m or N.

    The result has shape (N, n). If the loop settled before t = 0, the integrator starts at the
    value that explains the torques of the first moments (LAW_STEADY in limits.toml, s); else it
    starts at 0.
    """
    N, T = len(record), 1 / record.rate
    q_r, qd_r, qdd_r = (
        x[:: controller.record_every][:N] for x in (reference.q, reference.qd, reference.qdd)
    )
    e = q_r - record.q
    qd_m = np.diff(record.q, axis=0, prepend=record.q[:1]) / T
    fed = record.tau_ff if controller.feedforward == "record" and record.tau_ff is not None else 0.0
    u = law.P * e + law.Vr * qd_r - law.Vm * qd_m + law.ca * qdd_r + fed
    steps = T * (law.Ie * e + law.Ir * qd_r - law.Im * qd_m)
    for j in np.flatnonzero(law.K):
        first = 0.0
        if controller.settle:
            head = slice(max(1, round(LIMIT.LAW_STEADY * record.rate)))
            before = np.cumsum(steps[head, j]) - steps[head, j]
            tau = record.tau[head, j]
            first = float(np.median((tau - u[head, j]) / law.K[j] - before))
        bound = float(law.antiwindup[j])
        u[:, j] += law.K[j] * _integral(steps[:, j], first, bound)
    return np.asarray(np.clip(u, -law.saturation, law.saturation))


def _integral(steps: Array, first: float, bound: float) -> Array:
    """Compute the integral I of the control law before each step, shape (N,), limited to +-bound.

    I_0 = first, I_(k+1) = clip(I_k + step_k), as in `runtime.loop.controller_tick`.
    """

    def following(I: float, step: float) -> float:
        return min(max(I + step, -bound), bound)

    start = following(first, 0.0)
    return np.fromiter(accumulate(steps[:-1].tolist(), following, initial=start), float, len(steps))


def law_text(fits: Sequence[LawFit]) -> str:
    """Write which share of each joint torque the control law explains, and why it may be small."""
    shares = ", ".join(f"{max(one.share, 0.0):.0f} % of joint {one.joint}" for one in fits)
    poor = [one for one in fits if one.share < LIMIT.LAW_POOR]
    if not poor:
        return f"The stated control law explains {shares} of the torques."
    hints = ", ".join(
        (
            f"joint {one.joint} {max(one.best, 0.0):.0f} % with {one.factor:.3g} times the gains "
            f"and {1000 * one.delay:.0f} ms later"
        )
        for one in poor
    )
    return (
        f"The stated control law explains {shares} of the torques: gains, units, side, delay or "
        f"reference are not those of this record (best: {hints})."
    )


def _share(y: Array, x: Array) -> tuple[float, float, float]:
    """Compute the share of a signal y, %, that the signal x explains, without and with a factor.

    Returns the share, %; the best factor of x; and the share with this factor, %.
    """
    norm, size = float(np.linalg.norm(y)), float(x @ x)
    if not norm:
        return 100.0, 1.0, 100.0
    factor = float(x @ y) / size if size else 0.0
    return (
        100 * (1 - float(np.linalg.norm(y - x)) / norm),
        factor,
        100 * (1 - float(np.linalg.norm(y - factor * x)) / norm),
    )
