"""What is to be found of the law whose torque stands for a measured one: `controller.law` with
kd: fit, delay: fit.

    W X = tau_0(t - delay) + kd v(t - delay),       v = qd_ref - qd, tau_0 the law without kd
        = Y_0 + kd V - (delay - d) d/dt(Y_0 + kd V)            at the last delay d

Least squares of X, kd of every joint and one delay together, weighted by joint; deviations are
those of blocks of time. Where qd_ref does not move, V is the column of FV and their sum alone is
known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from runtime.estimators.estimate import Estimate
from runtime.json_documents import Result
from runtime.limits import LIMIT
from runtime.loop.methods import estimate_of
from runtime.model.generated import GeneratedModel, joint_labels
from runtime.records.law import late
from runtime.records.record import Record
from runtime.records.stream import Stream, in_memory
from runtime.rows.observation import Observation
from runtime.rows.observe import observe, with_torques
from runtime.rows.prepared import Prepared
from runtime.settings.controller import Law
from runtime.settings.study import EstimateSettings, Study

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class LawEstimate(Result):
    """Gains of the velocity and delay of a law.

    Attributes
    ----------
    joints : tuple of str
    kd, sigma : ndarray, shape (n,), N m s/rad or N s/m
        Gains and their deviations, jointly with all parameters; nan where kd and FV cannot be told
        apart, or kd was given.
    delay, sigma_delay : float, s
        From the logged signals to the torque; nan where it was given.
    text : str
        The same in words.
    error : float, %
        Of the torque, with what was found.
    """

    joints: tuple[str, ...]
    kd: Array
    sigma: Array
    delay: float
    sigma_delay: float
    text: str
    error: float


def completed(
    model: GeneratedModel,
    study: Study,
    fitted: Sequence[Prepared | Stream],
    further: Sequence[Record | Stream],
) -> tuple[tuple[Prepared | Stream, ...], list[Record | Stream], LawEstimate | None]:
    """The records with the torque of the completed law, and what was found; as they are where
    nothing is to be.
    """
    laws = [r.controller.law for r in study.record if r.by_law and r.controller is not None]
    asked = [law for law in laws if "fit" in (law.kd, law.delay)]
    if not asked:
        return tuple(fitted), list(further), None
    who = "controller.law: fit needs"
    own, others = in_memory(fitted, who), in_memory(further, who)
    found = law_estimate(model, own, study, asked[0])

    def whole(record: Record) -> Record:
        others = {key: x for key, x in record.channels.items() if key != "law_v"}
        tau = _torque(record, np.nan_to_num(found.kd), found.delay)
        return replace(record, tau=tau, channels=others)

    changed = tuple(replace(one, record=whole(one.record)) for one in own)
    return changed, [whole(one) for one in others], found


def gain_doubt(
    model: GeneratedModel, study: Study, records: Sequence[Prepared | Stream], error: float
) -> str:
    """Whether another kd than the stated one explains the records, a sentence; "" where it does
    not, or they hold none. error : of the stated one, %.
    """
    own = [one for one in records if isinstance(one, Prepared) and "law_v" in one.record.channels]
    laws = [r.controller.law for r in study.record if r.controller is not None]
    if error < LIMIT.LAW_DOUBT or len(own) < len(records) or not laws or laws[0].kd == "fit":
        return ""
    found = law_estimate(model, own, study, Law(kp=laws[0].kp, kd="fit"))
    if not found.error < error / 2:
        return ""
    stated = laws[0].gains(own[0].record.n)["Vm"]
    each = ", ".join(
        f"{x + dx:.4g} in place of {x:g} of joint {j}"
        for j, x, dx in zip(found.joints, stated, found.kd, strict=True)
        if np.isfinite(dx)
    )
    return (
        f"With kd {each} the law leaves {found.error:.1f} % unexplained in place of {error:.1f} %: "
        "are the gains in other units, or of the motor side?"
    )


def law_estimate(
    model: GeneratedModel, own: Sequence[Prepared], study: Study, law: Law
) -> LawEstimate:
    """kd of every joint and the delay, as far as `law` asks for them."""
    n, labels = own[0].record.n, joint_labels(model)
    gains = [f"KD{j}" for j in labels] if law.kd == "fit" else []
    kd, delay, rows = np.zeros(n), 0.0, observe(model, own, study)
    for _ in range(LIMIT.LAW_PASSES):
        fit = _fit(model, own, rows, gains, law.delay == "fit", kd, delay)
        value = dict(zip(fit.names, fit.X, strict=True))
        kd = np.array([value.get(name, 0.0) for name in gains] or kd)
        delay = delay + value.get("delay", 0.0)
        unknown = [name for name in gains if name in value and not _apart(fit, name)]
        gains = [name for name in gains if name not in unknown]
        kd = np.array(
            [0.0 if f"KD{j}" not in gains else x for j, x in zip(labels, kd, strict=True)]
        )
    sigma = dict(zip(fit.names, np.fmax(fit.sigma, fit.sigma_corrected), strict=True))
    sigmas = np.array([sigma.get(f"KD{j}", np.nan) for j in labels])
    kd = np.where(np.isfinite(sigmas), kd, np.nan)
    late_by = (delay, sigma["delay"]) if "delay" in sigma else (np.nan, np.nan)
    text = _text(labels, kd, sigmas, late_by, law)
    return LawEstimate(tuple(labels), kd, sigmas, late_by[0], late_by[1], text, fit.relative_error)


def _fit(
    model: GeneratedModel,
    own: Sequence[Prepared],
    rows: Observation,
    gains: Sequence[str],
    late_too: bool,
    kd: Array,
    delay: float,
) -> Estimate:
    """X beside kd and the step of the delay."""
    records = [one.record for one in own]
    shifted = [_torque(record, np.zeros_like(kd), delay) for record in records]
    Y = with_torques(rows, own, shifted)
    columns: dict[str, Array] = {}
    if gains:
        V = with_torques(rows, own, [late(r.t, r.channels["law_v"], delay) for r in records]).Y
        labels = [f"KD{j}" for j in joint_labels(model)]
        columns = {k: -V * (rows.joints == labels.index(k)) for k in gains}
    if late_too:
        whole = [_torque(record, kd, delay) for record in records]
        rates = [np.gradient(x, 1 / r.rate, axis=0) for x, r in zip(whole, records, strict=True)]
        columns["delay"] = with_torques(rows, own, rates).Y
    W = np.column_stack([rows.W, *columns.values()])
    wide = replace(Y, W=W, names=(*rows.names, *columns), errors=None)
    return estimate_of(wide, EstimateSettings("wls", "joint"), model=model)


def _torque(record: Record, kd: Array, delay: float) -> Array:
    """Torque of the law of a record with these gains, late by `delay`."""
    tau = record.tau + kd * record.channels["law_v"] if np.any(kd) else record.tau
    return late(record.t, tau, np.nan_to_num(delay))


def _apart(fit: Estimate, name: str) -> bool:
    """Whether a gain can be told from every parameter."""
    k = fit.names.index(name)
    scale = np.sqrt(np.diag(fit.covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        alike = np.abs(fit.covariance[k] / (scale[k] * scale))
    return bool(np.sort(alike)[-2] < LIMIT.KD_ALIKE) if np.isfinite(alike).all() else False


def _text(
    labels: Sequence[str], kd: Array, sigma: Array, late_by: tuple[float, float], law: Law
) -> str:
    parts = []
    known = [(j, x, s) for j, x, s in zip(labels, kd, sigma, strict=True) if np.isfinite(x)]
    if known:
        each = ", ".join(f"{x:.4g} +- {1.96 * s:.2g} of joint {j}" for j, x, s in known)
        parts.append(f"The law of the torque has kd {each} (fit)")
    open_ones = [j for j, x in zip(labels, kd, strict=True) if not np.isfinite(x)]
    if law.kd == "fit" and open_ones:
        parts.append(
            f"kd and FV of joint {', '.join(open_ones)} cannot be told apart on these records: FV "
            "is the sum of both; say kd, or move the reference velocity"
        )
    if np.isfinite(late_by[0]):
        which = " without kd" if law.kd == "fit" and open_ones else ""
        parts.append(
            f"The torque of the law{which} comes {1e3 * late_by[0]:.2f} +- "
            f"{1.96e3 * late_by[1]:.2g} ms after the logged signals (fit)"
        )
    return ". ".join(parts) + "."
