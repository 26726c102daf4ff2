"""Methods of estimation by the name that `estimate.method` of a study gives them, one file each:
the one list, and the functions that use it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from runtime.errors import InputError, SettingsError
from runtime.estimators import feasible, irls
from runtime.estimators.essential import Essential, essential_of
from runtime.estimators.estimate import Estimate
from runtime.estimators.linear import assemble, ordinary
from runtime.estimators.method import LINEAR, Beginning, Method, linear_companion
from runtime.estimators.wls import by_weights, weighted
from runtime.loop import didim, iv
from runtime.loop.closed_loop import closed_loop, loop_of
from runtime.loop.fixed_point import FixedPointOptions, full
from runtime.loop.simulated_motion import judged
from runtime.model.generated import GeneratedModel
from runtime.rows.observation import Observation
from runtime.rows.observe import observe
from runtime.rows.prepared import Source, prepared, record_of, resolved
from runtime.settings.study import EstimateSettings, Study

if TYPE_CHECKING:
    from runtime.loop.simulation import Simulator

METHODS: Mapping[str, Method] = {
    **LINEAR,
    # robust least squares, Huber or Tukey
    "irls": Method(irls.IrlsOptions, weighted, irls.fit, weights=("none",)),
    # instrumental variables of the simulated closed loop
    "iv": Method(FixedPointOptions, ordinary, iv.fit, closed_loop=True),
    # torques on the regressor of the simulated motion
    "didim": Method(FixedPointOptions, ordinary, didim.fit, closed_loop=True),
    # least squares among physical robots
    "feasible": Method(
        feasible.FeasibleOptions,
        by_weights,
        feasible.fit,
        brief={"explain": False},
        any_rank=True,
    ),
}
CLOSED_LOOP = tuple(name for name, method in METHODS.items() if method.closed_loop)
"""Methods that simulate the closed loop of the records."""


def estimate(
    model: GeneratedModel,
    records: Source | Sequence[Source] | Observation,
    study: Study | None = None,
) -> Estimate:
    """All parameters of records, or of their Observation, by the method of the study.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    records : Record, Prepared, a sequence of them, or Observation
        Joint side, SI.
    study : Study, optional
        Settings; default: Study().

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
        records = observed(model, records, study, simulator=simulator_of(model, study))
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
        Rows of the records.
    settings : EstimateSettings, optional
        Method, weights, columns, options; default: ols.
    model : GeneratedModel, optional
        Gives units, joint numbers and the hash of the robot file.
    provenance : mapping, optional
        Further entries for Estimate.provenance (a seed, the study file).
    """
    settings = settings or EstimateSettings()
    method = method_of(settings)
    system = method.system(observation, settings)
    solution = system.solve()
    if method.fit is None or (solution.rank < len(system.names) and not method.any_rank):
        return assemble(system, solution, model=model, provenance=provenance)
    rows, options = observation.columns(system.names), method.checked(settings)
    fitted = method.fit(Beginning(rows, settings, options, system, solution, model))
    estimate = assemble(fitted.system, fitted.solution, model=model, provenance=provenance)
    status, notes, details = fitted.status, [estimate.message, fitted.message], fitted.details
    if method.closed_loop:
        loop = loop_of(rows, settings.method)
        X = full(system.names, estimate.X, loop.model.BASE_PARAMETERS)
        apart, note, motion = judged(loop, rows, X)
        status, notes = apart if status == "ok" else status, [*notes, note]
        details = {**details, **motion}
    C = estimate.covariance if fitted.covariance is None else fitted.covariance
    return replace(
        estimate,
        covariance=C,
        sigma=estimate.sigma if fitted.covariance is None else np.sqrt(np.diag(C)),
        sigma_corrected=estimate.sigma_corrected if fitted.corrected is None else fitted.corrected,
        status=status if estimate.status == "ok" else estimate.status,
        message=" ".join(note for note in notes if note),
        details=details,
    )


def essential(
    model: GeneratedModel,
    records: Source | Sequence[Source] | Observation,
    study: Study | None = None,
) -> Essential:
    """Essential parameters of records, or of their Observation, by the method of the study or its
    linear companion.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    records : Record, Prepared, a sequence of them, or Observation
        Joint side, SI.
    study : Study, optional
        Settings; default: Study().
    """
    study = study or Study()
    if not isinstance(records, Observation):
        records = observed(model, records, study, simulator=simulator_of(model, study))
    return essential_of(records, study.essential, linear_companion(study.estimate), model=model)


def method_of(settings: EstimateSettings) -> Method:
    """The method that `settings` names."""
    if settings.method not in METHODS:
        raise SettingsError(
            f"{settings.method!r}; expected {' or '.join(METHODS)}", path=("estimate", "method")
        )
    return METHODS[settings.method]


def point_estimate(settings: EstimateSettings) -> EstimateSettings:
    """The settings of an estimate whose deviations and explanations nobody reads."""
    brief = method_of(settings).brief
    return replace(settings, options={**settings.options, **brief}) if brief else settings


def observed(
    model: GeneratedModel,
    records: Source | Sequence[Source],
    study: Study,
    *,
    simulator: Simulator | None = None,
) -> Observation:
    """The Observation that the method of the study needs: with the closed loop for those that
    simulate it.

    Parameters
    ----------
    model : GeneratedModel
        Emitted module.
    records : Record, Prepared, or a sequence of them
        Joint side, SI.
    study : Study
        Settings.
    simulator : Simulator, optional
        Closed loop that made the records.
    """
    several = list(records) if isinstance(records, Sequence) else [records]
    study, settings = resolved(study, several)[0], study.estimate
    for record in map(record_of, several):
        if record.n != len(model.JOINTS):
            message = (
                f"{record.n} joints; {model.NAME} has {len(model.JOINTS)}: a record of "
                "another robot, or of some of its joints"
            )
            raise InputError(message, file=record.file)
    own = [prepared(model, record, study) for record in several]
    if simulator is not None:
        asked = {
            key: settings.options[key] for key in ("reference", "around") if key in settings.options
        }
        return closed_loop(model, own, study, simulator, **asked).measured()
    return observe(model, own, study)


def simulator_of(model: GeneratedModel, study: Study) -> Simulator | None:
    """The closed loop of study.controller where the method of the study simulates one; else
    None.
    """
    if study.controller is None or not method_of(study.estimate).closed_loop:
        return None
    from runtime.loop.simulation import Simulator  # CasADi, for these methods alone

    return Simulator(model, study.controller)
