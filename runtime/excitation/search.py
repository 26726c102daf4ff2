"""Exciting motions: the search from several random starts, and what its best motion promises.

    excitation = excite(model, record, study)         # section `excitation` of the study
    excitation.verdict, excitation.relative_sigma     # predicted %sigma of every parameter
    t, q, qd, qdd, tau = excitation.sampled()

The margin at the points of the optimiser's grid (`runtime.excitation.optimiser`) is widened until the limits hold at the controller rate. Every
figure of the result is that of the rows the identification will use, with sign(qd) itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from runtime.errors import InputError
from runtime.estimators.essential import essential_of
from runtime.estimators.methods import estimate_of
from runtime.excitation.criteria import (
    MotionLimits,
    Weights,
    criterion_of,
    excesses,
    kept_correlation,
    limits_of,
    planned,
    usage,
    weights_of,
)
from runtime.excitation.optimiser import Problem, Start, improved, one_start
from runtime.model.casadi import casadi_path
from runtime.model.generated import GeneratedModel, require
from runtime.motion.dry_friction import dry_friction
from runtime.motion.result import csv_text
from runtime.motion.simulation import parameters_of
from runtime.observation.observation import observe
from runtime.parallel import results
from runtime.records.record import Record
from runtime.settings.excitation import ExcitationSettings
from runtime.settings.study import Study, to_mapping
from runtime.settings.trajectories import Motion, motion_from_mapping
from runtime.table import Table

Array = np.ndarray

TOLERATED = 1e-3  # violation at the points of the grid of a start that is looked at
BEST = 3  # starts that are looked at on the grid of the controller
WIDENINGS = 2  # of the margin, doubled each time
LISTED = 10  # parameters of the table, the least certain ones
NAMED = 5  # parameters, in a sentence


@dataclass(frozen=True, eq=False)
class Known:
    """Parameters that the search stands on, and how good the motion of the records was.

    Attributes
    ----------
    X : ndarray, shape (b,)
        All base parameters.
    source : str
        Where they come from.
    weights : Weights
    condition : float or None
        Of W_w of the records; None without records.
    relative_sigma : dict
        Predicted %sigma by name on the motion of the records; empty without records.
    """

    X: Array
    source: str
    weights: Weights
    condition: float | None = None
    relative_sigma: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Excitation:
    """The best motion of a search.

    Attributes
    ----------
    model : GeneratedModel
    motion : Motion
    condition : float
        Of W_w on the rows of the identification.
    relative_sigma : dict
        Predicted %sigma by name.
    starts : tuple of Start
        All of them, by number.
    margin : float
        Share of the limits kept free at the points of the grid, as it had to be.
    settings : ExcitationSettings
    limits : MotionLimits
    known : Known
        Parameters that the search stands on.
    """

    model: GeneratedModel
    motion: Motion
    condition: float
    relative_sigma: dict[str, float]
    starts: tuple[Start, ...]
    margin: float
    settings: ExcitationSettings
    limits: MotionLimits
    known: Known

    def sampled(self) -> tuple[Array, Array, Array, Array, Array]:
        """t, shape (N,), and q, qd, qdd, tau, shape (N, n), at the controller rate."""
        t, q, qd, qdd = self.motion.sampled(self.settings.rate)
        return t, q, qd, qdd, self.model.inverse_dynamics(q, qd, qdd, self.known.X)

    def to_csv(self) -> str:
        """t, q1 ..., qd1 ..., qdd1 ... at the controller rate, SI: a reference that `simulate` reads."""
        t, q, qd, qdd, _ = self.sampled()
        return csv_text(t, q=q, qd=qd, qdd=qdd)

    @property
    def usage(self) -> dict[str, list[float]]:
        """Largest share of each limit that the motion uses, by quantity and joint."""
        return usage(self.model, self.motion, self.limits, self.settings.rate, self.known.X)

    @property
    def worse(self) -> dict[str, float]:
        """Parameters that the motion of the record tells better, by name, with the ratio of predicted %sigma to that of the record, largest first."""
        before = self.known.relative_sigma
        ratios = {name: sigma / before[name] for name, sigma in self.relative_sigma.items() if before.get(name, 0.0) > 0}
        return dict(sorted(((name, ratio) for name, ratio in ratios.items() if ratio > 1), key=lambda item: -item[1]))

    @property
    def comparison(self) -> str:
        """The motion beside that of the record, parameter by parameter, a sentence; "" without record."""
        before, worse = self.known.relative_sigma, self.worse
        if not before:
            return ""
        if not worse:
            return f" It tells each of these {len(before)} parameters better than the motion of the record."
        named = ", ".join(f"{name} {self.relative_sigma[name]:.2g} % (record {before[name]:.2g} %)" for name in list(worse)[:NAMED])
        more = f" and {len(worse) - NAMED} more" if len(worse) > NAMED else ""
        return f" It tells {len(before) - len(worse)} of {len(before)} parameters better than the motion of the record, and WORSE: {named}{more}."

    @property
    def torques(self) -> str:
        """What is not limited, a sentence; "" where every torque is."""
        free = [str(j) for j, limit in zip(self.model.JOINTS, self.limits.tau, strict=True) if not np.isfinite(limit)]
        if not free:
            return ""
        largest = np.abs(self.sampled()[-1]).max(axis=0)
        values = ", ".join(f"{x:.3g}" for x in largest)
        return f" Torque limits of joint {', '.join(free)} are unknown and were not kept: it asks for up to {values}; compare with the data sheet (limits: {{tau: [...]}})."

    @property
    def verdict(self) -> str:
        """Condition, the least certain parameter, where the motion of the record is better, and limits that are unknown."""
        of_record = "" if self.known.condition is None else f" (motion of the record: {self.known.condition:.1f})"
        worst = max(self.relative_sigma, key=self.relative_sigma.__getitem__)
        kept = "all limits" if np.isfinite(self.limits.tau).all() else "the limits of position, velocity and acceleration"
        return (
            f"A motion of {self.motion.duration:.1f} s within {kept} with weighted cond(W) {self.condition:.1f}{of_record}; "
            f"least certain is {worst} with a predicted %sigma of {self.relative_sigma[worst]:.2g}.{self.comparison}{self.torques}"
        )

    def summary(self) -> dict[str, Any]:
        """Everything as JSON values: excitation.json."""
        return {
            "robot": self.model.NAME,
            "parameters_from": self.known.source,
            "duration": self.motion.duration,
            "cond": self.condition,
            "cond_of_record": self.known.condition,
            "relative_sigma": self.relative_sigma,
            "relative_sigma_of_record": self.known.relative_sigma,
            "worse_than_record": self.worse,
            "torque_sigma": self.known.weights.s.tolist(),
            "limits_used": self.usage,
            "margin": self.margin,
            "starts": [{"number": s.number, "criterion": s.criterion, "violation": s.violation, "message": s.message} for s in self.starts],
            "settings": to_mapping(self.settings),
        }

    def sigma_table(self, most: int | None = None) -> Table:
        """Predicted %sigma, the least certain parameters first, beside that of the motion of the record; the first `most` of them."""
        before = self.known.relative_sigma
        worst = sorted(self.relative_sigma.items(), key=lambda item: -item[1])[:most]
        rows = [(name, f"{value:.3g}", *((f"{before[name]:.3g}",) if before else ())) for name, value in worst]
        note = f"Parameters and torque deviations: {self.known.source}. Torque noise is taken as white at the sampling rate; model error is not."
        return Table("Predicted %sigma", ("parameter", "this motion", *(("motion of the record",) if before else ())), rows, note)

    def usage_table(self) -> Table:
        """Share of the limits used, by quantity and joint."""
        rows = [(what, *(f"{100 * x:.1f}" for x in shares)) for what, shares in self.usage.items()]
        note = "At the controller rate. 100 is the limit; the optimiser keeps a margin."
        return Table("Share of the limits used, %", ("", *(f"joint {j}" for j in self.model.JOINTS)), rows, note)

    def starts_table(self) -> Table:
        """How every start ended."""
        rows = [(str(s.number), f"{s.criterion:.4g}", f"{s.violation:.1e}", s.message) for s in self.starts]
        return Table("Starts", ("start", "criterion", "violation", "end"), rows)

    def to_table(self) -> str:
        """Verdict, the least certain parameters, how far the limits are used."""
        return "\n\n".join(
            [self.verdict, *(f"{table.caption}\n{table.to_text()}" for table in (self.sigma_table(LISTED), self.usage_table()))]
        )

    def __str__(self) -> str:
        return self.to_table()


def excite(
    model: GeneratedModel,
    records: Record | Sequence[Record] = (),
    study: Study | None = None,
    *,
    symbolic: str | Path | ModuleType | None = None,
    workers: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Excitation:
    """The motion of smallest criterion over all starts of study.excitation, within the limits at the controller rate.

    Parameters
    ----------
    model : GeneratedModel
    records : Record or sequence of Record
        Their estimate gives parameters and deviations of the torques; without records, the values of the robot file serve.
    study : Study, optional
        Families, limits, criterion, filters and rows; default: Study().
    symbolic : str, Path or module, optional
        CasADi model of the same robot; default: the file beside that of `model`.
    workers : int
        Processes, 0 for this one; results do not depend on it.
    progress : callable, optional
        Called after each start with the number done and their total.

    Raises
    ------
    InputError
        No start keeps the limits, with the limit that was missed most; or the parameters are known neither from a record nor from the robot file.
    """
    study = study or Study()
    settings = study.excitation or ExcitationSettings()
    known = _known(model, (records,) if isinstance(records, Record) else tuple(records), study, settings)
    limits, weights = limits_of(model, settings.limits), known.weights
    if settings.criterion == "record" and not known.relative_sigma:
        raise InputError("criterion: record compares with the motion of a record; give one, or ask for cond, logdet or sigma")
    if settings.criterion == "auto":
        settings = replace(settings, criterion="record" if known.relative_sigma else "cond")
    if settings.criterion == "record":  # a column in units of its deviation by the record
        before = np.array([known.relative_sigma[name] for name in weights.names])
        weights = replace(weights, size=weights.size * np.maximum(before, 1e-3 * before.max()) / 100)
    require(model, "inverse_dynamics")
    path = str(getattr(symbolic, "__file__", symbolic) or casadi_path(model))
    problem = Problem(path, settings, weights, limits, known.X, dry_friction(model).smooth)
    starts = []
    for start in results(one_start, problem, range(settings.starts), workers):
        starts.append(start)
        if progress is not None:
            progress(len(starts), settings.starts)
    starts.sort(key=lambda s: s.number)
    kept = sorted((s for s in starts if s.violation <= TOLERATED), key=lambda s: s.criterion)
    if not kept:
        least = min(starts, key=lambda s: s.violation)
        raise InputError(
            f"no motion within the limits in {settings.starts} starts; the closest misses a limit by {least.violation:.2g} of it "
            f"({least.message}). Widen the limits, lengthen the parts, ask for fewer harmonics or points, or free `begin`"
        )
    candidates = []
    for motion, margin in _within(model, problem, kept[:BEST]):
        observation = planned(model, motion, study, settings.rate)
        candidates.append((criterion_of(weights, observation, settings.criterion), motion, margin, observation))
    if not candidates:
        exceeded = excesses(model, motion_from_mapping(kept[0].motion), limits, settings, known.X)
        raise InputError(
            f"between the points of the grid {'; '.join(map(str, exceeded[:3]))}, also with twice and four times the margin; "
            f"raise `grid` ({settings.grid:g} Hz)"
        )
    _, motion, margin, observation = min(candidates, key=lambda candidate: candidate[0])
    sigma = _relative_sigma(known.weights, observation, study, settings.rate)
    return Excitation(model, motion, known.weights.condition(observation), sigma, tuple(starts), margin, settings, limits, known)


def _within(model: GeneratedModel, problem: Problem, starts: Sequence[Start]) -> Iterator[tuple[Motion, float]]:
    """Motions of the starts within the limits at the controller rate, with the margin that took; none of a start where wider ones do not help."""
    for start in starts:
        settings = problem.settings
        for _ in range(WIDENINGS + 1):
            motion = motion_from_mapping(start.motion)
            if start.violation <= TOLERATED and not excesses(model, motion, problem.limits, settings, problem.X):
                yield motion, settings.margin
                break
            settings = replace(settings, margin=max(2 * settings.margin, 0.01))
            start = improved(replace(problem, settings=settings), start.number, motion)


def _known(model: GeneratedModel, records: Sequence[Record], study: Study, settings: ExcitationSettings) -> Known:
    """From records: estimate, deviations, essential parameters, condition and %sigma. Without: the values of the robot file."""
    if not records:
        X = parameters_of(model)
        return Known(X, "values of the robot file", weights_of(model, settings, dict(zip(model.BASE_PARAMETERS, X, strict=True))))
    observation = observe(model, records, study)
    linear = replace(study.estimate, method="ols", weights="none", options={}, columns="all")
    fit = estimate_of(observation, linear, model=model)
    if fit.status == "rank-deficient":
        raise InputError(
            f"the record does not determine {', '.join(' '.join(group) for group in fit.groups)}; leave it out, or name columns"
        )
    names = essential_of(observation, study.essential, linear).names
    deviations = [joint.sigma_rho for joint in fit.per_joint]
    weights = weights_of(model, settings, dict(zip(fit.names, fit.X, strict=True)), essential=names, s=deviations)
    sigma = _relative_sigma(weights, observation, study, records[0].rate)
    return Known(fit.X, f"estimate of {', '.join(record.name for record in records)}", weights, weights.condition(observation), sigma)


def _relative_sigma(weights: Weights, observation: Any, study: Study, rate: float) -> dict[str, float]:
    sigma = weights.relative_sigma(observation, kept_correlation(study.signals, rate))
    return dict(zip(weights.names, map(float, sigma), strict=True))
