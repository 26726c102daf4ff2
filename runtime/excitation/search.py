"""Search for an exciting motion from random starts, and predict the precision of the best motion.

    excitation = excite(model, record, study)         # section `excitation` of the study
    excitation.verdict, excitation.relative_sigma     # predicted %sigma of every parameter
    t, q, qd, qdd, tau = excitation.sampled()

The margin at the points of the optimiser's grid (`runtime.excitation.optimiser`) is enlarged until
the motion keeps the limits at the controller rate. Every figure of the result is computed from the
rows that the identification will use, with the exact sign(qd).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from runtime.core.essential import essential_of
from runtime.core.least_squares.linear import assemble
from runtime.core.least_squares.wls import weighted_system
from runtime.core.model import (
    GeneratedModel,
    base_columns,
    require,
    require_no_axes,
    require_no_channels,
)
from runtime.core.problem import Problem, observe_rows
from runtime.core.rows.predicted import Weights, kept_correlation
from runtime.core.study import Study
from runtime.excitation.criteria import criterion_of, excesses, limits_of, plan_rows, weights_of
from runtime.excitation.optimiser import Search, improve, one_start
from runtime.excitation.result import Excitation, Known, Start
from runtime.excitation.settings import ExcitationSettings
from runtime.ground.errors import InputError
from runtime.ground.limits import limits
from runtime.loop.control_law import parameters_of
from runtime.loop.dry_friction import dry_friction
from runtime.loop.trajectories import Motion, motion_from_mapping

LIMIT = limits(__package__)


def excite(
    problem: Problem,
    *,
    map: Callable[..., Iterable[Any]] = map,
    progress: Callable[[int, int], None] | None = None,
) -> Excitation:
    """Search for the motion of best criterion within the limits at every sample of the controller.

    The search runs from all starts of study.excitation.

    Parameters
    ----------
    problem : Problem
        Prepared problem. The estimate from its records gives the parameters and the standard
        deviations of the torques; without records, the values of the robot file are used.
    map : callable, optional
        Function like the built-in `map`, such as `runtime.parallel.processes.processes`; results do
        not depend on it.
    progress : callable, optional
        Function called after each start with the number of starts done and their total.

    Raises
    ------
    InputError
        No start keeps the limits (the message gives the largest violation of the best start); or
        the parameters are known neither from a record nor from the robot file.
    """
    model = problem.model
    study: Any = problem.settings
    require_no_channels(model, "the search for a motion")
    require_no_axes(model, "the search for a motion")
    problem.require_motion("the search for a motion (poses: excitation: {poses: N})")
    settings = study.excitation or ExcitationSettings()
    limits = limits_of(model, settings.limits, problem.records)
    known = _known_estimate(problem, settings)
    weights = known.weights
    if settings.criterion == "record" and not known.relative_sigma:
        raise InputError(
            "criterion: record compares with the motion of a record, but no record is given; give "
            "a record, or set criterion: cond, logdet or sigma"
        )
    if settings.criterion == "auto":
        settings = replace(settings, criterion="record" if known.relative_sigma else "cond")
    if settings.criterion == "record":  # a column in units of its deviation by the record
        before = np.array([known.relative_sigma[name] for name in weights.names])
        weights = replace(
            weights, size=weights.size * np.maximum(before, 1e-3 * before.max()) / 100
        )
    require(model, "inverse_dynamics", "casadi")
    smooth = dry_friction(model).smooth
    search = Search(model, settings, weights, limits, known.X, smooth)
    starts = []
    for start in map(partial(one_start, search), range(settings.starts)):
        starts.append(start)
        if progress is not None:
            progress(len(starts), settings.starts)
    starts.sort(key=lambda s: s.number)
    kept = sorted(
        (s for s in starts if s.violation <= LIMIT.GRID_VIOLATION), key=lambda s: s.criterion
    )
    if not kept:
        least = min(starts, key=lambda s: s.violation)
        raise InputError(
            f"none of {settings.starts} starts gave a motion within the limits; the best one exceeds "
            f"a limit by {100 * least.violation:.2g} % ({least.message}). Widen the limits, make the "
            "parts of the motion longer, use fewer harmonics or points, or remove the start "
            "positions (the setting `begin`)"
        )
    candidates = []
    for motion, margin in _within(model, search, kept[: LIMIT.STARTS_COMPARED]):
        observation = plan_rows(problem, motion, settings.rate)
        candidates.append(
            (criterion_of(weights, observation, settings.criterion), motion, margin, observation)
        )
    if not candidates:
        exceeded = excesses(model, motion_from_mapping(kept[0].motion), limits, settings, known.X)
        raise InputError(
            "the best motions exceed a limit between the points of the time grid, also with "
            f"larger safety margins: {'; '.join(map(str, exceeded[:3]))}. Raise the rate of this "
            f"grid, the setting `grid`, which is {settings.grid:g} Hz"
        )
    _, motion, margin, observation = min(candidates, key=lambda candidate: candidate[0])
    sigma = _relative_sigma(known.weights, observation, study, settings.rate)
    return Excitation(
        model,
        motion,
        known.weights.condition(observation),
        sigma,
        tuple(starts),
        margin,
        settings,
        limits,
        known,
    )


def _within(
    model: GeneratedModel, search: Search, starts: Sequence[Start]
) -> Iterator[tuple[Motion, float]]:
    """Yield motions within the limits at every controller sample, each with its safety margin.

    If a motion exceeds a limit between grid points, it is optimised again with twice the margin, a
    few times. A start that still exceeds a limit yields nothing.
    """
    for start in starts:
        settings = search.settings
        for _ in range(LIMIT.MARGIN_DOUBLINGS + 1):
            motion = motion_from_mapping(start.motion)
            if start.violation <= LIMIT.GRID_VIOLATION and not excesses(
                model, motion, search.limits, settings, search.X
            ):
                yield motion, settings.margin
                break
            settings = replace(settings, margin=max(2 * settings.margin, 0.01))
            start = improve(replace(search, settings=settings), start.number, motion)


def _known_estimate(problem: Problem, settings: ExcitationSettings) -> Known:
    """Collect parameter values X for the search, and the precision that recorded motions give.

    The values come from an estimate with the records; without records, they are those of the robot
    file.
    """
    model, records, study = problem.model, problem.records, problem.settings
    if not records:
        X = parameters_of(model)
        values = dict(zip(model.BASE_PARAMETERS, X, strict=True))
        fitted = study.estimate.columns
        kept = model.BASE_PARAMETERS if fitted == "all" else fitted
        judged, bare = _with_values(model, settings, values, kept)
        weights = weights_of(model, judged, values, essential=kept)
        return Known(X, "values of the robot file", weights, without_values=bare)
    observation = observe_rows(problem)
    system = weighted_system(observation)
    fit = assemble(system, system.solve(), model=model, corrected=False)
    if fit.status == "rank-deficient":
        raise InputError(
            f"the record does not determine {', '.join(' '.join(group) for group in fit.groups)}; "
            "remove this record from the study, or use a record that determines these parameters"
        )
    names = essential_of(system, study.essential).names
    deviations = [joint.sigma_rho for joint in fit.per_joint]
    weights = weights_of(
        model, settings, dict(zip(fit.names, fit.X, strict=True)), essential=names, s=deviations
    )
    sigma = _relative_sigma(weights, observation, study, records[0].rate)
    return Known(
        fit.X,
        f"estimate of {', '.join(record.name for record in records)}",
        weights,
        weights.condition(observation),
        sigma,
    )


def _with_values(
    model: GeneratedModel,
    settings: ExcitationSettings,
    values: Mapping[str, float],
    essential: Sequence[str],
) -> tuple[ExcitationSettings, tuple[str, ...]]:
    """Leave out parameters for whose unit the robot file has no value, such as friction in most
    URDFs.

    A criterion compares parameters by their size. Returns settings that name the other parameters,
    and the names left out. No name is left out if the user names parameters, or if no parameter has
    a value.
    """
    if settings.columns not in ("essential", "all"):
        return settings, ()
    names = base_columns(model, settings.columns, essential, "columns")
    units = dict(getattr(model, "UNITS", {}))
    known = {units.get(name) for name in names if values[name]}
    kept = tuple(name for name in names if units.get(name) in known)
    if not kept:
        return settings, ()
    return replace(settings, columns=kept), tuple(name for name in names if name not in kept)


def _relative_sigma(
    weights: Weights, observation: Any, study: Study, rate: float
) -> dict[str, float]:
    sigma = weights.relative_sigma(observation, kept_correlation(study.signals, rate))
    return dict(zip(weights.names, map(float, sigma), strict=True))
