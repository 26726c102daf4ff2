"""Feasible least squares: the parameters nearest to the record that a physical robot can have.

    min ||R (z - K chi)||^2 + weight D(chi)      subject to  P_j(chi) >= margin 1, forms >= margin 1, Ia, FV, FS >= margin, limits
    X = K chi                                    R z = Q'Y, W = Q R

W is factored once and b rows enter the semidefinite program (`runtime.estimators.semidefinite`); the conditions are those of `runtime.model.inertia`. All base
parameters are fitted, essential or not: a condition ties every parameter of a link. With the columns of some parameters alone, the others
are free to make a robot of them. `weights` weighs the rows as for ols ("none") and wls. Where least squares is feasible, it is the solution.

options (all of `runtime.estimators.feasibility.RobotLimits` too):
    margin     smallest eigenvalue of every condition, SI; 1e-6
    prior      none | euclidean | entropic | pullback: distance D of the inertial parameters from the values of the robot file
    weight     of D, a number; "auto": the largest, to half a decade, that raises the residual norm by at most 1 %; "held-out": that by which
               the two halves of the record in time predict each other best
    bootstrap  resampled records (blocks of time) behind `sigma_corrected`, 0 for none; seed
    linear     options of the least squares behind it: rank_tolerance, block

sigma and covariance are those of least squares without conditions, eq. (10): the theory of estimates on the boundary of a cone has no such
formula. `sigma_corrected` is the scatter of the bootstrap, conditions included. A parameter held by an active condition is told by `details`.

`fitted` takes any R and z: the feasible form of instrumental variables has R = L^-1 Z'V W and z' = L^-1 Z'V Y, L L' = Z'V Z.

Reference: Sousa and Cortesao (2014); Wensing, Kim and Slotine (2018); Lee, Wensing and Park (2020) for the distances.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, field, replace
from typing import Any, Literal

import numpy as np

from runtime.errors import InputError
from runtime.estimators import wls
from runtime.estimators.block_covariance import drawn_again, gram_root
from runtime.estimators.estimate import Estimate
from runtime.estimators.feasibility import RobotLimits, feasibility, limit_rows, nearest_standard, pulled, scales, unsolved
from runtime.estimators.linear import System, assemble
from runtime.estimators.semidefinite import Distance, LinearBounds, Optimum, closest, everything
from runtime.model.generated import GeneratedModel
from runtime.model.inertia import PhysicalModel, physical_model
from runtime.observation.qr_factor import Array, Factor, factor
from runtime.observation.system import Observation
from runtime.settings.schema import NotNegative, Positive, Resamples, Seed, require, structure
from runtime.settings.study import EstimateSettings

INCREASE = 1.01  # of the residual norm that weight: auto allows
WEIGHTS = 10.0 ** np.arange(0.0, -9.5, -0.5)
ACTIVE = 2.0  # a condition within this factor of the margin is active


class FeasibleOptions(RobotLimits):
    """estimate.options of method feasible; those of `RobotLimits` too.

    Attributes
    ----------
    margin : float, SI
        Smallest eigenvalue of every condition.
    prior : str
        Distance D of the inertial parameters from the values of the robot file: none, euclidean, entropic or pullback.
    weight : float or str
        Weight of D; auto: the largest, to half a decade, that raises the residual norm by at most 1 %; held-out: that by which the two
        halves of the record in time predict each other best.
    bootstrap : int
        Resampled records (blocks of time) behind `sigma_corrected`; 0: none.
    seed : int
        Seed of the bootstrap.
    linear : mapping
        Options of the least squares that starts the method: rank_tolerance, block.
    """

    margin: Positive = 1e-6
    prior: Distance = "none"
    weight: NotNegative | Literal["auto", "held-out"] = "auto"
    bootstrap: Resamples = 30
    seed: Seed = 1
    linear: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        message = f"{self.weight} without prior; set prior: euclidean, entropic or pullback"
        require(self.prior != "none" or isinstance(self.weight, str), message, "weight")


def feasible(
    observation: Observation,
    settings: EstimateSettings,
    *,
    model: GeneratedModel | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Estimate:
    """The feasible Estimate; `details` holds the standard parameters, the smallest eigenvalues, and what least squares gave."""
    if model is None:
        raise InputError("method feasible needs the model: it knows which parameters belong to one link")
    options = structure(FeasibleOptions, settings.options, ("estimate", "options"))
    physical = physical_model(model)
    system = wls.least_squares(observation, settings, options.linear)
    free = system.solve()
    unconstrained = feasibility(physical, system.names, free.X, options)
    if unconstrained.feasible and unconstrained.margin >= options.margin and options.prior == "none":
        X, chi, weight = free.X, unconstrained.chi, 0.0
    else:
        fixed = (
            replace(options, weight=held_out_weight(observation, system, physical, options)) if options.weight == "held-out" else options
        )
        chi, weight = weighed(system.weighted, physical, fixed)
        X = physical.rows(system.names) @ chi
    if weight == 0:  # nothing was pulled: chi is one of many
        chi = nearest_standard(physical, system.names, X, chi, options)
    fit = replace(free, X=X, residual_norm=residual_norm(system.weighted, X))
    estimate = assemble(replace(system, settings=settings), fit, model=model, provenance=provenance)
    smallest = physical.smallest(chi)
    active = [name for name, value in smallest.items() if value < ACTIVE * options.margin]
    without = assemble(system, free, model=model)
    details = {
        "standard": physical.named(chi),
        "smallest_eigenvalues": smallest,
        "active": active,
        "options": asdict(options),
        "weight": weight,
        "least_squares": {
            "method": system.settings.method,
            "feasible": unconstrained.feasible,
            "margin": unconstrained.margin,
            "blocking": [{"condition": name, "margin": t} for name, t in unconstrained.blocking],
            "relative_error": without.relative_error,
            "residual_norm": without.residual_norm,
            "X": without.X,
        },
    }
    message = " ".join(part for part in (estimate.message, difference_text(system, unconstrained.text, active, estimate, without)) if part)
    if min(smallest.values()) < 0:
        estimate = replace(estimate, status="not-converged")
        message += " The solver left a condition violated: try another margin, a prior, or bounds on the masses."
    scatter = bootstrapped(observation, system, physical, options, weight) if options.bootstrap else estimate.sigma_corrected
    return replace(estimate, message=message, details=details, sigma_corrected=scatter)


def weighed(rows: Factor, physical: PhysicalModel, options: FeasibleOptions) -> tuple[Array, float]:
    """chi of a factored system, and the weight of D."""
    K = physical.rows(rows.names)
    size = float(np.hypot(np.linalg.norm(rows.r12), rows.r22)) or 1.0

    def at(weight: float) -> Array:
        return fitted(rows.R11 @ K / size, rows.r12 / size, physical, options, weight)

    if options.prior == "none":
        return at(0.0), 0.0
    if not isinstance(options.weight, str):
        return at(options.weight), options.weight
    allowed = INCREASE * residual_norm(rows, K @ at(0.0))
    for weight in WEIGHTS:
        chi = at(float(weight))
        if residual_norm(rows, K @ chi) <= allowed:
            return chi, float(weight)
    return at(0.0), 0.0


def held_out_weight(observation: Observation, system: System, physical: PhysicalModel, options: FeasibleOptions) -> float:
    """The weight of D by which the halves of the record predict each other best."""
    if options.prior == "none":
        return 0.0
    middle = float(np.median(observation.t))
    late = observation.t > middle
    halves = [part_factor(observation.where(mask), system) for mask in (~late, late)]
    K = physical.rows(system.names)

    def error(weight: float) -> float:
        fixed = replace(options, weight=weight)
        fits = [weighed(half, physical, fixed)[0] for half in halves]
        return float(np.hypot(residual_norm(halves[1], K @ fits[0]), residual_norm(halves[0], K @ fits[1])))

    return min(map(float, (*WEIGHTS, 0.0)), key=error)


def part_factor(part: Observation, system: System) -> Factor:
    """Factor of some rows with the weights of the joints in the whole."""
    chosen = part.columns(system.names)
    return factor(chosen.W, chosen.Y, chosen.rows, chosen.names).weighted(1 / np.array(system.scales))


def fitted(R: Array, z: Array, physical: PhysicalModel, options: FeasibleOptions, weight: float = 0.0) -> Array:
    """chi, shape (p,), of min ||R chi - z||^2 + weight D(chi) under the conditions; R (m, p), z (m,), ||z|| about 1."""
    rows, space = limit_rows(physical, options), everything(scales(physical))
    pull = pulled(physical, options.prior, weight)

    def attempt(within: LinearBounds) -> Optimum:
        return closest(R, z, physical.conditions, within, space, least=options.margin, pull=pull)

    optimum = attempt(rows)
    if not optimum.solved:
        raise InputError(unsolved(optimum.status, rows, attempt))
    return optimum.chi


def residual_norm(rows: Factor, X: Array) -> float:
    """||Y - W X|| of a factored system."""
    return float(np.hypot(rows.r22, np.linalg.norm(rows.R11 @ X - rows.r12)))


def bootstrapped(observation: Observation, system: System, physical: PhysicalModel, options: FeasibleOptions, weight: float) -> Array:
    """Deviation of X, shape (b,), over records of resampled blocks of time; weights of the joints stay."""
    fixed = options if options.prior == "none" else replace(options, weight=weight)
    K, names = physical.rows(system.names), system.names

    def estimator(gram: Array) -> Array:
        return np.asarray(K @ weighed(Factor(names, gram_root(gram), ()), physical, fixed)[0])

    blocks = observation.block_rows(names, 1 / np.array(system.scales), observation.residual_block, system.whitener)
    return np.asarray(np.std(drawn_again(blocks, estimator, options.bootstrap, options.seed), axis=0, ddof=1))


def difference_text(system: System, answer: str, active: list[str], estimate: Estimate, without: Estimate) -> str:
    """What the conditions changed, in words."""
    return (
        f"Least squares ({system.settings.method}) is {answer}. With the conditions the relative error is {estimate.relative_error:.3f} % "
        f"instead of {without.relative_error:.3f} %; at their limit: {', '.join(active) or 'none'}."
    )
