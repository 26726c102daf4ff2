"""Fit of the gain kd and the delay of a control law whose torque replaces a measured torque.

Settings: `controller.law` with kd: fit, delay: fit.

    W X = tau(t - delay),      tau = sat(tau_0 + kd v),      v = qd_ref - qd
        = Y + (kd - k) V - (delay - d) d/dt Y

tau_0 is the torque of the law without kd, k and d are the last values of kd and delay, and V is v
where the drive does not cut the torque, else zero.

X, kd of every joint and one delay are estimated together by least squares weighted by joint; the
standard deviations are those of blocks of time. If the drive cuts the torque, the law is not linear
in kd: passes begin at several kd, a step that raises the misfit is halved, and the kd of smallest
misfit is the result. If qd_ref does not move and the drive does not cut, V is the column of FV, and
only the sum of kd and FV is determined: the sign of FV is then not judged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d

from runtime.controller.law import late, torque_law
from runtime.core.least_squares.estimate import Estimate
from runtime.core.least_squares.linear import assemble
from runtime.core.least_squares.wls import weighted_system
from runtime.core.model import GeneratedModel, elements_of, joint_labels, joint_units
from runtime.core.problem import Note, Problem
from runtime.core.record import Record
from runtime.core.result import Identification
from runtime.core.rows.observation import Observation
from runtime.core.rows.prepared import Prepared, stacked, with_torques
from runtime.ground.check import Check
from runtime.ground.documents import Result
from runtime.ground.limits import limits
from runtime.ground.part import Doubt, Part
from runtime.loop.settings import Law

LIMIT = limits(__package__)

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class LawEstimate(Result):
    """Estimated velocity gains kd and estimated delay of a control law.

    Attributes
    ----------
    joints : tuple of str
    kd, sigma : ndarray, shape (n,), N m s/rad or N s/m
        Gains and their standard deviations, jointly with all parameters; nan if kd and FV cannot be
        separated, or kd was given.
    delay, sigma_delay : float, s
        Delay from the logged signals to the torque, and its standard deviation; nan if it was
        given.
    text : str
        The same in words.
    error : float, %
        Relative error of the torque, with the estimated values.
    """

    joints: tuple[str, ...]
    kd: Array
    sigma: Array
    delay: float
    sigma_delay: float
    text: str
    error: float


KIND = "law"


def law_of_controller(problem: Problem) -> Problem:
    """Estimate kd and delay of the control law, and compute the torque of the records by the law.

    This is a step of the preparation of a problem. Only values that the settings set to "fit" are
    estimated; if there are none, the problem is returned unchanged.
    """
    settings: Any = problem.settings
    controllers = [r.controller for r in settings.record if r.by_law and r.controller is not None]
    asked = [c for c in controllers if "fit" in (c.law.kd, c.law.delay)]
    if not asked or not any("law_v" in record.channels for record in problem.records):
        return problem
    law = asked[0].law
    if problem.reader.at_rest and law.delay == "fit":  # poses have no clock
        law = replace(law, delay=0.0)
        if law.kd != "fit":
            return problem
    saturation = torque_law(controllers[0], problem.records[0].n, problem.model.LIMITS).saturation
    estimate = law_estimate(problem, law, saturation)
    bound = np.where(np.isfinite(estimate.kd) | (law.kd != "fit"), saturation, np.inf)

    def with_torque(record: Record) -> Record:
        channels = dict(record.channels)
        v = channels.pop("law_v")
        if law.kd != "fit":
            channels["law_v"] = late(record.t, v, np.nan_to_num(estimate.delay))
        tau = torque_of(record, np.nan_to_num(estimate.kd), estimate.delay, bound)
        return replace(record, tau=tau, channels=channels)

    model: Any = problem.model
    if sums := friction_and_gain(model, law, estimate):
        model = UnsignedModel(model, sums)
    return problem.changed(
        Note(KIND, "", {KIND: estimate.summary()}, estimate),
        model=model,
        records=tuple(map(with_torque, problem.records)),
        unseen=tuple(map(with_torque, problem.unseen)),
    )


class FittedLaw(Part):
    """Part on the fitted values of the control law, printed before the values of the parameters."""

    name = "law_of_controller"
    title = "Law of the controller"
    about = "record"

    def __init__(self, estimate: LawEstimate) -> None:
        self.estimate = estimate

    def checks(self) -> tuple[Check, ...]:
        """Return one check, always good, whose text gives the fitted gains and the fitted delay."""
        finding = self.estimate.text.rstrip(".")
        question = "What was fitted of the law of the controller?"
        return (Check(question, "good", finding, ahead=True),)


def fitted_law(result: Identification) -> FittedLaw | None:
    """Return the part on the fitted control law; None if nothing of it was fitted."""
    note = result.problem.noted(KIND)
    return FittedLaw(note.result) if note is not None and note.result.text.strip(".") else None


def friction_and_gain(model: GeneratedModel, law: Law, estimate: LawEstimate) -> tuple[str, ...]:
    """Return the viscous friction that contains a gain kd, because both cannot be separated.

    Such a parameter is the sum of friction and an unknown gain, so it may be negative.
    """
    elements: Mapping[str, Any] = getattr(model, "ELEMENTS", {})
    pairs = zip(model.JOINTS, estimate.kd, strict=True)
    joints = {j for j, kd in pairs if law.kd == "fit" and not np.isfinite(kd)}
    return tuple(
        name
        for name, (kind, _, acts) in elements.items()
        if kind == "viscous" and joints & {j for key in acts for j in np.atleast_1d(key).tolist()}
    )


class UnsignedModel:
    """A model in which some parameters of elements may have either sign.

    Parameters
    ----------
    model : GeneratedModel
    names : tuple of str
        Parameters of the elements; their kind becomes `column`, which has no sign.
    """

    def __init__(self, model: GeneratedModel, names: tuple[str, ...]) -> None:
        self._model, self._names = model, names
        self.JOINT_UNITS, self.ELEMENTS = joint_units(model), self._unsigned(elements_of(model))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "_model":  # pickle asks before there is a model
            raise AttributeError(name)
        return getattr(self._model, name)

    def elements(self, **constants: float) -> dict[str, Any]:
        """Return the joint elements of the model, for other constants than those of the robot."""
        return self._unsigned(elements_of(self._model, constants))

    def _unsigned(self, elements: Mapping[str, Any]) -> dict[str, Any]:
        return {
            name: ("column", *element[1:]) if name in self._names else element
            for name, element in elements.items()
        }


def doubt_of_gains(result: Identification) -> Doubt | None:
    """Return a warning if the records fit much better with other velocity gains than the given
    ones.

    The result is None if there is no such doubt.
    """
    sentence = gain_doubt(result.problem, result.estimate.relative_error)
    return Doubt("gain_doubt", "Law of the controller", sentence) if sentence else None


def gain_doubt(problem: Problem, error: float) -> str:
    """Write a warning if the records fit much better with other velocity gains kd than the given.

    The warning is written if another kd more than halves the error. Otherwise the text is "". It is
    "" as well if the torques of the records do not come from the control law.

    error : relative error of the torque with the stated kd, %.
    """
    settings: Any = problem.settings
    by_law = ["law_v" in record.channels for record in problem.records]
    laws = [r.controller.law for r in settings.record if r.controller is not None]
    if error < LIMIT.LAW_DOUBT or not all(by_law) or not laws or laws[0].kd == "fit":
        return ""
    uncut = np.full(problem.records[0].n, np.inf)
    estimate = law_estimate(problem, Law(kp=laws[0].kp, kd="fit", delay=0.0), uncut)
    if not estimate.error < error / 2:
        return ""
    stated = laws[0].gains(problem.records[0].n)["Vm"]
    each = ", ".join(
        f"{x + dx:.4g} instead of {x:g} for joint {j}"
        for j, x, dx in zip(estimate.joints, stated, estimate.kd, strict=True)
        if np.isfinite(dx)
    )
    return (
        f"With kd {each}, the control law leaves {estimate.error:.1f} % of the torques "
        f"unexplained instead of {error:.1f} %: are the gains in other units, or of "
        "the motor side?"
    )


def law_estimate(problem: Problem, law: Law, saturation: Array) -> LawEstimate:
    """Estimate the velocity gains kd and the delay of a control law, if they are set to "fit".

    saturation : ndarray, shape (n,), N m or N
        Largest torque of the drives; inf if they do not cut.
    """
    model = problem.model
    n = problem.records[0].n
    labels = joint_labels(model)
    asked = [f"KD{j}" for j in labels] if law.kd == "fit" else []
    cuts = bool(asked) and bool(np.isfinite(saturation).any())
    starts = [s * law.gains(n)["P"] for s in (LIMIT.LAW_STARTS if cuts else (0.0,))]
    late_by = (np.nan, np.nan)
    if law.delay == "fit":
        slow = problem.prepared if asked else slow_records(problem)  # kd needs all frequencies
        rows = stacked(model, slow)
        rows = rows if asked else away_from_reversals(rows, slow)
        late_by = _delay(TorquesOfLaw(model, slow, rows, saturation), asked, starts, cuts)
    delay = float(np.nan_to_num(late_by[0]))
    torques = TorquesOfLaw(model, problem.prepared, stacked(model, problem.prepared), saturation)
    kd = _best(torques, asked, False, starts, delay, cuts)[0]
    fit = torques.fit(asked, False, kd, delay)
    gains = [name for name in asked if name in fit.names and _apart(fit, name)]
    if len(gains) < len(asked):  # FV is the sum of both: without a cut the share of kd is zero
        lost = np.array([f"KD{j}" not in gains for j in labels])
        torques = replace(torques, saturation=np.where(lost, np.inf, saturation))
        kd = _best(torques, gains, False, [np.where(lost, 0.0, kd)], delay, cuts)[0]
        fit = torques.fit(gains, False, kd, delay)
    both = torques.fit(gains, bool(gains and np.isfinite(late_by[0])), kd, delay)
    sigma = dict(zip(both.names, np.fmax(both.sigma, both.sigma_corrected), strict=True))
    sigmas = np.array([sigma.get(f"KD{j}", np.nan) for j in labels])
    kd = np.where(np.isfinite(sigmas), kd, np.nan)
    text = _text(labels, kd, sigmas, late_by, law)
    return LawEstimate(tuple(labels), kd, sigmas, late_by[0], late_by[1], text, fit.relative_error)


def _delay(
    torques: TorquesOfLaw, gains: Sequence[str], starts: Sequence[Array], cuts: bool
) -> tuple[float, float]:
    """Estimate the delay of a control law and its standard deviation, s; nan if it is uncertain."""
    kd, delay, _ = _best(torques, gains, True, starts, 0.0, cuts)
    fit = torques.fit(gains, True, kd, delay)
    sigma = dict(zip(fit.names, np.fmax(fit.sigma, fit.sigma_corrected), strict=True))
    known = abs(delay) + sigma.get("delay", np.inf) < LIMIT.LAW_LONGEST
    return (delay, sigma["delay"]) if known else (np.nan, np.nan)


def slow_records(problem: Problem) -> tuple[Prepared, ...]:
    """Prepare the records with a low-pass near the frequencies of the motion.

    The noise of positions and velocities is in the torque of the law and in W, and its correlation
    between both looks like a delay; it grows with the third power of the cut-off.
    """
    study: Any = problem.settings
    low = study.signals.lowpass
    if low is None:
        return problem.prepared
    own = [record.origin.cutoff or low.hertz for record in problem.records]
    hertz = min(
        [low.hertz, *own, *(LIMIT.LAW_BAND * _fastest(record) for record in problem.records)]
    )
    signals = replace(study.signals, lowpass=replace(low, cutoff=hertz))
    return tuple(own.by(replace(study, signals=signals)) for own in problem.prepared)


def _fastest(record: Record) -> float:
    """Return the frequency, Hz, below which 95 % of the power of the reference velocities lie."""
    q = record.channels.get("q_r", record.q)
    power = np.abs(np.fft.rfft(np.diff(q, axis=0), axis=0)) ** 2
    share = np.cumsum(power[1:], axis=0) / np.maximum(power[1:].sum(axis=0), 1e-300)
    f = np.fft.rfftfreq(len(q) - 1, 1 / record.rate)[1:]
    return float(max(f[int(np.argmax(own >= 0.95))] for own in share.T))


def away_from_reversals(rows: Observation, records: Sequence[Prepared]) -> Observation:
    """Return the rows in which the joint moves and does not reverse nearby.

    Near a reversal, a joint may stick, and the filters smear the step of dry friction, so that the
    residual would be taken for a delay. All rows are returned if too few are left.
    """
    kept = np.zeros(len(rows.Y), dtype=bool)
    for number, own in enumerate(records):
        qd, low = own.states.qd, own.study.signals.lowpass
        reach = round(
            LIMIT.REVERSAL * own.record.rate / (own.record.rate if low is None else low.hertz)
        )
        slow = np.abs(qd) < LIMIT.STANDING * np.abs(qd).max(axis=0)
        slow[1:] |= np.sign(qd[1:]) != np.sign(qd[:-1])
        near = maximum_filter1d(slow.astype(np.int8), 2 * reach + 1, axis=0) > 0
        mine = rows.record == number
        samples = np.searchsorted(own.record.t, rows.t[mine]).clip(max=len(qd) - 1)
        kept[mine] = ~near[samples, rows.joints[mine]]
    least = LIMIT.LAW_ROWS * len(rows.names)
    return rows.where(kept) if kept.sum() >= least else rows


def _best(
    torques: TorquesOfLaw,
    gains: Sequence[str],
    late_too: bool,
    starts: Sequence[Array],
    delay: float,
    cuts: bool,
) -> tuple[Array, float, float]:
    """Search for kd and delay from several kd; return those of the smallest misfit, and the misfit."""
    ends = [_search_kd(torques, gains, late_too, kd, delay, cuts) for kd in starts]
    return min(ends, key=lambda end: end[2])


def _search_kd(
    torques: TorquesOfLaw,
    gains: Sequence[str],
    late_too: bool,
    kd: Array,
    delay: float,
    cuts: bool,
) -> tuple[Array, float, float]:
    """Search for velocity gains kd and delay by Gauss-Newton iterations from given kd and delay.

    Returns kd, the delay and their misfit, which is nan if the drives do not cut.

    cuts : whether the drives cut the torque; then the law is not linear in kd.
    """
    labels = [f"KD{j}" for j in joint_labels(torques.model)]
    misfit = torques.misfit(kd, delay) if cuts else np.nan
    for _ in range(
        (LIMIT.LAW_CUT_PASSES if cuts else LIMIT.LAW_PASSES) if gains or late_too else 0
    ):
        fit = torques.fit(gains, late_too, kd, delay)
        step = {name: x for name, x in zip(fit.names, fit.X, strict=True) if np.isfinite(x)}
        by_kd = np.array([step.get(name, 0.0) for name in labels])
        by_delay = step.get("delay", 0.0)
        if not cuts:
            kd = kd + by_kd
            delay = delay + by_delay
            continue
        share = 1.0
        after = torques.misfit(kd + by_kd, delay + by_delay)
        while after > misfit and share > LIMIT.LAW_LEAST_STEP:
            share /= 2
            after = torques.misfit(kd + share * by_kd, delay + share * by_delay)
        if not after < misfit:
            break
        kd = kd + share * by_kd
        delay = delay + share * by_delay
        misfit = after
    return kd, delay, misfit


@dataclass(frozen=True, eq=False)
class TorquesOfLaw:
    """The records whose torque is computed by the control law, with their observation matrix W.

    Attributes
    ----------
    model : GeneratedModel
    records : sequence of Prepared
        With the torque of the law without kd, and the channel law_v.
    rows : Observation
        W of these records.
    saturation : ndarray, shape (n,), N m or N
        Largest torque of the drives; inf if they do not cut.
    """

    model: GeneratedModel
    records: Sequence[Prepared]
    rows: Observation
    saturation: Array

    def torques(self, kd: Array, delay: float) -> list[Array]:
        """Compute the torques of the control law for all records, shape (N, n) each.

        kd : velocity gains. delay : of the torque, s.
        """
        records = [prepared.record for prepared in self.records]
        return [torque_of(record, kd, delay, self.saturation) for record in records]

    def slopes(self, kd: Array, delay: float) -> list[Array]:
        """Compute dtau/dkd of each torque: the velocity error, or zero where the torque saturates.

        The velocity error is v = qd_ref - qd, late by the delay; kd is the velocity gain of the
        joint.
        """
        slopes = []
        for prepared in self.records:
            record = prepared.record
            v = record.channels["law_v"]
            cut = np.abs(record.tau + kd * v) > self.saturation
            slopes.append(late(record.t, np.where(cut, 0.0, v), delay))
        return slopes

    def fit(self, gains: Sequence[str], late_too: bool, kd: Array, delay: float) -> Estimate:
        """Estimate X, and corrections of the gains kd and of the delay, by one linear fit."""
        torques = self.torques(kd, delay)
        Y = with_torques(self.rows, self.records, torques)
        columns: dict[str, Array] = {}
        if gains:
            V = with_torques(self.rows, self.records, self.slopes(kd, delay)).Y
            labels = [f"KD{j}" for j in joint_labels(self.model)]
            columns = {k: -V * (self.rows.joints == labels.index(k)) for k in gains}
        if late_too:
            records = [prepared.record for prepared in self.records]
            rates = [
                np.gradient(x, 1 / r.rate, axis=0) for x, r in zip(torques, records, strict=True)
            ]
            columns["delay"] = with_torques(self.rows, self.records, rates).Y
        W = np.column_stack([self.rows.W, *columns.values()])
        wide = replace(Y, W=W, names=(*self.rows.names, *columns))
        system = weighted_system(wide, "joint")
        return assemble(system, system.solve(), model=self.model)

    def misfit(self, kd: Array, delay: float) -> float:
        """Compute how badly the model fits the torques of a control law with given kd and delay.

        With N_j rows of joint j the result is sum_j N_j log ||Y_j - W_j X||, X the estimate by
        least squares weighted by joint.
        """
        fit = self.fit((), False, kd, delay)
        return float(
            sum(joint.rows * np.log(joint.residual_norm) for joint in fit.per_joint if joint.rows)
        )


def torque_of(record: Record, kd: Array, delay: float, saturation: Array) -> Array:
    """Compute the torque of the control law for a record, delayed by `delay` s, shape (N, n)."""
    tau = record.tau + kd * record.channels["law_v"] if np.any(kd) else record.tau
    cut = late(record.t, np.clip(tau, -saturation, saturation), np.nan_to_num(delay))
    return np.asarray(np.clip(cut, -saturation, saturation))  # the spline may exceed the limit


def _apart(fit: Estimate, name: str) -> bool:
    """Whether the gain `name` can be distinguished from every other parameter of the fit.

    Its correlations with the other parameters must be small (below KD_ALIKE in limits.toml).
    """
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
            f"kd and FV of joint {', '.join(open_ones)} cannot be separated on these records: FV "
            "is the sum of both; give kd, or change the reference velocity"
        )
    if np.isfinite(late_by[0]):
        which = " without kd" if law.kd == "fit" and open_ones else ""
        parts.append(
            f"The torque of the law{which} comes {1e3 * late_by[0]:.2f} +- "
            f"{1.96e3 * late_by[1]:.2g} ms after the logged signals (fit)"
        )
    return ". ".join(parts) + "."
