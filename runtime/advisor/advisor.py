"""Resolution advisor: predict the coarsest encoder that does not bias the estimate.

No sampling is needed. CESTAC rounds every position at random, many times, and measures how far the
mean estimate moves. This mean is known to first order in the variance v of the rounding (errors in
variables), from the expected normal equations of `runtime.advisor.position_errors`:

    X(v) = E[W_c' W_c]^-1 E[W_c' Y]                %e (21) = 100 |1 - X(v) / X(0)|

    v = Delta^2 (two-point, gaussian), Delta^2 / 3 (uniform, quantise)

So one set of sensitivities gives the curve of every parameter, for all encoders together and for
one at a time with the others exact. Runs of CESTAC, with Student intervals, confirm the step at
which the first parameter reaches a limit of the verdict (`runtime.core.cestac.result`).

Noise of the torques does not change the mean: Y is linear in it. It increases sigma; for white
noise of the motors

    C = A^-1 (sum_ij Omega_ij W_i'W_j) A^-1,  A = W'W,  Omega = c R'R,  c = G(0)^2 / n_d of the
    decimation (the noise that slow columns see)

Weights of the joints (method wls) are those of the fit without errors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial, reduce
from operator import add
from typing import Any

import numpy as np

from runtime.advisor.advice import (
    ALL,
    LIMITS,
    Advice,
    EncoderAdvice,
    EncoderGroup,
    Limit,
    ReaderAdvice,
    confirm_by_runs,
    deciding_columns,
    limits_of,
)
from runtime.advisor.coarse_encoders import CoarseEncoders
from runtime.advisor.position_errors import Perturbation, perturbation, solution, value_reader
from runtime.advisor.readers import (
    encoder_readers,
    parts_of_reader,
    reader_advice,
    readers_in_words,
)
from runtime.core.cestac.perturbed import study_columns
from runtime.core.cestac.result import deciding_names, names_judged, weighed_change
from runtime.core.cestac.rounding import VARIANCE
from runtime.core.drives import Drives
from runtime.core.least_squares.estimate import Estimate
from runtime.core.model import GeneratedModel, joint_labels, joint_units, require_no_axes
from runtime.core.problem import Problem, estimated
from runtime.core.record import Record
from runtime.core.result import Identification
from runtime.core.rows.observation import Observation, stack
from runtime.core.rows.prepared import common_drives, stacked
from runtime.core.signals.reader import Reader
from runtime.core.study import Study
from runtime.ground.errors import InputError, SettingsError
from runtime.ground.limits import limits
from runtime.ground.progress import Work, at
from runtime.ground.settings import to_mapping

LIMIT = limits(__package__)

Array = np.ndarray
Progress = Callable[[int, int], None]

FIRST_ORDER = "to first order in the variance of the errors, for a motion that is slow compared with the filters; "


@dataclass(frozen=True, eq=False)
class Predictor:
    """Prediction of how the estimate X depends on the encoder step, for records of one robot.

    parts : effect of position errors on each record.
    weights : weight 1/s_j of the rows of each joint, shape (n,).
    share : variance of the rounding over Delta^2.
    """

    parts: tuple[Perturbation, ...]
    weights: Array
    share: float

    def change(self, delta: float, encoders: Sequence[int]) -> Array:
        """Predict the change of the estimate X, in %, if the given encoders have the step `delta`.

        With v the variance of the encoder errors, the change is 100 (X(v)/X(0) - 1).
        """
        X = solution(self._total(self.share * delta**2, encoders), self.weights)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(100 * (X / self.exact - 1))

    @cached_property
    def exact(self) -> Array:
        """Parameters X estimated with exact encoders, shape (b,)."""
        return solution(self._total(0.0, ()), self.weights)

    def rate(self, encoders: Sequence[int]) -> Array:
        """Compute how fast the estimate X changes with the squared encoder step Delta^2, near 0.

        Return the derivative of the change in % by Delta^2 at Delta = 0, shape (b,). Errors of
        columns that switch sign are left out.
        """
        moved, X = self._total(0.0, ()), self.exact
        added = reduce(add, [part.smooth[i] for part in self.parts for i in encoders])
        moved[..., -1] = added @ np.append(-X, 1.0)
        moved = solution(moved, self.weights)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(100 * self.share * moved / X)

    def _total(self, variance: float, encoders: Sequence[int]) -> Array:
        return reduce(add, [part.expected(variance, encoders) for part in self.parts])


@dataclass(frozen=True, eq=False)
class MeasuredFit:
    """Least squares of the records as measured, and how errors of the positions change it.

    Attributes
    ----------
    problem : Problem
        Prepared, without steps of encoders.
    names : tuple of str
        Fitted columns.
    drives : Drives or None
        Drives of all records.
    reference : Estimate
    rows : Observation
        Rows of the filtered positions, without errors.
    predictor : Predictor
    """

    problem: Problem
    names: tuple[str, ...]
    drives: Drives | None
    reference: Estimate
    rows: Observation
    predictor: Predictor

    @property
    def every(self) -> range:
        """Numbers of all encoders, from 0."""
        return range(len(self.problem.model.JOINTS))

    def first_step(self, encoders: Sequence[int], share: float) -> float:
        """Compute the encoder step of the first limit, if the change is as Delta^2; inf if none.

        share : variance of the rounding over Delta^2.
        """
        rates = weighed_change(replace(self.predictor, share=share).rate(encoders), self.reference)
        rate = rates[deciding_columns(self.reference)].max(initial=0.0)
        return float(np.sqrt(LIMITS[0] / rate)) if np.isfinite(rate) and rate > 0 else np.inf


def advise(
    problem: Problem,
    *,
    readers: Mapping[str, Reader],
    columns: Sequence[str] | None = None,
    asked: Sequence[float] = (),
    encoders: Sequence[str] | None = None,
    confirm: bool = True,
    progress: Progress | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Advice:
    """Predict the coarsest encoders that leave the estimate practically unbiased, and not biased.

    Side, rounding law, columns and number of runs are those of study.cestac. Real encoders (law
    phase) are judged for each of `readers` (`runtime.advisor.readers`).

    Parameters
    ----------
    problem : Problem
        Prepared.
    readers : mapping of str to Reader
        Readers for which real encoders are judged, by name; at least one for law phase.
    columns : sequence of str, optional
        Names of the essential parameters, if they are known; default: by study.cestac.columns.
    asked : sequence of float, rad or m
        Further steps whose change is predicted.
    encoders : sequence of str, optional
        Which encoders are coarse: "all" together, or numbers of joints, each alone; default: "all",
        then every joint.
    confirm : bool
        Whether CESTAC runs confirm the steps of the limits, study.cestac.runs at each.
    progress : callable, optional
        Called with the number of finished parts of the work, and of all parts as far as they are
        expected; a part is one step of one choice of encoders.
    provenance : mapping, optional
        Further entries of Advice.provenance, besides the names and time stamps of the records.

    Raises
    ------
    SettingsError
        The method is not linear least squares, or there is a median filter, for which no prediction
        is possible.
    """
    _refuse(problem)
    fit = measured_fit(problem, columns, provenance or {})
    study, law = fit.problem.settings, fit.problem.settings.cestac.rounding
    groups = encoder_groups(problem.model, study.cestac.side, encoders)
    stages = parts_of_law(groups, confirm) * (law != "phase")
    work = Work(progress, stages + len(readers) * parts_of_reader(groups, confirm))
    work.advance(0)
    real = advice_by_reader(fit, groups, readers, asked, confirm, work)
    if law == "phase":
        own = next((one for one in real if one.reader == study.signals.reader), real[0])
        by_group, steps = real[0].encoders, own.steps
    else:
        by_group = advice_by_law(fit, groups, confirm, work)
        changes = [fit.predictor.change(delta, fit.every) for delta in asked]
        steps = np.array(changes).reshape(len(asked), len(fit.names))
    return Advice(
        names=fit.names,
        reference=fit.reference,
        encoders=by_group,
        real=real,
        asked=tuple(asked),
        steps=steps,
        torque_sigma=torque_sigma(fit.predictor, fit.drives),
        assumptions=assumptions(
            study, problem.records, fit.predictor.parts, fit.reference, real=bool(real)
        ),
        settings={
            **fit.rows.settings,
            "estimate": to_mapping(study.estimate),
            "cestac": to_mapping(study.cestac),
            "rate": [record.rate for record in problem.records],
        },
        provenance={**fit.reference.provenance, "seed": study.cestac.seed},
    )


def measured_fit(
    problem: Problem, columns: Sequence[str] | None, provenance: Mapping[str, Any]
) -> MeasuredFit:
    """Fit the records as measured, and compute how errors of the positions change the fit.

    columns : names of the essential parameters, if they are known.
    provenance : further entries of the provenance of the estimate.
    """
    sought = replace(problem.settings.cestac, delta=())  # steps are what is sought
    problem = problem.changed(settings=replace(problem.settings, cestac=sought))
    model, study, records = problem.model, problem.settings, problem.prepared
    drives = common_drives(model, records)
    names = study_columns(problem, records, columns)
    parts = tuple(perturbation(model, own, study, names, drives=drives) for own in records)
    reference = estimated(
        problem,
        stacked(model, records, names),
        replace(study.estimate, columns="all"),
        provenance={**problem.provenance, **names_judged(sought), **provenance},
    )
    rows = stack([part.observation for part in parts])
    weights = 1 / np.array(problem.linear_system(rows, columns="all").scales)
    predictor = Predictor(parts, weights, VARIANCE[sought.rounding])
    return MeasuredFit(problem, names, drives, reference, rows, predictor)


def advice_by_reader(
    fit: MeasuredFit,
    groups: Sequence[EncoderGroup],
    readers: Mapping[str, Reader],
    asked: Sequence[float],
    confirm: bool,
    work: Work,
) -> tuple[ReaderAdvice, ...]:
    """Compute how coarse real encoders may be, by each reader."""
    start = fit.first_step(fit.every, VARIANCE["phase"])
    words = readers_in_words(readers)
    return tuple(
        reader_advice(
            CoarseEncoders(fit.problem, fit.names, fit.drives, "phase", reader),
            name,
            words[name],
            fit.reference,
            groups,
            start,
            asked=asked,
            confirm=confirm,
            work=work,
        )
        for name, reader in readers.items()
    )


def advice_by_law(
    fit: MeasuredFit, groups: Sequence[EncoderGroup], confirm: bool, work: Work
) -> tuple[EncoderAdvice, ...]:
    """Predict how coarse encoders may be that round by the law of the study, for each group."""
    problem, advices = fit.problem, []
    at(f"encoders that round by the law {problem.settings.cestac.rounding}")
    work.begin(parts_of_law(groups, confirm))
    if confirm:
        law, reader = problem.settings.cestac.rounding, value_reader(problem.reader)
        runs = CoarseEncoders(problem, fit.names, fit.drives, law, reader)
    for group in groups:
        advice = predicted_advice(fit, group)
        if confirm:
            advice = confirm_by_runs(advice, fit.reference, partial(runs.sampled, group.encoders))
        advices.append(advice)
        work.advance(parts_of_law([group], confirm))
    work.end()
    return tuple(advices)


def parts_of_law(groups: Sequence[EncoderGroup], confirm: bool) -> int:
    """Count the parts of the work for one law of rounding: a curve and two limits, by group."""
    return len(groups) * (1 + len(LIMITS) * confirm)


def encoder_groups(
    model: GeneratedModel, side: str, wanted: Sequence[str] | None
) -> tuple[EncoderGroup, ...]:
    """List the groups of encoders that are made coarse together: all, or a single one.

    side : side of the gears where the encoders are, joint or motor; those of motors turn.
    wanted : "all" and numbers of joints; default: all together, then every joint.
    """
    n = len(model.JOINTS)
    every = {ALL: tuple(range(n)), **{str(joint): (i,) for i, joint in enumerate(model.JOINTS)}}
    labels = tuple(wanted) if wanted is not None else tuple(every)[: n + 1 if n > 1 else 1]
    unknown = [label for label in labels if label not in every]
    if unknown or not labels:
        raise InputError(
            f"no encoder is called {', '.join(unknown) or '(empty list)'}; expected some "
            f"of {', '.join(every)}"
        )
    names = dict(zip(list(every)[1:], joint_labels(model), strict=True))
    units = joint_units(model) if side == "joint" else ["rad"] * n
    return tuple(
        EncoderGroup(
            names.get(label, label),
            every[label],
            " or ".join(sorted({units[i] for i in every[label]}, reverse=True)),
        )
        for label in dict.fromkeys(labels)
    )


def predicted_advice(fit: MeasuredFit, group: EncoderGroup) -> EncoderAdvice:
    """Compute how the estimate changes with the step of some encoders, and how coarse they may be.

    Steps are tried in geometric progression until both limits are passed; the curve of all encoders
    extends beyond them.
    """
    start = fit.first_step(group.encoders, fit.predictor.share)
    if not np.isfinite(start):
        limits = tuple(Limit(percent, np.inf, "") for percent in LIMITS)
        nothing = np.empty((0, len(fit.names)))
        return EncoderAdvice(group.label, limits, np.empty(0), nothing, unit=group.unit)
    decisive = deciding_columns(fit.reference)

    @cache
    def change(k: int) -> Array:
        return fit.predictor.change(start * LIMIT.CURVE_RATIO**k, group.encoders)

    def worst(k: int) -> float:
        return float(weighed_change(change(k), fit.reference)[decisive].max())

    down, last = range(0, -LIMIT.CURVE_STEPS, -1), LIMIT.CURVE_STEPS - 1
    low = next((k for k in down if worst(k) < LIMITS[0]), -LIMIT.CURVE_STEPS)
    high = next((k for k in range(low, last + 1) if worst(k) > LIMITS[-1]), last)
    if group.label == ALL:
        low, high = low - LIMIT.CURVE_BELOW, high + LIMIT.CURVE_ABOVE
    exponents = range(low, max(high, 0) + 1)
    delta = start * LIMIT.CURVE_RATIO ** np.array(exponents, dtype=float)
    changes = np.array([change(k) for k in exponents])
    found = tuple(
        Limit(one.percent, np.inf, "") if group.unit == "rad" and one.delta >= np.pi else one
        for one in limits_of(delta, changes, fit.reference)
    )  # an encoder that turns has two steps at least
    return EncoderAdvice(group.label, found, delta, changes, unit=group.unit)


def torque_sigma(predictor: Predictor, drives: Drives | None) -> Array:
    """Compute the standard deviation of X due to white noise on all motor torques, shape (b,).

    The standard deviation of the noise is 1 N m (N).
    """
    n = predictor.parts[0].observation.n
    R = np.eye(n) if drives is None else drives.ratio
    w = predictor.weights
    middle, A = 0.0, 0.0
    for part in predictor.parts:
        b = len(part.observation.names)
        full = np.zeros((n, len(part.selection.kept), b))
        full[part.selection.mask] = part.observation.W
        Omega = R.T @ R * part.band.gain**2 / part.selection.factor
        middle = middle + np.einsum(
            "i,j,ij,iKa,jKb->ab", w**2, w**2, Omega, full, full, optimize=True
        )
        A = A + np.einsum("j,jab->ab", w**2, part.clean[:, :-1, :-1])
    inverse = np.linalg.inv(A)
    return np.asarray(np.sqrt(np.diag(inverse @ middle @ inverse)))


def assumptions(
    study: Study,
    records: Sequence[Record],
    parts: Sequence[Perturbation],
    reference: Estimate,
    *,
    real: bool = False,
) -> tuple[str, ...]:
    """Write the assumptions behind the predicted effect of coarse encoders, as a tuple of texts.

    real : whether real encoders were judged, too.
    """
    cestac, low = study.cestac, study.signals.lowpass
    law = {
        "two-point": "+-Delta, variance Delta^2",
        "gaussian": "normal, deviation Delta",
        "uniform": "uniform within +-Delta, variance Delta^2/3",
        "quantise": (
            "to the grid of step Delta below or above, taken as white noise of variance Delta^2/3"
        ),
    }.get(cestac.rounding)
    rates = ", ".join(f"{record.rate:g} Hz" for record in records)
    filters = (
        "no low-pass"
        if low is None
        else (
            f"Butterworth of order {low.order} at {low.hertz:g} Hz forward and backward on "
            f"{' and '.join(low.on)}"
        )
    )
    out = [name for name in reference.names if name not in deciding_names(reference)]
    friction = ", ".join(reference.names[s.column] for s in parts[0].switches)
    lines = f"uneven by {cestac.uneven:g} of a step" if cestac.uneven else "even"
    place = f"on the {cestac.side} side, sampled at {rates}"
    encoders = (
        [
            (
                f"Encoders: rounding {cestac.rounding} ({law}) of every sample, independent from "
                f"sample to sample, {place}."
            )
        ]
        if law
        else []
    )
    if real:
        encoders.append(
            f"Real encoders: counts of steps Delta, lines {lines}, the phase random by encoder and "
            f"run, {place}. The reader is given the step, not the phase. Curves are a quadrature over "
            f"the phase, without first order; steps of fewer than {LIMIT.LINES_IN_MOTION} in the "
            "motion of a joint are not judged. Both estimates use the rows that the reader keeps; "
            "rows in which the direction of dry friction is uncertain are not among them. "
            f"Steps are tried in the ratio {LIMIT.READER_RATIO:g}, read as positions more closely "
            "where constant speeds of the record lock to the sampling and change more; between "
            "these, ask for the step of the encoder itself."
        )
    return (
        *encoders,
        (
            f"Filters: {filters}, no median, decimation by "
            f"{', '.join(str(part.selection.factor) for part in parts)}. Another rate or cut-off "
            "gives another answer."
        ),
        f"Method {study.estimate.method}; {FIRST_ORDER if law else ''}rows used and weights are "
        "those of the record.",
        *(
            [
                (
                    f"Friction that switches with the sign of a speed ({friction}) by its mean and "
                    "covariance under normal errors."
                )
            ]
            if friction and law
            else []
        ),
        f"A change is negligible below {LIMIT.NEGLIGIBLE:g} % or a tenth of the 95 % interval of its "
        f"parameter, and a bias above {LIMIT.BIASED:g} % and half of the interval"
        + (f"; not asked for: {', '.join(out)}." if out else "."),
        (
            "Torques: white noise of the motors does not bias X, since Y is linear in it and W does "
            "not depend on it; it only increases sigma."
        ),
    )


def _refuse(problem: Problem) -> None:
    """Raise an error for problems for which no prediction is possible."""
    require_no_axes(problem.model, "the advice on encoders of joints")
    study = problem.settings
    if not problem.method.linear:
        raise SettingsError(
            f"the advisor cannot predict estimates by {study.estimate.method!r}; set method: "
            "ols or wls",
            path=("estimate", "method"),
        )
    if study.estimate.weights == "covariance":
        raise SettingsError(
            "the advisor does not support weights: covariance, because it needs one weight per "
            "joint; set weights: joint or iterated",
            path=("estimate", "weights"),
        )


def readers_of_law(problem: Problem, listed: Mapping[str, Reader]) -> dict[str, Reader]:
    """Return the readers of a list for which real encoders are judged; none unless law phase."""
    settings = problem.settings
    if settings.cestac.rounding != "phase":
        return {}
    return encoder_readers(listed, settings.signals.reader)


def advice_of(
    result: Identification, encoder: Sequence[float] = (), *, listed: Mapping[str, Reader]
) -> Advice:
    """Predict how coarse encoders may be for the essential parameters of an identification.

    encoder : steps of the encoders in use, rad or m.
    listed : readers by name.
    """
    if not result.determined:
        raise InputError("the record does not determine the parameters; record a richer motion")
    readers = readers_of_law(result.problem, listed)
    names = result.essential.names
    return advise(result.problem, readers=readers, columns=names, asked=tuple(encoder))
