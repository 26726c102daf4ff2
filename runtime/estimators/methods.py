"""Methods of estimation by the name that `estimate.method` of a study gives them, one file each.

A new method is a file with a function of type Estimator, and a line in METHODS.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from runtime.errors import InputError, SettingsError
from runtime.estimators import cloe, didim, feasible, irls, iv, ols, tls, wls
from runtime.estimators.closed_loop import LoopSimulator, closed_loop
from runtime.estimators.estimate import Estimate
from runtime.estimators.linear import System, assemble
from runtime.model.generated import GeneratedModel
from runtime.observation.observation import observe
from runtime.observation.position_errors import with_errors
from runtime.observation.segments import Window
from runtime.observation.system import Observation, stack
from runtime.parallel import Workers
from runtime.records.record import Record
from runtime.records.stream import Stream
from runtime.settings.study import EstimateSettings, Study


class Estimator(Protocol):
    """An estimation method."""

    def __call__(
        self, observation: Observation, settings: EstimateSettings, *, model: GeneratedModel | None, provenance: Mapping[str, Any] | None
    ) -> Estimate:
        """The Estimate of one observation."""


@dataclass(frozen=True)
class Method:
    """One method of estimation.

    Attributes
    ----------
    estimator : Estimator
        The method.
    system : callable or None
        The weighted rows, of a method that is one least-squares problem in them; it needs no single row.
    closed_loop : bool
        Whether it simulates the closed loop of the records.
    resamples : bool
        Whether its deviations come from resampled records (option `bootstrap`).
    """

    estimator: Estimator
    system: Callable[[Observation, EstimateSettings], System] | None = None
    closed_loop: bool = False
    resamples: bool = False


def solved(
    observation: Observation, settings: EstimateSettings, *, model: GeneratedModel | None, provenance: Mapping[str, Any] | None
) -> Estimate:
    """The Estimate of a method that is one linear system."""
    system = linear_system(observation, settings)
    return assemble(system, system.solve(), model=model, provenance=provenance)


METHODS: Mapping[str, Method] = {
    "ols": Method(solved, ols.system),  # ordinary least squares
    "wls": Method(solved, wls.system),  # least squares weighted by joint
    "irls": Method(irls.irls),  # robust least squares, Huber or Tukey
    "tls": Method(tls.tls, resamples=True),  # total least squares with exact columns
    "iv": Method(iv.iv, closed_loop=True),  # instrumental variables of the simulated closed loop
    "didim": Method(didim.didim, closed_loop=True),  # torques on the regressor of the simulated motion
    "cloe": Method(cloe.cloe, closed_loop=True),  # output error of the closed loop, position or torque
    "feasible": Method(feasible.feasible, resamples=True),  # least squares among physical robots
}
LINEAR = tuple(name for name, method in METHODS.items() if method.system)
"""Methods that are one least-squares problem in the rows of the observation."""
CLOSED_LOOP = tuple(name for name, method in METHODS.items() if method.closed_loop)
"""Methods that simulate the closed loop of the records."""


def estimate(
    model: GeneratedModel,
    records: Record | Stream | Sequence[Record | Stream] | Observation,
    study: Study | None = None,
    *,
    simulator: LoopSimulator | None = None,
) -> Estimate:
    """All parameters of records, or of their Observation, by the method of the study.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    records : Record, Stream, a sequence of them, or Observation
        Joint side, SI.
    study : Study, optional
        Settings; default: Study().
    simulator : LoopSimulator, optional
        Closed loop of iv, didim and cloe; default: that of study.controller.

    Returns
    -------
    Estimate
        X, deviations, rank and fit by joint, in SI units.

    Raises
    ------
    InputError
        Records that give no row.
    SettingsError
        A method that needs what the study or the records lack.
    """
    study = study or Study()
    if not isinstance(records, Observation):
        records = observed(model, records, study, simulator=simulator or simulator_of(model, study))
    return estimate_of(records, study.estimate, model=model)


def estimate_of(
    observation: Observation,
    settings: EstimateSettings | None = None,
    *,
    model: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Estimate:
    """Parameters of Y = W X + rho by the method that `settings` names.

    Parameters
    ----------
    observation : Observation
        Rows held; of a linear method, or reduced.
    settings : EstimateSettings, optional
        Method, weights, columns, options; default: ols.
    model : GeneratedModel, optional
        Gives units, joint numbers and the hash of the robot file.
    provenance : mapping, optional
        Further entries for Estimate.provenance (a seed, the study file).
    """
    settings = settings or EstimateSettings()
    method = method_of(settings)
    if method.system is None:
        observation.require_rows(settings.method)
    return method.estimator(observation, settings, model=model, provenance=provenance)


def method_of(settings: EstimateSettings) -> Method:
    """The method that `settings` names."""
    if settings.method not in METHODS:
        raise SettingsError(f"{settings.method!r}; expected {' or '.join(METHODS)}", path=("estimate", "method"))
    return METHODS[settings.method]


def linear_system(observation: Observation, settings: EstimateSettings) -> System:
    """The factored rows as the method of `settings` weighs them; SettingsError for a method that is not one linear system."""
    system = method_of(settings).system
    if system is None:
        raise SettingsError(f"{settings.method!r} is not one linear system; expected {' or '.join(LINEAR)}", path=("estimate", "method"))
    return system(observation, settings)


def linear_companion(settings: EstimateSettings) -> EstimateSettings:
    """The settings themselves where their method is one linear system; else least squares with the same weights and columns.

    Essential parameters and weak directions of such a method are those of its companion.
    """
    if settings.method in LINEAR:
        return settings
    return EstimateSettings("ols" if settings.weights == "none" else "wls", settings.weights, settings.columns)


def point_estimate(settings: EstimateSettings) -> EstimateSettings:
    """The settings of an estimate whose deviations nobody reads: without resampling."""
    brief = {"bootstrap": 0, **({"explain": False} if settings.method == "feasible" else {})}
    return replace(settings, options={**settings.options, **brief}) if method_of(settings).resamples else settings


def observed(
    model: GeneratedModel,
    records: Record | Stream | Sequence[Record | Stream],
    study: Study,
    *,
    windows: Sequence[Window] | None = None,
    simulator: LoopSimulator | None = None,
    workers: int | Workers = 1,
) -> Observation:
    """The Observation that the method of the study needs: with errors of its columns for tls, with the closed loop for those that simulate it.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    records : Record, Stream, or a sequence of them
        Joint side, SI.
    study : Study
        Settings.
    windows, workers
        As in `runtime.observation.observation.observe`.
    simulator : LoopSimulator, optional
        Closed loop that made the records.
    """
    settings, several = study.estimate, list(records) if isinstance(records, Sequence) else [records]
    for record in several:
        if record.n != len(model.JOINTS):
            message = f"{record.n} joints; {model.NAME} has {len(model.JOINTS)}: a record of another robot, or of some of its joints"
            raise InputError(message, file=", ".join(record.files) or record.name)
    whole = [record for record in several if isinstance(record, Record)]
    method = method_of(settings)
    if len(whole) < len(several) and (simulator is not None or settings.method == "tls"):
        raise SettingsError(f"{settings.method} needs records in memory, not by blocks; set stream: off", path=("estimate", "method"))
    if simulator is not None:
        asked = {key: settings.options[key] for key in ("reference", "around") if key in settings.options}
        return closed_loop(model, whole, study, simulator, **asked).measured()
    if settings.method == "tls":
        error = tls.tls_options(settings).position_error
        return stack([with_errors(model, record, study, observe(model, record, study), error) for record in whole])
    needed_by = "weights: covariance" if settings.weights == "covariance" else "" if method.system else settings.method
    return observe(model, several, study, windows=windows, needed_by=needed_by, workers=workers)


def simulator_of(model: GeneratedModel, study: Study) -> LoopSimulator | None:
    """The closed loop of study.controller where the method of the study simulates one; else None."""
    if study.controller is None or not method_of(study.estimate).closed_loop:
        return None
    from runtime.motion.simulation import Simulator  # CasADi, for these methods alone

    return Simulator(model, study.controller)
